"""The perception trace: what each frame of a drive showed, and where its camera stood.

A trace is all that a run needs of the real world: neither frames nor a GPU. One Parquet file holds
one drive with all its cameras, one row per frame, and its provenance in the schema's metadata under
``genie_sim``.
"""

import functools
import hashlib
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

from genie_sim.base import parquet
from genie_sim.base.errors import UserError, as_user_error, short_repr, unknown
from genie_sim.base.geometry import Geodetic, heading_of, transform
from genie_sim.base.paths import remembered
from genie_sim.core.messages import CameraPose, Detection, Location
from genie_sim.data import world_table
from genie_sim.data.frame_source import Drive
from genie_sim.data.world_table import in_range

if TYPE_CHECKING:
    import pyarrow

SensorKind = Literal["camera", "lidar"]
KINDS: tuple[SensorKind, ...] = get_args(SensorKind)
METADATA = ("name", "sequence")  # of a trace's file, besides what all tell; see ``Trace``
FEATURE = "feature_"  # how the columns of features begin; a trace need not have any
# columns, and fields
PLAIN = ("camera", "index", "stamp_ns", "width", "height", "size_bytes", "digest", "dhash")
BOX, PLACE = ("x1", "y1", "x2", "y2"), ("east_m", "north_m", "up_m")

# sensor_msgs/Image in ROS 1, without the pixels: sequence number, stamp, frame_id, height, width,
# encoding, endianness, step and length of the data.
IMAGE_HEADER_BYTES = 4 + 8 + (4 + len("camera")) + 4 + 4 + (4 + len("bgr8")) + 1 + 4 + 4

# Decimals kept in a trace, far below the detector's and the laser's own errors: the last bits of a
# float differ between processors, and without them the same frames give the same trace on most
# machines.
POSITION_DECIMALS = 3
SCORE_DECIMALS = 4
PIXEL_DECIMALS = 2
ANGLE_DECIMALS = 6

MAX_HEADING_RAD = 2 * math.pi
# The lowest and highest values of a frame, by the kind of its sensor: a lidar has no picture.
_OF_BOTH = {"stamp_ns": (0, 2**63 - 1), "size_bytes": (1, 2**63 - 1)}
LIMITS: Mapping[SensorKind, Mapping[str, tuple[float, float]]] = {
    "camera": _OF_BOTH
    | dict.fromkeys(("width", "height"), (1, 2**31))
    | {"horizontal_fov_rad": (1e-6, math.pi - 1e-6)},
    "lidar": _OF_BOTH
    | dict.fromkeys(("width", "height"), (0, 0))
    | {"horizontal_fov_rad": (1e-6, math.tau)},
}

MIN_HEIGHT_PX = 25  # KITTI's benchmark judges no object that is lower in the picture
RANGE_M = 40.0  # up to which objects are judged, unless somebody says; where KITTI's labels end


@dataclass(frozen=True, slots=True)
class TraceFrame:
    """One frame of a camera or a lidar: when it was taken and from where, the fingerprints of its
    image, and what was found in it.

    ``stamp_ns`` counts from the drive's first frame, ``size_bytes`` is that of a
    ``sensor_msgs/Image``, or of the encoded picture in which things were found, ``digest`` the
    sha256 of the image file, ``dhash`` the unsigned 64-bit difference hash of the grey image.
    ``pose`` is the camera's centre in the trace's east-north-up frame with the heading of its
    optical axis. ``features`` are short vectors by name, as ``base.features`` packs them; a
    trace may have none. A frame of ``kind`` ``lidar`` has no picture: width and height are 0,
    ``size_bytes`` is that of its scan, and its field of view may be a whole turn.
    """

    camera: str
    index: int
    stamp_ns: int
    width: int
    height: int
    size_bytes: int
    digest: str
    dhash: int
    pose: CameraPose
    horizontal_fov_rad: float
    detections: tuple[Detection, ...]
    features: Mapping[str, bytes] = field(default_factory=dict, hash=False)
    kind: SensorKind = "camera"


@dataclass(frozen=True)
class Trace(Drive):
    """All frames of one drive, by camera and in order of time, placed around one geodetic origin.

    ``origin`` is latitude [deg], longitude [deg], altitude [m]. ``sequence`` names the drive of
    several cars that this trace is a part of: the stamps of all its traces are on one
    clock; ``None`` for a car that drove alone. ``digest`` is the sha256 of origin, frames and
    sequence: it does not change with the name, the provenance or the Parquet version, nor with
    the features, whose own digests are in the provenance.

    Of ``provenance`` are read: ``detector`` and ``drive``, by which maps choose their laws; these,
    ``weights_sha256`` and ``parameters``, which ``sources.encoded_beside`` compares and, with
    ``drive_sha256``, ``kitti.trace_check``; ``features``, what ``feature_facts`` gives.
    """

    name: str
    origin: Geodetic
    frames: Mapping[str, tuple[TraceFrame, ...]]
    provenance: Mapping[str, Any]
    sequence: str | None = None

    @property
    def by_picture(self) -> dict[tuple[str, int], TraceFrame]:
        """The frames by camera and number."""
        return {(name, frame.index): frame for name in self.frames for frame in self.frames[name]}

    @functools.cached_property
    def digest(self) -> str:
        """The sha256 of what the trace shows, computed when it is asked for."""
        rows = [_row(frame) for camera in sorted(self.frames) for frame in self.frames[camera]]
        content = [[float(x) for x in self.origin], rows]
        if self.sequence is not None:
            content.append([self.sequence])
        return world_table.content_digest(content)

    def rebased(self, origin: Geodetic) -> "Trace":
        """The same trace around another geodetic origin, with the decimals that a trace keeps;
        drives with one origin share one world.
        """
        if origin == self.origin:
            return self
        from genie_sim.data.geodesy import enu_SE3_enu

        new_SE3_old = enu_SE3_enu(origin, self.origin)

        def place(location: Location) -> Location:
            return rounded(transform(new_SE3_old, location), POSITION_DECIMALS)

        def moved(frame: TraceFrame) -> TraceFrame:
            heading_rad = frame.pose.heading_rad
            ahead = new_SE3_old[:3, :3] @ [math.cos(heading_rad), math.sin(heading_rad), 0.0]
            east_m, north_m, up_m = transform(new_SE3_old, frame.pose[:3]).tolist()
            pose = CameraPose(east_m, north_m, up_m, heading_of(ahead))
            detections = tuple(
                d if d.location is None else replace(d, location=place(d.location))
                for d in frame.detections
            )
            return rounded_pose(replace(frame, pose=pose, detections=detections))

        frames = {camera: tuple(map(moved, sequence)) for camera, sequence in self.frames.items()}
        return replace(self, origin=origin, frames=frames)


def rounded(numbers: Iterable[float], decimals: int) -> tuple[Any, ...]:
    """As a trace keeps them; numpy rounds otherwise where two numbers are as near."""
    return tuple(round(float(x), decimals) for x in numbers)


def rounded_pose(frame: TraceFrame) -> TraceFrame:
    """The frame with the decimals of its pose and field of view that a trace keeps."""
    east_m, north_m, up_m = rounded(frame.pose[:3], POSITION_DECIMALS)
    angles_rad = frame.pose.heading_rad, frame.horizontal_fov_rad
    heading_rad, fov_rad = rounded(angles_rad, ANGLE_DECIMALS)
    pose = CameraPose(east_m, north_m, up_m, heading_rad)
    return replace(frame, pose=pose, horizontal_fov_rad=fov_rad)


def feature_facts(
    path: object, frames: Mapping[str, Sequence[TraceFrame]]
) -> dict[str, dict[str, Any]]:
    """Of each feature: its dimension, and the sha256 of all of them, camera by camera. Raises
    UserError, naming ``path``, for a frame whose features are not those of the first, or as long.
    """
    ordered = [frame for camera in sorted(frames) for frame in frames[camera]]
    names = {name for frame in ordered for name in frame.features}
    for frame in ordered:
        for name in sorted(names):
            value, first = frame.features.get(name), ordered[0].features.get(name, b"")
            if not (value and isinstance(value, bytes) and len(first) in (0, len(value))):
                raise UserError(
                    f"{path}: camera {frame.camera!r}, frame {frame.index}: feature {name!r} is "
                    f"{short_repr(value)}; every frame must have it, as bytes of one length"
                )
    return {
        name: {
            "dimension": len(ordered[0].features[name]),
            "sha256": hashlib.sha256(
                b"".join(frame.features[name] for frame in ordered)
            ).hexdigest(),
        }
        for name in sorted(names)
    }


def check_replaceable(path: Path) -> None:
    """Raises ``UserError`` where a trace may not be written: what is there is none."""
    world_table.check_replaceable(path, METADATA)


def write_trace(path: str | Path, trace: Trace) -> None:
    """Writes a trace, whole or not at all; the same one gives the same bytes with the same pyarrow.
    Raises UserError where the folder cannot be written.
    """
    import pyarrow as pa

    frames = [frame for camera in sorted(trace.frames) for frame in trace.frames[camera]]
    features = sorted(feature_facts(path, trace.frames))
    schema = _schema()
    for name in features:
        schema = schema.append(pa.field(FEATURE + name, pa.binary(len(frames[0].features[name]))))
    if any(frame.kind != KINDS[0] for frame in frames):
        schema = schema.append(pa.field("kind", pa.string()))
    rows = (
        {"kind": KINDS[0]}
        | _row(frame)
        | {FEATURE + name: frame.features[name] for name in features}
        for frame in frames
    )
    world_table.write(Path(path), schema, rows, trace, METADATA)


@remembered
def read_trace(path: Path) -> Trace:
    """Read a trace and check all of it.

    Raises UserError, naming file and field, for a missing, truncated, altered or foreign file,
    another format version, a missing column, time stamps or numbers of frames out of order and
    poses that are not numbers.
    """
    table, about = world_table.read(path, "trace", _schema(), "name", optional=_is_more)
    with as_user_error(f"{path}: a row cannot be read", TypeError, ValueError):
        frames = [_frame(row) for row in table.to_pylist()]
    by_camera = checked(path, frames)
    if not isinstance(about["provenance"].get("parameters", {}), dict):
        raise UserError(f"{path}: metadata: provenance: 'parameters' is not a mapping")
    sequence = _sequence(path, about)
    trace = Trace(about["name"], about["origin"], by_camera, about["provenance"], sequence=sequence)
    world_table.check_digest(path, trace.digest, about)
    if "features" in trace.provenance and trace.provenance["features"] != feature_facts(
        path, by_camera
    ):
        raise UserError(
            f"{path}: features do not match the digests in its own provenance: file was altered"
        )
    return trace


def sequence_of(path: Path) -> str | None:
    """The sequence that the trace in a file is of, read without its frames. Raises UserError."""
    return _sequence(path, parquet.described(path, "trace")[1])


def _sequence(path: Path, about: Mapping[str, Any]) -> str | None:
    sequence = about.get("sequence")
    if sequence is None or (isinstance(sequence, str) and sequence):
        return sequence
    raise UserError(f"{path}: metadata: sequence {sequence!r} is no name")


def checked(path: object, frames: Iterable[TraceFrame]) -> dict[str, tuple[TraceFrame, ...]]:
    """The frames by camera. Raises UserError, naming ``path``, if frames are out of order or have
    impossible values.
    """
    by_camera: dict[str, list[TraceFrame]] = {}
    for frame in frames:
        where = f"{path}: camera {frame.camera!r}, frame {frame.index}"
        earlier = by_camera.setdefault(frame.camera, [])
        if earlier and frame.stamp_ns <= earlier[-1].stamp_ns:
            raise UserError(
                f"{where}: stamp_ns {frame.stamp_ns} does not follow {earlier[-1].stamp_ns}"
            )
        if earlier and frame.index <= earlier[-1].index:
            raise UserError(f"{where}: index does not follow {earlier[-1].index}")
        if frame.kind not in KINDS:
            raise UserError(f"{where}: {unknown('kind of sensor', frame.kind, KINDS)}")
        for name, (low, high) in LIMITS[frame.kind].items():
            value = getattr(frame, name)
            if not low <= value <= high:
                raise UserError(
                    f"{where}: {name} of a {frame.kind} must be from {low:.6g} to {high:.6g}, "
                    f"not {value!r}"
                )
        if not (in_range(frame.pose[:3]) and in_range(frame.pose[3:], MAX_HEADING_RAD)):
            raise UserError(
                f"{where}: pose {tuple(frame.pose)} is no place on Earth [m] and a heading [rad]"
            )
        for detection in frame.detections:
            texts = (detection.label, detection.placed_by)
            numbers = (detection.score, *(detection.box or ()), *(detection.location or ()))
            if not (in_range(numbers) and all(isinstance(text, str) for text in texts)):
                raise UserError(
                    f"{where}: a detection has label and placed_by {texts}, and score, box and "
                    f"place {numbers}: must be texts, and numbers in range"
                )
            if not 0 <= detection.score <= 1:
                raise UserError(
                    f"{where}: a {detection.label} of score {detection.score!r}; must be from 0 "
                    "to 1"
                )
        earlier.append(frame)
    if not by_camera:
        raise UserError(f"{path}: the trace has no frames")
    return {camera: tuple(sequence) for camera, sequence in by_camera.items()}


def _schema() -> "pyarrow.Schema":
    import pyarrow as pa

    kinds = {"camera": pa.string(), "digest": pa.string(), "dhash": pa.uint64()}
    detection = [
        ("label", pa.string()),
        *((name, pa.float64()) for name in ("score", *BOX, *PLACE)),
        ("method", pa.string()),
    ]
    return pa.schema(
        [
            *((name, kinds.get(name, pa.int64())) for name in PLAIN),
            *((name, pa.float64()) for name in (*CameraPose._fields, "horizontal_fov_rad")),
            ("detections", pa.list_(pa.struct(detection))),
        ]
    )


def _is_more(column: str) -> bool:
    """Whether a trace may have this column besides those of ``_schema``."""
    return column == "kind" or column.startswith(FEATURE)


def _row(frame: TraceFrame) -> dict[str, Any]:
    """One row of the file, without what is as usual: features, and a camera's kind.

    A detection's confidence is not stored, it starts as its score.
    """
    detections = [
        {"label": d.label, "score": d.score, "method": d.placed_by}
        | dict(zip(BOX, d.box or (None,) * 4, strict=True))
        | dict(zip(PLACE, d.location or (None,) * 3, strict=True))
        for d in frame.detections
    ]
    plain = {name: getattr(frame, name) for name in (*PLAIN, "horizontal_fov_rad")}
    kind = {} if frame.kind == KINDS[0] else {"kind": frame.kind}
    return plain | frame.pose._asdict() | {"detections": detections} | kind


def _frame(row: Mapping[str, Any]) -> TraceFrame:
    def several(of: Mapping[str, Any], names: Sequence[str]) -> Any:
        return None if of[names[0]] is None else tuple(of[name] for name in names)

    detections = tuple(
        Detection(
            d["label"],
            d["score"],
            box=several(d, BOX),
            location=several(d, PLACE),
            confidence=d["score"],
            placed_by=d["method"],
        )
        for d in row["detections"]
    )
    plain = {name: row[name] for name in (*PLAIN, "horizontal_fov_rad")}
    features = {name.removeprefix(FEATURE): row[name] for name in row if name.startswith(FEATURE)}
    return TraceFrame(
        **plain,
        pose=CameraPose(*(row[name] for name in CameraPose._fields)),
        detections=detections,
        features=features,
        kind=row.get("kind", KINDS[0]),
    )
