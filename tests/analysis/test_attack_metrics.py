"""Metrics of attacks, by hand."""

from __future__ import annotations

import pandas as pd
import pytest

from genie_sim.analysis import attacks
from genie_sim.analysis.metric import measured
from genie_sim.analysis.registry import METRICS
from tests.analysis.outage_tables import table

S = 1_000_000_000
NAN = float("nan")
FORGED = ("method", "attack", "attacker", "receiver", "change", "label", "east_m", "north_m")
HELD = ("method", "car", "label", "east_m", "north_m", "judged", "begin_ns", "end_ns")


def forged(attacker="car1", receiver="edge1", change="added", label="car", at=10.0, span=(2, 4)):
    place = (change, label, at, 0.0, span[0] * S, span[1] * S)
    return ("genie", "spoof", attacker, receiver, *place)


def hold(car: str, begin: float, end: float, judged="never_there", label="truck", at=11.0):
    return ("genie", car, label, at, 0.5, judged, round(begin * S), end * S)


def metrics(forgeries: list, rows: list, cars=("car1", "car2", "car3", "car4")):
    """By name and component; the run lasts 12 s."""
    instants = [("genie", "consumer", car, at * S) for car in cars for at in (0, 12)]
    held = table(instants, "method", "what", "car", "stamp_ns")
    forgery_table = table(forgeries, *FORGED, "begin_ns", "end_ns")
    tables = {"attacks": forgery_table, "held": held, "held_objects": table(rows, *HELD)}
    views = attacks.views(tables, dict.fromkeys(["genie", "local"]), intervals=True)
    computed = measured(attacks.METRICS, views)
    return {(item.metric, item.component): item.value for item in computed}


def test_poison_at_attackers_and_others_by_hand():
    """Ten seconds from the first forgery on, one attacker and three others."""
    values = metrics(
        [forged(span=(2, 4))],
        [
            hold("car1", 2.5, 4.5),
            hold("car2", 1.0, 3.0),  # one second of it since the attack began
            hold("car2", 3.0, 6.0, judged="duplicate"),
            hold("car3", 3.0, 3.5),
            hold("car4", 3.0, 9.0, judged="right"),
            hold("car4", 3.0, 9.0, label="person"),
            hold("car4", 3.0, 9.0, at=13.0),  # too far away
            hold("car4", 15.0, 16.0),  # too late
        ],
    )
    assert values["poisoned_objects", "attackers"] == pytest.approx(2.0 / 10)
    assert values["poisoned_objects", "others"] == pytest.approx((1 + 3 + 0.5) / 30)
    assert values["poisoned_objects", "receivers"] is None
    assert values["suppressed_objects", "others"] == 0
    assert {metric for metric, _ in values} <= set(METRICS)


def test_cars_of_a_captured_edge_are_receivers_and_others():
    values = metrics(
        [forged("edge1", "car2"), forged("edge1", "edge2"), forged("edge1", "car3", at=90.0)],
        [hold("car2", 2.0, 4.0), hold("car4", 2.0, 3.0), hold("car4", 2.5, NAN, at=90.0)],
    )
    assert values["poisoned_objects", "receivers"] == pytest.approx(2.0 / 20)
    assert values["poisoned_objects", "others"] == pytest.approx((2 + 1 + 9.5) / 40)
    assert values["poisoned_objects", "attackers"] is None


def test_left_out_objects_count_where_they_are_missed():
    values = metrics(
        [forged(change="left_out")],
        [hold("car2", 2.0, 7.0, judged="missed"), hold("car3", 2.0, 7.0)],
    )
    assert values["suppressed_objects", "others"] == pytest.approx(5.0 / 30)
    assert values["poisoned_objects", "others"] == 0


def test_without_attacks_or_judged_cars_there_are_no_metrics():
    assert metrics([], [hold("car2", 2.0, 7.0)]) == {}
    assert metrics([forged()], [], cars=()) == {}
    assert isinstance(table([], *HELD).to_frame(), pd.DataFrame)
