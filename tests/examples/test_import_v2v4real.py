"""V2V4Real: poses recovered on a made-up street, both cars on one clock, and what is refused."""

from __future__ import annotations

import math
from pathlib import Path

import ego_motion
import import_v2v4real
import numpy as np
import pytest
from import_v2v4real import DETECTIONS, LABELS, imported

from genie_sim.base.errors import UserError
from genie_sim.data.intake import ImportedCar
from genie_sim.data.trace import read_trace
from genie_sim.data.truth import TruthRow, read_truth_table
from genie_sim.runs.folder import run_in_memory
from genie_sim.scenario.reading import load_scenario
from tests.examples import made_up_pair as street

NEAR_M = 0.3


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("v2v4real")
    street.write(root)
    return root


@pytest.fixture(scope="module")
def pair(root: Path) -> dict[str, ImportedCar]:
    return imported(root, "train/0012", partner=street.PARTNER)


def poses(recording: ImportedCar) -> np.ndarray:
    frames = recording.trace.frames["sensor"]
    return np.array([(f.pose.east_m, f.pose.north_m, f.pose.heading_rad) for f in frames])


def apart_m(recording: ImportedCar, index: int, place: tuple[float, float]) -> float:
    """From a place to the nearest detection in a frame."""
    frame = recording.trace.frames["sensor"][index]
    return min(math.dist(d.location[:2], place) for d in frame.detections if d.location)


def test_the_poses_of_both_cars_are_recovered(pair: dict[str, ImportedCar]):
    times_s = np.arange(street.FRAMES) / 10
    for car, real in (("ego", street.ego_pose), ("cav1", street.partner_pose)):
        expected = np.array([real(t_s) for t_s in times_s])
        error = poses(pair[car]) - expected
        assert np.hypot(error[:, 0], error[:, 1]).max() < (0.15 if car == "ego" else NEAR_M)
        limit_deg = 0.5
        assert np.degrees(np.abs(np.unwrap(error[:, 2]))).max() < limit_deg
    assert 0 < pair["ego"].trace.provenance["scatter_m"] < 0.2


def test_two_objects_are_enough_to_find_where_the_car_is():
    seen = np.array([[10.0, 0.0], [10.0, 20.0]])
    place = np.array([5.0, -2.0])
    assert ego_motion._consensus(seen, seen + place, place) == pytest.approx([5, -2, 0], abs=1e-9)


def test_left_stays_left(pair: dict[str, ImportedCar]):
    """Objects 3 and 4 stand to the left and to the right of the ego's first pose."""
    for recording in pair.values():
        for item in (3, 4):
            assert apart_m(recording, 0, street.STANDING[item]) < NEAR_M
            east, north = street.STANDING[item]
            assert apart_m(recording, 0, (east, -north)) > 1.0


def test_both_cars_have_one_world_and_one_clock(pair: dict[str, ImportedCar]):
    ego, cav1 = (pair[car].trace for car in ("ego", "cav1"))
    assert ego.sequence == cav1.sequence is not None and ego.origin == cav1.origin
    assert ego.provenance["drive"] == "v2v4real/train/0012"
    for one, other in zip(ego.frames["sensor"], cav1.frames["sensor"], strict=True):
        assert one.stamp_ns == other.stamp_ns == one.index * 100_000_000
    for index in (0, 20, street.FRAMES - 1):
        there = street.places(index / 10)
        for item in (3, 8, *street.MOVING):
            for recording in pair.values():
                assert apart_m(recording, index, there[item][:2]) < NEAR_M, (index, item)


def test_the_truth_of_a_car_has_all_but_itself(pair: dict[str, ImportedCar]):
    for car, other, own in (
        ("ego", street.partner_pose, street.ego_pose),
        ("cav1", street.ego_pose, street.partner_pose),
    ):
        truth = pair[car].truth
        assert len({row.object for row in truth.rows}) == len(street.STANDING) + 4
        assert all(row.visible for row in truth.rows if away_m(row, own(row.stamp_ns / 1e9)) < 39)
        assert {row.label for row in truth.rows} == {"car"}
        rows_of: dict[int, list[bool]] = {}
        for row in truth.rows:
            rows_of.setdefault(row.object, []).append(row.moving)
        # labels wander by a decimetre, so what stands may move for a few frames
        assert sum(sum(rows) > len(rows) / 2 for rows in rows_of.values()) == len(street.MOVING) + 1
        at_3s = [row for row in truth.rows if row.stamp_ns == 3_000_000_000]
        assert min(away_m(row, other(3.0)) for row in at_3s) < NEAR_M
        assert min(away_m(row, own(3.0)) for row in at_3s) > 2.0
        assert truth.range_m == 40.0


def away_m(row: TruthRow, pose: tuple[float, float, float]) -> float:
    return math.dist(row.location[:2], pose[:2])


def test_a_car_does_not_detect_itself(pair: dict[str, ImportedCar]):
    for recording, real in zip(pair.values(), (street.ego_pose, street.partner_pose), strict=True):
        assert apart_m(recording, 10, real(1.0)[:2]) > 2.0
    assert apart_m(pair["cav1"], 10, street.ego_pose(1.0)[:2]) < NEAR_M


def test_the_other_car_is_what_the_ego_sees_and_the_other_never(root: Path):
    assert import_v2v4real.candidates(import_v2v4real.read_files(root, "train/0012")) == [
        street.PARTNER
    ]


def test_traces_span_the_frames_in_which_the_other_car_is_labelled(tmp_path: Path):
    street.write(tmp_path, "val/0001", cut=7)
    pair = imported(tmp_path, "val/0001", partner=street.PARTNER)
    for recording in pair.values():
        frames = recording.trace.frames["sensor"]
        assert (len(frames), frames[0].stamp_ns) == (street.FRAMES - 7, 0)
        assert recording.trace.provenance["frames"] == [7, street.FRAMES - 1]
        assert min(row.stamp_ns for row in recording.truth.rows) == 0
    assert import_v2v4real.longest_run([True, False, True, True, False, True, True]) == (2, 4)


def test_a_frame_at_which_nothing_agrees_is_bridged_and_told():
    frames = [dict(street.STANDING) for _ in range(40)]
    frames[20] = {3: street.STANDING[3]}
    motion = ego_motion.recovered(frames)
    assert (motion.bridged, motion.standing) == (1, 12)
    assert np.isfinite(motion.poses).all()
    assert motion.doubts() == ["1 frames could not be placed (none may be)"]


def test_a_car_among_few_objects_is_told():
    few = {item: place for item, place in street.STANDING.items() if item < 7}
    doubts = ego_motion.recovered([few] * 40).doubts()
    assert doubts == ["4 objects stand (at least 5)"]
    nothing = ego_motion.recovered([{}] * 40)
    assert np.isfinite(nothing.poses).all() and nothing.scatter_m == math.inf
    assert len(nothing.doubts()) == 3


@pytest.mark.slow
def test_one_command_writes_what_a_scenario_takes(root: Path, tmp_path: Path, capsys):
    options = ["--sequence", "train/0012", "--partner", str(street.PARTNER)]
    assert import_v2v4real.main([str(root), *options, "--out", str(tmp_path / "pair")]) == 0
    assert "frames 0 to 59, the other car is label 40" in capsys.readouterr().out
    for car in ("ego", "cav1"):
        trace = read_trace(tmp_path / "pair" / f"{car}.parquet")
        assert read_truth_table(tmp_path / "pair" / f"{car}.truth.parquet").trace == trace.digest
    cars = "".join(
        f"  - {{name: {car}, device: orin_nano, edge: edge,"
        f" route: {{trace: {tmp_path}/pair/{car}.parquet}}}}\n"
        for car in ("ego", "cav1")
    )
    (tmp_path / "pair.yaml").write_text(
        f"perception: {{trace: {tmp_path}/pair/ego.parquet}}\nstart_jitter: 0 s\nmethods: [local]\n"
        "cameras: [{name: lidar, recording: sensor}]\nedges: [{name: edge, device: rtx_a4500}]\n"
        f"cars:\n{cars}"
    )
    run = run_in_memory(load_scenario(str(tmp_path / "pair.yaml")))
    zero_delay = run.held[run.held["what"] == "zero_delay"]
    shares = zero_delay.groupby("car", observed=True)[["right", "held"]].sum()
    assert set(shares.index) == {"ego", "cav1"}
    right = shares["right"] / shares["held"]
    assert (right > 0.98).all(), "but at the end of the range, the street's detector is right"


def replaced(root: Path, path: str, old: str, new: str) -> None:
    file = root / path
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new, 1))


LABEL_FILE = LABELS.format(split="val", number="0001")
EGO_FILE = DETECTIONS.format(split="val", car="ego", number="0001")


@pytest.mark.parametrize(
    ("path", "old", "new", "message"),
    [
        (LABEL_FILE, "1 3 Car", "1 3 Van", r"0001.txt: line 17: type 'Van'"),
        (LABEL_FILE, "1 3 Car", "1 x Car", r"0001.txt: line 17: could not convert"),
        (LABEL_FILE, "1 3 Car", "1 2.5 Car", r"line 17: track '2.5' is no whole number"),
        (LABEL_FILE, "2 3 Car", "0 3 Car", r"line \d+: frame 0 comes after frame 1"),
        (LABEL_FILE, "2 3 Car", "2.5 3 Car", r"line \d+: '2.5' is no frame number"),
        (LABEL_FILE, "2 3 Car", "-2 3 Car", r"line \d+: '-2' is no frame number"),
        (LABEL_FILE, "2 3 Car", "2 3 Car 0", r"line \d+: 18 fields, expected 17"),
        (LABEL_FILE, "2 3 Car 0", "2 3 Car nan", r"line \d+: a number is not finite"),
        (EGO_FILE, "1,2,0,0,0,0,0.", "1,2,0,0,0,0,9.", r"line \d+: score 9.\d+ is not between"),
        (EGO_FILE, "1,2,0,0,0,0,0.", "1,2,0,0,0,0.", r"line \d+: 14 fields, expected 15"),
    ],
)
def test_a_broken_line_is_named(tmp_path: Path, path: str, old: str, new: str, message: str):
    street.write(tmp_path, "val/0001", frames=4)
    replaced(tmp_path, path, old, new)
    with pytest.raises(UserError, match=message) as error:
        imported(tmp_path, "val/0001", partner=street.PARTNER)
    assert str(error.value).startswith(str(tmp_path / path)) and "\n" not in str(error.value)


def test_what_is_missing_or_not_known_is_named(tmp_path: Path):
    street.write(tmp_path, "train/0003", frames=20)
    with pytest.raises(UserError, match=r"--partner; labels that it may be: 40$"):
        imported(tmp_path, "train/0003")
    with pytest.raises(UserError, match=r"train/0003: --partner: there is no label 41"):
        imported(tmp_path, "train/0003", partner=41)
    for wrong in ("test/0003", "0003", "train/../0003", "train/"):
        with pytest.raises(UserError, match="--sequence: must be such as train/0012"):
            imported(tmp_path, wrong)
    with pytest.raises(UserError, match=r"v2v4real_val_label/0003\.txt"):
        imported(tmp_path, "val/0003")
    street.write(tmp_path, "val/0003", frames=20)
    with pytest.raises(UserError, match=r"holds the same bytes as val/0003: take that"):
        imported(tmp_path, "train/0003", partner=40)
    (tmp_path / DETECTIONS.format(split="val", car="1", number="0003")).unlink()
    with pytest.raises(UserError, match=r"Car_val/1/0003\.txt"):
        imported(tmp_path, "val/0003", partner=40)


def test_an_unrecoverable_sequence_is_refused_and_nothing_is_written(tmp_path: Path, capsys):
    street.write(tmp_path, "val/0001", frames=10)
    options = ["--sequence", "val/0001", "--partner", "40", "--out", str(tmp_path / "pair")]
    assert import_v2v4real.main([str(tmp_path), *options]) == 1
    assert not (tmp_path / "pair").exists()
    line = capsys.readouterr().err
    assert line.startswith("import_v2v4real: val/0001: the ego's poses cannot be recovered: ")
    assert "0 objects stand (at least 5)" in line


# Scatter [m] that a prototype found in the real sequences.
@pytest.mark.parametrize(("sequence", "scatter_m"), [("val/0008", 0.09), ("train/0012", 0.24)])
def test_real_sequences_scatter_as_a_prototype_found(
    v2v4real_root: Path, sequence: str, scatter_m: float
):
    pair = imported(v2v4real_root, sequence)
    assert pair["ego"].trace.provenance["scatter_m"] == pytest.approx(scatter_m, rel=0.1)
