"""Hosts and what computes on them: accelerators and CPUs with a service-time law."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator

import numpy as np

from genie_sim.scenario.profiles import DeviceProfile, ServiceTime
from genie_sim.sim.clock import Clock

Done = Callable[[], None]


class Processor:
    """``capacity`` equal servers behind one first-come-first-served queue: an accelerator, or the cores of a CPU."""

    drops = 0  # whoever waits here, waits
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
            self.env.after(service_ns, self._finished, done)
        else:
            self._waiting.append((service_ns, done))

    def _finished(self, done: Done) -> None:
        self.completed += 1
        if self._waiting:
            service_ns, its_done = self._waiting.popleft()
            self.env.after(service_ns, self._finished, its_done)
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
        profile: DeviceProfile,
        model_time: ServiceTime,
        accelerator_rng: np.random.Generator,
        cpu_rng: np.random.Generator,
    ) -> None:
        self.name = name
        self.profile = profile
        self.accelerator = Processor(env, f"{name}.accelerator", "accelerator")
        self.cpu = Processor(env, f"{name}.cpu", "cpu", profile.cores.value)
        self._model_times = draws(model_time, accelerator_rng)
        self._genie_times = draws(profile.genie, cpu_rng)

    def hop_ns(self, size_bytes: int) -> int:
        """How long a message takes from one node to another on this host."""
        return self.profile.hop.duration_ns(size_bytes)

    def infer(self, done: Done) -> None:
        """The detector looks at one image."""
        self.accelerator.run(next(self._model_times), done)

    def serve_message(self, done: Done) -> None:
        """A Genie handles one message."""
        self.cpu.run(next(self._genie_times), done)


def draws(law: ServiceTime, rng: np.random.Generator) -> Iterator[int]:
    """Endless service times [ns]."""
    while True:  # several normal numbers at once are the same ones, and cost little more than one
        for z in rng.standard_normal(16).tolist():
            yield law.at(z)
