"""What happens in a run, written down as facts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol

from genie_sim.experiment.records import FrameTable, LookupTable, ObjectTable, PoseTable, ResourceTable
from genie_sim.messages import Detections, Expired, Header, Image, ImageLookup, Message, ObjectLookups

if TYPE_CHECKING:
    from genie_sim.sim.nodes import Genie


class Resource(Protocol):
    """Anything whose use is sampled: accelerators, CPUs, links, and the queues of nodes."""

    name: str
    kind: str
    capacity: int | None
    completed: int

    @property
    def busy_ns(self) -> int: ...

    @property
    def queued(self) -> int: ...


class Log:
    """The rows of one method's run. A frame's row is found by its header and completed as the frame moves on.

    ``poses`` and ``objects`` are what a replay needs besides; ``None`` leaves them out.
    """

    def __init__(
        self,
        method: str,
        frames: FrameTable,
        lookups: LookupTable,
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
        self._rows: dict[Header, int] = {}

    def published(self, image: Image, number: int, lap: int) -> None:
        header = image.header
        self._rows[header] = self._frames.add(self.method, header.origin, header.frame_id, number, lap, header.stamp_ns)
        if self._poses is not None:
            at, fov_rad = image.pose, image.horizontal_fov_rad
            place = (at.east_m, at.north_m, at.heading_rad, fov_rad)
            self._poses.add(header.origin, header.frame_id, number, header.stamp_ns, *place)

    def received(self, header: Header, now_ns: int) -> None:
        """The frame is in the queue of the first node that handles it."""
        self._frames.set(self._rows[header], "received_ns", now_ns)

    def carried(self, column: str, message: Message) -> None:
        """A message about a frame was on the wire of the car's link; ``column`` is ``bytes_up`` or ``bytes_down``."""
        row = self._rows.get(message.header)
        if row is not None:
            self._frames.increase(row, column, message.size_bytes)

    def answered(self, answer: Detections, source: str, now_ns: int) -> None:
        """An answer is in the consumer's hands. One under a stale stamp is no answer to this frame."""
        row = self._rows.get(answer.header)
        if row is None:
            return
        frames = self._frames
        if frames.get(row, "first_answer_ns") is None:
            frames.set(row, "first_answer_ns", now_ns)
            frames.set(row, "source", source)
            frames.set(row, "served_by", answer.served_by)
            frames.set(row, "objects_served", len(answer.objects))
            frames.set(row, "drop", None)
        if answer.source != "map" and frames.get(row, "fresh_answer_ns") is None:
            frames.set(row, "fresh_answer_ns", now_ns)
            frames.set(row, "objects_detected", len(answer.objects))

    def dropped(self, message: Message, where: str) -> None:
        """A copy of a frame, or an answer to it, was lost. It counts as long as the frame has no answer at all."""
        row = self._rows.get(message.header)
        if row is not None and self._frames.get(row, "first_answer_ns") is None:
            self._frames.set(row, "drop", where)

    def observe(self, genie: Genie, record: ImageLookup | ObjectLookups | Expired, role: str, now_ns: int) -> None:
        """One look-up of a Genie's cache or map. ``role``: ``local`` on a car, ``remote`` on an edge."""
        header = record.header
        if isinstance(record, Expired):
            row = self._rows.get(header)
            known = row is not None and role == "local"
            if known and self._frames.get(row, "drop") is None and self._frames.get(row, "first_answer_ns") is None:
                self._frames.set(row, "drop", f"{genie.name}:expired")
            return
        place = (now_ns, genie.name, role)
        frame = (header.origin, header.frame_id, header.stamp_ns)
        if isinstance(record, ImageLookup):
            hit = record.outcome == "hit"
            self._lookups.add(
                *place, "image", record.asker, *frame, record.outcome, 1, int(hit), 0, 0.0, record.entries
            )
            if role == "local" and record.asker == "client":
                self._frames.set(self._rows[header], "image_hit", hit)
                self._frames.set(self._rows[header], "coalesced", record.outcome == "coalesced")
            return
        counts = (record.requests, record.hits, record.updates, record.boost_sum, record.objects)
        self._lookups.add(*place, record.kind, None, *frame, None, *counts)
        if self._objects is not None:
            for label, location, confidence in record.changes:
                self._objects.add(now_ns, genie.name, label, location[0], location[1], confidence)

    def sample(self, resources: Sequence[Resource], now_ns: int) -> None:
        """The state of every device, link and queue at this instant."""
        for one in resources:
            self._resources.add(
                self.method,
                now_ns,
                one.name,
                one.kind,
                one.capacity,
                one.busy_ns,
                one.queued,
                one.completed,
                getattr(one, "drops", 0),
                getattr(one, "sent_bytes", None),
            )
