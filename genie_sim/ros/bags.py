"""A ROS 1 bag, a ROS 2 bag or an MCAP file as a drive: its images, scans, positions and detections become a trace.

What is needed of a bag: images with a ``camera_info`` beside them; where the car is, as NavSatFix with Imu (or as
transforms from ``map`` or ``world``, with an origin given); the mounting of the sensors, as transforms. Objects are
placed by a PointCloud2 topic. Pictures are taken for rectified, their frames for optical (z ahead, x right).
"""

import contextlib
import hashlib
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from genie_sim.core.geometry import Array, Geodetic, rigid, transform
from genie_sim.errors import UserError, as_user_error, unknown
from genie_sim.messages import Box, Detection
from genie_sim.perception.encoding import difference_hash
from genie_sim.perception.geodesy import enu_SE3_enu
from genie_sim.perception.placement import HALF_DEPTH_M, Placement
from genie_sim.perception.trace import (
    MOST_M,
    MOST_ORIGIN,
    Trace,
    TraceFrame,
    checked,
    detection,
    trace_frame,
    within,
)
from genie_sim.ros.codec import ABSOLUTE_FRAMES, IMAGE, OBJECTS, picture
from genie_sim.ros.tf import Frames, Track, rotation
from genie_sim.ros.typestore import stamp_ns as header_stamp_ns
from genie_sim.ros.typestore import typestore

if TYPE_CHECKING:
    from genie_sim.perception.detector import ImageDetector

IMAGES = (IMAGE, "sensor_msgs/msg/CompressedImage")
POINTS, FIX, IMU = "sensor_msgs/msg/PointCloud2", "sensor_msgs/msg/NavSatFix", "sensor_msgs/msg/Imu"
TRANSFORMS, CAMERA_INFO = (
    ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage"),
    "sensor_msgs/msg/CameraInfo",
)
ARRAYS = (OBJECTS, "vision_msgs/msg/Detection2DArray")
SCAN_WITHIN_NS = 60_000_000  # half a turn of a laser at 10 Hz, and a little
WAIT_NS = 300_000_000  # for the scan that was taken with an image
FLOAT32 = 7
LONGEST = 200  # of what rosbags says about a broken file, which may be the file

Progress = Callable[[int, int], None]
Topics = Mapping[str, str]
PlaceOf = Callable[[str, int], Array | None]


class Seen(NamedTuple):
    """An object that the bag's own detector has found; ``location`` where it says so in an absolute frame."""

    label: str
    score: float
    box: Box
    location: tuple[float, float, float] | None = None


@dataclass
class Surroundings:
    """What a bag says beside its pictures."""

    frames: Frames = field(default_factory=Frames)
    intrinsics: dict[str, Array] = field(default_factory=dict)  # by topic of the camera_info
    fixes: list[tuple[int, Geodetic, str]] = field(default_factory=list)
    turns: list[tuple[int, Array, str]] = field(default_factory=list)
    seen: dict[int, tuple[Seen, ...]] = field(default_factory=dict)  # by stamp


def perceive_bag(
    path: str | Path, detector: "ImageDetector | None" = None, cameras: Sequence[str] = (),
    detections: str | None = None, origin: Geodetic | None = None, min_score: float = 0.3,
    progress: Progress | None = None,
) -> Trace:  # fmt: skip
    """The trace of a bag. Either ``detector`` looks at its pictures, or ``detections`` names a topic of the bag.

    ``cameras`` are image topics, ``NAME=TOPIC`` to call them otherwise than the topic does; by default all that have a
    camera_info. ``origin`` is the geodetic origin, by default the first fix. Raises UserError.
    """
    path = Path(path)
    with _opened(path) as reader:
        topics = {one.topic: one.msgtype for one in reader.connections}
        if detections is not None:
            _check_topic(path, detections, topics, ARRAYS)
        around = _surroundings(path, reader, detections)
        selected = _cameras(path, cameras, topics, around.intrinsics)
        origin, place_of = _places(path, around, origin)
        scans = sorted(topic for topic, kind in topics.items() if kind == POINTS)
        total = sum(one.msgcount for one in reader.connections if one.topic in selected.values())
        made: dict[str, list[TraceFrame]] = {}
        for done, (camera, image, cloud) in enumerate(
            _pictures(path, reader, selected, scans[:1]), start=1
        ):
            frame = _frame(
                path,
                camera,
                selected[camera],
                done,
                image,
                cloud,
                around,
                place_of,
                detector,
                min_score,
            )
            if frame is not None:
                made.setdefault(camera, []).append(frame)
            if progress is not None:
                progress(done, total)
    if not made:
        raise UserError(f"{path}: no image was taken where the car's position is known")
    provenance = _provenance(path, selected, scans, detector, detections)
    return Trace(path.stem, origin, _numbered(path, made), provenance)


def _frame(
    path: Path, camera: str, topic: str, number: int, message: Any, cloud: Any, around: Surroundings, place_of: PlaceOf,
    detector: "ImageDetector | None", min_score: float,
) -> TraceFrame | None:  # fmt: skip
    """One picture perceived; ``None`` where nobody knows where it was taken. Its stamp is still the bag's."""
    stamp_ns, frame_id = header_stamp_ns(message.header), message.header.frame_id
    world_SE3_camera = place_of(frame_id, stamp_ns)
    if world_SE3_camera is None:
        return None
    image = _picture(path, topic, message)
    size, intrinsics = (image.shape[1], image.shape[0]), around.intrinsics[_info_topic(topic)]
    camera_SE3_laser = (
        None if cloud is None else around.frames.find(frame_id, cloud.header.frame_id, stamp_ns)
    )
    placement = None
    if camera_SE3_laser is not None:
        placement = Placement(intrinsics, size, camera_SE3_laser, _points(path, cloud))
    found: Iterable[Seen] = around.seen.get(stamp_ns, ())
    if detector is not None:
        found = (Seen(*one) for one in detector.detect(image))
    kept = [_placed(one, placement, world_SE3_camera) for one in found if one.score >= min_score]
    fingerprints = (hashlib.sha256(bytes(message.data)).hexdigest(), difference_hash(image))
    return trace_frame(
        camera, number, stamp_ns, size, fingerprints, world_SE3_camera, intrinsics, kept
    )


def _placed(one: Seen, placement: Placement | None, world_SE3_camera: Array) -> Detection:
    if one.location is not None:
        return detection(one.label, one.score, one.box, np.array(one.location), "bag")
    point, method = None, "none"
    if placement is not None and one.label in HALF_DEPTH_M:
        point, method = placement.place(one.label, one.box)
    world = None if point is None else transform(world_SE3_camera, point)
    return detection(one.label, one.score, one.box, world, method)


def _places(path: Path, around: Surroundings, origin: Geodetic | None) -> tuple[Geodetic, PlaceOf]:
    """The trace's origin, and ``world_SE3_frame`` of a frame of the car at an instant, ``None`` where it is not known.

    Raises UserError.
    """
    frames, fixes, turns = around.frames, around.fixes, around.turns
    if origin is None and fixes:
        origin = fixes[0][1]
    if origin is not None and fixes and turns:
        imu = turns[0][2]
        antenna = frames.find(imu, fixes[0][2], turns[0][0])
        lever = np.zeros(3) if antenna is None else antenna[:3, 3]
        here = Track((stamp_ns, enu_SE3_enu(origin, fix)) for stamp_ns, fix, _ in fixes)
        track = Track(_rig_poses(here, turns, lever))

        def on_the_track(frame_id: str, stamp_ns: int) -> Array | None:
            imu_SE3_frame, world_SE3_imu = frames.find(imu, frame_id, stamp_ns), track.at(stamp_ns)
            return (
                None
                if imu_SE3_frame is None or world_SE3_imu is None
                else world_SE3_imu @ imu_SE3_frame
            )

        return origin, on_the_track
    known = frames.known()
    world = next((name for name in ABSOLUTE_FRAMES if name in known), None)
    if world is None:
        raise UserError(
            f"{path}: where is the car? No {FIX} with {IMU}, and no transform from map or world"
        )
    if origin is None:
        raise UserError(f"{path}: no {FIX}: say with --origin where the frame {world!r} lies")
    return origin, partial(frames.find, world)


def _rig_poses(
    here: Track, turns: Iterable[tuple[int, Array, str]], lever: Array
) -> Iterator[tuple[int, Array]]:
    """The IMU's poses: turned as it says, where the fix is less the way from the IMU to the antenna."""
    for stamp_ns, turn, _ in turns:
        world_SE3_here = here.at(stamp_ns)
        if world_SE3_here is not None:
            yield stamp_ns, world_SE3_here @ rigid(turn, -turn @ lever)


@contextlib.contextmanager
def _opened(path: Path) -> Iterator[Any]:
    store = typestore(2)
    from rosbags.highlevel import AnyReader

    if not path.exists():
        raise UserError(f"{path}: no such bag")
    with _readable(path):
        reader = AnyReader([path], default_typestore=store)
        reader.open()
    try:
        yield reader
    finally:
        reader.close()


def _messages(path: Path, reader: Any, chosen: Sequence[Any]) -> Iterator[tuple[Any, int, Any]]:
    """Connection, time of the recording [ns] and message, of the ``chosen`` connections."""
    with _readable(path):
        for connection, at_ns, raw in reader.messages(chosen) if chosen else ():
            yield connection, at_ns, reader.deserialize(raw, connection.msgtype)


def _readable(path: Path) -> contextlib.AbstractContextManager[None]:
    """Whatever a broken file makes of its readers is told of the file."""
    return as_user_error(f"{path}: cannot be read as a bag", Exception, most=LONGEST)


def _surroundings(path: Path, reader: Any, detections: str | None) -> Surroundings:
    around = Surroundings()
    kinds = (*TRANSFORMS, CAMERA_INFO, FIX, IMU)
    chosen = [one for one in reader.connections if one.msgtype in kinds or one.topic == detections]
    for connection, _, message in _messages(path, reader, chosen):
        kind, topic = connection.msgtype, connection.topic
        if kind in TRANSFORMS:
            for one in message.transforms:
                place, turn = one.transform.translation, rotation(one.transform.rotation)
                if turn is None or not within((place.x, place.y, place.z), MOST_M):
                    raise UserError(
                        f"{path}: {topic}: a transform to {one.child_frame_id!r} that is no place and turn"
                    )
                step = rigid(turn, (place.x, place.y, place.z))
                parent, child = one.header.frame_id, one.child_frame_id
                around.frames.heard(
                    parent, child, header_stamp_ns(one.header), step, topic.endswith("static")
                )
        elif kind == CAMERA_INFO:
            projection = np.array(message.P if hasattr(message, "P") else message.p).reshape(3, 4)
            camera = np.array(message.K if hasattr(message, "K") else message.k).reshape(3, 3)
            around.intrinsics[topic] = projection[:, :3] if projection[0, 0] else camera
            if not (
                np.isfinite(around.intrinsics[topic]).all()
                and around.intrinsics[topic].diagonal().min() > 0
            ):
                raise UserError(f"{path}: {topic}: no intrinsics of a camera")
        elif kind == FIX:
            fix = (message.latitude, message.longitude, message.altitude)
            if all(within([number], most) for number, most in zip(fix, MOST_ORIGIN, strict=True)):
                around.fixes.append((header_stamp_ns(message.header), fix, message.header.frame_id))
        elif kind == IMU:
            turn = rotation(message.orientation)
            if turn is not None:
                around.turns.append(
                    (header_stamp_ns(message.header), turn, message.header.frame_id)
                )
        else:
            seen = around.seen[header_stamp_ns(message.header)] = tuple(_objects(message, kind))
            if not all(
                within((one.score, *one.box, *(one.location or ())), MOST_M) for one in seen
            ):
                raise UserError(
                    f"{path}: {topic}: an object whose score, box or place is no number in range"
                )
    return around


def _objects(message: Any, kind: str) -> Iterator[Seen]:
    """What an array of detections says. Locations count in the frames ``map`` and ``world``."""
    if kind == OBJECTS:
        for one in message.objects:
            box = (float(one.x), float(one.y), float(one.x + one.width), float(one.y + one.height))
            frame = (one.space_frame or one.header.frame_id or message.header.frame_id).strip("/")
            at = one.pose.position
            placed = frame in ABSOLUTE_FRAMES and any((at.x, at.y, at.z))
            yield Seen(one.label, float(one.score), box, (at.x, at.y, at.z) if placed else None)
        return
    for one in message.detections:
        if len(one.results):
            best = max(
                (getattr(result, "hypothesis", result) for result in one.results),
                key=lambda guess: guess.score,
            )
            middle = getattr(one.bbox.center, "position", one.bbox.center)
            half_x, half_y = one.bbox.size_x / 2, one.bbox.size_y / 2
            box = (middle.x - half_x, middle.y - half_y, middle.x + half_x, middle.y + half_y)
            yield Seen(
                str(best.class_id if hasattr(best, "class_id") else best.id), float(best.score), box
            )


def _cameras(
    path: Path, cameras: Sequence[str], topics: Mapping[str, str], known: Mapping[str, Array]
) -> Topics:
    """Image topics by the camera's name."""
    images = sorted(topic for topic, kind in topics.items() if kind in IMAGES)
    selected: dict[str, str] = {}
    for one in cameras or [topic for topic in images if _info_topic(topic) in known]:
        name, _, topic = one.rpartition("=")
        _check_topic(path, topic, topics, IMAGES)
        if _info_topic(topic) not in known:
            raise UserError(f"{path}: {topic}: no {_info_topic(topic)} says what the camera sees")
        name = name or _camera_topic(topic).strip("/").rpartition("/")[2] or "camera"
        if name in selected and cameras:
            raise UserError(
                f"{path}: two cameras are called {name!r}; give other names, as in left={topic}"
            )
        selected.setdefault(name, topic)  # of raw and compressed the raw one: it comes first
    if not selected:
        raise UserError(
            f"{path}: no image topic with a camera_info beside it; topics: {', '.join(sorted(topics))}"
        )
    return selected


def _camera_topic(topic: str) -> str:
    """``/camera/image_raw/compressed`` belongs to ``/camera``."""
    return topic.removesuffix("/compressed").rpartition("/")[0]


def _info_topic(topic: str) -> str:
    return f"{_camera_topic(topic)}/camera_info"


def _check_topic(path: Path, topic: str, topics: Mapping[str, str], kinds: Sequence[str]) -> None:
    usable = sorted(name for name, kind in topics.items() if kind in kinds)
    if topic not in usable:
        raise UserError(
            f"{path}: {unknown('topic', topic, usable)}"
            if usable
            else f"{path}: no {' or '.join(kinds)}"
        )


def _pictures(
    path: Path, reader: Any, selected: Topics, scans: Sequence[str]
) -> Iterator[tuple[str, Any, Any]]:
    """Each image with its camera's name and the scan nearest in time (``None``: there is none near)."""
    names = {topic: name for name, topic in selected.items()}
    waiting: deque[tuple[int, str, Any]] = deque()
    recent: deque[Any] = deque(maxlen=8)
    chosen = [one for one in reader.connections if one.topic in names or one.topic in scans]

    def with_scan(image: Any) -> Any:
        stamp_ns = header_stamp_ns(image.header)
        near = min(
            recent, key=lambda scan: abs(header_stamp_ns(scan.header) - stamp_ns), default=None
        )
        return (
            near
            if near is not None and abs(header_stamp_ns(near.header) - stamp_ns) <= SCAN_WITHIN_NS
            else None
        )

    for connection, at_ns, message in _messages(path, reader, chosen):
        if connection.topic in names:
            waiting.append((at_ns, names[connection.topic], message))
        else:
            recent.append(message)
        newest_ns = header_stamp_ns(recent[-1].header) if recent else 0
        while waiting:
            since_ns, camera, image = waiting[0]
            if scans and newest_ns < header_stamp_ns(image.header) and at_ns - since_ns < WAIT_NS:
                break
            waiting.popleft()
            yield camera, image, with_scan(image)
    for _, camera, image in waiting:
        yield camera, image, with_scan(image)


def _picture(path: Path, topic: str, message: Any) -> np.ndarray:
    """An image message, compressed or not, as (height, width, 3) bytes: blue, green, red."""
    import cv2

    if hasattr(message, "encoding"):
        with as_user_error(f"{path}: {topic}", ValueError, UserError):
            return picture(message)
    image = None
    with contextlib.suppress(cv2.error):  # it holds nothing, or too much
        image = cv2.imdecode(np.frombuffer(bytes(message.data), np.uint8), cv2.IMREAD_COLOR)
    if image is None:
        raise UserError(
            f"{path}: {topic}: a compressed image that cannot be read ({message.format})"
        )
    return image


def _points(path: Path, cloud: Any) -> Array:
    """Points (n, 3) of a scan, in the laser's frame."""
    offsets = {one.name: one.offset for one in cloud.fields if one.datatype == FLOAT32}
    if not {"x", "y", "z"} <= offsets.keys():
        raise UserError(f"{path}: a {POINTS} without float32 fields x, y and z")
    float32, names = (">f4" if cloud.is_bigendian else "<f4"), ["x", "y", "z"]
    data, count = bytes(cloud.data), cloud.width * cloud.height
    if (
        len(data) < count * cloud.point_step
        or cloud.point_step < max(offsets[name] for name in names) + 4
    ):
        raise UserError(f"{path}: a {POINTS} cut short: {len(data)} bytes")
    layout = np.dtype(
        {"names": names, "formats": [float32] * 3, "offsets": [offsets[name] for name in names],
         "itemsize": cloud.point_step}
    )  # fmt: skip
    read = np.frombuffer(data, layout, count)
    points: Array = np.column_stack([read[name] for name in names]).astype(np.float64)
    return points[np.isfinite(points).all(axis=1)]


def _numbered(
    path: Path, made: Mapping[str, list[TraceFrame]]
) -> dict[str, tuple[TraceFrame, ...]]:
    """Frame numbers of each camera, and stamps that begin with the first one's. Raises UserError."""
    first_ns = min(frame.stamp_ns for frames in made.values() for frame in frames)
    numbered = [
        replace(frame, index=index, stamp_ns=frame.stamp_ns - first_ns)
        for frames in made.values() for index, frame in enumerate(frames)
    ]  # fmt: skip
    return checked(path, numbered)


def _provenance(
    path: Path,
    selected: Topics,
    scans: Sequence[str],
    detector: "ImageDetector | None",
    detections: str | None,
) -> dict[str, Any]:
    total = hashlib.sha256()
    for file in sorted(path.rglob("*")) if path.is_dir() else [path]:
        if file.is_file():
            with file.open("rb") as opened:
                total.update(hashlib.file_digest(opened, "sha256").digest())
    found = (
        {"detector": detector.name, "weights_sha256": detector.sha256}
        if detector
        else {"detector": detections}
    )
    topics = {"cameras": dict(selected), "scans": list(scans[:1])}
    return {
        "data": f"bag {path.name}",
        "bag_sha256": total.hexdigest(),
        "parameters": topics,
        **found,
    }
