"""The station that every engine of the speed benchmark simulates: cameras, one
first-come-first-served queue, servers.

It is what remains of a Genie run without Genies: every camera takes a frame each period, a frame
waits for one of the servers, keeps it for its service time, and its response is logged. Nothing is
random once the phases are drawn, so engines must agree on every response. SimPy is imported late:
other engines' Pythons read this module too.
"""

from __future__ import annotations

import heapq
import time
from collections import deque
from collections.abc import Callable, Generator
from dataclasses import dataclass
from statistics import fmean
from typing import Any

PERIOD_NS = 100_000_000  # KITTI's cameras take ten frames a second
CAMERAS_PER_SERVER = 3
UTILISATION = 0.7

Process = Generator[Any, Any, None]


@dataclass(frozen=True)
class Station:
    """``phases_ns``: when each camera takes its first frame. Together the cameras take ``frames``
    frames.
    """

    phases_ns: tuple[int, ...]
    frames: int
    servers: int
    service_ns: int
    period_ns: int = PERIOD_NS

    @property
    def utilisation(self) -> float:
        """Share of the servers' time that is used while all cameras run."""
        return len(self.phases_ns) * self.service_ns / (self.servers * self.period_ns)

    def frames_of(self, camera: int) -> int:
        """How many frames this camera takes; two cameras differ by one at most."""
        return len(range(camera, self.frames, len(self.phases_ns)))


@dataclass(frozen=True)
class Outcome:
    """What one engine did: frames, processor time [s], events (``None``: unknown), responses [ns]
    in order of departure (empty: not kept).
    """

    frames: int
    cpu_s: float
    events: int | None = None
    responses_ns: tuple[int, ...] = ()

    @property
    def rate(self) -> float:
        """Simulated frames a second of processor time."""
        return self.frames / self.cpu_s

    @property
    def mean_response_ns(self) -> float:
        return fmean(self.responses_ns)


def station_of(frames: int, phases_ns: tuple[int, ...]) -> Station:
    """A station for so many cameras, with one server to three of them, used to 70 %."""
    cameras = len(phases_ns)
    servers = max(cameras // CAMERAS_PER_SERVER, 1)
    return Station(phases_ns, frames, servers, round(UTILISATION * servers * PERIOD_NS / cameras))


def simpy_station(station: Station) -> Outcome:
    """The anchor, as SimPy's tutorial would write it: a process for each camera and each frame, and
    a ``Resource``.
    """
    import simpy

    began_s = time.process_time()
    env = simpy.Environment(initial_time=0)
    servers = simpy.Resource(env, station.servers)
    responses_ns: list[int] = []

    def camera(phase_ns: int, frames: int) -> Process:
        yield env.timeout(phase_ns)
        for _ in range(frames):
            env.process(frame())
            yield env.timeout(station.period_ns)

    def frame() -> Process:
        arrived_ns = env.now
        with servers.request() as server:
            yield server
            yield env.timeout(station.service_ns)
        responses_ns.append(env.now - arrived_ns)

    for number, phase_ns in enumerate(station.phases_ns):
        env.process(camera(phase_ns, station.frames_of(number)))
    env.run()
    cpu_s = time.process_time() - began_s
    return Outcome(len(responses_ns), cpu_s, scheduled_events(env), tuple(responses_ns))


def heapq_station(station: Station) -> Outcome:
    """The ceiling: the same events in a bare loop over a heap, with no simulation library at
    all.
    """
    began_s = time.process_time()
    left = [station.frames_of(camera) for camera in range(len(station.phases_ns))]
    heap = [
        (phase_ns, camera, 0) for camera, phase_ns in enumerate(station.phases_ns) if left[camera]
    ]
    heapq.heapify(heap)
    push, pop = heapq.heappush, heapq.heappop
    waiting: deque[int] = deque()
    free, period_ns, service_ns = station.servers, station.period_ns, station.service_ns
    responses_ns: list[int] = []
    events = 0
    while heap:
        now_ns, camera, arrived_ns = pop(heap)
        events += 1
        if camera >= 0:
            left[camera] -= 1
            if left[camera]:
                push(heap, (now_ns + period_ns, camera, 0))
            if free:
                free -= 1
                push(heap, (now_ns + service_ns, -1, now_ns))
            else:
                waiting.append(now_ns)
        else:
            responses_ns.append(now_ns - arrived_ns)
            if waiting:
                push(heap, (now_ns + service_ns, -1, waiting.popleft()))
            else:
                free += 1
    return Outcome(len(responses_ns), time.process_time() - began_s, events, tuple(responses_ns))


def scheduled_events(env: Any) -> int:
    """How many events a SimPy environment has scheduled so far: it numbers them, to keep ties in
    order.
    """
    return next(env._eid)


ENGINES: dict[str, Callable[[Station], Outcome]] = {"simpy": simpy_station, "heapq": heapq_station}
