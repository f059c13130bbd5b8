"""One drive, right or wrong, in the files of every reader, and what must be told of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pymap3d

from genie_sim.base.errors import UserError
from genie_sim.base.import_report import ImportReport
from genie_sim.data.detectors.detector import DetectorSettings
from genie_sim.data.kitti.perceive import FrameSelection, perceive
from genie_sim.data.table_import import Sensor, cars_of_tables
from tests.data.tracking_files import CALIBRATION
from tests.kitti_folder import DATE, make_network, make_street
from tools.make.published import tracking_trace

ORIGIN = (49.0, 8.4, 112.0)


@dataclass(frozen=True)
class MadeDrive:
    """A car on a straight way: when [s] and how far along [m] each frame is, the direction of the
    way and of what the car says to look [rad, from east], and the one object of each frame, so far
    ahead of the car along its way [m].
    """

    times_s: Sequence[float]
    along_m: Sequence[float]
    objects_m: Sequence[float]
    course_rad: float = 0.0
    heading_rad: float = 0.0
    label: str = "car"
    score: float = 0.75

    def places(self, beyond_m: float | Sequence[float] = 0.0) -> list[tuple[float, float]]:
        """East and north of the car, or of what is so far ahead of it [m]."""
        along = np.array(self.along_m) + np.array(beyond_m)
        ahead = np.column_stack(
            [math.cos(self.course_rad) * along, math.sin(self.course_rad) * along]
        )
        return [(east_m, north_m) for east_m, north_m in ahead.tolist()]

    def geodetic(self) -> list[tuple[float, float, float]]:
        """Latitude, longitude [deg] and altitude [m] of the car."""
        return [
            tuple(map(float, pymap3d.enu2geodetic(east_m, north_m, 0.0, *ORIGIN)))
            for east_m, north_m in self.places()
        ]


def steady(count: int = 9, step_s: float = 0.1, speed_mps: float = 10.0) -> MadeDrive:
    """A drive at one speed, with an object 20 m ahead in each frame."""
    times_s = [round(k * step_s, 9) for k in range(count)]
    return MadeDrive(times_s, [t_s * speed_mps for t_s in times_s], [20.0] * count)


def later(drive: MadeDrive, by_s: float) -> MadeDrive:
    """The drive with a pause of so long before its last three frames."""
    times_s = [*drive.times_s[:-3], *(t_s + by_s for t_s in drive.times_s[-3:])]
    return replace(drive, times_s=times_s)


class Check(NamedTuple):
    """A wrong drive, what is told of it, whether it is refused, and in which kinds of files it can
    be.
    """

    drive: MadeDrive
    told: str
    is_refused: bool = True
    readers: str = "tables raw published bag"


NORTH = {"course_rad": math.pi / 2}
TIMED = "tables raw bag"  # published detections come every 0.1 s
PLACED = "tables published bag"  # of a raw drive a detector tells what is where
NAMED = "tables bag"  # files with labels and scores of their own
CHECKS = {
    "faster than a car": Check(steady(speed_mps=1500), "steps are faster than 100 m/s"),
    "degrees for metres": Check(steady(20, speed_mps=1e-4), "are places in degrees"),
    "radians for degrees": Check(
        replace(steady(), **NORTH, heading_rad=math.radians(math.pi / 2)), "as radians"
    ),
    "a compass bearing": Check(
        replace(steady(), **NORTH), "90 degrees beside the way driven", is_refused=False
    ),
    "a row every 20 s": Check(steady(step_s=20, speed_mps=1), "a row every 20 s", readers=TIMED),
    "a row every 2 s": Check(
        steady(step_s=2, speed_mps=1), "a row every 2 s", is_refused=False, readers=TIMED
    ),
    "a pause": Check(later(steady(), 3.0), "a gap of 3.1 s", is_refused=False, readers=TIMED),
    "a clock that was set": Check(later(steady(), 9000.0), "a gap of 9e.03 s", readers=TIMED),
    "frames at one time": Check(
        steady(step_s=0.0004), "millisecond (of another|after)", readers=TIMED
    ),
    "beyond the range": Check(
        replace(steady(), objects_m=[60.0] * 9), "beyond the range of 40 m", readers=PLACED
    ),
    "beyond any sensor": Check(
        replace(steady(), objects_m=[20.0] + [300.0] * 8),
        "8 of 9 objects are more than 250 m away",
        readers=PLACED,
    ),
    "some beyond any sensor": Check(
        replace(steady(), objects_m=[20.0] * 5 + [300.0] * 4),
        "4 of 9 objects are more than 250 m away",
        is_refused=False,
        readers=PLACED,
    ),
    "behind the camera": Check(
        replace(steady(), objects_m=[-20.0] * 9),
        "9 of 9 detections are outside of the field of view",
        is_refused=False,
        readers=PLACED,
    ),
    "labels of others": Check(
        replace(steady(), label="Vehicle"), "9 of 9 detections have labels", readers=NAMED
    ),
    "scores above one": Check(replace(steady(), score=7.5), "score", readers=NAMED),
    "places nowhere": Check(
        replace(steady(), objects_m=[1e12] * 9), "east_m: must|finite|in range", readers=PLACED
    ),
}


def of_tables(drive: MadeDrive, folder: Path, report: ImportReport) -> None:
    """As CSV files, of a sensor that looks ahead."""
    heading_deg = math.degrees(drive.heading_rad)
    poses = [
        f"{t_s:.9f},{east_m!r},{north_m!r},{heading_deg!r}"
        for t_s, (east_m, north_m) in zip(drive.times_s, drive.places(), strict=True)
    ]
    objects = [
        f"{t_s:.9f},{drive.label},{east_m!r},{north_m!r},{drive.score}"
        for t_s, (east_m, north_m) in zip(drive.times_s, drive.places(drive.objects_m), strict=True)
    ]
    files = folder / "poses.csv", folder / "detections.csv"
    files[0].write_text("\n".join(["time_s,east_m,north_m,heading_deg", *poses]))
    files[1].write_text("\n".join(["time_s,label,east_m,north_m,score", *objects]))
    cars_of_tables(*files, sensor=Sensor(math.radians(90)), report=report)


def _oxts(drive: MadeDrive) -> list[str]:
    """The lines of KITTI's positions."""
    return [
        " ".join(map(repr, (*place, 0.0, 0.0, drive.heading_rad, *[0.0] * 19, 4, 10, 4, 4, 0)))
        for place in drive.geodetic()
    ]


def of_raw_drive(drive: MadeDrive, folder: Path, report: ImportReport) -> None:
    """As a raw drive of KITTI, whose pictures and scans show a car 15 m ahead."""
    data = make_street(folder, frames=len(drive.times_s))
    for index, line in enumerate(_oxts(drive)):
        (data / "oxts" / "data" / f"{index:010d}.txt").write_text(f"{line}\n")
    first = np.datetime64("2011-09-26T13:04:32", "ns")
    stamps = [first + np.timedelta64(round(t_s * 1e9), "ns") for t_s in drive.times_s]
    (data / "image_02" / "timestamps.txt").write_text(
        "".join(f"{str(stamp).replace('T', ' ')}\n" for stamp in stamps)
    )
    detector = DetectorSettings(weights=make_network(folder / "yolox_nano.onnx"))
    perceive(folder, FrameSelection(f"{DATE}/0005", ("02",)), detector, report=report)


def of_published(drive: MadeDrive, folder: Path, report: ImportReport) -> None:
    """As a tracking sequence of KITTI with PointRCNN's detections: a frame each 0.1 s."""
    for name in ("training/oxts", "training/calib", "detections/pointrcnn_Car"):
        (folder / name).mkdir(parents=True)
    (folder / "detections/pointrcnn_Pedestrian").mkdir()
    (folder / "training/oxts/0003.txt").write_text("\n".join(_oxts(drive)) + "\n")
    (folder / "training/calib/0003.txt").write_text(CALIBRATION)
    off_rad = drive.course_rad - drive.heading_rad
    across, ahead = -math.sin(off_rad), math.cos(off_rad)
    cars = [
        f"{k},2,500,170,600,230,9,1.5,1.6,3.9,{across * m!r},1.6,{ahead * m!r},0,0\n"
        for k, m in enumerate(drive.objects_m)
    ]
    (folder / "detections/pointrcnn_Car/0003.txt").write_text("".join(cars))
    (folder / "detections/pointrcnn_Pedestrian/0003.txt").write_text("")
    tracking_trace(folder, "0003", report=report)


Reader = Callable[[MadeDrive, Path, ImportReport], None]
READERS: dict[str, Reader] = {
    "tables": of_tables,
    "raw": of_raw_drive,
    "published": of_published,
}


def cases(*readers: str) -> list[tuple[str, str]]:
    """Reader and check of all files that can be wrong in that way."""
    return [
        (reader, name)
        for name, check in CHECKS.items()
        for reader in readers
        if reader in check.readers.split()
    ]


def told(reader: Reader, drive: MadeDrive, folder: Path) -> tuple[bool, list[str]]:
    """Whether a drive is refused, and what is told of it."""
    report = ImportReport(folder)
    try:
        reader(drive, folder, report)
    except UserError as error:
        return True, [str(error)]
    return False, report.warnings
