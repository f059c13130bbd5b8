"""A link to the nanosecond: the wire, the cable, what is lost, and what waits."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from genie_sim.core.messages import Detections, Header
from genie_sim.links.presets import LINKS
from genie_sim.links.wire import Wire
from genie_sim.sim.clock import Clock
from genie_sim.sim.link import Link
from genie_sim.sim.link_model import LINK
from tests.sim.processes import DOWN, UP, transmitter

IMAGE_BYTES = 1_397_297  # sensor_msgs/Image, bgr8, 1242 x 375


def wire(name: str = "ethernet_1g", **changes: Any) -> Wire:
    """A shipped link but for some settings."""
    made = LINK.make(LINKS[name])
    assert isinstance(made, Wire)
    return replace(made, **changes)


LAN = wire()


class Sized:
    """Only what a link looks at."""

    def __init__(self, size_bytes: int, number: int = 0, frame_id: str = "camera_02") -> None:
        self.header = Header(number, frame_id, "car1")
        self.size_bytes = size_bytes


class Line:
    """A link, and what happened on it: arrivals as (message's number, when), what was lost, what
    was carried.
    """

    def __init__(
        self, model: Wire, up: bool = True, queue_length: int = 10**9, seed: int = 1
    ) -> None:
        self.clock = Clock()
        self.arrived: list[tuple[int, int]] = []
        self.lost: list[int] = []
        self.carried: list[int] = []
        self.link = Link(
            self.clock,
            "car1->edge1",
            transmitter(model, UP if up else DOWN, clock=self.clock, seed=seed),
            queue_length=queue_length,
            dropped=lambda message, where: self.lost.append(message.header.stamp_ns),
        )

    def send(
        self, at_ns: int, number: int, size_bytes: int = IMAGE_BYTES, channel: str = "images"
    ) -> None:
        message = Sized(size_bytes, number)

        def now() -> None:
            self.link.send(
                channel,
                message,
                lambda: self.arrived.append((number, self.clock.now)),
                carried=lambda one: self.carried.append(one.header.stamp_ns),
            )

        self.clock.timeout(at_ns).callbacks.append(lambda _: now())

    def run(self) -> Line:
        self.clock.run()
        return self


def alone(model: Wire, size_bytes: int, up: bool = True) -> int:
    """How long one message takes from one end to the other."""
    line = Line(model, up)
    line.send(0, 1, size_bytes)
    return line.run().arrived[0][1]


@given(st.integers(1, 10**8))
def test_a_message_takes_its_bits_over_the_rate_and_then_the_delay(size_bytes: int):
    bits = (size_bytes + math.ceil(size_bytes / 1448) * 90) * 8
    assert LAN.link_bits(size_bytes) == bits
    assert alone(LAN, size_bytes) == bits + LAN.delay_ns, "at 1 Gbit/s a bit is a nanosecond"


def test_an_image_takes_11_87_ms_at_1_gbit_per_s():
    assert alone(LAN, IMAGE_BYTES) - LAN.delay_ns == 11_873_176


def test_the_formula_agrees_with_measured_times():
    """Token-bucket filters that count 66 B of headers a segment: 11.77 ms at 1 Gbit/s, 115.7 ms at
    100 Mbit/s.

    Measured over a veth pair; the formula is within 1.1 %.
    """
    for name, measured_ms in (("ethernet_1g", 11.77), ("ethernet_100m", 115.7)):
        shaped = wire(name, overhead_bytes=66, delay_ns=0)
        assert alone(shaped, IMAGE_BYTES) / 1e6 == pytest.approx(measured_ms, rel=0.011)
    fast, slow = wire("ethernet_1g"), wire("ethernet_100m")
    assert alone(slow, IMAGE_BYTES) - slow.delay_ns == 10 * (
        alone(fast, IMAGE_BYTES) - fast.delay_ns
    )


def test_up_and_down_have_their_own_rates():
    asymmetric = wire(rate_up_bps=10**7, rate_down_bps=10**8, delay_ns=0)
    assert (
        alone(asymmetric, IMAGE_BYTES, up=True)
        == 10 * alone(asymmetric, IMAGE_BYTES, up=False)
        == 1_187_317_600
    )


def test_part_of_a_nanosecond_is_a_whole_one():
    """Time is whole nanoseconds, and no message is faster than its wire."""
    odd = wire(rate_up_bps=3 * 10**9, delay_ns=0)
    assert alone(odd, 1) == math.ceil(8 * 91 / 3)
    assert isinstance(alone(odd, 1), int)


def test_the_ideal_link_takes_no_time_for_anything():
    line = Line(wire("ideal"))
    for number in range(5):
        line.send(7, number)
    assert line.run().arrived == [(number, 7) for number in range(5)]
    assert line.link.busy_ns == 0


def test_messages_sent_together_follow_each_other_on_the_wire():
    line = Line(LAN)
    for number in range(4):
        line.send(1000, number)
    line.run()
    assert line.arrived == [
        (n, 1000 + (n + 1) * LAN.link_bits(IMAGE_BYTES) + LAN.delay_ns) for n in range(4)
    ]
    assert line.link.busy_ns == 4 * LAN.link_bits(IMAGE_BYTES), (
        "the delay of the cable keeps no wire busy"
    )


def test_a_small_answer_waits_for_the_image_before_it():
    line = Line(LAN)
    line.send(0, 1)
    line.send(1, 2, size_bytes=426, channel="objects")
    line.run()
    assert line.arrived[1] == (2, LAN.link_bits(IMAGE_BYTES) + LAN.link_bits(426) + LAN.delay_ns)


@given(
    st.lists(st.tuples(st.integers(0, 50_000_000), st.integers(1, 10**6)), min_size=2, max_size=20)
)
def test_jitter_keeps_the_order_and_its_bounds(messages: list[tuple[int, int]]):
    jitter_ns = 30_000_000
    steady, shaken = Line(LAN), Line(wire(jitter_ns=jitter_ns))
    for number, (at_ns, size_bytes) in enumerate(sorted(messages)):
        for line in (steady, shaken):
            line.send(at_ns, number, size_bytes)
    steady.run()
    shaken.run()
    assert [number for number, _ in shaken.arrived] == [number for number, _ in steady.arrived]
    for (_, with_ns), (_, without_ns) in zip(shaken.arrived, steady.arrived, strict=True):
        assert 0 <= with_ns - without_ns <= jitter_ns
    assert all(earlier[1] <= later[1] for earlier, later in pairwise(shaken.arrived))


@pytest.mark.parametrize(("loss", "arrive"), [(0.0, 50), (1.0, 0)])
def test_a_link_that_loses_nothing_or_everything(loss: float, arrive: int):
    line = Line(wire(loss=loss))
    for number in range(50):
        line.send(number, number)
    line.run()
    assert (len(line.arrived), line.link.completed, line.link.drops) == (
        arrive,
        arrive,
        50 - arrive,
    )


def test_during_an_outage_nothing_gets_through_and_afterwards_everything():
    """The outage is [begin, end): what decides is when a message's last bit leaves."""
    wire_ns = LAN.link_bits(IMAGE_BYTES)
    begin_ns, end_ns = 100_000_000, 200_000_000
    line = Line(LAN)
    line.clock.after(begin_ns, line.link.cut_by.append, ("outage",))
    line.clock.after(end_ns, line.link.cut_by.remove, ("outage",))
    last_bit_ns = (begin_ns - 1, begin_ns, 150_000_000, end_ns - 1 + wire_ns // 2, end_ns + wire_ns)
    for number, leaves_ns in enumerate(last_bit_ns):
        line.send(leaves_ns - wire_ns, number)
    line.run()
    assert line.lost == [1, 2]
    assert [number for number, _ in line.arrived] == [0, 3, 4]


def test_every_channel_keeps_its_newest_waiting_message_and_counts_the_others():
    """As a ROS publisher with queue length 1 does; 0 is on the wire already when the others
    come.
    """
    line = Line(LAN, queue_length=1)
    for number, channel in enumerate(
        ("camera_02", "camera_02", "camera_03", "camera_02", "camera_03", "camera_02")
    ):
        line.send(number, number, channel=channel)
    line.run()
    assert [number for number, _ in line.arrived] == [0, 4, 5]
    assert line.lost == [1, 2, 3] and line.link.drops == 3


def test_of_a_longer_queue_the_oldest_message_goes_first():
    line = Line(LAN, queue_length=2)
    for number in range(5):
        line.send(number, number)
    line.run()
    assert [number for number, _ in line.arrived] == [0, 3, 4]


@given(
    st.lists(st.tuples(st.integers(0, 40_000_000), st.sampled_from("ab")), min_size=1, max_size=30),
    st.integers(1, 3),
)
def test_published_is_arrived_or_dropped_and_at_most_the_queue_waits(
    messages: list[tuple[int, str]], length: int
):
    line = Line(LAN, queue_length=length)
    for number, (at_ns, channel) in enumerate(messages):
        line.send(at_ns, number, channel=channel)
    while line.clock.peek() != float("inf"):
        line.clock.step()
        assert line.link.queued <= 2 * length, "one queue for each of two channels"
    numbers = [number for number, _ in line.arrived]
    assert sorted(numbers + line.lost) == list(range(len(messages)))
    assert (line.link.completed, line.link.drops) == (len(numbers), len(line.lost))


def test_bytes_are_those_on_the_wire_lost_ones_too_but_not_those_dropped_before_it():
    busy = Line(LAN, queue_length=1)
    for number in range(4):
        busy.send(0, number)
    busy.run()
    assert busy.carried == [0, 3] and busy.link.sent_bytes == 2 * IMAGE_BYTES
    lossy = Line(wire(loss=1.0))
    lossy.send(0, 1)
    lossy.run()
    assert (
        lossy.carried == [1] and lossy.link.sent_bytes == IMAGE_BYTES and lossy.link.completed == 0
    )


def test_the_use_of_the_wire_is_known_while_a_message_is_on_it():
    line = Line(LAN)
    line.send(1000, 1)
    line.clock.run(until=1000 + 500)
    assert line.link.busy_ns == 500
    line.run()
    assert line.link.busy_ns == LAN.link_bits(IMAGE_BYTES)


def test_an_answer_of_eight_objects_is_433_times_smaller_than_the_image():
    """26 + 8 x 400 bytes of autoware_msgs/DetectedObjectArray with empty clouds."""
    from genie_sim.core.messages import Detection

    eight = Detections(
        Header(0, "camera_02", "car1"), (Detection("car", 0.9, None, None, 0.9),) * 8
    )
    assert eight.size_bytes == 3226 and IMAGE_BYTES // eight.size_bytes == 433
