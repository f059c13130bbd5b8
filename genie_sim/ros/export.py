"""A finished run as a bag for Foxglove or RViz: ROS 2 messages in one MCAP file, or a ROS 1 bag.

=============================  ==================================================================================
topic                          what
=============================  ==================================================================================
``/tf``                        every camera of every car (``car1/camera_02``) in the frame ``map``: ``poses``
``/<genie>/object_map``        each change of a Genie's object map as a box, its confidence as colour: ``objects``
``/lookups``                   each look-up for an image as a ball over the camera that took it: ``lookups``
``/events``                    the same in words, and what was dropped: ``lookups``, ``frames``
``/<car>/<method>/response``   time to the first answer [ms]: ``frames``
``/cars``                      a box for each camera's car, which moves with its frame
=============================  ==================================================================================

The simulation begins at second ``START_S`` of ROS time, because ROS takes the time 0 for "unknown".
"""

import math
import re
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from genie_sim.errors import UserError, unknown
from genie_sim.paths import atomic_write
from genie_sim.recording import provenance
from genie_sim.ros.codec import ADD, CUBE, MARKERS
from genie_sim.ros.typestore import TF, message, time, typestore
from genie_sim.units import NS_PER_S

if TYPE_CHECKING:
    import pandas as pd

    from genie_sim.recording.results import Run

FORMATS = {"mcap": 2, "bag": 1}  # the ROS that reads it
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
SIZES_M = {  # length, width, height of a box; others are a metre of everything
    "car": (3.9, 1.6, 1.5), "truck": (4.9, 1.9, 2.2), "bus": (4.9, 1.9, 2.5), "train": (15.0, 2.5, 3.5),
    "person": (0.5, 0.5, 1.75), "bicycle": (1.8, 0.6, 1.7), "motorcycle": (2.0, 0.8, 1.5),
}  # fmt: skip
CAR_BELOW_CAMERA_M = -0.8  # a KITTI car's camera is mounted 1.65 m above the ground
LOOKUP_SHOWN_NS = NS_PER_S


class Entry(NamedTuple):
    """One message of the bag: its simulated time, and the fields that are not empty."""

    t_ns: int
    topic: str
    kind: str
    fields: dict[str, Any]


def export(run: "Run", out: Path, format: str) -> int:
    """Writes a run to ``out`` and returns how many messages it holds. Raises UserError."""
    if format not in FORMATS:
        raise UserError(unknown("format", format, FORMATS))
    if run.poses.empty:
        raise UserError(
            f"{run.folder or run.name}: holds no poses, so there is nothing to show; 'record' them"
        )
    ros = FORMATS[format]
    with provenance.of_this_version(run.folder):
        made = (*_poses(run), *_cars(run), *_objects(run), *_lookups(run, ros), *_frames(run, ros))
        entries = sorted(made, key=lambda entry: entry.t_ns)
    with atomic_write(out) as beside:
        out.parent.mkdir(parents=True, exist_ok=True)
        write(beside, ros, entries)
    return len(entries)


def _poses(run: "Run") -> Iterator[Entry]:
    for row in _rows(run.poses):
        motion = {
            "translation": {"x": row.east_m, "y": row.north_m},
            "rotation": _heading(row.heading_rad),
        }
        child = f"{row.car}/{row.stream}"
        one = {"header": _header(row.stamp_ns), "child_frame_id": child, "transform": motion}
        yield Entry(row.stamp_ns, "/tf", TF, {"transforms": [one]})


def _cars(run: "Run") -> Iterator[Entry]:
    first = run.poses.drop_duplicates(["car", "stream"])
    for number, row in enumerate(_rows(first.drop_duplicates("car"))):
        yield _marker(
            "/cars", row.stamp_ns, row.car, number, CUBE, (-1.0, 0.0, CAR_BELOW_CAMERA_M), SIZES_M["car"],
            (0.25, 0.4, 0.7, 0.8), row.car, frame=f"{row.car}/{row.stream}",
        )  # fmt: skip


def _objects(run: "Run") -> Iterator[Entry]:
    numbers: dict[tuple[object, ...], int] = {}
    for row in _rows(run.objects):
        which = (row.genie, row.label, row.east_m, row.north_m)
        number = numbers.setdefault(which, len(numbers))
        size = SIZES_M.get(row.label, (1.0, 1.0, 1.0))
        forgotten = math.isnan(row.confidence)
        confidence = 0.0 if forgotten else row.confidence
        place, text = (row.east_m, row.north_m, size[2] / 2), f"{row.label} {confidence:.2f}"
        topic, colour = f"/{_topic(row.genie)}/object_map", (*confidence_colour(confidence), 0.9)
        action = DELETE if forgotten else ADD
        yield _marker(
            topic, row.t_ns, row.label, number, CUBE, place, size, colour, text, action=action
        )


def _lookups(run: "Run", ros: int) -> Iterator[Entry]:
    at = {
        (row.car, row.stream, row.stamp_ns): (row.east_m, row.north_m) for row in _rows(run.poses)
    }
    for number, row in enumerate(_rows(run.lookups[run.lookups["kind"] == "image"])):
        asked = f"{row.outcome} at {row.genie} for {row.car}/{row.stream}, {row.stamp_ns / NS_PER_S:.3f} s"
        yield _event(ros, row.t_ns, INFO, row.genie, asked)
        place, colour = (*at[row.car, row.stream, row.stamp_ns], 3.0), (*COLOURS[row.outcome], 1.0)
        lifetime = time(LOOKUP_SHOWN_NS)
        yield _marker(
            "/lookups",
            row.t_ns,
            row.genie,
            number,
            BALL,
            place,
            (0.5,) * 3,
            colour,
            asked,
            lifetime=lifetime,
        )


def _frames(run: "Run", ros: int) -> Iterator[Entry]:
    for row in _rows(run.frames):
        if isinstance(row.drop, str) and row.source == "none":
            lost = f"{row.method}: {row.car}/{row.stream} frame {row.frame} dropped at {row.drop}"
            yield _event(ros, row.stamp_ns, WARN, row.car, lost)
        first, received = row.first_answer_ns, row.received_ns
        if first == first and first is not None and received == received:  # not nan, not null
            response_ms = (int(first) - int(received)) / 1e6
            yield Entry(
                int(first),
                f"/{_topic(row.car)}/{row.method}/response",
                FLOAT,
                {"data": response_ms},
            )


def _event(ros: int, t_ns: int, level: dict[int, int], name: str, text: str) -> Entry:
    when = {"header": _header(t_ns)} if ros == 1 else {"stamp": time(_ros_ns(t_ns))}
    return Entry(
        t_ns, "/events", LOGS[ros], {**when, "level": level[ros], "name": name, "msg": text}
    )


def _marker(
    topic: str, t_ns: int, ns: str, number: int, shape: int, place: tuple[float, ...], size: tuple[float, ...],
    colour: tuple[float, ...], text: str, frame: str = MAP_FRAME, **more: Any,
) -> Entry:  # fmt: skip
    """Without a ``lifetime``: until the next one of this number. One in another frame than the map moves with it."""
    marker = {
        "header": _header(t_ns, frame),
        "ns": ns,
        "id": number,
        "type": shape,
        "text": text,
        "frame_locked": frame != MAP_FRAME,
        "pose": {"position": dict(zip("xyz", place, strict=True)), "orientation": _heading(0.0)},
        "scale": dict(zip("xyz", size, strict=True)),
        "color": dict(zip("rgba", colour, strict=True)),
        **more,
    }
    return Entry(t_ns, topic, MARKERS, {"markers": [marker]})


def _heading(heading_rad: float) -> dict[str, float]:
    return {"z": math.sin(heading_rad / 2), "w": math.cos(heading_rad / 2)}


def _header(t_ns: int, frame: str = MAP_FRAME) -> dict[str, Any]:
    return {"stamp": time(_ros_ns(t_ns)), "frame_id": frame}


def _rows(table: "pd.DataFrame") -> Iterator[Any]:
    """Every row with its columns as attributes."""
    yield from table.itertuples(index=False)


def confidence_colour(confidence: float) -> tuple[float, float, float]:
    """From violet (0) over green-blue to yellow (1), ever lighter: viridis, which also survives greyscale."""
    at, stops = (0.0, 0.5, 1.0), ((0.27, 0.13, 0.99), (0.0, 0.57, 0.91), (0.33, 0.55, 0.14))
    red, green, blue = (float(np.interp(confidence, at, channel)) for channel in stops)
    return red, green, blue


def _ros_ns(t_ns: int) -> int:
    return int(t_ns) + START_S * NS_PER_S


def _topic(name: str) -> str:
    """A name of ours as part of a ROS topic."""
    return re.sub(r"[^A-Za-z0-9_/]", "_", name)


def write(path: Path, ros: int, entries: Iterable[Entry]) -> None:
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
