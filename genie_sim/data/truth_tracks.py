"""What was really there, out of rows that say where objects were at times: where each was between
them, whether it moved, and what of that a car's frames could see.
"""

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from genie_sim.base.classes import MOVING_MPS
from genie_sim.base.geometry import Array
from genie_sim.base.import_report import ImportReport
from genie_sim.base.spans import Flags, Ints
from genie_sim.core.view import ViewSector
from genie_sim.data.intake import BEYOND_M, SAME_TIME_S
from genie_sim.data.trace import POSITION_DECIMALS, TraceFrame, rounded_pose
from genie_sim.data.truth import TruthObject

GAP_S = 1.0  # between two rows of an object that far apart at most it is there
MOVING_OVER_S = 1.0  # the time over which a speed is computed


class ObjectRow(NamedTuple):
    """An object at a time, for one car or, without one, for all. What it does not say of ``moving``
    and ``visible`` is computed.
    """

    car: str | None
    time_s: float
    object: str
    label: str
    east_m: float
    north_m: float
    moving: bool | None
    visible: bool | None
    up_m: float | None


class Sightings(NamedTuple):
    """One object at the times of a car's frames, as columns: whether it is there, where [m] (n, 3),
    and which row of the table is nearest in time.
    """

    there: Flags
    place: Array
    row: Ints


class TruthTrack:
    """One object of the truth, by its number: its rows in order of time without a gap, and where it
    is between them.
    """

    def __init__(self, number: int, rows: Sequence[ObjectRow]) -> None:
        self.number, self.rows, self.label = number, rows, rows[0].label
        self.times_s = np.array([row.time_s for row in rows])
        self.places = np.array([(row.east_m, row.north_m, row.up_m or 0.0) for row in rows])

    def at(self, times_s: Array) -> Sightings:
        """The object at some times (n,), between two rows on a straight line."""
        own_s, places = self.times_s, self.places
        last = len(own_s) - 1
        later = np.minimum(np.searchsorted(own_s, times_s - SAME_TIME_S), last)
        earlier = np.maximum(later - 1, 0)
        exact = np.abs(own_s[later] - times_s) <= SAME_TIME_S
        gap_s = own_s[later] - own_s[earlier]
        between = (own_s[earlier] < times_s) & (times_s < own_s[later])
        share = np.where(exact, 1.0, (times_s - own_s[earlier]) / np.where(gap_s > 0, gap_s, 1.0))
        place = places[earlier] + share[:, None] * (places[later] - places[earlier])
        return Sightings(
            there=exact | between,
            place=np.where(exact[:, None], places[later], place),
            row=np.where(share < 0.5, earlier, later),
        )

    def is_moving(self, times_s: Array) -> Flags:
        """Whether it moves at some times (n,) at which it is there, by its places over the second
        around each, as far as they are known.
        """
        first_s = np.maximum(times_s - MOVING_OVER_S / 2, self.times_s[0])
        last_s = np.minimum(times_s + MOVING_OVER_S / 2, self.times_s[-1])
        way_m = np.hypot(*(self.at(last_s).place - self.at(first_s).place)[:, :2].T)
        duration_s = last_s - first_s
        is_moving: Flags = (duration_s > SAME_TIME_S) & (way_m > MOVING_MPS * duration_s)
        return is_moving


def without_gaps(rows: Sequence[ObjectRow]) -> list[Sequence[ObjectRow]]:
    """The rows of an object in order of time, cut where none comes for longer than ``GAP_S``."""
    gaps = np.flatnonzero(np.diff([row.time_s for row in rows]) > GAP_S) + 1
    return [rows[begin:end] for begin, end in pairwise([0, *gaps.tolist(), len(rows)])]


def in_view(
    frames: Sequence[TraceFrame], times_s: Array, tracks: Sequence[TruthTrack], range_m: float
) -> list[list[TruthObject]]:
    """What is there at each frame of a car, taken at ``times_s`` (n,), up to a little beyond
    ``range_m``.
    """
    poses = [rounded_pose(frame).pose for frame in frames]
    sectors = [
        ViewSector(pose, frame.horizontal_fov_rad, range_m)
        for pose, frame in zip(poses, frames, strict=True)
    ]
    origins = np.array([pose[:2] for pose in poses])
    there: list[list[TruthObject]] = [[] for _ in frames]
    for track in tracks:
        sightings, moving = track.at(times_s), track.is_moving(times_s)
        away_m = np.hypot(*(sightings.place[:, :2] - origins).T)
        near = sightings.there & (away_m <= range_m + BEYOND_M)
        for index in np.flatnonzero(near).tolist():
            place = sightings.place[index].round(POSITION_DECIMALS).tolist()
            row = track.rows[sightings.row[index]]
            is_seen = sectors[index].distance_m(*place[:2]) is not None
            there[index].append(
                TruthObject(
                    track.number,
                    track.label,
                    bool(moving[index]) if row.moving is None else row.moving,
                    is_seen and row.visible is not False,
                    *place,
                )
            )
    return there


def check_covered(
    car: str, times_s: Array, tracks: Sequence[TruthTrack], *, report: ImportReport, path: Path
) -> None:
    """Warns of poses of a car at whose times no track has a row. Raises UserError, naming ``path``,
    where most are such.
    """
    own_s = np.sort(np.concatenate([[-np.inf, np.inf], *(track.times_s for track in tracks)]))
    after = np.searchsorted(own_s, times_s)
    apart_s = np.minimum(own_s[after] - times_s, times_s - own_s[after - 1])
    uncovered_s = times_s[apart_s > GAP_S]
    if len(uncovered_s):
        text = (
            f"time_s: no row within {GAP_S:g} s of {len(uncovered_s):,} of {len(times_s):,} poses "
            f"of {car}, the first at {uncovered_s[0]:.15g}"
        )
        if 2 * len(uncovered_s) > len(times_s):
            report.refuse(f"{text}: are they of one drive?", path)
        else:
            report.warn(f"{path.name}: {text}: nothing is there")
