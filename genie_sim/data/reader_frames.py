"""Frames and detections as readers of other people's files make them for ``intake.traces``."""

import hashlib
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

from genie_sim.base.geometry import Array, heading_of, horizontal_fov_rad, transform
from genie_sim.core.messages import Box, CameraPose, Detection
from genie_sim.data.trace import (
    IMAGE_HEADER_BYTES,
    PIXEL_DECIMALS,
    POSITION_DECIMALS,
    SCORE_DECIMALS,
    TraceFrame,
    rounded,
)

if TYPE_CHECKING:
    from genie_sim.data.detectors.boxes import DetectedBox
    from genie_sim.data.detectors.placement import Placement
    from genie_sim.data.encoding import Picture

COUNTED = -1  # the number of a frame until ``traces`` counts it


def new_detection(
    label: str, score: float, box: Box | None, location: Array | None, *, placed_by: str
) -> Detection:
    """A detection as a trace keeps it.

    Parameters
    ----------
    label : its class
    score : in [0, 1]
    box : left, top, right and bottom [pixels]; ``None`` where there is no picture
    location : of the object's centre in the world, (3,) [m]
    placed_by : what tells the place, such as ``scan``
    """
    rounded_score = round(float(score), SCORE_DECIMALS)
    return Detection(
        label,
        rounded_score,
        box=None if box is None else rounded(box, PIXEL_DECIMALS),
        location=None if location is None else rounded(location, POSITION_DECIMALS),
        confidence=rounded_score,
        placed_by=placed_by,
    )


def placed(box: "DetectedBox", placement: "Placement | None", world_SE3_camera: Array) -> Detection:
    """The detection of a box, where the scan's points in it or the ground below it are; without a
    place where there is no ``placement``.
    """
    label, score, corners = box
    point, placed_by = (None, "none") if placement is None else placement.place(label, corners)
    location = None if point is None else transform(world_SE3_camera, point)
    return new_detection(label, score, corners, location, placed_by=placed_by)


def picture_frame(
    *,
    camera: str,
    stamp_ns: int,
    picture: "Picture",
    world_SE3_camera: Array,
    intrinsics: Array,
    index: int | None = None,
    detections: Iterable[Detection] = (),
    features: Mapping[str, bytes] = {},
) -> TraceFrame:
    """A frame of a camera, for ``traces``.

    Parameters
    ----------
    stamp_ns : on the reader's own clock
    picture : what ``picture_of`` gives
    world_SE3_camera : where the camera is, (4, 4)
    intrinsics : of the camera, (3, 3)
    index : the frame's number in the drive; ``None``: frames are counted, camera by camera
    features : those of the detector's network
    camera, detections : as in ``TraceFrame``
    """
    width, height = picture.size
    east_m, north_m, up_m = world_SE3_camera[:3, 3].tolist()
    picture_bytes = width * height * 3 if picture.size_bytes is None else picture.size_bytes
    return TraceFrame(
        camera=camera,
        index=COUNTED if index is None else index,
        stamp_ns=stamp_ns,
        width=width,
        height=height,
        size_bytes=picture_bytes + IMAGE_HEADER_BYTES,
        digest=picture.digest,
        dhash=picture.dhash,
        pose=CameraPose(east_m, north_m, up_m, heading_of(world_SE3_camera[:3, 2])),
        horizontal_fov_rad=horizontal_fov_rad(intrinsics, width),
        detections=tuple(detections),
        features={**picture.features, **features},
    )


def scan_frame(
    *,
    camera: str,
    stamp_ns: int,
    size_bytes: int,
    key: str,
    pose: CameraPose,
    horizontal_fov_rad: float,
    detections: Iterable[Detection],
) -> TraceFrame:
    """A frame of a lidar, which has no picture, for ``traces``.

    Parameters
    ----------
    stamp_ns : on the reader's own clock
    size_bytes : of the scan
    key : tells this frame from every other: no two are the same picture
    camera, pose, horizontal_fov_rad, detections : as in ``TraceFrame``
    """
    digest = hashlib.sha256(key.encode()).hexdigest()
    return TraceFrame(
        camera=camera,
        index=COUNTED,
        stamp_ns=stamp_ns,
        width=0,
        height=0,
        size_bytes=size_bytes,
        digest=digest,
        dhash=int(digest[:16], 16),
        pose=pose,
        horizontal_fov_rad=horizontal_fov_rad,
        detections=tuple(detections),
        kind="lidar",
    )
