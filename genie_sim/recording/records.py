"""What a run writes down: one row per frame, per look-up, per sample of a resource, per pose and per map change; per
answer how right it was, and where the truth is known, per instant what a consumer held.

Rows are measurements (instants, counts, names); latencies and ratios are computed from them later, in ``metrics``. A
value that is not known stays ``None``.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from operator import attrgetter
from pathlib import Path

from genie_sim.messages import Image
from genie_sim.recording.tables import Column, Schema, Table, Value

METHOD = Column("method", "text", "", "the method that was simulated, by its name in the scenario")
CAMERA = (
    METHOD,
    Column("car", "text", "", "the car whose camera took the frame"),
    Column("stream", "text", "", "camera stream of that car (frame_id)"),
)
STAMP = Column("stamp_ns", "int64", "ns", "when the camera took it")
FRAMES = Schema(
    "frames",
    "One row per method, car, stream and frame.",
    (
        *CAMERA,
        Column("frame", "int32", "", "running number in the stream, over all laps"),
        Column("lap", "int32", "", "how often the car had driven its route before"),
        Column("stamp_ns", "int64", "ns", "when the camera took and published it"),
        Column(
            "received_ns",
            "int64",
            "ns",
            "when it reached the queue of the first node; null: never",
            True,
        ),
        Column(
            "first_answer_ns",
            "int64",
            "ns",
            "when the consumer got the first answer; null: none",
            True,
        ),
        Column(
            "fresh_answer_ns",
            "int64",
            "ns",
            "when it got a detection or cached answer of this frame",
            True,
        ),
        Column("source", "text", "", "what produced the first answer"),
        Column("served_by", "text", "", "the node that gave the first answer", True),
        Column("image_hit", "bool", "", "found in the message cache of the first Genie", True),
        Column(
            "coalesced", "bool", "", "waited at the first Genie for an equal frame's answer", True
        ),
        Column("objects_fresh", "int32", "objects", "in the fresh answer", True),
        Column("objects_served", "int32", "objects", "in the first answer", True),
        Column("bytes_up", "int64", "B", "sent from the car to its edge for this frame"),
        Column("bytes_down", "int64", "B", "sent from the edge to the car for this frame"),
        Column(
            "drop",
            "text",
            "",
            "queue or link that dropped it before any fresh answer; CAR:no_edge: no link",
            True,
        ),
    ),
    sorted_by=("method", "car", "stream", "frame"),
)
LOOKUPS = Schema(
    "lookups",
    "One row per message for which a Genie asked its message cache or its object map; in order of time.",
    (
        METHOD,
        Column("t_ns", "int64", "ns", "simulated time"),
        Column("genie", "text", "", "the Genie that looked up"),
        Column("placement", "text", "", "where this Genie runs: car or edge"),
        Column(
            "kind",
            "text",
            "",
            "image (message cache), sighting or boost (object map, Algorithm 2 line 4 or 10)",
        ),
        Column(
            "requester",
            "text",
            "",
            "client (its own network) or neighbour (another edge); null: object map",
            True,
        ),
        Column("car", "text", "", "car of the frame"),
        Column("stream", "text", "", "stream of the frame"),
        Column("stamp_ns", "int64", "ns", "stamp of the frame"),
        Column("outcome", "text", "", "hit, miss or coalesced; null: object map", True),
        Column("requests", "int32", "look-ups", "asked for this message"),
        Column(
            "hits", "int32", "look-ups", "answered by a stored entry, or by an object with C >= C_T"
        ),
        Column("updates", "int32", "objects", "stored objects whose confidence changed"),
        Column("boost_sum", "float64", "", "sum of C_new - C_old over these updates"),
        Column("entries", "int32", "entries", "in the message cache or the object map afterwards"),
    ),
)
RESOURCES = Schema(
    "resources",
    "One row per resource and sample; counts since the start of the run. Method by method, in order of time.",
    (
        METHOD,
        Column("t_ns", "int64", "ns", "simulated time of the sample"),
        Column(
            "resource",
            "text",
            "",
            "for example edge1.accelerator, car1->edge1, car1/genie:/image_raw",
        ),
        Column("kind", "text", "", "accelerator, cpu, link or queue"),
        Column(
            "capacity",
            "int32",
            "",
            "how many can be served at once; null: nothing is served here (queue)",
            True,
        ),
        Column("busy_ns", "int64", "ns", "time spent serving, summed over the servers"),
        Column("queue", "int32", "messages", "waiting now"),
        Column("completed", "int64", "messages", "served so far"),
        Column("dropped", "int64", "messages", "lost or pushed out so far"),
        Column("bytes", "int64", "B", "carried so far; null: not a link", True),
    ),
)
POSES = Schema(
    "poses",
    "One row per car, stream and frame: where the camera stood. Written under the first method that the car drives "
    "with, in order of time; the same under every other.",
    (
        *CAMERA,
        Column("frame", "int32", "", "running number in the stream, over all laps"),
        STAMP,
        Column(
            "east_m", "float64", "m", "camera centre, in the scenario's one east-north-up frame"
        ),
        Column("north_m", "float64", "m", "camera centre"),
        Column("heading_rad", "float64", "rad", "optical axis, counter-clockwise from east"),
        Column(
            "horizontal_fov_rad",
            "float64",
            "rad",
            "what the camera sees from its left to its right border",
        ),
    ),
)
OBJECTS = Schema(
    "objects",
    "One row per change of an object map (Algorithm 2, lines 3 to 7), in order of time: a new object, a new "
    "confidence, or none any more, when the map forgets the object. `label`, `east_m` and `north_m` are those of "
    "the first sighting, so they tell which object it is.",
    (
        METHOD,
        Column("t_ns", "int64", "ns", "simulated time"),
        Column("genie", "text", "", "the Genie whose map it is"),
        Column("label", "text", "", "class of the object"),
        Column(
            "east_m",
            "float64",
            "m",
            "where it was first seen, in the scenario's one east-north-up frame",
        ),
        Column("north_m", "float64", "m", "where it was first seen"),
        Column("confidence", "float64", "", "from now on; null: the object is forgotten", True),
    ),
)
ANSWERS = Schema(
    "answers",
    "One row per first and per fresh answer, in order of time: its objects, compared with those that the method's "
    "detector finds in that very frame. A proxy: the detector errs too. Objects without a place in the world are not "
    "counted, nor answers that come 6 s after the frame or later.",
    (
        *CAMERA,
        STAMP,
        Column("which", "text", "", "first or fresh; an answer that is both has two rows"),
        Column("source", "text", "", "what produced the answer"),
        Column("served", "int32", "objects", "in the answer"),
        Column("detected", "int32", "objects", "found by the detector in this frame"),
        Column(
            "matched",
            "int32",
            "objects",
            "pairs of the two: one class, at most 2 m apart, nearest first",
        ),
    ),
)
HELD = Schema(
    "held",
    "Where the truth is known, one row per car and frame of its first camera, in order of time: what its consumer "
    "holds when the frame is taken, compared with what is really in view then. An object held is right if one of its "
    "class is within reach of it, each counted once, nearest first. The detector's own answer to the frame without any "
    "delay, the floor, is judged in the same way; it is written under the first method that the car drives with, and "
    "the same under every other.",
    (
        METHOD,
        Column("what", "text", "", "consumer or floor"),
        Column("car", "text", "", "the car that is judged"),
        Column("stamp_ns", "int64", "ns", "the instant"),
        Column(
            "held",
            "int32",
            "objects",
            "in the field of view; without those of classes that are not known",
        ),
        Column("right", "int32", "objects", "of those held: a visible object is there"),
        Column(
            "moved_away",
            "int32",
            "objects",
            "of those held: not there, but visible there in the 10 s before",
        ),
        Column("never_there", "int32", "objects", "of those held: not there, nor before"),
        Column("duplicate", "int32", "objects", "of those held: what is there is held once more"),
        Column("hidden", "int32", "objects", "there, but not visible; counted in no other column"),
        Column("visible_static", "int32", "objects", "visible and not moving"),
        Column("found_static", "int32", "objects", "of those: held"),
        Column("visible_moving", "int32", "objects", "visible and moving"),
        Column("found_moving", "int32", "objects", "of those: held"),
        Column("gospa_m", "float64", "m", "GOSPA, p = 2, c = 5 m, alpha = 2"),
        Column(
            "age_s",
            "float64",
            "s",
            "mean over those held: time since it was seen; a lower bound",
            True,
        ),
        Column(
            "error_m", "float64", "m", "mean over those right: distance from what is there", True
        ),
    ),
)
HELD_OBJECTS = Schema(
    "held_objects",
    "Where the truth is known, one row per object that a car's consumer holds in its field of view, or misses there, "
    "and per time for which it does so at one place; judged at the same instants and in the same way as `held`, whose "
    "counts are the rows open at an instant (`begin_ns` <= `stamp_ns` < `end_ns`). In the order of their ends.",
    (
        METHOD,
        Column("car", "text", "", "the car that is judged"),
        Column("label", "text", "", "class of the object"),
        Column(
            "east_m",
            "float64",
            "m",
            "where it is held, or missed, in the scenario's one east-north-up frame",
        ),
        Column("north_m", "float64", "m", "where it is held, or missed"),
        Column(
            "judged",
            "text",
            "",
            "right; moved_away, never_there or duplicate: a ghost; missed: visible, but not held",
        ),
        Column("begin_ns", "int64", "ns", "the first instant of which this holds"),
        Column(
            "end_ns",
            "int64",
            "ns",
            "the first instant after it of which it does not; null: until the last",
            True,
        ),
    ),
)
STEPS = Schema(
    "steps",
    "One row per step on the way of a first or fresh answer, from when the frame was received until the consumer had "
    "it; in order of time, answer by answer. A step begins when the one before it ends, so they add up to the "
    "response time.",
    (
        *CAMERA,
        STAMP,
        Column("which", "text", "", "first or fresh answer, or both in one"),
        Column(
            "part", "text", "",
            "queueing (for a thread, a processor or a link), hop (between processes), genie (work of a cache or "
            "router), inference, encoding (and decoding), uplink, downlink, edges (their network), or pending (until "
            "the answer to an equal frame, or a deadline)",
        ),
        Column("place", "text", "", "the node, processor or link; of a hop, the host"),
        Column("begin_ns", "int64", "ns", "simulated time"),
        Column("end_ns", "int64", "ns", "simulated time"),
    ),
)  # fmt: skip
SCHEMAS = (FRAMES, LOOKUPS, RESOURCES, POSES, OBJECTS, ANSWERS, HELD, HELD_OBJECTS, STEPS)

_frame_row = attrgetter(*(column.name for column in FRAMES.columns))


@dataclass(slots=True)
class Frame:
    """One row of ``frames``, as long as something may still become known of it."""

    method: str
    car: str
    stream: str
    frame: int
    lap: int
    stamp_ns: int
    received_ns: int | None = None
    first_answer_ns: int | None = None
    fresh_answer_ns: int | None = None
    source: str = "none"
    served_by: str | None = None
    image_hit: bool | None = None
    coalesced: bool | None = None
    objects_fresh: int | None = None
    objects_served: int | None = None
    bytes_up: int = 0
    bytes_down: int = 0
    drop: str | None = None
    image: Image | None = None  # no column: what the detector itself finds, until the fresh answer

    def row(self) -> tuple[Value, ...]:
        """Its values, in the order of the columns."""
        values: tuple[Value, ...] = _frame_row(self)
        return values


class Tables:
    """What a run writes down. ``held`` and ``held_objects`` stay empty where nobody knows the truth.

    With a ``folder``, the rows of long tables wait there and not in memory.
    """

    frames: Table
    lookups: Table
    resources: Table
    poses: Table
    objects: Table
    answers: Table
    held: Table
    held_objects: Table
    steps: Table

    def __init__(self, folder: Path | None = None) -> None:
        for one in SCHEMAS:
            spill = None if folder is None or one.sorted_by else folder / f"{one.name}.rows"
            setattr(self, one.name, Table(one, spill))

    def __iter__(self) -> Iterator[Table]:
        return (getattr(self, one.name) for one in SCHEMAS)
