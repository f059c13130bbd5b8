"""Files of others: traces, drives, labels, networks, archives, latencies, device profiles."""

from __future__ import annotations

import random
from collections.abc import Callable
from functools import partial
from pathlib import Path

from genie_sim.base.errors import UserError
from genie_sim.base.import_report import ImportReport
from genie_sim.data import fetch
from genie_sim.data.detectors.detector import DetectorSettings
from genie_sim.data.kitti.drive import open_drive, read_image
from genie_sim.data.kitti.drive_name import DriveName
from genie_sim.data.kitti.drive_truth import label_file
from genie_sim.data.kitti.tracking_labels import tracking_labels
from genie_sim.data.kitti.tracking_sequence import open_sequence
from genie_sim.data.kitti.tracklets import tracklets
from genie_sim.data.trace import read_trace, write_trace
from genie_sim.scenario import device_fit
from genie_sim.scenario.profiles import load_profile
from tests.checkout import REPOSITORY
from tests.data.archives import archive
from tests.data.tracking_files import CALIBRATION, CAR, OXTS
from tests.kitti_folder import DATE, make_drive, make_network
from tests.made_up_networks import make_nanodet, make_yolov8
from tests.make import trace
from tools.fuzz.harness import Case, Target
from tools.fuzz.mutation import broken, changed
from tools.make.published import tracking_trace


def with_one_broken(folder: Path, read: Callable[[], object], patterns: str = "*") -> Case:
    """Breaks one file of a folder, reads, and mends it again."""
    whole = {path: path.read_bytes() for path in sorted(folder.rglob(patterns)) if path.is_file()}

    def case(rng: random.Random) -> None:
        path = rng.choice(list(whole))
        try:
            path.write_bytes(broken(whole[path], rng))
            read()
        finally:
            path.write_bytes(whole[path])

    return case


def one_file(path: Path, whole: bytes, read: Callable[[Path], object]) -> Case:
    """Breaks one file."""

    def case(rng: random.Random) -> None:
        path.write_bytes(broken(whole, rng))
        read(path)

    return case


def drive(folder: Path) -> Case:
    sync = make_drive(folder, frames=2)
    pose = (
        "<item>"
        + "".join(f"<{n}>1</{n}>" for n in ("tx", "ty", "tz", "rz", "occlusion", "truncation"))
        + "</item>"
    )
    (sync / "tracklet_labels.xml").write_text(
        "<b><tracklets><item><objectType>Car</objectType><h>1.5</h><w>2</w><l>4</l><first_frame>0</first_frame>"
        f"<poses>{pose * 2}</poses></item></tracklets></b>"
    )

    def read() -> None:
        opened = open_drive(folder, f"{DATE}/0005")
        for frame in opened.frames["02"]:
            opened.scan(frame.index)
            read_image(frame.image_path)
        tracklets(label_file(folder, DriveName(DATE, "0005")))

    return with_one_broken(folder, read)


def tracking(folder: Path) -> Case:
    files = {
        "training/oxts/0003.txt": (OXTS + "\n") * 3,
        "training/calib/0003.txt": CALIBRATION,
        "training/label_02/0003.txt": (
            "0 7 Car 0 0 -1.5 500 170 600 230 1.5 1.6 3.9 -2.0 1.6 20.0 -1.6\n" * 3
        ),
        "detections/pointrcnn_Car/0003.txt": CAR.format(frame=0, logit=5.0) * 3,
        "detections/pointrcnn_Pedestrian/0003.txt": "",
        "detections/rrc_Car/0003.txt": "1,500.0,170.0,600.0,230.0,0.9\n" * 3,
        "detections/rrc_Pedestrian/0003.txt": "",
    }
    for name, content in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(content)

    def labels() -> None:
        drive = open_sequence(folder / "training", "0003")
        tracking_labels(folder / "training" / "label_02" / "0003.txt", drive)

    def read() -> None:
        refused = None
        reads = (
            partial(tracking_trace, folder, "0003"),
            partial(tracking_trace, folder, "0003", "rrc"),
            labels,
        )
        for each in reads:
            try:
                each()
            except UserError as error:
                refused = error
        if refused is not None:
            raise refused

    return with_one_broken(folder, read)


def traces(folder: Path) -> Case:
    write_trace(folder / "whole.parquet", trace())
    return one_file(folder / "broken.parquet", (folder / "whole.parquet").read_bytes(), read_trace)


def networks(folder: Path) -> Case:
    made = {"yolox_nano": make_network, "nanodet_m": make_nanodet, "yolov8": make_yolov8}
    cases = []
    for name, make in made.items():
        whole = make(folder / f"{name}.onnx").read_bytes()
        read = partial(_open_detector, name)
        cases.append(one_file(folder / f"broken_{name}.onnx", whole, read))
    return lambda rng: rng.choice(cases)(rng)


def _open_detector(name: str, weights: Path) -> object:
    return DetectorSettings(name, weights).opened()


NAMES = (
    "a/b.txt",
    "c.bin",
    " ",
    "/",
    "..",
    "../x",
    "/x",
    "a/../../x",
    "A/B.TXT",
    "a\0b",
    "x" * 300,
    "a/",
    "~/x",
)


def archives(folder: Path) -> Case:
    """Broken ones, and whole ones with names that nobody should unpack. Nothing may come to lie
    outside.
    """
    whole = archive([("a/b.txt", "text" * 100), ("c.bin", bytes(range(256)) * 8)])
    path, inside = folder / "in" / "broken.zip", folder / "in" / "unpacked"
    path.parent.mkdir()

    def case(rng: random.Random) -> None:
        content = whole
        if rng.random() < 0.3:
            names = rng.sample(NAMES, rng.randint(1, 3))
            content = archive([(name, b"\0" * rng.choice((0, 10, 10**6))) for name in names])
        path.write_bytes(
            content if content is not whole and rng.random() < 0.5 else broken(content, rng)
        )
        try:
            fetch.unpack(path, inside)
        finally:
            assert {one.name for one in folder.iterdir()} == {"in"}
            assert {one.name for one in path.parent.iterdir()} <= {"broken.zip", "unpacked"}

    return case


def latencies(folder: Path) -> Case:
    whole = b"model,latency_ms\n" + b"yolo,12.5\nyolo,13.25\n" * 15
    return one_file(
        folder / "broken.csv",
        whole,
        lambda path: device_fit.from_table(path, "yolo", ImportReport(path)),
    )


def profiles(folder: Path) -> Case:
    """The text broken, or its values changed."""
    import yaml

    texts = [path.read_bytes() for path in sorted((REPOSITORY / "device_profiles").glob("*.yaml"))]
    trees = [yaml.safe_load(text) for text in texts]
    path = folder / "device.yaml"

    def case(rng: random.Random) -> None:
        if rng.random() < 0.5:
            path.write_bytes(broken(rng.choice(texts), rng))
        else:
            path.write_text(yaml.safe_dump(changed(rng.choice(trees), rng), allow_unicode=True))
        load_profile(path)

    return case


TARGETS = (
    Target("KITTI drives", 200, drive),
    Target("tracking sequences", 200, tracking),
    Target("traces", 250, traces),
    Target("networks", 100, networks),
    Target("archives", 160, archives),
    Target("latencies", 60, latencies),
    Target("device profiles", 130, profiles),
)
