"""Sweeps as their user meets them: what is varied, what comes out, what a kill costs, and where
runs are done.
"""

from __future__ import annotations

import json
import math
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import genie_sim
from genie_sim.analysis import metrics
from genie_sim.analysis.registry import definition
from genie_sim.base import files
from genie_sim.base.errors import UserError
from genie_sim.cli.main import main
from genie_sim.core.similarity import Exact
from genie_sim.data.sources import Recorded
from genie_sim.record import provenance
from genie_sim.record.results import MetricValue
from genie_sim.runs.prepare import Prepared, prepare
from genie_sim.runs.simulate import simulate
from genie_sim.scenario.reading import load_scenario
from genie_sim.study import tables, work
from genie_sim.study.design import load_design
from genie_sim.study.figures import SweepFigures
from genie_sim.study.plan import plan
from genie_sim.study.study import Study, check_folder
from genie_sim.study.work import Parts, PointRun
from genie_sim.worlds.town import town
from tests.checkout import REPOSITORY, sign
from tests.make import METHODS


@pytest.fixture(autouse=True)
def _draws_only_where_figures_matter(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Drawing takes most of a small sweep's time; only tests marked ``drawn`` have figures."""
    if request.node.get_closest_marker("drawn") is None:
        monkeypatch.setattr(SweepFigures, "drawn", lambda _: iter(()))


SMALL = """
scenario: street_1car_homo
set: {"cars[0].route.window": [0 s, 500 ms], methods: [genie]}
seeds: 3
axes:
  rate: {set: genie.object_map.rate, list: [0.1, 0.5]}
  gate: {set: [genie.object_map.gate, genie.view_range], grid: {from: 1 m, to: 3 m, points: 2}}
"""
TABLES = ("table.parquet", "table.csv", "runs.parquet")


def write(text: str, name: str = "s.yaml") -> str:
    Path(name).write_text(text)
    return name


def points(text: str) -> pd.DataFrame:
    """The values of the axes at each point."""
    design = load_design(Path(write(text)))
    return pd.DataFrame(
        [point.levels for point in design.points()], columns=list(design.columns.values())
    )


def sampled(axes: str, samples: int = 20, more: str = "") -> pd.DataFrame:
    return points(f"scenario: street_1car_homo\nsamples: {samples}\n{more}\naxes:\n{axes}")


SHARE = {
    "method": "genie",
    "metric": "fresh_answered_share",
    "placement": "all",
    "component": "",
    "unit": "1",
    "n": 100,
}
RATE = "  rate: {set: genie.object_map.rate, latin_hypercube: {from: 0, to: 1}}\n"
VIEW = "  view: {set: genie.view_range, latin_hypercube: {from: 10 m, to: 90 m}}\n"


# What is varied


def test_crossed_axes_make_every_combination():
    table = points(SMALL)
    assert list(table.columns) == ["rate", "gate [m]"]
    assert sorted(map(tuple, table.to_numpy())) == [(0.1, 1.0), (0.1, 3.0), (0.5, 1.0), (0.5, 3.0)]


def test_every_setting_of_an_axis_gets_the_value_with_its_unit():
    first, *_ = load_design(Path(write(SMALL))).points()
    assert first.overrides[2:] == (
        "genie.object_map.rate=0.1",
        'genie.object_map.gate="1 m"',
        'genie.view_range="1 m"',
    )


def test_a_logarithmic_grid_has_equal_ratios():
    grid = "{from: 1 m, to: 100 m, points: 5, scale: log}"
    gates = points(SMALL.replace("{from: 1 m, to: 3 m, points: 2}", grid))["gate [m]"].unique()
    assert gates[[0, -1]] == pytest.approx([1, 100])
    assert gates[1:] / gates[:-1] == pytest.approx(math.sqrt(10), rel=1e-4)  # six digits


def test_cases_have_settings_of_their_own_and_a_scenario_can_be_one():
    design = load_design(
        Path(
            write("""
scenario: street_1car_homo
axes:
  cars: {set: scenario, list: [street_1car_homo, street_2car_homo]}
  load: {list: {quiet: {}, busy: {"cars[0].route.laps": 2, "spread": loaded}}}
""")
        )
    )
    found = [(point.levels, point.scenario, point.overrides) for point in design.points()]
    assert found[0] == (("street_1car_homo", "quiet"), "street_1car_homo", ())
    assert found[3] == (
        ("street_2car_homo", "busy"),
        "street_2car_homo",
        ("cars[0].route.laps=2", 'spread="loaded"'),
    )


def test_a_latin_hypercube_has_one_value_in_each_part_of_the_span():
    views = np.sort(sampled(VIEW)["view [m]"])
    assert ((views - 10) // 4 == np.arange(20)).all(), "80 m in 20 parts"


def test_a_grid_whose_steps_are_whole_fits_settings_that_must_be():
    cars = (
        "scenario: fleet_30\naxes:\n  cars: {set: fleet.cars, grid: {from: 1, to: 10, points: 4}}"
    )
    design = load_design(Path(write(cars)))
    assert [point.overrides for point in design.points()] == [
        (f"fleet.cars={n}",) for n in (1, 4, 7, 10)
    ]


def test_samples_on_a_logarithmic_scale_have_even_decades():
    text = RATE.replace("from: 0, to: 1", "from: 0.001, to: 1, scale: log")
    rates = sampled(text, 30)["rate"]
    assert [((rates >= low) & (rates < 10 * low)).sum() for low in (0.001, 0.01, 0.1)] == [
        10,
        10,
        10,
    ]


def test_samples_come_from_streams_of_the_axes_names():
    """Another axis, or another order of the axes, changes nobody's samples; another sample_seed
    changes all.
    """
    alone = sampled(VIEW)["view [m]"]
    assert sampled(RATE + VIEW)["view [m]"].equals(alone)
    assert sampled(VIEW + RATE)["view [m]"].equals(alone)
    assert not sampled(VIEW, more="sample_seed: 2")["view [m]"].equals(alone)
    assert not sampled(VIEW.replace("view:", "sight:"))["sight [m]"].equals(alone)


def test_sampled_axes_are_drawn_together_and_crossed_with_the_others():
    table = sampled(
        RATE + VIEW + "  rule: {set: genie.object_map.rule, list: [ema, noisy_or]}\n", 7
    )
    assert len(table) == 14
    both = [
        table[table["rule"] == rule][["rate", "view [m]"]].to_numpy()
        for rule in ("ema", "noisy_or")
    ]
    assert (both[0] == both[1]).all()


RATES = "genie.object_map.rate, list: [0.1, 0.5]"
MISTAKES = [
    ("seeds:", "sedes:", "s.yaml: sedes: unknown field; did you mean 'seeds'?"),
    ("list: [0.1, 0.5]", "", "s.yaml: axes.rate: "),
    ("list: [0.1, 0.5]", "list: [1], latin_hypercube: {from: 0, to: 1}", "s.yaml: axes.rate: "),
    ("set: genie.object_map.rate, ", "", "s.yaml: axes.rate.set: missing"),
    ("object_map.rate", "object_map.rat", "s.yaml: genie.object_map.rat=0.1: "),
    ("[0.1, 0.5]", "[0.1, 5]", "s.yaml: genie.object_map.rate=5: genie."),
    ("[0.1, 0.5]", "[0.1, 0.1]", "s.yaml: axes.rate.list: "),
    ("[0.1, 0.5]", "[]", "s.yaml: axes.rate.list: "),
    ("to: 3 m", "to: 3 s", "s.yaml: axes.gate.grid.to: "),
    ("to: 3 m", "to: 1 m", "s.yaml: axes.gate.grid.to: "),
    ("{from: 1 m,", "{scale: log, from: 0 m,", "s.yaml: axes.gate.grid.from: "),
    ("from: 1 m", "from: near", "s.yaml: axes.gate.grid.from: "),
    ("points: 2", "points: 1", "s.yaml: axes.gate.grid.points: "),
    ("points: 2", "points: '2'", "s.yaml: axes.gate.grid.points: "),
    ("seeds: 3", "seeds: 0", "s.yaml: seeds: "),
    ("seeds: 3", "seeds: [1, 2, 1]", "s.yaml: seeds: "),
    ("seeds: 3", "samples: 3", "s.yaml: samples: "),
    (
        "list: [0.1, 0.5]",
        "latin_hypercube: {from: 0, to: 1}",
        "s.yaml: samples: missing; axis 'rate' needs",
    ),
    ("gate, genie.view_range]", "rate]", "would undo genie.object_map.rate"),
    ("set: genie.object_map.rate", "set: seed", "s.yaml: seeds: "),
    ("rate: {", "metric: {", "s.yaml: axes.metric: "),
    (
        "points: 2}}",
        "points: 999}}\n  long: {set: x, grid: {from: 1, to: 9, points: 999}}",
        "s.yaml: axes: ",
    ),
    ("street_1car_homo", "1car_hom", "s.yaml: unknown scenario '1car_hom' (did you mean"),
    (RATES, "genie.similarity, list: ['json:no']", "s.yaml: similarity 'json:no'"),
    (RATES, "scenario, list: [fleet_30]", "s.yaml: fleet_30: cars[0]"),
    ("[0 s, 500 ms]", "[90 s, 91 s]", "cars[0].route.window: "),
]


@pytest.mark.parametrize(("right", "wrong", "place"), MISTAKES)
def test_a_mistake_in_a_sweep_gets_one_line_and_status_1(right, wrong, place, capsys):
    assert right in SMALL
    assert main(["sweep", write(SMALL.replace(right, wrong, 1))]) == 1
    one_line(capsys, place)
    assert not Path("results").exists(), "nothing is run before all points are checked"


@pytest.mark.parametrize(
    ("arguments", "status"),
    [
        (["--shard", "3/2"], 1),
        (["--shard", "one"], 1),
        (["--jobs", "0"], 2),
    ],
)
def test_bad_arguments_are_one_line(arguments, status, capsys):
    assert main(["sweep", write(SMALL), *arguments]) == status
    one_line(capsys, arguments[0])


@pytest.mark.parametrize("name", files.available(files.SWEEP))
def test_the_shipped_sweeps_are_right(name):
    """Every point of them can be run; not that anybody has the time to do so here."""
    planned = plan(load_design(name), name)
    assert len(planned.runs) == load_design(name).runs > 10


# What comes out


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the small sweep, run by one process without a break."""
    folder = tmp_path_factory.mktemp("uninterrupted")
    path = folder / "s.yaml"
    path.write_text(SMALL)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(SweepFigures, "drawn", lambda _: iter(()))
        assert main(["sweep", str(path), "--out", str(folder), "--jobs", "1"]) == 0
    return folder / "s"


@pytest.mark.slow
def test_the_table_holds_mean_and_interval_of_separate_runs(uninterrupted):
    """Source: the same runs, one by one, and SciPy's t intervals over seeds 1 to 3, none where all
    are equal or of a percentile that fewer answers than it needs decide.
    """
    from scipy import stats

    overrides = [
        "cars[0].route.window=[0 s, 500 ms]",
        "methods=[genie]",
        "genie.object_map.rate=0.5",
    ]
    overrides += ["genie.object_map.gate=3 m", "genie.view_range=3 m"]
    measured: dict[tuple[str, ...], list[float]] = {}
    too_few: set[tuple[str, ...]] = set()
    for seed in (1, 2, 3):
        made = simulate(prepare(load_scenario("street_1car_homo", overrides, seed)))
        tables = {name: made[name].to_frame() for name in work.MEASURED}
        for one in metrics.compute(METHODS, tables):
            key = one.metric, one.method, one.placement, one.component
            measured.setdefault(key, []).extend([] if one.value is None else [one.value])
            if one.n < (100 if one.metric.endswith("_p99") else 0):
                too_few.add(key)
    table = pd.read_parquet(uninterrupted / "table.parquet")
    table = table[(table["rate"] == 0.5) & (table["gate [m]"] == 3.0)]
    assert len(table) == len(measured)
    for row in table.itertuples():
        key = row.metric, row.method, row.placement, row.component
        values = measured[key]
        assert row.n == len(values)
        assert row.value == pytest.approx(np.mean(values) if values else math.nan, nan_ok=True), row
        ends = math.nan, math.nan
        if len(values) == 3 and len(set(values)) > 1 and key not in too_few:
            low, high = stats.t.interval(0.95, 2, np.mean(values), stats.sem(values))
            metric = definition(row.metric)
            is_bounded = metric.unit and not metric.is_signed and np.mean(values) >= 0
            ends = max(low, 0.0) if is_bounded else low, high
            if is_bounded and metric.unit == "%":
                ends = ends[0], min(high, 1.0)
        assert (row.low, row.high) == pytest.approx(ends, nan_ok=True), row
    assert too_few and table["low"].notna().any()


def test_the_folder_says_what_it_is(uninterrupted):
    about = json.loads((uninterrupted / "sweep.json").read_text())
    assert (about["points"], about["runs"], about["sweep"]["scenario"]) == (
        4,
        12,
        "street_1car_homo",
    )


@pytest.mark.slow
@pytest.mark.drawn
def test_a_third_axis_has_figures_of_its_own_that_say_where_they_are(uninterrupted):
    runs = pd.read_parquet(uninterrupted / "runs.parquet")
    both = pd.concat([runs.assign(rule="ema"), runs.assign(rule="noisy_or")])
    text = SMALL + "  rule: {set: genie.object_map.rule, list: [ema, noisy_or]}\n"
    design = load_design(write(text))
    drawn = dict(SweepFigures(design, both, {"genie": "Genie"}, "made up").drawn())
    assert {name.partition("-")[0] for name in drawn} == {"rate", "gate", "rule"}
    assert drawn["rate-first_answer_mean-2"].get_suptitle() == "at rule = noisy_or"


@pytest.mark.slow
def test_differences_are_paired_by_seed(uninterrupted):
    """Source: SciPy's paired t interval over seeds 1 to 3."""
    from scipy import stats

    runs = pd.read_parquet(uninterrupted / "runs.parquet")
    mine = runs[(runs["metric"] == "first_answer_mean") & (runs["gate [m]"] == 3.0)]
    low, high = (mine[mine["rate"] == rate].set_index("seed")["value"] for rate in (0.1, 0.5))
    found = genie_sim.load(uninterrupted).differences("rate", to=0.1)
    row = found[(found["metric"] == "first_answer_mean") & (found["gate [m]"] == 3.0)].iloc[0]
    gaps = high - low
    assert (row["rate"], row["value"], row["n"]) == (0.5, pytest.approx(gaps.mean()), 3)
    expected = (
        stats.t.interval(0.95, 2, gaps.mean(), stats.sem(gaps))
        if gaps.std()
        else (gaps.mean(), gaps.mean())
    )
    assert (row["low"], row["high"]) == pytest.approx(expected)


def test_differences_name_columns_and_values_that_are_not_there(uninterrupted):
    swept = genie_sim.load(uninterrupted)
    with pytest.raises(UserError, match="unknown column 'speed'"):
        swept.differences("speed", to=1)
    with pytest.raises(UserError, match=r"method: unknown value 'local'"):
        swept.differences("method", to="local")


@pytest.mark.slow
def test_a_sweep_from_python_equals_that_of_the_file(uninterrupted, monkeypatch):
    drawn: list[str] = []
    monkeypatch.setattr(
        SweepFigures, "drawn", lambda sweep: iter(drawn.append(sweep.design.name) or ())
    )
    settings = {"cars[0].route.window": ["0 s", "0.5 s"], "methods": ["genie"]}
    axes = {"genie.object_map.rate": [0.1, 0.5]}
    axes["gate"] = {"set": ["genie.object_map.gate", "genie.view_range"], "list": ["1 m", "3 m"]}
    made = genie_sim.sweep("street_1car_homo", axes, settings, seeds=3, jobs=1)
    pd.testing.assert_frame_equal(made.metrics, pd.read_parquet(uninterrupted / "table.parquet"))
    assert drawn == []
    genie_sim.sweep(
        "street_1car_homo", {"genie.object_map.rate": [0.1]}, settings, seeds=1, jobs=1, out="kept"
    )
    assert drawn == [folder.name for folder in Path("kept").iterdir()]
    with pytest.raises(UserError, match=r"^axes: speed=1: speed: unknown field"):
        genie_sim.sweep("street_1car_homo", {"speed": [1, 2]}, settings, seeds=1)


def test_a_sweep_of_an_older_genie_sim_is_named_with_what_to_do(capsys):
    write(SMALL)
    Path("results/s").mkdir(parents=True)
    Path("results/s/sweep.json").write_text('{"format": 1, "sweep": {}}')
    assert main(["sweep", "s.yaml"]) == 1
    older = "results/s/sweep.json: made by an older genie-sim: format 1, this one reads "
    one_line(capsys, older)
    assert main(["table", "results/s"]) == 1
    one_line(capsys, older)


def test_an_axis_may_be_called_as_the_setting_it_varies():
    axes = (
        "{spread: {set: spread, list: [isolated, loaded]}, order: {set: genie.object_map.rate,"
        " list: [0.1, 0.5]}}"
    )
    window = '"cars[0].route.window": [0 s, 500 ms]'
    write(
        f"scenario: street_1car_homo\nset: {{{window}, methods: [genie]}}\nseeds: 1\naxes: {axes}\n"
    )
    assert main(["sweep", "s.yaml", "--jobs", "1"]) == 0
    table = pd.read_csv("results/s/table.csv")
    assert set(table["spread"]) == {"isolated", "loaded"} and set(table["order"]) == {0.1, 0.5}
    assert Path("results/s/figures").is_dir()


def test_a_folder_describes_its_tables_even_if_the_sweep_file_changed(
    uninterrupted,
):
    finished(uninterrupted)
    first = Study.of(load_design("s.yaml"), "s.yaml", Path("results"))
    first.run(1)
    Study.of(
        load_design(write(SMALL.replace("seeds: 3", "seeds: 1"))), "s.yaml", Path("results")
    ).run(1)
    first.finish()
    assert json.loads(Path("results/s/sweep.json").read_text())["runs"] == 12
    assert len(pd.read_parquet("results/s/runs.parquet")["run_id"].unique()) == 12


@pytest.mark.slow
def test_two_processes_make_the_same_bytes_as_one(uninterrupted):
    assert main(["sweep", write(SMALL), "--jobs", "2"]) == 0
    same_bytes(uninterrupted)


# Nothing is run twice, nothing is lost


@pytest.mark.process
@pytest.mark.unix
def test_a_killed_sweep_goes_on_to_the_same_bytes(uninterrupted):
    """kill -9 of the sweep and its processes in the middle, then the same command."""
    write(SMALL)
    with in_the_middle("--jobs", "2") as run:
        os.killpg(run.pid, signal.SIGKILL)
    kept = runs_in_parts()
    assert 0 < len(kept) < 12
    assert not Path("results/s/table.csv").exists()
    assert main(["sweep", "s.yaml", "--jobs", "1"]) == 0
    same_bytes(uninterrupted)
    assert len(list(Path("results/s/parts").iterdir())) == 12, "no half part is left"


@pytest.mark.process
@pytest.mark.unix
def test_a_sweep_whose_main_process_alone_is_killed_ends_its_workers():
    write(SMALL)
    with in_the_middle("--jobs", "2") as run:
        os.kill(run.pid, signal.SIGKILL)
        run.wait()
        deadline = time.monotonic() + 60
        while processes_of(run.pid) and time.monotonic() < deadline:
            time.sleep(0.1)
        assert not processes_of(run.pid)


@pytest.mark.process
@pytest.mark.skipif(not Path("/proc").is_dir(), reason="only /proc tells the workers")
def test_a_worker_that_is_killed_loses_nothing(uninterrupted):
    write(SMALL)
    with in_the_middle("--jobs", "2") as run:
        os.kill(next(filter(is_worker, processes_of(run.pid))), signal.SIGKILL)
        _, error = run.communicate(timeout=60)
    assert run.returncode == 1 and "a worker process was killed" in error
    assert main(["sweep", "s.yaml", "--jobs", "1"]) == 0
    same_bytes(uninterrupted)


@pytest.mark.process
@pytest.mark.unix
@pytest.mark.parametrize("asked", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_sweep_keeps_finished_runs_and_exits_with_130(asked, uninterrupted):
    write(SMALL)
    with in_the_middle("--jobs", "2") as run:
        os.killpg(run.pid, asked)  # as a terminal and Slurm do
        _, error = run.communicate(timeout=60)
    assert run.returncode == 130
    assert error == f"genie-sim: interrupted; finished runs are kept in {Path('results/s')}\n"
    assert main(["sweep", "s.yaml", "--jobs", "1"]) == 0
    same_bytes(uninterrupted)


@pytest.mark.process
@pytest.mark.skipif(
    not Path("/proc").is_dir(),
    reason="only /proc tells when a process has begun to listen to Ctrl-C",
)
def test_ctrl_c_while_workers_begin_is_one_line_too():
    write(SMALL)
    with begun("--jobs", "2") as run:
        while not any(is_importing(process) for process in processes_of(run.pid)):
            assert run.poll() is None, run.communicate()
            time.sleep(0.002)
        os.killpg(run.pid, signal.SIGINT)
        _, error = run.communicate(timeout=60)
    assert run.returncode == 130
    assert error == f"genie-sim: interrupted; finished runs are kept in {Path('results/s')}\n"


@pytest.mark.slow
def test_what_is_done_is_not_run_again_even_along_other_axes(uninterrupted, monkeypatch):
    finished(uninterrupted)
    simulated = count_runs(monkeypatch)
    assert main(["sweep", "s.yaml", "--jobs", "1"]) == 0
    assert not simulated
    write(
        SMALL.replace(
            "rate: {set: genie.object_map.rate, list: [0.1, 0.5]}",
            "weight: {set: genie.object_map.rate, list: [0.2, 0.5]}",
        )
    )
    assert main(["sweep", "s.yaml", "--jobs", "1"]) == 0
    assert len(simulated) == 6, "half of the points were there"
    assert set(pd.read_csv("results/s/table.csv")["rate"]) == {0.1, 0.5}, "nothing is overwritten"
    (other,) = Path("results").glob("s-*")
    assert set(pd.read_csv(other / "table.csv")["weight"]) == {0.2, 0.5}
    assert main(["sweep", "s.yaml", "--jobs", "1"]) == 0 and len(simulated) == 6, "it goes on there"


@pytest.mark.drawn
@pytest.mark.slow
def test_a_sweep_can_be_loaded_compared_and_reported(uninterrupted, capsys):
    finished(uninterrupted)
    swept = genie_sim.load("results/s")
    assert swept.metrics.equals(pd.read_parquet("results/s/table.parquet"))
    assert swept.figure("first_answer_mean").axes
    differences = swept.differences("rate", 0.1)
    assert set(differences["rate"]) == {0.5} and len(differences)
    assert main(["report", "results/s"]) == 0
    assert "table.csv in the folder of the results" in Path("results/s/report.html").read_text()
    table = genie_sim.compare("results/s", swept, labels=["a", "b"]).table
    assert "b, rate 0.1, gate [m] 1" in set(table["setting"])
    assert (table[table["against"] != ""]["value"] == 0).all(), "it is compared with itself"
    capsys.readouterr()
    assert main(["table", "results/s", "--format", "csv"]) == 0
    assert capsys.readouterr().out == Path("results/s/table.csv").read_text()


class Broken(Exact):
    """An image similarity that fails on the first image."""

    def key(self, request: object) -> object:
        raise RuntimeError("the lens is dirty")


@pytest.mark.parametrize("jobs", ["1", pytest.param("2", marks=pytest.mark.process)])
def test_runs_that_fail_are_told_and_the_others_are_done(jobs, monkeypatch, capsys):
    short = SMALL.replace("seeds: 3", "seeds: 1")
    rates, parts = "object_map.rate, list: [0.1, 0.5]", "similarity, list: [{}exact]"
    write(short.replace(rates, parts.format("'tests.study.test_study:Broken', ")))
    assert main(["sweep", "s.yaml", "--jobs", jobs]) == 1
    line = capsys.readouterr().err
    first = r"point 0 \(rate = tests.study.test_study:Broken, gate = 1.0\), seed 1"
    why = r"similarity 'tests.study.test_study:Broken': RuntimeError: 'the lens is dirty' \(.*\)"
    told = re.fullmatch(
        rf"genie-sim: results/s: 2 of 4 runs failed, the others are done; {first}: {why}\n",
        line,
    )
    assert told, line
    assert not Path("results/s/table.csv").exists(), "a table would lack points"

    simulated = count_runs(monkeypatch)
    write(short.replace(rates, parts.format("")))
    assert main(["sweep", "s.yaml", "--jobs", "1"]) == 0
    assert not simulated


@dataclass(frozen=True, slots=True)
class MadeUp(PointRun):
    """A run of a study that has one metric, or none and fails."""

    fails: bool = False

    def measure(self, study: Path) -> list[MetricValue]:
        if self.fails:
            raise RuntimeError("the lens is dirty")
        return [MetricValue("streaming_f1", "local", "all", "", 0.5, "1")]


def test_progress_counts_what_is_done_and_what_failed(tmp_path):
    parts, told = Parts(tmp_path), []
    scenario = load_scenario("street_1car_homo")
    runs = [MadeUp(name, scenario, "here", fails=name == "b") for name in "ab"]
    with pytest.raises(UserError, match="1 of 2 runs failed"):
        parts.run(runs, 1, progress=lambda *progress: told.append(progress))
    assert told[0] == (0, 2, "") and told[-1] == (1, 2, "1 failed")
    told.clear()
    parts.run(runs[:1], 1, progress=lambda *progress: told.append(progress))
    assert told == [(1, 1, "")], "it is done"


def test_a_difference_of_shares_may_be_negative_and_has_an_interval():
    """Two arms with shares around .2 and .5: no interval of a share, which would begin at zero. The
    half of it: the 97.5 % quantile of t with two degrees of freedom, 4.302653.
    """
    noise = (-0.01, 0.0, 0.01)
    rows = [
        {"arm": arm, "seed": seed, "value": share + sign * noise[seed], **SHARE}
        for arm, share, sign in (("first", 0.5, 1), ("second", 0.2, -1))
        for seed in range(3)
    ]
    (row,) = tables.differences(pd.DataFrame(rows), ["arm"], "arm", "first").to_dict("records")
    half = 4.302653 * 0.02 / math.sqrt(3)
    assert row["value"] == pytest.approx(-0.3)
    assert (row["low"], row["high"]) == pytest.approx((-0.3 - half, -0.3 + half), rel=1e-4)


def test_points_that_say_the_same_share_their_runs(monkeypatch):
    simulated = count_runs(monkeypatch)
    same = "list: {plain: {}, said: {genie.eviction: fifo}}"
    short = SMALL.replace("seeds: 3", "seeds: 1")
    write(short.replace("set: genie.object_map.rate, list: [0.1, 0.5]", same))
    assert main(["sweep", "s.yaml", "--jobs", "1"]) == 0
    assert len(simulated) == 2
    table = pd.read_csv("results/s/table.csv").drop(columns="point").set_index("rate")
    assert (
        table.loc["plain"].reset_index(drop=True).equals(table.loc["said"].reset_index(drop=True))
    )


@pytest.mark.slow
def test_shards_share_the_runs_and_the_last_one_makes_the_table(uninterrupted, monkeypatch, capsys):
    simulated = count_runs(monkeypatch)
    write(SMALL)
    for shard in ("3/3", "1/3"):
        assert main(["sweep", "s.yaml", "--jobs", "1", "--shard", shard]) == 0
    assert capsys.readouterr().out.endswith(
        "8 of 12 runs are in results/s; the last shard makes the table\n"
    )
    assert not Path("results/s/table.csv").exists()
    assert main(["sweep", "s.yaml", "--jobs", "1", "--shard", "2/3"]) == 0
    assert len(simulated) == 12
    same_bytes(uninterrupted)


@pytest.mark.slow
def test_profiles_and_traces_are_read_once(monkeypatch):
    opened: list[int] = []
    open_source = Recorded.open
    monkeypatch.setattr(Recorded, "open", lambda *a: opened.append(1) or open_source(*a))
    work._frames_of_process.cache_clear()
    assert main(["sweep", write(SMALL.replace("seeds: 3", "seeds: 2")), "--jobs", "1"]) == 0
    assert len(opened) == 2, "once to plan and once to run"
    assert len(list(Path("results/s/parts").iterdir())) == 8


# Folders that are not as they should be


def test_a_plan_lays_out_no_town_and_each_seed_has_its_own_id(monkeypatch):
    settings = "scenario: fleet_30\nset: {perception.duration: 1 s}\nseeds: 5"
    design = load_design(
        Path(write(f"{settings}\naxes:\n  cars: {{set: fleet.cars, list: [2, 3]}}\n"))
    )
    monkeypatch.setattr(town, "lay_out", None)  # nothing is laid out before a car looks
    planned = plan(design, "s.yaml")
    for entry, seed in zip(planned.entries[5:], range(1, 6), strict=True):
        scenario = load_scenario("fleet_30", ["perception.duration=1 s", "fleet.cars=3"], seed)
        assert entry.run_id == provenance.run_id(prepare(scenario).facts)


def test_an_empty_folder_is_free_for_a_sweep(tmp_path):
    check_folder(tmp_path)


def test_a_folder_of_something_else_is_left_alone(capsys):
    Path("results/s").mkdir(parents=True)
    Path("results/s/thesis.tex").write_text("mine")
    assert main(["sweep", write(SMALL)]) == 1
    one_line(capsys, "results/s: holds something else than a sweep; choose another --out")
    assert [path.name for path in Path("results/s").iterdir()] == ["thesis.tex"]


def test_an_out_folder_that_cannot_be_written_is_found_before_simulating(capsys):
    Path("results").write_text("a file, not a folder")
    assert main(["sweep", write(SMALL)]) == 1
    one_line(capsys, "results/s: no results can be written there")


@pytest.mark.parametrize(
    "how", ["cut", "another number", pytest.param("every one", marks=pytest.mark.slow)]
)
def test_the_runs_of_a_part_that_was_changed_are_made_again(how, uninterrupted, caplog):
    finished(uninterrupted)
    before = Path("results/s/table.csv").read_bytes()
    part = min(Path("results/s/parts").iterdir())
    if how == "another number":
        edited = json.loads(part.read_text())
        edited["metrics"][0][4] = 0.001
        part.write_text(json.dumps(edited))
    elif how == "every one":  # each is made again under its own name
        for path in Path("results/s/parts").iterdir():
            path.write_bytes(b"")
    else:
        part.write_bytes(part.read_bytes()[:1000])
    assert main(["sweep", "s.yaml", "--jobs", "1"]) == 0
    assert f"{part}: was changed since it was written" in caplog.text
    assert Path("results/s/table.csv").read_bytes() == before


def test_files_of_others_in_the_folder_of_the_parts_stay(uninterrupted, caplog):
    finished(uninterrupted)
    others = ("notes.parquet", ".notes.partial", "notes.json", ".0123456789ab.json.partial")
    for name in others:
        Path("results/s/parts", name).write_text("mine")
    assert main(["sweep", "s.yaml", "--jobs", "1"]) == 0
    assert all(Path("results/s/parts", name).read_text() == "mine" for name in others)
    (told,) = [record.getMessage() for record in caplog.records]
    assert "parts: not of a sweep, left alone" in told and "notes.json and 1 more" in told


@pytest.mark.unix
@pytest.mark.parametrize("what", ["another program's file", "a pipe"])
def test_what_others_put_in_place_of_a_part_stays(what, uninterrupted, capsys):
    finished(uninterrupted)
    part = min(Path("results/s/parts").iterdir())
    part.unlink()
    if what == "a pipe":
        os.mkfifo(part)
    else:
        part.write_text('{"mine": 1}')
    before = part.lstat().st_ino, part.lstat().st_mtime_ns
    assert main(["sweep", "s.yaml", "--jobs", "1"]) == 1
    one_line(capsys, f"{part}: ")
    assert (part.lstat().st_ino, part.lstat().st_mtime_ns) == before


@pytest.mark.unix
@pytest.mark.parametrize("put", [os.mkfifo, os.mkdir])
def test_what_others_put_in_place_of_a_table_stays_and_so_do_the_other_tables(
    put, uninterrupted, capsys
):
    finished(uninterrupted)
    Path("results/s/table.csv").unlink()
    put("results/s/table.csv")
    assert main(["sweep", "s.yaml", "--jobs", "1"]) == 1
    one_line(capsys, "results/s/table.csv: ")
    assert not Path("results/s/table.csv").is_file()
    assert all(Path("results/s", name).exists() for name in TABLES)


@pytest.mark.unix
@pytest.mark.parametrize("what", ["parts", "a part"])
def test_a_link_in_place_of_parts_is_not_followed(what, uninterrupted, tmp_path, capsys):
    finished(uninterrupted)
    parts, elsewhere = Path("results/s/parts"), tmp_path / "elsewhere"
    if what == "a part":
        parts = min(parts.iterdir())
    parts.rename(elsewhere)
    parts.symlink_to(elsewhere)
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    assert main(["sweep", "s.yaml", "--jobs", "1"]) == 1
    one_line(capsys, "a link out of the result folder, which is not followed")
    assert all(path.read_bytes() == text for path, text in before.items())


def test_a_worker_that_plans_other_runs_is_refused(tmp_path):
    run = PointRun("0" * 12, load_scenario("street_1car_homo"), "here")
    with pytest.raises(UserError, match="is not the one that was planned with"):
        Parts(tmp_path).run([run], 1)


# The tests' own words


@contextmanager
def in_the_middle(*arguments: str) -> Iterator[subprocess.Popen[str]]:
    """A sweep of ``s.yaml`` in a process group of its own, of which some parts are done and some
    are not.
    """
    with begun(*arguments) as run:
        while not list(Path("results/s/parts").glob("[!.]*.json")):
            assert run.poll() is None, run.communicate()
            time.sleep(0.005)
        yield run


@contextmanager
def begun(*arguments: str) -> Iterator[subprocess.Popen[str]]:
    """A sweep of ``s.yaml`` in a process group of its own."""
    run = subprocess.Popen(
        [sys.executable, "-m", "genie_sim", "sweep", "s.yaml", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env={**os.environ, "PYTHONPATH": str(REPOSITORY)},
        # a background job ignores it
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    try:
        yield run
    finally:
        if run.poll() is None or processes_of(run.pid):
            os.killpg(run.pid, signal.SIGKILL)
        run.wait()


def processes_of(group: int) -> list[int]:
    """The processes of a group that are still doing something."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, of_group = path.read_text().rpartition(")")[2].split()[:3]
        except OSError:
            continue
        if int(of_group) == group and state != "Z":
            found.append(int(path.parent.name))
    return found


def is_worker(process: int) -> bool:
    try:
        return b"popen_loky" in Path(f"/proc/{process}/cmdline").read_bytes()
    except OSError:
        return False


def is_importing(process: int) -> bool:
    """Whether the process is a worker whose Python has begun, and would show where an interrupt
    struck it.
    """
    try:
        status = Path(f"/proc/{process}/status").read_text()
    except OSError:
        return False
    caught = re.search(r"SigCgt:\s+(\w+)", status)
    listens = caught is not None and int(caught[1], 16) & 1 << signal.SIGINT - 1
    return bool(listens) and is_worker(process)


def count_runs(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What is simulated in this process from now on."""
    simulated: list[str] = []
    measured = work.measured

    def counted(prepared: Prepared) -> object:
        simulated.append(prepared.scenario.name)
        return measured(prepared)

    monkeypatch.setattr(work, "measured", counted)
    return simulated


def runs_in_parts() -> set[str]:
    return {path.stem for path in Path("results/s/parts").glob("[!.]*.json")}


def finished(uninterrupted: Path) -> None:
    """The small sweep as if it had been run here."""
    write(SMALL)
    shutil.copytree(uninterrupted, "results/s")


def same_bytes(uninterrupted: Path) -> None:
    for name in TABLES:
        assert (Path("results/s") / name).read_bytes() == (uninterrupted / name).read_bytes(), name


def one_line(capsys: pytest.CaptureFixture[str], message: str) -> None:
    said = capsys.readouterr().err
    assert message in said
    assert said.count("\n") == 1, said
    assert "Traceback" not in said


@pytest.mark.slow
def test_a_sweep_run_again_has_the_same_metrics(uninterrupted, capsys):
    finished(uninterrupted)
    assert main(["rerun", "results/s"]) == 0
    assert "reproduced, the metrics of 12 runs" in capsys.readouterr().out
    part = min(Path("results/s/parts").glob("*.json"))
    kept = json.loads(part.read_text())
    kept["metrics"][0][4:8] = [0.001, "ms", None, None]
    kept["digest"] = work._digest(kept["metrics"])
    part.write_text(json.dumps(kept))
    assert main(["rerun", "results/s"]) == 1
    assert "1 of 12 runs do not reproduce" in capsys.readouterr().err


@pytest.mark.parametrize("change", ["no columns", "other values", "rows twice"])
def test_a_table_that_no_sweep_writes_is_refused(change, uninterrupted, capsys):
    finished(uninterrupted)
    path = "results/s/table.parquet"
    table = pq.read_table(path)
    changed = {
        "no columns": table.select(["point"]),
        "other values": table.set_column(
            table.schema.get_field_index("method"), "method", [[b"a"] * len(table)]
        ),
        "rows twice": pa.concat_tables([table, table]),
    }
    pq.write_table(changed[change], path)
    sign(Path("results/s"))
    assert main(["table", "results/s"]) == 1
    one_line(capsys, "results/s")
