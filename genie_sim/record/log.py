"""What happens in a run, written down row by row."""

from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from itertools import takewhile
from typing import NamedTuple, Protocol

from genie_sim.core.header import Header
from genie_sim.core.messages import (
    Detection,
    Detections,
    Expired,
    Forgotten,
    Image,
    ImageLookup,
    MapChange,
    Message,
    ObjectLookups,
    Observation,
)
from genie_sim.record.open_frame import OpenFrame
from genie_sim.record.records import (
    BOTH,
    COALESCED,
    FIRST,
    FRESH,
    HIT,
    IMAGE,
    RESULT,
    FaultRow,
    HostRow,
    LookRow,
    LookupRow,
    PoseRow,
    Tables,
)
from genie_sim.record.tables import Value
from genie_sim.sim.monitor import (
    FaultSpan,
    HostUsage,
    LookEvent,
    Placement,
    Resource,
    Samples,
    Span,
)

SETTLED_NS = 6_000_000_000  # a frame this old has nearly always seen its last answer

# What an answer is called in the table of steps, by whether it is the first and the fresh one.
_WHICH = {
    (True, True): BOTH,
    (True, False): FIRST,
    (False, True): FRESH,
    (False, False): RESULT,
}
# The rows of the table of answers about one, by whether it is the first one and a result.
_COMPARED = {
    (True, True): (FIRST, RESULT),
    (True, False): (FIRST,),
    (False, True): (RESULT,),
}


class ComparedAnswer(NamedTuple):
    """The objects of an answer to a frame, and those that the detector finds in it."""

    header: Header
    which: Sequence[str]  # answer it is: the ``first``, the ``result``, or both in one
    source: str  # what produced it
    served: Sequence[Detection]
    detected: Sequence[Detection]


class AnswerJudge(Protocol):
    """Compares answers with the detector's (``judge.agreement``)."""

    def add(self, answer: ComparedAnswer) -> None: ...

    def close(self) -> None: ...


class Judge(Protocol):
    """Compares what consumers hold with the truth (``judge.consumers``)."""

    def published(self, image: Image) -> None: ...

    def answered(self, answer: Detections, now_ns: int) -> None: ...

    def close(self) -> None: ...


class Log:
    """Writes the rows of one method's run; a ``monitor.Monitor``.

    A frame's row is *open* while the frame moves on: it is found by the frame's header and
    completed with what becomes known (``OpenFrame``). Some seconds later it *settles*, that is, it
    goes into the table, which is compact. If more becomes known after all, it is taken out again.

    The rows of ``resources``, ``objects`` and ``steps``, of which there are most, are plain values
    in the order of the columns (``records``), and go into their table many at once: naming the
    columns of each takes ten times as long.

    The calls of a ``monitor.Monitor`` come first, in the order in which they happen to a frame;
    then those at the end of a run; then the rows that ``observe`` writes.

    Parameters
    ----------
    method : str
        The name under which rows are written.
    tables : dict of str to Table
        All tables of the run, by name: ``records.new_tables``.
    record : collection of str
        The tables that are written besides those that always are: ``lookups``, ``looks``,
        ``steps``, and what a replay needs, ``poses`` and ``objects``.
    samples : str
        The resources that are sampled: ``all``, those of ``edges``, ``processors``, or ``none``.
    agreement : AnswerJudge, optional
        Compares the answers with the detector's.
    judge : Judge, optional
        Judges what the consumers hold, where the truth is known.
    earlier_cars : collection of str
        Cars that an earlier method had: their poses are written already.
    """

    def __init__(
        self,
        method: str,
        tables: Tables,
        record: Collection[str] = ("lookups",),
        *,
        samples: Samples = "all",
        agreement: AnswerJudge | None = None,
        judge: Judge | None = None,
        earlier_cars: Collection[str] = (),
    ) -> None:
        self.method = method
        self.samples: Samples = samples
        self._agreement = agreement
        self._judge = judge
        self._earlier_cars = frozenset(earlier_cars)
        self._frames = tables["frames"]
        self._resources = tables["resources"]
        self._hosts = tables["hosts"]
        self._faults = tables["faults"]
        self._lookups = tables["lookups"] if "lookups" in record else None
        self._looks = tables["looks"] if "looks" in record else None
        self._poses = tables["poses"] if "poses" in record else None
        self._objects = tables["objects"] if "objects" in record else None
        self._steps = tables["steps"] if "steps" in record else None
        self.names_changes = self._objects is not None  # of object maps
        self.wants_paths = self._steps is not None
        # in order of their stamps, but for those that were taken out of the table again
        self._open: dict[Header, OpenFrame] = {}
        # an object's number in our table, by Genie and number in its map
        self._object_numbers: dict[tuple[str, int], int] = {}
        self._object_counts: Counter[str] = Counter()  # by Genie, forgotten ones included
        self.published_frames = 0

    def published(self, image: Image, number: int, lap: int) -> None:
        """A camera took a frame. See ``monitor.Monitor`` for this and what follows."""
        header = image.header
        frame = OpenFrame(self.method, header, number, lap)
        self._open[header] = frame
        self.published_frames += 1
        if self._judge is not None:
            self._judge.published(image)
        if self._agreement is not None:
            frame.image = image
        if self._poses is not None and header.origin not in self._earlier_cars:
            pose = image.pose
            row = PoseRow(
                method=self.method,
                car=header.origin,
                stream=header.frame_id,
                frame=number,
                stamp_ns=header.stamp_ns,
                east_m=pose.east_m,
                north_m=pose.north_m,
                heading_rad=pose.heading_rad,
                horizontal_fov_rad=image.horizontal_fov_rad,
            )
            self._poses.append(row)

    def received(self, header: Header, now_ns: int) -> None:
        """The frame is in the queue of the first node that handles it."""
        frame = self._frame(header)
        if frame is not None:
            frame.received_ns = now_ns

    def carried(self, column: str, message: Message) -> None:
        """A message about a frame was on the wire of the car's link; ``column`` is ``bytes_up`` or
        ``bytes_down``.
        """
        frame = self._frame(message.header)
        if frame is not None:
            if column == "bytes_up":
                frame.bytes_up += message.size_bytes
            else:
                frame.bytes_down += message.size_bytes

    def dropped(self, message: Message, where: str) -> None:
        """A copy of a frame, or an answer to it, was lost. It counts as long as the frame has no
        result.
        """
        frame = self._frame(message.header)
        if frame is not None and frame.result_answer_ns is None:
            frame.drop = where

    def answered(
        self, answer: Detections, source: str, now_ns: int, path: Span | None = None
    ) -> None:
        """An answer is in the consumer's hands. One under a stale stamp is no answer to this
        frame.
        """
        if self._judge is not None:
            self._judge.answered(answer, now_ns)
        frame = self._frame(answer.header)
        if frame is None:
            return
        is_first = frame.first_answer_ns is None
        is_fresh = answer.is_fresh and frame.fresh_answer_ns is None
        is_result = answer.source != "map" and frame.result_answer_ns is None
        looked_ns = answer.looked_ns
        if looked_ns is not None and (frame.looked_ns is None or frame.looked_ns < looked_ns):
            frame.looked_ns = looked_ns
        if (is_first or is_result) and self._agreement is not None and frame.image is not None:
            noted = ComparedAnswer(
                header=frame.image.header,
                which=_COMPARED[is_first, is_result],
                source=source,
                served=answer.objects,
                detected=frame.image.content.detections,
            )
            self._agreement.add(noted)
        if is_first or is_result or is_fresh:
            self._note_steps(path, frame, is_first, is_fresh)
        if is_first:
            frame.first_answer_ns = now_ns
            frame.first_looked_ns = looked_ns
            frame.source = source
            frame.served_by = answer.served_by
            frame.objects_served = len(answer.objects)
        if is_result:
            frame.drop = frame.image = None  # neither lost, nor compared any more
            frame.result_answer_ns = now_ns
            frame.objects_result = len(answer.objects)
        if is_fresh:
            frame.fresh_answer_ns = now_ns
            frame.objects_fresh = len(answer.objects)

    def observe(self, placement: Placement, node: str, record: Observation, now_ns: int) -> None:
        """Writes what a Genie tells of its cache or map."""
        if isinstance(record, ImageLookup):
            self._note_image_lookup(placement, node, record, now_ns)
        elif isinstance(record, ObjectLookups):
            self._note_object_lookups(placement, node, record, now_ns)
            self._note_changes(node, record.changes, now_ns)
            self._note_changes(node, record.forgotten, now_ns, forgotten=True)
        elif isinstance(record, Forgotten):
            self._note_changes(node, record.objects, now_ns, forgotten=True)
        elif isinstance(record, LookEvent):
            self._note_look(node, record, now_ns)
        elif isinstance(record, Expired):
            self._note_expired(node, record)

    def sample(self, resources: Sequence[Resource], now_ns: int) -> None:
        """Writes the state of every device, link and queue at this instant."""
        old = takewhile(lambda header: header.stamp_ns < now_ns - SETTLED_NS, self._open)
        self._settle(list(old))
        values: list[Value] = []
        for resource in resources:
            values += (
                self.method,
                now_ns,
                resource.name,
                resource.kind,
                resource.capacity,
                resource.busy_ns,
                resource.queued,
                resource.completed,
                resource.drops,
                resource.sent_bytes,
                resource.occupancy.total_ns,
                resource.occupancy.most,
            )
        self._resources.extend(values)

    def used(self, usage: Iterable[HostUsage]) -> None:
        """Writes what each host has used until the end of the run."""
        for host in usage:
            self._hosts.append(HostRow(self.method, **host._asdict()))

    def failed(self, spans: Sequence[FaultSpan]) -> None:
        """Writes the faults that there were."""
        for span in spans:
            self._faults.append(FaultRow(self.method, **span._asdict()))

    def close(self) -> None:
        """The run is over: every frame goes into the table."""
        self._settle(list(self._open))
        if self._judge is not None:
            self._judge.close()
        if self._agreement is not None:
            self._agreement.close()

    def _frame(self, header: Header) -> OpenFrame | None:
        """The row of a frame, taken out of the table if it is there already; ``None`` for what is
        no frame, and for one of the warm-up.
        """
        frame = self._open.get(header)
        if frame is None:
            stamp_ns, stream, car = header
            row = self._frames.take(method=self.method, car=car, stream=stream, stamp_ns=stamp_ns)
            if row is not None:
                self._open[header] = frame = OpenFrame(self.method, header)
                frame.__dict__.update(row)
        return frame

    def _settle(self, headers: Iterable[Header]) -> None:
        """These open frames go into the table."""
        values: list[Value] = []
        for header in headers:
            values += self._open.pop(header).values()
        self._frames.extend(values)

    def _note_steps(
        self, path: Span | None, frame: OpenFrame, is_first: bool, is_fresh: bool
    ) -> None:
        """Writes the steps from when the frame was received until the answer was there."""
        if self._steps is None or path is None or frame.received_ns is None:
            return
        which = _WHICH[is_first, is_fresh]
        values: list[Value] = []
        for (part, place), begin_ns, end_ns in path.since(frame.received_ns):
            values += (
                self.method,
                frame.car,
                frame.stream,
                frame.stamp_ns,
                which,
                part,
                place,
                begin_ns,
                end_ns,
            )
        self._steps.extend(values)

    def _note_image_lookup(
        self, placement: Placement, genie: str, lookup: ImageLookup, now_ns: int
    ) -> None:
        is_hit = lookup.outcome == HIT
        if self._lookups is not None:
            stamp_ns, stream, car = lookup.header
            row = LookupRow(
                method=self.method,
                t_ns=now_ns,
                genie=genie,
                placement=placement,
                kind=IMAGE,
                requester=lookup.requester,
                car=car,
                stream=stream,
                stamp_ns=stamp_ns,
                outcome=lookup.outcome,
                requests=1,
                hits=int(is_hit),
                updates=0,
                boost_sum=0.0,
                entries=lookup.entries,
            )
            self._lookups.append(row)
        if placement == "car" and lookup.requester == "client":
            frame = self._frame(lookup.header)
            if frame is not None:
                frame.image_hit = is_hit
                frame.coalesced = lookup.outcome == COALESCED

    def _note_object_lookups(
        self, placement: Placement, genie: str, lookups: ObjectLookups, now_ns: int
    ) -> None:
        if self._lookups is None:
            return
        stamp_ns, stream, car = lookups.header
        row = LookupRow(
            method=self.method,
            t_ns=now_ns,
            genie=genie,
            placement=placement,
            kind=lookups.kind,
            requester=None,
            car=car,
            stream=stream,
            stamp_ns=stamp_ns,
            outcome=None,
            requests=lookups.requests,
            hits=lookups.hits,
            updates=lookups.updates,
            boost_sum=lookups.boost_sum,
            entries=lookups.objects,
        )
        self._lookups.append(row)

    def _note_changes(
        self, genie: str, changes: Iterable[MapChange], now_ns: int, forgotten: bool = False
    ) -> None:
        """Objects of a Genie's map are new, have another confidence, or are ``forgotten``."""
        if self._objects is None:
            return
        numbers = self._object_numbers
        values: list[Value] = []
        for change in changes:
            # A Genie that lost its state counts its objects from 0 again; the table goes on.
            key = genie, change.number
            number = numbers.get(key)
            if number is None:
                numbers[key] = number = self._object_counts[genie]
                self._object_counts[genie] += 1
            east_m, north_m = change.location[:2]
            values += (
                self.method,
                now_ns,
                genie,
                number,
                change.label,
                east_m,
                north_m,
                None if forgotten else change.confidence,
            )
            if forgotten:
                del numbers[key]
        self._objects.extend(values)

    def _note_look(self, genie: str, event: LookEvent, now_ns: int) -> None:
        if self._looks is not None:
            stamp_ns, stream, car = event.header
            row = LookRow(
                method=self.method,
                t_ns=now_ns,
                genie=genie,
                car=car,
                stream=stream,
                stamp_ns=stamp_ns,
                way=event.way,
                outcome=event.outcome,
                looked_ns=event.looked_ns,
                gap_ns=event.gap_ns,
            )
            self._looks.append(row)

    def _note_expired(self, genie: str, request: Expired) -> None:
        """A client's request was forgotten before anybody answered it."""
        frame = self._frame(request.header)
        if frame is not None and frame.drop is None and frame.result_answer_ns is None:
            frame.drop = f"{genie}:expired"
