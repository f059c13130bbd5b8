"""What happens in a run, written down as facts."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import takewhile
from typing import TYPE_CHECKING, Protocol

from genie_sim.messages import Detections, Fact, Forgotten, Header, Image, ImageLookup, Message, ObjectLookups
from genie_sim.recording.records import Frame, FrameTable, LookupTable, ObjectTable, PoseTable, ResourceTable

if TYPE_CHECKING:
    from genie_sim.sim.nodes import Genie


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


SETTLED_NS = 6_000_000_000  # a frame this old has nearly always seen its last answer


class Log:
    """The rows of one method's run. A frame's row is found by its header and completed as the frame moves on. Then it
    goes into the table, which is compact; in the rare case that more becomes known, it is taken out again.

    ``poses`` and ``objects`` are what a replay needs besides. ``None`` leaves them, or ``lookups``, out.
    """

    def __init__(
        self,
        method: str,
        frames: FrameTable,
        lookups: LookupTable | None,
        resources: ResourceTable,
        poses: PoseTable | None = None,
        objects: ObjectTable | None = None,
    ) -> None:
        self.method = method
        self._poses = poses
        self._objects = objects
        self._frames = frames
        self._lookups = lookups
        self._resources = resources
        self.wants_changes = objects is not None  # of object maps
        self._open: dict[Header, Frame] = {}  # in order of their stamps
        self.published_frames = 0

    def published(self, image: Image, number: int, lap: int) -> None:
        header = image.header
        stamp_ns, stream, car = header
        self._open[header] = Frame(self.method, car, stream, number, lap, stamp_ns)
        self.published_frames += 1
        if self._poses is not None:
            at, fov_rad = image.pose, image.horizontal_fov_rad
            self._poses.add(car, stream, number, stamp_ns, at.east_m, at.north_m, at.heading_rad, fov_rad)

    def close(self, before_ns: int | None = None) -> None:
        """Frames taken before this go into the table; ``None``: all do."""
        settled: Iterable[Header] = self._open
        if before_ns is not None:
            settled = takewhile(lambda header: header.stamp_ns < before_ns, self._open)
        for header in list(settled):
            self._frames.add(self._open.pop(header))

    def _frame(self, header: Header) -> Frame | None:
        frame = self._open.get(header)
        if frame is None:
            frame = self._frames.take(self.method, header.origin, header.frame_id, header.stamp_ns)
            if frame is not None:
                self._open[header] = frame
        return frame

    def received(self, header: Header, now_ns: int) -> None:
        """The frame is in the queue of the first node that handles it."""
        frame = self._frame(header)
        assert frame is not None, "every frame is published first"
        frame.received_ns = now_ns

    def carried(self, column: str, message: Message) -> None:
        """A message about a frame was on the wire of the car's link; ``column`` is ``bytes_up`` or ``bytes_down``."""
        frame = self._frame(message.header)
        if frame is not None:
            setattr(frame, column, getattr(frame, column) + message.size_bytes)

    def answered(self, answer: Detections, source: str, now_ns: int) -> None:
        """An answer is in the consumer's hands. One under a stale stamp is no answer to this frame."""
        frame = self._frame(answer.header)
        if frame is None:
            return
        if frame.first_answer_ns is None:
            frame.first_answer_ns = now_ns
            frame.source = source
            frame.served_by = answer.served_by
            frame.objects_served = len(answer.objects)
        if answer.source != "map" and frame.fresh_answer_ns is None:
            frame.drop = None
            frame.fresh_answer_ns = now_ns
            frame.objects_detected = len(answer.objects)

    def dropped(self, message: Message, where: str) -> None:
        """A copy of a frame, or an answer to it, was lost. It counts as long as the frame has no fresh answer."""
        frame = self._frame(message.header)
        if frame is not None and frame.fresh_answer_ns is None:
            frame.drop = where

    def observe(self, genie: Genie, record: Fact, role: str, now_ns: int) -> None:
        """A fact about a Genie's cache or map. ``role``: ``local`` on a car, ``remote`` on an edge."""
        if isinstance(record, Forgotten):
            if self._objects is not None:
                for label, location, _ in record.objects:
                    self._objects.add(now_ns, genie.name, label, location[0], location[1], None)
            return
        header = record.header
        stamp_ns, stream, car = header
        if isinstance(record, ObjectLookups):
            _, kind, requests, hits, updates, boost_sum, objects, changes = record
            if self._lookups is not None:
                counts = (requests, hits, updates, boost_sum, objects)
                self._lookups.add(now_ns, genie.name, role, kind, None, car, stream, stamp_ns, None, *counts)
            if self._objects is not None:
                for label, location, confidence in changes:
                    self._objects.add(now_ns, genie.name, label, location[0], location[1], confidence)
        elif isinstance(record, ImageLookup):
            _, outcome, asker, entries = record
            hit = outcome == "hit"
            if self._lookups is not None:
                counts = (1, int(hit), 0, 0.0, entries)
                self._lookups.add(now_ns, genie.name, role, "image", asker, car, stream, stamp_ns, outcome, *counts)
            if role == "local" and asker == "client":
                frame = self._frame(header)
                assert frame is not None, "every frame is published first"
                frame.image_hit = hit
                frame.coalesced = outcome == "coalesced"
        elif role == "local":
            lost = self._frame(header)
            if lost is not None and lost.drop is None and lost.fresh_answer_ns is None:
                lost.drop = f"{genie.name}:expired"

    def sample(self, resources: Sequence[Resource], now_ns: int) -> None:
        """The state of every device, link and queue at this instant."""
        self.close(now_ns - SETTLED_NS)
        add, method = self._resources.add, self.method
        for one in resources:
            used = one.capacity, one.busy_ns, one.queued, one.completed
            add(method, now_ns, one.name, one.kind, *used, one.drops, one.sent_bytes)
