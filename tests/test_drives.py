"""The claims on other drives: made-up runs with known answers, and real sequences of the tracking benchmark."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path

import pandas as pd
import pytest

from genie_sim.cli import main
from genie_sim.errors import UserError
from genie_sim.paper import drives
from genie_sim.paper.checks import load_claims
from genie_sim.paper.drives import DIRECTIONS, FACTS, SCENARIOS, DriveJob, Driven
from genie_sim.paper.reproduce import reproduce

REPOSITORY = Path(__file__).resolve().parent.parent


def drive(sequence, **more):
    """Both runs of one drive: all facts 0.5, but for ``more``, named with ``__`` before the role."""
    facts = dict.fromkeys(FACTS, 0.5) | {name.replace("__", ":"): value for name, value in more.items()}
    return [Driven(sequence, scenario, 20.0, dict(facts)) for scenario in SCENARIOS]


def found(*driven):
    return {one["says"]: one for one in drives.directions([run for runs in driven for run in runs])}


def test_every_direction_is_that_of_a_claim():
    known = {claim.id for claim in load_claims()}
    assert {direction.claim for direction in DIRECTIONS} <= known
    assert len({direction.says for direction in DIRECTIONS}) == len(DIRECTIONS)


def test_a_claim_holds_on_some_drives_and_not_on_others():
    one = found(
        drive("0001", image_reuse__car=0.1, image_reuse__edge=0.3),
        drive("0002", image_reuse__car=0.4, image_reuse__edge=0.3),
        drive("0003", image_reuse__car=0.1, image_reuse__edge=0.6),
    )["image reuse, remote - local"]
    assert (one["holds"], one["drives"], one["claim"]) == (2, 3, "C18")
    assert (one["median"], one["low"], one["high"]) == (0.2, -0.1, 0.5)
    assert one["numbers"] == {"0001": 0.2, "0002": -0.1, "0003": 0.5}


def test_both_scenarios_must_hold():
    runs = drive("0001", confidence_boost__car=0.1, confidence_boost__edge=0.2)
    runs[1].facts["confidence_boost:edge"] = 0.05
    one = found(runs)
    assert one["confidence boost, remote - local"]["holds"] == 0
    assert one["confidence boost, heterogeneous - homogeneous"]["median"] == pytest.approx(-0.075)


def test_a_drive_without_images_to_reuse_has_no_ratio():
    empty = drive("0001", image_reuse__car=0.0, image_reuse__edge=0.0)
    one = found(empty, drive("0002", object_reuse__car=0.9, object_reuse__edge=0.7))
    ratio = one["object reuse / image reuse (the paper: 4)"]
    assert (ratio["drives"], ratio["holds"], ratio["median"]) == (1, 1, 1.6)
    unknown = found(drive("0001", under_deadline_share__genie=math.nan))["share of frames answered in 33 ms"]
    assert (unknown["drives"], unknown["median"]) == (0, None)


def test_what_is_written(tmp_path):
    (tmp_path / "verdicts.md").write_text("# What of the paper holds here\n")
    driven = [*drive("0001"), *drive("0002", confidence_boost__car=math.nan)]
    table = drives.write(tmp_path, driven)
    with (tmp_path / "drives.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [(row["sequence"], row["scenario"]) for row in rows] == [(n, s) for n in ("0001", "0002") for s in SCENARIOS]
    assert (rows[0]["confidence_boost:car"], rows[2]["confidence_boost:car"]) == ("0.5", "")
    assert json.loads((tmp_path / "drives.json").read_text()) == drives.directions(driven)
    document = (tmp_path / "verdicts.md").read_text()
    assert document.startswith("# What of the paper holds here")
    assert document.endswith(f"{table}\n")
    assert "2 sequences" in document
    assert "| C26 | smallest confidence boost | > 0 | 0.5 (0.5 to 0.5) | 1 of 1 |" in table


def test_without_sequences_nothing_is_simulated(tmp_path, monkeypatch, capsys):
    def simulated(*_):
        raise AssertionError("it was")

    monkeypatch.setattr("genie_sim.paper.reproduce.run_jobs", simulated)
    monkeypatch.delenv("GENIE_SIM_KITTI", raising=False)
    assert main(["reproduce", "--quick", "--drives", "--out", "out"]) == 1
    assert capsys.readouterr().err.startswith("genie-sim: drives: set GENIE_SIM_KITTI to KITTI's folder")
    monkeypatch.setenv("GENIE_SIM_KITTI", str(tmp_path))
    with pytest.raises(UserError, match="tracking: no sequences of KITTI's tracking benchmark here"):
        reproduce(tmp_path / "out", quick=True, with_drives=True)


@pytest.mark.real_data
@pytest.mark.parametrize("sequence", ["0000", "0014"])
def test_cars_drive_the_declared_parts_of_a_real_sequence(kitti_root, sequence):
    prepared = drives.prepare_drive(DriveJob(kitti_root / "tracking", sequence, "3car_hetero"))
    frames = prepared.drives["car1"].frames["02"]
    assert {camera.recording for camera in prepared.scenario.cameras} == {"02"}
    whole_ns = len(frames) * 100_000_000
    windows = [[t / whole_ns for t in car.route.window_ns] for car in prepared.scenario.cars]
    assert windows == [pytest.approx(window, abs=1e-3) for window in ([0.0, 0.6], [0.2, 0.8], [0.4, 1.0])]


@pytest.mark.real_data
def test_a_real_sequence_gives_every_number(kitti_root):
    """The shortest sequence. Latencies follow from the devices, so they are as on any drive."""
    driven = [drives.run_drive(DriveJob(kitti_root / "tracking", "0014", scenario)) for scenario in SCENARIOS]
    assert all(not math.isnan(run.facts[name]) for run in driven for name in FACTS)
    one = found(driven)
    assert all(direction["drives"] == 1 for direction in one.values())
    assert one["smallest of these, first answer"]["holds"] == 1
    assert one["share of frames answered in 33 ms"]["median"] == pytest.approx(1.0, abs=0.01)


@pytest.mark.real_data
@pytest.mark.parametrize("sequence", ["0003", "0016"])
def test_a_sequence_becomes_a_trace_that_a_scenario_drives(kitti_root, sequence, run_cli, tmp_path):
    """A drive on which no place is seen twice, and one on which the car stands: its pictures answer each other."""
    made = run_cli(
        "perceive", "--kitti", str(kitti_root), "--drive", f"tracking/{sequence}", "--detector", "pointrcnn",
        "--out", "drive.parquet",
    )  # fmt: skip
    assert made.returncode == 0, made.stderr
    stream = "cameras=[{name: front, recording: '02'}]"
    windows = [f"cars[{i}].route.window=[0 s, 9 s]" for i in range(1)]
    settings = [part for one in (stream, "perception.trace=drive.parquet", *windows) for part in ("--set", one)]
    done = run_cli("run", "1car_homo", *settings, "--no-report", "--out", "results")
    assert done.returncode == 0, done.stderr
    (folder,) = (tmp_path / "results").iterdir()
    measured = json.loads((folder / "metrics.json").read_text())
    metrics = {(one["metric"], one["placement"]): one["value"] for one in measured}
    frames = pd.read_parquet(folder / "frames.parquet")
    assert len(frames[frames["method"] == "genie"]) == 90
    reuse = metrics["image_reuse", "car"]
    assert reuse < 0.1 if sequence == "0003" else reuse > 0.5


@pytest.mark.real_data
@pytest.mark.slow
def test_the_documented_table_is_that_of_all_sequences(kitti_root, monkeypatch):
    monkeypatch.setenv("GENIE_SIM_KITTI", str(kitti_root))
    driven = drives.run_drives(drives.jobs(), 2)
    table = drives.markdown(drives.directions(driven))
    assert table in (REPOSITORY / "docs" / "paper.md").read_text(encoding="utf-8"), table
