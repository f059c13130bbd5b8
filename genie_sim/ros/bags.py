"""A ROS 1 bag, a ROS 2 bag or an MCAP file as a drive: its images, scans, positions and detections
become a trace.

What is needed of a bag: images with a ``camera_info`` beside them; where the car is, as NavSatFix
with Imu (or as transforms from ``map`` or ``world``, with an origin given); the mounting of the
sensors, as transforms. Objects are placed by a PointCloud2 topic. Pictures are taken for rectified,
their frames for optical (z ahead, x right).
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

from genie_sim.base.errors import UserError, as_user_error, unknown
from genie_sim.base.progress import Progress
from genie_sim.core.geometry import Array, Geodetic, rigid, transform
from genie_sim.core.messages import Box, Detection
from genie_sim.data.encoding import difference_hash
from genie_sim.data.geodesy import enu_SE3_enu
from genie_sim.data.placement import HALF_DEPTH_M, Placement
from genie_sim.data.trace import Trace, TraceFrame, checked, detection, trace_frame
from genie_sim.data.world_table import in_range, is_origin
from genie_sim.ros.codec import ABSOLUTE_FRAMES, IMAGE, OBJECTS, picture
from genie_sim.ros.tf import Trajectory, TransformTree, rotation
from genie_sim.ros.typestore import stamp_ns as header_stamp_ns
from genie_sim.ros.typestore import typestore

if TYPE_CHECKING:
    from genie_sim.data.detector import ImageDetector

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
MAX_REASON = 200  # characters of what rosbags says about a broken file, which may be the file

Topics = Mapping[str, str]
PlaceOf = Callable[[str, int], Array | None]


class BagDetection(NamedTuple):
    """An object that the bag's own detector has found; ``location`` [m] if it is given in an
    absolute frame.
    """

    label: str
    score: float
    box: Box
    location: tuple[float, float, float] | None = None


@dataclass
class Surroundings:
    """What a bag says beside its pictures."""

    frames: TransformTree = field(default_factory=TransformTree)
    intrinsics: dict[str, Array] = field(default_factory=dict)  # by topic of the camera_info
    fixes: list[tuple[int, Geodetic, str]] = field(default_factory=list)
    turns: list[tuple[int, Array, str]] = field(default_factory=list)
    detections: dict[int, tuple[BagDetection, ...]] = field(default_factory=dict)  # by stamp


def perceive_bag(
    path: str | Path,
    *,
    detector: "ImageDetector | None" = None,
    cameras: Sequence[str] = (),
    detections: str | None = None,
    origin: Geodetic | None = None,
    min_score: float = 0.3,
    progress: Progress | None = None,
) -> Trace:
    """The trace of a bag. Either ``detector`` looks at its pictures, or ``detections`` names a
    topic of the bag. Raises UserError.

    Parameters
    ----------
    path : str or Path
        A ROS 1 bag, an MCAP file or the folder of a ROS 2 bag.
    detector : ImageDetector, optional
        Finds the objects in the pictures.
    cameras : sequence of str
        Image topics, ``NAME=TOPIC`` to give a camera another name than the topic does; by default
        all topics that have a camera_info.
    detections : str, optional
        A topic with the objects in the pictures.
    origin : tuple, optional
        The geodetic origin (latitude [deg], longitude [deg], height [m]); by default the first fix.
    min_score : float
        Objects with a lower score are left out.
    progress : callable, optional
        Gets the number of pictures that are done, and of all.
    """
    path = Path(path)
    with _opened(path) as reader:
        topics = {connection.topic: connection.msgtype for connection in reader.connections}
        if detections is not None:
            _check_topic(path, detections, topics, ARRAYS)
        around = _surroundings(path, reader, detections)
        selected = _cameras(path, cameras, topics, around.intrinsics)
        origin, place_of = _places(path, around, origin)
        scans = sorted(topic for topic, kind in topics.items() if kind == POINTS)
        total = sum(
            connection.msgcount
            for connection in reader.connections
            if connection.topic in selected.values()
        )
        perception = _Perception(path, selected, around, place_of=place_of, detector=detector)
        frames: dict[str, list[TraceFrame]] = {}
        pictures = _pictures(path, reader, selected, scans[:1])
        for done, (camera, image, cloud) in enumerate(pictures, start=1):
            frame = perception.frame(camera, image, cloud, min_score)
            if frame is not None:
                frames.setdefault(camera, []).append(frame)
            if progress is not None:
                progress(done, total, "")
    if not frames:
        raise UserError(f"{path}: no image was taken where the car's position is known")
    detected_by: dict[str, Any] = {"detector": detections}
    if detector is not None:
        detected_by = {"detector": detector.name, "weights_sha256": detector.sha256}
    provenance = {
        "data": f"bag {path.name}",
        "bag_sha256": _digest(path),
        "parameters": {"cameras": dict(selected), "scans": scans[:1]},
        **detected_by,
    }
    return Trace(path.stem, origin, _numbered(path, frames), provenance)


@dataclass(frozen=True)
class _Perception:
    """What is needed to perceive one picture of a bag."""

    path: Path
    topics: Topics  # by the camera's name
    around: Surroundings
    place_of: PlaceOf
    detector: "ImageDetector | None"

    def frame(self, camera: str, image: Any, cloud: Any, min_score: float) -> TraceFrame | None:
        """One picture perceived; ``None`` if nobody knows where it was taken. Its stamp is still
        the bag's, and it has no number yet. ``cloud`` is the scan taken with it, or ``None``.
        """
        topic = self.topics[camera]
        stamp_ns = header_stamp_ns(image.header)
        world_SE3_camera = self.place_of(image.header.frame_id, stamp_ns)
        if world_SE3_camera is None:
            return None
        pixels = _picture(self.path, topic, image)
        size = (pixels.shape[1], pixels.shape[0])
        intrinsics = self.around.intrinsics[_info_topic(topic)]
        placement = self._placement(image, cloud, intrinsics, size)
        found: Iterable[BagDetection] = self.around.detections.get(stamp_ns, ())
        if self.detector is not None:
            found = (BagDetection(*detection) for detection in self.detector.detect(pixels))
        return trace_frame(
            camera=camera,
            index=0,
            stamp_ns=stamp_ns,
            size=size,
            digest=hashlib.sha256(bytes(image.data)).hexdigest(),
            dhash=difference_hash(pixels),
            world_SE3_camera=world_SE3_camera,
            intrinsics=intrinsics,
            detections=[
                _placed(detection, placement, world_SE3_camera)
                for detection in found
                if detection.score >= min_score
            ],
        )

    def _placement(
        self, image: Any, cloud: Any, intrinsics: Array, size: tuple[int, int]
    ) -> Placement | None:
        """Places the objects of a picture by the scan taken with it; ``None`` without one.
        ``intrinsics`` and ``size`` are the camera's matrix and the picture's width and height [px].
        """
        if cloud is None:
            return None
        camera_SE3_laser = self.around.frames.find(
            image.header.frame_id, cloud.header.frame_id, header_stamp_ns(image.header)
        )
        if camera_SE3_laser is None:
            return None
        return Placement(intrinsics, size, camera_SE3_laser, _points(self.path, cloud))


def _placed(found: BagDetection, placement: Placement | None, world_SE3_camera: Array) -> Detection:
    """An object with its place in the world, as far as it can be told."""
    location, method = None, "none"
    if found.location is not None:
        location, method = np.array(found.location), "bag"
    elif placement is not None and found.label in HALF_DEPTH_M:
        point, method = placement.place(found.label, found.box)
        location = None if point is None else transform(world_SE3_camera, point)
    return detection(found.label, found.score, found.box, location=location, method=method)


def _places(path: Path, around: Surroundings, origin: Geodetic | None) -> tuple[Geodetic, PlaceOf]:
    """The trace's origin, and a function of a frame of the car and an instant that returns
    ``world_SE3_frame``, or ``None`` where it is not known. Raises UserError.
    """
    frames, fixes, turns = around.frames, around.fixes, around.turns
    if origin is None and fixes:
        origin = fixes[0][1]
    if origin is not None and fixes and turns:
        imu = turns[0][2]
        antenna = frames.find(imu, fixes[0][2], turns[0][0])
        lever = np.zeros(3) if antenna is None else antenna[:3, 3]
        positions = Trajectory((stamp_ns, enu_SE3_enu(origin, fix)) for stamp_ns, fix, _ in fixes)
        track = Trajectory(_rig_poses(positions, turns, lever))

        def on_the_track(frame_id: str, stamp_ns: int) -> Array | None:
            imu_SE3_frame = frames.find(imu, frame_id, stamp_ns)
            world_SE3_imu = track.at(stamp_ns)
            if imu_SE3_frame is None or world_SE3_imu is None:
                return None
            return world_SE3_imu @ imu_SE3_frame

        return origin, on_the_track
    names = frames.names()
    world = next((name for name in ABSOLUTE_FRAMES if name in names), None)
    if world is None:
        raise UserError(
            f"{path}: where is the car? No {FIX} with {IMU}, and no transform from map or world"
        )
    if origin is None:
        raise UserError(f"{path}: no {FIX}: say with --origin where the frame {world!r} lies")
    return origin, partial(frames.find, world)


def _rig_poses(
    positions: Trajectory, turns: Iterable[tuple[int, Array, str]], lever: Array
) -> Iterator[tuple[int, Array]]:
    """The IMU's poses: its turns, at the antenna's position less the ``lever`` from the IMU to the
    antenna [m].
    """
    for stamp_ns, turn, _ in turns:
        world_SE3_antenna = positions.at(stamp_ns)
        if world_SE3_antenna is not None:
            yield stamp_ns, world_SE3_antenna @ rigid(turn, -turn @ lever)


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
    """An exception of a reader becomes a UserError that names the file."""
    return as_user_error(f"{path}: cannot be read as a bag", Exception, most=MAX_REASON)


def _surroundings(path: Path, reader: Any, detections: str | None) -> Surroundings:
    """Reads all that is no picture and no scan."""
    around = Surroundings()
    kinds = (*TRANSFORMS, CAMERA_INFO, FIX, IMU)
    chosen = [
        connection
        for connection in reader.connections
        if connection.msgtype in kinds or connection.topic == detections
    ]
    for connection, _, message in _messages(path, reader, chosen):
        kind, where = connection.msgtype, f"{path}: {connection.topic}"
        if kind in TRANSFORMS:
            is_static = connection.topic.endswith("static")
            for entry in message.transforms:
                _add_transform(where, around.frames, entry, is_static)
        elif kind == CAMERA_INFO:
            around.intrinsics[connection.topic] = _intrinsics(where, message)
        elif kind == FIX:
            fix = (message.latitude, message.longitude, message.altitude)
            if is_origin(fix):
                around.fixes.append((header_stamp_ns(message.header), fix, message.header.frame_id))
        elif kind == IMU:
            turn = rotation(message.orientation)
            if turn is not None:
                stamp_ns = header_stamp_ns(message.header)
                around.turns.append((stamp_ns, turn, message.header.frame_id))
        else:
            objects = tuple(_objects(message, kind))
            for found in objects:
                if not in_range((found.score, *found.box, *(found.location or ()))):
                    raise UserError(
                        f"{where}: an object whose score, box or place is no number in range"
                    )
            around.detections[header_stamp_ns(message.header)] = objects
    return around


def _add_transform(where: str, frames: TransformTree, entry: Any, is_static: bool) -> None:
    """Adds a transform of the bag. Raises UserError for one that is no place and turn."""
    translation = entry.transform.translation
    place = (translation.x, translation.y, translation.z)
    turn = rotation(entry.transform.rotation)
    parent, child = entry.header.frame_id, entry.child_frame_id
    if turn is None or not in_range(place):
        raise UserError(f"{where}: a transform to {child!r} that is no place and turn")
    if is_static:
        frames.add_static(parent, child, rigid(turn, place))
    else:
        frames.add_moving(parent, child, header_stamp_ns(entry.header), rigid(turn, place))


def _intrinsics(where: str, message: Any) -> Array:
    """The matrix (3, 3) of a camera [px]: that of rectified pictures, if there is one. Raises
    UserError.
    """
    # the fields have capitals in ROS 1
    projection = np.array(message.P if hasattr(message, "P") else message.p).reshape(3, 4)
    camera = np.array(message.K if hasattr(message, "K") else message.k).reshape(3, 3)
    intrinsics: Array = projection[:, :3] if projection[0, 0] else camera
    if not (np.isfinite(intrinsics).all() and intrinsics.diagonal().min() > 0):
        raise UserError(f"{where}: no intrinsics of a camera")
    return intrinsics


def _objects(message: Any, kind: str) -> Iterator[BagDetection]:
    """The objects of an array of detections. Locations count in ``map`` and ``world`` only."""
    if kind == OBJECTS:
        for entry in message.objects:
            frame = entry.space_frame or entry.header.frame_id or message.header.frame_id
            position = entry.pose.position
            location = (position.x, position.y, position.z)
            has_place = frame.strip("/") in ABSOLUTE_FRAMES and any(location)
            left, top = float(entry.x), float(entry.y)
            yield BagDetection(
                label=entry.label,
                score=float(entry.score),
                box=(left, top, float(entry.x + entry.width), float(entry.y + entry.height)),
                location=location if has_place else None,
            )
        return
    for entry in message.detections:
        if len(entry.results):
            # what the versions of vision_msgs call differently
            guesses = (getattr(result, "hypothesis", result) for result in entry.results)
            best = max(guesses, key=lambda guess: guess.score)
            center = getattr(entry.bbox.center, "position", entry.bbox.center)
            half_x, half_y = entry.bbox.size_x / 2, entry.bbox.size_y / 2
            yield BagDetection(
                label=str(best.class_id if hasattr(best, "class_id") else best.id),
                score=float(best.score),
                box=(center.x - half_x, center.y - half_y, center.x + half_x, center.y + half_y),
            )


def _cameras(
    path: Path, cameras: Sequence[str], topics: Mapping[str, str], intrinsics: Mapping[str, Array]
) -> Topics:
    """Image topics by the camera's name."""
    images = sorted(topic for topic, kind in topics.items() if kind in IMAGES)
    selected: dict[str, str] = {}
    for choice in cameras or [topic for topic in images if _info_topic(topic) in intrinsics]:
        name, _, topic = choice.rpartition("=")
        _check_topic(path, topic, topics, IMAGES)
        if _info_topic(topic) not in intrinsics:
            raise UserError(f"{path}: {topic}: no {_info_topic(topic)} says what the camera sees")
        name = name or _camera_topic(topic).strip("/").rpartition("/")[2] or "camera"
        if name in selected and cameras:
            raise UserError(
                f"{path}: two cameras are called {name!r}; give other names, as in left={topic}"
            )
        selected.setdefault(name, topic)  # of raw and compressed the raw one: it comes first
    if not selected:
        names = ", ".join(sorted(topics))
        raise UserError(f"{path}: no image topic with a camera_info beside it; topics: {names}")
    return selected


def _camera_topic(topic: str) -> str:
    """``/camera/image_raw/compressed`` belongs to ``/camera``."""
    return topic.removesuffix("/compressed").rpartition("/")[0]


def _info_topic(topic: str) -> str:
    return f"{_camera_topic(topic)}/camera_info"


def _check_topic(path: Path, topic: str, topics: Mapping[str, str], kinds: Sequence[str]) -> None:
    usable = sorted(name for name, kind in topics.items() if kind in kinds)
    if not usable:
        raise UserError(f"{path}: no {' or '.join(kinds)}")
    if topic not in usable:
        raise UserError(f"{path}: {unknown('topic', topic, usable)}")


def _pictures(
    path: Path, reader: Any, selected: Topics, scans: Sequence[str]
) -> Iterator[tuple[str, Any, Any]]:
    """Each image with its camera's name and the scan nearest in time (``None``: there is none
    near).
    """
    names = {topic: name for name, topic in selected.items()}
    waiting: deque[tuple[int, str, Any]] = deque()
    recent: deque[Any] = deque(maxlen=8)
    chosen = [
        connection
        for connection in reader.connections
        if connection.topic in names or connection.topic in scans
    ]

    def nearest_scan(image: Any) -> Any:
        stamp_ns = header_stamp_ns(image.header)
        by_distance = sorted(recent, key=lambda scan: abs(header_stamp_ns(scan.header) - stamp_ns))
        for scan in by_distance[:1]:
            if abs(header_stamp_ns(scan.header) - stamp_ns) <= SCAN_WITHIN_NS:
                return scan
        return None

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
            yield camera, image, nearest_scan(image)
    for _, camera, image in waiting:
        yield camera, image, nearest_scan(image)


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
    names = ["x", "y", "z"]
    offsets = {entry.name: entry.offset for entry in cloud.fields if entry.datatype == FLOAT32}
    if not set(names) <= offsets.keys():
        raise UserError(f"{path}: a {POINTS} without float32 fields x, y and z")
    float32 = ">f4" if cloud.is_bigendian else "<f4"
    data, count = bytes(cloud.data), cloud.width * cloud.height
    point_bytes = max(offsets[name] for name in names) + 4
    if len(data) < count * cloud.point_step or cloud.point_step < point_bytes:
        raise UserError(f"{path}: a {POINTS} cut short: {len(data)} bytes")
    layout = np.dtype(
        {
            "names": names,
            "formats": [float32] * 3,
            "offsets": [offsets[name] for name in names],
            "itemsize": cloud.point_step,
        }
    )
    read = np.frombuffer(data, layout, count)
    points: Array = np.column_stack([read[name] for name in names]).astype(np.float64)
    return points[np.isfinite(points).all(axis=1)]


def _numbered(
    path: Path, frames: Mapping[str, list[TraceFrame]]
) -> dict[str, tuple[TraceFrame, ...]]:
    """Frames with numbers for each camera, and stamps that begin with the first one's. Raises
    UserError.
    """
    first_ns = min(frame.stamp_ns for of_camera in frames.values() for frame in of_camera)
    numbered = [
        replace(frame, index=index, stamp_ns=frame.stamp_ns - first_ns)
        for of_camera in frames.values()
        for index, frame in enumerate(of_camera)
    ]
    return checked(path, numbered)


def _digest(path: Path) -> str:
    """The SHA-256 of a bag: of the digests of its files."""
    total = hashlib.sha256()
    for file in sorted(path.rglob("*")) if path.is_dir() else [path]:
        if file.is_file():
            with file.open("rb") as opened:
                total.update(hashlib.file_digest(opened, "sha256").digest())
    return total.hexdigest()
