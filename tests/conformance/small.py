"""Small worlds that the conformance tests run: two cars, two edges, one street of the tests' own, two seconds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from genie_sim import build, runner
from genie_sim.recording.log import Log
from genie_sim.recording.records import Tables
from genie_sim.scenario.scenario import Scenario, read_scenario
from genie_sim.sim.world import World

CAMERAS = [
    {"name": "camera_0", "recording": "left"},
    {"name": "camera_1", "recording": "right", "phase": "30 ms"},
]
FRAMES = 2 * 20  # of each car
ALL = ("local", "remote", "genie")


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


def tables(setting: Scenario) -> dict[str, pd.DataFrame]:
    """Every table of a run of all its methods, by name, texts as such."""
    found = {table.name: table.to_frame() for table in runner.simulate(runner.prepare(setting))}
    return {name: _plain(rows) for name, rows in found.items()}


def _plain(rows: pd.DataFrame) -> pd.DataFrame:
    """The values alone, ``None`` for what is not known: a column's type depends on what else ran."""
    values = rows.astype(object)
    return values.where(values.notna(), None)


def frames(setting: Scenario) -> pd.DataFrame:
    return tables(setting)["frames"]


def of(method: str, found: Mapping[str, pd.DataFrame]) -> dict[str, pd.DataFrame]:
    """The rows of one method in every table that has rows for every method."""
    mine = {name: rows[rows["method"] == method] for name, rows in found.items() if name != "poses"}
    return {name: _plain(rows.reset_index(drop=True)) for name, rows in mine.items()}


def same(one: Mapping[str, pd.DataFrame], other: Mapping[str, pd.DataFrame]) -> None:
    """Raises where two sets of tables are not the same to the last bit."""
    assert one.keys() == other.keys()
    for name, rows in one.items():
        pd.testing.assert_frame_equal(rows, other[name], check_exact=True, obj=name)


def world(setting: Scenario, place: int = 0) -> tuple[World, Tables]:
    """The world of one of the scenario's methods, ready to run, and the tables that it fills."""
    prepared, filled = runner.prepare(setting), Tables()
    entry = setting.methods[place]
    return World(
        build.setup(prepared, entry), build.method(entry), Log(entry.name, filled, setting.record)
    ), filled


def check_conserved(rows: pd.DataFrame, methods: Sequence[str]) -> None:
    """Every frame that was published is there once, and was freshly answered or dropped: nothing is in flight any more,
    and nothing is both."""
    counts = rows.groupby(["method", "car"], observed=True).size().to_dict()
    assert counts == {(method, f"car{i}"): FRAMES for method in methods for i in (1, 2)}
    assert not rows.duplicated(["method", "car", "stream", "stamp_ns"]).any()
    answered, dropped = rows["fresh_answer_ns"].notna(), rows["drop"].notna()
    assert not (answered & dropped).any(), "a fresh result, and dropped"
    lost = rows[~(answered | dropped)]
    assert lost.empty, f"neither answered nor dropped, with nothing in flight:\n{lost}"
    first = rows["first_answer_ns"].dropna()
    assert (first >= rows.loc[first.index, "stamp_ns"]).all(), "answered before it was taken"
