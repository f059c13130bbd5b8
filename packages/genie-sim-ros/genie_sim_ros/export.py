"""A finished run as a bag for Foxglove or RViz: ROS 2 messages in one MCAP file, or a ROS 1 bag.

==================================  ==============================================================
topic                               what
==================================  ==============================================================
``/tf``                             every camera of every car (``car1/camera_02``) in the frame
                                    ``map``; from the table ``poses``
``/<genie>/object_map``             each change of a Genie's object map as a box with its
                                    confidence as colour; from ``objects``
``/lookups``                        each look-up for an image as a ball over the camera that took
                                    it; from ``lookups``
``/events``                         the same in words, and what was dropped; from ``lookups`` and
                                    ``frames``
``/<car>/<method>/response``        time to the first answer [ms]; from ``frames``
``/<car>/<method>/false``           red boxes: what the car holds and is not there; from
                                    ``held_objects``
``/<car>/<method>/missed``          yellow balls: what is in its view and it does not hold; from
                                    ``held_objects``
``/<node>/<method>/queue``          messages that wait at a node, when that changes; from
                                    ``resources``
``/<host>/<method>/accelerator``    share of the time since the last value that it worked; from
                                    ``resources``
``/cars``                           a box for each car, which moves with a frame of its camera
==================================  ==============================================================

The simulation begins at second ``START_S`` of ROS time, because ROS takes the time 0 for "unknown".
"""

import math
import re
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from genie_sim.base.classes import SIZES, Size
from genie_sim.base.errors import UserError
from genie_sim.base.paths import OutputKind, atomic_write
from genie_sim.base.units import NS_PER_S
from genie_sim.record import provenance
from genie_sim_ros.codec import ADD, CUBE, MARKERS
from genie_sim_ros.typestore import TF, message, time, typestore

if TYPE_CHECKING:
    import pandas as pd

    from genie_sim.record.results import Run

START_S = 1
FLOAT = "std_msgs/msg/Float64"
LOGS = {1: "rosgraph_msgs/msg/Log", 2: "rcl_interfaces/msg/Log"}
INFO = {1: 2, 2: 20}
WARN = {1: 4, 2: 30}
BALL = 2
DELETE = 2
MAP_FRAME = "map"
# Outcomes differ in lightness as well: dark, middle, light.
COLOURS = {"hit": (0.0, 0.45, 0.2), "miss": (0.85, 0.2, 0.1), "coalesced": (1.0, 0.85, 0.2)}
COLOUR_STOPS = (0.0, 0.5, 1.0)  # confidences of violet, green-blue and yellow
OTHER_SIZE = Size(1.0, 1.0, 1.0)  # of objects whose class has no usual size
CAR_BELOW_CAMERA_M = -0.8  # a KITTI car's camera is mounted 1.65 m above the ground
RECORDING = OutputKind("recording")  # one of others looks the same
LOOKUP_SHOWN_NS = NS_PER_S
RIGHT, MISSED = "right", "missed"  # in the column ``judged``
FALSE_COLOUR, MISSED_COLOUR = (0.85, 0.2, 0.1, 0.6), (1.0, 0.85, 0.2, 0.6)


class BagMessage(NamedTuple):
    """One message of the bag: its simulated time, and the fields that are not empty."""

    t_ns: int
    topic: str
    kind: str
    fields: dict[str, Any]


def mcap(run: "Run", out: Path) -> int:
    """Writes a run to ``out`` as an MCAP file of ROS 2, and returns how many messages it holds.
    Raises UserError.
    """
    return _export(run, out, ros=2)


def bag(run: "Run", out: Path) -> int:
    """As ``mcap``, a bag of ROS 1."""
    return _export(run, out, ros=1)


def _export(run: "Run", out: Path, ros: int) -> int:
    RECORDING.check(out)
    if run.poses.empty:
        raise UserError(
            f"{run.folder or run.name}: holds no poses, so there is nothing to show; 'record' them"
        )
    with provenance.of_this_version(run.folder):
        entries = [
            *_poses(run),
            *_cars(run),
            *_objects(run),
            *_lookups(run, ros),
            *_frames(run, ros),
            *_held_objects(run),
            *_resources(run),
        ]
    entries.sort(key=lambda entry: entry.t_ns)
    with atomic_write(out, RECORDING) as beside:
        out.parent.mkdir(parents=True, exist_ok=True)
        write(beside, ros, entries)
    return len(entries)


def _poses(run: "Run") -> Iterator[BagMessage]:
    for row in _rows(run.poses):
        transform = {
            "header": _header(row.stamp_ns),
            "child_frame_id": f"{row.car}/{row.stream}",
            "transform": {
                "translation": {"x": row.east_m, "y": row.north_m},
                "rotation": _heading(row.heading_rad),
            },
        }
        yield BagMessage(row.stamp_ns, "/tf", TF, {"transforms": [transform]})


def _cars(run: "Run") -> Iterator[BagMessage]:
    first = run.poses.drop_duplicates(["car", "stream"]).drop_duplicates("car")
    for number, row in enumerate(_rows(first)):
        marker = _marker(
            row.stamp_ns,
            frame=f"{row.car}/{row.stream}",
            ns=row.car,
            id=number,
            type=CUBE,
            place=(-1.0, 0.0, CAR_BELOW_CAMERA_M),
            size=SIZES["car"],
            colour=(0.25, 0.4, 0.7, 0.8),
            text=row.car,
        )
        yield BagMessage(row.stamp_ns, "/cars", MARKERS, marker)


def _objects(run: "Run") -> Iterator[BagMessage]:
    numbers: dict[tuple[object, ...], int] = {}
    for row in _rows(run.objects):
        size = SIZES.get(row.label, OTHER_SIZE)
        is_forgotten = math.isnan(row.confidence)
        confidence = 0.0 if is_forgotten else row.confidence
        marker = _marker(
            row.t_ns,
            ns=row.label,
            id=numbers.setdefault((row.method, row.genie, row.object), len(numbers)),
            type=CUBE,
            place=(row.east_m, row.north_m, size.height_m / 2),
            size=size,
            colour=(*confidence_colour(confidence), 0.9),
            text=f"{row.label} {confidence:.2f}",
            action=DELETE if is_forgotten else ADD,
        )
        yield BagMessage(row.t_ns, f"/{_topic(row.genie)}/object_map", MARKERS, marker)


def _lookups(run: "Run", ros: int) -> Iterator[BagMessage]:
    places = {
        (row.car, row.stream, row.stamp_ns): (row.east_m, row.north_m) for row in _rows(run.poses)
    }
    for number, row in enumerate(_rows(run.lookups[run.lookups["kind"] == "image"])):
        stamp = f"{row.stamp_ns / NS_PER_S:.3f} s"
        text = f"{row.outcome} at {row.genie} for {row.car}/{row.stream}, {stamp}"
        yield _event(ros, row.t_ns, level=INFO, name=row.genie, text=text)
        marker = _marker(
            row.t_ns,
            ns=row.genie,
            id=number,
            type=BALL,
            place=(*places[row.car, row.stream, row.stamp_ns], 3.0),
            size=(0.5, 0.5, 0.5),
            colour=(*COLOURS[row.outcome], 1.0),
            text=text,
            lifetime=time(LOOKUP_SHOWN_NS),
        )
        yield BagMessage(row.t_ns, "/lookups", MARKERS, marker)


def _frames(run: "Run", ros: int) -> Iterator[BagMessage]:
    for row in _rows(run.frames):
        if isinstance(row.drop, str) and row.source == "none":
            text = f"{row.method}: {row.car}/{row.stream} frame {row.frame} dropped at {row.drop}"
            yield _event(ros, row.stamp_ns, level=WARN, name=row.car, text=text)
        first, received = row.first_answer_ns, row.received_ns
        if first == first and first is not None and received == received:  # not nan, not null
            topic = f"/{_topic(row.car)}/{row.method}/response"
            response_ms = (int(first) - int(received)) / 1e6
            yield BagMessage(int(first), topic, FLOAT, {"data": response_ms})


def _held_objects(run: "Run") -> Iterator[BagMessage]:
    """A marker for each time that a false object is held, or one in view is not."""
    rows = run.held_objects[run.held_objects["judged"] != RIGHT]
    for number, row in enumerate(_rows(rows)):
        size = SIZES.get(row.label, OTHER_SIZE)
        is_missed = row.judged == MISSED
        begin_ns, end_ns = int(row.begin_ns), row.end_ns
        is_closed = end_ns == end_ns and end_ns is not None  # not nan, not null
        lifetime_ns = int(end_ns) - begin_ns if is_closed else 0  # 0: as long as it is shown
        marker = _marker(
            begin_ns,
            ns=row.judged,
            id=number,
            type=BALL if is_missed else CUBE,
            place=(row.east_m, row.north_m, size.height_m / 2),
            size=size,
            colour=MISSED_COLOUR if is_missed else FALSE_COLOUR,
            text=f"{row.label} {row.judged.replace('_', ' ')}",
            lifetime=time(lifetime_ns),
        )
        what = MISSED if is_missed else "false"
        topic = f"/{_topic(row.car)}/{_topic(row.method)}/{what}"
        yield BagMessage(begin_ns, topic, MARKERS, marker)


def _resources(run: "Run") -> Iterator[BagMessage]:
    """How many messages wait at each node, and how busy each accelerator is."""
    by = ["method", "resource", "kind"]
    of_each: Any = run.resources.groupby(by, sort=False, observed=True)
    for (method, resource, kind), rows in of_each:
        if kind == "queue":
            topic = f"/{_topic(resource)}/{_topic(method)}/queue"
            changed = rows[rows["queue"].diff().fillna(1) != 0]
            for row in _rows(changed):
                yield BagMessage(row.t_ns, topic, FLOAT, {"data": float(row.queue)})
        elif kind == "accelerator":
            host = resource.removesuffix(".accelerator")
            topic = f"/{_topic(host)}/{_topic(method)}/accelerator"
            shares = rows["busy_ns"].diff() / rows["capacity"] / rows["t_ns"].diff()
            for t_ns, share in zip(rows["t_ns"].iloc[1:], shares.iloc[1:], strict=True):
                yield BagMessage(int(t_ns), topic, FLOAT, {"data": float(share)})


def _event(ros: int, t_ns: int, *, level: dict[int, int], name: str, text: str) -> BagMessage:
    """A line of the log.

    Parameters
    ----------
    ros : int
        The ROS that reads it, 1 or 2.
    t_ns : int
        When it happens.
    level : dict
        How serious it is, by ROS.
    name : str
        To whom it happens.
    text : str
        What happens.
    """
    when = {"header": _header(t_ns)} if ros == 1 else {"stamp": time(_ros_ns(t_ns))}
    fields = {**when, "level": level[ros], "name": name, "msg": text}
    return BagMessage(t_ns, "/events", LOGS[ros], fields)


def _marker(
    t_ns: int,
    *,
    place: tuple[float, ...],
    size: tuple[float, ...],
    colour: tuple[float, ...],
    frame: str = MAP_FRAME,
    **fields: Any,
) -> dict[str, Any]:
    """The fields of an array with one marker. Without a ``lifetime`` it stays until the next one
    with its ``id``. One in another frame than the map moves with it.

    Parameters
    ----------
    t_ns : int
        When it appears.
    place : tuple of float
        Its centre: x, y, z [m].
    size : tuple of float
        Its length, width and height [m].
    colour : tuple of float
        Red, green, blue and opacity, each from 0 to 1.
    frame : str
        The frame of ``place``.
    **fields
        Other fields of the marker.
    """
    marker = {
        "header": _header(t_ns, frame),
        "frame_locked": frame != MAP_FRAME,
        "pose": {"position": dict(zip("xyz", place, strict=True)), "orientation": _heading(0.0)},
        "scale": dict(zip("xyz", size, strict=True)),
        "color": dict(zip("rgba", colour, strict=True)),
        **fields,
    }
    return {"markers": [marker]}


def _heading(heading_rad: float) -> dict[str, float]:
    return {"z": math.sin(heading_rad / 2), "w": math.cos(heading_rad / 2)}


def _header(t_ns: int, frame: str = MAP_FRAME) -> dict[str, Any]:
    return {"stamp": time(_ros_ns(t_ns)), "frame_id": frame}


def _rows(table: "pd.DataFrame") -> Iterator[Any]:
    """Every row with its columns as attributes."""
    yield from table.itertuples(index=False)


def confidence_colour(confidence: float) -> tuple[float, float, float]:
    """A colour from violet (0) over green-blue to yellow (1), ever lighter: viridis, which can also
    be read in shades of grey.
    """
    red = float(np.interp(confidence, COLOUR_STOPS, (0.27, 0.13, 0.99)))
    green = float(np.interp(confidence, COLOUR_STOPS, (0.0, 0.57, 0.91)))
    blue = float(np.interp(confidence, COLOUR_STOPS, (0.33, 0.55, 0.14)))
    return red, green, blue


def _ros_ns(t_ns: int) -> int:
    return int(t_ns) + START_S * NS_PER_S


def _topic(name: str) -> str:
    """A name as part of a ROS topic."""
    return re.sub(r"[^A-Za-z0-9_/]", "_", name)


def write(path: Path, ros: int, entries: Iterable[BagMessage]) -> None:
    """A bag of ROS 1, or the one MCAP file that a bag of ROS 2 consists of."""
    store = typestore(ros)
    from rosbags import rosbag1, rosbag2

    serialize = store.serialize_ros1 if ros == 1 else store.serialize_cdr
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=".") as scratch:
        bag = Path(scratch, "run")
        writer: Any = rosbag1.Writer(bag)
        if ros == 2:
            writer = rosbag2.Writer(bag, version=9, storage_plugin=rosbag2.StoragePlugin.MCAP)
            writer.set_compression(rosbag2.CompressionMode.STORAGE, rosbag2.CompressionFormat.ZSTD)
        with writer:
            connections: dict[str, Any] = {}
            for entry in entries:
                if entry.topic not in connections:
                    connections[entry.topic] = writer.add_connection(
                        entry.topic, entry.kind, typestore=store
                    )
                data = serialize(message(store, entry.kind, **entry.fields), entry.kind)
                writer.write(connections[entry.topic], _ros_ns(entry.t_ns), data)
        (bag if ros == 1 else bag / "run.mcap").replace(path)
