"""A car that lies: what leaves it, and whom it reaches."""

from __future__ import annotations

import math

import pytest
from lying_car import LyingCar

from genie_sim.base.errors import UserError
from genie_sim.core.messages import CameraPose, Detection, Detections, Header, Image
from genie_sim.runs.folder import run_in_memory
from genie_sim.scenario.reading import load_scenario
from tests.conformance.faults import FaultConformance

SEEN = Detection("person", 0.6, None, (4.0, 1.0, 0.0), 0.6)
LIARS = {"car1", "car6", "car11"}


@pytest.mark.parametrize("fault", [{"fault": "lying_car:LyingCar", "target": "car1"}])
class TestConformance(FaultConformance):
    pass


class Picture:
    detections = (SEEN,)


class Border:
    """The part of a network that bends what leaves one host."""

    def __init__(self) -> None:
        self.bends: list = []

    def bend(self, host, bend):
        self.bends.append(bend)

    def unbend(self, host, bend):
        self.bends.remove(bend)


def test_a_picture_leaves_with_a_phantom_ahead_of_its_camera():
    border, fault = Border(), LyingCar("car1", ahead_m=20.0, label="truck", score=0.9)
    lie = fault.strike(border)
    next(lie)
    pose = CameraPose(100.0, 50.0, 1.6, math.atan2(4.0, 3.0))
    image = Image(Header(0, "02", "car1"), 100, "", 0, pose, 1.2, Picture())
    (bend,) = border.bends
    true, phantom = bend.outward(image, "edge1").content.detections
    assert true == SEEN and (phantom.label, phantom.score) == ("truck", 0.9)
    assert phantom.location == pytest.approx((112.0, 66.0, 1.6))
    answer = Detections(image.header, (SEEN,))
    assert bend.inward(answer, "edge1") is answer and bend.outward(answer, "edge1") is answer
    next(lie, None)
    assert border.bends == []


def false_objects(*changes: str) -> dict[tuple[str, bool], int]:
    """How many false objects cars held, by method and whether the car lies."""
    scenario = load_scenario("lying_car.yaml", ["perception.duration=3 s", *changes])
    held = run_in_memory(scenario).tables["held_objects"].to_frame()
    never_there = held[held["judged"] == "never_there"]
    return never_there.groupby(["method", never_there["car"].isin(LIARS)]).size().to_dict()


@pytest.mark.slow
@pytest.mark.nightly
def test_a_map_at_the_edge_spreads_what_a_car_makes_up():
    lying, honest = false_objects(), false_objects("faults=[]")
    for others in (False, True):
        assert lying["local", others] == honest["local", others], "nobody else looks"
    assert lying["remote", False] == honest["remote", False], "it deceives itself alone"
    assert lying["remote", True] > honest["remote", True]
    assert lying["genie_recommended", False] > honest["genie_recommended", False]


def test_a_score_that_is_none_is_one_line():
    with pytest.raises(UserError, match="score: must be above 0 and at most 1, but is 2"):
        run_in_memory(load_scenario("lying_car.yaml", ["faults[0].score=2"]))
