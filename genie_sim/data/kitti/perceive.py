"""Frames to a trace: every picture of a drive through a detector, every box placed in the world."""

import os
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from genie_sim.base.classes import SIZES, VEHICLES
from genie_sim.base.errors import UserError
from genie_sim.base.geometry import Geodetic
from genie_sim.base.import_report import ImportReport
from genie_sim.base.paths import expanded
from genie_sim.base.progress import Progress
from genie_sim.data.detectors import placement
from genie_sim.data.detectors.boxes import NMS_IOU
from genie_sim.data.detectors.detector import DetectorSettings, detector_facts
from genie_sim.data.detectors.image_detector import ImageDetector, tell_network
from genie_sim.data.intake import traces
from genie_sim.data.kitti.drive import CameraFrame, KittiDrive, open_drive
from genie_sim.data.kitti.pipeline import trace_frames
from genie_sim.data.trace import Trace

DEFAULT_DETECTOR = DetectorSettings()


def kitti_folder(root: str | Path | None) -> Path:
    """KITTI's folder: ``root``, else what GENIE_SIM_KITTI says. UserError if neither is given."""
    place = root or os.environ.get("GENIE_SIM_KITTI")
    if not place:
        raise UserError(
            "kitti: where are the drives? Name KITTI's folder with --kitti or the variable "
            "GENIE_SIM_KITTI; 'genie-sim import fetch drive 2011_09_26_drive_0005' gets a drive"
        )
    return expanded(place)


@dataclass(frozen=True)
class FrameSelection:
    """Frames of a KITTI drive, and the world that they are placed in.

    Parameters
    ----------
    drive : such as ``2011_09_26/0005`` or ``odometry/05``
    cameras : of ``layouts.CAMERAS``
    numbers : the frame numbers to look at; ``None``: all
    origin : of the world, latitude [deg], longitude [deg], altitude [m]; ``None``: the first fix
    allow_missing_scans : place by the ground alone where a frame has no scan
    """

    drive: str
    cameras: Sequence[str] = ("02", "03")
    numbers: Collection[int] | None = None
    origin: Geodetic | None = None
    allow_missing_scans: bool = False


def perceive(
    kitti_root: str | Path | None,
    frames: FrameSelection,
    detector: DetectorSettings = DEFAULT_DETECTOR,
    *,
    progress: Progress | None = None,
    report: ImportReport | None = None,
) -> Trace:
    """The trace of a KITTI drive. The same input gives the same trace. Raises UserError.

    Parameters
    ----------
    kitti_root : KITTI's folder; ``None``: what GENIE_SIM_KITTI says
    frames : what to look at
    detector : what looks
    progress : is called with the frames done and all frames
    report : is told what was read, left out and chosen
    """
    root = kitti_folder(kitti_root)
    report = report or ImportReport(root)
    drive = open_drive(
        root,
        frames.drive,
        frames.cameras,
        origin=frames.origin,
        allow_missing_scans=frames.allow_missing_scans,
        report=report,
    )
    camera_frames = in_turn(drive, frames.numbers)
    network = detector.opened()
    perceived = trace_frames(drive, camera_frames, network, detector.encoding)
    pictures = []
    for done, frame in enumerate(perceived, start=1):
        pictures.append(frame)
        if progress is not None:
            progress(done, len(camera_frames), "perceive")
    tell_network(report, network)
    name = drive.name.trace
    imported = traces(
        {name: pictures},
        origin=drive.layout.origin,
        provenance=_provenance(drive, network, detector),
        report=report,
        first_ns=drive.first_stamp_ns,
    )
    return imported[name].trace


def in_turn(drive: KittiDrive, numbers: Collection[int] | None = None) -> list[CameraFrame]:
    """Frame by frame, all cameras of each: they share a scan. Only frames of these ``numbers``;
    UserError for none.
    """
    frames = [
        frame
        for sequence in drive.frames.values()
        for frame in sequence
        if numbers is None or frame.index in numbers
    ]
    if not frames:
        raise UserError(f"{drive.name}: has none of the frames that were asked for")
    return sorted(frames, key=lambda frame: (frame.index, frame.camera))


def _provenance(
    drive: KittiDrive, detector: ImageDetector, settings: DetectorSettings
) -> dict[str, Any]:
    parameters: dict[str, Any] = {
        "cameras": sorted(drive.frames),
        "input_size": list(detector.size),
        "min_score": settings.min_score,
        "nms_iou": NMS_IOU,
        "half_depth_m": placement.HALF_DEPTH_M,
        "vehicle_sizes_m": {
            label: [SIZES[label].length_m, SIZES[label].width_m] for label in VEHICLES
        },
    }
    # Only what is not usual: it does not change what most traces say of themselves.
    parameters |= settings.unusual("threads", "encoding", "classes")
    return {
        "data": drive.layout.attribution,
        "drive": str(drive.name),
        "drive_sha256": drive.digest(),
        "parameters": parameters,
        **detector_facts(detector),
    }
