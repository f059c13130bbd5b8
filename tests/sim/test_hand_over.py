"""A car changes its edge: by hand, nanosecond by nanosecond, and that nothing is lost without a
word.
"""

from __future__ import annotations

from typing import Any

import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from genie_sim.base.errors import UserError
from genie_sim.scenario.scenario import Scenario
from genie_sim.sim.clock import Clock
from genie_sim.sim.link import Link
from genie_sim.sim.world import World
from tests.make import build, drive, fixed_device, scenario, street
from tests.sim.test_way_of_one_frame import (
    EDGE_DETECTOR,
    EDGE_HOP_ANSWER,
    LINK_ANSWER,
    LINK_IMAGE,
    MS,
    ONE_CAMERA,
    UP,
    trace,
    view,
)

AT_EDGE = UP + EDGE_DETECTOR + EDGE_HOP_ANSWER
ANSWERED = AT_EDGE + LINK_ANSWER
GAP = 50 * MS
LOST = "car1:hand_over"
DEVICES = {
    "jetson_tx2": fixed_device("jetson_tx2", detector="300 ms", genie="9 ms"),
    "agx_xavier": fixed_device(
        "agx_xavier", detector="60 ms", genie="8 ms", hop="0.2 ms", per_megabyte="1 ms"
    ),
}
TWO_EDGES = [{"name": name, "device": "agx_xavier"} for name in ("edge1", "edge2")]
STREET = street(seconds=3.0)


MOVER = {"name": "car1", "device": "jetson_tx2", "edge": "edge1"}


def hand_over(at_ns: int, edge: str, gap_ns: int = GAP) -> dict[str, str]:
    """As in YAML."""
    times = {"begin": f"{at_ns} ns", "gap": f"{gap_ns} ns"}
    return {"fault": "hand_over", "target": "car1", "edge": edge, **times}


def moving(*hand_overs: tuple[int, str], gap_ns: int = GAP, **more: Any) -> Scenario:
    """One car that begins at edge1."""
    faults = [hand_over(at_ns, edge, gap_ns) for at_ns, edge in hand_overs]
    usual = {
        "methods": ["remote"],
        "cameras": ONE_CAMERA,
        "start_jitter": "0 s",
        "edges": TWO_EDGES,
    }
    return scenario([MOVER], faults=faults, **usual | more)


def answers(setting: Scenario, *stamps_ns: int) -> list[tuple[int | None, str | None, str | None]]:
    """Of each frame taken at these instants: its response since the stamp, who served it, and what
    dropped it.
    """
    views = trace(
        *(view(index, stamp_ns, float(index)) for index, stamp_ns in enumerate(stamps_ns))
    )
    frames = drive(setting, views, DEVICES)["frames"]
    since = (
        (frames["first_answer_ns"] - frames["stamp_ns"])
        .astype("object")
        .where(frames["first_answer_ns"].notna())
    )
    table = pd.DataFrame(
        {"since": since, "by": frames["served_by"], "drop": frames["drop"]}
    ).astype(object)
    return list(table.where(table.notna(), None).itertuples(index=False, name=None))


BY = "{}/vision_darknet_detect"


def test_an_answer_that_is_in_time_comes_from_the_old_edge():
    assert answers(moving((ANSWERED + 1, "edge2")), 0) == [(ANSWERED, BY.format("edge1"), None)]


@pytest.mark.parametrize(
    ("at_ns", "where"),
    [
        (ANSWERED - 1, "the answer is on the link"),
        (AT_EDGE - 1, "the edge is about to send it"),
        (UP + 30 * MS, "the edge's detector is at work"),
        (UP - LINK_IMAGE + 1, "the frame is on the link"),
        (1, "the frame has not left the car; the gap is not over when it does"),
    ],
)
def test_what_is_between_car_and_old_edge_is_lost_and_says_so(at_ns: int, where: str):
    assert answers(moving((at_ns, "edge2")), 0) == [(None, None, LOST)], where


def test_a_frame_that_reaches_the_link_after_the_gap_goes_to_the_new_edge():
    """The hop inside the car takes 3.1 ms: what the camera took just before the new connection was
    there still goes.
    """
    hop = UP - LINK_IMAGE
    back = 5 * MS + GAP  # when the car is connected again
    found = answers(moving((5 * MS, "edge2")), 0, back - hop - 1, back - hop + 1)
    assert found == [(None, None, LOST), (None, None, LOST), (ANSWERED, BY.format("edge2"), None)]


def test_a_gap_of_no_time_loses_only_what_was_under_way():
    hand_over = 100 * MS
    found = answers(moving((hand_over, "edge2"), gap_ns=0), 0, hand_over - 10 * MS, hand_over)
    by = BY.format("edge1"), BY.format("edge2")
    assert found == [(ANSWERED, by[0], None), (None, None, LOST), (ANSWERED, by[1], None)]


def test_a_car_that_comes_back_has_its_old_link_and_gets_what_the_edge_has_finished_since():
    """Away while the edge's detector works, not when it has the answer; but the second frame is on
    the link meanwhile and lost, although the car is back before it would have arrived.
    """
    away = moving(
        (30 * MS, "edge2"),
        (35 * MS, "edge1"),
        (108 * MS, "edge2"),
        (109 * MS, "edge1"),
        gap_ns=1 * MS,
    )
    frames = 0, 100 * MS, 200 * MS
    by = BY.format("edge1")
    assert answers(away, *frames) == [
        (ANSWERED, by, None),
        (None, None, LOST),
        (ANSWERED, by, None),
    ]
    views = trace(*(view(index, stamp_ns, float(index)) for index, stamp_ns in enumerate(frames)))
    world, _ = build(away, "remote", views, DEVICES)
    world.run()
    links = {
        one.name: one.completed
        for one in world.network.resources
        if isinstance(one, Link) and "car1" in one.name
    }
    assert links == {"car1->edge1": 3, "edge1->car1": 2, "car1->edge2": 0, "edge2->car1": 0}


def test_the_second_of_two_edges_is_the_cars_own_after_the_hand_over():
    """With Genie: an answer of edge2's detector is its edge's, not a peer's; the car's own detector
    is slower.
    """
    rules = {"miss_policy": "blocking", "similarity": "exact"}
    setting = moving((500 * MS, "edge2"), methods=["genie"], genie=rules)
    frames = drive(setting, STREET, DEVICES)["frames"]
    served = frames[frames["source"].isin(["edge_detector", "edge_cache", "peer_cache"])]
    late = served["first_answer_ns"] > 500 * MS
    assert set(served[~late]["served_by"].astype(str).str.split("/").str[0]) == {"edge1"}
    assert set(served[late]["served_by"].astype(str).str.split("/").str[0]) == {"edge2"}
    assert set(served["source"]) == {"edge_detector"}


def test_other_cars_notice_a_hand_over_only_through_the_edges():
    """A car alone at its edge, which shares with nobody, has exactly the answers that it has
    without the mover.
    """
    lonely = {"name": "car2", "device": "jetson_tx2", "edge": "edge3"}
    edges = [*TWO_EDGES, {"name": "edge3", "device": "agx_xavier", "neighbours": []}]
    both = scenario([MOVER, lonely], edges=edges, faults=[hand_over(500 * MS, "edge2")])
    frames = {
        len(setting.cars): drive(setting, STREET, DEVICES)["frames"]
        for setting in (scenario([lonely], edges=edges), both)
    }
    with_mover = (
        frames[2][frames[2]["car"] == "car2"]
        .reset_index(drop=True)
        .astype({"method": str, "car": str})
    )
    alone = frames[1].astype({"method": str, "car": str})
    assert with_mover.astype(object).fillna("").equals(alone.astype(object).fillna(""))


@settings(max_examples=10)
@given(
    st.lists(st.tuples(st.integers(0, 800), st.integers(1, 2)), max_size=5),
    st.sampled_from((0, 20, 50, 300)),
    st.sampled_from(("remote", "genie")),
)
def test_every_frame_is_answered_dropped_or_in_flight_whatever_the_car_does(
    moves: list[tuple[int, int]], gap_ms: int, method: str
):
    """published = with a result + dropped + in flight at any time, and nothing is in flight
    in the end.
    """
    at_ms, edge, hand_overs = 0, 1, []
    for wait_ms, step in moves:
        at_ms, edge = at_ms + wait_ms, (edge + step - 1) % 3 + 1
        hand_overs.append((at_ms * MS, f"edge{edge}"))
        at_ms += gap_ms
    edges = [*TWO_EDGES, {"name": "edge3", "device": "agx_xavier"}]
    setting = moving(*hand_overs, gap_ns=gap_ms * MS, edges=edges, methods=[method])
    world, tables = build(setting, method, STREET, DEVICES)
    world.run()
    frames = tables["frames"].to_frame()
    answered, dropped = frames["result_answer_ns"].notna(), frames["drop"].notna()
    assert len(frames) == 30 and not (answered & dropped).any()
    world.clock.run(until=world.clock.now + 60_000 * MS)
    settled = tables["frames"].to_frame()
    assert (settled["result_answer_ns"].notna() ^ settled["drop"].notna()).all()
    check_bytes(world, settled)
    if method == "remote":
        check_remote(world, settled)


def check_bytes(world: World, frames: pd.DataFrame) -> None:
    """What each frame cost is what its car's links carried, whichever edge they led to."""
    links = [one for one in world.network.resources if isinstance(one, Link)]
    assert frames["bytes_up"].sum() == sum(
        one.sent_bytes for one in links if one.name.startswith("car1->")
    )
    assert frames["bytes_down"].sum() == sum(
        one.sent_bytes for one in links if one.name.endswith("->car1")
    )


def check_remote(world: World, frames: pd.DataFrame) -> None:
    """Every answer on record came down a link; what came down and is not on record was cut off by a
    hand-over.
    """
    down = sum(
        one.completed
        for one in world.network.resources
        if isinstance(one, Link) and one.name.endswith("->car1")
    )
    answered = int(frames["first_answer_ns"].notna().sum())
    assert answered <= down <= answered + int((frames["drop"] == LOST).sum())


@pytest.mark.parametrize(
    ("hand_overs", "message"),
    [
        (
            [(5, "edge9")],
            r"faults\[0\].edge: unknown edge 'edge9' \(did you mean 'edge2'\?\)",
        ),
        ([(5, "edge1")], r"faults\[0\].edge: car1 is with edge1 already"),
        (
            [(5 * MS, "edge2"), (54 * MS, "edge1")],
            r"faults\[1\].begin: comes before the hand-over before it is over, at 55 ms",
        ),
    ],
)
def test_hand_overs_that_cannot_be_are_told_in_one_line(
    hand_overs: list[tuple[int, str]], message: str
):
    with pytest.raises(UserError, match=message):
        moving(*hand_overs)


@pytest.mark.parametrize(
    ("car", "message"),
    [
        ({}, r"faults\[0\].target: car1 has no 'edge' to leave"),
        (
            {"edge": "edge1", "cameras": False},
            r"faults\[0\].target: a car without cameras stays with the edge that serves it",
        ),
    ],
)
def test_cars_that_cannot_change_their_edge(car: dict[str, Any], message: str):
    with pytest.raises(UserError, match=message):
        faults = [hand_over(1_000 * MS, "edge2")]
        scenario([{"name": "car1", "device": "jetson_tx2", **car}], edges=TWO_EDGES, faults=faults)


def test_a_car_without_cameras_needs_an_edge_that_nobody_with_cameras_ever_comes_to():
    blind = {"name": "car2", "device": "jetson_tx2", "edge": "edge2", "cameras": False}
    with pytest.raises(UserError, match="serves car1's cameras"):
        scenario([MOVER, blind], edges=TWO_EDGES, faults=[hand_over(500 * MS, "edge2")])


class Noting:
    """A transmitter that notes whether its link is up."""

    is_up = True

    def set_available(self, is_available: bool) -> None:
        self.is_up = is_available


def test_a_hand_over_that_ends_during_an_outage_does_not_end_the_outage():
    transmitter = Noting()
    link = Link(Clock(), "car1->edge1", transmitter)  # type: ignore[arg-type]
    link.set_connected(False)
    link.cut("outage")
    link.set_connected(True)
    assert not transmitter.is_up
    link.restore("outage")
    assert transmitter.is_up
    link.cut("outage")
    link.set_connected(False)
    link.restore("outage")
    assert not transmitter.is_up, "the hand-over goes on"
