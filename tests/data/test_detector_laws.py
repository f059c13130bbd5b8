"""Detectors' laws: measured on drives of their own, never on those that are judged."""

from __future__ import annotations

import json
from importlib import resources

import pytest

from benchmarks import detector_laws as measuring
from genie_sim.base import files
from genie_sim.core.freshness.laws import ASSUMED
from genie_sim.data.detector_laws import detector_laws
from genie_sim.data.perceive import kitti_folder
from genie_sim.data.trace import read_trace
from genie_sim.runs.build import setup
from genie_sim.runs.prepare import prepare
from genie_sim.scenario.reading import load_scenario

SHIPPED = json.loads(
    (resources.files("genie_sim.data") / "detector_laws.json").read_text(encoding="utf-8")
)


def test_a_detectors_laws_are_those_that_come_with_it():
    laws = detector_laws({"pointrcnn"}, {"tracking/0003"})
    assert laws.vehicles == tuple(SHIPPED["pointrcnn"]["vehicles"])
    assert laws.firsts == tuple(SHIPPED["pointrcnn"]["firsts"])


@pytest.mark.parametrize(
    ("detectors", "drives"),
    [
        ({"pointrcnn"}, {"tracking/0003", "tracking/0000"}),
        ({"yolox_nano"}, {"2011_09_26/0005"}),
        ({"town"}, {"town/11"}),
        ({"mine:Detector"}, {"tracking/0003"}),
        ({"pointrcnn", "rrc"}, {"tracking/0003"}),
        (set(), set()),
    ],
    ids=["measured there", "and there", "and in that town", "unknown", "two", "none"],
)
def test_else_they_are_assumed(detectors, drives):
    assert detector_laws(detectors, drives) is ASSUMED


def test_maps_and_trackers_use_them_unless_told_to_assume():
    town = [
        "perception.duration=1 s",
        "fleet.cars=2",
        "methods=[{name: tracker, method: remote, consumer: tracker},"
        " {name: genie, method: genie, genie: recommended},"
        " {name: assumed, method: genie,"
        " genie: {object_map: {freshness: {name: recommended, measured: false}}}}]",
    ]
    prepared = prepare(load_scenario("fleet_30", town))
    laws = [setup(prepared, entry).laws for entry in prepared.scenario.methods]
    assert laws[0] == laws[1] != ASSUMED
    assert laws[0].vehicles == tuple(SHIPPED["town"]["vehicles"])
    assert laws[2] is ASSUMED


def test_the_shipped_street_is_judged_with_assumed_laws():
    prepared = prepare(load_scenario("3car_recommended"))
    assert prepared.laws is ASSUMED


@pytest.mark.parametrize("detector", ["pointrcnn", "rrc"])
def test_published_detections_give_the_shipped_laws(detector):
    try:
        kitti_folder(None)
    except Exception as error:
        pytest.skip(str(error))
    assert measuring.recorded(detector, measuring.SEQUENCE, ("02",)) == SHIPPED[detector]


@pytest.mark.nightly
def test_the_town_gives_the_shipped_laws():
    assert measuring.town() == SHIPPED["town"]


def test_the_shipped_trace_gives_the_shipped_laws():
    trace = read_trace(files.find(files.TRACE, "kitti_0005"))
    assert measuring.laws([trace], measuring.DRIVE, ("02", "03")) == SHIPPED["yolox_nano"]
