"""Common random numbers: the same frame has the same times and losses under every method, in any
order of methods and cars.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
import pytest

from genie_sim.base.seeds import Draws
from genie_sim.core.messages import CameraPose, Detections, Header, Image
from genie_sim.faults.gnss import Gnss
from genie_sim.links.burst_loss import BurstLoss, LossProcess
from genie_sim.links.wire import Wire, WireTransmitter
from genie_sim.runs import build
from genie_sim.scenario.profiles import load_profile
from genie_sim.sim.clock import Clock
from genie_sim.sim.host import Host, Processor
from genie_sim.sim.link import Link
from genie_sim.sim.message_random import REMEMBERED, MessageRandom
from genie_sim.sim.method import METHODS
from tests.conformance import small
from tests.sim.processes import transmitter

LINK = {"like": "nr5g", "rate_up": "100 Mbit/s", "loss": 0.1}
S = 1_000_000_000


def scenario(methods: Sequence[Any], cars: Sequence[int] = (1, 2), **settings: Any) -> Any:
    """Two cars at one edge, on links that are late at random and lose messages."""
    own = [small.car(number, edge="edge1", link=LINK) for number in cars]
    return small.scenario(methods, cars=own, edge_network=LINK, **settings)


class Spy:
    """What each frame took on each device and link, under one method."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.took: defaultdict[tuple[Any, ...], list[Any]] = defaultdict(list)
        self._patch = monkeypatch
        self._about: tuple[Any, ...] = ()
        self._wrap(Host, "infer", self._infer)
        self._wrap(Host, "serve_message", self._serve_message)
        self._wrap(Processor, "serve", self._serve)
        self._wrap(Link, "_leave", self._leave)
        self._wrap(WireTransmitter, "delay_ns", self._delay)

    def _wrap(self, owner: type, name: str, spy: Any) -> None:
        real = getattr(owner, name)
        self._patch.setattr(owner, name, lambda *given, **named: spy(real, *given, **named))

    def _infer(self, real: Any, host: Host, header: Header, label: Any) -> Any:
        self._about = (header,)
        return real(host, header, label)

    def _serve_message(
        self, real: Any, host: Host, topic: str, message: Any, sender: str, label: Any
    ) -> Any:
        said = getattr(message, "source", "image")
        self._about = (message.header, topic, said, sender.partition("/")[0])
        return real(host, topic, message, sender, label)

    def _serve(self, real: Any, processor: Any, service_ns: int, *given: Any, **named: Any) -> Any:
        if self._about:  # else it computes a key
            self.took[processor.name, *self._about].append(service_ns)
        self._about = ()
        return real(processor, service_ns, *given, **named)

    def _leave(self, real: Any, link: Any, transfer: Any, message: Any) -> None:
        said = getattr(message, "source", "image")
        self._about = link.name, message.header, said, transfer.host.partition("/")[0]
        real(link, transfer, message)
        self._about = ()

    def _delay(self, real: Any, channel: Any, size_bytes: int, now_ns: int) -> Any:
        delay_ns = real(channel, size_bytes, now_ns)
        self.took[self._about].append(delay_ns)
        return delay_ns


@pytest.mark.slow
def test_a_frame_has_one_time_under_every_method(monkeypatch: pytest.MonkeyPatch):
    """On each detector and CPU, and one delay or loss on each link; under all that is shipped."""
    by_method = {}
    names = [name for name in METHODS if name != "oracle"]  # which needs no time
    assert {"genie", "local", "remote"} <= set(names)
    for name in names:
        with monkeypatch.context() as patch:
            spy = Spy(patch)
            world, _ = small.world(scenario([name]))
            world.run()
            by_method[name] = spy.took
    together: defaultdict[tuple[Any, ...], list[Any]] = defaultdict(list)
    for took in by_method.values():
        for about, values in took.items():
            assert len(values) == 1, about
            together[about].append(values)
    shared = {about: values for about, values in together.items() if len(values) > 1}
    for about, values in shared.items():
        assert all(value == values[0] for value in values), (about, values)
    places = {about[0] for about in shared}
    assert {"car1.accelerator", "edge1.accelerator", "car1->edge1", "edge1->car1"} <= places
    assert {"car1.cpu", "edge1.cpu"} <= places
    for one, other, place in (
        ("local", "genie", "car1.accelerator"),
        ("remote", "genie", "edge1.accelerator"),
        ("remote", "genie", "car1->edge1"),
    ):
        both = [by_method[name] for name in (one, other)]
        common = [about for about in both[0] if about[0] == place and about in both[1]]
        assert len(common) >= 3, (one, other, place)
        assert len({both[0][about][0] for about in common}) > 1, "they are drawn"


def test_the_order_of_methods_and_cars_changes_nothing():
    """To the last bit. Each car begins at a time of its own, so no two messages come at once."""

    def rows(methods: Sequence[str], cars: Sequence[int]) -> dict[str, pd.DataFrame]:
        found = {}
        tables = small.tables(scenario(methods, cars))
        for name in ("frames", "lookups"):
            table = tables[name].astype(str)
            found[name] = table.sort_values(list(table.columns)).reset_index(drop=True)
        return found

    first, second = (
        rows(["local", "remote", "genie"], (1, 2)),
        rows(["genie", "remote", "local"], (2, 1)),
    )
    for name, table in first.items():
        pd.testing.assert_frame_equal(table, second[name])


# Devices


def host(name: str = "edge1", seed: int = 1) -> Host:
    device = build.device(load_profile("agx_xavier"), "autoware_vision_detector", "isolated")
    return Host(Clock(), name, device, seed=seed)


def headers(count: int, car: str = "car1") -> list[Header]:
    return [Header(number * 100_000_007, "camera_02", car) for number in range(count)]


def test_times_of_frames_have_the_law_of_their_device():
    from scipy.stats import kstest, lognorm

    edge, law = host(), host().device.detector_time
    times = np.array([edge.detection_ns(header) for header in headers(20_000)], dtype=float)
    normals = (times / law.median_ns - law.loc) / (1 - law.loc)
    assert kstest(normals, lognorm(law.sigma).cdf).pvalue > 0.01
    assert times.mean() == pytest.approx(law.mean_ns, rel=0.01)


@pytest.mark.slow
def test_times_of_frames_are_independent():
    """Of frames after one another, of cameras and cars, and of devices: |r| below 4 / sqrt(n)."""
    edge, count = host(), 8_000
    times = np.array([edge.detection_ns(header) for header in headers(count)])
    others = [
        times[1:],
        [edge.detection_ns(header) for header in headers(count, "car2")],
        [edge.detection_ns(header._replace(frame_id="camera_03")) for header in headers(count)],
        [host("edge2").detection_ns(header) for header in headers(count)],
        [host(seed=2).detection_ns(header) for header in headers(count)],
    ]
    for other in others:
        found = np.corrcoef(times[: len(other)], np.array(other))[0, 1]
        assert abs(found) < 4 / np.sqrt(count)


def test_a_batch_takes_the_time_of_its_first_picture():
    edge, (one, other) = host(), headers(2)
    assert edge.detection_ns(one, 3) == round(edge.detection_ns(one) * edge.device.batch_factor(3))
    assert edge.detection_ns(one, 3) != edge.detection_ns(other, 3)


# Links


class Air:
    def draws(self, *names: Any) -> Draws:
        return Draws(7, *names)


def message(number: int, source: str = "") -> Any:
    header = Header(number, "camera_02", "car1")
    if source:
        return Detections(header, (), source)
    return Image(header, 100, "", 0, CameraPose(0.0, 0.0, 0.0, 0.0), 1.0)


def numbers(random: MessageRandom, about: Any, to: str = "edge1/detector") -> list[float]:
    random.begin(about, to)
    return [random.random(), *random.random(2), int(random.integers(10**9)), random.random()]


def test_a_message_has_its_numbers_whatever_else_is_sent():
    one, other = (MessageRandom(Air(), "car1->edge1") for _ in range(2))
    for number in range(5):
        numbers(one, message(number))
    assert numbers(one, message(9)) == numbers(other, message(9))
    assert numbers(other, message(3)) != numbers(other, message(4))


def test_what_tells_messages_apart():
    found = [
        numbers(MessageRandom(Air(), "car1->edge1"), message(1)),
        numbers(MessageRandom(Air(), "car2->edge1"), message(1)),
        numbers(MessageRandom(Air(), "car1->edge1"), message(1), "edge2/detector"),
        numbers(MessageRandom(Air(), "car1->edge1"), message(1, "map")),
        numbers(MessageRandom(Air(), "car1->edge1"), message(1, "detector")),
        numbers(MessageRandom(Air(), "car1->edge1"), None),
    ]
    values = [value for of_one in found for value in of_one]
    assert len(set(values)) == len(values)
    node = numbers(MessageRandom(Air(), "car1->edge1"), message(1), "edge1/genie")
    assert node == found[0], "nodes have other names under other methods"


def test_a_message_that_is_sent_again_has_other_numbers():
    """Or one that was lost would always be."""
    one, other = (MessageRandom(Air(), "car1->edge1") for _ in range(2))
    first = numbers(one, message(1))
    for number in range(2, REMEMBERED):
        numbers(one, message(number))
    again, third = numbers(one, message(1)), numbers(one, message(1))
    assert not set(first) & set(again) and not set(again) & set(third)
    assert [numbers(other, message(1)) for _ in range(3)] == [first, again, third]


def test_jitter_and_losses_have_their_shares():
    """The jitter uniform, a share lost, one independent of the other: 4 standard errors."""
    channel, count = transmitter(Wire(None, None, 50, jitter_ns=1000, loss=0.3)), 20_000
    delays_ns = []
    for number in range(count):
        channel.random.begin(message(number), "edge1")
        delays_ns.append(channel.delay_ns(100, number))
    arrived = np.array([delay_ns for delay_ns in delays_ns if delay_ns is not None])
    assert 1 - len(arrived) / count == pytest.approx(0.3, abs=4 * np.sqrt(0.21 / count))
    assert (arrived.min(), arrived.max()) == (50, 1050)
    assert arrived.mean() == pytest.approx(550, abs=4 * 1000 / np.sqrt(12 * len(arrived)))
    lags = np.corrcoef(arrived[1:], arrived[:-1])[0, 1]
    assert abs(lags) < 4 / np.sqrt(len(arrived))


# What unfolds in time


def lost(sent_ns: Sequence[int], size_bytes: int = 5 * 1448) -> list[bool]:
    """Which messages are lost on one link, by when their last bits leave."""
    loss = BurstLoss(mean=0.2, burst=30)
    wire = Wire(10_000_000, None, 0, loss=loss)
    channel = transmitter(wire)
    return [channel.delay_ns(size_bytes, now_ns) is None for now_ns in sent_ns]


def test_bursts_of_losses_come_at_the_same_time_whatever_is_sent():
    often = list(range(10_000_000, 20 * S, 10_000_000))
    rarely = often[::7]
    assert lost(rarely) == lost(often)[::7]
    assert 0.2 < np.mean(lost(often)) < 0.4


@pytest.mark.parametrize(("gap", "size"), [(0, 1), (0, 40), (500, 40), (13, 5)])
def test_pauses_change_no_share_of_losses(gap: int, size: int):
    """Of messages of n segments 1 - (1 - m) (1 - p)^(n - 1) are hit; within 5 %."""
    loss = BurstLoss(mean=0.05, burst=4)
    losses, count = LossProcess(loss, np.random.default_rng(3)), 40_000
    hits = np.mean([losses.pass_steps(number * (size + gap), size) for number in range(count)])
    assert hits == pytest.approx(
        1 - (1 - 0.05) * (1 - loss.begin_probability) ** (size - 1), rel=0.05
    )


def test_two_position_errors_of_a_car_do_not_feel_each_other():
    """However often one is asked: how many messages a car sends depends on the method."""

    def error_after(asked: int) -> Any:
        world, _ = small.world(scenario(["remote"]))
        network: Any = world.network
        first, second = Gnss("car1"), Gnss("car1", noise_m=1.0)
        next(first.strike(network))
        bends = network._bends["car1"]
        next(second.strike(network))
        for number in range(asked):
            world.clock._now = number * S
            bends[0].outward(message(number), "edge1")
        world.clock._now = 30 * S
        return bends[1].outward(message(1), "edge1").pose

    assert error_after(0) == error_after(40)
