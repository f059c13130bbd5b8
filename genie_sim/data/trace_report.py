"""What an importer tells of the frames of a trace: how many, where, and what was found in them."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from genie_sim.base.import_report import ImportReport, askew_rad
from genie_sim.base.units import NS_PER_S
from genie_sim.data.trace import Trace, TraceFrame, write_trace

FARTHEST_M = 250.0  # no sensor of a car tells the place of an object beyond


def tell_network(report: ImportReport, detector: Any) -> None:
    """What was found out about a detector's network, and which of its labels are not used."""
    report.chosen += getattr(detector, "notes", [])
    for label, count in getattr(detector, "unused", {}).items():
        report.leave_label(label, count)


def tell_distances(report: ImportReport, distances_m: Sequence[float]) -> None:
    """How far away objects are. Raises UserError where most are beyond what a sensor sees."""
    report.span("objects", distances_m, "m away")
    far = sum(distance_m > FARTHEST_M for distance_m in distances_m)
    text = f"{far:,} of {len(distances_m):,} objects are more than {FARTHEST_M:g} m away"
    if 2 * far > len(distances_m):
        report.refuse(f"{text}: are they in the car's frame, not on the plane of its poses?")
    elif far:
        report.warn(text)


def tell_frames(report: ImportReport, by_camera: Mapping[str, Sequence[TraceFrame]]) -> None:
    """Counts, ranges and ways. Raises UserError where a car goes faster than any, or where most
    objects are beyond what a sensor sees.
    """
    distances_m: list[float] = []
    off_rad: dict[str, float] = {}
    found = 0
    for camera, frames in by_camera.items():
        pictured = [frame for frame in frames if frame.kind == "camera"]
        report.read(f"{'images' if pictured else 'scans'} of {camera}", len(frames))
        times_s = [frame.stamp_ns / NS_PER_S for frame in frames]
        poses = np.array([frame.pose for frame in frames])
        report.way(camera, times_s, poses[:, :2])
        off_rad[camera] = askew_rad(poses[:-1, 3], np.diff(poses[:, :2], axis=0), np.diff(times_s))
        report.span("width", {frame.width for frame in pictured}, "px")
        report.span("height", {frame.height for frame in pictured}, "px")
        for frame in frames:
            found += len(frame.detections)
            distances_m += [
                math.dist(detection.location[:2], frame.pose[:2])
                for detection in frame.detections
                if detection.location is not None
            ]
    # of several cameras some look aside
    ahead = min(off_rad, key=lambda camera: off_rad[camera])
    report.heading(f"{ahead}: the heading", off_rad[ahead], math.inf)
    report.read("detections", found)
    tell_distances(report, distances_m)
    if 2 * len(distances_m) < found:
        report.warn(f"{found - len(distances_m):,} of {found:,} detections have no place")


def write_told(path: Path, trace: Trace) -> str:
    """Writes a trace; returns a line about it."""
    write_trace(path, trace)
    frames = [frame for sequence in trace.frames.values() for frame in sequence]
    detections = sum(len(frame.detections) for frame in frames)
    return f"{path}: {len(frames)} frames, {detections} detections, content {trace.digest[:12]}"
