"""Accelerators, CPUs, detectors and links against queueing theory.

Mean waits: M/M/1 and M/D/1 (Pollaczek-Khinchine), M/M/c (Erlang C), M/D/c (Crommelin 1932); losses
of a detector that keeps one waiting image: M/D/1/2. Every test states its replications, seed and
margin, and prints what it found (-s).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from genie_sim.core.messages import CameraPose, Detections, Header, Image
from genie_sim.data.trace import TraceFrame
from genie_sim.links.presets import LINKS
from genie_sim.runs import build
from genie_sim.sim.batching import BatchingDetectorNode
from genie_sim.sim.clock import Clock
from genie_sim.sim.host import Host, Processor
from genie_sim.sim.link import Link
from genie_sim.sim.link_model import LINK
from genie_sim.sim.nodes import DetectorNode
from genie_sim.sim.ros_graph import Graph, Subscriber
from genie_sim.sim.settings import Serving
from tests.make import FOV_RAD, fixed_device
from tests.sim.processes import job, transmitter
from tests.theory.replications import equivalent, replicate

pytestmark = [
    pytest.mark.no_cover,
    pytest.mark.slow,
]  # long runs of what the tests of sim run already

SERVICE_NS = 65_000_000
WARM_UP = 300  # customers before the queue has forgotten that it began empty
POSE = CameraPose(0.0, 0.0, 1.6, 0.0)
Law = Callable[[np.random.Generator], int]


def always(rng: np.random.Generator) -> int:
    return SERVICE_NS


def exponential(rng: np.random.Generator) -> int:
    return max(1, round(rng.exponential(SERVICE_NS)))


def arrivals(env: Clock, rng: np.random.Generator, rho: float, servers: int, customers: int, come):
    """A Poisson process that keeps ``servers`` busy for a share ``rho`` of the time."""
    for number in range(customers):
        yield env.timeout(round(rng.exponential(SERVICE_NS / (rho * servers))))
        come(number)


def pollaczek_khinchine(rho: float, squared_variation: float) -> float:
    """Mean wait of M/G/1 in service times; the squared coefficient of variation is 0 for M/D/1, 1
    for M/M/1.
    """
    return rho * (1 + squared_variation) / (2 * (1 - rho))


def erlang_c(rho: float, servers: int) -> float:
    """Mean wait of M/M/c in service times."""
    offered = rho * servers
    busy = offered**servers / math.factorial(servers) / (1 - rho)
    waits = busy / (sum(offered**k / math.factorial(k) for k in range(servers)) + busy)
    return waits / (servers * (1 - rho))


def crommelin(rho: float, servers: int) -> float:
    """Mean wait of M/D/c in service times: the sum over i of P(N >= i c) - P(N > i c) / rho, N
    Poisson(i c rho).
    """
    from scipy.stats import poisson

    i = np.arange(1, 2000)
    mean = i * servers * rho
    return float(np.sum(poisson.sf(i * servers - 1, mean) - poisson.sf(i * servers, mean) / rho))


def processor_waits(rho: float, service: Law, servers: int = 1, customers: int = 3000):
    """An experiment: the mean wait before a processor with an unbounded queue, in service times."""

    def experiment(rng: np.random.Generator) -> float:
        env = Clock()
        processor = Processor(env, "edge1.accelerator", "accelerator", servers)
        waits: list[int] = []

        def customer() -> None:
            service_ns, came_ns = service(rng), env.now
            job(processor, service_ns, lambda: waits.append(env.now - came_ns - service_ns))

        env.process(arrivals(env, rng, rho, servers, customers, lambda _: customer()))
        env.run()
        assert processor.completed == customers and processor.queued == 0
        return float(np.mean(waits[WARM_UP:])) / SERVICE_NS

    return experiment


@pytest.mark.nightly
def test_accelerator_matches_m_m_1():
    """Mean wait, M/M/1: rho / (1 - rho) service times."""
    waits = replicate(processor_waits(0.5, exponential, customers=6000), replications=40, seed=1)
    assert equivalent(waits, expected=pollaczek_khinchine(0.5, 1.0), margin=0.08)


@pytest.mark.nightly
@pytest.mark.parametrize("rho", [0.3, 0.7])
def test_accelerator_matches_m_d_1(rho: float):
    """Mean wait, M/D/1: rho / (2 (1 - rho)) service times."""
    waits = replicate(processor_waits(rho, always, customers=6000), replications=30, seed=2)
    assert equivalent(waits, expected=pollaczek_khinchine(rho, 0.0), margin=0.07)


def test_cores_of_a_cpu_match_m_m_c():
    """Mean wait, M/M/c: Erlang's C over c (1 - rho), in service times."""
    assert erlang_c(0.6, 1) == pytest.approx(pollaczek_khinchine(0.6, 1.0)), (
        "with one server it is M/M/1"
    )
    waits = replicate(
        processor_waits(0.6, exponential, servers=2, customers=6000), replications=40, seed=3
    )
    assert equivalent(waits, expected=erlang_c(0.6, 2), margin=0.10)


@pytest.mark.nightly
def test_cores_of_a_cpu_match_m_d_c():
    """Genie's CPU: several cores, one queue."""
    assert crommelin(0.7, 1) == pytest.approx(pollaczek_khinchine(0.7, 0.0)), (
        "with one server it is M/D/1"
    )
    waits = replicate(
        processor_waits(0.7, always, servers=4, customers=7000), replications=30, seed=4
    )
    assert equivalent(waits, expected=crommelin(0.7, 4), margin=0.10)


def test_a_wrong_service_law_would_be_noticed():
    """M/D/1 waits half as long as M/M/1, and few replications prove nothing."""
    waits = replicate(processor_waits(0.5, always), replications=30, seed=5)
    assert not equivalent(waits, expected=pollaczek_khinchine(0.5, 1.0), margin=0.05)
    assert not equivalent(waits[:2], expected=float(np.mean(waits[:2])), margin=0.05)


def test_time_in_use_counts_the_job_in_service():
    env = Clock()
    processor = Processor(env, "edge1.accelerator", "accelerator", 2)
    for service_ns in (100, 300, 500):
        job(processor, service_ns)
    env.run(until=50)
    assert (processor.busy_ns, processor.queued, processor.completed) == (100, 1, 0)
    env.run(until=250)
    assert (processor.busy_ns, processor.queued, processor.completed) == (100 + 250 + 150, 0, 1)
    env.run()
    assert (processor.busy_ns, processor.completed) == (900, 3)


def image(number: int, stamp_ns: int) -> Image:
    frame = TraceFrame(
        "02", number, stamp_ns, 1242, 375, 1_397_297, str(number), number, POSE, FOV_RAD, ()
    )
    return Image(
        Header(stamp_ns, "camera_02", "car1"), 1_397_297, str(number), number, POSE, FOV_RAD, frame
    )


def detector_run(rng: np.random.Generator, rho: float, queue_length: int, images: int):
    """Images come to a detector at random: stamps of those answered, of those dropped, and the
    waits [ns].
    """
    env = Clock()
    device = fixed_device("edge1", detector=f"{SERVICE_NS} ns", hop="0 ms", per_megabyte="0 ms")
    host = Host(env, "edge1", build.device(device, "autoware_vision_detector"), seed=1)
    answered: list[int] = []
    waits: list[int] = []
    dropped: list[int] = []

    class Consumer(Subscriber):
        address = "consumer"

        def deliver(self, topic: str, answer: Detections, sender: str) -> None:
            answered.append(answer.header.stamp_ns)
            waits.append(env.now - answer.header.stamp_ns - SERVICE_NS)

    graph = Graph(
        host, queue_length, lambda message, where: dropped.append(message.header.stamp_ns)
    )
    detector = DetectorNode("detector", graph, ("/image_raw",), ("/objects",))
    graph.subscribe("/objects", Consumer())

    def come(number: int) -> None:
        graph.inject("/image_raw", image(number, env.now), "camera")

    env.process(arrivals(env, rng, rho, 1, images, come))
    env.run()
    assert detector.completed == len(answered) and detector.drops == len(dropped)
    assert len(answered) + len(dropped) == images, (
        "published = answered + dropped, nothing is in flight any more"
    )
    return answered, dropped, waits


@pytest.mark.nightly
def test_detector_with_an_unbounded_queue_matches_m_d_1():
    """The whole node, from the topic to the answer."""

    def experiment(rng: np.random.Generator) -> float:
        _, dropped, waits = detector_run(rng, rho=0.6, queue_length=10**9, images=4000)
        assert not dropped
        return float(np.mean(waits[WARM_UP:])) / SERVICE_NS

    waits = replicate(experiment, replications=30, seed=8)
    assert equivalent(waits, expected=pollaczek_khinchine(0.6, 0.0), margin=0.08)


@pytest.mark.parametrize("rho", [pytest.param(0.7, marks=pytest.mark.nightly), 2.6])
def test_detector_that_keeps_the_newest_image_drops_as_m_d_1_2(rho: float):
    """Of M/D/1/2 a share 1 - 1 / (rho + exp(-rho)) is lost, whichever of two waiting images goes.

    2.6: four cameras at 10 Hz before an AGX Xavier.
    """

    def experiment(rng: np.random.Generator) -> float:
        answered, dropped, _ = detector_run(rng, rho, queue_length=1, images=1500)
        return len(dropped) / (len(answered) + len(dropped))

    losses = replicate(experiment, replications=30, seed=9)
    assert equivalent(losses, expected=1 - 1 / (rho + math.exp(-rho)), margin=0.05)


@pytest.mark.nightly
def test_a_link_with_poisson_messages_matches_m_d_1():
    """A wire is a server too: the wait for it, in times a message is on it."""
    rho = 0.6

    def experiment(rng: np.random.Generator) -> float:
        env = Clock()
        wire: Any = LINK.make(LINKS["ethernet_1g"])
        upwards = transmitter(replace(wire, delay_ns=0), clock=env)
        link = Link(env, "car1->edge1", upwards, queue_length=10**9)
        wire_ns = upwards.occupied_ns(1_397_297, 0)
        came_ns: deque[int] = deque()
        waits: list[int] = []

        def publisher():
            for number in range(6000):
                yield env.timeout(round(rng.exponential(wire_ns / rho)))
                came_ns.append(env.now)
                link.send(
                    "images",
                    image(number, env.now),
                    lambda: waits.append(env.now - came_ns.popleft() - wire_ns),
                )

        env.process(publisher())
        env.run()
        assert len(waits) == link.completed == 6000 and link.busy_ns == 6000 * wire_ns
        return float(np.mean(waits[WARM_UP:])) / wire_ns

    waits = replicate(experiment, replications=30, seed=10)
    assert equivalent(waits, expected=pollaczek_khinchine(rho, 0.0), margin=0.07)


def bulk_wait(rate_per_ns: float, batch: int, fixed: float) -> float:
    """Mean wait [ns] of a queue whose server takes all that wait, at most ``batch``, for a time
    that is linear in their number.

    How many wait when a batch ends is a Markov chain (Neuts 1967, the general bulk service rule
    with at least one): from n, the batch takes min(n, batch), or the next that comes where n is 0,
    and Poisson arrivals join meanwhile. Little's law turns the time average of the waiting ones
    into their mean wait.
    """
    from scipy.stats import poisson

    most = 400
    starts = np.maximum(np.arange(most), 1)  # how many wait when the batch begins
    taken = np.minimum(starts, batch)
    times_ns = SERVICE_NS * (fixed + (1 - fixed) * taken)
    chain = np.zeros((most, most))
    for n in range(most):
        left = starts[n] - taken[n]
        chain[n, left:] = poisson.pmf(np.arange(most - left), rate_per_ns * times_ns[n])
    chain /= chain.sum(axis=1, keepdims=True)
    shares = np.linalg.solve(
        (chain - np.eye(most)).T + np.ones((most, most)), np.ones(most)
    )  # the stationary distribution: shares @ chain == shares, with a sum of 1
    waiting = (starts - taken) * times_ns + rate_per_ns * times_ns**2 / 2
    idle_ns = np.where(np.arange(most) == 0, 1 / rate_per_ns, 0.0)
    mean_waiting = float(shares @ waiting) / float(shares @ (times_ns + idle_ns))
    return mean_waiting / rate_per_ns


def batching_detector(**serving: object):
    """A detector with batches and an unbounded queue, on its own clock; and the graph that feeds
    it.
    """
    env = Clock()
    profile = fixed_device("edge1", detector=f"{SERVICE_NS} ns", hop="0 ms", per_megabyte="0 ms")
    device = replace(build.device(profile, "autoware_vision_detector"), batch_fixed=0.573)
    host = Host(env, "edge1", device, seed=0)
    graph = Graph(host, 10**9)
    topics = ("/image_raw",), ("/objects",)
    return BatchingDetectorNode("detector", graph, *topics, serving=Serving(**serving)), graph


@pytest.mark.parametrize(
    ("load", "batch"),
    [
        (1.2, 4),
        *(pytest.param(*one, marks=pytest.mark.nightly) for one in ((0.7, 1), (0.8, 4), (1.5, 8))),
    ],
)
def test_batches_match_the_queue_with_bulk_service(load: float, batch: int):
    """Mean wait in service times of one picture, by numbers of the embedded Markov chain. A load
    above 1 is more than the detector could serve one by one.
    """
    rate_per_ns = load / SERVICE_NS
    if batch == 1:
        expected = pollaczek_khinchine(load, 0.0) * SERVICE_NS
        assert bulk_wait(rate_per_ns, 1, 0.573) == pytest.approx(expected, rel=1e-6)

    def experiment(rng: np.random.Generator) -> float:
        detector, graph = batching_detector(batch=batch)
        env, taken = detector.clock, 0
        integral, last_ns, waiting = 0.0, 0, 0

        def note() -> None:
            nonlocal integral, last_ns, waiting
            integral += waiting * (env.now - last_ns)
            last_ns, waiting = env.now, detector.queued

        class Consumer(Subscriber):
            address = "consumer"

            def deliver(self, topic: str, answer: Detections, sender: str) -> None:
                nonlocal taken
                taken += 1
                note()

        graph.subscribe("/objects", Consumer())

        def come(number: int) -> None:
            note()
            graph.inject("/image_raw", image(number, env.now), "camera")
            env.after(0, note)  # an idle detector has taken it by then

        env.process(arrivals(env, rng, load, 1, 4000, come))
        env.run()
        assert taken == detector.completed == 4000
        return integral / 4000 / SERVICE_NS

    waits = replicate(experiment, replications=16, seed=11)
    expected = bulk_wait(rate_per_ns, batch, 0.573) / SERVICE_NS
    assert equivalent(waits, expected=expected, margin=0.08)


@pytest.mark.parametrize("batch", [1, pytest.param(3, marks=pytest.mark.nightly), 8])
def test_a_saturated_detector_serves_a_full_batch_after_the_other(batch: int):
    """Throughput b / t(b), to 1 %."""
    detector, graph = batching_detector(batch=batch)
    env = detector.clock
    for number in range(3000):
        env.after(
            number * SERVICE_NS // 3, graph.inject, ("/image_raw", image(number, number), "camera")
        )
    until_ns = 1000 * SERVICE_NS
    env.run(until=until_ns)
    rate = detector.completed / (until_ns / SERVICE_NS)
    assert rate == pytest.approx(batch / (0.573 + 0.427 * batch), rel=0.01)
