"""Tables of made-up numbers in every format read as they did: every row, unit, sign and note."""

from __future__ import annotations

import csv
from dataclasses import replace

import pandas as pd
import pytest

from genie_sim.analysis import compare_tables, renderers, screen, summary
from genie_sim.analysis.seed_runs import SeedRuns
from genie_sim.analysis.verdict import verdicts
from genie_sim.kinds import Run as LoadedRun
from genie_sim.record.records import new_tables
from genie_sim.record.results import MetricValue, Run
from genie_sim.report.result import Comparison
from tests import make, outline
from tests.make import METHODS


def made(seed: int, lift: float = 1.0, speed: float = 1.0) -> Run:
    """A run with response times, reuse, resources, correctness and energy."""
    tables = make.tables(seed=seed, lift=lift, speed=speed)
    scenario = {"name": "made_up", "lift": lift, "seed": seed, "edges": [{}, {}]}
    run = make.run_of(tables=tables, **scenario)
    measured = [*run.measured]
    for place, method in enumerate(METHODS):
        for number, (name, unit) in enumerate(
            (
                ("streaming_f1", "1"),
                ("object_precision", "1"),
                ("object_recall", "1"),
                ("ghost_share", "1"),
                ("energy_per_frame", "J"),
                ("bytes_up_per_frame", "B"),
            )
        ):
            value = (0.2 + 0.1 * place + 0.01 * number + 0.001 * seed) * (1 if unit == "1" else 50)
            ends = value * 0.9, value * 1.2
            measured.append(MetricValue(name, method.name, "all", "", value, unit, *ends, n=60))
    empty = {name: table.columns() for name, table in new_tables().items()}
    parts = ("traces", "plugins", "sources", "source", "devices")
    about = {part: {} for part in parts}
    return replace(
        run,
        run_id=f"0123456789a{seed}",
        facts={"genie_sim": "1", **about, **run.facts},
        tables=empty | run.tables,
        measured=measured,
    )


@pytest.fixture(scope="module")
def one() -> Run:
    return made(1)


@pytest.fixture(scope="module")
def seeds(one: Run) -> SeedRuns:
    return SeedRuns([one, made(2), made(3)], label="three seeds")


def test_one_run(one: Run):
    for name, text in (
        ("terminal", screen.text(one, 80)),
        ("narrow terminal", screen.text(one, 50)),
        ("terminal, all rows", screen.text(one, 80, ())),
        ("markdown", summary.markdown(one)),
        ("csv", summary.table(one, "csv")),
        ("markdown table", summary.table(one, "markdown")),
        ("latex", summary.table(one, "latex")),
        ("notebook", LoadedRun.of(one)._repr_html_().replace("<tr>", "\n<tr>")),
    ):
        outline.check_lines(f"table of one run, {name}", text.splitlines())


def test_several_seeds(seeds: SeedRuns):
    for name, text in (
        ("terminal", screen.text(seeds, 80)),
        ("markdown", summary.markdown(seeds)),
        ("latex", summary.table(seeds, "latex")),
    ):
        outline.check_lines(f"table of seeds, {name}", text.splitlines())


def test_a_comparison(one: Run):
    comparison = Comparison([one, made(1, lift=2.0, speed=1.5)], labels=["before", "after"])
    compared = comparison.compared
    for name, text in (
        ("markdown", compare_tables.text(compared, "markdown")),
        ("csv", compare_tables.text(compared, "csv")),
        ("latex", compare_tables.text(compared, "latex")),
        ("sentences", "\n".join([*verdicts(compared), compare_tables.about(compared)])),
        ("notebook", comparison._repr_html_().replace("<tr>", "\n<tr>")),
    ):
        outline.check_lines(f"table of a comparison, {name}", text.splitlines())


def test_each_line_of_a_csv_has_a_cell_for_each_name():
    table = pd.DataFrame({"rate": [0.1, 0.5], "metric": ["m", "m"], "value": [1.0, None]})
    names, *rows = csv.reader(renderers.csv_of_table(table).splitlines())
    assert [(row[0], len(row)) for row in rows] == [("0.1", len(names)), ("0.5", len(names))]
    assert names[:2] == ["rate", "metric"]
