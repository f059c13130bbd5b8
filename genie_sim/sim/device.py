"""Hosts and what computes on them: accelerators and CPUs with a service-time law."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
import simpy

from genie_sim.experiment.profiles import DeviceProfile, ServiceTime


class Processor:
    """``capacity`` equal servers behind one first-come-first-served queue: an accelerator, or the cores of a CPU."""

    def __init__(self, env: simpy.Environment, name: str, kind: str, capacity: int = 1) -> None:
        self.env = env
        self.name = name
        self.kind = kind
        self.capacity = capacity
        self.completed = 0
        self._busy_ns = 0
        self._started_ns: dict[int, int] = {}
        self._resource = simpy.Resource(env, capacity)

    @property
    def queued(self) -> int:
        return len(self._resource.queue)

    @property
    def busy_ns(self) -> int:
        """Server time used until now, jobs in service included."""
        return self._busy_ns + sum(self.env.now - start_ns for start_ns in self._started_ns.values())

    def run(self, service_ns: int) -> Iterable[simpy.Event]:
        """A process that waits for a free server and keeps it for ``service_ns``."""
        with self._resource.request() as server:
            yield server
            job = id(server)
            self._started_ns[job] = self.env.now
            yield self.env.timeout(service_ns)
            self._busy_ns += self.env.now - self._started_ns.pop(job)
            self.completed += 1


class Host:
    """A car's board or an edge server: one accelerator, the cores of its CPU, and how long a message hop takes."""

    def __init__(
        self,
        env: simpy.Environment,
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

    def infer(self) -> Iterable[simpy.Event]:
        """The detector looks at one image."""
        return self.accelerator.run(next(self._model_times))

    def serve_message(self) -> Iterable[simpy.Event]:
        """A Genie handles one message."""
        return self.cpu.run(next(self._genie_times))


def draws(law: ServiceTime, rng: np.random.Generator) -> Iterator[int]:
    """Endless service times [ns]."""
    while True:
        yield law.sample(rng)
