"""What a sweep draws and prints."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from genie_sim.cli.main import main
from genie_sim.study.design import load_design
from genie_sim.study.figures import SweepFigures

pytestmark = pytest.mark.slow

TITLES = {"local": "local (L)", "remote": "remote (R)", "genie": "Genie (DG)"}

CROSSED = """
description: DESCRIPTION
scenario: street_2car_homo
set: {"cars[0].route.window": [0 s, 1 s], "cars[1].route.window": [0.5 s, 1.5 s]}
seeds: 1
axes:
  rate: {set: genie.object_map.rate, grid: {from: 0.01, to: 1, points: 2, scale: log}}
  rule: {set: genie.object_map.rule, list: [noisy_or, ema]}
"""

TOWN = """
scenario: fleet_30
set:
  methods: [genie]
  perception.duration: 1 s
  record: [lookups, held]
seeds: 1
samples: 4
axes:
  size: {set: fleet.cars, list: [2, 3]}
  forget:
    set: genie.object_map.forget_after
    latin_hypercube: {from: 100 ms, to: 5000 ms, scale: log}
  mix: {set: fleet.devices, list: [orin_nano, {jetson_tx2: 0.5, orin_nano: 0.5}]}
"""


def swept(text: str, folder: Path, name: str) -> Path:
    """Runs a sweep; returns the folder of its results."""
    file = folder / f"{name}.yaml"
    file.write_text(text, encoding="utf-8")
    assert main(["sweep", str(file), "--out", str(folder), "--jobs", "1"]) == 0
    return folder / name


@pytest.fixture(scope="module")
def town(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return swept(TOWN, tmp_path_factory.mktemp("town"), "town")


@pytest.fixture(scope="module")
def crossed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return swept(CROSSED, tmp_path_factory.mktemp("crossed"), "crossed")


def test_an_unfinished_sweep_has_no_table(crossed, capsys):
    Path("half").mkdir()
    Path("half/sweep.json").write_bytes((crossed / "sweep.json").read_bytes())
    assert main(["table", "half"]) == 1
    Path("half/sweep.json").write_text("{}")
    assert main(["table", "half"]) == 1
    unfinished, foreign = capsys.readouterr().err.splitlines()
    assert "runs.parquet: missing; the sweep is not finished" in unfinished
    assert "sweep.json: cannot be read" in foreign


def test_only_drawn_values_are_averaged_over(crossed, town):
    assert not any(
        "averaged over" in path.read_text() for path in (crossed / "figures").glob("*.svg")
    )
    assert all(
        "averaged over forget" in path.read_text() for path in (town / "figures").glob("size-*.svg")
    )


def test_the_figures_of_a_sweep_in_a_town_show_its_ghosts(town):
    words = "".join(path.read_text() for path in (town / "figures").glob("forget-*.svg"))
    assert "false objects" in words and "size = 3" in words


def test_values_on_an_axis_can_be_read(town):
    """Round numbers on a logarithmic axis, long texts cut as in the page, and no marker at the edge
    of its panel.
    """
    design = load_design(town.parent / "town.yaml")
    runs = pd.read_parquet(town / "runs.parquet")
    figures = SweepFigures(design, runs, TITLES, "")
    drawn = figures.along("forget")
    assert [tick.get_text() for tick in drawn.axes[0].get_xticklabels()] == [
        "200",
        "500",
        "1000",
        "2000",
    ]
    assert drawn.get_label().split("\n")[0].endswith("one seed, so without intervals")
    told = {(panel.get_xlabel(), panel.get_xscale()) for panel in drawn.axes}
    assert told == {("forget [ms]", "log")}
    assert any("fresh result" in panel.get_ylabel() for panel in drawn.axes), (
        "latencies are of those alone"
    )
    mixes = figures.along("mix")
    assert [tick.get_text() for tick in mixes.axes[0].get_xticklabels()] == [
        "orin_nano",
        '{"jetson_tx2": …',
    ]
    for panel in (*drawn.axes, *mixes.axes):
        highest = np.nanmax(np.concatenate([line.get_ydata() for line in panel.get_lines()]))
        low, high = panel.get_ylim()
        assert low + 0.98 * (high - low) > highest


def test_a_sweep_has_a_table_and_figures_for_a_paper(crossed, tmp_path, capsys):
    capsys.readouterr()
    assert main(["table", str(crossed), "--format", "latex"]) == 0
    latex = capsys.readouterr().out
    points = pd.read_parquet(crossed / "table.parquet")
    mean = points[(points["metric"] == "first_answer_mean")].iloc[0]
    assert f"{mean['value']:.3g}" in latex and r"\caption{Sweep crossed of " in latex
    assert main(["table", str(crossed), "--format", "csv"]) == 0
    assert len(capsys.readouterr().out.splitlines()) == len(points) + 1
    assert main(["table", str(crossed), "--methods", "genie"]) == 0
    of_genie = capsys.readouterr().out
    assert TITLES["genie"] in of_genie and TITLES["local"] not in of_genie
    assert main(["table", str(crossed), "--methods", "geni"]) == 1
    assert "did you mean 'genie'?" in capsys.readouterr().err
    one = ["figures", str(crossed), "--only", "rate-streaming_f1", "--format", "pdf"]
    assert main([*one, "--out", str(tmp_path)]) == 0 and list(tmp_path.glob("rate-*.pdf"))
