"""Metrics around a fault, by hand, and what a run records of its faults."""

from __future__ import annotations

import pandas as pd
import pytest

from genie_sim.analysis import outages, summary
from genie_sim.analysis.registry import METRICS
from genie_sim.record.columns import Columns
from genie_sim.runs.folder import run_in_memory
from tests.conformance import small


def table(rows: list[tuple], *names: str) -> Columns:
    frame = pd.DataFrame(rows, columns=list(names))
    return Columns.of(
        frame.astype(
            {
                name: "category"
                for name in names
                if frame[name].dtype == object and name[-2:] != "ns"
            }
        )
    )


S, MS = 1_000_000_000, 1_000_000


def metrics(faults: list[tuple], frames: list[tuple], held: list[tuple] | None = None):
    fault_table = table(faults, "method", "fault", "target", "begin_ns", "end_ns")
    frame_table = table(
        frames, "method", "stamp_ns", "first_answer_ns", "first_looked_ns", "fresh_answer_ns"
    )
    names = ("method", "what", "stamp_ns", "held", "right", "visible_static", "visible_moving")
    tables = {"faults": fault_table, "frames": frame_table}
    if held is not None:
        tables["held"] = table(held, *names)
    found = {}
    for seen in outages.views(tables):
        for name, metric in outages.METRICS.items():
            if metric.kind == seen.kind:
                number = metric.of(seen.rows)
                found[name, seen.component] = number.value, number.n
    return found


def frames(fresh: str) -> list[tuple]:
    """A frame every 100 ms; ``f`` has a fresh result after 30 ms, ``a`` after 10 an answer of which
    a detector last saw something 250 ms before the frame.
    """
    nan = float("nan")
    return [
        (
            "remote",
            100 * MS * place,
            100 * MS * place + {"f": 30, "a": 10}.get(letter, nan) * MS,
            100 * MS * place - {"f": 0, "a": 250}.get(letter, nan) * MS,
            100 * MS * place + 30 * MS if letter == "f" else nan,
        )
        for place, letter in enumerate(fresh)
    ]


def test_answers_around_a_fault_by_hand():
    """Ten frames before 1 s, five until 1.5 s, fifteen after; the last ten are as those before."""
    found = metrics(
        [("remote", "hand_over", "car1", 0, 1), ("remote", "crash", "edge1", S, 3 * S // 2)],
        frames("fffffffffa" + "a-a--" + "a-f-a" + "fffff" + "fffff"),
    )
    assert found["fault_fresh_share", "before"] == (0.9, 10)
    assert found["fault_fresh_share", "during"] == (0.0, 5)
    assert found["fault_fresh_share", "after"] == (pytest.approx(11 / 15), 15)
    assert found["fault_recovery", ""] == (0.5, None)
    assert {metric for metric, _ in found} | {"fault_recall", "fault_ghosts"} <= set(METRICS)


def test_recovery_needs_95_percent_of_what_was_before_and_an_end():
    before, during = "ffffffffff", "-----"
    fault = ("remote", "crash", "edge1", S, 3 * S // 2)
    recovery = ("fault_recovery", "")
    assert metrics([fault], frames(before + during + "fffff"))[recovery] == (0.0, None)
    assert metrics([fault], frames(before + during + "ffff-" * 4))[recovery] == (None, None)
    assert metrics([fault], frames("ffff-" * 2 + during + "ffff-" * 2))[recovery] == (0.0, None)
    assert metrics([fault], frames("----------" + during + "fffff"))[recovery] == (None, None)
    for_good = ("remote", "crash", "edge1", S, float("nan"))
    found = metrics([for_good], frames(before + during))
    assert found[recovery] == (None, None) and found["fault_fresh_share", "during"] == (0.0, 5)
    assert found["fault_fresh_share", "after"] == (None, 0)


def test_recall_and_ghosts_around_a_fault_by_hand():
    held = [
        ("remote", "consumer", 0, 4, 3, 4, 1),
        ("remote", "consumer", S, 6, 1, 2, 2),
        ("remote", "zero_delay", S, 9, 9, 9, 9),
        ("remote", "consumer", 2 * S, 2, 2, 3, 1),
    ]
    fault = ("remote", "stall", "edge1", S, 3 * S // 2)
    found = metrics([fault], frames("f" * 30), held)
    assert [found["fault_recall", phase][0] for phase in outages.PHASES] == [0.6, 0.25, 0.5]
    assert [found["fault_ghosts", phase] for phase in outages.PHASES] == [
        (0.25, 4),
        (pytest.approx(5 / 6), 6),
        (0.0, 2),
    ]


def test_a_run_tells_when_its_faults_began_and_ended():
    faults = [
        {"fault": "slow", "target": "edge1", "begin": "0.5 s", "end": "0.7 s"},
        {"fault": "partition", "target": ["car1", "edge2"], "begin": "0.2 s"},
        {"fault": "hand_over", "target": "car2", "edge": "edge1", "begin": "1 s"},
        {
            "fault": "outage",
            "target": "car1",
            "mean_time_between": "400 ms",
            "mean_duration": "50 ms",
        },
    ]
    run = run_in_memory(small.scenario(["local", "remote"], faults=faults))
    rows = run.faults
    of_local, of_remote = (
        rows[rows["method"] == method].drop(columns="method").reset_index(drop=True)
        for method in ("local", "remote")
    )
    pd.testing.assert_frame_equal(of_local, of_remote)
    assert of_local["begin_ns"].is_monotonic_increasing
    slow = of_local[of_local["fault"] == "slow"].iloc[0]
    assert tuple(slow) == ("slow", "edge1", 500 * MS, 700 * MS)
    parts = of_local[of_local["fault"] == "partition"].iloc[0]
    assert parts["target"] == "car1, edge2" and pd.isna(parts["end_ns"])
    hand_over = of_local[of_local["fault"] == "hand_over"].iloc[0]
    assert hand_over["end_ns"] - hand_over["begin_ns"] == 50 * MS
    outage = of_local[of_local["fault"] == "outage"]
    assert len(outage) >= 2 and (outage["end_ns"] > outage["begin_ns"]).all()
    text = summary.markdown(run)
    assert "## Around the first fault" in text
    recall = [
        line for line in text.splitlines() if line.startswith("| frames with a fresh result around")
    ]
    assert [line.split(" [")[0].rpartition(", ")[2] for line in recall] == [
        f"{phase} it" for phase in outages.PHASES
    ]
