"""Hosts and their processors: accelerators and CPUs with a service-time law."""

import math

import simpy

from genie_sim.base.seeds import Draws
from genie_sim.core.header import Header
from genie_sim.core.messages import Message
from genie_sim.sim.clock import Clock, Occupancy, Steps
from genie_sim.sim.device import Device
from genie_sim.sim.draw_keys import frame_key, message_key
from genie_sim.sim.monitor import Resource, SpanLabel


class Processor(Resource):
    """Equal ``units`` behind one first-come-first-served queue: an accelerator, or the
    cores of a CPU. SimPy's own resource can neither stand still nor tell its busy time exactly.

    A process that needs one says ``yield from processor.serve(service_ns)``.
    """

    def __init__(self, clock: Clock, name: str, kind: str, units: int = 1) -> None:
        self.clock = clock
        self.name = name
        self.kind = kind
        self._units = units
        self.completed = 0
        self.jobs = 0  # completed; a batch of pictures is one
        self._queueing = SpanLabel("queueing", name)
        self._service = SpanLabel("inference" if kind == "accelerator" else "genie", name)
        self._free = units
        self._waiting: list[simpy.Event] = []  # for a free unit, in the order of their arrival
        self._occupancy = Occupancy(clock)  # of those that wait
        self._busy_ns = 0  # of completed jobs, minus the beginnings of those in service
        self._stalls = 0  # how many faults keep it from going on
        self._stall_began_ns = 0
        self._stalled_ns = 0  # in all, until the present stall
        self._go_on = clock.event()
        self._factors: list[float] = []  # by which faults lengthen its jobs

    @property
    def capacity(self) -> int:
        return self._units

    @property
    def queued(self) -> int:
        return len(self._waiting)

    @property
    def occupancy(self) -> Occupancy:
        """How many have waited, over time."""
        return self._occupancy

    @property
    def busy_ns(self) -> int:
        """The time of all units used until now, jobs in service included."""
        return self._busy_ns + (self._units - self._free) * self.clock.now

    @property
    def is_stalled(self) -> bool:
        """Whether it stands still."""
        return self._stalls > 0

    def serve(self, service_ns: int, label: SpanLabel | None = None, pictures: int = 1) -> Steps:
        """A job: waits for a free unit and occupies it.

        Parameters
        ----------
        service_ns : int
            How long the job takes [ns].
        label : SpanLabel or None
            What the service time counts as on the path of the message that is handled now;
            ``None``: the work of this processor.
        pictures : int
            How many pictures the job is, or messages.
        """
        clock, label = self.clock, label or self._service
        if self._factors:
            service_ns = round(service_ns * math.prod(self._factors))
        if self._free and not self._stalls:
            self._occupy()
        else:
            yield from self._turn()
        try:
            while service_ns:
                stalled_ns = self._stalled_ns
                yield from clock.wait(clock.timeout(service_ns), label)
                service_ns = self._stalled_ns - stalled_ns  # for so long it stood still meanwhile
                if self._stalls:
                    service_ns += clock.now - self._stall_began_ns
                    yield from clock.wait(self._go_on, label)
            self.completed += pictures
            self.jobs += 1
        finally:  # also where a crash interrupts it
            self._release()

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
        self._stalled_ns += self.clock.now - self._stall_began_ns
        self._go_on.succeed()
        self._go_on = self.clock.event()
        self._begin_next()

    def slow(self, factor: float) -> None:
        """Jobs that come from now on take ``factor`` times as long."""
        self._factors.append(factor)

    def speed_up(self, factor: float) -> None:
        """Ends what ``slow`` has begun."""
        self._factors.remove(factor)

    def _turn(self) -> Steps:
        """Waits for a free unit, which is taken then."""
        turn = self.clock.event()
        self._waiting.append(turn)
        self._occupancy.enter()
        try:
            yield from self.clock.wait(turn, self._queueing)
        except simpy.Interrupt:  # a crash
            if turn in self._waiting:
                self._waiting.remove(turn)
                self._occupancy.leave()
            else:  # the job was just about to begin
                self._release()
            raise

    def _begin_next(self) -> None:
        """Free units take the jobs that have waited for longest."""
        while self._waiting and self._free and not self._stalls:
            self._occupy()
            self._waiting.pop(0).succeed()
            self._occupancy.leave()

    def _occupy(self) -> None:
        self._free -= 1
        self._busy_ns -= self.clock.now

    def _release(self) -> None:
        self._free += 1
        self._busy_ns += self.clock.now
        self._begin_next()


class Host:
    """A car's board or an edge server: one accelerator, the cores of its CPU, and how long a
    message hop takes. A frame's times on it are the same under every method.

    Parameters
    ----------
    clock : Clock
        The run's clock.
    name : str
        The car's or edge's name.
    device : Device
        The service-time laws.
    seed : int
        The root of its random numbers.
    """

    def __init__(self, clock: Clock, name: str, device: Device, *, seed: int) -> None:
        self.clock = clock
        self.name = name
        self.device = device
        self.accelerator = Processor(clock, f"{name}.accelerator", "accelerator")
        self.cpu = Processor(clock, f"{name}.cpu", "cpu", device.cores)
        self._hops_ns: dict[int, int] = {}  # by the message's size
        self._detection_draws = Draws(seed, name, "accelerator")
        self._message_draws = Draws(seed, name, "cpu")

    @property
    def is_stalled(self) -> bool:
        """Whether its processors stand still."""
        return self.accelerator.is_stalled and self.cpu.is_stalled

    def hop_ns(self, size_bytes: int) -> int:
        """How long a message of this size takes to another process [ns]."""
        hop_ns = self._hops_ns.get(size_bytes)
        if hop_ns is None:
            hop_ns = self._hops_ns[size_bytes] = self.device.hop.of(size_bytes)
        return hop_ns

    def infer(self, header: Header, label: SpanLabel) -> Steps:
        """Runs the detector on one image."""
        return self.accelerator.serve(self.detection_ns(header), label)

    def detection_ns(self, header: Header, pictures: int = 1) -> int:
        """How long the detector takes for so many images at once, of which this is the first
        [ns].
        """
        alone_ns = self.device.detector_time.at(self._detection_draws.normal(frame_key(header)))
        return round(alone_ns * self.device.batch_factor(pictures))

    def compute_key(self, name: str, label: SpanLabel) -> Steps:
        """Computes the similarity key called ``name`` of an image."""
        processor, service_ns = self.device.keys[name]
        return (self.cpu if processor == "cpu" else self.accelerator).serve(service_ns, label)

    def serve_message(self, topic: str, message: Message, sender: str, label: SpanLabel) -> Steps:
        """Handles one message of a Genie: on which topic it came, and from which node."""
        z = self._message_draws.normal(message_key(topic, message, sender))
        return self.cpu.serve(self.device.message_time.at(z), label)
