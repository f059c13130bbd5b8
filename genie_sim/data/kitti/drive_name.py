"""What KITTI's drives are called."""

import re
from pathlib import Path
from typing import NamedTuple

from genie_sim.base.errors import UserError, short_repr

ODOMETRY, TRACKING = "odometry", "tracking"
NAME = re.compile(
    rf"(\d{{4}}_\d\d_\d\d)(?:/|_drive_)(\d{{4}})(?:_sync)?|({ODOMETRY}|{TRACKING})/(\w+)", re.ASCII
)
TRACE_PREFIXES = {"2011_09_26": "kitti", ODOMETRY: "odometry"}  # else the date is in the name


class DriveName(NamedTuple):
    """A raw drive by its date and number, ``2011_09_26/0005`` or ``2011_09_26_drive_0005``, or a
    sequence of a benchmark, ``odometry/05`` or ``tracking/0000``.

    ``part`` of KITTI's data is the date or the benchmark.
    """

    part: str
    number: str

    @classmethod
    def match(cls, text: object) -> "DriveName | None":
        """What a text names; ``None`` where that is no drive."""
        match = NAME.fullmatch(str(text))
        return match and cls(*filter(None, match.groups()))

    @classmethod
    def parse(cls, text: object) -> "DriveName":
        """What a text names. Raises UserError."""
        name = cls.match(text)
        if name is None:
            raise UserError(
                f"drive {short_repr(text)}: must be a raw drive, such as 2011_09_26/0005, or a "
                f"sequence, {ODOMETRY}/05 or {TRACKING}/0000"
            )
        return name

    def __str__(self) -> str:
        return f"{self.part}/{self.number}"

    @property
    def is_raw(self) -> bool:
        return self.part not in (ODOMETRY, TRACKING)

    @property
    def raw(self) -> str:
        """What KITTI calls a raw drive: ``2011_09_26_drive_0005``."""
        return f"{self.part}_drive_{self.number}"

    @property
    def folder(self) -> Path:
        """Where the files of a raw drive are, below KITTI's root."""
        return Path(self.part) / f"{self.raw}_sync"

    @property
    def trace(self) -> str:
        """What its trace is called: ``kitti_0005`` on the day of most drives,
        ``kitti_2011_09_28_0016`` on another, whose drives have numbers of their own,
        ``odometry_05``.
        """
        return f"{TRACE_PREFIXES.get(self.part, f'kitti_{self.part}')}_{self.number}"
