"""What an importer tells of the frames of a trace: how many, where, and what was found in them."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from genie_sim.base.import_report import ImportReport
from genie_sim.base.units import NS_PER_S
from genie_sim.data.trace import Trace, TraceFrame, write_trace

FARTHEST_M = 250.0  # no sensor of a car tells the place of an object beyond


def tell_network(report: ImportReport, detector: Any) -> None:
    """What was found out about a detector's network, and which of its labels are not used."""
    report.chosen += getattr(detector, "notes", [])
    for label, count in getattr(detector, "unused", {}).items():
        report.leave_label(label, count)


def tell_frames(report: ImportReport, by_camera: Mapping[str, Sequence[TraceFrame]]) -> None:
    """Counts, ranges and ways. Raises UserError where a car goes faster than any, or where all
    objects are beyond what a sensor sees.
    """
    distances_m: list[float] = []
    found = 0
    for camera, frames in by_camera.items():
        pictured = [frame for frame in frames if frame.kind == "camera"]
        report.read(f"{'images' if pictured else 'scans'} of {camera}", len(frames))
        report.way(
            camera,
            [frame.stamp_ns / NS_PER_S for frame in frames],
            [frame.pose[:2] for frame in frames],
        )
        report.span("width", {frame.width for frame in pictured}, "px")
        report.span("height", {frame.height for frame in pictured}, "px")
        for frame in frames:
            found += len(frame.detections)
            distances_m += [
                math.dist(detection.location[:2], frame.pose[:2])
                for detection in frame.detections
                if detection.location is not None
            ]
    report.read("detections", found)
    report.span("objects", distances_m, "m away")
    if distances_m and min(distances_m) > FARTHEST_M:
        report.refuse(
            f"all {len(distances_m):,} objects are {min(distances_m):,.0f} m away or more"
        )
    if 2 * len(distances_m) < found:
        report.warn(f"{found - len(distances_m):,} of {found:,} detections have no place")


def write_told(path: Path, trace: Trace) -> str:
    """Writes a trace; returns a line about it."""
    write_trace(path, trace)
    frames = [frame for sequence in trace.frames.values() for frame in sequence]
    detections = sum(len(frame.detections) for frame in frames)
    return f"{path}: {len(frames)} frames, {detections} detections, content {trace.digest[:12]}"
