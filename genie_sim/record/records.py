"""The tables of a run: one class per table, whose fields are the columns of one row.

A field is annotated with its type, its unit and what it means; ``| None`` marks a column that may
be null, and the class's docstring tells what one row is. ``SCHEMAS`` is the one list of all tables.
Rows are measurements (instants, counts, names); latencies and ratios are computed from them later,
in ``analysis.metrics``. A value that is not known is ``None``. Frames that are taken during the
warm-up of a scenario have no rows, nor has what was over before its end.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, NamedTuple

from genie_sim.record.tables import Int32, Schema, Table

Method = Annotated[str, "", "the method that was simulated, by its name in the scenario"]
Car = Annotated[str, "", "the car whose camera took the frame"]
Stream = Annotated[str, "", "camera stream of that car (frame_id)"]
FrameNumber = Annotated[Int32, "", "running number in the stream, over all laps"]
Stamp = Annotated[int, "ns", "when the camera took it"]
CONSUMER = "consumer"  # what is judged: what a consumer holds, or
ZERO_DELAY = "zero_delay"  # the detector's own answers without any delay; also a component
# The values of text columns: of look-ups, of answers, and of objects that are held or missed.
IMAGE, SIGHTING, BOOST = "image", "sighting", "boost"
MISS, HIT, COALESCED = "miss", "hit", "coalesced"
FIRST, FRESH, BOTH, RESULT = "first", "fresh", "both", "result"
JUDGED = ("right", "missed", "moved_away", "never_there", "duplicate")


class FrameRow(NamedTuple):
    """One row per method, car, stream and frame."""

    method: Method
    car: Car
    stream: Stream
    frame: FrameNumber
    lap: Annotated[Int32, "", "how often the car had driven its route before"]
    stamp_ns: Annotated[int, "ns", "when the camera took and published it"]
    received_ns: Annotated[
        int | None, "ns", "when it reached the queue of the first node; null: never"
    ] = None
    first_answer_ns: Annotated[
        int | None, "ns", "when the consumer got the first answer; null: none"
    ] = None
    fresh_answer_ns: Annotated[
        int | None, "ns", "when it got what a detector saw in this very frame; null: never"
    ] = None
    result_answer_ns: Annotated[
        int | None, "ns", "when it got a fresh, cached or shared answer, not one out of a map alone"
    ] = None
    source: Annotated[str, "", "what produced the first answer"] = "none"
    served_by: Annotated[str | None, "", "the node that gave the first answer"] = None
    image_hit: Annotated[bool | None, "", "found in the message cache of the first Genie"] = None
    coalesced: Annotated[
        bool | None, "", "waited at the first Genie for an equal frame's answer"
    ] = None
    first_looked_ns: Annotated[
        int | None,
        "ns",
        "stamp of the newest frame in which a detector saw any of the first answer",
    ] = None
    looked_ns: Annotated[
        int | None,
        "ns",
        "stamp of the newest frame in which a detector saw any of the answers to this one",
    ] = None
    objects_fresh: Annotated[Int32 | None, "objects", "in the fresh answer"] = None
    objects_result: Annotated[Int32 | None, "objects", "in the result"] = None
    objects_served: Annotated[Int32 | None, "objects", "in the first answer"] = None
    bytes_up: Annotated[int, "B", "sent from the car to its edge for this frame"] = 0
    bytes_down: Annotated[int, "B", "sent from the edge to the car for this frame"] = 0
    drop: Annotated[
        str | None,
        "",
        "queue or link that dropped it before any result; CAR:no_edge: no link",
    ] = None


class LookupRow(NamedTuple):
    """One row per message for which a Genie asked its message cache or its object map; in order
    of time.
    """

    method: Method
    t_ns: Annotated[int, "ns", "simulated time"]
    genie: Annotated[str, "", "the Genie that looked up"]
    placement: Annotated[str, "", "where this Genie runs: car or edge"]
    kind: Annotated[
        str,
        "",
        "image (message cache), sighting or boost (object map, Algorithm 2 line 4 or 10)",
    ]
    requester: Annotated[
        str | None,
        "",
        "client (its own network) or neighbour (another edge); null: object map",
    ]
    car: Annotated[str, "", "car of the frame"]
    stream: Annotated[str, "", "stream of the frame"]
    stamp_ns: Annotated[int, "ns", "stamp of the frame"]
    outcome: Annotated[str | None, "", "hit, miss or coalesced; null: object map"]
    requests: Annotated[Int32, "look-ups", "asked for this message"]
    hits: Annotated[Int32, "look-ups", "answered by a stored entry, or by an object with C >= C_T"]
    updates: Annotated[Int32, "objects", "stored objects whose confidence changed"]
    boost_sum: Annotated[float, "", "sum of C_new - C_old over these updates"]
    entries: Annotated[Int32, "entries", "in the message cache or the object map afterwards"]


class LookRow(NamedTuple):
    """One row per event of a look, in order of time: a frame that went up to be looked at, was
    answered or lost; and one per frame that was answered at once out of the map. Only Genies with
    ``looks`` have any.
    """

    method: Method
    t_ns: Annotated[int, "ns", "when it happened"]
    genie: Annotated[str, "", "the car's Genie"]
    car: Car
    stream: Stream
    stamp_ns: Stamp
    way: Annotated[str, "", "own: the car's detector; edge: the edge's; map: no look"]
    outcome: Annotated[
        str,
        "",
        "sent; answered; stale: answered too late to count; overtaken: given up, because a later"
        " frame was answered first; timed_out: given up; late: answered after it was given up",
    ]
    looked_ns: Annotated[
        int | None,
        "ns",
        "of way map: stamp of the newest frame of this view that a detector had looked at; null:"
        " none yet",
    ]
    gap_ns: Annotated[
        int | None,
        "ns",
        "of outcome sent: time since the stamp of the frame of this view that went up before; null:"
        " the first",
    ]


class ResourceRow(NamedTuple):
    """One row per resource and sample; counts since the start of the run. Method by method, in
    order of time.
    """

    # ``log.Log`` writes the values of rows in this order.

    method: Method
    t_ns: Annotated[int, "ns", "simulated time of the sample"]
    resource: Annotated[
        str,
        "",
        "for example edge1.accelerator, edge1.cell_up, car1->edge1, car1/genie:/image_raw",
    ]
    kind: Annotated[str, "", "accelerator, cpu, link, cell or queue"]
    capacity: Annotated[
        Int32 | None,
        "",
        "how many can be served at once; null: nothing is served here (queue)",
    ]
    busy_ns: Annotated[
        int,
        "ns",
        "time spent serving, summed over the servers",
    ]
    queue: Annotated[
        Int32,
        "messages",
        "waiting now; of a cell, the cars that send now",
    ]
    completed: Annotated[int, "messages", "served so far"]
    dropped: Annotated[int, "messages", "lost or pushed out so far"]
    bytes: Annotated[int | None, "B", "carried so far; null: neither a link nor a cell"]
    queue_ns: Annotated[int, "ns", "time waited so far, summed over the messages"]
    queue_max: Annotated[
        Int32, "messages", "that have waited at a time so far, since the end of the warm-up"
    ]


class PoseRow(NamedTuple):
    """One row per car, stream and frame: where the camera stood. Written under the first method
    that the car drives with, in order of time; the same under every other.
    """

    method: Method
    car: Car
    stream: Stream
    frame: FrameNumber
    stamp_ns: Stamp
    east_m: Annotated[float, "m", "camera centre, in the scenario's one east-north-up frame"]
    north_m: Annotated[float, "m", "camera centre"]
    heading_rad: Annotated[float, "rad", "optical axis, counter-clockwise from east"]
    horizontal_fov_rad: Annotated[
        float, "rad", "what the camera sees from its left to its right border"
    ]


class ObjectRow(NamedTuple):
    """One row per change of an object map (Algorithm 2, lines 3 to 7), in order of time: a new
    object, one that was seen again, or one that the map forgets. The rows of one object have the
    same `genie` and `object`; the map holds it from the first of them until the one without a
    confidence. An object of a map that tracks moves.
    """

    # ``log.Log`` writes the values of rows in this order.

    method: Method
    t_ns: Annotated[int, "ns", "simulated time"]
    genie: Annotated[str, "", "the Genie whose map it is"]
    object: Annotated[Int32, "", "number of the object, its own under this method and Genie"]
    label: Annotated[str, "", "class of the object"]
    east_m: Annotated[
        float, "m", "where the map has it from now on, in the scenario's one east-north-up frame"
    ]
    north_m: Annotated[float, "m", "where the map has it from now on"]
    confidence: Annotated[float | None, "", "from now on; null: the object is forgotten"]


class AnswerRow(NamedTuple):
    """One row per first answer and per result, in order of time: its objects, compared with
    those that the method's detector finds in that very frame. A proxy: the detector errs too.
    Objects without a place in the world are not counted, nor answers that come 6 s after the
    frame or later.
    """

    method: Method
    car: Car
    stream: Stream
    stamp_ns: Stamp
    which: Annotated[str, "", "first or result; an answer that is both has two rows"]
    source: Annotated[str, "", "what produced the answer"]
    served: Annotated[Int32, "objects", "in the answer"]
    detected: Annotated[Int32, "objects", "found by the detector in this frame"]
    matched: Annotated[
        Int32,
        "objects",
        "pairs of the two: one class, at most 2 m apart, nearest first",
    ]


class HeldRow(NamedTuple):
    """Where the truth is known, one row per car and frame of its first camera, or of all that are
    judged, in order of time: what its consumer holds when the frame is taken, compared with what is
    really in view then. An object held is right if one of its class is within reach of it, each
    counted once, nearest first. The detector's own answer to the frame without any delay,
    zero_delay, is judged in the same way; it is written under the first method that the car drives
    with, and the same under every other.
    """

    method: Method
    what: Annotated[str, "", "consumer or zero_delay"]
    car: Annotated[str, "", "the car that is judged"]
    stream: Annotated[str, "", "its camera stream in whose field of view that is"]
    stamp_ns: Annotated[int, "ns", "the instant"]
    held: Annotated[
        Int32,
        "objects",
        "in the field of view; without those of classes that are not known",
    ]
    right: Annotated[Int32, "objects", "of those held: a visible object is there"]
    moved_away: Annotated[
        Int32,
        "objects",
        "of those held: not there, but visible there in the 10 s before",
    ]
    never_there: Annotated[
        Int32, "objects", "of those held: not there, nor visible there in the 10 s before"
    ]
    duplicate: Annotated[Int32, "objects", "of those held: what is there is held once more"]
    hidden: Annotated[Int32, "objects", "there, but not visible; counted in no other column"]
    visible_static: Annotated[Int32, "objects", "visible and not moving"]
    found_static: Annotated[Int32, "objects", "of those: held"]
    visible_moving: Annotated[Int32, "objects", "visible and moving"]
    found_moving: Annotated[Int32, "objects", "of those: held"]
    error_m: Annotated[float | None, "m", "mean over those right: distance from what is there"]


class HeldObjectRow(NamedTuple):
    """Where the truth is known, one row per object that a car's consumer holds in a camera's field
    of view, or misses there, for as long as it does so at one place. Judged at the same instants
    and in the same way as `held`, whose counts are the rows of the camera that are open at an
    instant (`begin_ns` <= `stamp_ns` < `end_ns`); two at one place make one row. What several
    cameras see has a row for each, alike but for the stream. In the order of their ends, then of
    their beginnings; those without an end come last, camera by camera.
    """

    method: Method
    car: Annotated[str, "", "the car that is judged"]
    stream: Annotated[str, "", "its camera stream in whose field of view the object is"]
    label: Annotated[str, "", "class of the object"]
    east_m: Annotated[
        float,
        "m",
        "where it is held, or missed, in the scenario's one east-north-up frame",
    ]
    north_m: Annotated[float, "m", "where it is held, or missed"]
    judged: Annotated[
        str,
        "",
        "right; moved_away, never_there or duplicate: false; missed: visible, but not held",
    ]
    begin_ns: Annotated[int, "ns", "the first instant of which this holds"]
    end_ns: Annotated[
        int | None,
        "ns",
        "the first instant after it of which it does not; null: until the last",
    ]


class StepRow(NamedTuple):
    """One row per step on the way of a first answer, a result or a fresh answer, from when the
    frame was received until the consumer had it; in order of time, answer by answer. A step begins
    when the one before it ends, so they add up to the response time.
    """

    # ``log.Log`` writes the values of rows in this order.

    method: Method
    car: Car
    stream: Stream
    stamp_ns: Stamp
    which: Annotated[str, "", "first or fresh answer, both in one, or result: neither of them"]
    part: Annotated[
        str,
        "",
        "queueing (for a thread, a processor or a link), hop (between processes), genie (work of "
        "a cache or router), inference, encoding (and decoding), uplink, downlink, edges (their "
        "network), or pending (until the answer to an equal frame, or a deadline)",
    ]
    place: Annotated[str, "", "the node, processor or link; of a hop, the host"]
    begin_ns: Annotated[int, "ns", "simulated time"]
    end_ns: Annotated[int, "ns", "simulated time"]


class FaultRow(NamedTuple):
    """One row per method and time that a fault lasted, in the order of their beginnings. The times
    are the same under every method.
    """

    method: Method
    fault: Annotated[str, "", "the kind of fault, by its name in the scenario"]
    target: Annotated[str, "", "what it affected: a car, an edge, a link, or several hosts"]
    begin_ns: Annotated[int, "ns", "simulated time at which it began"]
    end_ns: Annotated[int | None, "ns", "when it ended; null: not before the run did"]


class HostRow(NamedTuple):
    """One row per method and host: what it has used from the end of the warm-up until the end of
    the run. Cars and edges on which the method runs nothing at all have none.
    """

    method: Method
    host: Annotated[str, "", "the car or edge"]
    placement: Annotated[str, "", "car or edge"]
    device: Annotated[str, "", "its device profile"]
    interface: Annotated[
        str | None, "", "network interface of a car; null: none, or of a kind without known power"
    ]
    accelerator_ns: Annotated[int, "ns", "time the accelerator has worked"]
    cpu_ns: Annotated[int, "ns", "time its cores have worked, summed over them"]
    pictures: Annotated[int, "pictures", "served by the accelerator; keys computed there count too"]
    batches: Annotated[int, "batches", "in which it served them"]
    bytes_up: Annotated[int, "B", "sent by a car to its edges; 0 for edges"]
    bytes_down: Annotated[int, "B", "sent to a car by its edges; 0 for edges"]
    transfer_ns: Annotated[int, "ns", "time its interface sent or received; 0 for edges"]
    tail_ns: Annotated[int, "ns", "time its interface stayed awake between transfers"]
    begin_ns: Annotated[
        int,
        "ns",
        "since when that is: a car from its start, an edge always, neither before the end of the "
        "warm-up",
    ]


class PowerRow(NamedTuple):
    """One row per method and part of the power of a device or network interface. The power of what
    has no rows here is not known.
    """

    method: Method
    kind: Annotated[str, "", "device or interface"]
    name: Annotated[str, "", "the device profile or interface"]
    part: Annotated[
        str,
        "",
        "of a device: idle (always), accelerator and core (more, while one works); of an "
        "interface: port (always), transfer and tail (while it does), up and down (by the megabit)",
    ]
    value: Annotated[float, "W", "of up and down in J/Mbit"]
    low: Annotated[float, "W", "lower end of its range"]
    high: Annotated[float, "W", "upper end of its range"]


FRAMES = Schema.of_rows(
    "frames", FrameRow, instant="stamp_ns", sorted_by=("method", "car", "stream", "frame")
)
LOOKUPS = Schema.of_rows("lookups", LookupRow, instant="stamp_ns")
LOOKS = Schema.of_rows("looks", LookRow, instant="stamp_ns")
RESOURCES = Schema.of_rows("resources", ResourceRow, instant="t_ns")
POSES = Schema.of_rows("poses", PoseRow, instant="stamp_ns")
OBJECTS = Schema.of_rows("objects", ObjectRow)  # what was known before still is
ANSWERS = Schema.of_rows("answers", AnswerRow, instant="stamp_ns")
HELD = Schema.of_rows("held", HeldRow, instant="stamp_ns")
HELD_OBJECTS = Schema.of_rows("held_objects", HeldObjectRow, instant="end_ns")
STEPS = Schema.of_rows("steps", StepRow, instant="stamp_ns")
HOSTS = Schema.of_rows("hosts", HostRow)
FAULTS = Schema.of_rows("faults", FaultRow, instant="end_ns")
POWER = Schema.of_rows("power", PowerRow)
SCHEMAS: Mapping[str, Schema] = {
    schema.name: schema
    for schema in (
        FRAMES,
        LOOKUPS,
        LOOKS,
        RESOURCES,
        POSES,
        OBJECTS,
        ANSWERS,
        HELD,
        HELD_OBJECTS,
        STEPS,
        HOSTS,
        FAULTS,
        POWER,
    )
}

Tables = dict[str, Table]  # by name


def new_tables(folder: Path | None = None) -> Tables:
    """Returns an empty table for each schema, by name. ``held`` and ``held_objects`` stay empty
    where nobody knows the truth.

    With a ``folder``, the rows of long tables go to files there as they come and do not stay in
    memory.
    """
    tables = {}
    for name, schema in SCHEMAS.items():
        spill = None
        if folder is not None and not schema.sorted_by:
            spill = folder / f"{name}.rows"
        tables[name] = Table(schema, spill)
    return tables
