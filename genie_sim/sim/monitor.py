"""The observer interface of a simulation run."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, NamedTuple, Protocol

from genie_sim.core.messages import Detections, Header, Image, Message, Observation

if TYPE_CHECKING:
    from genie_sim.sim.clock import Occupancy

Placement = Literal["car", "edge"]
Samples = Literal["all", "edges", "none"]  # of a run's resources
Part = Literal[
    "queueing",  # for a thread, a processor or a link
    "hop",  # between processes of a host
    "genie",  # the work of a cache or a router
    "inference",
    "encoding",  # and decoding
    "uplink",
    "downlink",
    "edges",  # the network between edges
    "pending",  # until the answer to an equal frame, or a deadline
]


class SpanLabel(NamedTuple):
    """What takes time on the path of a frame, and the node, link or host at which it does."""

    part: Part
    place: str


@dataclass(slots=True)
class Span:
    """A period on the path of a frame. It ends at ``end_ns`` and begins where the span before it
    ends; the first one, without a ``label``, is the instant at which the frame is taken.
    """

    label: SpanLabel | None
    end_ns: int
    before: "Span | None"
    header: Header

    def since(self, begin_ns: int) -> list[tuple[SpanLabel, int, int]]:
        """Label, begin and end of each span from an instant on, in their order, up to this one.
        Spans of one label that follow one another are one.
        """
        spans: list[tuple[SpanLabel, int, int]] = []
        last: Span | None = self
        while last is not None and last.before is not None and last.end_ns > begin_ns:
            label, first = last.label, last.before
            while first.before is not None and first.label == label and first.end_ns > begin_ns:
                first = first.before
            assert label is not None, "a span with another before it"
            spans.append((label, max(first.end_ns, begin_ns), last.end_ns))
            last = first
        return spans[::-1]


@dataclass(slots=True)
class LookEvent(Observation):
    """What became of a frame as a look: a detector's pass over it.

    ``way`` is ``own`` (the car's detector), ``edge``, or ``map``: the frame was answered out of a
    map of tracks, and ``looked_ns`` is the stamp of the newest frame of its view that a detector
    has looked at by then, ``None`` before the first. ``outcome`` is ``sent``, ``answered``,
    ``stale`` (answered too late to count), ``overtaken`` (a later frame was answered first, so this
    one is given up), ``timed_out`` (given up, too) or ``late`` (answered after it was given up).
    ``gap_ns``, of one that is sent: the time since the frame of its view that went up before.
    """

    header: Header
    way: str
    outcome: str
    gap_ns: int | None = None
    looked_ns: int | None = None


class FaultSpan(NamedTuple):
    """A fault from its beginning to its end; ``end_ns`` is ``None`` for good."""

    fault: str
    target: str
    begin_ns: int
    end_ns: int | None


class Resource(Protocol):
    """Anything whose use is sampled: accelerators, CPUs, links, and the queues of nodes. A class
    that inherits from this one drops nothing, works on nothing itself and is no link, unless it
    says so.
    """

    name: str
    kind: str
    completed: int
    drops: int = 0

    @property
    def capacity(self) -> int | None:
        """How many it works on at a time; ``None`` for what only queues."""
        return None

    @property
    def busy_ns(self) -> int:
        """How long it has worked until now, summed over all that it works on at a time."""
        return 0

    @property
    def queued(self) -> int: ...

    @property
    def occupancy(self) -> "Occupancy": ...

    @property
    def sent_bytes(self) -> int | None:
        """``None`` for what is no link."""
        return None


class HostUsage(NamedTuple):
    """What a host has used from the end of the warm-up until the end of a run.

    Parameters
    ----------
    host : str
        The car's or edge's name.
    placement : {"car", "edge"}
        Which of the two it is.
    device : str
        Its device profile.
    interface : str or None
        The kind of a car's network interface; ``None`` if it has none that is known.
    accelerator_ns, cpu_ns : int
        How long the accelerator, and all cores together, have worked [ns].
    pictures, batches : int
        What the accelerator has served, and in how many jobs.
    bytes_up, bytes_down : int
        What a car has sent to its edges, and received.
    transfer_ns, tail_ns : int
        How long its interface sent or received, and stayed awake in between [ns].
    begin_ns : int
        Since when that is: a car from its start, an edge always, neither before the end of the
        warm-up [ns].
    """

    host: str
    placement: Placement
    device: str
    interface: str | None
    accelerator_ns: int
    cpu_ns: int
    pictures: int
    batches: int
    bytes_up: int = 0
    bytes_down: int = 0
    transfer_ns: int = 0
    tail_ns: int = 0
    begin_ns: int = 0


class Monitor(Protocol):
    """Observes the run of one method; ``record.log.Log`` writes it into tables."""

    names_changes: bool  # whether observations are to name the objects of a map that changed
    wants_paths: bool  # whether answers are to come with their paths
    samples: Samples  # which resources are sampled

    def published(self, image: Image, number: int, lap: int) -> None:
        """A camera took a frame: its running number, and how often the car had driven its route
        before.
        """

    def received(self, header: Header, now_ns: int) -> None:
        """A frame is in the queue of the first node that handles it."""

    def carried(self, column: str, message: Message) -> None:
        """A message about a frame has left over the car's link: ``bytes_up`` or
        ``bytes_down``.
        """

    def answered(
        self, answer: Detections, source: str, now_ns: int, path: Span | None = None
    ) -> None:
        """The consumer has received an answer; ``path`` is the last span of its path, if wanted."""

    def dropped(self, message: Message, where: str) -> None:
        """A copy of a frame, or an answer to it, was lost; ``where`` names the queue, link or
        fault.
        """

    def observe(self, placement: Placement, node: str, record: Observation, now_ns: int) -> None:
        """An observation of a cache or map."""

    def sample(self, resources: Sequence[Resource], now_ns: int) -> None:
        """The state of devices, links and queues at this instant."""

    def used(self, usage: Iterable[HostUsage]) -> None:
        """What each host has used until the end of the run."""

    def failed(self, spans: Sequence[FaultSpan]) -> None:
        """The faults that there were, in the order of their beginnings."""

    def close(self) -> None:
        """The run is over."""
