"""The claims on other drives: made-up runs with known answers, and real sequences of the tracking
benchmark.
"""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path

import pandas as pd
import pytest

from genie_sim.cli import main
from genie_sim.errors import UserError
from genie_sim.messages import CameraPose
from genie_sim.paper import drives
from genie_sim.paper.checks import load_claims
from genie_sim.paper.drives import DIRECTIONS, FACTS, SAME_CELL, SCENARIOS, SEEDS, DriveRun
from genie_sim.paper.reproduce import reproduce
from genie_sim.perception.trace import Trace, TraceFrame
from genie_sim.scenario.scenario import load_scenario
from genie_sim.study.parts import Parts
from tests.perception.test_tracking_labels import CALIBRATION

REPOSITORY = Path(__file__).resolve().parents[2]


def drive(sequence, *seeds, same_cell=0.5, **more):
    """The runs of one drive, with two seeds unless ``seeds`` says of each what differs: all facts
    0.5, but for ``more``, named with ``__`` before the role.
    """
    of_seeds = seeds or ({}, {})
    return [
        {"sequence": sequence, "scenario": scenario, "seed": seed, "drive_s": 20.0}
        | (dict.fromkeys(map(str, FACTS), 0.5) | {str(SAME_CELL): same_cell} | named(more | mine))
        for scenario in SCENARIOS
        for seed, mine in enumerate(of_seeds)
    ]


def named(facts):
    return {name.replace("__", ":"): value for name, value in facts.items()}


def found(*driven):
    return {one["says"]: one for one in drives.directions([run for runs in driven for run in runs])}


def test_every_direction_is_that_of_a_claim_or_beside_the_paper():
    known = {claim.id for claim in load_claims()}
    assert {direction.claim for direction in DIRECTIONS} - {""} <= known
    assert len({direction.says for direction in DIRECTIONS}) == len(DIRECTIONS)


def test_a_claim_holds_on_some_drives_and_not_on_others():
    one = found(
        drive("0001", image_reuse__car=0.1, image_reuse__edge=0.3),
        drive("0002", image_reuse__car=0.4, image_reuse__edge=0.3),
        drive("0003", image_reuse__car=0.1, image_reuse__edge=0.9),
    )["image reuse, remote - local"]
    assert (one["holds"], one["contrary"], one["drives"], one["claim"]) == (2, 1, 3, "C18")
    assert (one["median"], one["low"], one["high"]) == (0.2, -0.1, 0.8)
    assert one["numbers"] == {"0001": [0.2] * 3, "0002": [-0.1] * 3, "0003": [0.8] * 3}


def test_where_seeds_disagree_a_drive_is_open():
    """Gaps of 0.1, 0.3 and -0.1: a mean above the bound, and an interval on both sides of it."""
    seeds = [{"image_reuse__car": 0.5, "image_reuse__edge": 0.5 + gap} for gap in (0.1, 0.3, -0.1)]
    one = found(drive("0001", *seeds))["image reuse, remote - local"]
    assert (one["holds"], one["contrary"], one["drives"]) == (0, 0, 1)
    half = 4.302653 * 0.2 / math.sqrt(3)
    assert one["numbers"]["0001"] == pytest.approx([0.1, 0.1 - half, 0.1 + half], abs=1e-5)


def test_both_scenarios_must_hold():
    runs = drive("0001", confidence_boost__car=0.1, confidence_boost__edge=0.2)
    for run in runs[2:]:
        run["confidence_boost:edge"] = 0.05
    one = found(runs)
    assert one["confidence boost, remote - local"]["holds"] == 0
    assert one["confidence boost, heterogeneous - homogeneous"]["median"] == pytest.approx(-0.075)


def test_a_drive_without_images_to_reuse_has_no_ratio():
    empty = drive("0001", image_reuse__car=0.0, image_reuse__edge=0.0)
    one = found(empty, drive("0002", object_reuse__car=0.9, object_reuse__edge=0.7))
    ratio = one["object reuse / image reuse (the paper: 4)"]
    assert (ratio["drives"], ratio["holds"], ratio["median"]) == (1, 1, 1.6)
    unknown = found(drive("0001", under_deadline_share__genie=math.nan))[
        "share of frames answered in 33 ms"
    ]
    assert (unknown["drives"], unknown["median"]) == (0, None)


def test_ghosts_of_genie_are_compared_with_those_of_remote_execution():
    one = found(drive("0001", ghost_share__genie=0.8))
    assert one["share of ghosts in what is held, Genie - remote"]["median"] == pytest.approx(0.3)


def gap(sequence, same_cell, number):
    return drive(
        sequence, same_cell=same_cell, image_reuse__car=0.5, image_reuse__edge=0.5 + number
    )


def test_the_hypothesis_is_tested_by_least_squares_over_drives():
    """Four points by hand: slope -4 / 5 with residuals 0.1, -0.1, -0.1, 0.1 around it."""
    points = {"0001": (0.0, 0.5), "0002": (0.5, -0.1), "0003": (1.0, -0.5), "0004": (1.5, -0.7)}
    tested = drives.hypothesis([run for name, at in points.items() for run in gap(name, *at)])
    assert tested["slope"] == pytest.approx(-0.8)
    half = 4.302653 * math.sqrt(0.04 / 2 / 1.25)
    assert (tested["low"], tested["high"]) == pytest.approx((-0.8 - half, -0.8 + half), abs=1e-5)
    assert (tested["n"], tested["supported"]) == (4, True)
    assert tested["r"] == pytest.approx(-0.8 * math.sqrt(1.25 / 0.84), abs=1e-5)
    assert tested["zero_at"] == pytest.approx(0.5)
    assert tested["points"]["0002"] == pytest.approx([0.5, -0.1])


def test_a_slope_that_may_be_zero_supports_nothing():
    points = {"0001": (0.0, 0.0), "0002": (0.5, -0.4), "0003": (1.0, 0.2), "0004": (1.5, -0.3)}
    tested = drives.hypothesis([run for name, at in points.items() for run in gap(name, *at)])
    assert tested["low"] < tested["slope"] < 0 < tested["high"]
    assert not tested["supported"]
    assert drives.hypothesis([*gap("0001", 0.0, 0.1), *gap("0002", 0.5, 0.2)]) is None, (
        "two points are a line"
    )
    assert (
        drives.hypothesis([run for name in ("0001", "0002", "0003") for run in gap(name, 0.5, 0.1)])
        is None
    )


def test_what_is_written(tmp_path):
    (tmp_path / "verdicts.md").write_text("# What of the paper holds here\n")
    driven = [*drive("0001"), *drive("0002", confidence_boost__car=math.nan)]
    table = drives.write(tmp_path, driven)
    with (tmp_path / "drives.csv").open() as file:
        rows = list(csv.DictReader(file))
    runs = [
        (n, scenario, seed)
        for n in ("0001", "0002")
        for scenario in SCENARIOS
        for seed in ("0", "1")
    ]
    assert [(row["sequence"], row["scenario"], row["seed"]) for row in rows] == runs
    assert (rows[0]["confidence_boost:car"], rows[4]["confidence_boost:car"]) == ("0.5", "")
    written = json.loads((tmp_path / "drives.json").read_text())
    assert (written["directions"], written["hypothesis"]) == (drives.directions(driven), None)
    document = (tmp_path / "verdicts.md").read_text()
    assert document.startswith("# What of the paper holds here")
    assert document.endswith(f"{table}\n")
    assert "2 sequences" in document
    assert "| C26 | smallest confidence boost | 0 | 0.5 (0.5 to 0.5) | 1 of 1 | 0 | 0 |" in table
    assert "The hypothesis that it falls is" not in table
    tested = drives.hypothesis([run for i in range(3) for run in gap(str(i), i, 1 - i)])
    told = drives.markdown(written | {"hypothesis": tested})
    assert (
        "slope -1 (-1 to -1), r = -1.00, n = 3, zero at 1.00. The hypothesis that it falls is"
        " supported." in told
    )


def test_without_sequences_nothing_is_simulated(tmp_path, monkeypatch, capsys):
    def simulated(*_):
        raise AssertionError("it was")

    monkeypatch.setattr("genie_sim.paper.runs.run_parts", simulated)
    monkeypatch.delenv("GENIE_SIM_KITTI", raising=False)
    assert main(["reproduce", "--quick", "--drives", "--out", "out"]) == 1
    assert capsys.readouterr().err.startswith(
        "genie-sim: kitti: where are the drives? Name KITTI's folder"
    )
    monkeypatch.setenv("GENIE_SIM_KITTI", str(tmp_path))
    with pytest.raises(
        UserError, match="tracking: no sequences of KITTI's tracking benchmark here"
    ):
        reproduce(tmp_path / "out", quick=True, with_drives=True)


@pytest.mark.parametrize(
    ("steps_m", "headings_rad", "share"),
    [
        ((0.1, 0.5, 0.9, 1.3), (0, 0, 0, 0), 2 / 3),
        ((0.1, 0.1, 0.1), (0.0, 0.0, 1.0), 1 / 2),
        ((0.5, 1.5, 2.5), (0, 0, 0), 0.0),
    ],
)
def test_frames_share_a_cell_where_neither_place_nor_heading_leaves_it(
    steps_m, headings_rad, share
):
    """Cells of 1 m and sectors of 15 degrees, the default."""
    frames = tuple(
        TraceFrame(
            "02",
            i,
            i * 10**8,
            1242,
            375,
            1,
            f"{i}",
            i,
            CameraPose(east_m, 0.0, 0.0, heading),
            1.4,
            (),
        )
        for i, (east_m, heading) in enumerate(zip(steps_m, headings_rad, strict=True))
    )
    trace = Trace("made up", (49.0, 8.4, 100.0), {"02": frames}, {})
    assert drives.same_cell_share(load_scenario("3car_homo"), trace) == pytest.approx(share)


def make_sequences(root, names):
    """Sequences of 40 frames at KITTI's rate, on the day of sequence 0020: a car that drives north
    at 5 m/s, past one that is parked 20 m ahead of it. There are no pictures and no scans.
    """
    training, detections = root / "tracking" / "training", root / "tracking" / "detections"
    for folder in ("oxts", "calib", "label_02"):
        (training / folder).mkdir(parents=True)
    for kind in ("Car", "Pedestrian"):
        (detections / f"pointrcnn_{kind}").mkdir(parents=True)
    for name in names:
        oxts = [f"{49 + 4.5e-6 * i:.8f} 8.4 112 0 0 1.5708 " + "0 " * 24 for i in range(40)]
        (training / "oxts" / f"{name}.txt").write_text("\n".join(oxts))
        (training / "calib" / f"{name}.txt").write_text(CALIBRATION.replace("721.5377", "718.856"))
        z_m = [20.0 - 0.5 * i for i in range(30)]
        label = "{} 7 Car 0 0 -1.5 500 170 600 230 1.5 1.6 3.9 -2.0 1.6 {} -1.6"
        (training / "label_02" / f"{name}.txt").write_text(
            "\n".join(label.format(i, z) for i, z in enumerate(z_m))
        )
        car = "{},2,500.0,170.0,600.0,230.0,8.0,1.5,1.6,3.9,-2.0,1.6,{},-1.6,-1.5"
        found = "\n".join(car.format(i, z) for i, z in enumerate(z_m))
        (detections / "pointrcnn_Car" / f"{name}.txt").write_text(found)
        (detections / "pointrcnn_Pedestrian" / f"{name}.txt").write_text("")


def test_a_bad_sequence_is_left_out_with_a_line_and_the_rest_goes_on(tmp_path, monkeypatch, caplog):
    """0020 is of the day whose pictures are 1241 x 376; of 0004 a file is cut short, 0005 has no
    labels.
    """
    make_sequences(tmp_path, ("0004", "0005", "0020"))
    training = tmp_path / "tracking" / "training"
    (training / "calib" / "0004.txt").write_text("P2: 1 2 3\n")
    (training / "label_02" / "0005.txt").unlink()
    monkeypatch.setenv("GENIE_SIM_KITTI", str(tmp_path))
    jobs = drives.all_runs()
    (line,) = caplog.messages
    assert line.startswith("drives: sequence 0004 is left out: ") and "calib/0004.txt: P2" in line
    assert [(one.sequence, one.scenario, one.seed) for one in jobs] == [
        (sequence, scenario, seed)
        for sequence in ("0005", "0020")
        for scenario in SCENARIOS
        for seed in SEEDS
    ]
    unlabelled, labelled = drives.simulate([jobs[0], jobs[-1]], Parts(tmp_path / "runs"), 1)
    assert math.isnan(unlabelled["ghost_share:genie"])
    assert labelled["ghost_share:genie"] < 1
    assert (
        0
        < labelled["image_reuse:car"]
        == pytest.approx(labelled["image_reuse_pooled:car"], abs=0.03)
    )
    assert labelled[str(SAME_CELL)] == pytest.approx(20 / 39, abs=0.03), (
        "half a metre a frame, cells of one metre"
    )
    (training / "calib" / "0005.txt").unlink()
    (training / "calib" / "0020.txt").unlink()
    drives._recordings.cache_clear()
    with pytest.raises(UserError, match="none of the 3 sequences here can be used"):
        drives.all_runs()


@pytest.mark.real_data
@pytest.mark.parametrize("sequence", ["0000", "0014"])
def test_cars_drive_the_declared_parts_of_a_real_sequence(kitti_root, sequence):
    prepared = DriveRun(kitti_root, sequence, "3car_hetero", 2).prepare()
    frames = prepared.drives["car1"].frames["02"]
    assert {camera.recording for camera in prepared.scenario.cameras} == {"02"}
    whole_ns = len(frames) * 100_000_000
    windows = [[t / whole_ns for t in car.route.window_ns] for car in prepared.scenario.cars]
    assert windows == [
        pytest.approx(window, abs=1e-3) for window in ([0.0, 0.6], [0.2, 0.8], [0.4, 1.0])
    ]


@pytest.mark.real_data
def test_a_real_sequence_gives_every_number(kitti_root, tmp_path):
    """The shortest sequence. Latencies follow from the devices, so they are as on any drive."""
    runs = [DriveRun(kitti_root, "0014", scenario, 2) for scenario in SCENARIOS]
    driven = drives.simulate(runs, Parts(tmp_path), 1)
    assert all(not math.isnan(row[str(fact)]) for row in driven for fact in FACTS)
    one = found(driven)
    assert all(direction["drives"] == 1 for direction in one.values())
    assert one["smallest of these, first answer"]["holds"] == 1
    assert one["share of frames answered in 33 ms"]["median"] == pytest.approx(1.0, abs=0.01)


@pytest.mark.real_data
@pytest.mark.parametrize("sequence", ["0003", "0016"])
def test_a_sequence_becomes_a_trace_that_a_scenario_drives(kitti_root, sequence, run_cli, tmp_path):
    """A drive on which no place is seen twice, and one on which the car stands: its pictures answer
    each other.
    """
    made = run_cli(
        "perceive",
        "--kitti",
        str(kitti_root),
        "--drive",
        f"tracking/{sequence}",
        "--detector",
        "pointrcnn",
        "--out",
        "drive.parquet",
    )
    assert made.returncode == 0, made.stderr
    stream = "cameras=[{name: front, recording: '02'}]"
    windows = [f"cars[{i}].route.window=[0 s, 9 s]" for i in range(1)]
    settings = [
        part
        for one in (stream, "perception.trace=drive.parquet", *windows)
        for part in ("--set", one)
    ]
    done = run_cli("run", "1car_homo", *settings, "--no-report", "--out", "results")
    assert done.returncode == 0, done.stderr
    (folder,) = (tmp_path / "results").iterdir()
    measured = json.loads((folder / "metrics.json").read_text())
    metrics = {(one["metric"], one["placement"]): one["value"] for one in measured}
    frames = pd.read_parquet(folder / "frames.parquet")
    assert len(frames[frames["method"] == "genie"]) == 90
    reuse = metrics["image_reuse", "car"]
    assert reuse < 0.1 if sequence == "0003" else reuse > 0.5


def test_the_committed_drives_are_those_of_the_committed_runs():
    """``genie-sim reproduce --drives --out results/paper`` writes both; docs/paper.md shows them
    (test_reproduce).
    """
    committed = json.loads((REPOSITORY / "results" / "paper" / "drives.json").read_text())
    rows = pd.read_csv(
        REPOSITORY / "results" / "paper" / "drives.csv", dtype={"sequence": str}
    ).to_dict("records")
    assert drives.directions(rows) == committed["directions"]
    assert drives.hypothesis(rows) == committed["hypothesis"]


@pytest.mark.real_data
def test_a_real_sequence_gives_the_committed_numbers(kitti_root, tmp_path):
    """The shortest one: the rows of a seed in ``drives.csv`` come out again."""
    committed = pd.read_csv(
        REPOSITORY / "results" / "paper" / "drives.csv", dtype={"sequence": str}
    )
    run = DriveRun(kitti_root, "0014", "3car_hetero", 3)
    (row,) = drives.simulate([run], Parts(tmp_path), 1)
    mine = committed.query("sequence == '0014' and scenario == '3car_hetero' and seed == 3")
    assert len(mine) == 1
    for name, value in row.items():
        assert mine[name].item() == (
            pytest.approx(value, rel=1e-6) if isinstance(value, float) else value
        ), name
