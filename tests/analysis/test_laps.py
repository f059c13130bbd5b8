"""What consumers hold, lap by lap."""

from __future__ import annotations

import numpy as np
import pandas as pd

from genie_sim.analysis import summary
from genie_sim.analysis.correctness import METRICS, views
from genie_sim.record.columns import Columns
from genie_sim.runs.folder import run_in_memory
from genie_sim.scenario.reading import load_scenario

S = 1_000_000_000


def published(
    car: str, first_s: float, laps: int, length_s: int, first_lap: int = 0
) -> pd.DataFrame:
    """A frame a second, no pause between laps."""
    stamps_ns = (np.arange(laps * length_s) * S + first_s * S).astype(np.int64)
    laps_of_frames = np.repeat(first_lap + np.arange(laps), length_s)
    return pd.DataFrame(
        {"method": "genie", "car": car, "stamp_ns": stamps_ns, "lap": laps_of_frames}
    )


def held(car: str, *counts: tuple[float, int, int, int]) -> pd.DataFrame:
    """At these times [s], so many objects held, right, and visible."""
    rows = [
        {
            "method": "genie",
            "what": "consumer",
            "car": car,
            "stamp_ns": round(t_s * S),
            "held": held_count,
            "right": right,
            "visible_static": visible,
            "visible_moving": 0,
        }
        for t_s, held_count, right, visible in counts
    ]
    return pd.DataFrame(rows)


def laps_of(frames: list[pd.DataFrame], judged: list[pd.DataFrame]) -> dict[tuple[str, str], float]:
    tables = (Columns.of(pd.concat(tables, ignore_index=True)) for tables in (judged, frames))
    of_genie = dict(zip(("held", "frames"), tables, strict=True))
    return {
        ("lap_f1", seen.component): METRICS["lap_f1"].of(seen.rows).value
        for seen in views(of_genie)
        if seen.kind == METRICS["lap_f1"].kind
    }


def test_each_lap_is_judged_by_itself_and_each_car_has_its_own():
    """Car 2 begins 2 s later, so that at 4 s car 1 is in its second lap and car 2 in its first."""
    frames = [published("car1", 0, 2, 4), published("car2", 2, 2, 4)]
    judged = [
        held("car1", (0, 2, 2, 4), (3, 2, 1, 4), (4, 5, 1, 8)),
        held("car2", (4, 10, 9, 10), (6, 1, 0, 2)),
    ]
    assert laps_of(frames, judged) == {
        ("lap_f1", "lap 1"): 2 * (2 + 1 + 9) / (2 + 2 + 10 + 4 + 4 + 10),
        ("lap_f1", "lap 2"): 2 * (1 + 0) / (5 + 1 + 8 + 2),
    }


def test_a_warm_up_leaves_a_lap_its_number():
    """Car 1 has frames of its second and third lap, car 2 of its first."""
    frames = [published("car1", 20, 2, 4, first_lap=1), published("car2", 20, 1, 4)]
    judged = [
        held("car1", (20, 2, 2, 4), (24, 5, 1, 8)),
        held("car2", (21, 10, 9, 10)),
    ]
    assert laps_of(frames, judged) == {
        ("lap_f1", "lap 1"): 2 * 9 / (10 + 10),
        ("lap_f1", "lap 2"): 2 * 2 / (2 + 4),
        ("lap_f1", "lap 3"): 2 * 1 / (5 + 8),
    }


def test_one_lap_is_the_whole_run_and_not_judged_twice():
    assert laps_of([published("car1", 0, 1, 4)], [held("car1", (0, 2, 2, 4))]) == {}


def test_laps_stand_in_the_summary():
    settings = ["methods=[local]", "cars[0].route={window: [2 s, 3 s], laps: 2}"]
    text = summary.markdown(run_in_memory(load_scenario("street_1car_hetero", settings)))
    assert "## Laps" in text and "streaming F1 in a lap, lap 2 [%]" in text
