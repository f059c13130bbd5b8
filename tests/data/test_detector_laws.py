"""Detectors' laws: measured on drives of their own, never on those that are judged."""

from __future__ import annotations

import json
from dataclasses import replace
from importlib import resources
from types import SimpleNamespace

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from genie_sim.analysis import screen, summary
from genie_sim.analysis.seed_runs import SeedRuns
from genie_sim.analysis.summary import about_boxes, about_laws
from genie_sim.base import files
from genie_sim.data.detectors.detector_laws import facts, laws_of
from genie_sim.data.kitti.perceive import kitti_folder
from genie_sim.data.trace import read_trace
from genie_sim.report import pages
from genie_sim.runs.build import setup
from genie_sim.runs.folder import run_in_memory
from genie_sim.runs.prepare import prepare
from genie_sim.scenario.reading import load_scenario
from genie_sim.tracks.laws import ASSUMED
from genie_sim.tracks.measure import LawCounts, shrunk, total
from tools.make import detector_laws as measuring

SHIPPED = json.loads(
    (resources.files("genie_sim.data.detectors") / "detector_laws.json").read_text(encoding="utf-8")
)
COUNTS = {
    (detector, drive): LawCounts(**counts)
    for detector, drives in SHIPPED["counts"].items()
    for drive, counts in drives.items()
}
WINDOW = "cars[0].route.window=[0 s, 1 s]"


def test_laws_are_those_of_all_other_drives():
    laws = laws_of({"pointrcnn"}, {"tracking/0003"})
    others = [
        counts for key, counts in COUNTS.items() if key[0] == "pointrcnn" and "0003" not in key[1]
    ]
    assert len(others) == 10
    assert laws == shrunk(total(others), SHIPPED["prior_looks"])
    assert laws != laws_of({"pointrcnn"}, {"tracking/0005"})


@given(st.sampled_from(sorted(COUNTS)), st.floats(0.1, 1e6), st.integers(1, 50))
def test_laws_lie_between_what_was_counted_and_what_is_assumed(
    key: tuple[str, str], prior_looks: float, times: int
):
    """The more was measured, the nearer they are to it."""
    counts = COUNTS[key]
    looks = counts.vehicle_looks[2]
    assume(looks)
    share = counts.vehicles_found[2] / looks
    less, more = (
        shrunk(total([counts] * count), prior_looks).vehicles[2] for count in (times, times + 1)
    )
    assert abs(more - share) <= abs(less - share) + 1e-12
    assert min(share, ASSUMED.vehicles[2]) - 1e-12 <= less
    assert less <= max(share, ASSUMED.vehicles[2]) + 1e-12


def test_with_a_very_large_weight_they_are_the_assumed_ones():
    laws = shrunk(COUNTS["yolox_nano", "2011_09_26/0005"], 1e12)
    for found, assumed in zip(laws, ASSUMED, strict=True):
        assert found == pytest.approx(assumed, abs=1e-6)


@pytest.mark.parametrize(
    ("detector", "drive", "text"),
    [
        ("pointrcnn", "tracking/0003", "on 10 other drives, shrunk towards assumed ones."),
        ("nanodet_m", "tracking/0003", "on one other drive, shrunk towards assumed ones."),
        ("yolox_nano", "2011_09_26/0005", "on this drive alone, so the assumed ones are used."),
        ("mine:Detector", "x", "nowhere, so the assumed ones are used."),
    ],
)
def test_one_line_says_what_they_rest_on(detector: str, drive: str, text: str):
    run = SimpleNamespace(runs=[SimpleNamespace(facts={"laws": facts({detector}, {drive})})])
    assert about_laws(run) == f"Laws of {detector}: measured {text}"
    assert facts({detector, "other"}, {drive}) is None


def test_a_run_says_so_in_its_results():
    run = run_in_memory(load_scenario("street_1car_homo", [WINDOW, "methods=[local]"]))
    said = "Laws of yolox_nano: measured on this drive alone"
    assert said in summary.markdown(run)
    laws = {"detector": "yolox_nano", "measured_on": [], "is_known": False}
    unknown = replace(run, facts=run.facts | {"laws": laws})
    for one in (run, unknown):
        for page in (pages.of_run(one, {}), pages.of_seeds(SeedRuns([one]), {})):
            assert page.count("Laws of yolox_nano: measured") == 1
    assert "Laws of" not in screen.text(run)


@pytest.mark.parametrize(
    ("detectors", "drives"),
    [
        ({"yolox_nano"}, {"2011_09_26/0005"}),
        ({"town"}, {"town/11"}),
        ({"mine:Detector"}, {"tracking/0003"}),
        ({"pointrcnn", "rrc"}, {"tracking/0003"}),
        (set(), set()),
    ],
    ids=["measured there", "and in that town", "unknown", "two", "none"],
)
def test_else_they_are_assumed(detectors, drives):
    assert laws_of(detectors, drives) is ASSUMED


def test_maps_and_trackers_use_them_unless_told_to_assume():
    town = ["perception.duration=1 s", "fleet.cars=2", "methods=[remote]"]
    prepared = prepare(load_scenario("fleet_30", town))
    (entry,) = prepared.scenario.methods
    assert setup(prepared, entry).laws == laws_of({"town"}, {"town/1"}) != ASSUMED
    assumed = {"name": "assumed", "method": "recommended", "measured": False}
    methods = [{"name": "usual", "method": "recommended"}, assumed]
    run = run_in_memory(
        load_scenario(
            "fleet_30",
            ["perception.duration=2 s", "fleet.cars=3", f"methods={json.dumps(methods)}"],
        )
    )
    served = run.frames.groupby("method", observed=True)["objects_served"].sum()
    assert served["usual"] != served["assumed"]


@pytest.mark.parametrize("detector", ["pointrcnn", "rrc"])
def test_published_detections_give_the_shipped_laws(detector):
    try:
        kitti_folder(None)
    except Exception as error:
        pytest.skip(str(error))
    for drive, counts in measuring.tracked(detector, ("0000", "0017")).items():
        assert counts == SHIPPED["counts"][detector][drive]


@pytest.mark.nightly
def test_the_town_gives_the_shipped_laws():
    assert measuring.town() == SHIPPED["counts"]["town"]


def test_the_shipped_trace_gives_the_shipped_laws():
    trace = read_trace(files.find(files.TRACE, "kitti_0005"))
    counts = measuring.counts([trace], ("02", "03"))
    assert counts == SHIPPED["counts"]["yolox_nano"][measuring.DRIVE]


def test_a_run_says_whose_times_and_whose_boxes_it_has():
    settings = [WINDOW, "methods=[local, {name: small, method: local, model: yolov8m}]"]
    run = run_in_memory(load_scenario("street_1car_homo", [*settings, "model=yolov8s"]))
    said = "Times are of yolov8s, yolov8m, boxes of yolox_nano: 'model' changes times alone."
    assert about_boxes(run) == said
    run.facts["scenario"]["model"] = "yolox_nano"
    run.facts["scenario"]["methods"] = ["local"]
    assert about_boxes(run) == ""
