"""Small worlds that the conformance tests run: two cars, two edges, one street of the tests' own,
two seconds.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from genie_sim.base.settings import from_plain
from genie_sim.record.log import Log
from genie_sim.record.records import Tables, new_tables
from genie_sim.record.tables import Table
from genie_sim.runs import build
from genie_sim.runs.prepare import prepare
from genie_sim.runs.simulate import simulate
from genie_sim.scenario.methods import MethodEntry
from genie_sim.scenario.reading import read_scenario
from genie_sim.scenario.scenario import Scenario
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


def arrow(written: Tables) -> dict[str, pa.Table]:
    """The tables as a file has them, texts as such."""
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, table in written.items():
            table.write(Path(folder) / name)
            rows = pq.read_table(Path(folder) / name)
            texts = [field for field in rows.schema if pa.types.is_dictionary(field.type)]
            for field in texts:
                column = rows[field.name].cast(pa.string())
                rows = rows.set_column(rows.schema.get_field_index(field.name), field.name, column)
            found[name] = rows
    return found


def of(method: str, found: Mapping[str, pa.Table]) -> dict[str, pa.Table]:
    """The rows of one method in every table, without those that only a car's first method has: its
    poses, and the judgement of the zero-delay detector.
    """
    own = {}
    for name, rows in found.items():
        if name == "poses":
            continue
        mine = pc.equal(rows["method"], method)
        if name == "held":
            mine = pc.and_(mine, pc.not_equal(rows["what"], "zero_delay"))
        own[name] = rows.filter(mine)
    return own


def same(one: Mapping[str, Any], other: Mapping[str, Any]) -> None:
    """Raises where two sets of tables are not the same to the last bit."""
    assert one.keys() == other.keys()
    for name, rows in one.items():
        assert rows.equals(other[name]), f"{name}:\n{rows}\n{other[name]}"


def check_twice_the_same(scenario: Scenario) -> Tables:
    """Two runs give the same bytes; returns the tables of the first."""
    first = simulated(scenario)
    same(arrow(first), arrow(simulated(scenario)))
    return first


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
    setting: Callable[[Sequence[Any]], Scenario], methods: Sequence[Any] = ALL
) -> Tables:
    """Every method gives the same bytes alone and after the others, so that nothing that a scenario
    names keeps state from one method to the next. Returns the tables of all of them.
    """
    written = simulated(setting(methods[::-1]))
    together = arrow(written)
    for method in methods:
        name = from_plain(MethodEntry, method).name
        same(of(name, arrow(simulated(setting([method])))), of(name, together))
    return written
