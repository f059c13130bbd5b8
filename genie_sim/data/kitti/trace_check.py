"""How far what detectors find here is from what a trace keeps: its frames are perceived again.

ONNX Runtime adds in another order in each version, so that scores near the threshold fall on its
other side.
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from genie_sim.base.errors import UserError, as_user_error
from genie_sim.base.plugins import is_own
from genie_sim.base.progress import Progress
from genie_sim.core.messages import Detection
from genie_sim.data.detectors.detector import DetectorSettings
from genie_sim.data.kitti.perceive import FrameSelection, perceive
from genie_sim.data.trace import Trace

MIN_IOU = 0.5  # of one object in both


def perceive_again(
    kitti_root: Path, trace: Trace, detector: DetectorSettings, progress: Progress | None = None
) -> Trace:
    """The trace of the same frames with the same settings, made here. Raises UserError for a trace
    of no KITTI drive, or of another detector, other weights or files.

    Parameters
    ----------
    kitti_root : KITTI's folder
    trace : what was perceived somewhere else
    detector : where its weights are, how it runs here, and its class if it is the user's own; all
        else is as in the trace
    progress : is called with the frames done and all frames
    """
    about = trace.provenance
    if not {"drive", "detector", "weights_sha256", "parameters"} <= about.keys():
        raise UserError(f"{trace.name}: was not perceived from a drive, so nothing can be checked")
    parameters = about["parameters"]
    broken = LookupError, TypeError, ValueError
    with as_user_error(f"{trace.name}: its provenance cannot be read", *broken):
        width, height = map(int, parameters["input_size"])
        cameras = [str(camera) for camera in parameters["cameras"]]
        settings = replace(
            detector,
            name=detector.name if is_own(detector.name) else str(about["detector"]),
            size=(width, height),
            min_score=float(parameters["min_score"]),
            encoding=parameters.get("encoding", "raw"),
            classes=dict(parameters.get("classes", {})),
        )
    numbers = {number for _, number in trace.by_picture}
    selection = FrameSelection(
        about["drive"], cameras, numbers, trace.origin, allow_missing_scans=True
    )
    again = perceive(kitti_root, selection, settings, progress=progress)
    for key, what in (
        ("detector", "another detector than that"),
        ("weights_sha256", "other weights than those"),
        ("drive_sha256", "other files of the drive than those"),
    ):
        if again.provenance[key] != about.get(key):
            raise UserError(f"{trace.name}: was made with {what} here ({key})")
    return again


def differences(trace: Trace, again: Trace) -> Iterator[str]:
    """Lines about versions, frames and detections that are not the same in two traces of the same
    frames.
    """
    there, here = (trace_of.provenance.get("versions", {}) for trace_of in (trace, again))
    changed = [
        f"{name} {there.get(name, 'unknown')} in the trace, {here[name]} here"
        for name in here
        if here[name] != there.get(name)
    ]
    yield f"versions: {'; '.join(changed) or 'the same'}"
    frames = again.by_picture
    pairs = [
        (frame.detections, frames[picture].detections)
        for picture, frame in trace.by_picture.items()
    ]
    equal_frames = sum(before == after for before, after in pairs)
    yield f"frames: {equal_frames:,} of {len(pairs):,} have the same detections"
    lost, new = 0, 0
    score, box_px, place_m = 0.0, 0.0, 0.0
    for before, after in pairs:
        candidates = list(after)
        for detection in before:
            match = _match(detection, candidates)
            if match is None:
                lost += 1
                continue
            candidates.remove(match)
            score = max(score, abs(detection.score - match.score))
            sides = zip(detection.box or (), match.box or (), strict=True)
            box_px = max(box_px, *(abs(side - its_side) for side, its_side in sides))
            if detection.location is not None and match.location is not None:
                place_m = max(place_m, math.dist(detection.location, match.location))
        new += len(candidates)
    total = sum(len(before) for before, _ in pairs)
    yield f"detections: of {total:,}, {lost:,} are not found here, and {new:,} are new"
    yield f"the others differ by at most {score:.3g} in score, {box_px:.3g} px, {place_m:.3g} m"


def _match(detection: Detection, among: list[Detection]) -> Detection | None:
    """The detection of the same label whose box is nearest, if it is the same object."""
    if detection.box is None:
        return None
    alike = [candidate for candidate in among if candidate.label == detection.label]
    best = max(alike, key=lambda candidate: _iou(detection, candidate), default=None)
    return best if best is not None and _iou(detection, best) >= MIN_IOU else None


def _iou(one: Detection, other: Detection) -> float:
    """Intersection over union of the boxes of two detections of a picture."""
    boxes = np.array([one.box, other.box])
    areas = (boxes[:, 2:] - boxes[:, :2]).prod(axis=1)
    extent = boxes[:, 2:].min(axis=0) - boxes[:, :2].max(axis=0)
    shared = extent.clip(0.0).prod()
    return float(shared / max(areas.sum() - shared, 1e-9))
