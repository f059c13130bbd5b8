"""A car's Genie that paces its looks and the relays of its edges, in their gateways: links that
fail and come back, without ROS and without time.
"""

from __future__ import annotations

import heapq
import struct
from collections.abc import Callable
from dataclasses import replace
from itertools import count, pairwise
from pathlib import Path

import pytest

from genie_sim.base.errors import UserError
from genie_sim.core.messages import CameraPose, Detection, Header, Observation
from genie_sim.sim.monitor import LookEvent
from genie_sim_ros.codec import WireType, codec_of
from genie_sim_ros.gateway import Gateway, Peer
from genie_sim_ros.looks import StampClock
from genie_sim_ros.message import RosMessage
from genie_sim_ros.plan import AttachPlan, check, checked_settings, make_gateway

MS, S = 1_000_000, 1_000_000_000
IMAGE = codec_of(WireType("my_msgs/Scan", "0" * 32, "Header header\nfloat32[] ranges\n"), 1)
DEFINITION = Path(__file__).with_name("objects.txt").read_text()
ARRAY = codec_of(WireType("autoware_msgs/DetectedObjectArray", "2" * 32, DEFINITION), 1)
EDGE_MS, OWN_MS, WAY_MS = 30, 300, 20  # detectors, and one way over a link
STAMPS_BEGIN_NS = 1_000 * S  # when the drive begins on the clock of the cameras,
HERE_BEGIN_NS = 9_000 * S  # and on that of the gateways
CAR_AHEAD = Detection("car", 0.9, None, (20.0, 0.5, 0.0), 0.9)


def here_ns(time_ms: int) -> int:
    """A time of the drive on the clock of the gateways."""
    return HERE_BEGIN_NS + time_ms * MS


def plan(name: str, role: str, **settings: object) -> AttachPlan:
    return AttachPlan(
        node="/detector",
        name=name,
        role=role,
        requests=("/image",),
        answers=("/objects",),
        settings={"method": "recommended", **settings},
        pose_topic="/pose",
        horizontal_fov_rad=1.4,
        connect=("edge1@there:1",) if role == "car" else (),
    )


class Drive:
    """A car with its detector, and edges with theirs. ``up`` are the edges that the car is
    connected to, in the order in which they came. All detectors see the same car.
    """

    def __init__(self, *edges: str, **settings: object) -> None:
        self.up = list(edges)
        self.now_ms = 0
        self.events: list[tuple[int, str, str, int]] = []  # when, way, outcome, stamp [ms]
        self.answers: list[tuple[int, int, int, int]] = []  # when, stamp, how many, how old
        self.to_edge: dict[str, list[int]] = {name: [] for name in edges}
        self._numbers = count()
        self._steps: list[tuple[int, int, Callable[[], None]]] = []
        self._car = self._gateway("car1", "car", settings)
        self._edges = {name: self._gateway(name, "edge", settings) for name in edges}

    def connect(self, name: str) -> None:
        self.up.append(name)

    def at(self, time_ms: int, step: Callable[[], None]) -> None:
        heapq.heappush(self._steps, (time_ms, next(self._numbers), step))

    def run(self, until_ms: int, cameras: bool = True, posed: bool = True) -> None:
        """A frame every 100 ms, and the gateways' timers."""
        for time_ms in range(0, until_ms, 100):
            if cameras:
                self.at(time_ms, lambda: self._frame(posed))
            self.at(time_ms + 50, self._timers)
        while self._steps:
            self.now_ms, _, step = heapq.heappop(self._steps)
            step()

    def outcomes(self, way: str, outcome: str, after_ms: int, before_ms: int) -> list[int]:
        """The stamps [ms] of the looks with an outcome in a time."""
        return [
            stamp_ms
            for time_ms, *what, stamp_ms in self.events
            if what == [way, outcome] and after_ms <= time_ms < before_ms
        ]

    def _gateway(self, name: str, role: str, settings: dict[str, object]) -> Gateway:
        return make_gateway(
            plan(name, role, **settings),
            publish=lambda topic, message: self._publish(name, topic, message),
            observe=self._observe,
            links=Links(self, name),
            object_codec=ARRAY,
        )

    def _frame(self, posed: bool) -> None:
        stamp_ns = STAMPS_BEGIN_NS + self.now_ms * MS
        payload = struct.pack("<IIII", 0, *divmod(stamp_ns, S), 6) + b"camera" + bytes(9)
        pose = CameraPose(0.0, 0.0, 1.6, 0.0) if posed else None
        image = RosMessage(
            Header(stamp_ns, "camera", "car1"), payload, IMAGE, pose=pose, horizontal_fov_rad=1.4
        )
        self._car.from_ros("/image", image, here_ns(self.now_ms), "/camera")

    def _timers(self) -> None:
        for gateway in (self._car, *self._edges.values()):
            gateway.on_timer(here_ns(self.now_ms))

    def _publish(self, name: str, topic: str, message: RosMessage) -> None:
        if topic == "/image_local":
            gateway = self._car if name == "car1" else self._edges[name]
            took_ms = OWN_MS if name == "car1" else EDGE_MS
            payload = ARRAY.with_objects(b"", message.header, [CAR_AHEAD])
            answer = RosMessage.of(payload, ARRAY, name, answer=True)
            hear = gateway.from_ros
            at_ms = self.now_ms + took_ms
            self.at(at_ms, lambda: hear("/objects_local", answer, here_ns(at_ms), "/detector"))
        elif (name, topic) == ("car1", "/objects"):
            message.encoded()
            stamp_ms = (message.header.stamp_ns - STAMPS_BEGIN_NS) // MS
            row = self.now_ms, stamp_ms, len(message.objects or ()), self.now_ms - stamp_ms
            self.answers.append(row)

    def sent(self, name: str, peer: str, topic: str, message: RosMessage) -> None:
        """Over a link; lost if that goes before it has come."""
        at_ms = self.now_ms + WAY_MS
        edge = peer if name == "car1" else name
        if edge == peer:
            stamp_ms = (message.header.stamp_ns - STAMPS_BEGIN_NS) // MS
            self.to_edge[edge].append(stamp_ms)
        to, sender = (
            (self._edges[edge], Peer("car1", "car"))
            if edge == peer
            else (self._car, Peer(edge, "edge"))
        )

        def arrive() -> None:
            if edge in self.up:
                to.from_link(sender, topic, message, here_ns(at_ms))

        self.at(at_ms, arrive)

    def _observe(self, record: Observation, now_ns: int) -> None:
        if isinstance(record, LookEvent):
            stamp_ms = (record.header.stamp_ns - STAMPS_BEGIN_NS) // MS
            self.events.append(
                ((now_ns - HERE_BEGIN_NS) // MS, record.way, record.outcome, stamp_ms)
            )


class Links:
    """The links of one Genie in a drive."""

    def __init__(self, drive: Drive, name: str) -> None:
        self._drive, self._name = drive, name

    def peers(self) -> list[Peer]:
        if self._name == "car1":
            return [Peer(name, "edge") for name in self._drive.up]
        return [Peer("car1", "car")] if self._name in self._drive.up else []

    def send(self, peer: str, topic: str, message: RosMessage) -> None:
        self._drive.sent(self._name, peer, topic, message)


def immediate(drive: Drive) -> dict[int, int]:
    """How many objects the answer at once had, by the frame's stamp [ms]."""
    return {stamp_ms: count for _, stamp_ms, count, age_ms in drive.answers if age_ms == 0}


def test_every_frame_is_answered_at_once_and_looked_at_by_the_edge():
    drive = Drive("edge1")
    drive.run(2000)
    frames = list(range(0, 2000, 100))
    assert sorted(immediate(drive)) == frames
    assert set(immediate(drive).values()) == {0, 1} and immediate(drive)[1000] == 1
    assert drive.to_edge["edge1"] == frames
    assert drive.outcomes("edge", "answered", 0, 3000) == frames
    assert drive.outcomes("own", "answered", 0, 3000), "the car's detector looks, too"


def test_an_edge_dies_and_comes_back():
    """From 2 to 5 s. What was on its way is given up; the car goes on with its own detector."""
    drive = Drive("edge1")
    drive.at(2010, lambda: drive.up.remove("edge1"))
    drive.at(5010, lambda: drive.connect("edge1"))
    drive.run(9000)
    assert sorted(immediate(drive)) == list(range(0, 9000, 100))
    assert drive.outcomes("edge", "timed_out", 2010, 5010)[0] == 2000
    assert not drive.outcomes("edge", "answered", 2100, 5010)
    assert len(drive.outcomes("own", "answered", 2400, 5010)) >= 8
    assert immediate(drive)[4500] == 1, "the map sees by the car's own detector"
    back = drive.outcomes("edge", "answered", 5010, 9500)
    assert back[0] <= 6000 and back[-10:] == list(range(8000, 9000, 100))


def test_an_outage_is_longer_than_any_backoff():
    """Half a minute. Frames that go nowhere get rarer, but one is tried every 5 s at least."""
    drive = Drive("edge1", in_flight=1)
    drive.at(1010, lambda: drive.up.remove("edge1"))
    drive.at(31_010, lambda: drive.connect("edge1"))
    drive.run(40_000)
    tried = drive.outcomes("edge", "sent", 1100, 31_010)
    gaps = [later - earlier for earlier, later in pairwise(tried)]
    assert gaps == sorted(gaps), "each timeout is no shorter than the one before"
    assert 8 * 105 <= gaps[-1] <= 5100, "eight times one and a half round trips"
    assert len(drive.outcomes("edge", "timed_out", 1010, 31_100)) >= len(tried) - 1
    back = drive.outcomes("edge", "answered", 31_010, 40_500)
    assert back[0] <= 31_010 + 5100 and back[-20:] == list(range(38_000, 40_000, 100))
    assert sorted(immediate(drive)) == list(range(0, 40_000, 100))


def test_after_a_hand_over_frames_go_to_the_new_edge_alone():
    """Both edges are connected for a second: every frame goes up but once."""
    drive = Drive("edge1", "edge2")
    drive.up.remove("edge2")
    drive.at(2010, lambda: drive.connect("edge2"))
    drive.at(3010, lambda: drive.up.remove("edge1"))
    drive.run(6000)
    first, second = drive.to_edge["edge1"], drive.to_edge["edge2"]
    assert first == list(range(0, 3100, 100))
    assert min(second) > 3000 and second[-20:] == list(range(4000, 6000, 100))
    assert drive.outcomes("edge", "timed_out", 3010, 4000) == [3000], "on its way at the change"
    assert drive.outcomes("edge", "answered", 4000, 6500)[-10:] == list(range(5000, 6000, 100))


def test_a_car_without_cameras_says_and_does_nothing():
    drive = Drive("edge1")
    drive.run(3000, cameras=False)
    assert drive.events == [] and drive.answers == [] and drive.to_edge == {"edge1": []}


def test_without_a_pose_the_robot_gets_what_its_detector_says():
    """Nothing goes up, and nothing is answered out of the map."""
    drive = Drive("edge1")
    drive.run(1000, posed=False)
    assert drive.to_edge == {"edge1": []}
    assert [(stamp_ms, count, age_ms) for _, stamp_ms, count, age_ms in drive.answers] == [
        (stamp_ms, 1, OWN_MS) for stamp_ms in range(0, 1000, 100)
    ]


def test_the_clock_of_stamps_is_that_of_the_soonest_frame():
    """Delays of 30, 10 and 50 ms; then the clock is set back by an hour."""
    clock = StampClock()
    assert clock.now_ns(7) == 7
    for stamp_ms, now_ms in ((1_000_000, 30), (1_000_100, 110), (1_000_200, 250)):
        clock.received(stamp_ms * MS, now_ms * MS)
    assert clock.now_ns(300 * MS) == 1_000_290 * MS
    clock.received(1_000_000 * MS - 3600 * S, 400 * MS)
    assert clock.now_ns(410 * MS) == 1_000_010 * MS - 3600 * S


@pytest.mark.parametrize(
    ("settings", "pose_topic", "message"),
    [
        ("recommended", None, "genie: recommended: needs to know where the camera is"),
        (
            {"method": "recommended", "sharing": {"gate": "2 m"}},
            "/pose",
            "genie: sharing: ROS messages cannot carry tracks; write null",
        ),
        ({"method": "recommended", "similarity": "dhash"}, "/pose", "genie.similarity: unknown"),
        ({"method": "oracle"}, "/pose", "genie: method: unknown method 'oracle'"),
    ],
)
def test_what_real_ros_cannot_do_is_refused(
    settings: dict[str, object] | str, pose_topic: str | None, message: str
):
    with pytest.raises(UserError, match=message):
        checked_settings(settings, pose_topic)


def test_looks_need_one_input_and_answers_with_objects():
    two = replace(plan("car1", "car"), requests=("/left", "/right"))
    with pytest.raises(UserError, match=r"/detector has 2 inputs \(/left, /right\); choose one"):
        check(two)
    quiet = {"publish": lambda *_: None, "observe": lambda *_: None}
    with pytest.raises(UserError, match="genie: recommended: /objects carries no objects"):
        make_gateway(plan("car1", "car"), **quiet, links=Links(Drive(), "car1"), object_codec=None)
