"""Runs compared: by seeds, by blocks of one second, what is refused, and what is written."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import genie_sim as gs
from genie_sim.analysis import compare_tables, metrics, renderers
from genie_sim.analysis.compare import BLOCKS, SEEDS, Difference, compare
from genie_sim.analysis.tidy import cells_of
from genie_sim.base.errors import UserError
from genie_sim.base.text import number_text
from genie_sim.cli import main as cli
from genie_sim.record.columns import Columns
from genie_sim.record.results import MethodInfo, Run
from genie_sim.report import comparison, pages
from genie_sim.report.output import Output
from genie_sim.runs.folder import run_in_memory, run_to_folder
from genie_sim.scenario.reading import load_scenario

WINDOW = "cars[0].route.window=[2 s, 5 s]"
SLOWER = "edges[0].device=jetson_tx2"


def ran(*settings: str, seed: int = 1, window: str = WINDOW) -> Run:
    return run_in_memory(
        load_scenario("street_1car_hetero", [window, "record=[answers, held]", *settings], seed)
    )


@pytest.fixture(scope="module")
def usual() -> list[Run]:
    return [ran(seed=seed) for seed in (1, 2, 3)]


@pytest.fixture(scope="module")
def slower() -> list[Run]:
    return [ran(SLOWER, seed=seed) for seed in (1, 2, 3)]


def row(rows: list[Difference], metric: str, arm: str) -> Difference:
    (found,) = (
        one for one in rows if (one.metric, one.arm.method.name) == (metric, arm) and one.against
    )
    return found


def measured(run: Run, metric: str, method: str) -> float:
    (found,) = (
        one.value
        for one in run.measured
        if (one.metric, one.method, one.placement, one.component) == (metric, method, "all", "")
    )
    assert found is not None
    return found


def test_its_numbers_are_those_of_the_run(usual: list[Run]):
    made = compare(usual[:1])
    assert {"first_answer_mean", "streaming_f1", "energy_per_frame"} <= {
        one.metric for one in made.rows
    }
    for one in made.rows:
        assert one.value == pytest.approx(measured(usual[0], one.metric, one.arm.label))


def test_methods_of_one_run_are_compared_by_blocks_with_the_first(usual: list[Run]):
    made = compare(usual[:1], ["remote", "genie"])
    assert [arm.label for arm in made.arms] == ["remote", "genie"] and not made.settings
    found = row(list(made.rows), "first_answer_mean", "genie")
    assert (found.by, found.against, found.n) == (BLOCKS, made.arms[0], 4), (
        "three seconds, begun within one"
    )
    gap = measured(usual[0], "first_answer_mean", "genie") - measured(
        usual[0], "first_answer_mean", "remote"
    )
    assert found.difference == pytest.approx(gap)
    assert found.low is not None and found.high is not None and found.low < gap < found.high < 0
    assert "blocks" in compare_tables.about(made) and "other seeds" in compare_tables.about(made)


def test_a_run_alone_is_compared_with_the_best_baseline_of_each_metric(usual: list[Run]):
    made = compare(usual[:1])
    rows = {one.metric: one for one in made.rows if one.against}
    assert {one.arm.label for one in rows.values()} == {"genie"}
    for metric, best in {"first_answer_mean": min, "ghost_share": min, "streaming_f1": max}.items():
        values = {name: measured(usual[0], metric, name) for name in ("local", "remote")}
        assert rows[metric].against.label == best(values, key=values.__getitem__)
        assert rows[metric].against_value == best(values.values())
    assert {one.against.label for one in rows.values()} == {"local", "remote"}
    assert {one.against.label for one in compare(usual).rows if one.against} == {"local", "remote"}
    named = compare(usual[:1], ["local", "remote", "genie"])
    pairs = {(one.against.label, one.arm.label) for one in named.rows if one.against}
    assert pairs == {("local", "remote"), ("local", "genie")}


def test_a_block_interval_by_hand(usual: list[Run]):
    """Three seconds of one car, as many frames in each: the t interval of the three paired
    differences of means.
    """
    frames = usual[0].frames.copy()
    frames["received_ns"] = frames["stamp_ns"]
    seconds = frames["stamp_ns"] // 10**9 - frames["stamp_ns"].min() // 10**9
    frames = (
        frames[seconds < 3]
        .groupby(["method", frames["stamp_ns"] // 10**9], observed=True)
        .head(4)
        .copy()
    )
    seconds = (frames["stamp_ns"] // 10**9 - frames["stamp_ns"].min() // 10**9).to_numpy()
    late_ms = np.where(frames["method"] == "genie", 10.0, 20.0 + np.array([1.0, 4.0, 7.0])[seconds])
    frames["first_answer_ns"] = frames["stamp_ns"] + (late_ms * 1e6).astype(int)
    tables = {**usual[0].tables, "frames": Columns.of(frames)}
    measured_anew = metrics.compute(usual[0].methods, tables)
    made = compare(
        [replace(usual[0], tables=tables, measured=measured_anew)],
        ["remote", "genie"],
    )
    found = row(list(made.rows), "first_answer_mean", "genie")
    half = 4.302653 * 3.0 / np.sqrt(3)
    assert (found.difference, found.low, found.high) == pytest.approx(
        (-14.0, -14.0 - half, -14.0 + half), rel=1e-6
    )


def test_settings_are_compared_seed_by_seed(usual: list[Run], slower: list[Run]):
    """Each seed with the same seed of the reference, whatever the order in which runs are given."""
    made = compare([*usual, *slower[::-1]], ["remote"])
    values = [measured(run, "first_answer_mean", "remote") for run in slower]
    gaps = [
        value - measured(reference, "first_answer_mean", "remote")
        for value, reference in zip(values, usual, strict=True)
    ]
    assert len(set(values)) == len(set(gaps)) == 3, "all seeds differ, or nothing is tested"
    found = row(list(made.rows), "first_answer_mean", "remote")
    half = 4.302653 * np.std(gaps, ddof=1) / np.sqrt(3)
    assert (found.by, found.n) == (SEEDS, 3)
    assert found.value == pytest.approx(np.mean(values))
    assert (found.difference, found.low, found.high) == pytest.approx(
        (np.mean(gaps), np.mean(gaps) - half, np.mean(gaps) + half), rel=1e-6
    )
    found = row(list(made.rows), "streaming_f1", "remote")
    assert found.high is not None and found.high < 0, "a slower edge is less right"
    assert made.settings["scenario.edges[0].device"] == ["'quadro_rtx_4000'", "'jetson_tx2'"]
    assert not any("seed" in path for path in made.settings)
    devices = {path: values for path, values in made.settings.items() if "devices" in path}
    assert devices == {
        "devices.quadro_rtx_4000": ["'Intel Xeon E5-2650 with NVIDIA Quadro RTX 4000'", "-"]
    }, "one line a device"


def test_each_method_is_compared_with_itself_under_the_first_setting(
    usual: list[Run], slower: list[Run]
):
    made = compare([usual[0], slower[0]], ["remote", "genie"])
    pairs = {(one.arm.label, one.against.label) for one in made.rows if one.against}
    first, second = made.names
    assert pairs == {(f"{second}: {name}", f"{first}: {name}") for name in ("remote", "genie")}
    titles = [arm.title for arm in made.arms]
    assert titles == [
        f"{name}: {title}" for name in made.names for title in ("remote (R)", "Genie (DG)")
    ]


def test_settings_are_called_by_what_differs_where_that_is_short(
    usual: list[Run], slower: list[Run]
):
    made = compare([*usual, *slower], ["remote"])
    assert list(made.names) == ["device quadro_rtx_4000", "device jetson_tx2"]
    table = compare_tables.pairs(made)
    assert renderers.html_table(table) in pages.of_comparison(made, {})
    rows = {(metric, arm): cells for metric, arm, *cells in table.texts()}
    assert {arm for _, arm in rows} == {"device jetson_tx2: remote (R)"}, (
        "the first has nothing to be compared with"
    )
    mean = rows["first answer, mean [ms]", "device jetson_tx2: remote (R)"]
    gap = row(list(made.rows), "first_answer_mean", "remote")
    theirs = next(one for one in made.rows if one.metric == "first_answer_mean" and not one.against)
    assert mean[:3] == [
        f"{gap.value:.3g}",
        theirs.arm.title,
        f"{theirs.value:.3g}",
    ]
    assert mean[3].startswith(f"{gap.difference:+.3g} (")


def test_a_percentile_of_few_answers_has_no_interval_over_seeds(
    usual: list[Run], slower: list[Run]
):
    made = compare([*usual, *slower], ["remote"], metrics=["first_answer_p50", "first_answer_p99"])
    intervals = {one.metric: one.low for one in made.rows if one.against}
    assert intervals["first_answer_p50"] is not None and intervals["first_answer_p99"] is None


def test_with_one_common_seed_its_blocks_are_paired_and_it_says_so(
    usual: list[Run], slower: list[Run]
):
    made = compare([*usual[:2], slower[1]], ["remote"])
    found = row(list(made.rows), "ghost_share", "remote")
    gap = measured(slower[1], "ghost_share", "remote") - measured(usual[1], "ghost_share", "remote")
    assert (found.by, found.difference) == (BLOCKS, pytest.approx(gap))


@pytest.fixture(scope="module")
def two_cars() -> list[Run]:
    settings = ["record=[answers, held]", "methods=[remote]", WINDOW]
    return [
        run_in_memory(load_scenario("street_2car_hetero", settings, seed)) for seed in (1, 2, 3)
    ]


def test_runs_of_other_cars_are_paired_by_seed_and_only_common_seeds_count(
    usual: list[Run], two_cars: list[Run]
):
    made = compare([*usual, *two_cars[:2]], ["remote"])
    found = row(list(made.rows), "first_answer_mean", "remote")
    values, others = (
        [measured(run, "first_answer_mean", "remote") for run in runs]
        for runs in (two_cars[:2], usual[:2])
    )
    assert found.value == pytest.approx(np.mean(values)), "of the seeds that both have"
    assert found.against_value == pytest.approx(np.mean(others))
    assert found.difference == pytest.approx(found.value - found.against_value)
    assert (found.by, found.n, found.low) == (SEEDS, 2, None), "two seeds tell little"
    about = compare_tables.about(made)
    assert "Only the common seeds 1, 2: street_1car_hetero has seeds 1 to 3; " in about
    assert "No intervals of fewer than 3 seeds." in about
    for format in ("markdown", "latex"):
        assert "Only the common seeds 1, 2" in compare_tables.text(made, format)


def test_one_run_each_of_other_cars_is_compared_by_blocks(usual: list[Run], two_cars: list[Run]):
    made = compare([usual[0], two_cars[0]], ["remote"])
    found = row(list(made.rows), "first_answer_mean", "remote")
    alone = {one.arm: one for one in made.rows if one.metric == "first_answer_mean"}
    assert found.by == BLOCKS
    assert found.difference == pytest.approx(alone[found.arm].value - alone[found.against].value)
    assert found.low is not None and found.low < found.difference < found.high


def test_many_intervals_come_with_how_many_miss(usual: list[Run]):
    made = compare(usual[:1])
    count = sum(one.low is not None for one in made.rows)
    assert f"Of {count} intervals, about one in twenty misses" in compare_tables.about(made)


def test_what_cannot_be_compared_is_refused_in_one_line(usual: list[Run]):
    with pytest.raises(UserError, match=r"no seed in common: .*seed 1; .*seed 2"):
        compare([usual[0], ran(SLOWER, seed=2)])
    with pytest.raises(UserError, match="nothing to compare"):
        compare(usual[:1], ["genie"])
    with pytest.raises(UserError, match=r"unknown method 'gneie' \(did you mean 'genie'\?\)"):
        compare(usual[:1], ["gneie"])
    with pytest.raises(UserError, match="given twice"):
        compare([usual[0], usual[0]])
    with pytest.raises(UserError, match="unknown format 'md'"):
        compare_tables.text(compare(usual[:1]), "md")


def read_again(run: Run, **scenario: object) -> Run:
    """The run as if its trace had been written anew."""
    traces = run.facts["traces"] | {"car1": "0" * 64}
    scenario = run.facts["scenario"] | scenario
    return replace(run, run_id="0" * 12, facts=run.facts | {"traces": traces, "scenario": scenario})


def test_runs_that_read_other_data_are_two_settings(usual: list[Run]):
    made = compare([usual[0], read_again(usual[0])])
    assert len(made.names) == 2 and list(made.settings) == ["traces.car1"]
    stalled = compare([usual[0], read_again(usual[0], faults=[{"fault": "stall"}])])
    assert stalled.settings["scenario.faults[0]"] == ["-", "{'fault': 'stall'}"]
    page = pages.of_comparison(made, {})
    assert '<h2 id="h-figures">' not in page and "None" not in page, "no heading of nothing"
    facts = usual[0].facts | {"scenario": usual[0].facts["scenario"] | {"name": "copy"}}
    renamed = replace(usual[0], run_id="0" * 12, facts=facts)
    for results, is_one_setting in ((usual[:1], True), ([usual[0], renamed], False)):
        page = pages.of_comparison(compare(results), {})
        assert "None" in page and ("within a setting" in page) == is_one_setting
    with pytest.raises(UserError, match="no seed in common"):
        compare([usual[0], read_again(usual[1])])


def test_runs_of_one_seed_whose_worlds_differ_are_not_called_the_same(usual: list[Run]):
    """The seed decides a world's digest, too, so that it tells no settings apart."""
    in_town = {"perception": {"source": "town"}}
    scenario = usual[0].facts["scenario"] | in_town
    first = replace(usual[0], facts=usual[0].facts | {"scenario": scenario})
    with pytest.raises(UserError, match=r"same setting and seed, in traces\.car1$"):
        compare([first, read_again(usual[0], **in_town)])
    assert len(compare([first, read_again(usual[1], **in_town)]).names) == 1


@dataclass(frozen=True)
class Cells:
    """A sweep, as far as it is compared."""

    cells: Mapping[str, Mapping[int, Run]]


def test_cells_of_a_sweep_are_compared_alone_and_with_those_of_another():
    axes = pd.MultiIndex.from_product([[0.1, 0.5], [1, 2], ["remote", "genie"]])
    table = axes.to_frame(index=False, name=["rate", "seed", "method"])
    table = table.assign(metric="streaming_f1", placement="all", component="", n=100)
    table["value"] = table["rate"] + np.where(table["method"] == "genie", 0.25, 0.0)
    methods = [MethodInfo(name, name, baseline=False) for name in ("remote", "genie")]
    about = {"name": "s", "genie_sim": "1", "origin": []}
    sweep = Cells(cells_of(table, ["rate"], methods, **about))
    gains = [one.difference for one in compare([sweep]).rows if one.against]
    assert gains == pytest.approx([0.25, 0.25])
    close = table.assign(rate=np.where(table["rate"] < 0.3, 1e6, 1e6 + 1))
    assert [*cells_of(close, ["rate"], methods, **about)] == ["rate 1e+06", "rate 1000001.0"]
    with pytest.raises(UserError, match=r"two settings are called 'rate 0\.1'"):
        cells_of(table.replace({"rate": {0.5: "0.1"}}), ["rate"], methods, **about)
    again = Cells(cells_of(table.assign(value=table["value"] / 2), ["rate"], methods, **about))
    half = Cells({cell: runs for cell, runs in again.cells.items() if cell == "rate 0.5"})
    assert (
        compare([sweep, half], labels=["a", "b"]).left_out
        == "Only settings that all results have: 1."
    )
    made = compare([sweep, again], labels=["a", "b"])
    rows = {one.arm.label: one.difference for one in made.rows if one.against}
    assert rows["b, rate 0.5: genie"] == pytest.approx(-0.375) and len(rows) == 4
    assert not made.settings
    late = pd.concat([table.assign(seed=seed, value=table["value"] * seed) for seed in range(3)])
    for rows, has_interval in ((late.drop(columns="n"), True), (late.assign(n=19), False)):
        rows = rows.assign(metric="first_answer_p95").drop_duplicates(["rate", "seed", "method"])
        made = compare([Cells(cells_of(rows, ["rate"], methods, **about))])
        ends = {one.low is not None for one in made.rows if one.against}
        assert ends == {has_interval}, "how many answers is not known, or too few"
        assert ("percentile of too few" in compare_tables.about(made)) != has_interval


def test_tables_in_three_formats_hold_the_same_rows(usual: list[Run]):
    made = compare(usual[:1])
    rows = list(csv.DictReader(io.StringIO(compare_tables.text(made, "csv"))))
    pairs = [one for one in rows if one["against"]]
    values = {(one["metric"], one["method"]): one["value"] for one in rows if not one["against"]}
    for one in made.rows:
        assert float(values[one.metric, one.arm.label]) == pytest.approx(one.value, rel=1e-9)
    assert [(one["metric"], one["method"], one["against"], one["verdict"]) for one in pairs] == [
        (one.metric, one.arm.label, one.against.label, one.verdict)
        for one in made.rows
        if one.difference is not None
    ]
    assert {one["seed"] for one in rows} == {str(next(iter(made.arms[0].runs)))}
    without_interval = [one["n"] for one in pairs if not one["by"]]
    assert without_interval and not any(without_interval), "not known, and not zero"
    assert compare_tables.text(made).count("\n") == sum(bool(one.against) for one in made.rows) + 2
    latex = compare_tables.text(made, "latex")
    gap = next(row for row in made.rows if row.metric == "first_answer_mean" and row.against)
    assert r"first answer, mean [ms] & " in latex and r"\caption" in latex
    assert f"& {number_text(gap.difference, sign='+')}".replace("-", "$-$") in latex


@pytest.mark.slow
def test_the_page_has_figures_and_the_same_runs_give_the_same_bytes(
    usual: list[Run], tmp_path: Path
):
    folders = [tmp_path / "a", tmp_path / "b"]
    for folder in folders:
        page = comparison.write(compare(usual[:1]), folder)
        text = page.read_text(encoding="utf-8")
        assert (
            text.count("data:image/svg+xml") == 3
            and "default-src 'none'" in text
            and "img-src data:" in text
        )
    names = sorted(path.relative_to(folders[0]) for path in folders[0].rglob("*") if path.is_file())
    assert len(names) == 10
    for name in names:
        assert (folders[0] / name).read_bytes() == (folders[1] / name).read_bytes(), name


@pytest.mark.parametrize("about", ["run.json", "sweep.json", "verdicts.json"])
def test_a_comparison_replaces_no_figure_of_a_result(usual: list[Run], tmp_path: Path, about: str):
    (tmp_path / about).write_text("{}")
    with pytest.raises(UserError, match="a result is in that folder"):
        comparison.write(compare(usual[:1]), tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == [about]
    if about != "run.json":
        (tmp_path / "own.md").write_text("own")
        with pytest.raises(UserError, match="say where else"):
            renderers.write(tmp_path / "own.md", "table", "markdown")
        assert (tmp_path / "own.md").read_text() == "own"


@pytest.mark.slow
def test_the_command_and_the_library_say_the_same(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    made = run_to_folder(
        load_scenario("street_1car_hetero", [WINDOW]), tmp_path, output=Output(page=False)
    )
    assert (
        cli.main(["compare", str(made.folder), "--format", "csv", "--out", str(tmp_path / "page")])
        == 0
    )
    printed = capsys.readouterr().out
    in_hand = gs.compare(made.folder)
    assert printed == in_hand.text("csv")
    assert len(in_hand.table) == printed.count("\n") - 1 and in_hand.settings.empty
    assert (tmp_path / "page" / "compare.html").is_file()
    assert cli.main(["compare", str(made.folder), "--format", "html"]) == 1
    assert "format: unknown format 'html'" in capsys.readouterr().err
    assert cli.main(["compare", str(tmp_path)]) == 1
