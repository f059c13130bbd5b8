"""The gate through which all frames come that readers of other people's files find: KITTI's drives,
bags, tables, published detections.

A reader makes frames (``reader_frames``) and, if that is known, says what was there
(``TruthObject``). ``traces`` alone orders, numbers and checks the frames, tells what was read, and
keeps where it comes from: what is refused or warned of in one kind of file is so in all.
"""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from genie_sim.base.classes import ROAD_LABELS, class_of
from genie_sim.base.errors import UserError
from genie_sim.base.geometry import Array, Geodetic
from genie_sim.base.import_report import ImportReport, askew_rad
from genie_sim.base.units import NS_PER_MS, NS_PER_S
from genie_sim.core.view import ViewSector
from genie_sim.data.reader_frames import COUNTED
from genie_sim.data.trace import (
    POSITION_DECIMALS,
    RANGE_M,
    Trace,
    TraceFrame,
    check_replaceable,
    checked,
    feature_facts,
    rounded,
    rounded_pose,
    write_trace,
)
from genie_sim.data.truth import (
    TruthObject,
    TruthRow,
    TruthTable,
    check_range,
    check_rows,
    check_truth_replaceable,
    path_beside,
    write_truth,
)

BEYOND_M = 10.0  # truth is told so much beyond the range, for what is held a little off
NEAREST_M = 0.5  # what is nearer is the car itself
SAME_SHARE, FEW = 0.25, 10  # of the detections may be where another is
FARTHEST_M = 250.0  # no sensor of a car tells the place of an object beyond
CLOSEST_NS = NS_PER_MS  # no sensor takes two frames within less
SAME_TIME_S = CLOSEST_NS / NS_PER_S / 2  # what differs by less is one instant
USUAL_MB = (0.001, 100.0)  # one frame
OUTSIDE_SHARE = 0.1  # of the objects may have their middles beside what is seen of them


class _View(NamedTuple):
    """A frame, and what was there in view of it."""

    frame: TraceFrame
    there: Sequence[TruthObject]


class _Car(NamedTuple):
    """A car of an import, and whether there are others."""

    name: str
    is_one_of_several: bool

    def camera(self, name: str) -> str:
        """What one of its cameras is called in the report."""
        return f"{self.name} {name}" if self.is_one_of_several else name


class ImportedCar(NamedTuple):
    """The trace of one car, and its truth table if there is one."""

    trace: Trace
    truth: TruthTable | None


def traces(
    frames: Mapping[str, Sequence[TraceFrame]],
    *,
    origin: Geodetic,
    provenance: Mapping[str, Any],
    report: ImportReport,
    truth: Mapping[str, Sequence[Sequence[TruthObject]]] = {},
    first_ns: int | None = None,
    sequence: str | None = None,
    range_m: float = RANGE_M,
    detected_in: Path | None = None,
    truth_in: Path | None = None,
) -> dict[str, ImportedCar]:
    """The traces of cars that share a clock, by their names.

    Raises UserError for frames that no drive has: see ``docs/how-to/own-data.md``.

    Parameters
    ----------
    frames : of each car, in any order, with stamps of that clock
    origin : of the world: latitude [deg], longitude [deg], altitude [m]
    provenance : where they come from; what the report knows is added
    report : of the files that were read, whose path begins errors; is told what there is
    truth : of the cars of which it is known what was there: the objects in view of each frame, in
        the order of ``frames``
    first_ns : when the traces begin on that clock; ``None``: with the first frame of any car
    sequence : as in ``Trace``
    range_m : up to which objects are judged
    detected_in, truth_in : the files that detections and truth stand in, if they are others than
        the report's
    """
    if first_ns is None:
        first_ns = min(
            (frame.stamp_ns for of_car in frames.values() for frame in of_car), default=0
        )
    by_car, objects = {}, {}
    for car, of_car in frames.items():
        of_frames = truth[car] if car in truth else [()] * len(of_car)
        if len(of_frames) != len(of_car):
            counts = f"{len(of_frames):,} frames, but there are {len(of_car):,}"
            raise UserError(f"{report.path}: truth: has the objects of {car} in {counts}")
        views = [_View(*pair) for pair in zip(of_car, of_frames, strict=True)]
        named = _Car(car, len(frames) > 1)
        ordered = _in_order(named, views, first_ns, report)
        cameras = checked(f"{report.path}: {car}", [view.frame for view in ordered])
        by_car[car] = _with_shared_features(named, cameras, report)
        objects[car] = [
            (view.frame, truth_row(view.frame, there)) for view in ordered for there in view.there
        ]
        _check_ways(named, by_car[car], first_ns, report)
    _check_detections(by_car, report, range_m, detected_in)
    if truth:
        check_range(report.path, range_m)
        _check_truth([*chain(*objects.values())], report, range_m, truth_in)
    import_facts = {"import": report.facts()}
    imported = {}
    for car, by_camera in by_car.items():
        features = feature_facts(f"{report.path}: {car}", by_camera)
        about = {**provenance, **({"features": features} if features else {}), **import_facts}
        if len(by_car) > 1:
            about["car"] = car
        # only now, after the checks, which see what the reader found
        kept = {camera: tuple(map(rounded_pose, of)) for camera, of in by_camera.items()}
        trace = Trace(car, origin, kept, about, sequence=sequence)
        table = None
        if car in truth:
            rows = sorted(row for _, row in objects[car])
            about = {**trace.provenance, "trace": trace.name}
            table = TruthTable(trace.digest, trace.origin, tuple(rows), about, range_m=range_m)
        imported[car] = ImportedCar(trace, table)
    return imported


def write_cars(out: str | Path, cars: Mapping[str, ImportedCar]) -> list[str]:
    """Writes ``CAR.parquet`` of every car into a folder, with ``CAR.truth.parquet`` beside it if
    there is a truth table, and returns a line about each car.

    Raises UserError, before it writes, where a file of somebody else or the truth table of another
    import is in the way.
    """
    paths = {car: Path(out) / f"{car}.parquet" for car in cars}
    for car, path in paths.items():
        check_replaceable(path)
        beside = path_beside(path)
        check_truth_replaceable(beside)
        if cars[car].truth is None and beside.exists():
            raise UserError(f"{beside}: is of another import; take it away, or give --truth")
    lines = []
    for car, (trace, truth) in cars.items():
        line = write_told(paths[car], trace)
        if truth is not None:
            write_truth(path_beside(paths[car]), truth)
            visible = sum(row.visible for row in truth.rows)
            line += f", objects visible {visible:,} times"
        lines.append(line)
    return lines


def write_told(path: Path, trace: Trace) -> str:
    """Writes a trace; returns a line about it."""
    write_trace(path, trace)
    frames = trace.by_picture.values()
    detections = sum(len(frame.detections) for frame in frames)
    return f"{path}: {len(frames)} frames, {detections} detections, content {trace.digest[:12]}"


def check_distances(
    report: ImportReport, distances_m: Sequence[float], path: Path | None = None
) -> None:
    """How far away the objects in a file are. Raises UserError, naming ``path``, where most are
    beyond what a sensor sees.
    """
    report.span("objects", distances_m, "m away")
    far = sum(distance_m > FARTHEST_M for distance_m in distances_m)
    text = f"{far:,} of {len(distances_m):,} objects are more than {FARTHEST_M:g} m away"
    if 2 * far > len(distances_m):
        report.refuse(f"{text}: are they in the car's frame, not on the plane of its poses?", path)
    elif far:
        report.warn(text)


def _in_order(
    car: _Car, views: Sequence[_View], first_ns: int, report: ImportReport
) -> list[_View]:
    """The frames of a car, camera by camera in order of time, with numbers, and stamps from
    ``first_ns`` on.
    """
    by_camera: dict[str, list[_View]] = {}
    for view in views:
        by_camera.setdefault(view.frame.camera, []).append(view)
    ordered = []
    for camera, of_camera in sorted(by_camera.items()):
        spaced: list[_View] = []
        name = car.camera(camera)
        for frame, there in report.in_order(name, of_camera, key=lambda view: view[0].stamp_ns):
            stamp_ns = frame.stamp_ns - first_ns
            if not spaced or stamp_ns - spaced[-1].frame.stamp_ns >= CLOSEST_NS:
                index = len(spaced) if frame.index == COUNTED else frame.index
                spaced.append(_View(replace(frame, index=index, stamp_ns=stamp_ns), there))
        report.check_dropped(
            f"frames of {name}", len(spaced), len(of_camera), "within a millisecond of another"
        )
        ordered += spaced
    return ordered


def _with_shared_features(
    car: _Car, cameras: Mapping[str, Sequence[TraceFrame]], report: ImportReport
) -> dict[str, Sequence[TraceFrame]]:
    """The frames with those features that all cameras of a car have: a lidar, say, has none."""
    names = {camera: {*frames[0].features} for camera, frames in cameras.items()}
    shared, kept = set.intersection(*names.values()), dict(cameras)
    for camera, frames in cameras.items():
        for name in sorted(names[camera] - shared):
            why = f"features {name!r} of {car.camera(camera)}, which another has not"
            report.leave_out(why, len(frames))
            kept[camera] = [
                replace(
                    frame, features={n: frame.features[n] for n in frame.features if n in shared}
                )
                for frame in frames
            ]
    return kept


def _check_ways(
    car: _Car, cameras: Mapping[str, Sequence[TraceFrame]], first_ns: int, report: ImportReport
) -> None:
    """When and where each camera was, and whether one of them looks where the car drives."""
    courses: dict[str, tuple[Array, Array, Array]] = {}
    for camera, frames in cameras.items():
        pictured = [frame for frame in frames if frame.kind == "camera"]
        name = car.camera(camera) if pictured or len(cameras) > 1 else car.name
        report.read(f"images of {name}" if pictured else "poses", len(frames))
        times_s = np.array([frame.stamp_ns for frame in frames]) / NS_PER_S
        poses = np.array([frame.pose for frame in frames])
        report.span("times", times_s[[0, -1]] + first_ns / NS_PER_S, "s")
        for axis, values in zip(("east", "north"), poses.T, strict=False):
            report.span(axis, values.round(POSITION_DECIMALS), "m")
        report.span("width", {frame.width for frame in pictured}, "px")
        report.span("height", {frame.height for frame in pictured}, "px")
        report.warn_unusual(
            f"{name}: a frame takes", frames[0].size_bytes / 1e6, "MB", USUAL_MB, "to send"
        )
        sizes = sorted({(frame.width, frame.height) for frame in pictured})
        if len(sizes) > 1:
            several = ", ".join(f"{width}x{height}" for width, height in sizes[:3])
            report.warn(f"{name}: pictures of {len(sizes)} sizes, such as {several} pixels")
        report.check_way(name, times_s.tolist(), poses[:, :2])
        courses[name] = poses[:-1, 3], np.diff(poses[:, :2], axis=0), np.diff(times_s)
    # of several cameras some look aside
    ahead = min(courses, key=lambda name: askew_rad(*courses[name]))
    heading_rad, steps_m, passed_s = courses[ahead]
    heading_deg = np.degrees(heading_rad)
    report.check_heading(f"{ahead}: the heading", heading_deg, steps_m=steps_m, passed_s=passed_s)


def _check_detections(
    cars: Mapping[str, Mapping[str, Sequence[TraceFrame]]],
    report: ImportReport,
    range_m: float,
    detected_in: Path | None,
) -> None:
    """How many detections there are, and whether they are where the sensors look."""
    frames = [frame for cameras in cars.values() for of in cameras.values() for frame in of]
    labels = Counter(found.label for frame in frames for found in frame.detections)
    distances_m: list[float] = []
    outside, doubled = 0, 0
    for frame in frames:
        sector = ViewSector(frame.pose, frame.horizontal_fov_rad)
        places = [found.location for found in frame.detections if found.location]
        doubled += len(places) - len(set(places))
        distances_m += [math.dist(place[:2], frame.pose[:2]) for place in places]
        outside += sum(sector.distance_m(*place[:2]) is None for place in places)
    count = labels.total()
    report.read("detections", count)
    others = Counter({label: many for label, many in labels.items() if label not in ROAD_LABELS})
    report.check_labels(count - others.total(), others, detected_in)
    if distances_m and min(distances_m) > range_m + BEYOND_M:
        report.refuse(
            f"all {len(distances_m):,} detections are {min(distances_m):,.0f} m or more from their "
            f"cars, beyond the range of {range_m:g} m: are they in the car's frame, not on the "
            "plane of its poses?",
            detected_in,
        )
    if distances_m and max(distances_m) < NEAREST_M:
        report.refuse(
            f"all {len(distances_m):,} detections are within {max(distances_m):.2g} m of their "
            "cars: are their places in metres?",
            detected_in,
        )
    if doubled:
        text = f"{doubled:,} of {len(distances_m):,} detections are at the very place of another"
        if doubled > max(FEW, SAME_SHARE * len(distances_m)):
            report.refuse(f"{text} in the same frame: are their places unknown?", detected_in)
        else:
            report.warn(f"{text} in the same frame")
    check_distances(report, distances_m, detected_in)
    if outside > OUTSIDE_SHARE * len(distances_m):
        report.warn(
            f"{outside:,} of {len(distances_m):,} detections are outside of the field of view: "
            "are heading and field of view as they are told?"
        )
    if 2 * len(distances_m) < count:
        report.warn(f"{count - len(distances_m):,} of {count:,} detections have no place")


def truth_row(frame: TraceFrame, there: TruthObject) -> TruthRow:
    """An object in view of a frame, with the class and the decimals that a truth table keeps."""
    known = there._replace(label=class_of(there.label))[:-3]
    place = rounded(there[-3:], POSITION_DECIMALS)
    return TruthRow(frame.camera, frame.index, frame.stamp_ns, *known, *place)


def _check_truth(
    objects: Sequence[tuple[TraceFrame, TruthRow]],
    report: ImportReport,
    range_m: float,
    truth_in: Path | None,
) -> None:
    """Raises UserError for objects of no class, at no place, or none of them near a car."""
    check_rows(truth_in or report.path, [row for _, row in objects])
    if not any(row.visible for _, row in objects):
        report.warn("no object of the truth is ever visible")
    away_m = (math.dist(row.location[:2], frame.pose[:2]) for frame, row in objects)
    if min(away_m, default=math.inf) > range_m + BEYOND_M:
        report.refuse(
            f"no object is ever within {range_m + BEYOND_M:g} m of a car: are the places on "
            "the plane of the poses?",
            truth_in,
        )
