"""KITTI's labels as boxes in the pictures of a trace: what a detector should have found there, and
where it stands.

Which labels count is KITTI's own codes: an object counts when its box is at least ``MIN_HEIGHT_PX``
high, lies mostly in the picture (truncation 0 or 1) and how hidden it is was judged (occlusion 0 to
2). The others are ignored, found or not, and so are trams, ``Misc`` and the areas that KITTI calls
``DontCare``; tracklets have no such areas.

KITTI labels what its annotators saw in the laser scans; objects far away or never labelled are
missing, so an object without a label nearby is not always a ghost.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from genie_sim.base.classes import MOVING_MPS
from genie_sim.base.units import NS_PER_S
from genie_sim.core.messages import Box, Location
from genie_sim.data.labels import KittiLabel, labelled_cameras, read_labels
from genie_sim.data.trace import MIN_HEIGHT_PX, Trace
from genie_sim.data.tracking import TRACKING

# KITTI's types by what a detector can tell apart; others (Misc, Tram, DontCare) are no objects here
GROUPS = {
    "Car": "vehicles",
    "Van": "vehicles",
    "Truck": "vehicles",
    "Pedestrian": "persons",
    "Person": "persons",
    "Person_sitting": "persons",
    "Person (sitting)": "persons",
    "Cyclist": "persons",
}
IGNORED = {"Tram": "vehicles", "Misc": "vehicles", "DontCare": "anything"}  # by KITTI's type

Picture = tuple[str, int]  # camera and frame number


class ObjectLabel(NamedTuple):
    """One label in one picture. ``centre`` is in the trace's world, ``None`` for an area that is no
    object.
    """

    track: int
    group: str
    box: Box
    counts: bool
    centre: Location | None


@dataclass(frozen=True, slots=True)
class PictureLabels:
    """The labels of all pictures of a trace, by picture, and the tracks that move, by number."""

    source: str
    pictures: Mapping[Picture, list[ObjectLabel]]
    moving: frozenset[int]


def read_truth(root: str | Path, drive: str, trace: Trace) -> PictureLabels:
    """The labels of ``2011_09_26/0005`` (tracklets) or ``tracking/0000`` for the pictures of a
    trace of that drive.

    Raises UserError for labels that are missing or broken, and where they are not of this drive.
    """
    pictures: dict[Picture, list[ObjectLabel]] = {
        (camera, frame.index): []
        for camera in labelled_cameras(drive, trace)
        for frame in trace.frames[camera]
    }
    for label in read_labels(Path(root), drive, trace):
        if label.kind in GROUPS or label.kind in IGNORED:
            pictures[label.camera, label.frame].append(_as_object(label))
    source = f"label_02 of {drive}" if drive.startswith(TRACKING) else f"tracklets of {drive}"
    return PictureLabels(source, pictures, _moving(pictures, trace))


def _as_object(label: KittiLabel) -> ObjectLabel:
    """A label with what it counts for in KITTI's benchmark."""
    if label.kind in IGNORED:
        return ObjectLabel(label.track, IGNORED[label.kind], label.box, counts=False, centre=None)
    high_enough = label.box[3] - label.box[1] >= MIN_HEIGHT_PX
    counts = high_enough and label.truncation in (0, 1) and label.occlusion in (0, 1, 2)
    return ObjectLabel(
        track=label.track,
        group=GROUPS[label.kind],
        box=label.box,
        counts=counts,
        centre=label.centre,
    )


def _moving(pictures: Mapping[Picture, list[ObjectLabel]], trace: Trace) -> frozenset[int]:
    """The tracks that got away from where they were first labelled faster than ``MOVING_MPS``, over
    all their time.
    """
    stamps_ns = {
        (camera, frame.index): frame.stamp_ns
        for camera in trace.frames
        for frame in trace.frames[camera]
    }
    tracks: dict[int, dict[int, Location]] = {}
    for picture, labels in pictures.items():
        for label in labels:
            if label.centre is not None:
                tracks.setdefault(label.track, {})[stamps_ns[picture]] = label.centre
    return frozenset(track for track, places in tracks.items() if _speed_mps(places) > MOVING_MPS)


def _speed_mps(places: Mapping[int, Location]) -> float:
    """How far it got from its first place over the time between its first and its last."""
    first_ns, last_ns = min(places), max(places)
    away_m = max(math.dist(place[:2], places[first_ns][:2]) for place in places.values())
    return away_m / ((last_ns - first_ns) / NS_PER_S) if last_ns > first_ns else 0.0
