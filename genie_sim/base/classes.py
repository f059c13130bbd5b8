"""Classes of road objects, by their COCO names: groups of classes, usual sizes, and what moves."""

from typing import NamedTuple

VEHICLES = ("car", "truck", "bus")
PERSONS = ("person",)
# What KITTI's labels tell apart. A detector confuses the classes of a group, so they are compared
# as one class: the first.
GROUPS = {"vehicles": VEHICLES, "persons": PERSONS}
CANONICAL = {label: group[0] for group in GROUPS.values() for label in group}

# On drive 0005 the labelled centres of parked cars wander by up to 0.3 m a second, from the labels'
# and OXTS's own errors; a slow walk is 1 m/s.
# What moves, as the truth tells it: a labelled track of KITTI that is faster over all its time
# (``data.kitti.drive_truth``), an object of tables that is faster over the second around that time
# (``data.truth_tracks``), and in towns and traffic what is faster at that instant.
MOVING_MPS = 0.5


class Size(NamedTuple):
    """The usual extent of the objects of a class."""

    length_m: float
    width_m: float
    height_m: float


# The classes that belong to a road: its users and its furniture. KITTI's tracking labels (15
# sequences, mean over tracks) have cars of 3.90 m x 1.63 m, vans of 4.90 m x 1.90 m and trams
# 2.53 m wide. What COCO calls truck or bus is mostly a van there. All other numbers are assumed.
SIZES = {
    "car": Size(3.90, 1.63, 1.5),
    "truck": Size(4.90, 1.90, 3.0),
    "bus": Size(4.90, 1.90, 2.5),
    "train": Size(15.0, 2.53, 3.5),
    "person": Size(0.5, 0.5, 1.75),
    "bicycle": Size(1.8, 0.6, 1.1),
    "motorcycle": Size(2.0, 0.8, 1.5),
    "traffic light": Size(0.3, 0.3, 0.9),
    "stop sign": Size(0.1, 0.75, 0.75),
    "fire hydrant": Size(0.3, 0.3, 0.75),
    "parking meter": Size(0.3, 0.3, 1.4),
    "bench": Size(0.6, 1.5, 0.85),
}
ROAD_LABELS = frozenset(SIZES)
NO_CLASS = "none"  # what a label of a file is mapped to whose objects are left out


def class_of(label: str) -> str:
    """The class as which objects with this label are compared."""
    return CANONICAL.get(label, label)
