"""The claims on other drives: every sequence of KITTI's tracking benchmark, so that no conclusion hangs on one street.

Declared before any of it was run:

- *Sequences*: all that the folder holds; the paper does not say which drives it played.
- *Detections*: PointRCNN's as published, from a score of 0.3 on. They have places in space; no pictures are needed.
- *Scenarios*: the three cars of ``3car_homo`` and ``3car_hetero``, as shipped but for two things. All four streams show
  recording 02, the only one that has detections. The cars' windows keep their proportion to the drive: each car 60 % of
  it, a fifth ahead of the car before.
- *Nothing is fitted*: neither the overlap nor the gate of the paper's evaluation, which were calibrated on one drive.
- *One seed*: the drive is what is replicated. Cars set off up to 100 ms later, as always.

Similarities that look at pictures (``exact``, ``dhash``) mean nothing here; ``pose_grid``, the default, does not.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from genie_sim.analysis.metrics import PLACEMENTS
from genie_sim.errors import UserError
from genie_sim.paper.checks import BASELINES
from genie_sim.paper.facts import Facts, ratio
from genie_sim.paper.replicate import Progress, in_parallel, outcome_of
from genie_sim.paths import expanded
from genie_sim.perception.sources import Recordings
from genie_sim.perception.tracking import CAMERA, FRAME_NS, sequences, tracking_trace
from genie_sim.recording import provenance
from genie_sim.runner import Prepared, on_frames
from genie_sim.scenario.scenario import load_scenario
from genie_sim.units import NS_PER_S

KITTI = "GENIE_SIM_KITTI"
SCENARIOS = ("3car_homo", "3car_hetero")
DETECTIONS = "pointrcnn"
MIN_SCORE = 0.3
SEED = 1
SHARE, AHEAD = 0.6, 0.2  # of the drive: what a car drives, and how far it is ahead of the car before

FACTS = (
    *(f"improvement_{answer}_answer:{baseline}" for answer in ("first", "fresh") for baseline in BASELINES.values()),
    "under_deadline_share:genie",
    *(f"{name}:{where}" for name in ("image_reuse", "object_reuse", "confidence_boost") for where in PLACEMENTS),
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class DriveJob:
    """One run: a scenario on a sequence of the tracking benchmark in ``root``."""

    root: Path
    sequence: str
    scenario: str


@dataclass(frozen=True, slots=True)
class Driven:
    """What a run gave; ``drive_s`` is how long the whole drive is."""

    sequence: str
    scenario: str
    drive_s: float
    facts: Facts


OfDrive = Mapping[str, Facts]  # by scenario


@dataclass(frozen=True, slots=True)
class Direction:
    """One claim as a number of each drive, which the paper says is more than ``bound``."""

    claim: str
    says: str
    number: Callable[[OfDrive], float]
    bound: float = 0.0


def _values(drive: OfDrive, *names: str) -> list[float]:
    return [facts.get(name, math.nan) for facts in drive.values() for name in names]


def _both(name: str) -> list[str]:
    """The fact over both baselines, or of the Genies on cars and on edges."""
    return [f"{name}:{what}" for what in (BASELINES.values() if name.startswith("improvement") else PLACEMENTS)]


def _mean(drive: OfDrive, name: str) -> float:
    return float(np.mean(_values(drive, *_both(name))))


def _least_gap(drive: OfDrive, name: str) -> float:
    """Edges minus cars, in the scenario where it is smaller."""
    on_cars, on_edges = (_values(drive, f"{name}:{placement}") for placement in PLACEMENTS)
    return float(np.min(np.subtract(on_edges, on_cars)))


def _faster_server(drive: OfDrive, name: str) -> float:
    """Heterogeneous minus homogeneous, mean over cars and edges."""
    homo, hetero = (_mean({scenario: drive[scenario]}, name) for scenario in SCENARIOS)
    return hetero - homo


DIRECTIONS = (
    Direction(
        "C1",
        "improvement over local and remote, first answer (the paper: 0.82)",
        lambda d: _mean(d, "improvement_first_answer"),
    ),
    Direction("C1", "the same, fresh answer", lambda d: _mean(d, "improvement_fresh_answer")),
    Direction("C4", "smallest of these, first answer", lambda d: min(_values(d, *_both("improvement_first_answer")))),
    Direction("C3", "share of frames answered in 33 ms", lambda d: min(_values(d, "under_deadline_share:genie")), 0.99),
    Direction(
        "C13",
        "object reuse / image reuse (the paper: 4)",
        lambda d: ratio(_mean(d, "object_reuse"), _mean(d, "image_reuse")),
        1.0,
    ),
    Direction("C16", "object reuse, heterogeneous - homogeneous", lambda d: _faster_server(d, "object_reuse")),
    Direction("C18", "image reuse, remote - local", lambda d: _least_gap(d, "image_reuse")),
    Direction("C21", "image reuse, heterogeneous - homogeneous", lambda d: _faster_server(d, "image_reuse")),
    Direction("C22", "confidence boost, remote - local", lambda d: _least_gap(d, "confidence_boost")),
    Direction("C24", "confidence boost, heterogeneous - homogeneous", lambda d: _faster_server(d, "confidence_boost")),
    Direction("C26", "smallest confidence boost", lambda d: min(_values(d, *_both("confidence_boost")))),
)


def jobs() -> list[DriveJob]:
    """Every scenario on every sequence in $GENIE_SIM_KITTI/tracking. UserError where there is none."""
    place = os.environ.get(KITTI)
    if not place:
        raise UserError(f"drives: set {KITTI} to KITTI's folder, which holds tracking/training and tracking/detections")
    root = expanded(place) / "tracking"
    found = sequences(root)
    if not found:
        raise UserError(f"{root}: no sequences of KITTI's tracking benchmark here (training/oxts/0000.txt)")
    return [DriveJob(root, sequence, scenario) for sequence in found for scenario in SCENARIOS]


def prepare_drive(job: DriveJob) -> Prepared:
    """The scenario on the sequence. Raises ``UserError``."""
    trace = tracking_trace(job.root, job.sequence, DETECTIONS, MIN_SCORE)
    drive_s = len(trace.frames[CAMERA]) * FRAME_NS / NS_PER_S
    settings = []
    for index in range(len(load_scenario(job.scenario).cars)):
        begin_s = index * AHEAD * drive_s
        settings.append(f"cars[{index}].route.window=[{begin_s:.3f} s, {begin_s + SHARE * drive_s:.3f} s]")
    scenario = load_scenario(job.scenario, settings, SEED)
    cameras = tuple(camera.model_copy(update={"recording": CAMERA}) for camera in scenario.cameras)
    scenario = scenario.model_copy(update={"cameras": cameras})
    return on_frames(scenario, Recordings(trace))


def run_drive(job: DriveJob) -> Driven:
    """Simulates one job."""
    prepared = prepare_drive(job)
    drive_s = len(next(iter(prepared.drives.values())).frames[CAMERA]) * FRAME_NS / NS_PER_S
    return Driven(job.sequence, job.scenario, drive_s, outcome_of(prepared).facts)


def run_drives(jobs: Sequence[DriveJob], workers: int, progress: Progress | None = None) -> list[Driven]:
    """Simulates every job, on several processes."""
    return in_parallel(run_drive, jobs, workers, progress, "drives")


def rows(driven: Sequence[Driven]) -> list[dict[str, Any]]:
    """One row for each run, for ``drives.csv``."""
    return [
        {"sequence": one.sequence, "scenario": one.scenario, "drive_s": one.drive_s}
        | {name: _rounded(one.facts.get(name, math.nan)) for name in FACTS}
        for one in driven
    ]


def directions(driven: Sequence[Driven]) -> list[dict[str, Any]]:
    """For each claim its number on each drive, their median and range, and on how many drives it holds."""
    by_drive: dict[str, dict[str, Facts]] = {}
    for one in driven:
        by_drive.setdefault(one.sequence, {})[one.scenario] = one.facts
    found = []
    for direction in DIRECTIONS:
        numbers = {sequence: direction.number(drive) for sequence, drive in by_drive.items()}
        known = [number for number in numbers.values() if not math.isnan(number)]
        found.append(
            {
                "claim": direction.claim,
                "says": direction.says,
                "bound": direction.bound,
                "median": _rounded(float(np.median(known))) if known else None,
                "low": _rounded(min(known)) if known else None,
                "high": _rounded(max(known)) if known else None,
                "holds": sum(number > direction.bound for number in known),
                "drives": len(known),
                "numbers": {sequence: _rounded(number) for sequence, number in numbers.items()},
            }
        )
    return found


def write(folder: Path, driven: Sequence[Driven]) -> str:
    """``drives.csv`` (each run), ``drives.json`` (each claim on each drive), a part of ``verdicts.md``; its table."""
    import pandas as pd

    found = directions(driven)
    with (folder / "drives.csv").open("w", encoding="utf-8", newline="") as file:  # of a path pandas makes a URI
        pd.DataFrame(rows(driven)).to_csv(file, index=False)
    provenance.write_json(folder / "drives.json", found)
    count = len({one.sequence for one in driven})
    about = f"{count} sequences of KITTI's tracking benchmark, three cars, PointRCNN's detections:"
    with (folder / "verdicts.md").open("a", encoding="utf-8") as document:
        document.write(f"\n## On other drives\n\n{about}\n\n{markdown(found)}\n")
    return markdown(found)


def markdown(found: Sequence[Mapping[str, Any]]) -> str:
    """The claims over the drives as a table."""
    lines = ["| | number of each drive | claimed | median (range) | holds |", "|---|---|---|---|---|"]
    for one in found:
        spread = "-" if one["median"] is None else "{median:.3g} ({low:.3g} to {high:.3g})".format_map(one)
        lines.append(
            f"| {one['claim']} | {one['says']} | > {one['bound']:g} | {spread} | {one['holds']} of {one['drives']} |"
        )
    return "\n".join(lines)


def _rounded(value: float) -> float | None:
    return None if math.isnan(value) else float(f"{value:.6g}")
