"""Files that somebody broke: a trace, a drive, labels, networks, mutated thousands of times. Only clear errors come."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from kitti_folder import DATE, make_drive, make_network
from made_up_networks import make_nanodet, make_yolov8

from genie_sim import device_fit
from genie_sim.errors import UserError
from genie_sim.perception import fetch
from genie_sim.perception.detector import make_detector
from genie_sim.perception.kitti import open_drive, read_image
from genie_sim.perception.labels import read_tracking_labels, read_tracklets
from genie_sim.perception.trace import read_trace, write_trace
from genie_sim.perception.tracking import tracking_trace

WORDS = [
    b"",
    b"\0",
    b"nan",
    b"-inf",
    b"1e400",
    b"9" * 400,
    b"\xff\xfe",
    b"\n",
    b" ",
    b"-1",
    b"2.5",
    b"x",
    b"<",
    b"\r\n\r\n",
]
SEEDS = st.integers(0, 2**32)


def mutations(number: int) -> settings:
    """So many broken files."""
    return settings(max_examples=number, suppress_health_check=list(HealthCheck), deadline=None)


def mutated(content: bytes, seed: int) -> bytes:
    """One to four changes: bytes flipped, cut out, doubled, put in, or the end cut off."""
    random_ = random.Random(seed)
    data = bytearray(content)
    for _ in range(random_.randint(1, 4)):
        at, length = random_.randint(0, len(data)), random_.randint(1, 40)
        what = random_.randrange(6)
        if what == 0 and data:
            data[at % len(data)] ^= 1 << random_.randrange(8)
        elif what == 1:
            del data[at : at + length]
        elif what == 2:
            data[at:at] = data[at : at + length]
        elif what == 3:
            data[at : at + length] = random_.choice(WORDS)
        elif what == 4:
            data[at:at] = random_.choice(WORDS)
        else:
            del data[at:]
    return bytes(data)


def only_clear_errors(read: Callable[[], object]) -> None:
    """Either it reads, or one line says why not. Any other exception is a bug and fails the test."""
    try:
        read()
    except UserError as error:
        assert "\n" not in str(error)


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    root = tmp_path_factory.mktemp("drive")
    folder = make_drive(root, frames=2)
    pose = "<item>" + "".join(f"<{n}>1</{n}>" for n in ("tx", "ty", "tz", "rz", "occlusion", "truncation")) + "</item>"
    (folder / "tracklet_labels.xml").write_text(
        "<b><tracklets><item><objectType>Car</objectType><h>1.5</h><w>2</w><l>4</l><first_frame>0</first_frame>"
        f"<poses>{pose * 2}</poses></item></tracklets></b>"
    )
    return root


def read_all(root: Path) -> None:
    opened = open_drive(root, f"{DATE}/0005")
    for frame in opened.frames["02"]:
        opened.scan(frame.index)
        read_image(frame.image_path)
    read_tracklets(root, f"{DATE}/0005")


SYNC = f"{DATE}/{DATE}_drive_0005_sync"


@pytest.mark.parametrize(
    "name",
    [
        f"{DATE}/calib_cam_to_cam.txt", f"{DATE}/calib_imu_to_velo.txt", f"{DATE}/calib_velo_to_cam.txt",
        f"{SYNC}/oxts/data/0000000001.txt", f"{SYNC}/oxts/timestamps.txt", f"{SYNC}/image_02/timestamps.txt",
        f"{SYNC}/image_02/data/0000000001.png", f"{SYNC}/velodyne_points/data/0000000001.bin",
        f"{SYNC}/tracklet_labels.xml",
    ],
)  # fmt: skip
@mutations(150)
@given(SEEDS)
def test_a_drive_with_one_broken_file(drive, name, seed):
    path = drive / name
    whole = path.read_bytes()
    try:
        path.write_bytes(mutated(whole, seed))
        only_clear_errors(lambda: read_all(drive))
    finally:
        path.write_bytes(whole)


@pytest.fixture(scope="module")
def training(tmp_path_factory):
    from test_perception_tracking import CALIBRATION, CAR, OXTS

    root = tmp_path_factory.mktemp("tracking")
    files = {
        "training/oxts/0003.txt": (OXTS + "\n") * 3,
        "training/calib/0003.txt": CALIBRATION,
        "training/label_02/0003.txt": "0 7 Car 0 0 -1.5 500 170 600 230 1.5 1.6 3.9 -2.0 1.6 20.0 -1.6\n" * 3,
        "detections/pointrcnn_Car/0003.txt": CAR.format(frame=0, logit=5.0) * 3,
        "detections/pointrcnn_Pedestrian/0003.txt": "",
        "detections/rrc_Car/0003.txt": "1,500.0,170.0,600.0,230.0,0.9\n" * 3,
        "detections/rrc_Pedestrian/0003.txt": "",
    }
    for name, content in files.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(content)
    return root


@pytest.mark.parametrize(
    "name",
    ["training/oxts", "training/calib", "training/label_02", "detections/pointrcnn_Car", "detections/rrc_Car"],
)
@mutations(200)
@given(SEEDS)
def test_a_tracking_sequence_with_one_broken_file(training, name, seed):
    path = training / name / "0003.txt"
    whole = path.read_bytes()
    try:
        path.write_bytes(mutated(whole, seed))
        only_clear_errors(lambda: tracking_trace(training, "0003"))
        only_clear_errors(lambda: tracking_trace(training, "0003", "rrc"))
        only_clear_errors(lambda: read_tracking_labels(training / "training", "0003"))
    finally:
        path.write_bytes(whole)


@mutations(800)
@given(SEEDS)
def test_a_broken_trace(tmp_path_factory, seed):
    folder = tmp_path_factory.getbasetemp()
    whole = folder / "whole.parquet"
    if not whole.exists():
        from test_trace import trace

        write_trace(whole, trace())
    broken = folder / "broken.parquet"
    broken.write_bytes(mutated(whole.read_bytes(), seed))
    only_clear_errors(lambda: read_trace(broken))


@pytest.mark.parametrize(
    ("name", "make"), [("yolox_nano", make_network), ("nanodet_m", make_nanodet), ("yolov8", make_yolov8)]
)
@mutations(150)
@given(SEEDS)
def test_a_broken_network(tmp_path_factory, name, make, seed):
    folder = tmp_path_factory.getbasetemp()
    whole = folder / f"{name}.onnx"
    if not whole.exists():
        make(whole)
    broken = folder / f"broken_{name}.onnx"
    broken.write_bytes(mutated(whole.read_bytes(), seed))
    only_clear_errors(lambda: make_detector(name, broken))


@mutations(500)
@given(SEEDS)
def test_a_broken_archive(tmp_path_factory, seed):
    from test_fetch import archive

    folder = tmp_path_factory.getbasetemp()
    broken = folder / "broken.zip"
    broken.write_bytes(mutated(archive([("a/b.txt", "text" * 100), ("c.bin", bytes(range(256)) * 8)]), seed))
    only_clear_errors(lambda: fetch.unpack(broken, folder / "unpacked"))
    inside = {path.name for path in folder.iterdir()}
    assert not {"b.txt", "c.bin"} & inside


@mutations(500)
@given(SEEDS)
def test_broken_latencies(tmp_path_factory, seed):
    broken = tmp_path_factory.getbasetemp() / "broken.csv"
    broken.write_bytes(mutated(b"model,latency_ms\n" + b"yolo,12.5\nyolo,13.25\n" * 15, seed))
    only_clear_errors(lambda: device_fit.from_csv(broken, "yolo"))
