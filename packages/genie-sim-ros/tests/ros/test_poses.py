"""The pose of the camera from a pose topic, and the clock that stamps frames."""

from __future__ import annotations

import math

import pytest

from genie_sim.base.errors import UserError
from genie_sim.core.messages import Publish
from genie_sim_ros.codec import WireType, codec_of
from genie_sim_ros.looks import MAX_STEP_BACK_NS, EdgeRelay, StampClock
from genie_sim_ros.message import checked_pose
from genie_sim_ros.poses import POSE_TYPES, Poses
from genie_sim_ros.typestore import message, stamp_ns, time, typestore

MS = 1_000_000


def payload(kind: str, now_ns: int, turn_rad: float = 0.0, x_m: float = 1.0) -> bytes:
    """A message of ROS 2 at (x, 2, 3), turned to the left about the vertical."""
    store = typestore(2)
    package, name = kind.split("/")
    pose = {
        "position": {"x": x_m, "y": 2.0, "z": 3.0},
        "orientation": {"z": math.sin(turn_rad / 2), "w": math.cos(turn_rad / 2)},
    }
    inner = pose if name == "PoseStamped" else {"pose": pose}
    whole = message(store, f"{package}/msg/{name}", header={"stamp": time(now_ns)}, pose=inner)
    return bytes(store.serialize_cdr(whole, f"{package}/msg/{name}"))


@pytest.mark.parametrize("kind", POSE_TYPES)
@pytest.mark.parametrize("turn_rad", [0.0, 1.0, -2.5, 3.1])
def test_every_kind_of_message_has_place_and_heading(kind: str, turn_rad: float):
    poses = Poses(2)
    poses.receive(kind.replace("/", "/msg/"), payload(kind, 5_000 * MS, turn_rad))
    pose = poses.at(5_000 * MS)
    assert pose is not None and pose[:3] == (1.0, 2.0, 3.0)
    assert pose.heading_rad == pytest.approx(turn_rad)


def test_the_nearest_pose_counts_if_it_is_no_older_than_half_a_second():
    poses, (kind, *_) = Poses(2), POSE_TYPES
    assert poses.at(0) is None
    for now_ms in (1_000, 1_200, 3_000):
        poses.receive(kind, payload(kind, now_ms * MS, x_m=float(now_ms)))

    def x_at(now_ms: float) -> float | None:
        pose = poses.at(round(now_ms * MS))
        return None if pose is None else pose.east_m

    assert x_at(1_090) == 1_000 and x_at(1_110) == 1_200
    assert x_at(500) == 1_000 and x_at(499.9) is None
    assert x_at(1_700) == 1_200 and x_at(1_700.1) is None
    assert x_at(3_500) == 3_000


def test_another_type_and_a_place_that_is_none_are_refused():
    with pytest.raises(UserError, match="sensor_msgs/msg/Image has no pose; known: geometry_msgs"):
        Poses(2).receive("sensor_msgs/msg/Image", b"")
    for place in ((math.nan, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, math.inf), (1e9, 0.0, 0.0, 0.0)):
        with pytest.raises(ValueError, match="not finite, or larger than the Earth"):
            checked_pose(*place)
    assert checked_pose(1.0, 2.0, 3.0, 0.5) == (1.0, 2.0, 3.0, 0.5)


def test_the_clock_of_the_stamps_is_that_of_the_quickest_frame():
    clock = StampClock()
    assert clock.now_ns(50) == 50
    clock.received(stamp_ns=1_000, now_ns=100)
    assert clock.now_ns(200) == 1_100
    clock.received(1_050, 160)  # came 10 ns later after its stamp
    assert clock.now_ns(200) == 1_100
    clock.received(1_100, 190)  # came sooner
    assert clock.now_ns(200) == 1_110
    clock.received(1_110 + 200 - 1_110 - MAX_STEP_BACK_NS + 910, 200)  # exactly a second behind
    assert clock.now_ns(200) == 1_110
    clock.received(1_109 - MAX_STEP_BACK_NS, 200)  # set back by more
    assert clock.now_ns(200) == 1_109 - MAX_STEP_BACK_NS


def test_an_edge_that_keeps_nothing_hands_frames_on_and_answers_back():
    relay = EdgeRelay("edge1/genie", ["/images"], ["/objects"], suffixes=("_local", "_remote"))
    assert relay.subscriptions() == ("/images", "/objects_local")
    assert relay.publications() == ("/images_local", "/objects")
    assert relay.on_message("/images", "frame", 5) == [Publish("/images_local", "frame")]
    assert relay.on_message("/objects_local", "answer", 5) == [Publish("/objects", "answer")]
    assert relay.on_message("/objects", "of another edge", 5) == relay.on_deadline(5) == []


def test_a_message_is_empty_but_for_what_is_given():
    store = typestore(2)
    info = message(
        store, "sensor_msgs/msg/CameraInfo", width=4, header={"stamp": time(7 * 10**9 + 5)}
    )
    assert (info.width, info.height, info.distortion_model) == (4, 0, "")
    assert stamp_ns(info.header) == 7 * 10**9 + 5 and info.header.frame_id == ""
    assert info.k.tolist() == [0.0] * 9 and info.k.dtype == "float64", "of fixed length"
    assert info.d.tolist() == [] and info.roi.do_rectify is False
    image = message(store, "sensor_msgs/msg/Image")
    assert image.data.tolist() == [] and image.data.dtype == "uint8"
    path = message(store, "nav_msgs/msg/Path", poses=[{"pose": {"position": {"x": 2.0}}}, {}])
    assert [one.pose.position.x for one in path.poses] == [2.0, 0.0]
    names = message(store, "sensor_msgs/msg/JointState", name=["a"])
    assert names.name == ["a"] and names.position.tolist() == []
    assert typestore(1) is not store
    with pytest.raises(ValueError, match="my_msgs/msg/Bad: "):
        typestore(2, "uint8[ x", "my_msgs/msg/Bad")
    codec = codec_of(WireType("geometry_msgs/PoseStamped"), 2)
    assert codec.stamp(payload("geometry_msgs/PoseStamped", 12 * MS)) == (12 * MS, "")
