"""Replicated requests: the first answer counts, whatever becomes of the other copies."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from genie_sim.base.errors import UserError
from genie_sim.core.messages import Publish
from tests.conformance import small
from tests.conformance.methods import MethodConformance
from tests.make import answer, frame

REPLICATED = "replicated:Replicated"
FLAT = {"model": "wire", "rate_up": "1 Gbit/s", "rate_down": "1 Gbit/s", "delay": "10 ms"}
ONE_CAMERA = [{"name": "camera_0", "recording": "left"}]


@pytest.mark.parametrize("method", [REPLICATED])
class TestReplicated(MethodConformance):
    pass


def first_answer() -> Any:
    from replicated import FirstAnswer

    return FirstAnswer("car1/replicator", ("images",), ("objects",))


def test_the_first_answer_to_each_frame_passes_and_later_ones_do_not():
    node = first_answer()
    for number in (1, 2):
        assert node.on_message("images", frame(number), 0) == [
            Publish("images-remote", frame(number))
        ]
    early, late = (answer(frame(number)) for number in (1, 2))
    told = [node.on_message("objects-remote", one, 0) for one in (late, early, late, early, early)]
    assert told == [[Publish("objects", late)], [Publish("objects", early)], [], [], []]


def test_it_remembers_a_bounded_number_of_frames():
    from replicated import REMEMBERED

    node = first_answer()
    for number in range(3 * REMEMBERED):
        assert node.on_message("objects-remote", answer(frame(number)), 0)
    assert len(node._answered) == REMEMBERED
    assert not node.on_message("objects-remote", answer(frame(number)), 0)


def world(methods: list[Any], **settings: Any) -> Any:
    """One car with one camera, at the first of three edges."""
    edges = [{"name": f"edge{number}", "device": "quadro_rtx_4000"} for number in (1, 2, 3)]
    usual = {"cameras": ONE_CAMERA, "edges": edges}
    cars = [small.car(1, link=settings.pop("link", FLAT))]
    return small.scenario(methods, **usual, cars=cars, **settings)


def entry(*links: Any) -> dict[str, Any]:
    """The method with these links to edge2, edge3 and so on; its name is how many copies go up."""
    further = [{"edge": f"edge{number}", "link": link} for number, link in enumerate(links, 2)]
    return {"name": f"x{len(links) + 1}", "method": REPLICATED, "further": further}


def by_method(scenario: Any) -> dict[str, pd.DataFrame]:
    rows = small.frames(scenario)
    return {name: of.reset_index() for name, of in rows.groupby("method", observed=True)}


def test_the_first_answer_is_that_of_the_faster_edge():
    """The second link is 7 ms shorter each way, so every answer comes 14 ms sooner."""
    nearer = FLAT | {"delay": "3 ms"}
    found = by_method(world([entry(), entry(nearer)], spread="isolated"))
    assert set(found["x1"]["served_by"].dropna()) == {"edge1/vision_darknet_detect"}
    assert "edge2/vision_darknet_detect" in set(found["x2"]["served_by"])
    gained = found["x1"]["first_answer_ns"] - found["x2"]["first_answer_ns"]
    assert (gained.dropna() >= 0).all()
    assert gained.max() >= 14e6


@pytest.mark.parametrize("copies", [1, 2, 3])
def test_each_copy_goes_up_its_own_link(copies: int):
    """Nothing is dropped on these links: so many times the bytes of one copy go up."""
    methods = ["remote", entry(*[FLAT] * (copies - 1))]
    found = by_method(world(methods))
    ours, theirs = found[f"x{copies}"], found["remote"]
    assert (ours["bytes_up"] == copies * theirs["bytes_up"]).all()


def test_an_outage_of_one_link_loses_no_frame_of_two_copies():
    faults = [{"fault": "outage", "target": "car1->edge1", "begin": "500 ms", "end": "1500 ms"}]
    found = by_method(world(["remote", entry(FLAT)], faults=faults))
    lost = {name: rows["drop"].notna().sum() for name, rows in found.items()}
    assert lost == {"remote": 10, "x2": 0}
    assert found["x2"]["first_answer_ns"].notna().all()
    assert found["x2"].loc[10, "served_by"] == "edge2/vision_darknet_detect"


@pytest.mark.slow
@pytest.mark.nightly
def test_lost_copies_of_independent_links_multiply():
    """Of 30 % lost up and 30 % down, 51 % of one copy and 26 % of both get no answer: within three
    standard deviations.
    """
    lossy = FLAT | {"loss": 0.3}
    setting = world([entry(), entry(lossy)], link=lossy)
    runs = [by_method(replace(setting, seed=seed)) for seed in range(15)]
    for name, expected in (("x1", 1 - 0.7**2), ("x2", (1 - 0.7**2) ** 2)):
        unanswered = np.concatenate([run[name]["first_answer_ns"].isna() for run in runs])
        sigma = math.sqrt(expected * (1 - expected) / len(unanswered))
        assert unanswered.mean() == pytest.approx(expected, abs=3 * sigma)


@pytest.mark.slow
@pytest.mark.nightly
def test_the_tail_is_shorter_than_that_of_one_uplink():
    """As published: the 99th percentile falls, and so does the share of missed deadlines."""
    import genie_sim as gs

    run = gs.run("replicated.yaml", {"cars[0].route.laps": 2, "record": []})
    found = run.metrics[run.metrics["placement"] == "all"].set_index(["metric", "method"])["value"]
    for metric in ("first_answer_p99", "replicated:missed_deadline"):
        assert found[metric, "two"] < found[metric, "remote"]
    assert found["first_answer_p99", "three"] <= found["first_answer_p99", "two"]


@pytest.mark.parametrize(
    ("further", "text"),
    [
        (3, "further: "),
        ([{"edge": "edge2"}], r"further\[0\].link: missing"),
        ([{"edge": "edge2", "link": "lti"}], r"further\[0\].link: unknown link 'lti'"),
        ([{"edge": "edge9", "link": "lte"}], "replicated: unknown edge 'edge9'"),
        ([{"edge": "edge1", "link": "lte"}], "replicated: link car1->edge1: there is one already"),
    ],
)
def test_bad_settings_are_told_in_one_line(further: Any, text: str):
    with pytest.raises(UserError, match=text) as told:
        small.simulated(world([{"method": REPLICATED, "further": further}]))
    assert "\n" not in str(told.value)
