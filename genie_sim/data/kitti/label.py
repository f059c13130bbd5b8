"""What one label of KITTI's is, and whether it counts, by KITTI's own codes.

An object counts when its box is at least ``MIN_HEIGHT_PX`` high, lies mostly in the picture
(truncation 0 or 1) and how hidden it is was judged (occlusion 0 to 2). The others are ignored,
found or not, and so are trams, ``Misc`` and the areas that KITTI calls ``DontCare``; tracklets have
no such areas.
"""

import math
from collections.abc import Iterable, Mapping
from typing import NamedTuple

from genie_sim.base.errors import UserError
from genie_sim.base.geometry import Array
from genie_sim.core.messages import Box, Location
from genie_sim.data.trace import MIN_HEIGHT_PX, TraceFrame

# KITTI's types by what a detector can tell apart
GROUP_OF = {
    "Car": "vehicles",
    "Van": "vehicles",
    "Truck": "vehicles",
    "Pedestrian": "persons",
    "Person": "persons",
    "Person_sitting": "persons",
    "Person (sitting)": "persons",
    "Cyclist": "persons",
    "Tram": "vehicles",
    "Misc": "vehicles",
}
IGNORED = frozenset({"Tram", "Misc"})  # a vehicle found there is neither right nor wrong

# A trace's camera this near to a drive's, at the same frame, has recorded the same drive.
SAME_PLACE_M = 1.0

PictureKey = tuple[str, int]  # camera and frame number
Poses = Mapping[int, Array]  # of a camera in the world, (4, 4), by frame number


class ObjectLabel(NamedTuple):
    """One label in one picture. ``group``: what a detector finds there, ``anything`` in an area
    such as ``DontCare``. ``counts``: in KITTI's benchmark. ``centre`` is in the trace's world,
    ``None`` for what is no object. ``is_area``: all that lies inside its box is ignored.
    """

    track: int
    group: str
    box: Box
    counts: bool
    centre: Location | None
    is_area: bool = False


def check_drive(where: str, frames: Iterable[TraceFrame], world_SE3_cameras: Poses) -> None:
    """Raises UserError, beginning with ``where``, for a frame of a trace where the drive's camera
    has no frame of its number, or was elsewhere.
    """
    for frame in frames:
        pose = world_SE3_cameras.get(frame.index)
        if pose is None or math.dist(frame.pose[:3], pose[:3, 3].tolist()) > SAME_PLACE_M:
            raise UserError(
                f"{where} is not the drive of this trace: has no frame {frame.index} of camera "
                f"{frame.camera} at its place"
            )


def object_label(
    track: int, kind: str, box: Box, *, truncation: int, occlusion: int, centre: Array
) -> ObjectLabel:
    """What a label counts for in KITTI's benchmark, by KITTI's type and codes."""
    if kind not in GROUP_OF:
        return ObjectLabel(track, "anything", box, counts=False, centre=None, is_area=True)
    high_enough = box[3] - box[1] >= MIN_HEIGHT_PX
    counts = high_enough and truncation in (0, 1) and occlusion in (0, 1, 2)
    east_m, north_m, up_m = centre.tolist()
    is_area = kind in IGNORED
    place = (east_m, north_m, up_m)
    return ObjectLabel(track, GROUP_OF[kind], box, counts and not is_area, place, is_area)
