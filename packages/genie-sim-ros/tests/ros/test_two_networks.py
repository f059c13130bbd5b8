"""A car and its edge: two masters, a Genie at each, joined by a link."""

from __future__ import annotations

import json
import struct
import time
from collections.abc import Callable

import pytest

from genie_sim_ros.codec import WireType, codec_of
from genie_sim_ros.links import Links
from genie_sim_ros.message import RosMessage
from genie_sim_ros.plan import AttachPlan
from tests.ros.conftest import DETECTOR, Keys, Master, free_port, until

pytestmark = pytest.mark.slow

IMAGE_MD5 = "060021388200f6f0f447d0fcd9c64743"


def lookups(master: Master) -> list[tuple[str, str, str]]:
    """Origin, outcome, requester of every look-up."""
    records = map(json.loads, (master.folder / "record.jsonl").read_text().splitlines())
    return [
        (record["header"]["origin"], record["outcome"], record["requester"])
        for record in records
        if record["record"] == "ImageLookup"
    ]


def test_the_edge_answers_what_the_car_is_slow_to_see(
    new_master: Callable[[str], Master], keys: Keys
):
    """The car's detector takes a second, the edge's 50 ms, and each has a label of its own: answers
    come over the link, and come but once.
    """
    car, edge = new_master("car1"), new_master("edge1")
    car.start_node(DETECTOR, "detector.py", "_seconds:=1.0", "_label:=bus")
    edge.start_node(DETECTOR, "detector.py")
    address = f"127.0.0.1:{free_port()}"
    edge.attach(role="edge", name="edge1", listen=address, cars=["car1"], keys=keys("edge1"))
    car.attach(name="car1", connect=[f"edge1@{address}"], keys=keys("car1"))
    until(lambda: "edge edge1 is connected" in car.log_of_genie(), "the link is up")

    answers = car.play("1,2,1,2", pause_s=1.3, listen_s=0.8)

    assert lookups(car) == [("car1", "miss", "client")] * 2 + [("car1", "hit", "client")] * 2
    assert lookups(edge) == [("car1", "miss", "client")] * 2
    assert [answer["stamp_ns"] // 10**9 for answer in answers] == [1, 2, 3, 4]
    assert [answer["objects"][0][1] for answer in answers] == [1, 2, 1, 2]
    assert [answer["objects"][0][0] for answer in answers[:2]] == ["car"] * 2, "the edge's"

    edge.detach()
    until(lambda: "edge1 is cut" in car.log_of_genie(), "the car notices that its edge is gone")
    alone = car.play("3,3", pause_s=1.3, listen_s=0.8)
    assert [outcome for _, outcome, _ in lookups(car)[4:]] == ["miss", "hit"]
    assert alone[0]["objects"][0][0] == "bus", "its own detector's"

    edge.attach(role="edge", name="edge1", listen=address, cars=["car1"], keys=keys("edge1"))
    until(
        lambda: car.log_of_genie().count("edge edge1 is connected") == 2,
        "the car has found its edge again",
    )
    again = car.play("5", listen_s=1.0)
    assert again[0]["objects"][0][0] == "car", "the edge's"


def test_what_one_edge_has_seen_is_a_hit_at_the_other(
    new_master: Callable[[str], Master], keys: Keys
):
    first, second = new_master("edge1"), new_master("edge2")
    for edge in (first, second):
        edge.start_node(DETECTOR, "detector.py")
    address = f"127.0.0.1:{free_port()}"
    first.attach(role="edge", name="edge1", listen=address, edges=["edge2"], keys=keys("edge1"))
    second.attach(role="edge", name="edge2", connect=[f"edge1@{address}"], keys=keys("edge2"))
    until(lambda: "edge edge1 is connected" in second.log_of_genie(), "the link is up")
    first.play("1,2")
    answers = second.play("1")
    assert lookups(first) == [("edge1", "miss", "client")] * 2
    assert lookups(second) == [("edge1", "miss", "neighbour")] * 2 + [("edge2", "hit", "client")]
    assert answers[0]["objects"] == [["car", 1, 0.75, ["place", "1"]]]


def test_nobody_poisons_the_map(new_master: Callable[[str], Master], keys: Keys):
    """Neither with a certificate of another authority, nor, with one of ours, in the name of
    another car.
    """
    edge = new_master("edge1")
    edge.start_node(DETECTOR, "detector.py")
    address = f"127.0.0.1:{free_port()}"
    cars, keys_of_edge = ["car1", "car2"], keys("edge1")
    edge.attach(role="edge", name="edge1", listen=address, cars=cars, keys=keys_of_edge)
    image_type, objects = (
        WireType("sensor_msgs/Image", IMAGE_MD5),
        "/detection/image_detector/objects_remote",
    )

    def say(name: str, *, topic: str, origin: str, authority: str = "ours") -> None:
        plan = AttachPlan(
            node="/n",
            name=name,
            role="car",
            requests=(),
            answers=(),
            connect=(f"edge1@{address}",),
            keys=keys(name, authority),
        )
        links = Links(plan, {}.get)
        links.start(lambda *_: None)
        time.sleep(1.0)
        image = struct.pack("<IIII", 0, 1, 0, 6) + b"camera" + bytes(100)
        links.send(
            "edge1", topic, RosMessage.of(image, codec_of(image_type, 1), origin, answer=False)
        )
        time.sleep(0.5)
        links.close()

    images = "/image_raw_remote"
    say("car1", topic=images, origin="car1", authority="others")
    say("mallory", topic=images, origin="mallory")
    say("car2", topic=images, origin="car1")  # is car2, and not car1
    say("car2", topic=objects, origin="car2")  # images are no objects
    assert not (edge.folder / "record.jsonl").read_text()
    assert edge.log_of_genie().count("mallory at tls/127.0.0.1") == 1
    assert edge.log_of_genie().count("car car2 may not send") == 1
    assert edge.log_of_genie().count("a type that is not the one here") == 1

    say("car2", topic=images, origin="car2")
    assert lookups(edge) == [("car2", "miss", "client")], "an honest car is heard"
