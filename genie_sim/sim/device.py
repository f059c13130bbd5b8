"""Hosts and their processors: accelerators and CPUs with a service-time law."""

import math
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np

from genie_sim.monitor import Span, SpanLabel
from genie_sim.sim.clock import Clock
from genie_sim.sim.service import Device

Done = Callable[..., None]
Arguments = tuple[Any, ...]


class Job:
    """What a processor works on.

    ``generation`` and ``stalled_ns`` are the processor's when the job began or went on: how often
    all jobs had been voided, and how long it had stood still.
    """

    __slots__ = ("arguments", "done", "generation", "label", "pictures", "stalled_ns")

    def __init__(
        self, label: SpanLabel | None, pictures: int, done: Done, arguments: Arguments
    ) -> None:
        self.label = label
        self.pictures = pictures
        self.done = done
        self.arguments = arguments
        self.generation = 0
        self.stalled_ns = 0


class Processor:
    """``capacity`` equal servers behind one first-come-first-served queue: an accelerator, or the
    cores of a CPU.
    """

    drops = 0  # the queue is unbounded
    sent_bytes = None

    def __init__(self, clock: Clock, name: str, kind: str, capacity: int = 1) -> None:
        self.clock = clock
        self.name = name
        self.kind = kind
        self.capacity = capacity
        self.completed = 0
        self.jobs = 0  # completed; a batch of pictures is one
        self._queueing = SpanLabel("queueing", name)
        self._serving = 0
        self._waiting: deque[tuple[Span | None, int, Job]] = deque()  # and how long they take
        self._busy_ns = 0  # of completed jobs, minus the beginnings of those in service
        self._generation = 0  # counts how often all jobs were voided
        self._stalls = 0  # how many faults keep it from going on
        self._stall_began_ns = 0
        self._stalled_ns = 0  # in all, until the present stall
        self._held: list[tuple[int, Span | None, Job]] = []  # and how long they still take
        self._factors: list[float] = []  # by which faults lengthen its jobs

    @property
    def queued(self) -> int:
        return len(self._waiting)

    @property
    def busy_ns(self) -> int:
        """Server time used until now, jobs in service included."""
        return self._busy_ns + self._serving * self.clock.now

    def run(
        self,
        service_ns: int,
        done: Done,
        arguments: Arguments = (),
        label: SpanLabel | None = None,
        pictures: int = 1,
    ) -> None:
        """Adds a job, which waits for a free server and occupies it.

        Parameters
        ----------
        service_ns : int
            How long the job takes [ns].
        done : callable
            Called with ``arguments`` when the job is done.
        arguments : tuple
            See ``done``.
        label : SpanLabel or None
            What the service time counts as on the path of the frame that is handled now.
        pictures : int
            How many pictures the job is, or messages.
        """
        clock, job = self.clock, Job(label, pictures, done, arguments)
        if self._factors:
            service_ns = round(service_ns * math.prod(self._factors))
        if self._serving < self.capacity and not self._stalls:
            self._serving += 1
            self._busy_ns -= clock.now
            self._begin(job, service_ns)
        else:
            self._waiting.append((clock.path, service_ns, job))

    def void(self) -> None:
        """Drops every job that waits or is in service: none of them is ever done."""
        self._waiting.clear()
        self._held.clear()
        self._busy_ns = self.busy_ns
        self._serving = 0
        self._generation += 1

    def stall(self) -> None:
        """Jobs stand still from now on, until ``go_on``."""
        if not self._stalls:
            self._stall_began_ns = self.clock.now
        self._stalls += 1

    def go_on(self) -> None:
        """Ends a stall: jobs go on where they were."""
        self._stalls -= 1
        if self._stalls:
            return
        clock, own_path = self.clock, self.clock.path
        self._stalled_ns += clock.now - self._stall_began_ns
        held, self._held = self._held, []
        for left_ns, path, job in held:
            clock.path = path
            self._begin(job, left_ns)
        while self._waiting and self._serving < self.capacity:
            self._serving += 1
            self._busy_ns -= clock.now
            self._begin_next()
        clock.path = own_path

    def slow(self, factor: float) -> None:
        """Jobs that come from now on take ``factor`` times as long."""
        self._factors.append(factor)

    def speed_up(self, factor: float) -> None:
        """Ends what ``slow`` has begun."""
        self._factors.remove(factor)

    def _begin_next(self) -> None:
        """A server takes the job that has waited for longest."""
        path, service_ns, job = self._waiting.popleft()
        self.clock.waited(path, self._queueing)
        self._begin(job, service_ns)

    def _begin(self, job: Job, service_ns: int) -> None:
        """A job begins or goes on; it takes so long from now on."""
        job.generation = self._generation
        job.stalled_ns = self._stalled_ns
        self.clock.after(service_ns, self._finished, (job,), job.label)

    def _finished(self, job: Job) -> None:
        if job.generation != self._generation:
            return
        clock = self.clock
        left_ns = self._stalled_ns - job.stalled_ns
        if self._stalls:
            left_ns += clock.now - self._stall_began_ns
            self._held.append((left_ns, clock.path, job))
            return
        if left_ns:  # it stood still meanwhile
            self._begin(job, left_ns)
            return
        self.completed += job.pictures
        self.jobs += 1
        if self._waiting:
            own_path = clock.path
            self._begin_next()
            clock.path = own_path
        else:
            self._serving -= 1
            self._busy_ns += clock.now
        job.done(*job.arguments)


class Host:
    """A car's board or an edge server: one accelerator, the cores of its CPU, and how long a
    message hop takes.

    Parameters
    ----------
    clock : Clock
        The run's clock.
    name : str
        The car's or edge's name.
    device : Device
        The service-time laws.
    accelerator_rng, cpu_rng : Generator
        Draw the times of detections and of a Genie's messages.
    """

    def __init__(
        self,
        clock: Clock,
        name: str,
        device: Device,
        *,
        accelerator_rng: np.random.Generator,
        cpu_rng: np.random.Generator,
    ) -> None:
        self.clock = clock
        self.name = name
        self.device = device
        self.accelerator = Processor(clock, f"{name}.accelerator", "accelerator")
        self.cpu = Processor(clock, f"{name}.cpu", "cpu", device.cores)
        self._hops_ns: dict[int, int] = {}  # by the message's size
        self._detector_times = device.detector_time.draws(accelerator_rng)
        self._message_times = device.message_time.draws(cpu_rng)

    def hop_ns(self, size_bytes: int) -> int:
        """How long a message of this size takes to another process [ns]."""
        hop_ns = self._hops_ns.get(size_bytes)
        if hop_ns is None:
            hop_ns = self._hops_ns[size_bytes] = self.device.hop.of(size_bytes)
        return hop_ns

    def infer(self, done: Done, arguments: Arguments = (), label: SpanLabel | None = None) -> None:
        """Runs the detector on one image."""
        self.accelerator.run(next(self._detector_times), done, arguments, label)

    def batch_ns(self, pictures: int) -> int:
        """Draws how long the detector takes for so many images at once [ns]."""
        return round(next(self._detector_times) * self.device.batch_factor(pictures))

    def mean_batch_ns(self, pictures: int) -> float:
        """The mean of that [ns]."""
        return self.device.detector_time.mean_ns * self.device.batch_factor(pictures)

    def compute_key(
        self, name: str, done: Done, arguments: Arguments = (), label: SpanLabel | None = None
    ) -> None:
        """Computes the similarity key called ``name`` of an image."""
        processor, service_ns = self.device.keys[name]
        server = self.cpu if processor == "cpu" else self.accelerator
        server.run(service_ns, done, arguments, label)

    def serve_message(
        self, done: Done, arguments: Arguments = (), label: SpanLabel | None = None
    ) -> None:
        """Handles one message of a Genie."""
        self.cpu.run(next(self._message_times), done, arguments, label)
