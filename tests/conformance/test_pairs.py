"""Methods, faults, links and what else a scenario says of cars and edges: each two choices of
different kinds meet in a run.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations, product
from typing import Any

import pytest

from genie_sim.runs.prepare import prepare
from genie_sim.runs.simulate import simulate
from genie_sim.sim.fault import FAULTS
from genie_sim.sim.method import METHODS
from tests.conformance import small
from tests.conformance.faults import BEGIN_NS, END_NS, NothingDown, times_of

OWN = "tests.conformance.own"
ALL_METHODS = (*METHODS, f"{OWN}:Again")
ALL_FAULTS = (
    {"fault": "outage", "target": "edge1->car1"},
    {"fault": "hand_over", "target": "car1", "edge": "edge2", "gap": "600 ms"},
    {"fault": "crash", "target": "edge1", "memory": "cold"},
    {"fault": "stall", "target": "edge1"},
    {"fault": "slow", "target": "edge1", "factor": 5.0},
    {"fault": "gnss", "target": "car1", "bias": "3 m", "noise": "1 m"},
    {"fault": "partition", "target": ["car1", "edge2"]},
    {"fault": "camera", "target": "car1"},
)
ALL_LINKS = (
    "ethernet_100m",
    {"like": "wifi", "loss": 0.2},
    {"like": "ethernet_100m", "loss": {"mean": 0.01, "burst": 50}},
    {"model": "wire", "rate_up": "50 Mbit/s", "rate_down": None, "delay": "3 ms"},
    {"model": "cell", "path_loss": "none"},
    {"model": "trace"},
    {"model": f"{OWN}:OneAtATime", "rate": "1 Gbit/s"},
    {"model": f"{OWN}:Radio", "slot_ms": 0.5, "fails": 3},
)
ALL_PLACES = (
    {"device": "jetson_tx2"},
    {"device": "jetson_tx2", "edge": "edge1"},
    {"device": "agx_xavier", "edge": "edge1"},
    {"device": "agx_xavier"},
)
FACTORS = (ALL_METHODS, ALL_FAULTS, ALL_LINKS, ALL_PLACES)


def pairwise(factors: Sequence[Sequence[Any]]) -> Iterator[tuple[int, ...]]:
    """Rows of indices in which each two choices of different factors meet: all of the first two,
    and of each factor after them the choice that meets most of the row for the first time.
    """
    met: set[Any] = set()
    for row in product(*(range(len(factor)) for factor in factors[:2])):
        for factor in factors[2:]:
            longer = ((*row, choice) for choice in range(len(factor)))
            row = max(longer, key=lambda row: len({*combinations(enumerate(row), 2)} - met))
        met |= {*combinations(enumerate(row), 2)}
        yield row


ROWS = list(pairwise(FACTORS))


def test_each_two_choices_meet_in_a_row():
    met = {pair for row in ROWS for pair in combinations(enumerate(row), 2)}
    assert len(met) == sum(len(one) * len(other) for one, other in combinations(FACTORS, 2))
    assert {fault["fault"] for fault in ALL_FAULTS} == {*FAULTS}


@pytest.mark.parametrize(
    ("method", "fault", "link", "place"),
    [[factor[choice] for factor, choice in zip(FACTORS, row, strict=True)] for row in ROWS],
)
def test_every_frame_is_answered_or_dropped(
    method: str, fault: dict[str, Any], link: Any, place: dict[str, Any]
):
    """The fault comes when it should, and when it is over nothing is down."""
    times = {"begin": "0.5 s"} | ({} if "gap" in fault else {"end": "1.1 s"})
    cars = [small.car(1, link=link), small.car(2, link=link, **place)]
    scenario = small.scenario([method], cars=cars, faults=[fault | times])
    written = simulate(prepare(scenario), observer=NothingDown())
    rows, (entry,) = written["frames"].to_frame(), scenario.methods
    small.check_conserved(rows, [entry.name])
    assert rows["first_answer_ns"].notna().any(), "it never answers"
    assert times_of(written, entry.name) == [(BEGIN_NS, END_NS)]
