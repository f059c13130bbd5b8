"""What a table says of object maps is what the maps hold, under every freshness policy."""

from __future__ import annotations

from typing import Any

import pandas as pd
import pytest

from genie_sim.core.freshness import FRESHNESS
from genie_sim.runs.folder import run_in_memory
from genie_sim.scenario.reading import load_scenario

SETTINGS: dict[str, dict[str, Any]] = {"ttl": {"ttl": "400 ms"}}
LOST_EDGE = {
    "fault": "tests.conformance.own:Crash",
    "target": "edge1",
    "begin": "1 s",
    "end": "1500 ms",
}


def short_run(policy: str, *settings: str) -> Any:
    freshness = {"name": policy, **SETTINGS.get(policy, {})}
    window = [f"cars[{car}].route.window=[3 s, 6 s]" for car in range(3)]
    overrides = [*window, "methods=[genie]", f"genie.object_map.freshness={freshness}", *settings]
    return run_in_memory(load_scenario("street_3car_hetero", overrides))


def open_objects(rows: pd.DataFrame) -> pd.DataFrame:
    """How many objects of a Genie are open after each instant with a change: ``t_ns``, ``open``.

    Raises AssertionError where an object is forgotten twice, or comes back.
    """
    is_open: dict[int, bool] = {}
    counts = []
    for t_ns, changes in rows.groupby("t_ns"):
        for number, confidence in zip(changes["object"], changes["confidence"], strict=True):
            assert is_open.get(number, True), f"object {number} was forgotten before {t_ns} ns"
            is_open[number] = pd.notna(confidence)
        counts.append((t_ns, sum(is_open.values())))
    return pd.DataFrame(counts, columns=["t_ns", "open"])


def assert_open_rows_are_stored_objects(run: Any) -> None:
    of_maps = run.lookups[run.lookups["kind"].isin(["sighting", "boost"])]
    genies = of_maps["genie"].unique()
    assert len(genies) >= 4, "of cars and of edges"
    for genie in genies:
        stored = of_maps[of_maps["genie"] == genie].groupby("t_ns")["entries"].last().reset_index()
        rows = open_objects(run.objects[run.objects["genie"] == genie])
        both = pd.merge_asof(stored, rows, on="t_ns").fillna({"open": 0})
        assert (both["open"] == both["entries"]).all(), genie
        assert len(both) > 20 and both["entries"].max() > 3


@pytest.mark.parametrize("policy", FRESHNESS)
def test_open_rows_are_the_stored_objects_whenever_a_map_is_asked(policy: str):
    run = short_run(policy)
    assert_open_rows_are_stored_objects(run)
    forgets = policy not in ("never", "corroborate")
    assert run.objects["confidence"].isna().any() == forgets


@pytest.mark.parametrize("policy", ["never", "recommended"])
def test_objects_of_a_lost_map_end_and_their_numbers_are_not_reused(policy: str):
    run = short_run(policy, f"faults=[{LOST_EDGE}]")
    of_edge = run.objects[run.objects["genie"] == "edge1/genie"]
    lost = of_edge[of_edge["confidence"].isna() & (of_edge["t_ns"] == 10**9)]
    after = of_edge[of_edge["t_ns"] > 10**9]
    assert len(lost) > 3 < len(after)
    assert after["object"].min() > lost["object"].max()
    assert_open_rows_are_stored_objects(run)


def test_an_object_of_a_map_that_tracks_keeps_its_number_while_it_moves():
    rows = short_run("recommended").objects
    places = rows.groupby(["genie", "object"], observed=True)["east_m"].nunique()
    assert places.max() > 10
