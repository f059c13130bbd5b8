"""KITTI's tracking benchmark: sequences of labels, positions and published detections become
traces, without pictures.

A published detector saw the pictures or scans; its boxes and scores are read here. PointRCNN gives
boxes in space, so its objects stand where the laser saw them; RRC gives boxes in the picture,
placed by where they meet flat ground.
"""

import hashlib
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from genie_sim.base.errors import UserError, unknown
from genie_sim.base.paths import read_bytes
from genie_sim.core.geometry import Array, Geodetic, inverse, rigid, transform
from genie_sim.core.messages import Box, Detection, Location
from genie_sim.data.files import matrices, named_rows, numbers, picture_size
from genie_sim.data.geodesy import read_oxts, world_SE3_imu
from genie_sim.data.placement import Placement
from genie_sim.data.trace import Trace, detection, trace_frame

TRACKING = "tracking/"  # so the name of a drive begins that is a sequence of the benchmark
CAMERA = "02"  # the benchmark's labels and detections are those of the left colour camera
FRAME_NS = 100_000_000  # KITTI records at 10 Hz; tracking sequences carry no time stamps
# Matrices, as KITTI spells them (the benchmark's files do it in two ways), and how many columns
# they have.
CALIBRATION = (
    (("P2",), 4),
    (("R0_rect", "R_rect"), 3),
    (("Tr_velo_to_cam", "Tr_velo_cam"), 4),
    (("Tr_imu_to_velo", "Tr_imu_velo"), 4),
)
ATTRIBUTION = (
    "KITTI Vision Benchmark Suite, tracking: A. Geiger, P. Lenz, R. Urtasun, "
    "'Are we ready for Autonomous Driving?', CVPR 2012, "
    "https://www.cvlibs.net/datasets/kitti/, CC BY-NC-SA 3.0; detections as published with "
    "AB3DMOT and DeepFusionMOT"
)

# PointRCNN's scores are logits from -0.85 to 15.6. A detection is right with probability 1 / (1 +
# exp(-(a logit + b))): (a, b) by logistic regression on the labels of 15 sequences
# (tools/make/pointrcnn_scores.py). On sequences left out of the fit the mean gap between score and
# share of right ones is 0.01 to 0.02 for cars, 0.08 to 0.09 for persons; that of the plain sigmoid
# is 0.18 to 0.37.
POINTRCNN_SCORES = {"car": (1.05, -3.15), "person": (1.21, -2.54)}
LABELS_OF = {"Car": "car", "Pedestrian": "person"}


@dataclass(frozen=True, slots=True)
class TrackingDrive:
    """One sequence: where the rectified camera 0, whose frame the labels are in, was at each frame.

    ``intrinsics`` are those of camera 2 and ``camera2_SE3_camera0`` where it looks from; ``size``
    is that of its pictures (width, height).
    """

    name: str
    origin: Geodetic
    world_SE3_camera0: tuple[Array, ...]
    camera2_SE3_camera0: Array
    camera2_SE3_velo: Array
    intrinsics: Array
    size: tuple[int, int]

    def world_SE3_camera2(self, frame: int) -> Array:
        return self.world_SE3_camera0[frame] @ inverse(self.camera2_SE3_camera0)


def sequences(training: Path) -> list[str]:
    """The names of all sequences in ``training``, which holds ``oxts``."""
    return sorted(path.stem for path in (training / "oxts").glob("*.txt"))


def open_sequence(
    training: str | Path, sequence: str, origin: Geodetic | None = None
) -> TrackingDrive:
    """A sequence such as ``0005``; ``training`` holds ``oxts`` and ``calib``. UserError for files
    that are broken.
    """
    training = Path(training)
    choices = sequences(training)
    if sequence not in choices:
        raise UserError(f"{training}: {unknown('tracking sequence', sequence, choices)}")
    oxts = read_oxts(training / "oxts" / f"{sequence}.txt")
    path = training / "calib" / f"{sequence}.txt"
    projection, rectification, velo, imu = matrices(path, named_rows(path), CALIBRATION)
    intrinsics, shift = projection[:, :3], projection[:, 3]
    camera0_SE3_velo = rigid(rectification, (0, 0, 0)) @ rigid(velo[:, :3], velo[:, 3])
    imu_SE3_camera0 = np.linalg.inv(camera0_SE3_velo @ rigid(imu[:, :3], imu[:, 3]))
    if origin is None:
        latitude, longitude, altitude = oxts[0, :3].tolist()
        origin = (latitude, longitude, altitude)
    camera2_SE3_camera0 = rigid(np.eye(3), np.linalg.solve(intrinsics, shift))
    return TrackingDrive(
        name=sequence,
        origin=origin,
        world_SE3_camera0=tuple(world_SE3_imu(packet, origin) @ imu_SE3_camera0 for packet in oxts),
        camera2_SE3_camera0=camera2_SE3_camera0,
        camera2_SE3_velo=camera2_SE3_camera0 @ camera0_SE3_velo,
        intrinsics=intrinsics,
        size=_picture_size(path, training / "image_02" / sequence, float(intrinsics[0, 0])),
    )


def tracking_trace(
    root: str | Path,
    sequence: str,
    detections: str = "pointrcnn",
    *,
    min_score: float = 0.3,
    origin: Geodetic | None = None,
) -> Trace:
    """The trace of a tracking sequence such as ``0005``, with the detections that a detector's
    authors published.

    There are no pictures: a frame's digest and dhash stand for its detections, so that two frames
    are never the same picture. Raises UserError.

    Parameters
    ----------
    root : the folder that holds ``training`` and ``detections``
    sequence : its number
    detections : the name of the published detector
    min_score : the lowest score kept
    origin : of the world; ``None``: the sequence's first fix
    """
    if detections not in PUBLISHED:
        raise UserError(f"{root}: {unknown('published detector', detections, PUBLISHED)}")
    root = Path(root)
    drive = open_sequence(root / "training", sequence, origin)
    by_frame: list[list[Detection]] = [[] for _ in drive.world_SE3_camera0]
    total = hashlib.sha256()
    for kind, label in LABELS_OF.items():
        path = root / "detections" / f"{detections}_{kind}" / f"{sequence}.txt"
        total.update(read_bytes(path))
        for index, published in _published(path, detections, label, drive):
            by_frame[index].append(published)
    frames = []
    for index, detected in enumerate(by_frame):
        likely = sorted(
            (d for d in detected if d.score >= min_score),
            key=lambda d: (-d.score, d.label, d.box or ()),
        )
        digest = hashlib.sha256(f"tracking/{sequence}/{detections}/{index}".encode()).hexdigest()
        frames.append(
            trace_frame(
                camera=CAMERA,
                index=index,
                stamp_ns=index * FRAME_NS,
                size=drive.size,
                digest=digest,
                dhash=int(digest[:16], 16),
                world_SE3_camera=drive.world_SE3_camera2(index),
                intrinsics=drive.intrinsics,
                detections=likely,
            )
        )
    provenance = {
        "data": ATTRIBUTION,
        "drive": f"tracking/{sequence}",
        "detector": detections,
        "detections_sha256": total.hexdigest(),
        "parameters": {
            "min_score": min_score,
            "pictures": False,
            "pointrcnn_scores": POINTRCNN_SCORES,
        },
    }
    return Trace(
        f"tracking_{sequence}_{detections}", drive.origin, {CAMERA: tuple(frames)}, provenance
    )


def _published(
    path: Path, detector: str, label: str, drive: TrackingDrive
) -> Iterator[tuple[int, Detection]]:
    """Frame number and detection of each line of a file."""
    columns, read = PUBLISHED[detector]
    no_scan = Placement(drive.intrinsics, drive.size, drive.camera2_SE3_velo, None)
    for row in numbers(path, columns).tolist():
        index = int(row[0])
        if row[0] != index:
            raise UserError(f"{path}: {row[0]} is no frame number")
        if not 0 <= index < len(drive.world_SE3_camera0):
            raise UserError(f"{path}: frame {index} has no line in oxts")
        score, box, centre = read(row, label)
        if not 0 <= score <= 1:
            raise UserError(f"{path}: score {score} is not between 0 and 1")
        if box[2] < box[0] or box[3] < box[1]:
            raise UserError(f"{path}: box {box} ends before it begins")
        if centre is None:
            point, method = no_scan.place(label, box)
            place = None if point is None else transform(drive.world_SE3_camera2(index), point)
        else:
            place, method = transform(drive.world_SE3_camera0[index], centre), "scan"
        yield index, detection(label, score, box, place, method=method)


def _pointrcnn(row: list[float], label: str) -> tuple[float, Box, Location | None]:
    """Of ``frame,type,x1,y1,x2,y2,score,h,w,l,x,y,z,ry,alpha``; x, y, z is the middle of the
    bottom.
    """
    a, b = POINTRCNN_SCORES[label]
    score = 1.0 / (1.0 + math.exp(-(a * min(max(row[6], -50.0), 50.0) + b)))
    return score, (row[2], row[3], row[4], row[5]), (row[10], row[11] - row[7] / 2, row[12])


def _rrc(row: list[float], label: str) -> tuple[float, Box, Location | None]:
    """Of ``frame,x1,y1,x2,y2,score``, the score in [0, 1]."""
    return row[5], (row[1], row[2], row[3], row[4]), None


# How many columns a file of a published detector has; score, box and, in the frame of the rectified
# camera 0, centre.
PUBLISHED = {"pointrcnn": (15, _pointrcnn), "rrc": (6, _rrc)}


def _picture_size(calibration: Path, pictures: Path, focal_px: float) -> tuple[int, int]:
    """Width and height of a sequence's pictures: by the day that has this focal length, else those
    of a picture.
    """
    known = picture_size(focal_px)
    if known is not None:
        return known
    picture = next(
        iter(sorted(path for path in pictures.glob("*") if path.suffix in (".png", ".jpg"))), None
    )
    if picture is None:
        raise UserError(
            f"{calibration}: P2: how large are the pictures? None of KITTI's days has a focal "
            f"length of {focal_px:g} pixels: put one picture into {pictures}"
        )
    from genie_sim.data.kitti import read_image

    height, width = read_image(picture).shape[:2]
    return width, height
