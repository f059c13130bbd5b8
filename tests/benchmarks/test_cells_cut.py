"""A town that is cut into cells has the same cars, frames and detections as the whole one."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from benchmarks import cells
from benchmarks.cells import (
    CUTS,
    JOINT,
    SHOWN,
    Setting,
    Tabled,
    apart,
    small_town,
    together,
    visits,
)
from genie_sim.build import Prepared
from genie_sim.errors import UserError
from genie_sim.scenario.scenario import load_scenario
from genie_sim.units import NS_PER_S

TINY = Setting(columns=2, rows=1, cars=4, drive_s=12.0)
SEED = 28  # with which two cars are handed over


@pytest.fixture(scope="module")
def joint() -> Prepared:
    return small_town(TINY, SEED)


@pytest.fixture(scope="module")
def ran(joint: Prepared) -> dict[str, Tabled]:
    return {cut: together(make(joint)) for cut, make in CUTS.items()}


def test_every_cut_has_the_frames_of_the_joint_run(joint: Prepared, ran: dict[str, Tabled]):
    assert len(joint.expanded.faults) == 2, "or nothing is cut"
    keys = {
        cut: sorted(one.frames[["car", "stream", "stamp_ns"]].itertuples(False, None))
        for cut, one in ran.items()
    }
    assert len(keys[JOINT]) == len(set(keys[JOINT])) == 4 * 120
    assert all(keys[cut] == keys[JOINT] for cut in CUTS)


def test_a_cut_run_is_judged_by_the_same_truth(ran: dict[str, Tabled]):
    """What is in view depends on the place, the time and the town: a visit that was shifted would
    see other things.
    """
    columns = ["car", "what", "stamp_ns", "visible_static"]
    seen = {
        cut: {row[:3]: row[3] for row in one.held[columns].itertuples(False, None)}
        for cut, one in ran.items()
    }
    assert sum(seen[JOINT].values()) > 0
    for cut in CUTS:
        both = seen[JOINT].keys() & seen[cut].keys()
        assert len(both) > 400 and all(seen[cut][one] == seen[JOINT][one] for one in both)


def test_visits_follow_each_other_without_a_gap(joint: Prepared):
    cars, drives = visits(joint)
    handed_over = cells.hand_overs(joint)
    for car in joint.expanded.cars:
        mine = [one for one in cars if one.name.partition(".")[0] == car.name]
        assert [one.edge for one in mine] == [
            car.edge,
            *(edge for _, edge in handed_over[car.name]),
        ]
        assert all(
            before.route.window_ns[1] == after.route.window_ns[0]
            for before, after in pairwise(mine)
        )
        assert (mine[0].route.window_ns[0], mine[-1].route.window_ns[1]) == (
            0,
            drives[car.name].duration_ns,
        )
        for one, (at_ns, _) in zip(mine[1:], handed_over[car.name], strict=True):
            assert one.route.start_ns == at_ns and drives[one.name] is drives[car.name]


def test_a_cell_by_itself_knows_its_own_edge_and_visits_only(joint: Prepared):
    found = apart(joint)
    for cell in found:
        (edge,) = cell.expanded.edges
        assert edge.neighbours == () and {car.edge for car in cell.expanded.cars} <= {edge.name}
        assert (
            set(cell.drives) == {car.name for car in cell.expanded.cars}
            and not cell.expanded.faults
        )
    names = sorted(name for cell in found for name in cell.drives)
    assert names == sorted(visits(joint)[1])


def test_cells_apart_are_one_town_without_sharing_whose_cars_arrive_empty(joint: Prepared):
    """The two cuts are all that separates cells: nothing else crosses, or these would differ in
    some look-up.
    """
    both = together([cells.without_sharing(cells.arriving_empty(joint))])
    by_itself = together(apart(joint))
    for name in ("frames", "lookups"):
        one, other = (getattr(tabled, name) for tabled in (both, by_itself))
        order = [
            column
            for column in ("t_ns", "car", "stamp_ns", "genie", "kind", "requester")
            if column in one
        ]
        one, other = (
            table.sort_values(order, kind="stable", ignore_index=True) for table in (one, other)
        )
        assert one.astype(str).equals(other.astype(str)), name


def test_frames_after_a_hand_over_are_those_of_its_car_and_the_next_five_seconds():
    at_ns = 7 * NS_PER_S
    rows = [
        ("car1", -1, 4, 4),
        ("car1", 0, 10, 3),
        ("car1", 5, 10, 5),
        ("car1", 6, 4, 4),
        ("car2", 1, 4, 4),
    ]
    columns = ["car", "stamp_ns", "visible_static", "right"]
    held = pd.DataFrame(
        [(car, at_ns + s * NS_PER_S, seen, found) for car, s, seen, found in rows], columns=columns
    )
    held = held.assign(what="consumer", visible_moving=0)
    assert cells.recall_after_hand_overs(held, {"car1": [(at_ns, "e")], "car2": []}) == 8 / 20
    assert np.isnan(cells.recall_after_hand_overs(held, {"car2": []}))


def test_a_cell_is_one_of_fleet_1000():
    whole = load_scenario("fleet_1000")
    town = whole.source.town
    columns, rows = (round(count * town.block_m / whole.fleet.cell_m) for count in town.blocks)
    assert whole.fleet.cell_m == cells.BLOCKS_A_CELL * town.block_m
    assert whole.fleet.cars / (columns * rows) == pytest.approx(cells.CARS_A_CELL, rel=0.1)
    mine = small_town(
        Setting(columns=2, rows=1, cars=4, drive_s=1.0, overrides=("genie.capacity=7 entries",)),
        SEED,
    )
    assert len(mine.expanded.edges) == 2 and mine.scenario.genie.capacity.entries == 7


def test_the_table_shows_paired_differences(tmp_path: Path):
    """A seed that is high in both runs makes no difference; here the cut adds one or three: 2, and
    the t interval over two seeds is 12.7062 standard errors of 1 wide on each side.
    """
    rows = [
        {
            "cut": cut,
            "seed": seed,
            "metric": shown.metric,
            "placement": shown.placement,
            "component": component,
            "value": (joint + (cut != JOINT) * added + (1000 if component else 0)) / shown.factor,
        }
        for cut in CUTS
        for seed, joint, added in ((1, 10.0, 1.0), (2, 500.0, 3.0))
        for shown in SHOWN
        for component in ("", "zero_delay")
    ]
    counts = (("frames", 480), ("hand_overs", 2))
    rows += [
        {"cut": JOINT, "seed": seed, "metric": metric, "placement": "all", "value": count}
        for seed in (1, 2)
        for metric, count in counts
    ]
    text = cells.markdown(TINY, pd.DataFrame(rows).fillna({"component": ""}))
    assert "960 frames a column, 2.50 hand-overs a car and minute" in text
    for shown in ("fresh answer, mean", "visible objects that are held"):
        (row,) = (line for line in text.splitlines() if line.startswith(f"| {shown}"))
        assert row.split(" | ")[1:3] == ["255.0", "+2.0 (-10.7 to +14.7)"]
    page = tmp_path / "page.md"
    page.write_text(f"<!-- measured: {TINY.name} -->\n<!-- end -->\n", encoding="utf-8")
    cells.write(TINY.name, text, page)
    assert text in page.read_text(encoding="utf-8")
    with pytest.raises(UserError, match="no place for 'cut 9 x 1'"):
        cells.write("cut 9 x 1", text, page)
