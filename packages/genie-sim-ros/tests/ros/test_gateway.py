"""A Genie in its gateway, without ROS and without time: which message goes where."""

from __future__ import annotations

import math
import struct
from dataclasses import replace
from pathlib import Path

import pytest

from genie_sim.base.errors import UserError
from genie_sim.core.messages import CameraPose, Detection, Header
from genie_sim_ros.codec import WireType, begins_with_header, codec_of
from genie_sim_ros.gateway import Peer
from genie_sim_ros.message import RosMessage
from genie_sim_ros.plan import AttachPlan, make_gateway
from genie_sim_ros.poses import Poses

NS_PER_S = 10**9
SCAN = codec_of(WireType("my_msgs/Scan", "0" * 32, "Header header\nfloat32[] ranges\n"), 1)
CAR1, CAR2, EDGE2 = Peer("car1", "car"), Peer("car2", "car"), Peer("edge2", "edge")


def message(
    stamp_ns: int, content: bytes = b"", origin: str = "car1", frame: bytes = b"laser"
) -> RosMessage:
    stamp = divmod(stamp_ns, NS_PER_S)
    return RosMessage.of(
        struct.pack("<IIII", 5, *stamp, len(frame)) + frame + content, SCAN, origin, answer=True
    )


class Site:
    """A Genie for an opaque node /scan -> /result, its links to three others, and all that it has
    said.
    """

    def __init__(self, name: str, role: str, **settings: object) -> None:
        plan = AttachPlan(
            node="/node",
            name=name,
            role=role,
            requests=("/scan",),
            answers=("/result",),
            settings=settings,
            connect=("edge:1",),
        )
        self.said: list[tuple[str, Header, bytes]] = []
        self.sent: list[tuple[str, str, Header]] = []
        self.outcomes: list[str] = []
        self.gateway = make_gateway(
            plan,
            publish=self._publish,
            observe=lambda record, _: self._observe(record),
            links=self,
            object_codec=None,
        )

    def peers(self) -> list[Peer]:
        return [Peer("edge1", "edge")] if self.gateway.genie.name == "car1" else [CAR1, CAR2, EDGE2]

    def send(self, peer: str, topic: str, message: RosMessage) -> None:
        self.sent.append((peer, topic, message.header))

    def _publish(self, topic: str, message: RosMessage) -> None:
        payload = message.encoded()
        assert SCAN.stamp(payload) == message.header[:2], "what is sent says what the Genie means"
        self.said.append((topic, message.header, SCAN.content(payload)))

    def _observe(self, record: object) -> None:
        self.outcomes.append(getattr(record, "outcome", type(record).__name__))

    def hear(self, topic: str, said: RosMessage, now_s: float = 0.0) -> None:
        self.gateway.from_ros(topic, said, int(now_s * NS_PER_S), "/somebody")


def test_an_opaque_message_is_matched_by_bytes_and_answered_by_its_header():
    car = Site("car1", "car")
    car.hear("/scan", message(1, b"same"))
    car.hear("/result_local", message(1, b"answer"))
    car.hear("/scan", message(2, b"same", frame=b"another frame"))
    car.hear("/scan", message(3, b"different"))
    assert car.outcomes == ["miss", "hit", "miss"]
    answers = [
        (header.stamp_ns, header.frame_id, content)
        for topic, header, content in car.said
        if topic == "/result"
    ]
    assert answers == [(1, "laser", b"answer"), (2, "another frame", b"answer")]
    assert [to for to, *_ in car.sent] == ["edge1", "edge1"], "only misses go up"


@pytest.mark.parametrize(
    ("learns", "outcomes"), [("all", ["miss", "hit"]), ("own", ["miss", "miss"])]
)
def test_a_car_may_learn_from_its_own_node_only(learns: str, outcomes: list[str]):
    car = Site("car1", "car", car_learns=learns)
    car.hear("/scan", message(1, b"same"))
    car.gateway.from_link(Peer("edge1", "edge"), "/result", message(1, b"of the edge"), 0)
    assert [content for topic, _, content in car.said if topic == "/result"] == [b"of the edge"]
    car.hear("/scan", message(2, b"same"))
    assert car.outcomes == outcomes


def test_stamps_that_go_back_are_stamps_like_others():
    """A bag that begins again, or a clock that has been set: a request is known by its stamp, not
    by its order.
    """
    car = Site("car1", "car")
    for stamp_ns in (9, 5, 7, 1):
        car.hear("/scan", message(stamp_ns, b"%d" % stamp_ns))
    for stamp_ns in (1, 7, 5, 9):
        car.hear("/result_local", message(stamp_ns, b"to %d" % stamp_ns))
    answers = [
        (header.stamp_ns, content) for topic, header, content in car.said if topic == "/result"
    ]
    assert answers == [(1, b"to 1"), (7, b"to 7"), (5, b"to 5"), (9, b"to 9")]


def test_what_the_node_says_unasked_or_late_still_reaches_the_robot():
    car = Site("car1", "car", request_expiry="2 s")
    car.hear("/result_local", message(7, b"unasked"))
    car.hear("/scan", message(8, b"slow"))
    car.hear("/result_local", message(8, b"late"), now_s=3.0)
    assert [content for topic, _, content in car.said if topic == "/result"] == [
        b"unasked",
        b"late",
    ]


def test_cars_with_equal_stamps_are_not_taken_for_each_other():
    """Two cars that replay one bag: the node knows nothing of cars, so the second request is a
    nanosecond later.
    """
    edge = Site("edge1", "edge")
    edge.gateway.from_link(CAR1, "/scan_remote", message(5, b"one", "car1"), 0)
    edge.gateway.from_link(CAR2, "/scan_remote", message(5, b"two", "car2"), 0)
    to_node = [header.stamp_ns for topic, header, _ in edge.said if topic == "/scan_local"]
    assert to_node == [5, 6]
    edge.hear("/result_local", message(6, b"of two", "edge1"))
    edge.hear("/result_local", message(5, b"of one", "edge1"))
    to_cars = [(peer, header) for peer, topic, header in edge.sent if topic == "/result"]
    assert to_cars == [("car2", Header(5, "laser", "car2")), ("car1", Header(5, "laser", "car1"))]
    assert "/result" not in [topic for topic, *_ in edge.said], "nobody at the edge asked"


@pytest.mark.parametrize(
    ("role", "peer", "topic", "origin"),
    [
        ("edge", CAR1, "/scan_remote", "car2"),  # in another car's name
        ("edge", CAR1, "/result_remote", "car1"),  # a car gives no answers
        ("edge", CAR1, "/scan", "car1"),
        ("edge", EDGE2, "/result_local", "edge2"),  # speaks for the node
        ("car", Peer("edge1", "edge"), "/result", "car2"),  # an answer to somebody else
        ("car", Peer("edge1", "edge"), "/scan_remote", "car1"),
        ("car", Peer("edge1", "edge"), "/cmd_vel", "car1"),
    ],
)
def test_a_genie_says_only_what_it_has_a_right_to(role: str, peer: Peer, topic: str, origin: str):
    site = Site("car1" if role == "car" else "edge1", role)
    with pytest.raises(ValueError, match=f"{peer.role} {peer.name} may not send {topic}"):
        site.gateway.from_link(peer, topic, message(1, b"", origin), 0)
    assert (site.said, site.sent, site.outcomes) == ([], [], [])


def test_pose_grid_without_a_pose_never_hits():
    plan = AttachPlan(
        node="/n",
        name="car1",
        role="car",
        requests=("/scan",),
        answers=("/result",),
        settings={"similarity": "pose_grid"},
        pose_topic="/pose",
    )
    outcomes: list[str] = []
    gateway = make_gateway(
        plan,
        publish=lambda *_: None,
        observe=lambda record, _: outcomes.append(record.outcome),
        links=Site("car1", "car"),
        object_codec=None,
    )
    here = CameraPose(10.2, 5.0, 0.0, 0.1)
    for stamp_ns, pose in ((1, None), (2, None), (3, here), (4, None), (5, here)):
        gateway.from_ros(
            "/scan", replace(message(stamp_ns), pose=pose, horizontal_fov_rad=1.4), 0, "/camera"
        )
        gateway.from_ros("/result_local", message(stamp_ns), 0, "/node")
    assert outcomes == ["miss", "miss", "miss", "miss", "hit"]


def test_the_pose_nearest_in_time_counts():
    """geometry_msgs/PoseStamped: a header and seven doubles; looking north is heading pi/2."""
    poses = Poses(1)
    for second, x in ((1, 10.0), (2, 20.0)):
        content = struct.pack("<7d", x, 0.0, 0.0, 0.0, 0.0, 0.5**0.5, 0.5**0.5)
        poses.receive("geometry_msgs/PoseStamped", message(second * NS_PER_S, content).payload)
    found = poses.at(2 * NS_PER_S - 1)
    assert (
        found is not None
        and found.east_m == 20.0
        and found.heading_rad == pytest.approx(3.14159265 / 2)
    )
    assert poses.at(3 * NS_PER_S) is None, "too old"
    for wrong in (math.nan, math.inf):
        with pytest.raises(ValueError, match="not finite"):
            poses.receive(
                "geometry_msgs/PoseStamped",
                message(9, struct.pack("<7d", wrong, *[0.0] * 6)).payload,
            )
    with pytest.raises(ValueError, match="no geometry_msgs/PoseStamped"):
        poses.receive("geometry_msgs/PoseStamped", message(9, b"short").payload)
    with pytest.raises(UserError, match="sensor_msgs/Imu has no pose"):
        poses.receive("sensor_msgs/Imu", b"")


def test_the_last_hundred_poses_are_kept():
    poses = Poses(1)
    for second in range(101):
        content = struct.pack("<7d", float(second), *[0.0] * 5, 1.0)
        poses.receive("geometry_msgs/PoseStamped", message(second * NS_PER_S, content).payload)
    assert poses.at(0) is None, "the first one made room"
    second = poses.at(NS_PER_S)
    assert second is not None and second.east_m == 1.0


def test_a_plan_without_a_field_of_view_sees_nothing_of_a_map():
    plan = AttachPlan(node="/n", name="car1", role="car", requests=(), answers=())
    assert AttachPlan.from_json(plan.to_json()) == plan
    assert plan.horizontal_fov_rad == 0.0 and plan.listen is None


@pytest.mark.parametrize(
    ("definition", "expected"),
    [
        ("# comment\n\nHeader header\nint32 x\n", True),
        ("std_msgs/Header stamp_of_it # with a comment\n", True),
        ("uint8 A=1\nstring B=Header # constants come first\nHeader header\n", True),
        ("int32 x\nHeader header\n", False),
        ("string data\n" + "=" * 80 + "\nMSG: std_msgs/Header\nHeader h\n", False),
    ],
)
def test_which_types_have_a_header(definition: str, expected: bool):
    assert begins_with_header(definition) is expected


@pytest.mark.parametrize("payload", [b"", b"\0" * 15, struct.pack("<IIII", 0, 0, 0, 2**31) + b"x"])
def test_bytes_that_are_no_message_are_called_so(payload: bytes):
    with pytest.raises(ValueError, match="header"):
        codec_of(WireType("a/B"), 1).stamp(payload)


def test_the_hash_of_a_ros_image_is_that_of_the_trace():
    """The same picture as bgr8, with padded rows, gives the hash that ``perceive`` writes."""
    import numpy as np

    from genie_sim.data.encoding import difference_hash

    picture = np.random.default_rng(3).integers(0, 256, (48, 64, 3), dtype=np.uint8)
    rows = np.pad(picture.reshape(48, -1), ((0, 0), (0, 8)))
    content = (
        struct.pack("<III", 48, 64, 4)
        + b"bgr8"
        + struct.pack("<BII", 0, 200, rows.size)
        + rows.tobytes()
    )
    assert codec_of(WireType("sensor_msgs/Image"), 1).dhash(
        message(1, content).payload
    ) == difference_hash(picture)


def test_an_image_cut_short_has_no_hash():
    image = codec_of(WireType("sensor_msgs/Image"), 1)
    content = struct.pack("<III", 48, 64, 4) + b"bgr8" + struct.pack("<BII", 0, 192, 10) + bytes(10)
    with pytest.raises(ValueError, match="an image of 64x48 with 10 bytes"):
        image.dhash(message(1, content).payload)
    with pytest.raises(ValueError, match="no sensor_msgs/Image"):
        image.dhash(message(1, content[:-5]).payload)


@pytest.mark.parametrize("ros", [1, 2])
def test_objects_survive_the_object_map(ros: int):
    """Read, given another confidence, written, read again: in both ROS, with a place in the map's
    frame only.
    """
    if ros == 1:
        definition = (Path(__file__).parent / "objects.txt").read_text()
        codec = codec_of(WireType("autoware_msgs/DetectedObjectArray", "2" * 32, definition), 1)
    else:
        codec = codec_of(WireType("visualization_msgs/msg/MarkerArray"), 2)
    from_map = Detection("car", 0.5, None, (1.0, 2.0, 3.0), 0.5)
    payload = codec.with_objects(b"", Header(5 * NS_PER_S + 7, "camera", "car1"), [from_map])
    assert codec.stamp(payload) == (5 * NS_PER_S + 7, "camera")
    (read,) = codec.objects(payload)
    assert (read.label, read.confidence) == ("car", 0.5)
    assert read.location == ((1.0, 2.0, 3.0) if ros == 1 else None), (
        "markers are placed by their own header's frame"
    )
    again = codec.with_objects(payload, Header(6, "map", "car1"), [read.with_confidence(0.75)])
    assert codec.stamp(again) == (6, "map")
    (read,) = codec.objects(again)
    assert (read.label, read.confidence, read.location) == ("car", 0.75, (1.0, 2.0, 3.0))
    assert codec.content(codec.restamped(again, 99, "map")) == codec.content(again)
    whole = RosMessage.of(again, codec, "car1", answer=True)
    assert whole.encoded() is again, "what nobody has changed keeps its bytes"
    image = RosMessage(whole.header, again, codec)
    assert image.encoded() is again, "and what has no objects, too"
    nowhere = codec.with_objects(
        b"", Header(1, "map", ""), [replace(from_map, location=(math.nan,) * 3)]
    )
    assert codec.objects(nowhere)[0].location is None
    with pytest.raises(ValueError, match="no "):
        codec.objects(payload[:-3])


def test_a_stamp_of_ros_2_is_changed_in_place():
    codec = codec_of(WireType("sensor_msgs/msg/Image"), 2)
    payload = b"\0\1\0\0" + struct.pack("<iII", 3, 4, 7) + b"camera\0" + bytes(20)
    assert codec.stamp(payload) == (3 * NS_PER_S + 4, "camera")
    assert codec.stamp(codec.restamped(payload, 8 * NS_PER_S + 1, "camera")) == (
        8 * NS_PER_S + 1,
        "camera",
    )
    assert codec.content(codec.restamped(payload, 8, "camera")) == bytes(20)
