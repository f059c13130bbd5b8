"""genie-sim as a library, as a notebook uses it."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import ModuleType

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

import genie_sim as gs
from genie_sim.analysis.style import RUN_FIGURES, SEEDS
from genie_sim.base.settings import plain_data
from genie_sim.cli.main import main
from genie_sim.methods.local import Local
from genie_sim.scenario import reading
from genie_sim.scenario.scenario import as_yaml
from tests.checkout import REPOSITORY

SHORT = {f"cars[{i}].route.window": ["0 s", "1 s"] for i in range(3)}
TABLES = ("frames", "lookups", "resources", "poses", "objects")


@pytest.fixture(scope="module")
def run() -> gs.Run:
    return gs.run("street_3car_hetero", SHORT, seed=5)


@pytest.fixture(scope="module")
def runs() -> gs.Runs:
    settings = {**SHORT, "methods": ["remote", "genie"]}
    return gs.run_seeds("street_3car_hetero", settings, seeds=[4, 5], jobs=1)


def test_a_run_in_memory_writes_nothing(run):
    assert run.folder is None
    assert not list(Path().iterdir())
    assert {"local", "remote", "genie"} == set(run.frames["method"])
    assert set(run.lookups["placement"]) == {"car", "edge"}
    assert run.scenario.seed == 5


def test_metrics_are_one_table(run):
    mean = run.metrics.query("metric == 'first_answer_mean' and method == 'genie'")
    columns = ["metric", "method", "placement", "component", "value", "unit", "low", "high", "n"]
    columns += ["range_low", "range_high"]
    assert list(run.metrics.columns) == columns
    assert len(mean) == 1
    answered = run.frames.query("method == 'genie'").dropna(subset="first_answer_ns")
    times_ms = (answered["first_answer_ns"] - answered["stamp_ns"]) / 1e6
    assert mean["value"].item() == pytest.approx(times_ms.mean())


FIGURES = [*RUN_FIGURES, "first_answer_p99"]


@pytest.mark.parametrize(
    ("name", "better"),
    [("first_answer_mean", ", lower is better"), ("fresh_answered_share", ", higher is better")],
)
def test_the_axis_of_a_metric_says_which_way_is_better(run, name, better):
    assert run.figure(name).axes[0].get_xlabel().endswith(better)


@pytest.mark.parametrize("name", FIGURES)
def test_every_figure_draws(run, runs, name):
    """Alone, of several seeds, and into a panel of somebody's own, where it takes one."""
    for what in (runs,) if name == "differences" else (run, runs):
        assert isinstance(what.figure(name), Figure)
    figure, (left, right) = plt.subplots(1, 2)
    if name == "differences":
        with pytest.raises(gs.UserError, match="ax: differences has panels of its own"):
            runs.figure(name, ax=right)
        return
    assert runs.figure(name, ax=right) is figure
    assert right.has_data() and not left.has_data()
    assert [axis for axis in figure.axes if axis not in (left, right)] == []
    plt.close(figure)


def test_a_figure_of_what_is_not_there_is_refused_in_one_line(run):
    little = gs.run(
        "street_1car_homo", {"cars[0].route.window": ["0 s", "1 s"], "record": ["lookups"]}
    )
    with pytest.raises(gs.UserError, match="unknown figure 'latency_accuracy'"):
        little.figure("latency_accuracy")


def test_the_wide_table_has_a_column_a_method_and_the_long_one_s_values(run):
    wide = run.table()
    assert list(wide.columns) == ["local", "remote", "genie"]
    assert wide.index.names == ["metric", "placement", "component"]
    long = run.metrics.set_index(["metric", "placement", "component", "method"])["value"]
    for place in (("first_answer_mean", "all", ""), ("image_reuse", "edge", "")):
        for method in wide.columns:
            expected = long.get((*place, method))
            value = wide.loc[place, method]
            assert (pd.isna(value) and expected is None) or value == expected
    assert len(wide) == len(run.metrics[["metric", "placement", "component"]].drop_duplicates())


def test_seeds_give_means_and_each_run(runs):
    assert isinstance(runs, gs.Runs) and runs.seeds == [4, 5] and runs.folder is None
    mean = runs.metrics.query("metric == 'first_answer_mean' and method == 'genie'").iloc[0]
    of_seeds = runs.every_run.query("metric == 'first_answer_mean' and method == 'genie'")
    assert list(of_seeds["seed"]) == [4, 5]
    assert mean["value"] == pytest.approx(of_seeds["value"].mean()) and mean["n"] == 2
    assert pd.isna(mean["low"]) and pd.isna(mean["high"]), "two seeds give no interval"
    assert runs.table().loc[("first_answer_mean", "all", ""), "genie"] == mean["value"]
    assert set(runs.runs[0].frames["method"]) == {"remote", "genie"}
    (sentence,) = runs.compare().verdicts
    assert sentence.startswith("Genie (DG) is ") and "without an interval" in sentence
    with pytest.raises(gs.UserError, match="unknown argument of run"):
        gs.run("street_1car_homo", seed=1, seeds=2)


def test_a_comparison_has_figures(runs):
    assert list(runs.compare().figures())[:2] == ["differences", "latency_cdf"]


@pytest.mark.slow
def test_seeds_in_a_folder_are_not_run_again_and_are_the_same(runs):
    settings = {**SHORT, "methods": ["remote", "genie"]}
    kept = gs.run_seeds(
        "street_3car_hetero", settings, seeds=[4, 5], label="two", jobs=1, out="lab"
    )
    again = gs.load(kept.folder)
    assert isinstance(again, gs.Runs) and again.title == "two"
    for other in (kept, again):
        pd.testing.assert_frame_equal(other.metrics, runs.metrics)
    page = Path(kept.folder, "report.html").read_text(encoding="utf-8")
    assert "<title>two, seeds 4, 5" in page
    pictures = runs.report("seeds.html").read_text(encoding="utf-8").count("data:image/svg")
    assert pictures == len([name for name, pages in RUN_FIGURES.items() if SEEDS in pages]) == 7
    with pytest.raises(gs.UserError, match="needs a path"):
        runs.report()


@pytest.mark.slow
@pytest.mark.usefixtures("without_figures")
def test_the_last_shard_of_a_sweep_makes_its_table():
    axes, short = {"spread": ["isolated", "loaded"]}, {"cars[0].route.window": ["0 s", "0.3 s"]}
    both = {"seeds": 1, "methods": "local", "jobs": 1, "out": "lab"}
    with pytest.raises(gs.UserError, match="1 of 2 runs are in lab"):
        gs.sweep("street_1car_homo", axes, short, shard=(1, 2), **both)
    swept = gs.sweep("street_1car_homo", axes, short, shard=(2, 2), **both)
    assert set(swept.metrics["spread"]) == {"isolated", "loaded"}


@pytest.mark.slow
def test_a_sweep_takes_methods_and_a_label():
    axes = {"link": {"set": "cars[0].link", "list": ["wifi", "lte"]}}
    short = {"cars[0].route.window": ["0 s", "1 s"]}
    swept = gs.sweep(
        "street_1car_homo",
        axes,
        short,
        seeds=1,
        methods=["remote"],
        label="two links",
        jobs=1,
        out="lab",
    )
    table = swept.metrics
    assert set(table["method"]) == {"remote"} and set(table["link"]) == {"wifi", "lte"}
    (folder,) = Path("lab").iterdir()
    assert "two links" in (folder / "figures" / "link.svg").read_text(encoding="utf-8")
    drawn = swept.figure("link")
    assert str(drawn.get_label()).endswith(
        f"sweep {folder.name} of street_1car_homo, 2 points, seeds 1"
    )
    with pytest.raises(gs.UserError, match="did you mean 'link'"):
        swept.figure("links")
    loaded = gs.load(folder)
    pd.testing.assert_frame_equal(loaded.metrics, table)
    assert loaded.title == "two links" and loaded.axes == ["link"]


def test_a_notebook_shows_what_was_run_and_its_table_as_plain_text(run, runs):
    html = run._repr_html_()
    assert "3 cars, 3 edges" in html and '<th scope="col">remote (R)</th>' in html
    assert "seeds 4, 5" in runs._repr_html_()
    compared = runs.compare()._repr_html_()
    assert "Genie (DG) is" in compared and "paired by" not in compared
    bad = gs.run(
        {**run.facts["scenario"], "methods": [{"name": "genie", "title": "<script>x</script>"}]},
        label="<b>",
    )
    assert "<script>" not in bad._repr_html_() and "&lt;script&gt;" in bad._repr_html_()
    assert "&lt;b&gt;" in bad._repr_html_()


def test_methods_and_labels(run):
    chosen = gs.run("street_3car_hetero", SHORT, seed=5, methods=["genie", "local"], label="chosen")
    assert [method.name for method in chosen.methods] == ["genie", "local"]
    compared = gs.compare(run, chosen, methods=["genie"], labels=["usual", "new"])
    assert set(compared.table["setting"]) == {"usual", "new"}
    assert repr(compared) == f"<Comparison of usual, new: {len(compared.table):,} rows>"
    assert set(compared.table["method"]) == {"genie"}
    compared = gs.compare(run, chosen, methods=["genie"])
    assert set(compared.table["setting"]) == {"street_3car_hetero", "chosen"}
    with pytest.raises(gs.UserError, match="unknown method 'genei'"):
        gs.run("street_3car_hetero", methods=["genei"])
    with pytest.raises(gs.UserError, match="label: must be one line"):
        gs.run("street_3car_hetero", label="a\nb")


@pytest.mark.slow
def test_a_run_in_memory_in_a_folder_and_on_the_command_line_are_the_same(run):
    written = gs.run("street_3car_hetero", SHORT, seed=5, out="lab")
    settings = [
        part for path, value in SHORT.items() for part in ("--set", f"{path}={json.dumps(value)}")
    ]
    assert main(["run", "street_3car_hetero", "--seed", "5", *settings, "--out", "cli"]) == 0
    (folder,) = Path("cli").iterdir()
    of_cli = gs.load(folder)
    assert written.run_id == of_cli.run_id == run.run_id
    assert written.folder == Path("lab") / folder.name
    for table in TABLES:
        for other in (written, of_cli):
            pd.testing.assert_frame_equal(getattr(run, table), getattr(other, table))
    pd.testing.assert_frame_equal(run.metrics, of_cli.metrics)
    assert run.report("memory.html").read_bytes() == of_cli.report("loaded.html").read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize("seeds", [None, 1])
def test_a_result_folder_has_the_page_and_figures_that_are_asked_for(seeds):
    settings = {"cars[0].route.window": ["0 s", "0.3 s"], "methods": ["local"]}
    run = gs.run if seeds is None else partial(gs.run_seeds, seeds=seeds, jobs=1)
    bare = run("street_1car_homo", settings, out="bare", report=False)
    drawn = run("street_1car_homo", settings, out="drawn", figures=True)
    assert not list(bare.folder.rglob("report.html")) + list(bare.folder.rglob("figures"))
    assert (drawn.folder / "report.html").is_file()
    assert (drawn.folder / "figures/latency_cdf.svg").is_file()


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


def test_a_scenario_keeps_what_its_mistakes_are_blamed_on():
    scenario = reading.load_scenario("street_1car_homo", ["cars[0].link=wifi"])
    error = gs.load_scenario(scenario).error_at("cars[0].link", "too slow")
    assert str(error) == str(scenario.error_at("cars[0].link", "too slow"))
    assert str(error).startswith("--set cars[0].link=wifi: ")


def test_a_scenario_that_a_program_changed_is_checked():
    given = gs.load_scenario("street_1car_homo")
    other = replace(given, cars=(replace(given.cars[0], device="orin_nano"),))
    assert gs.load_scenario(other).profiles.keys() >= {"orin_nano"}
    with pytest.raises(gs.UserError, match="seed: must be at least 0"):
        gs.load_scenario(replace(given, seed=-1))


def test_progress_is_told_in_simulated_seconds():
    told = []
    settings = {"cars[0].route.window": ["0 s", "1 s"], "methods": ["local", "genie"]}
    gs.run("street_1car_homo", settings, progress=lambda *now: told.append(now))
    done, total, what = told[-1]
    assert done == pytest.approx(total, abs=0.2)
    assert 2 < total < 4
    words = r"[\d,]+ frames/s"
    assert re.fullmatch(f"genie, {words}", what) and re.fullmatch(f"local, {words}", told[0][2])
    assert told == sorted(told, key=lambda now: now[0])


@pytest.mark.parametrize(
    ("do", "place"),
    [
        (lambda: gs.run("3car_heterro"), "did you mean '3car_hetero'?"),
        (lambda: gs.run("street_1car_homo", "genie.eviction=lru"), "settings: "),
        (lambda: gs.run({"edges": []}), "scenario: cars: missing"),
        (lambda: gs.load("nowhere"), "nowhere: "),
        (lambda: gs.run("street_1car_homo", SHORT), "cars[1]"),
    ],
)
def test_what_is_wrong_is_told_in_one_line(do, place):
    with pytest.raises(gs.UserError) as error:
        do()
    assert place in str(error.value) and "\n" not in str(error.value)


def test_a_run_without_a_folder_needs_a_path_for_its_report(run):
    with pytest.raises(gs.UserError, match="needs a path"):
        run.report()


def test_a_result_folder_that_lost_a_table_is_named():
    folder = gs.run(
        "street_1car_homo",
        {"cars[0].route.window": ["0 s", "1 s"], "methods": ["genie"]},
        out="out",
        report=False,
    ).folder
    (folder / "objects.parquet").unlink()
    with pytest.raises(gs.UserError, match=r"objects\.parquet: no such file"):
        gs.load(folder)


@pytest.mark.process
def test_the_names_are_there_but_nothing_heavy_until_they_are_used():
    code = (
        "import sys, genie_sim as gs; print('run' in dir(gs), 'pandas' in sys.modules,"
        " gs.run.__module__)"
    )
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
        gs.load_scenario("street_1car_homo", {"genie.evictionn": "lru"})


@pytest.mark.parametrize("text", ["\N{GRINNING FACE}", "\x85 \u2028 \ufeff \ufffe", '\\ud83d\n"'])
def test_a_text_is_set_as_it_is_whatever_its_characters(text):
    assert gs.load_scenario("street_1car_homo", {"description": text}).description == text


@pytest.mark.parametrize("text", ["\x7f", "\ud83d", "\0"])
def test_a_text_that_no_file_can_hold_is_told_in_one_line(text):
    with pytest.raises(gs.UserError, match=r"^description="):
        gs.load_scenario("street_1car_homo", {"description": text})


def test_the_next_entry_of_a_list_can_be_set():
    made = gs.load_scenario(
        "street_1car_homo", {"cars[1].name": "second", "cars[1].device": "orin_nano"}
    )
    assert [car.name for car in made.cars] == ["car1", "second"]


@pytest.mark.parametrize("given", ["seeds", "axes", "sweep file", "scenario file"])
def test_a_class_of_a_notebook_keeps_its_runs_in_this_process(given, tmp_path, monkeypatch):
    notebook = ModuleType("__main__")
    notebook.Mine = type("Mine", (Local,), {})
    monkeypatch.setitem(sys.modules, "__main__", notebook)
    settings = {"methods": ["__main__:Mine"], "cars[0].route.window": ["0 s", "1 s"]}
    gates = ["1 m", "2 m"]
    sweep = tmp_path / "gates.yaml"
    axes = {"gate": {"set": "genie.object_map.gate", "list": gates}}
    sweep.write_text(json.dumps({"scenario": "street_1car_homo", "seeds": 1, "axes": axes}))
    mine = tmp_path / "mine.yaml"
    mine.write_text(as_yaml(plain_data(gs.load_scenario("street_1car_homo", settings))))

    def study(jobs):
        if given == "seeds":
            return gs.run_seeds("street_1car_homo", settings, seeds=2, jobs=jobs)
        if given == "sweep file":
            return gs.sweep(sweep, settings=settings, jobs=jobs)
        at = (mine, {}) if given == "scenario file" else ("street_1car_homo", settings)
        return gs.sweep(at[0], {"genie.object_map.gate": gates}, at[1], seeds=1, jobs=jobs)

    with pytest.raises(gs.UserError, match="jobs: 2 processes do not know a class"):
        study(2)
    assert set(study(None).metrics["method"].dropna()) == {"Mine"}


@pytest.mark.parametrize(
    ("call", "argument"),
    [
        (lambda: gs.run(5), "scenario"),
        (lambda: gs.run("3car_hetero", 5), "settings"),
        (lambda: gs.run("3car_hetero", [1]), "settings[0]"),
        (lambda: gs.run("3car_hetero", seed=1.5), "seed"),
        (lambda: gs.run("3car_hetero", methods=5), "methods"),
        (lambda: gs.run("3car_hetero", methods={"local", "genie"}), "methods"),
        (lambda: gs.run("3car_hetero", label=5), "label"),
        (lambda: gs.run("3car_hetero", out=5), "out"),
        (lambda: gs.run("3car_hetero", report="no"), "report"),
        (lambda: gs.run("3car_hetero", progress=3), "progress"),
        (lambda: gs.run("3car_hetero", observer=3), "observer"),
        (lambda: gs.load(5), "folder"),
        (lambda: gs.compare(), "compare"),
        (lambda: gs.compare(5), "results"),
        (lambda: gs.run("3car_hetero", methods={"genie": {}}), "methods"),
        (lambda: gs.sweep("3car_hetero", 5), "axes"),
        (lambda: gs.sweep("3car_hetero", {}), "axes"),
        (lambda: gs.sweep("3car_hetero"), "3car_hetero is a scenario"),
        (lambda: gs.sweep("3car_hetero", {"genie.passes": [1]}, shard=(3, 2)), "shard"),
        (lambda: gs.load_scenario(b"x"), "source"),
    ],
)
def test_a_value_of_a_wrong_type_is_one_line_that_names_the_argument(call, argument):
    with pytest.raises(gs.UserError) as error:
        call()
    assert str(error.value).startswith(f"{argument}: ")
    (line,) = error.value._render_traceback_()  # what a notebook shows
    assert line == f"UserError: {error.value}"


def test_numbers_of_numpy_are_numbers():
    assert gs.load_scenario("3car_hetero", seed=np.int64(3)).seed == 3


def test_a_misspelt_attribute_is_answered_with_the_nearest():
    with pytest.raises(AttributeError, match="did you mean 'compare'"):
        _ = gs.comparee
    run = gs.run("1car_homo", {"cars[0].route.window": ["0 s", "0.3 s"]}, methods=["local"])
    with pytest.raises(gs.UserError, match="did you mean 'latency_cdf'") as error:
        run.figure("latency_cdff")
    assert len(error.value._render_traceback_()) == 1  # in a notebook
    with pytest.raises(AttributeError, match="did you mean 'frames'"):
        _ = run.frame
