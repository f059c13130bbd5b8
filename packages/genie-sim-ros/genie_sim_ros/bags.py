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
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from genie_sim.extend import (
    NS_PER_S,
    Array,
    DetectedBox,
    Detection,
    Geodetic,
    ImageDetector,
    ImportReport,
    Placement,
    Plane,
    Progress,
    Trace,
    TraceFrame,
    UserError,
    as_user_error,
    detector_facts,
    enu_SE3_enu,
    fit_ground,
    look,
    new_detection,
    picture_frame,
    picture_of,
    placed,
    rigid,
    tell_network,
    traces,
    unknown,
)
from genie_sim_ros.codec import ABSOLUTE_FRAMES, IMAGE, OBJECTS, picture
from genie_sim_ros.surroundings import (
    FIX,
    IMU,
    KINDS,
    BagDetection,
    Stamps,
    Surroundings,
    is_lost,
    match_images,
    read_surroundings,
)
from genie_sim_ros.tf import Trajectory
from genie_sim_ros.typestore import typestore

IMAGES = (IMAGE, "sensor_msgs/msg/CompressedImage")
POINTS = "sensor_msgs/msg/PointCloud2"
ARRAYS = (OBJECTS, "vision_msgs/msg/Detection2DArray")
DEPTH = ("16UC1", "16SC1", "32FC1", "mono16")  # encodings of distances, at which nobody looks
SCAN_WITHIN_NS = 60_000_000  # half a turn of a laser at 10 Hz, and a little
WAIT_NS = 300_000_000  # for the scan that was taken with an image
FLOAT32 = 7
USUAL_LASER_M = 1.73  # above the road, assumed: as on the roof of KITTI's car
STEEPEST = 0.7  # the sine of the steepest angle at which a camera of a car looks up or down
MAX_REASON = 200  # characters of what rosbags says about a broken file, which may be the file

Topics = Mapping[str, str]
PlaceOf = Callable[[str, int], Array | None]


class BagTopics(NamedTuple):
    """Which of several sensors of a kind to take; ``None``: the first that has what is needed.

    ``imu`` and ``fix`` say where the car is, ``lidar`` places objects.
    """

    imu: str | None = None
    fix: str | None = None
    lidar: str | None = None


ANY_TOPICS = BagTopics()


def perceive_bag(
    path: str | Path,
    *,
    detector: ImageDetector | None = None,
    cameras: Sequence[str] = (),
    detections: str | None = None,
    origin: Geodetic | None = None,
    min_score: float = 0.3,
    progress: Progress | None = None,
    sensors: BagTopics = ANY_TOPICS,
    laser_height_m: float = USUAL_LASER_M,
    classes: Mapping[str, str] = {},
    report: ImportReport | None = None,
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
    sensors : BagTopics
        Which of several sensors to take.
    laser_height_m : float
        How high above the road the laser is, to half a metre.
    classes : mapping
        The classes of labels of ``detections`` that have other names.
    report : ImportReport, optional
        Is told what was read, left out and chosen.
    """
    path = Path(path)
    report, stamps = report or ImportReport(path), Stamps()
    with _opened(path) as reader:
        topics = {connection.topic: connection.msgtype for connection in reader.connections}
        if detections is not None:
            _check_topic(path, detections, topics, ARRAYS)
        for topic, kind in zip(sensors, (IMU, FIX, POINTS), strict=True):
            if topic is not None:
                _check_topic(path, topic, topics, (kind,))
        beside = [
            connection
            for connection in reader.connections
            if connection.msgtype in KINDS or connection.topic == detections
        ]
        around = read_surroundings(
            path,
            _messages(path, reader, beside),
            stamps,
            report,
            fix=sensors.fix,
            imu=sensors.imu,
            classes=classes,
        )
        selected = _cameras(path, reader, cameras, topics, around=around, report=report)
        origin, place_of = _places(path, around, origin, report)
        if detections is not None:
            match_images(detections, around, _image_stamps(path, reader, selected), report)
        scans = sorted(topic for topic, kind in topics.items() if kind == POINTS)
        scan = sensors.lidar or next(iter(scans), None)
        if scan is not None:
            report.choose("lidar", scan, scans, "--lidar")
        total = sum(
            connection.msgcount
            for connection in reader.connections
            if connection.topic in selected.values()
        )
        perception = _Perception(
            path,
            selected,
            around,
            place_of=place_of,
            detector=detector,
            report=report,
            laser_height_m=laser_height_m,
        )
        frames: list[TraceFrame] = []
        shots = _pictures(path, reader, selected, scan=scan, stamps=stamps)
        for done, shot in enumerate(shots, start=1):
            frame = perception.frame(shot, min_score)
            if frame is None:
                report.leave_out("images taken where the position is not known")
            else:
                frames.append(frame)
            if progress is not None:
                progress(done, total, "")
    stamps.tell(report)
    if not frames:
        raise UserError(
            f"{path}: no image was taken where the car's position is known: "
            f"{perception.when(around)}"
        )
    if perception.without_ground:
        report.warn(
            f"{perception.without_ground:,} scans show no ground about {laser_height_m:g} m below "
            "the laser, where it is looked for: places of objects may be wrong; --laser-height "
            "says how high it is"
        )
    tell_network(report, detector)
    provenance = {
        "data": f"bag {path.name}",
        "bag_sha256": _digest(path),
        "parameters": {
            "cameras": dict(selected),
            "scans": [scan] if scan else [],
            "min_score": min_score,
        },
        **({"detector": detections} if detector is None else detector_facts(detector)),
    }
    name = path.stem
    imported = traces({name: frames}, origin=origin, provenance=provenance, report=report)
    return imported[name].trace


class _BagPicture(NamedTuple):
    """One picture of a bag: its camera, when it was taken, the message, and the scan taken with
    it, or ``None``.
    """

    camera: str
    stamp_ns: int
    image: Any
    cloud: Any


@dataclass
class _Perception:
    """What is needed to perceive one picture of a bag."""

    path: Path
    topics: Topics  # by the camera's name
    around: Surroundings
    place_of: PlaceOf
    detector: ImageDetector | None
    report: ImportReport
    laser_height_m: float
    steep: set[str] = field(default_factory=set)  # cameras that look up or down
    without_ground: int = 0  # scans
    first_ns: int = 0
    last_ns: int = 0

    def frame(self, shot: _BagPicture, min_score: float) -> TraceFrame | None:
        """One picture perceived; ``None`` if nobody knows where it was taken. Its stamp is still
        the bag's.
        """
        camera, stamp_ns, image, _ = shot
        topic = self.topics[camera]
        self.first_ns, self.last_ns = self.first_ns or stamp_ns, stamp_ns
        world_SE3_camera = self.place_of(image.header.frame_id, stamp_ns)
        if world_SE3_camera is None:
            return None
        if abs(world_SE3_camera[2, 2]) > STEEPEST and camera not in self.steep:
            self.steep.add(camera)
            self.report.refuse(
                f"{camera}: looks up or down: is its frame {image.header.frame_id!r} optical, z "
                "ahead and x to the right?"
            )
        pixels = _picture(self.path, topic, image)
        picture, pixels = picture_of(pixels, bytes(image.data))
        bag_camera = self.around.cameras[_info_topic(topic)]
        intrinsics = bag_camera.of_picture(topic, picture.size, self.report)
        placement = self._placement(shot, intrinsics, picture.size)
        bag_detections: Iterable[BagDetection] = self._of_bag(image.header.frame_id, stamp_ns)
        features: Mapping[str, bytes] = {}
        if self.detector is not None:
            boxes, features = look(pixels, self.detector)
            bag_detections = (BagDetection(*box) for box in boxes)
        return picture_frame(
            camera=camera,
            stamp_ns=stamp_ns,
            picture=picture,
            world_SE3_camera=world_SE3_camera,
            intrinsics=intrinsics,
            detections=[
                _placed(detection, placement, world_SE3_camera)
                for detection in bag_detections
                if detection.score >= min_score
            ],
            features=features,
        )

    def _of_bag(self, frame_id: str, stamp_ns: int) -> Iterable[BagDetection]:
        """What the bag's own detector has found in a picture; of several cameras only in its."""
        array = self.around.detections.get(stamp_ns)
        if array is None or (len(self.topics) > 1 and array.frame_id not in ("", frame_id)):
            return ()
        return array.objects

    def _placement(
        self, shot: _BagPicture, intrinsics: Array, size: tuple[int, int]
    ) -> Placement | None:
        """Places the objects of a picture by the scan taken with it; ``None`` without one.
        ``intrinsics`` and ``size`` are the camera's matrix and the picture's width and height [px].
        """
        if shot.cloud is None:
            return None
        camera_SE3_laser = self.around.frames.find(
            shot.image.header.frame_id, shot.cloud.header.frame_id, shot.stamp_ns
        )
        if camera_SE3_laser is None:
            self.report.leave_out("scans that no transform joins with the camera")
            return None
        points = _points(self.path, shot.cloud)
        ground = fit_ground(points, self.laser_height_m)
        if ground is None:
            self.without_ground += 1
            ground = Plane((0.0, 0.0), -self.laser_height_m)
        return Placement(intrinsics, size, camera_SE3_laser, points, ground=ground)

    def when(self, around: Surroundings) -> str:
        """When there are pictures and when positions."""
        images = f"images from {self.first_ns / 1e9:.3f} to {self.last_ns / 1e9:.3f} s"
        stamps_ns = [entry[0] for entry in around.fixes]
        if not stamps_ns:
            return images
        return f"{images}, fixes from {min(stamps_ns) / 1e9:.3f} to {max(stamps_ns) / 1e9:.3f} s"


def _placed(
    bag_detection: BagDetection, placement: Placement | None, world_SE3_camera: Array
) -> Detection:
    """An object with its place in the world, as far as it can be told."""
    label, score, box, place = bag_detection
    if place is None:
        return placed(DetectedBox(label, score, box), placement, world_SE3_camera)
    return new_detection(label, score, box, np.array(place), placed_by="bag")


def _places(
    path: Path, around: Surroundings, origin: Geodetic | None, report: ImportReport | None = None
) -> tuple[Geodetic, PlaceOf]:
    """The trace's origin, and a function of a frame of the car and an instant that returns
    ``world_SE3_frame``, or ``None`` where it is not known. Raises UserError.
    """
    frames, fixes, turns = around.frames, around.fixes, around.turns
    if origin is None and fixes:
        origin = fixes[0][1]
    worlds = [name for name in ABSOLUTE_FRAMES if name in frames.names()]
    if origin is not None and fixes and turns:
        if report is not None:
            sources = ["fixes and turns", *[f"transforms from {name}" for name in worlds]]
            report.choose("position", sources[0], sources)
        imu = turns[0][2]
        antenna = frames.find(imu, fixes[0][2], turns[0][0])
        lever = np.zeros(3) if antenna is None else antenna[:3, 3]
        positions = Trajectory((stamp_ns, enu_SE3_enu(origin, fix)) for stamp_ns, fix, _ in fixes)
        track = Trajectory(_rig_poses(positions, turns, lever))

        def on_the_track(frame_id: str, stamp_ns: int) -> Array | None:
            if is_lost(around, stamp_ns):
                return None
            imu_SE3_frame = frames.find(imu, frame_id, stamp_ns)
            world_SE3_imu = track.at(stamp_ns)
            if imu_SE3_frame is None or world_SE3_imu is None:
                return None
            return world_SE3_imu @ imu_SE3_frame

        return origin, on_the_track
    world = next(iter(worlds), None)
    if world is None:
        no_imu = IMU
        if fixes and around.unknown_headings:
            no_imu = f"{IMU} that says its orientation, so that the heading is not known"
        raise UserError(
            f"{path}: where is the car? No {FIX} with {no_imu}, and no transform from map or world"
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


def _cameras(
    path: Path,
    reader: Any,
    cameras: Sequence[str],
    topics: Mapping[str, str],
    *,
    around: Surroundings,
    report: ImportReport,
) -> Topics:
    """Image topics by the camera's name."""
    images = sorted(topic for topic, kind in topics.items() if kind in IMAGES)
    selected: dict[str, str] = {}
    for choice in cameras:
        name, _, topic = choice.rpartition("=")
        _check_topic(path, topic, topics, IMAGES)
        if _info_topic(topic) not in around.cameras:
            raise UserError(f"{path}: {topic}: no {_info_topic(topic)} says what the camera sees")
        if _is_depth(path, reader, topic):
            raise UserError(f"{path}: {topic}: holds distances, not a picture for a detector")
        name = name or _names([topic])[topic]
        if name in selected:
            raise UserError(
                f"{path}: two cameras are called {name!r}; give other names, as in left={topic}"
            )
        selected[name] = topic
    if cameras:
        return selected
    of_camera: dict[str, list[str]] = {}
    for topic in images:
        if _info_topic(topic) not in around.cameras:
            report.leave_out(f"topic {topic}: no camera_info")
        elif _is_depth(path, reader, topic):
            report.leave_out(f"topic {topic}: distances, no picture")
        else:
            of_camera.setdefault(_camera_topic(topic), []).append(topic)
    for same in of_camera.values():  # the raw one comes before the compressed one
        report.choose("images", same[0], same, "--topic")
    names = _names([same[0] for same in of_camera.values()])
    if not names:
        listed = ", ".join(sorted(topics))
        raise UserError(f"{path}: no image topic with a camera_info beside it; topics: {listed}")
    return {name: topic for topic, name in names.items()}


def _names(topics: Sequence[str]) -> dict[str, str]:
    """What cameras are called, by topic: the last part of its name, or, where several would have
    one name, all parts.
    """
    parts = {topic: _camera_topic(topic).strip("/").split("/") for topic in topics}
    last = [names[-1] for names in parts.values()]
    return {
        topic: (names[-1] if last.count(names[-1]) == 1 else "_".join(names)) or "camera"
        for topic, names in parts.items()
    }


def _is_depth(path: Path, reader: Any, topic: str) -> bool:
    """Whether the first image of a topic holds distances."""
    chosen = [connection for connection in reader.connections if connection.topic == topic]
    for _, _, message in _messages(path, reader, chosen):
        kind = str(getattr(message, "encoding", getattr(message, "format", "")))
        return "compressedDepth" in kind or kind.partition(";")[0].strip() in DEPTH
    return False


def _image_stamps(path: Path, reader: Any, selected: Topics) -> list[int]:
    """The stamps of the images, in order; their pixels are not looked at."""
    chosen = [one for one in reader.connections if one.topic in selected.values()]
    stamps_ns = []
    with _readable(path):
        for _, at_ns, raw in reader.messages(chosen) if chosen else ():
            # Behind 4 bytes (ROS 1: a number; ROS 2: how it is encoded) seconds and nanoseconds.
            seconds, nanoseconds = np.frombuffer(bytes(raw[4:12]), "<u4").tolist()
            stamps_ns.append(seconds * NS_PER_S + nanoseconds or at_ns)
    return sorted(stamps_ns)


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
    path: Path, reader: Any, selected: Topics, *, scan: str | None, stamps: Stamps
) -> Iterator[_BagPicture]:
    """Each image with its camera's name and the scan nearest in time (``None``: there is none
    near).
    """
    names = {topic: name for name, topic in selected.items()}
    waiting: deque[tuple[int, _BagPicture]] = deque()
    recent: deque[tuple[int, Any]] = deque(maxlen=8)
    chosen = [
        connection
        for connection in reader.connections
        if connection.topic in names or connection.topic == scan
    ]

    def with_scan(shot: _BagPicture) -> _BagPicture:
        by_distance = sorted(recent, key=lambda scan: abs(scan[0] - shot.stamp_ns))
        for scan_ns, cloud in by_distance[:1]:
            if abs(scan_ns - shot.stamp_ns) <= SCAN_WITHIN_NS:
                return shot._replace(cloud=cloud)
        return shot

    for connection, at_ns, message in _messages(path, reader, chosen):
        topic = connection.topic
        stamp_ns = stamps.of(topic, message.header, at_ns)
        if topic in names:
            waiting.append((at_ns, _BagPicture(names[topic], stamp_ns, message, None)))
        else:
            recent.append((stamp_ns, message))
        newest_ns = recent[-1][0] if recent else 0
        while waiting:
            since_ns, shot = waiting[0]
            if scan and newest_ns < shot.stamp_ns and at_ns - since_ns < WAIT_NS:
                break
            waiting.popleft()
            yield with_scan(shot)
    for _, shot in waiting:
        yield with_scan(shot)


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


def _digest(path: Path) -> str:
    """The SHA-256 of a bag: of the digests of its files."""
    total = hashlib.sha256()
    for file in sorted(path.rglob("*")) if path.is_dir() else [path]:
        if file.is_file():
            with file.open("rb") as opened:
                total.update(hashlib.file_digest(opened, "sha256").digest())
    return total.hexdigest()
