"""genie-sim as a library, as a notebook uses it."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest
from matplotlib.figure import Figure

import genie_sim as gs
from genie_sim.cli import main
from tests.conftest import REPOSITORY

SHORT = {f"cars[{i}].route.window": ["0 s", "1 s"] for i in range(3)}
TABLES = ("frames", "lookups", "resources", "poses", "objects")


@pytest.fixture(scope="module")
def run() -> gs.Run:
    return gs.run("3car_hetero", SHORT, seed=5)


def test_a_run_in_memory_writes_nothing(run):
    assert run.folder is None
    assert not list(Path().iterdir())
    assert {"local", "remote", "genie"} == set(run.frames["method"])
    assert set(run.lookups["placement"]) == {"car", "edge"}
    assert run.scenario.seed == 5


def test_metrics_are_one_table(run):
    mean = run.metrics.query("metric == 'first_answer_mean' and method == 'genie'")
    columns = ["metric", "method", "placement", "component", "value", "unit", "low", "high", "n"]
    assert list(run.metrics.columns) == columns
    assert len(mean) == 1
    answered = run.frames.query("method == 'genie'").dropna(subset="first_answer_ns")
    times_ms = (answered["first_answer_ns"] - answered["received_ns"]) / 1e6
    assert mean["value"].item() == pytest.approx(times_ms.mean())


@pytest.mark.parametrize(
    "name", ["latency_cdf", "image_reuse", "object_reuse", "confidence_boost", "resource_use"]
)
def test_every_figure_draws(run, name):
    assert isinstance(getattr(run.figures, name)(), Figure)


def test_a_run_in_memory_in_a_folder_and_on_the_command_line_are_the_same(run):
    written = gs.run("3car_hetero", SHORT, seed=5, out="lab")
    settings = [
        part for path, value in SHORT.items() for part in ("--set", f"{path}={json.dumps(value)}")
    ]
    assert main(["run", "3car_hetero", "--seed", "5", *settings, "--out", "cli"]) == 0
    (folder,) = Path("cli").iterdir()
    of_cli = gs.load(folder)
    assert written.run_id == of_cli.run_id == run.run_id
    assert written.folder == Path("lab") / folder.name
    for table in TABLES:
        for other in (written, of_cli):
            pd.testing.assert_frame_equal(getattr(run, table), getattr(other, table))
    pd.testing.assert_frame_equal(run.metrics, of_cli.metrics)
    assert run.report("memory.html").read_bytes() == of_cli.report("loaded.html").read_bytes()


def test_a_scenario_may_be_a_mapping_a_file_or_another_scenario(run):
    as_mapping = gs.load_scenario(run.facts["scenario"])
    assert as_mapping == run.scenario
    Path("mine.yaml").write_text(run.yaml)
    assert gs.load_scenario(Path("mine.yaml")) == as_mapping
    slower = gs.load_scenario(
        as_mapping, {"cars[0].link": "wifi", "genie.capacity": {"entries": 3}, "origin": None}
    )
    assert slower.cars[0].link != as_mapping.cars[0].link
    assert slower.genie.capacity.entries == 3
    assert gs.load_scenario(as_mapping, ["genie.eviction=lru"]).genie.eviction == "lru"


def test_progress_is_told_in_simulated_seconds():
    told = []
    settings = {"cars[0].route.window": ["0 s", "1 s"], "methods": ["local", "genie"]}
    gs.run("1car_homo", settings, progress=lambda *now: told.append(now))
    done, total, what = told[-1]
    assert done == pytest.approx(total, abs=0.2)
    assert 2 < total < 4
    assert what.startswith("genie") and told[0][2].startswith("local")
    assert told == sorted(told, key=lambda now: now[0])


@pytest.mark.parametrize(
    ("do", "message"),
    [
        (lambda: gs.run("3car_heterro"), "did you mean '3car_hetero'?"),
        (lambda: gs.run("1car_homo", {"genie.eviction": "lruu"}), "unknown eviction 'lruu'"),
        (
            lambda: gs.run("1car_homo", "genie.eviction=lru"),
            "settings: must be a mapping or a list",
        ),
        (lambda: gs.run({"edges": []}), "scenario: cars: missing"),
        (lambda: gs.load("nowhere"), "nowhere: not a result folder"),
        (lambda: gs.run("1car_homo", SHORT), "cars[1]"),
    ],
)
def test_what_is_wrong_is_told_in_one_line(do, message):
    with pytest.raises(gs.UserError) as error:
        do()
    assert message in str(error.value)
    assert "\n" not in str(error.value)


def test_a_run_without_a_folder_needs_a_path_for_its_report(run):
    with pytest.raises(gs.UserError, match="needs a path"):
        run.report()


def test_a_result_folder_that_lost_a_table_is_named():
    folder = gs.run(
        "1car_homo", {"cars[0].route.window": ["0 s", "1 s"], "methods": ["genie"]}, out="out"
    ).folder
    (folder / "objects.parquet").unlink()
    with pytest.raises(gs.UserError, match=r"objects\.parquet: no such file"):
        gs.load(folder)


def test_the_names_are_there_but_nothing_heavy_until_they_are_used():
    code = "import sys, genie_sim as gs; print('run' in dir(gs), 'pandas' in sys.modules, gs.run.__module__)"
    told = subprocess.run(
        [sys.executable, "-c", code], cwd=REPOSITORY, capture_output=True, text=True, check=True
    )
    assert told.stdout.split() == ["True", "False", "genie_sim.api"]
    with pytest.raises(AttributeError, match="runn"):
        _ = gs.runn


def test_settings_from_python_are_not_called_options_of_a_command():
    with pytest.raises(
        gs.UserError, match=r"^genie\.evictionn=\"lru\": genie\.evictionn: unknown field"
    ):
        gs.load_scenario("1car_homo", {"genie.evictionn": "lru"})


def test_the_next_entry_of_a_list_can_be_set():
    made = gs.load_scenario("1car_homo", {"cars[1].name": "second", "cars[1].device": "orin_nano"})
    assert [car.name for car in made.cars] == ["car1", "second"]
