"""What a Genie's process tells ROS, with stand-ins for its packages: publishers, subscriptions,
quality of service, message classes, command lines.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from types import ModuleType, SimpleNamespace
from typing import Any
from unittest import mock

import pytest

from genie_sim.base.errors import UserError
from genie_sim_ros.codec import WireType
from tests.ros.stand_ins import imported

IMAGE, OBJECTS = WireType("sensor_msgs/Image", "12ab"), WireType("my_msgs/Scan", "34cd")


def noting(cls: Any, plan: Any) -> Any:
    """A Genie of this class that notes what comes from ROS, without a connection."""
    genie = cls.__new__(cls)
    genie.plan, genie.codecs = plan, {}
    genie._publishers, genie._subscribers, genie._sent = {}, [], {}
    genie.heard, genie.failures = [], []
    genie.from_ros = lambda *given: genie.heard.append(given)
    genie.from_pose_topic = lambda *given: genie.heard.append(given)
    genie.fail = genie.failures.append
    return genie


PLAN = SimpleNamespace(
    node="/a/detector",
    requests=("/left", "/right"),
    answers=("/cars",),
    pose_topic="/pose",
    types={"/left": IMAGE},
)


@pytest.fixture
def ros2() -> Iterator[ModuleType]:
    yield from imported("ros2")


@pytest.fixture
def ros1() -> Iterator[ModuleType]:
    yield from imported("ros1")


class Node2:
    """A node of ROS 2 whose topics have so many publishers and subscribers."""

    def __init__(self, **counts: int) -> None:
        self.counts = counts
        self.published: list[str] = []
        self.subscribed: list[str] = []
        self.offered: list[Any] = []

    def create_publisher(self, cls: Any, topic: str, quality: Any) -> Any:
        self.published.append(topic)
        count = self.counts.get(topic, 0)
        return SimpleNamespace(get_subscription_count=lambda: count, publish=self.published.append)

    def create_subscription(self, cls: Any, topic: str, call: Any, quality: Any, raw: bool) -> None:
        assert raw, "messages stay bytes"
        self.subscribed.append(topic)

    def count_publishers(self, topic: str) -> int:
        return self.counts.get(topic, 0)

    def get_publishers_info_by_topic(self, topic: str) -> list[Any]:
        return self.offered


@pytest.fixture
def genie2(ros2: ModuleType, monkeypatch: pytest.MonkeyPatch) -> Any:
    genie = noting(ros2.Ros2Genie, PLAN)
    types = {"/left": IMAGE, "/right": IMAGE, "/cars": OBJECTS}
    genie.codecs = {topic: SimpleNamespace(type=kind) for topic, kind in types.items()}
    monkeypatch.setattr(ros2, "class_of", lambda name: name)
    genie._context = None
    return genie


def test_ros_2_publishes_and_subscribes_on_each_side_of_the_node(genie2: Any):
    genie2._node = node = Node2()
    genie2.connect()
    assert node.published == ["/left_local", "/right_local", "/cars"]
    assert node.subscribed == ["/left", "/right", "/cars_local", "/pose"]


@pytest.mark.parametrize(("left", "right", "all_there"), [(1, 2, True), (0, 1, False)])
def test_ros_2_waits_for_the_node_on_every_topic(
    genie2: Any, left: int, right: int, all_there: bool
):
    genie2._node = Node2(**{"/left_local": left, "/right_local": right, "/cars_local": right})
    genie2.connect()
    assert bool(genie2.requests_have_subscriber()) is all_there
    assert genie2.answers_have_publisher()
    genie2._node.counts["/cars_local"] = 0
    assert not genie2.answers_have_publisher()


def test_ros_2_publishes_what_fits_the_topic(genie2: Any):
    genie2._node = node = Node2()
    genie2.connect()
    del node.published[:]
    scan = SimpleNamespace(codec=SimpleNamespace(type=OBJECTS), encoded=lambda: b"scan")
    genie2.publish("/cars", scan)
    genie2.publish("/cars_remote", scan)  # there is no such topic on this host
    genie2.publish("/left_local", scan)  # a picture's topic
    assert node.published == [b"scan"]


@pytest.mark.parametrize(
    ("offers", "reliability", "durability"),
    [
        ([], "reliable", "volatile"),
        ([("reliable", "latched")], "reliable", "latched"),
        ([("reliable", "latched"), ("reliable", "volatile")], "reliable", "volatile"),
        ([("reliable", "volatile"), ("best effort", "volatile")], "best effort", "volatile"),
    ],
)
def test_ros_2_asks_for_no_more_than_is_offered(
    ros2: ModuleType, genie2: Any, offers: Any, reliability: str, durability: str
):
    for name, words in (
        ("ReliabilityPolicy", {"RELIABLE": "reliable", "BEST_EFFORT": "best effort"}),
        ("DurabilityPolicy", {"VOLATILE": "volatile", "TRANSIENT_LOCAL": "latched"}),
    ):
        setattr(ros2, name, SimpleNamespace(**words))
    genie2._node = node = Node2()
    node.offered = [
        SimpleNamespace(qos_profile=SimpleNamespace(reliability=one, durability=other))
        for one, other in offers
    ]
    genie2._quality("/left")
    asked = ros2.QoSProfile.call_args.kwargs
    assert (asked["reliability"], asked["durability"]) == (reliability, durability)


def test_the_command_line_of_a_node_that_begins_again_with_local_topics():
    ros2_graph = importlib.import_module("genie_sim_ros.ros2_graph")
    graph = next(
        value
        for value in vars(ros2_graph).values()
        if isinstance(value, type) and hasattr(value, "remapped")
    )
    remapped = graph.remapped
    argv = ["detector", "-r", "images:=/left", "--remap", "objects:=cars", "-r", "x", "/left:=/y"]
    line = remapped(None, "/a/detector", argv, ["/left", "/a/cars"])
    assert line == (
        *("detector", "-r", "images:=/left_local", "--remap", "objects:=/a/cars_local"),
        *("-r", "x", "/left:=/y", "--ros-args"),
        *("-r", "/left:=/left_local", "-r", "/a/cars:=/a/cars_local", "-r", "__node:=detector"),
    )


@pytest.fixture
def genie1(ros1: ModuleType) -> Any:
    ros1.rospy.AnyMsg = type("AnyMsg", (), {"__slots__": ["_buff"]})
    ros1.rospy.get_name.return_value = "/genie"
    return noting(ros1.Ros1Genie, PLAN)


def sent(ros1: ModuleType) -> list[Any]:
    return [call.args[0] for call in ros1.rospy.Publisher.return_value.publish.call_args_list]


def test_ros_1_numbers_answers_and_keeps_a_topic_s_type(ros1: ModuleType, genie1: Any):
    def scan(kind: WireType) -> Any:
        return SimpleNamespace(codec=SimpleNamespace(type=kind), encoded=lambda seq=None: seq)

    for _ in range(2):
        genie1.publish("/cars", scan(OBJECTS))
    genie1.publish("/left_local", scan(IMAGE))
    genie1.publish("/left_local", scan(OBJECTS))  # objects for a topic of pictures
    assert [raw._buff for raw in sent(ros1)] == [1, 2, None]
    (cars, left) = ros1.rospy.Publisher.call_args_list
    assert (cars.args[0], left.args[0]) == ("/cars", "/left_local"), "one publisher a topic"
    assert (cars.args[1]._type, cars.args[1]._md5sum) == ("my_msgs/Scan", "34cd")
    assert left.args[1]._full_text == IMAGE.definition


def test_ros_1_hears_others_and_not_itself(ros1: ModuleType, genie1: Any):
    def raw(caller: str, kind: str = "sensor_msgs/Image") -> Any:
        header = {"callerid": caller, "type": kind, "md5sum": "060021388200f6f0f447d0fcd9c64743"}
        return SimpleNamespace(_connection_header=header, _buff=b"bytes")

    genie1._on_message(raw("/genie"), "/left")
    assert genie1.heard == []
    genie1._on_message(raw("/camera"), "/left")
    genie1._on_message(raw("/camera"), "/left")
    (topic, buffer, codec, caller), again = genie1.heard
    assert (topic, buffer, caller) == ("/left", b"bytes", "/camera") and again[2] is codec
    genie1._on_pose(raw("/gps", "nav_msgs/Odometry"))
    assert genie1.heard[-1] == ("nav_msgs/Odometry", b"bytes")
    with mock.patch.object(ros1, "codec_of", side_effect=UserError("unknown type")):
        genie1._on_message(raw("/camera", "my_msgs/New"), "/right")
    assert [str(error) for error in genie1.failures] == ["unknown type"]
