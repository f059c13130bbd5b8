"""What the answers are worth: the objects a consumer holds at each instant, against KITTI's own labels.

The paper does not measure it. A consumer holds, of each camera stream, the objects of its newest answer; together they
are compared every 100 ms with the labelled objects in view at that instant. KITTI's annotators did not label
everything, so precision is a lower bound and ghosts an upper one; both are the same for all methods.
"""

from __future__ import annotations

import functools
import math
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from genie_sim.messages import CameraPose, Location
from genie_sim.paper.evidence import interval
from genie_sim.paper.facts import ratio
from genie_sim.paper.replicate import Answer, Held, Job, prepare_job, run_for_answers
from genie_sim.paths import expanded
from genie_sim.perception.labels import Labels, distance_m, read_tracklets
from genie_sim.perception.trace import Trace

KITTI = "GENIE_SIM_KITTI"
KINDS = {"car": ("vehicle",), "truck": ("vehicle",), "bus": ("vehicle",), "person": ("person", "cyclist")}
SAME_M = 2.0  # an object is a labelled one within this distance: half of what separates parked cars
MERGE_M = 1.0  # objects of two streams nearer than this are one
RANGE_M = 40.0  # where KITTI's labels end
STEP_NS = 100_000_000
VIEW = "02"  # the recording whose field of view counts

Object = tuple[str, Location]
There = tuple[str, bool, Location]  # of a labelled object: its kind, whether it moves, and where it is


@dataclass
class Count:
    """Sums over instants and cars."""

    held: int = 0
    right: int = 0
    moved_away: int = 0
    never_there: int = 0
    truth: dict[bool, int] = field(default_factory=lambda: {False: 0, True: 0})  # by whether it moves
    found: dict[bool, int] = field(default_factory=lambda: {False: 0, True: 0})
    ages_s: list[float] = field(default_factory=list)
    errors_m: list[float] = field(default_factory=list)

    def numbers(self) -> dict[str, float]:
        """Shares, ages and errors; NaN where nothing was held or there."""
        return {
            "precision": ratio(self.right, self.held),
            "recall_static": ratio(self.found[False], self.truth[False]),
            "recall_moving": ratio(self.found[True], self.truth[True]),
            "ghost_share": ratio(self.moved_away + self.never_there, self.held),
            "ghost_share_moved_away": ratio(self.moved_away, self.held),
            "ghost_share_never_there": ratio(self.never_there, self.held),
            "age_s_median": float(np.median(self.ages_s)) if self.ages_s else math.nan,
            "age_s_p95": float(np.percentile(self.ages_s, 95)) if self.ages_s else math.nan,
            "error_m_median": float(np.median(self.errors_m)) if self.errors_m else math.nan,
        }


def labels_are_here() -> bool:
    """Whether the environment says where KITTI is."""
    return bool(os.environ.get(KITTI))


def measure_job(job: Job) -> dict[str, dict[str, float]]:
    """Simulates one job and compares; the numbers by method."""
    prepared = prepare_job(job)
    trace = next(iter(prepared.drives.values()))
    assert isinstance(trace, Trace), "the evaluation drives recorded streets"
    truth = _truth(expanded(os.environ[KITTI]), str(trace.provenance["drive"]), trace.origin)
    windows = {car.name: car.route.window_ns for car in prepared.scenario.cars}
    return {method: measure(held, trace, truth, windows) for method, held in run_for_answers(prepared).items()}


class Truth:
    """The labelled objects of a drive at any instant, remembered: very many cars and runs ask for the same ones."""

    def __init__(self, labels: Labels) -> None:
        self._tracks = [(track, track.moving) for track in labels.tracks]
        self._at: dict[int, list[There]] = {}

    def at(self, drive_ns: int) -> list[There]:
        if drive_ns not in self._at:
            places = ((track.kind, moving, track.at(drive_ns)) for track, moving in self._tracks)
            self._at[drive_ns] = [(kind, moving, at) for kind, moving, at in places if at is not None]
        return self._at[drive_ns]


def measure(
    held: Held, trace: Trace, truth: Truth, windows_ns: Mapping[str, tuple[int, int] | None]
) -> dict[str, float]:
    """The numbers of one method in one run, over all cars and instants."""
    count, seen_ns, frames = Count(), _first_seen(trace), trace.frames[VIEW]
    stamps_ns = np.array([frame.stamp_ns for frame in frames])
    for car, answers in held.answers.items():
        late_ns = held.late_ns[car]
        begin_ns, end_ns = windows_ns[car] or (0, frames[-1].stamp_ns)
        instants = range(begin_ns, min(end_ns, frames[-1].stamp_ns), STEP_NS)
        for drive_ns, holding in zip(instants, _holding(answers, [one + late_ns for one in instants]), strict=True):
            frame = frames[int(np.argmin(np.abs(stamps_ns - drive_ns)))]
            pose = _View(frame.pose, frame.horizontal_fov_rad / 2)
            objects = [one for one in holding if one[0] in KINDS and pose.sees(one[1])]
            _compare(count, objects, [one for one in truth.at(drive_ns) if pose.sees(one[2])], truth, seen_ns)
            for label, at in objects:
                ages = _ages_ns(seen_ns[label, at], drive_ns + late_ns, held.late_ns, windows_ns)
                count.ages_s.append(min(ages, default=0) / 1e9)
    return count.numbers()


def summarise(runs: Sequence[Mapping[str, Mapping[str, float]]], seeds: int) -> list[dict[str, Any]]:
    """Means and 95 % intervals over seeds of each number, by method. ``runs`` are ordered scenario by scenario, each
    with the same seeds."""
    rows: list[dict[str, Any]] = []
    for method in runs[0]:
        for name in runs[0][method]:
            table = np.array([run[method][name] for run in runs]).reshape(-1, seeds)
            mean, low, high = interval(np.nanmean(table, axis=0))
            rows.append({"method": method, "name": name, "value": mean, "low": low, "high": high, "n": seeds})
    return rows


def _compare(
    count: Count,
    objects: Sequence[Object],
    there: Sequence[There],
    truth: Truth,
    seen_ns: Mapping[Object, int],
) -> None:
    """Pairs what is held with what is there, nearest first, each once."""
    pairs = sorted(
        (distance_m(at, place), i, j)
        for i, (label, at) in enumerate(objects)
        for j, (kind, _, place) in enumerate(there)
        if kind in KINDS[label] and distance_m(at, place) <= SAME_M
    )
    right: set[int] = set()
    found: set[int] = set()
    for error_m, i, j in pairs:
        if i not in right and j not in found:
            right.add(i)
            found.add(j)
            count.errors_m.append(error_m)
    count.held += len(objects)
    count.right += len(right)
    for j, (_, moving, _) in enumerate(there):
        count.truth[moving] += 1
        count.found[moving] += j in found
    for i, (label, at) in enumerate(objects):
        if i not in right:
            was_there = any(
                kind in KINDS[label] and distance_m(at, place) <= SAME_M
                for kind, _, place in truth.at(seen_ns[label, at])
            )
            count.moved_away += was_there
            count.never_there += not was_there


def _holding(answers: Sequence[Answer], instants_ns: Sequence[int]) -> Iterator[list[Object]]:
    """At each instant, the objects of each stream's newest answer so far; of several at one place the first."""
    newest: dict[str, Answer] = {}
    coming = 0
    for now_ns in instants_ns:
        while coming < len(answers) and answers[coming].t_ns <= now_ns:
            answer = answers[coming]
            held = newest.get(answer.stream)
            if held is None or answer.stamp_ns >= held.stamp_ns:
                newest[answer.stream] = answer
            coming += 1
        kept: list[Object] = []
        places: dict[str, list[Location]] = {}
        for stream in sorted(newest):
            for label, at in newest[stream].objects:
                others = places.setdefault(label, [])
                if not any(abs(at[0] - one[0]) < MERGE_M and distance_m(at, one) < MERGE_M for one in others):
                    others.append(at)
                    kept.append((label, at))
        yield kept


def _first_seen(trace: Trace) -> dict[Object, int]:
    """When in the drive a location was detected: a map keeps an object's first location, so this dates it."""
    seen: dict[Object, int] = {}
    for sequence in trace.frames.values():
        for frame in sequence:
            for one in frame.detections:
                if one.location is not None:
                    seen.setdefault((one.label, one.location), frame.stamp_ns)
    return seen


def _ages_ns(
    seen_ns: int, now_ns: int, late_ns: Mapping[str, int], windows_ns: Mapping[str, tuple[int, int] | None]
) -> Iterator[int]:
    """How long ago each car that drove there took the picture; the youngest counts, so an age is a lower bound."""
    for car, late in late_ns.items():
        window = windows_ns[car]
        if (window is None or window[0] <= seen_ns < window[1]) and seen_ns + late <= now_ns:
            yield now_ns - seen_ns - late


@dataclass(frozen=True, slots=True)
class _View:
    pose: CameraPose
    half_fov_rad: float

    def sees(self, at: Location) -> bool:
        east_m, north_m = at[0] - self.pose.east_m, at[1] - self.pose.north_m
        bearing = math.remainder(math.atan2(north_m, east_m) - self.pose.heading_rad, 2 * math.pi)
        return math.hypot(east_m, north_m) <= RANGE_M and abs(bearing) <= self.half_fov_rad


@functools.cache
def _truth(*place: Any) -> Truth:
    return Truth(read_tracklets(*place))
