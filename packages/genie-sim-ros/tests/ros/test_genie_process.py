"""A Genie's process without ROS: whatever arrives, the threads that bring it go on."""

from __future__ import annotations

import logging
import math
import struct

import pytest

from genie_sim.base.errors import UserError
from genie_sim_ros import genie_process
from genie_sim_ros.codec import IMAGE, WireType, codec_of
from genie_sim_ros.genie_process import GenieProcess, OneLine
from genie_sim_ros.message import RosMessage
from genie_sim_ros.plan import AttachPlan
from genie_sim_ros.typestore import message, time, typestore
from tests.ros.conftest import until

IMAGE_TYPE = WireType("sensor_msgs/Image", "060021388200f6f0f447d0fcd9c64743")
POSE = "geometry_msgs/msg/PoseStamped"


class Process(GenieProcess):
    """A Genie in front of a node of ROS 1 or 2 that is not there; ``published`` are the topics of
    what it has said.
    """

    def __init__(self, ros: int, **settings: object) -> None:
        self.published: list[str] = []
        self.ros = ros
        self.store = typestore(ros)
        super().__init__(
            AttachPlan(
                node="/node",
                name="car1",
                role="car",
                requests=("/image_raw",),
                answers=("/objects",),
                types={"/image_raw": IMAGE_TYPE, "/objects": WireType("my_msgs/Scan", "0" * 32)},
                settings=settings,
                pose_topic="/pose",
                horizontal_fov_rad=1.4,
            ),
            ros,
        )

    def connect(self) -> None:
        pass

    def publish(self, topic: str, message: RosMessage) -> None:
        message.encoded()
        self.published.append(topic)

    def requests_have_subscriber(self) -> bool:
        return True

    def answers_have_publisher(self) -> bool:
        return True

    def stop(self) -> None:
        self.ended.set()

    def hear_pose(self, second: int, x_m: float) -> None:
        header = {"stamp": time(second * 10**9), "frame_id": "map"}
        pose = {"position": {"x": x_m}, "orientation": {"w": 1.0}}
        self.from_pose_topic(
            "geometry_msgs/PoseStamped", self.written(POSE, header=header, pose=pose)
        )

    def hear_image(self, second: int) -> None:
        header = {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": "camera"}
        payload = bytearray(self.written(IMAGE, header=header))
        struct.pack_into("<I", payload, 4, second)
        self.from_ros("/image_raw", bytes(payload), self.codecs["/image_raw"], "/camera")

    def written(self, kind: str, **fields: object) -> bytes:
        store = self.store
        write = store.serialize_ros1 if self.ros == 1 else store.serialize_cdr
        return bytes(write(message(store, kind, **fields), kind))


@pytest.mark.parametrize("ros", [1, 2])
@pytest.mark.parametrize("x_m", [1e308, -1e300, 1e8, math.inf, math.nan])
def test_a_pose_nowhere_on_earth_is_dropped_and_images_go_on(
    ros: int, x_m: float, caplog: pytest.LogCaptureFixture
):
    genie = Process(ros, similarity="pose_grid")
    genie.hear_pose(1, x_m)
    genie.hear_image(1)
    assert "/pose: dropped a pose: a pose whose numbers are not finite" in caplog.text
    assert "/image_raw_local" in genie.published, "without a pose it is like no other image"
    genie.hear_pose(2, 3.0)
    genie.hear_image(2)
    assert genie.published.count("/image_raw_local") == 2 and not genie.ended.is_set()


@pytest.mark.parametrize("ros", [1, 2])
@pytest.mark.parametrize("second", [2**31 - 1, 2**31, 2**32 - 1])
def test_stamps_at_the_end_of_time_end_nothing(ros: int, second: int):
    """Two cameras with one stamp: the second request gets the next free nanosecond."""
    genie = Process(ros, similarity="exact")
    genie.hear_image(second)
    genie.hear_image(second)
    genie.hear_image(5)
    assert genie.published.count("/image_raw_local") >= 1 and not genie.ended.is_set()


@pytest.mark.parametrize(
    "error", [OverflowError("too far"), struct.error("too late"), KeyError("x"), MemoryError()]
)
def test_no_error_ends_the_thread_that_brings_messages(
    error: Exception, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
):
    genie = Process(1)

    def fail(*_: object) -> None:
        raise error

    monkeypatch.setattr(genie.gateway, "from_ros", fail)
    monkeypatch.setattr(genie._poses, "receive", fail)
    genie.hear_image(1)
    genie.hear_pose(1, 1.0)
    assert [record.levelno for record in caplog.records] == [logging.WARNING] * 2
    assert "/image_raw: dropped a message: " in caplog.text and not genie.ended.is_set()


def test_a_user_error_ends_the_process_and_is_told(monkeypatch: pytest.MonkeyPatch):
    genie = Process(1, similarity="dhash")
    error = UserError("dhash: my_msgs/Scan is no image")

    def fail(*_: object) -> None:
        raise error

    monkeypatch.setattr(genie.gateway, "from_ros", fail)
    genie.hear_image(1)
    assert genie.ended.is_set() and genie.failure is error


def test_the_timer_goes_on_after_an_error(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(genie_process, "TICK_S", 0.01)
    genie = Process(1)
    calls: list[int] = []

    def on_timer(now_ns: int) -> None:
        calls.append(now_ns)
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(genie.gateway, "on_timer", on_timer)
    genie.start()
    until(lambda: len(calls) > 3, "it is called again")
    genie.stop()


def test_a_stamp_that_no_message_can_hold_is_a_value_error():
    header = struct.pack("<IIII", 0, 1, 0, 1) + b"x"
    codec = codec_of(IMAGE_TYPE, 1)
    for stamp_ns in (-1, 2**32 * 10**9):
        with pytest.raises(ValueError, match="does not fit into a message"):
            codec.restamped(header, stamp_ns, "x")
    assert codec.restamped(header, 2**32 * 10**9 - 1, "x")


def test_a_line_of_the_log_is_one_line_whatever_it_quotes():
    quoted = "a\nlink: edge1 is connected\x1b[2J\u2028"
    record = logging.LogRecord("x", logging.WARNING, "", 0, "dropped: %s", (quoted,), None)
    assert OneLine().format(record) == "dropped: a\\nlink: edge1 is connected\\x1b[2J\\u2028"
