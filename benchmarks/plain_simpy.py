"""What method ``remote`` simulates, in plain SimPy, as its tutorial would write it: cameras, hops,
queues that keep the newest, links, accelerators.

It is what the speed benchmark compares genie-sim with: both give the very same answers
(tests/benchmarks/test_speed.py). All times are in whole nanoseconds.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import simpy

Process = Generator[simpy.Event, Any, None]
HEADER_BYTES, PAYLOAD_BYTES = 90, 1448  # of a segment


class Frame(NamedTuple):
    """A picture, how long the answer to it is, and how long its edge looks at it [ns]."""

    car: str
    camera: str
    stamp_ns: int
    image_bytes: int
    answer_bytes: int
    detection_ns: int


Answer = tuple[str, str, int, int]  # car, camera, when the picture was taken and answered [ns]
Answered = Callable[[Frame], None]


@dataclass(frozen=True)
class Fleet:
    """What is simulated.

    ``edge_of``: the edge of each car; ``cameras``: what each camera takes; ``car_hop_ns`` and
    ``edge_hop_ns``: how long a message takes to another process, the fixed part and that of a
    megabyte; ``bits_a_s`` and ``flight_ns``: rate and delay of the links.
    """

    edge_of: Mapping[str, str]
    cameras: Sequence[Sequence[Frame]]
    car_hop_ns: tuple[int, int]
    edge_hop_ns: tuple[int, int]
    bits_a_s: int
    flight_ns: int

    @property
    def edges(self) -> list[str]:
        """Every edge that serves a car."""
        return list(dict.fromkeys(self.edge_of.values()))

    @property
    def frames(self) -> int:
        """How many the cameras take."""
        return sum(len(frames) for frames in self.cameras)

    def sending_ns(self, size_bytes: int) -> int:
        """How long a link is busy with a message, headers of its segments included."""
        segments = -(-size_bytes // PAYLOAD_BYTES)
        bits = (size_bytes + segments * HEADER_BYTES) * 8
        return -(-bits * 10**9 // self.bits_a_s)


def hop_ns(law: tuple[int, int], size_bytes: int) -> int:
    """How long a message takes to another process of the same host."""
    return law[0] + law[1] * size_bytes // 10**6


class Newest(simpy.Store):
    """A queue of frames that keeps the newest of each flow."""

    def __init__(self, env: simpy.Environment, flow: Callable[[Frame], Any]) -> None:
        super().__init__(env)
        self.flow = flow

    def add(self, frame: Frame) -> None:
        flow = self.flow(frame)
        self.items = [waiting for waiting in self.items if self.flow(waiting) != flow]
        self.put(frame)


def later(env: simpy.Environment, delay_ns: int, call: Answered, frame: Frame) -> Process:
    """A message on its way."""
    yield env.timeout(delay_ns)
    call(frame)


def camera(env: simpy.Environment, frames: Sequence[Frame], publish: Answered) -> Process:
    for frame in frames:
        yield env.timeout(frame.stamp_ns - env.now)
        publish(frame)


def link(
    env: simpy.Environment, queue: Newest, sending_ns: Callable[[Frame], int], arrive: Answered
) -> Process:
    while True:
        frame = yield queue.get()
        yield env.timeout(sending_ns(frame))
        arrive(frame)


def accelerator(env: simpy.Environment, queue: Newest, publish: Answered) -> Process:
    while True:
        frame = yield queue.get()
        yield env.timeout(frame.detection_ns)
        publish(frame)


def simulate(fleet: Fleet, accelerator: Callable[..., Process] = accelerator) -> list[Answer]:
    """The answers, in the order in which consumers get them."""
    env = simpy.Environment(initial_time=0)
    answers: list[Answer] = []
    up = {car: Newest(env, lambda frame: frame.camera) for car in fleet.edge_of}
    down = {car: Newest(env, lambda frame: frame.camera) for car in fleet.edge_of}
    detecting = {edge: Newest(env, lambda _: None) for edge in fleet.edges}

    def publish_image(frame: Frame) -> None:
        delay_ns = hop_ns(fleet.car_hop_ns, frame.image_bytes)
        env.process(later(env, delay_ns, up[frame.car].add, frame))

    def arrive_at_edge(frame: Frame) -> None:
        queue = detecting[fleet.edge_of[frame.car]]
        env.process(later(env, fleet.flight_ns, queue.add, frame))

    def publish_answer(frame: Frame) -> None:
        delay_ns = hop_ns(fleet.edge_hop_ns, frame.answer_bytes)
        env.process(later(env, delay_ns, down[frame.car].add, frame))

    def arrive_at_car(frame: Frame) -> None:
        env.process(later(env, fleet.flight_ns, consume, frame))

    def consume(frame: Frame) -> None:
        answers.append((frame.car, frame.camera, frame.stamp_ns, env.now))

    for frames in fleet.cameras:
        env.process(camera(env, frames, publish_image))
    for car in fleet.edge_of:
        image_ns = lambda frame: fleet.sending_ns(frame.image_bytes)  # noqa: E731
        answer_ns = lambda frame: fleet.sending_ns(frame.answer_bytes)  # noqa: E731
        env.process(link(env, up[car], image_ns, arrive_at_edge))
        env.process(link(env, down[car], answer_ns, arrive_at_car))
    for queue in detecting.values():
        env.process(accelerator(env, queue, publish_answer))
    env.run()
    return answers
