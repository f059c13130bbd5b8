"""Faults at the border of a host and of its cameras: wrong positions, no pictures, parts of a
network.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from genie_sim.base.seeds import stream
from genie_sim.core.messages import CameraPose, Detection, Detections, Header, Image, Look
from genie_sim.faults.gnss import PositionError
from genie_sim.sim.bends import Bend, Border, shifted
from genie_sim.sim.content import EncodedContent
from genie_sim.tracks.track import Motion
from tests.conformance import small

S = 1_000_000_000
HEADER = Header(5, "camera_02", "car1")
CAR = Detection("car", 0.9, (0.0, 0.0, 9.0, 9.0), (10.0, 20.0, 0.5), 0.9, "scan")
NOWHERE = replace(CAR, location=None)
POSE = CameraPose(1.0, 2.0, 1.6, 0.3)


class Picture:
    detections = (CAR, NOWHERE)
    digest = "abc"
    stamp_ns = 5


def image(content: object = None, **changed: object) -> Image:
    usual = Image(HEADER, 100, "camera_02/abc", 7, POSE, 1.2, content or Picture())
    return replace(usual, **changed)


def test_all_places_of_a_message_are_displaced_and_nothing_else():
    moved = shifted(image(), 3.0, -4.0)
    assert isinstance(moved, Image)
    assert moved.pose == CameraPose(4.0, -2.0, 1.6, 0.3)
    assert [item.location for item in moved.content.detections] == [(13.0, 16.0, 0.5), None]
    assert (
        moved.content.digest == "abc" and moved.header == HEADER and moved.digest == "camera_02/abc"
    )
    encoded = EncodedContent((CAR,), encoded_bytes=10, raw_bytes=100, features={})
    moved = shifted(image(encoded), 3.0, -4.0)
    assert isinstance(moved, Image) and isinstance(moved.content, EncodedContent)
    assert moved.content.detections[0].location == (13.0, 16.0, 0.5)
    tracked = replace(CAR, motion=Motion((1.0, 0.0), 0.5, 0.9, HEADER))
    answer = Detections(HEADER, (tracked,), look=Look(HEADER, POSE, 1.2, (CAR,)), valid_ns=9)
    moved = shifted(answer, 3.0, -4.0)
    assert isinstance(moved, Detections) and moved.look is not None
    assert moved.objects == (replace(tracked, location=(13.0, 16.0, 0.5)),)
    assert moved.look.pose.east_m == 4.0 and moved.look.detections[0].location == (13.0, 16.0, 0.5)
    assert shifted(moved, -3.0, 4.0) == answer


def test_bends_follow_one_another_and_may_lose_a_message():
    add = Bend(
        lambda message, other: shifted(message, 1.0, 0.0), lambda message, other: message, "x"
    )
    lose = Bend(lambda message, other: None, lambda message, other: message, "cut")
    border = Border("car1", "edge1", [], [add, add])
    assert border.enter(image()).pose.east_m == 3.0  # type: ignore[union-attr]
    assert Border("car1", "edge1", [], [add, lose, add]).enter(image()) == "cut"
    message = image()
    assert Border("car1", "edge1", [lose], []).leave(message) is message
    whom: list[str] = []
    note = Bend(
        lambda message, other: whom.append(f"from {other}") or message,
        lambda message, other: whom.append(f"to {other}") or message,
        "x",
    )
    border = Border("car1", "edge1", [note], [note])
    border.leave(image()), border.enter(image())
    assert whom == ["to edge1", "from car1"]


@pytest.mark.slow
def test_the_position_error_is_a_bias_and_a_process_of_its_time():
    def error(**settings) -> PositionError:
        usual = {"bias_m": 0.0, "noise_m": 2.0, "correlation_ns": S}
        return PositionError(stream(4, "gnss"), **{**usual, **settings})

    bias = error(bias_m=5.0, noise_m=0.0)
    assert math.hypot(*bias.at(0)) == pytest.approx(5.0) and bias.at(0) == bias.at(77 * S)
    later_first, in_order = error(), error()
    later = later_first.at(40 * S)
    assert [later_first.at(t * S) for t in range(41)] == [in_order.at(t * S) for t in range(41)]
    assert later == in_order.at(40 * S)
    values = np.array([in_order.at(round(t * 0.1 * S)) for t in range(100_000)])
    assert values.mean(axis=0) == pytest.approx([0, 0], abs=4 * 2 * math.sqrt(2 / 10_000))
    assert values.std(axis=0) == pytest.approx([2, 2], rel=0.05)
    lag = [np.corrcoef(values[:-10, axis], values[10:, axis])[0, 1] for axis in (0, 1)]
    assert lag == pytest.approx([math.exp(-1)] * 2, abs=0.05)


def test_a_bias_moves_what_is_held_of_others_by_as_much_and_of_oneself_by_nothing():
    """Others place what car1 sees by the bias elsewhere, and car1 what others see by as much in the
    opposite direction. What car1 sees itself comes back from its edge where it is.
    """
    fault = {"fault": "gnss", "target": "car1", "bias": "3 m", "noise": "0 m", "begin": "0 s"}
    setting = small.scenario(["remote"], faults=[fault])
    world, _ = small.world(setting)
    world.clock.run(until=1)
    network, answer = world.network, Detections(HEADER, (CAR,))
    up, down = network.border("car1", "edge1"), network.border("edge1", "car1")
    told, heard = up.leave(answer), down.enter(answer)
    assert isinstance(told, Detections) and isinstance(heard, Detections)
    east_m, north_m = (told.objects[0].location[i] - CAR.location[i] for i in (0, 1))
    assert math.hypot(east_m, north_m) == pytest.approx(3.0)
    assert heard.objects[0].location[:2] == pytest.approx((10.0 - east_m, 20.0 - north_m))
    own = down.enter(told)
    assert isinstance(own, Detections)
    assert own.objects[0].location == pytest.approx(CAR.location)
    assert network.border("car2", "edge1").leave(answer) is answer
    assert network.border("edge1", "car2").enter(answer) is answer


def test_cameras_that_show_nothing_lose_their_frames_and_no_others():
    fault = {"fault": "camera", "target": "car1", "begin": "0.5 s", "end": "1 s"}
    frames = small.frames(small.scenario(["local", "remote", "genie"], faults=[fault]))
    lost = frames["drop"].isin(["car1/camera_0:camera", "car1/camera_1:camera"])
    within = (frames["car"] == "car1") & frames["stamp_ns"].between(0.5 * S, S - 1)
    assert lost.sum() > 20 and (lost == within).all()


def test_a_partition_separates_its_hosts_from_all_others_only():
    fault = {"fault": "partition", "target": ["car1", "edge2"], "begin": "0.5 s", "end": "1 s"}
    frames = small.frames(small.scenario(["remote"], faults=[fault]))
    lost = frames[frames["drop"].str.endswith(":partition", na=False)]
    assert set(lost["drop"]) <= {
        "car1->edge1:partition",
        "car2->edge2:partition",
        "edge1->car1:partition",
        "edge2->car2:partition",
    }
    assert len(lost) > 10 and lost["stamp_ns"].between(0.2 * S, S).all()
    together = {**fault, "target": ["car1", "edge1"]}
    frames = small.frames(small.scenario(["remote"], faults=[together]))
    assert not frames["drop"].str.endswith(":partition", na=False).any()


def test_an_outage_of_an_edge_goes_both_ways():
    """What other edges send goes to all of their neighbours but the one that is cut off."""
    fault = {"fault": "outage", "target": "edge1", "begin": "0 s", "end": "1.5 s"}
    edges = [{"name": f"edge{number}", "device": "agx_xavier"} for number in (1, 2, 3)]
    world, tables = small.world(small.scenario(["genie"], edges=edges, faults=[fault]))
    world.run()
    lookups = tables["lookups"].to_frame()
    lookups = lookups[lookups["car"] == "car2"].groupby("genie", observed=True)["t_ns"].min()
    assert lookups["edge3/genie"] < 0.5 * S < 1.5 * S <= lookups["edge1/genie"]


def test_a_warm_crash_keeps_what_a_genie_knows_and_a_cold_one_does_not():
    for memory, keeps in (("warm", True), ("cold", False)):
        fault = {
            "fault": "crash",
            "target": "edge1",
            "memory": memory,
            "begin": "1 s",
            "end": "1.2 s",
        }
        world, _ = small.world(small.scenario(["genie"], faults=[fault]))
        genie = next(
            node for node in world.network.graphs["edge1"].nodes if node.name == "edge1/genie"
        )
        world.clock.run(until=S - 1)
        before = len(genie.pure.object_map)
        world.clock.run(until=S + 1)
        assert before > 0 and (len(genie.pure.object_map) == before) is keeps
        assert world.network.links["car1->edge1"].cut_by == ["crash"]
        world.run()
        assert genie.completed > 0 and not world.network.outages
