"""Who is told what happens in a world."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

from genie_sim.messages import Detections, Header, Image, Message, Observation

Placement = Literal["car", "edge"]
Samples = Literal["all", "edges", "processors", "none"]  # of a world's resources


@dataclass(slots=True)
class Step:
    """What took until ``end_ns`` on the way of a frame, at which node, link or host, and the step before it. Parts are
    ``queueing`` (for a thread, a processor or a link), ``hop`` (between processes of a host), ``genie`` (a cache's or a
    router's work), ``inference``, ``encoding`` (and decoding), ``uplink``, ``downlink``, ``edges`` (their network) and
    ``pending`` (until the answer to an equal frame, or a deadline)."""

    part: str
    place: str
    end_ns: int
    before: "Step | None"
    header: Header

    def since(self, begin_ns: int) -> Iterator[tuple[str, str, int, int]]:
        """Part, place, begin and end of each step from an instant on, the last one first. Steps of one part that follow
        one another at one place are one."""
        last: Step | None = self
        while last is not None and last.before is not None and last.end_ns > begin_ns:
            first, here = last.before, (last.part, last.place)
            while (
                first.before is not None
                and (first.part, first.place) == here
                and first.end_ns > begin_ns
            ):
                first = first.before
            yield last.part, last.place, max(first.end_ns, begin_ns), last.end_ns
            last = first


class Resource(Protocol):
    """Anything whose use is sampled: accelerators, CPUs, links, and the queues of nodes."""

    name: str
    kind: str
    completed: int
    drops: int

    @property
    def capacity(self) -> int | None: ...

    @property
    def busy_ns(self) -> int: ...

    @property
    def queued(self) -> int: ...

    @property
    def sent_bytes(self) -> int | None:
        """``None`` for what is not a link."""


class Monitor(Protocol):
    """Notes what happens in the run of one method; ``recording.log.Log`` writes it into tables."""

    wants_changes: bool  # whether it is to be told which objects of a map changed
    wants_steps: bool  # whether it is to be told the way of each answer
    samples: Samples  # which resources are sampled

    def published(self, image: Image, number: int, lap: int) -> None:
        """A camera took a frame: its running number, and how often the car had driven its route before."""

    def received(self, header: Header, now_ns: int) -> None:
        """A frame is in the queue of the first node that handles it."""

    def carried(self, column: str, message: Message) -> None:
        """A message about a frame was on the wire of the car's link: ``bytes_up`` or ``bytes_down``."""

    def answered(
        self, answer: Detections, source: str, now_ns: int, way: Step | None = None
    ) -> None:
        """An answer is in the consumer's hands, with the steps that led to it, if they are wanted."""

    def dropped(self, message: Message, where: str) -> None:
        """A copy of a frame, or an answer to it, was lost; ``where`` names the queue, link or fault."""

    def observe(self, placement: Placement, node: str, record: Observation, now_ns: int) -> None:
        """An observation of a cache or map."""

    def sample(self, resources: Sequence[Resource], now_ns: int) -> None:
        """The state of devices, links and queues at this instant."""

    def close(self) -> None:
        """Nothing more happens."""
