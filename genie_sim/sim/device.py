"""Hosts and what computes on them: accelerators and CPUs with a service-time law."""

from collections import deque
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from genie_sim.monitor import Step
from genie_sim.sim.clock import Clock
from genie_sim.sim.service import Device

Done = Callable[..., None]
Arguments = tuple[Any, ...]


class Processor:
    """``capacity`` equal servers behind one first-come-first-served queue: an accelerator, or the cores of a CPU."""

    drops = 0  # nothing is ever pushed out of this queue
    sent_bytes = None

    def __init__(self, env: Clock, name: str, kind: str, capacity: int = 1) -> None:
        self.env = env
        self.name = name
        self.kind = kind
        self.capacity = capacity
        self.completed = 0
        self._serving = 0
        self._waiting: deque[tuple[Step | None, int, Done, Arguments]] = deque()
        self._busy_ns = 0  # of the jobs that are over, without the beginnings of those in service
        self._generation = 0  # counts how often everything here was voided

    @property
    def queued(self) -> int:
        return len(self._waiting)

    @property
    def busy_ns(self) -> int:
        """Server time used until now, jobs in service included."""
        return self._busy_ns + self._serving * self.env.now

    def run(self, service_ns: int, done: Done, arguments: Arguments = ()) -> None:
        """A job that waits for a free server, keeps it for ``service_ns``, and calls ``done(*arguments)`` then."""
        if self._serving < self.capacity:
            self._serving += 1
            self._busy_ns -= self.env.now
            self.env.after(service_ns, self._finished, self._generation, done, arguments)
        else:
            self._waiting.append((self.env.way, service_ns, done, arguments))

    def void(self) -> None:
        """Forgets every job that waits or is in service: none of them is ever done."""
        self._waiting.clear()
        self._busy_ns = self.busy_ns
        self._serving = 0
        self._generation += 1

    def _finished(self, generation: int, done: Done, arguments: Arguments) -> None:
        if generation != self._generation:
            return
        self.completed += 1
        if self._waiting:
            mine = self.env.way
            way, service_ns, next_done, next_arguments = self._waiting.popleft()
            self.env.waited(way, "queueing", self.name)
            self.env.after(service_ns, self._finished, generation, next_done, next_arguments)
            self.env.way = mine
        else:
            self._serving -= 1
            self._busy_ns += self.env.now
        done(*arguments)


class Host:
    """A car's board or an edge server: one accelerator, the cores of its CPU, and how long a message hop takes."""

    def __init__(
        self,
        env: Clock,
        name: str,
        device: Device,
        accelerator_rng: np.random.Generator,
        cpu_rng: np.random.Generator,
    ) -> None:
        self.env = env
        self.name = name
        self.device = device
        self.accelerator = Processor(env, f"{name}.accelerator", "accelerator")
        self.cpu = Processor(env, f"{name}.cpu", "cpu", device.cores)
        self.hop_ns = cache(
            device.hop.of
        )  # how long a message takes to another process, by its size
        self._detector_times = device.detector_time.draws(accelerator_rng)
        self._message_times = device.message_time.draws(cpu_rng)

    def infer(self, done: Done, arguments: Arguments = ()) -> None:
        """The detector looks at one image."""
        self.accelerator.run(next(self._detector_times), done, arguments)

    def compute_key(self, name: str, done: Done, arguments: Arguments) -> None:
        """A picture's similarity key is made."""
        processor, service_ns = self.device.keys[name]
        (self.cpu if processor == "cpu" else self.accelerator).run(service_ns, done, arguments)

    def serve_message(self, done: Done, arguments: Arguments) -> None:
        """A Genie handles one message."""
        self.cpu.run(next(self._message_times), done, arguments)
