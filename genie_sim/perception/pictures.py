"""A trace to look at: boxes in the pictures, a bird's-eye view of what was placed, and the object
map it makes.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import cv2
import numpy as np

from genie_sim.classes import class_of
from genie_sim.core.object_map import ObjectMap
from genie_sim.core.rules import ObjectMapRules
from genie_sim.errors import UserError
from genie_sim.messages import CameraPose, Location
from genie_sim.paths import usable
from genie_sim.perception.kitti import read_image
from genie_sim.perception.trace import Trace, TraceFrame

PANEL_PX = 480
VIEW_M = 60.0  # how far ahead the bird's-eye view reaches
VIDEO_FPS = 10.0
PAPER, INK, GRID = (250, 250, 250), (40, 40, 40), (215, 215, 215)  # blue, green, red
# Colours that people who see red and green alike can tell apart: Okabe and Ito's.
COLOURS = {"car": (178, 114, 0), "person": (0, 94, 213)}
OTHER = (115, 158, 0)

Images = Mapping[tuple[str, int], Path]  # by camera and frame number


def write_frames(
    folder: Path, trace: Trace, images: Images, progress: Callable[[int, int], None]
) -> None:
    """One PNG for each frame. UserError where the folder cannot be written."""
    with usable(folder):
        folder.mkdir(parents=True, exist_ok=True)
        for count, (frame, picture) in enumerate(drawn(trace, images), start=1):
            _, png = cv2.imencode(".png", picture)
            (folder / f"camera_{frame.camera}_{frame.index:06d}.png").write_bytes(png.tobytes())
            progress(count, _frames(trace))


def write_video(
    path: Path, trace: Trace, images: Images, progress: Callable[[int, int], None]
) -> None:
    """All frames of all cameras, one after the other, as an MP4 at 10 frames a second."""
    if path.suffix.lower() != ".mp4":
        raise UserError(f"{path}: a video's name must end in .mp4")
    path.parent.mkdir(parents=True, exist_ok=True)
    writer = None
    for count, (_, picture) in enumerate(drawn(trace, images), start=1):
        if writer is None:
            size = (picture.shape[1], picture.shape[0])
            writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), VIDEO_FPS, size)
            if not writer.isOpened():
                raise UserError(f"{path}: this OpenCV cannot write a video here; use --frames")
        writer.write(cv2.resize(picture, size))
        progress(count, _frames(trace))
    if writer is not None:
        writer.release()


def drawn(trace: Trace, images: Images) -> Iterator[tuple[TraceFrame, np.ndarray]]:
    """Each frame with its picture: the camera's image above, bird's-eye view and object map below.

    The object map is that of one Genie with the default rules that saw every frame up to this one.
    """
    for camera in sorted(trace.frames):
        object_map = ObjectMap(ObjectMapRules())
        for frame in trace.frames[camera]:
            for detection in frame.detections:
                if detection.location is not None:
                    object_map.sight(detection)
            image = _camera(frame, images.get((camera, frame.index)))
            width = max(image.shape[1] // 2, PANEL_PX)
            below = np.hstack([_birds_eye(frame, width), _map(frame, object_map, width)])
            above = np.full((image.shape[0], below.shape[1], 3), PAPER, np.uint8)
            above[:, : image.shape[1]] = image
            yield frame, np.vstack([above, below])


def _camera(frame: TraceFrame, path: Path | None) -> np.ndarray:
    image = (
        np.full((frame.height, frame.width, 3), 90, np.uint8) if path is None else read_image(path)
    )
    for detection in frame.detections:
        if detection.box is None:
            continue
        left, top, right, bottom = (round(value) for value in detection.box)
        colour = COLOURS.get(class_of(detection.label), OTHER)
        cv2.rectangle(image, (left, top), (right, bottom), color=colour, thickness=2)
        _text(
            image,
            f"{detection.label} {detection.score:.2f}",
            (left, max(10, top - 4)),
            (255, 255, 255),
        )
    _text(
        image,
        f"camera {frame.camera}, frame {frame.index}, {frame.stamp_ns / 1e9:.2f} s",
        (8, 16),
        (255, 255, 255),
    )
    return image


def _birds_eye(frame: TraceFrame, width: int) -> np.ndarray:
    """What was placed in this frame, from above: the camera at the bottom, ahead is up, rings every
    10 m.
    """
    panel = np.full((PANEL_PX, width, 3), PAPER, np.uint8)
    pixels_per_m = (PANEL_PX - 40) / VIEW_M
    foot = (width // 2, PANEL_PX - 20)
    for range_m in range(10, int(VIEW_M) + 1, 10):
        radius = round(range_m * pixels_per_m)
        cv2.circle(panel, foot, radius, color=GRID, thickness=1)
        _text(panel, f"{range_m} m", (foot[0] + 4, foot[1] - radius + 12), INK)
    for side in (-1, 1):
        angle = side * frame.horizontal_fov_rad / 2
        end = (
            foot[0] + round(2 * PANEL_PX * math.sin(angle)),
            foot[1] - round(2 * PANEL_PX * math.cos(angle)),
        )
        cv2.line(panel, foot, end, color=GRID, thickness=1)
    for detection in frame.detections:
        if detection.location is None:
            continue
        right_m, ahead_m = _from_camera(frame.pose, detection.location)
        place = (foot[0] + round(right_m * pixels_per_m), foot[1] - round(ahead_m * pixels_per_m))
        cv2.circle(
            panel,
            place,
            radius=5,
            color=COLOURS.get(class_of(detection.label), OTHER),
            thickness=-1 if detection.method == "scan" else 2,
            lineType=cv2.LINE_AA,
        )
    _text(panel, "placed in this frame (filled: by the scan, ring: by the ground)", (8, 16), INK)
    return panel


def _map(frame: TraceFrame, object_map: ObjectMap, width: int) -> np.ndarray:
    """The object map around the car, north up; the larger a dot, the more confident."""
    panel = np.full((PANEL_PX, width, 3), PAPER, np.uint8)
    pixels_per_m = PANEL_PX / (2 * VIEW_M)
    centre = (width // 2, PANEL_PX // 2)
    confident = 0
    for stored in object_map:
        right_px = round((stored.location[0] - frame.pose.east_m) * pixels_per_m)
        up_px = round((stored.location[1] - frame.pose.north_m) * pixels_per_m)
        is_confident = stored.confidence >= object_map.threshold
        confident += is_confident
        cv2.circle(
            panel,
            (centre[0] + right_px, centre[1] - up_px),
            radius=2 + round(4 * stored.confidence),
            color=COLOURS.get(class_of(stored.label), OTHER),
            thickness=-1 if is_confident else 1,
            lineType=cv2.LINE_AA,
        )
    tip = (
        centre[0] + round(14 * math.cos(frame.pose.heading_rad)),
        centre[1] - round(14 * math.sin(frame.pose.heading_rad)),
    )
    cv2.arrowedLine(
        panel, centre, tip, color=INK, thickness=2, line_type=cv2.LINE_AA, tipLength=0.5
    )
    _text(
        panel,
        f"object map: {len(object_map)} objects, {confident} with C >= {object_map.threshold:g}"
        " (filled)",
        (8, 16),
        INK,
    )
    return panel


def _from_camera(pose: CameraPose, location: Location) -> tuple[float, float]:
    """Metres to the right of the camera and ahead of it."""
    east_m, north_m = location[0] - pose.east_m, location[1] - pose.north_m
    cos, sin = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    return east_m * sin - north_m * cos, east_m * cos + north_m * sin


def _text(
    image: np.ndarray, text: str, place: tuple[int, int], colour: tuple[int, int, int]
) -> None:
    cv2.putText(
        image,
        text,
        place,
        fontFace=cv2.FONT_HERSHEY_SIMPLEX,
        fontScale=0.42,
        color=colour,
        thickness=1,
        lineType=cv2.LINE_AA,
    )


def _frames(trace: Trace) -> int:
    return sum(map(len, trace.frames.values()))
