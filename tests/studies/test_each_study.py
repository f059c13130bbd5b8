"""Each study goes from its first line to its table, on seconds of made-up drives with two seeds."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

import genie_sim as gs
from genie_sim.cli.main import main
from studies import baselines, drives, keep, pace, where_it_pays
from tests.checkout import REPOSITORY
from tests.data.tracking_files import CALIBRATION, CAR

pytestmark = pytest.mark.usefixtures("without_figures")

FRAMES = 12
DRIVES = ("0003", "0005", "0006")
LABEL = "{frame} 7 Car 0 0 -1.5 500 170 600 230 1.5 1.6 3.9 -2.0 1.6 20.0 -1.6\n"
WHERE = "{latitude:.7f} 8.4 112.0 " + "0 " * 27


@pytest.fixture(autouse=True)
def tracking(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Sequences of KITTI's benchmark on which one car stands before a camera, which is faster on
    each.
    """
    root = tmp_path / "kitti"
    for number, name in enumerate(DRIVES):
        latitudes = [49 + 1e-6 * (1 + 4 * number) * frame for frame in range(FRAMES)]
        files = {
            "training/oxts": "\n".join(WHERE.format(latitude=latitude) for latitude in latitudes),
            "training/calib": CALIBRATION,
            "training/label_02": "".join(LABEL.format(frame=frame) for frame in range(FRAMES)),
            "detections/pointrcnn_Car": "".join(
                CAR.format(frame=frame, logit=5.0) for frame in range(FRAMES)
            ),
            "detections/pointrcnn_Pedestrian": "",
        }
        for folder, text in files.items():
            path = root / "tracking" / folder / f"{name}.txt"
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
    monkeypatch.setenv("GENIE_SIM_KITTI", str(root))
    monkeypatch.setenv("PYTHONPATH", str(REPOSITORY))


@pytest.fixture(autouse=True)
def short_sweeps(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of an axis of conditions one of each town and two of each drive, half a second of each."""
    whole: Callable[..., Any] = gs.sweep

    def sweep(scenario: str, axes: Any, settings: Any, *, seeds: Any, **how: Any) -> Any:
        axes = {name: axis | {"list": short(axis["list"])} for name, axis in axes.items()}
        seeds = 1 if isinstance(seeds, int) else tuple(seeds)[:2]
        return whole(scenario, axes, settings, seeds=seeds, jobs=1, **how)

    monkeypatch.setattr(gs, "sweep", sweep)


def short(cases: Any) -> Any:
    """Conditions cut; the cases of another axis as they are."""
    if not isinstance(cases, dict):
        return cases
    replayed = {name: case for name, case in cases.items() if "scenario" not in case}
    towns = {name: case for name, case in cases.items() if "scenario" in case}
    drives = {str(case.get("perception.trace")) for case in replayed.values()}
    of_drive = {
        drive: [
            name for name, case in replayed.items() if str(case.get("perception.trace")) == drive
        ]
        for drive in drives
    }
    kept = {name for names in of_drive.values() for name in names[:2]}
    window = {"cars[*].route.window": ["0 s", "0.5 s"]}
    fleet = {"perception.duration": "0.5 s", "fleet.cars": 4}
    return {name: case | window for name, case in replayed.items() if name in kept} | {
        name: case | fleet for name, case in towns.items()
    }


@pytest.mark.slow
def test_the_study_of_other_drives(monkeypatch: pytest.MonkeyPatch, capsys):
    monkeypatch.setattr(drives, "SEEDS", (2, 3))
    monkeypatch.setattr(sys, "argv", ["drives", "--jobs", "1"])
    drives.main()
    table = capsys.readouterr().out
    assert "| C26 | smallest confidence boost |" in table and "The hypothesis that it" in table
    runs = pd.read_csv("results/drives/runs.csv", dtype={"sequence": str})
    assert sorted(set(runs["sequence"])) == list(DRIVES) and len(runs) == 12
    monkeypatch.setattr(sys, "argv", ["drives", "--table"])
    drives.main()
    assert capsys.readouterr().out == table


@pytest.mark.slow
def test_the_study_of_the_pace(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(pace, "SEQUENCES", DRIVES[:1])
    pace.main()
    means = pd.read_csv("results/pace/f1.csv", index_col="drive", dtype={"drive": str})
    assert means.index.tolist() == ["0003", "drive 0005"] and means.columns.tolist() == [
        str(ms) for ms in pace.EVERY_MS
    ]


@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.parametrize("start", ["cold", "warm"])
def test_the_study_of_other_caches(start: str, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(baselines, "bytes_of_largest_map", lambda: 94_800)
    monkeypatch.setattr(baselines, "CONSUMERS", {"set": "consumer", "list": ["tracker"]})
    baselines.main(start)
    kept = pd.read_csv(f"results/baselines/{start}.csv")
    assert set(kept["consumer"]) == {"tracker"} and set(kept["n"]) == {1}
    assert {"genie", "genie_free", "oracle", "central"} <= set(kept["method"])
    assert ("lap_f1" in set(kept["metric"])) == (start == "warm")


@pytest.mark.slow
@pytest.mark.nightly
def test_the_study_of_where_it_pays(monkeypatch: pytest.MonkeyPatch):
    usual = tuple((name, *point) for name, point in where_it_pays.USUAL.items())
    monkeypatch.setattr(where_it_pays, "POINTS", usual)
    monkeypatch.setattr(where_it_pays, "DEVELOPMENT", DRIVES[:1])
    monkeypatch.setattr(where_it_pays, "REPORTED", DRIVES[1:])
    monkeypatch.setattr(where_it_pays, "TOWN_SEEDS", (201, 202))
    for step in where_it_pays.STEPS.values():
        step()
    gains = pd.read_csv("results/where_it_pays/reported_gains.csv", index_col="condition")
    assert {"0005, 5G, 86 kB", "town, 5G, tuned to towns", "sequences and towns"} <= {*gains.index}
    assert (gains["low"] <= gains["high"]).all()


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.nightly if name != "failing_edge" else ())
        for name in keep.METRICS
    ],
)
def test_a_shipped_sweep_is_kept_for_its_page(name: str):
    fewer = ["--methods", "local,genie", "--seeds", "1", "--jobs", "1"]
    if name == "shared_uplink":
        fewer += ["--set", "perception.duration=1 s"]
    assert main(["sweep", name, *fewer, "--out", "results/studies"]) == 0
    keep.keep(name)
    points = pd.read_csv(f"results/{name}/points.csv")
    assert set(points["metric"]) == set(keep.METRICS[name]) and {"local", "genie"} <= {
        *points["method"]
    }
