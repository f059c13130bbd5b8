"""What is taken during the warm-up is simulated, but nowhere counted."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

from genie_sim.analysis import compare_tables, metrics, screen, summary
from genie_sim.analysis.compare import compare
from genie_sim.analysis.seed_runs import SeedRuns
from genie_sim.base.errors import UserError
from genie_sim.record.columns import Columns
from genie_sim.record.records import SCHEMAS
from genie_sim.record.results import Run
from genie_sim.report import pages
from genie_sim.report.replay import replay_data
from genie_sim.runs.folder import run_in_memory
from genie_sim.scenario.reading import load_scenario

WARM_UP_NS = 1_000_000_000
METHODS = ["remote", "genie", {"name": "paced", "method": "recommended"}]
SHORT = [f"cars[{car}].route.window=[0 s, 3 s]" for car in range(2)]


OF_ALL = f"methods={METHODS}".replace("'", '"')


def run(warm_up: str) -> Run:
    return run_in_memory(
        load_scenario("street_2car_hetero", [*SHORT, f"warm_up={warm_up}", OF_ALL])
    )


@pytest.fixture(scope="module")
def runs() -> tuple[Run, Run]:
    """The same without and with a warm-up."""
    return run("0 s"), run("1 s")


def after(name: str, table: Columns) -> Columns:
    """The rows that are not of the warm-up."""
    column = SCHEMAS[name].instant
    return table.rows(~(table.floats(column) < WARM_UP_NS)) if column else table


def cells(column: Any) -> list[Any]:
    return ["" if value is None or value != value else value for value in column.tolist()]


def test_a_warm_up_leaves_the_rows_after_it_as_they_are(runs: tuple[Run, Run]):
    whole, warm = runs
    for name in SCHEMAS:
        if name in ("hosts", "resources"):
            continue
        expected = after(name, whole.tables[name])
        for column in expected.names:
            assert cells(warm.tables[name][column]) == cells(expected[column]), (name, column)
    assert 0 < len(warm.tables["frames"]) < len(whole.tables["frames"])
    samples = after("resources", whole.tables["resources"])
    for column in samples.names:
        if column != "queue_max":
            assert cells(warm.tables["resources"][column]) == cells(samples[column]), column
    most = warm.tables["resources"]["queue_max"]
    assert (most <= samples["queue_max"]).all() and (most < samples["queue_max"]).any()


def test_a_warm_up_has_the_metrics_of_the_rows_after_it(runs: tuple[Run, Run]):
    whole, warm = runs
    tables = {name: after(name, table) for name, table in whole.tables.items()}
    tables["resources"] = tables["resources"].assign(
        queue_max=warm.tables["resources"]["queue_max"]
    )
    tables["hosts"] = hosts_after(whole, warm.tables["hosts"])
    expected = metrics.compute(whole.methods, tables)
    assert list(warm.measured) == expected and list(warm.measured) != list(whole.measured)


def hosts_after(whole: Run, warm: Columns) -> Columns:
    """What hosts used after the warm-up: what they used in all, less what samples say of it. What
    an interface did no sample tells.
    """
    samples = whole.tables["resources"]
    first = samples.rows(samples["t_ns"] == WARM_UP_NS)
    kinds = {"accelerator_ns": ".accelerator", "cpu_ns": ".cpu"}
    hosts = whole.tables["hosts"]
    assert cells(hosts["host"]) == cells(warm["host"])
    used: dict[str, Any] = {
        "begin_ns": np.maximum(hosts["begin_ns"], WARM_UP_NS),
        **{name: warm[name] for name in ("transfer_ns", "tail_ns", "batches", "pictures")},
    }
    rows = list(zip(hosts["method"].tolist(), hosts["host"].tolist(), strict=True))
    for column, suffix in kinds.items():
        before = [total(first, method, f"{host}{suffix}", "busy_ns") for method, host in rows]
        used[column] = hosts[column] - np.array(before, dtype=np.int64)
    for column in ("bytes_up", "bytes_down"):
        before = []
        for method, host in rows:
            edge = host.replace("car", "edge")
            link = f"{host}->{edge}" if column == "bytes_up" else f"{edge}->{host}"
            before.append(total(first, method, link, "bytes"))
        used[column] = hosts[column] - np.array(before, dtype=np.int64)
    return hosts.assign(**used)


def total(samples: Columns, method: str, resource: str, column: str) -> int:
    found = samples.where(method=method, resource=resource)
    return int(found.floats(column)[0]) if len(found) else 0


def test_a_warm_up_longer_than_the_run_is_one_clear_line():
    with pytest.raises(UserError) as error:
        run("1 min")
    assert str(error.value) == (
        "--set warm_up=1 min: warm_up: 60 s leaves nothing to count: the last frame is taken at"
        " 3.2 s"
    )


def test_everything_says_what_is_not_counted(runs: tuple[Run, Run]):
    whole, warm = runs
    said = "without the first 1 s"
    shown: Sequence[Callable[[Run], str]] = (
        screen.header,
        summary.markdown,
        lambda one: one.footer,
        lambda one: pages.of_run(one, {}),
        lambda one: SeedRuns([one]).footer,
        lambda one: compare_tables.about(compare([one])),
        lambda one: pages.of_seeds(SeedRuns([one]), {}),
    )
    for show in shown:
        assert said in show(warm) and said not in show(whole)
    shown, _ = replay_data(warm, 0)
    assert shown is not None and shown["begin_us"] == 1_000_000
