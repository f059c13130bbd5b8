"""What happens in a run, written down row by row."""

from collections.abc import Collection, Iterable, Sequence
from itertools import takewhile

from genie_sim.messages import (
    Detections,
    Forgotten,
    Header,
    Image,
    ImageLookup,
    Location,
    Message,
    ObjectLookups,
    Observation,
)
from genie_sim.monitor import Placement, Resource, Samples, Step
from genie_sim.recording.held import Held, agreement
from genie_sim.recording.records import Frame, Tables
from genie_sim.recording.tables import Value

SETTLED_NS = 6_000_000_000  # a frame this old has nearly always seen its last answer


class Log:
    """The rows of one method's run. A frame's row is found by its header and completed as the frame moves on. Then it
    goes into the table, which is compact; in the rare case that more becomes known, it is taken out again.

    ``record`` names what is written besides frames and resources: ``lookups``, ``answers``, ``steps``, and what a
    replay needs, ``poses`` and ``objects``. ``samples`` are the resources that are sampled: ``all``, those of
    ``edges``, ``processors``, or ``none``. ``held`` judges what the consumers hold, where the truth is known. The poses
    of the cars in ``posed`` are known already.
    """

    def __init__(
        self,
        method: str,
        tables: Tables,
        record: Collection[str] = ("lookups",),
        samples: Samples = "all",
        held: Held | None = None,
        posed: Collection[str] = (),
    ) -> None:
        self.method = method
        self.samples: Samples = samples
        self._held = held
        self._posed = frozenset(posed)
        self._frames = tables.frames
        self._resources = tables.resources
        self._lookups = tables.lookups if "lookups" in record else None
        self._poses = tables.poses if "poses" in record else None
        self._objects = tables.objects if "objects" in record else None
        self._answers = tables.answers if "answers" in record else None
        self._steps = tables.steps if "steps" in record else None
        self.wants_changes = self._objects is not None  # of object maps
        self.wants_steps = self._steps is not None
        self._open: dict[Header, Frame] = {}  # in order of their stamps
        self.published_frames = 0

    def published(self, image: Image, number: int, lap: int) -> None:
        header = image.header
        stamp_ns, stream, car = header
        self._open[header] = frame = Frame(self.method, car, stream, number, lap, stamp_ns)
        self.published_frames += 1
        if self._held is not None:
            self._held.published(image)
        if self._answers is not None:
            frame.image = image
        if self._poses is not None and car not in self._posed:
            at = image.pose
            where = at.east_m, at.north_m, at.heading_rad, image.horizontal_fov_rad
            self._poses.append((self.method, car, stream, number, stamp_ns, *where))

    def close(self, before_ns: int | None = None) -> None:
        """Frames taken before this go into the table; ``None``: all do."""
        settled: Iterable[Header] = self._open
        if before_ns is not None:
            settled = takewhile(lambda header: header.stamp_ns < before_ns, self._open)
        for header in list(settled):
            self._frames.append(self._open.pop(header).row())
        if before_ns is None and self._held is not None:
            self._held.close()

    def _frame(self, header: Header) -> Frame | None:
        frame = self._open.get(header)
        if frame is None:
            stamp_ns, stream, car = header
            row = self._frames.take(method=self.method, car=car, stream=stream, stamp_ns=stamp_ns)
            if row is not None:
                frame = self._open[header] = Frame(*row)  # type: ignore[arg-type]  # in the order of the columns
        return frame

    def received(self, header: Header, now_ns: int) -> None:
        """The frame is in the queue of the first node that handles it."""
        frame = self._open.get(header) or self._frame(header)
        assert frame is not None, "every frame is published first"
        frame.received_ns = now_ns

    def carried(self, column: str, message: Message) -> None:
        """A message about a frame was on the wire of the car's link; ``column`` is ``bytes_up`` or ``bytes_down``."""
        frame = self._open.get(message.header) or self._frame(message.header)
        if frame is not None:
            setattr(frame, column, getattr(frame, column) + message.size_bytes)

    def answered(
        self, answer: Detections, source: str, now_ns: int, way: Step | None = None
    ) -> None:
        """An answer is in the consumer's hands. One under a stale stamp is no answer to this frame."""
        if self._held is not None:
            self._held.answered(answer, now_ns)
        frame = self._open.get(answer.header) or self._frame(answer.header)
        if frame is None:
            return
        first, fresh = (
            frame.first_answer_ns is None,
            answer.source != "map" and frame.fresh_answer_ns is None,
        )
        if self._answers is not None and frame.image is not None and (first or fresh):
            counts = agreement(answer, frame.image)
            for which, is_this in (("first", first), ("fresh", fresh)):
                if is_this:
                    self._answers.append(
                        (
                            self.method,
                            frame.car,
                            frame.stream,
                            frame.stamp_ns,
                            which,
                            source,
                            *counts,
                        )
                    )
        if (
            self._steps is not None
            and way is not None
            and frame.received_ns is not None
            and (first or fresh)
        ):
            which = "both" if first and fresh else "first" if first else "fresh"
            for step in reversed(list(way.since(frame.received_ns))):
                self._steps.append(
                    (self.method, frame.car, frame.stream, frame.stamp_ns, which, *step)
                )
        if first:
            frame.first_answer_ns = now_ns
            frame.source = source
            frame.served_by = answer.served_by
            frame.objects_served = len(answer.objects)
        if fresh:
            frame.drop = frame.image = None
            frame.fresh_answer_ns = now_ns
            frame.objects_fresh = len(answer.objects)

    def dropped(self, message: Message, where: str) -> None:
        """A copy of a frame, or an answer to it, was lost. It counts as long as the frame has no fresh answer."""
        frame = self._frame(message.header)
        if frame is not None and frame.fresh_answer_ns is None:
            frame.drop = where

    def observe(self, placement: Placement, genie: str, event: Observation, now_ns: int) -> None:
        """What a Genie tells of its cache or map."""
        if isinstance(event, ImageLookup):
            requester, outcome = event.requester, event.outcome
            hit = outcome == "hit"
            if self._lookups is not None:
                stamp_ns, stream, car = event.header
                self._lookups.append((
                    self.method, now_ns, genie, placement, "image", requester, car, stream, stamp_ns, outcome,
                    1, int(hit), 0, 0.0, event.entries,
                ))  # fmt: skip
            if placement == "car" and requester == "client":
                frame = self._open.get(event.header) or self._frame(event.header)
                assert frame is not None, "every frame is published first"
                frame.image_hit = hit
                frame.coalesced = outcome == "coalesced"
        elif isinstance(event, ObjectLookups):
            if self._lookups is not None:
                stamp_ns, stream, car = event.header
                self._lookups.append((
                    self.method, now_ns, genie, placement, event.kind, None, car, stream, stamp_ns, None,
                    event.requests, event.hits, event.updates, event.boost_sum, event.objects,
                ))  # fmt: skip
            if event.changes:
                self._changed(genie, event.changes, now_ns)
        elif isinstance(event, Forgotten):
            self._changed(
                genie, [(label, location, None) for label, location, _ in event.objects], now_ns
            )
        else:
            lost = self._frame(event.header)
            if lost is not None and lost.drop is None and lost.fresh_answer_ns is None:
                lost.drop = f"{genie}:expired"

    def _changed(
        self, genie: str, changes: Iterable[tuple[str, Location, float | None]], now_ns: int
    ) -> None:
        """Objects of a Genie's map are new, have another confidence, or none any more."""
        if self._objects is not None:
            values: list[Value] = []
            for label, (east_m, north_m, _), confidence in changes:
                values += (self.method, now_ns, genie, label, east_m, north_m, confidence)
            self._objects.append(values)

    def sample(self, resources: Sequence[Resource], now_ns: int) -> None:
        """The state of every device, link and queue at this instant."""
        self.close(now_ns - SETTLED_NS)
        values: list[Value] = []
        for one in resources:
            values += (
                self.method, now_ns, one.name, one.kind, one.capacity, one.busy_ns,
                one.queued, one.completed, one.drops, one.sent_bytes,
            )  # fmt: skip
        self._resources.append(values)
