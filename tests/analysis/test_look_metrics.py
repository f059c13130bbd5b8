"""What became of looks, counted by hand."""

from __future__ import annotations

import math
from typing import Any

import pandas as pd
import pytest

from genie_sim.analysis import looks as look_metrics
from genie_sim.analysis import metrics
from genie_sim.analysis.frame_metrics import look_age_ms
from genie_sim.analysis.statistics import Measured
from genie_sim.record.columns import Columns

MS = 1_000_000
# frame by stamp [ms]: what became of it, and when [ms]; None: nothing yet
FATES = {
    0: ("answered", 80),
    100: ("overtaken", 330),
    200: ("stale", 810),
    300: ("timed_out", 1500),
    400: ("timed_out", 1500),
    500: None,
    600: None,
    700: None,
}


def looks() -> pd.DataFrame:
    """Eight frames of a stream go up 10 ms after their stamps, and one of another stream. Ten are
    answered out of the map; their view was looked at 100, 200, 200 and 700 ms before four of them.
    """
    rows: list[tuple[int, str, int, str, str]] = []
    for stamp_ms, fate in FATES.items():
        rows.append((stamp_ms + 10, "02", stamp_ms, "edge", "sent"))
        if fate is not None:
            rows.append((fate[1], "02", stamp_ms, "edge", fate[0]))
    rows += [(40, "03", 30, "edge", "sent"), (70, "03", 30, "edge", "answered")]
    rows += [(1600, "02", 300, "edge", "late"), (400, "02", 100, "own", "answered")]
    rows += [(100 * number, "02", 100 * number, "map", "answered") for number in range(10)]
    table = pd.DataFrame(sorted(rows), columns=["t_ns", "stream", "stamp_ns", "way", "outcome"])
    looked_ms = dict(zip(range(600, 1000, 100), (500, 500, 600, 200), strict=True))
    of_map = table["stamp_ns"].where(table["way"] == "map")
    table["looked_ns"] = of_map.map(looked_ms)
    table["gap_ns"] = table["stamp_ns"].where(table["outcome"] == "sent").map({100: 100, 30: 30})
    table[["t_ns", "stamp_ns", "looked_ns", "gap_ns"]] *= MS
    return table.assign(method="genie", car="car1", genie="car1/genie")


def frames() -> pd.DataFrame:
    table = pd.DataFrame({"stamp_ns": [100 * MS * number for number in range(10)]})
    return table.assign(method="genie", car="car1")


def held(shared: int, shared_right: int) -> pd.DataFrame:
    judged = {"method": "genie", "what": "consumer", "held": 8}
    sees = {"shared": shared, "shared_right": shared_right}
    without_delay = judged | {"what": "zero_delay", "shared": 0, "shared_right": 0}
    return pd.DataFrame([judged | sees, judged | {"shared": 1, "shared_right": 0}, without_delay])


def measured(**tables: pd.DataFrame) -> dict[str, Measured]:
    parts: dict[str, Any] = {"looks": looks(), "frames": frames(), **tables}
    columns = {name: Columns.of(table) for name, table in parts.items()}
    return {
        name: metric.of(seen.rows, intervals=False)
        for seen in look_metrics.views(metrics.of_method(columns, "genie"))
        for name, metric in look_metrics.METRICS.items()
        if metric.rows == seen.kind
    }


def test_each_frame_that_went_up_has_one_end():
    values = {name: metric.value for name, metric in measured().items()}
    assert values["looks_own_share"] == 1 / 10
    assert values["looks_sent_share"] == 9 / 10
    assert values["looks_answered_share"] == 2 / 9


def test_the_round_trip_is_that_of_the_frames_that_were_answered():
    """70 ms, 30 ms of the other stream, and 600 ms of the one that was stale; not the late one."""
    round_trip = measured()["look_round_trip_mean"]
    assert (round_trip.value, round_trip.n) == (pytest.approx((70 + 30 + 600) / 3), 3)


def test_the_age_of_a_view_is_that_of_its_newest_look_when_a_frame_comes():
    """Frames before the first look have none: 100, 200, 200 and 700 ms."""
    of_looks = measured()
    assert (of_looks["view_age_mean"].value, of_looks["view_age_mean"].n) == (300, 4)


def test_what_another_car_saw_counts_by_itself():
    of_held = measured(held=held(5, 2))
    assert (of_held["shared_share"].value, of_held["shared_share"].n) == (6 / 16, 16)
    assert (of_held["shared_right_share"].value, of_held["shared_right_share"].n) == (2 / 6, 6)


def test_where_nothing_was_shared_nobody_knows_how_right_it_is():
    table = held(0, 0).assign(shared=0)
    assert measured(held=table)["shared_right_share"].value is None


def test_the_gap_between_looks_is_that_of_the_frames_that_went_up():
    """Of two it is known: 100 and 30 ms."""
    assert measured()["look_gap_mean"].value == pytest.approx(65)


def test_a_look_that_is_newer_than_the_frame_is_of_no_age():
    """An object of the map may have been seen since the camera took the frame."""
    table = pd.DataFrame({"stamp_ns": [100 * MS] * 3, "first_looked_ns": [120 * MS, 40 * MS, None]})
    ages_ms = look_age_ms(Columns.of(table))
    assert ages_ms[:2].tolist() == [0.0, 60.0] and math.isnan(ages_ms[2])
