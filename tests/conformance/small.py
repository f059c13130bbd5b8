"""Small worlds that the conformance tests run: two cars, two edges, one street of the tests' own,
two seconds.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import pandas as pd

from genie_sim.record.columns import Columns
from genie_sim.record.log import Log
from genie_sim.record.records import Tables, new_tables
from genie_sim.record.tables import Table
from genie_sim.runs import build
from genie_sim.runs.prepare import prepare
from genie_sim.runs.simulate import Observer, simulate
from genie_sim.scenario.reading import read_scenario
from genie_sim.scenario.scenario import Scenario
from genie_sim.sim.world import World

CAMERAS = [
    {"name": "camera_0", "recording": "left"},
    {"name": "camera_1", "recording": "right", "phase": "30 ms"},
]
FRAMES = 2 * 20  # of each car
ALL = ("genie", "local", "remote")
Rows = dict[str, list[dict[str, Any]]]  # of each table


def scenario(methods: Sequence[Any] = ALL, **settings: Any) -> Scenario:
    """Cars with an edge each, on links too slow for all that they see; ``settings`` as in YAML."""
    usual = {
        "name": "small",
        "methods": list(methods),
        "perception": {"source": "tests.conformance.own:Street"},
        "cameras": CAMERAS,
        "edges": [{"name": f"edge{i}", "device": "agx_xavier"} for i in (1, 2)],
        "cars": [car(i) for i in (1, 2)],
    }
    return read_scenario(usual | settings)


def car(number: int, **settings: Any) -> dict[str, Any]:
    usual = {
        "name": f"car{number}",
        "device": "jetson_tx2",
        "edge": f"edge{number}",
        "link": "ethernet_100m",
    }
    return usual | settings


def tables(scenario: Scenario) -> dict[str, pd.DataFrame]:
    """Every table of a run of all its methods, by name, ``None`` for what is not known."""
    return {name: _plain(table) for name, table in simulated(scenario).items()}


def frames(scenario: Scenario) -> pd.DataFrame:
    """The table of frames alone."""
    return _plain(simulated(scenario)["frames"])


def simulated(scenario: Scenario) -> Tables:
    """Every table of a run of all its methods, by name."""
    return simulate(prepare(scenario))


def _plain(table: Table) -> pd.DataFrame:
    values = table.to_frame().astype(object)
    return values.where(values.notna(), None)


def rows(written: Tables) -> Rows:
    """The rows of every table, ``None`` for what is not known."""
    return {name: _rows(table.columns()) for name, table in written.items()}


def _rows(columns: Columns) -> list[dict[str, Any]]:
    known = {
        name: [None if value != value else value for value in columns[name].tolist()]
        for name in columns.names
    }
    return [dict(zip(known, row, strict=True)) for row in zip(*known.values(), strict=True)]


def of(method: str, written: Rows) -> Rows:
    """The rows of one method in every table, whatever its name, without those that only a car's
    first method has: its poses, and the judgement of the zero-delay detector.
    """
    return {
        name: [
            row | {"method": None}
            for row in rows
            if row["method"] == method and row.get("what") != "zero_delay"
        ]
        for name, rows in written.items()
        if name != "poses"
    }


def same(rows: Rows, others: Rows) -> None:
    """Raises where two sets of tables are not the same to the last bit."""
    assert rows.keys() == others.keys()
    for name in rows:
        assert rows[name] == others[name], name


def world(scenario: Scenario, place: int = 0) -> tuple[World, Tables]:
    """The world of one of the scenario's methods, ready to run, and the tables that it fills."""
    prepared, filled = prepare(scenario), new_tables()
    entry = scenario.methods[place]
    return World(
        build.setup(prepared, entry), entry.new(), Log(entry.name, filled, scenario.record)
    ), filled


def check_conserved(rows: pd.DataFrame, methods: Sequence[str]) -> None:
    """Every frame that was published is there once, and has a result or was dropped: nothing is
    in flight any more, and nothing is both.
    """
    counts = rows.groupby(["method", "car"], observed=True).size().to_dict()
    assert counts == {(method, f"car{i}"): FRAMES for method in methods for i in (1, 2)}
    assert not rows.duplicated(["method", "car", "stream", "stamp_ns"]).any()
    answered, dropped = rows["result_answer_ns"].notna(), rows["drop"].notna()
    assert not (answered & dropped).any(), "a result, and dropped"
    lost = rows[~(answered | dropped)]
    assert lost.empty, f"neither answered nor dropped, with nothing in flight:\n{lost}"
    first = rows["first_answer_ns"].dropna()
    assert (first >= rows.loc[first.index, "stamp_ns"]).all(), "answered before it was taken"


def check_order_is_irrelevant(
    setting: Callable[[Sequence[Any]], Scenario],
    methods: Sequence[Any] = ALL,
    observer: Observer | None = None,
) -> Tables:
    """A method gives the same rows first and ``again`` after others, so that nothing that a
    scenario names keeps state from one to the next. Returns the tables of all of them, also of
    ``again``; ``observer`` sees their worlds.
    """
    again = {"name": "again", "method": methods[0]}
    written = simulate(prepare(setting([*methods, again])), observer=observer)
    same(*(of(name, rows(written)) for name in (methods[0], "again")))
    return written
