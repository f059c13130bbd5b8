"""What a bag says beside its pictures and scans: transforms, cameras, positions, turns, and the
objects that its own detector has found.

Marks of "invalid" are heeded: a fix without a position, an IMU without an orientation, an altitude
or a stamp that is none.
"""

import bisect
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from genie_sim.base.classes import ROAD_LABELS
from genie_sim.base.errors import UserError
from genie_sim.base.geometry import Array, Geodetic, rigid
from genie_sim.base.import_report import ImportReport
from genie_sim.base.units import NS_PER_S
from genie_sim.core.messages import Box
from genie_sim.data.world_table import in_range, is_origin
from genie_sim_ros.codec import ABSOLUTE_FRAMES, OBJECTS
from genie_sim_ros.tf import TransformTree, rotation
from genie_sim_ros.typestore import stamp_ns as header_stamp_ns

FIX, IMU = "sensor_msgs/msg/NavSatFix", "sensor_msgs/msg/Imu"
TRANSFORMS, CAMERA_INFO = (
    ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage"),
    "sensor_msgs/msg/CameraInfo",
)
KINDS = (*TRANSFORMS, CAMERA_INFO, FIX, IMU)
SAME_SHAPE = 0.02  # width by height of a picture and of its camera_info may differ by this share
ANSWER_NS = 1_000_000_000  # a detector that stamps its answers gives them within this time


class BagDetection(NamedTuple):
    """An object that the bag's own detector has found; ``location`` [m] if it is given in an
    absolute frame.
    """

    label: str
    score: float
    box: Box
    location: tuple[float, float, float] | None = None


class BagCamera(NamedTuple):
    """What a ``camera_info`` says: the matrix (3, 3) [px], the width and height of the pictures
    that it is for (0: it does not say), and where in these the region of interest begins.
    """

    matrix: Array
    width: int = 0
    height: int = 0
    left: int = 0
    top: int = 0
    roi_width: int = 0

    def of_picture(self, where: str, size: tuple[int, int], report: ImportReport) -> Array:
        """The matrix for pictures of this width and height, which may have been made smaller.
        Raises UserError where they have another shape.
        """
        matrix = self.matrix.copy()
        width, height = size
        if not (self.width and self.height) or size == (self.width, self.height):
            return matrix
        if self.roi_width == width:
            matrix[:2, 2] -= (self.left, self.top)
            return matrix
        text = f"{where}: pictures of {width}x{height}, camera_info of {self.width}x{self.height}"
        scale = np.array([width / self.width, height / self.height])
        if abs(scale[0] / scale[1] - 1) > SAME_SHAPE:
            report.refuse(f"{text}: another shape, so nobody knows what was cut off")
        told = f"{text}: its matrix is scaled"
        if told not in report.warnings:
            report.warn(told)
        matrix[:2] *= scale[:, None]
        return matrix


class Stamps:
    """When messages were taken: the stamp of the header, or the time of the recording where that
    is 0.
    """

    def __init__(self) -> None:
        self._zero: Counter[str] = Counter()

    def of(self, topic: str, header: Any, at_ns: int) -> int:
        """The instant of a message that was recorded at ``at_ns``."""
        stamp_ns = header_stamp_ns(header)
        if not stamp_ns:
            self._zero[topic] += 1
        return stamp_ns or at_ns

    def tell(self, report: ImportReport) -> None:
        """Warns of stamps that are 0."""
        for topic, count in self._zero.items():
            report.warn(f"{topic}: {count:,} stamps are 0: the time of the recording is taken")


class BagDetections(NamedTuple):
    """The objects of one array, and the frame that they were seen in."""

    frame_id: str
    objects: tuple[BagDetection, ...]


@dataclass
class Surroundings:
    """What a bag says beside its pictures."""

    frames: TransformTree = field(default_factory=TransformTree)
    cameras: dict[str, BagCamera] = field(default_factory=dict)  # by topic of the camera_info
    fixes: list[tuple[int, Geodetic, str]] = field(default_factory=list)
    turns: list[tuple[int, Array, str]] = field(default_factory=list)
    detections: dict[int, BagDetections] = field(default_factory=dict)  # by stamp
    fixes_ns: list[int] = field(default_factory=list)  # when there was a fix, in order
    lost_ns: list[int] = field(default_factory=list)  # and when there was none
    unknown_headings: int = 0  # messages of an IMU that say nothing of its orientation


def is_lost(around: Surroundings, stamp_ns: int) -> bool:
    """Whether the nearest message of a position says that there is none."""
    if not around.lost_ns:
        return False
    lost_ns, known_ns = (
        min((abs(one - stamp_ns) for one in _beside(stamps_ns, stamp_ns)), default=ANSWER_NS)
        for stamps_ns in (around.lost_ns, around.fixes_ns)
    )
    return lost_ns < known_ns


def read_surroundings(
    path: Path,
    messages: Iterator[tuple[Any, int, Any]],
    stamps: Stamps,
    report: ImportReport,
    *,
    fix: str | None = None,
    imu: str | None = None,
    classes: Mapping[str, str] = {},
) -> Surroundings:
    """What the messages of a bag say that are no pictures and no scans.

    Parameters
    ----------
    path : the bag, to begin errors with
    messages : connection, time of the recording [ns] and message of each
    stamps : when they were taken
    report : is told what is left out and chosen
    fix, imu : the topics to take; ``None``: the first that has what is needed
    classes : the classes of labels that have other names

    Raises UserError for a message that cannot be.
    """
    around = Surroundings()
    fixes: dict[str, list[tuple[int, Geodetic, str]]] = {}
    turns: dict[str, list[tuple[int, Array, str]]] = {}
    lost_ns: dict[str, list[int]] = {}
    for connection, at_ns, message in messages:
        kind, topic = connection.msgtype, connection.topic
        where = f"{path}: {topic}"
        if kind in TRANSFORMS:
            is_static = topic.endswith("static")
            for entry in message.transforms:
                stamp_ns = None if is_static else stamps.of(topic, entry.header, at_ns)
                _add_transform(where, around.frames, entry, stamp_ns)
        elif kind == CAMERA_INFO:
            around.cameras[topic] = _camera(where, message)
        elif kind == FIX:
            place = (message.latitude, message.longitude, message.altitude)
            if message.status.status < 0 or not is_origin((*place[:2], 0.0)) or not any(place[:2]):
                report.leave_out(f"fixes of {topic} without a position")
                lost_ns.setdefault(topic, []).append(stamps.of(topic, message.header, at_ns))
            else:
                stamp_ns = stamps.of(topic, message.header, at_ns)
                fixes.setdefault(topic, []).append((stamp_ns, place, message.header.frame_id))
        elif kind == IMU:
            turn = rotation(message.orientation)
            if turn is None or message.orientation_covariance[0] == -1:
                report.leave_out(f"messages of {topic} without an orientation")
                around.unknown_headings += 1
            else:
                stamp_ns = stamps.of(topic, message.header, at_ns)
                turns.setdefault(topic, []).append((stamp_ns, turn, message.header.frame_id))
        else:
            objects = tuple(_known(where, _objects(message, kind), classes, report))
            stamp_ns = stamps.of(topic, message.header, at_ns)
            around.detections[stamp_ns] = BagDetections(message.header.frame_id, objects)
    fix = _chosen("fix", fix, fixes, report)
    around.fixes = _with_altitudes(fixes.get(fix, []), report)
    around.fixes_ns = sorted(entry[0] for entry in around.fixes)
    around.lost_ns = sorted(lost_ns.get(fix, []))
    around.turns = turns.get(_chosen("imu", imu, turns, report), [])
    report.check_gaps("fixes", [stamp_ns / NS_PER_S for stamp_ns in around.fixes_ns])
    return around


def _chosen(what: str, topic: str | None, topics: Collection[str], report: ImportReport) -> str:
    """The topic that was asked for by the option of this name, or the first of those that have what
    is needed.
    """
    if topic is not None or not topics:
        return topic or ""
    first = min(topics)
    report.choose(what, first, sorted(topics), f"--{what}")
    return first


def _with_altitudes(
    fixes: Sequence[tuple[int, Geodetic, str]], report: ImportReport
) -> list[tuple[int, Geodetic, str]]:
    """The fixes; one whose altitude is none has that of the nearest that has one, or 0 m."""
    known = [(stamp_ns, place[2]) for stamp_ns, place, _ in fixes if is_origin(place)]
    if len(known) < len(fixes):
        instead = "that of the fix before is taken" if known else "0 m is taken"
        report.warn(f"{len(fixes) - len(known):,} fixes have no altitude: {instead}")
    whole, altitude_m = [], known[0][1] if known else 0.0
    for stamp_ns, place, frame in fixes:
        altitude_m = place[2] if is_origin(place) else altitude_m
        whole.append((stamp_ns, (place[0], place[1], altitude_m), frame))
    return whole


def match_images(
    topic: str, around: Surroundings, images_ns: Sequence[int], report: ImportReport
) -> None:
    """Brings the arrays of a detector to the stamps of the images (in order) that they are about.

    Raises UserError where most have stamps of their own; if that is accepted, such an array is
    about the image before it.
    """
    unmatched = [stamp_ns for stamp_ns in around.detections if stamp_ns not in set(images_ns)]
    report.read(f"arrays of {topic}", len(around.detections))
    if 2 * len(unmatched) <= len(around.detections):
        report.leave_out("arrays with the stamp of no image", len(unmatched))
        return
    nearest_ns = min(
        (
            abs(image_ns - stamp_ns)
            for stamp_ns in unmatched
            for image_ns in _beside(images_ns, stamp_ns)
        ),
        default=0,
    )
    report.refuse(
        f"{topic}: {len(unmatched):,} of {len(around.detections):,} arrays have the stamp of no "
        f"image (the nearest is {nearest_ns / 1e6:.3g} ms away): the detector stamps its answers, "
        "so each would count for the image before it"
    )
    for stamp_ns in unmatched:
        array = around.detections.pop(stamp_ns)
        before = bisect.bisect_right(images_ns, stamp_ns) - 1
        if before >= 0 and stamp_ns - images_ns[before] <= ANSWER_NS:
            around.detections.setdefault(images_ns[before], array)


def _beside(images_ns: Sequence[int], stamp_ns: int) -> Sequence[int]:
    after = bisect.bisect_left(images_ns, stamp_ns)
    return images_ns[max(after - 1, 0) : after + 1]


def _add_transform(where: str, frames: TransformTree, entry: Any, stamp_ns: int | None) -> None:
    """Adds a transform of the bag; without a stamp it always holds. Raises UserError for one that
    is no place and turn.
    """
    translation = entry.transform.translation
    place = (translation.x, translation.y, translation.z)
    turn = rotation(entry.transform.rotation)
    parent, child = entry.header.frame_id, entry.child_frame_id
    if turn is None or not in_range(place):
        raise UserError(f"{where}: a transform to {child!r} that is no place and turn")
    if stamp_ns is None:
        frames.add_static(parent, child, rigid(turn, place))
    else:
        frames.add_moving(parent, child, stamp_ns, rigid(turn, place))


def _camera(where: str, message: Any) -> BagCamera:
    """A camera, with the matrix of rectified pictures, if there is one. Raises UserError."""
    # the fields have capitals in ROS 1
    projection = np.array(message.P if hasattr(message, "P") else message.p).reshape(3, 4)
    camera = np.array(message.K if hasattr(message, "K") else message.k).reshape(3, 3)
    matrix: Array = projection[:, :3] if projection[0, 0] else camera
    if not (np.isfinite(matrix).all() and matrix.diagonal().min() > 0):
        raise UserError(f"{where}: no intrinsics of a camera")
    roi = message.roi
    return BagCamera(
        matrix,
        width=int(message.width),
        height=int(message.height),
        left=int(roi.x_offset),
        top=int(roi.y_offset),
        roi_width=int(roi.width),
    )


def _known(
    where: str,
    objects: Iterator[BagDetection],
    classes: Mapping[str, str],
    report: ImportReport,
) -> Iterator[BagDetection]:
    """The objects of known classes. Raises UserError for one that is no object."""
    for bag_detection in objects:
        if not in_range((bag_detection.score, *bag_detection.box, *(bag_detection.location or ()))):
            raise UserError(f"{where}: an object whose score, box or place is no number in range")
        label = classes.get(bag_detection.label, bag_detection.label)
        if label in ROAD_LABELS:
            report.read("objects", 1)
            yield bag_detection._replace(label=label)
        else:
            report.leave_label(label)


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
