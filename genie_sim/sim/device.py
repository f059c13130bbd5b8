"""Hosts and what computes on them: accelerators and CPUs with a service-time law."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import numpy as np

from genie_sim.sim.clock import Clock
from genie_sim.sim.service import Device

Done = Callable[[], None]


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
        self._waiting: deque[tuple[int, Done]] = deque()
        self._busy_ns = 0  # until ``_since_ns``
        self._since_ns = 0
        self._generation = 0  # counts how often everything here was voided

    @property
    def queued(self) -> int:
        return len(self._waiting)

    @property
    def busy_ns(self) -> int:
        """Server time used until now, jobs in service included."""
        return self._busy_ns + self._serving * (self.env.now - self._since_ns)

    def run(self, service_ns: int, done: Done) -> None:
        """A job that waits for a free server, keeps it for ``service_ns``, and calls ``done`` then."""
        if self._serving < self.capacity:
            self._change(+1)
            self.env.after(service_ns, self._finished, done, self._generation)
        else:
            self._waiting.append((service_ns, done))

    def void(self) -> None:
        """Forgets every job that waits or is in service: none of them is ever done."""
        self._waiting.clear()
        self._change(-self._serving)
        self._generation += 1

    def _finished(self, done: Done, generation: int) -> None:
        if generation != self._generation:
            return
        self.completed += 1
        if self._waiting:
            service_ns, its_done = self._waiting.popleft()
            self.env.after(service_ns, self._finished, its_done, generation)
        else:
            self._change(-1)
        done()

    def _change(self, serving: int) -> None:
        now_ns = self.env.now
        self._busy_ns += self._serving * (now_ns - self._since_ns)
        self._since_ns = now_ns
        self._serving += serving


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
        self.name = name
        self.device = device
        self.accelerator = Processor(env, f"{name}.accelerator", "accelerator")
        self.cpu = Processor(env, f"{name}.cpu", "cpu", device.cores)
        self.hop_ns = device.hop.of
        self._detector_times = device.detector_time.draws(accelerator_rng)
        self._message_times = device.message_time.draws(cpu_rng)

    def infer(self, done: Done) -> None:
        """The detector looks at one image."""
        self.accelerator.run(next(self._detector_times), done)

    def compute_key(self, name: str, done: Done) -> None:
        """A picture's similarity key is made."""
        processor, service_ns = self.device.keys[name]
        (self.cpu if processor == "cpu" else self.accelerator).run(service_ns, done)

    def serve_message(self, done: Done) -> None:
        """A Genie handles one message."""
        self.cpu.run(next(self._message_times), done)
