"""The claims on other drives: every sequence of KITTI's tracking benchmark, so that no conclusion hangs on one street.

Declared before any of it was run:

- *Sequences*: all that the folder holds; the paper does not say which drives it played.
- *Detections*: PointRCNN's as published, from a score of 0.3 on. They have places in space; no pictures are needed.
- *Scenarios*: the three cars of ``3car_homo`` and ``3car_hetero``, as shipped but for two things. All four streams show
  recording 02, the only one that has detections. The cars' windows keep their proportion to the drive: each car 60 % of
  it, a fifth ahead of the car before.
- *Nothing is fitted*: neither the overlap nor the gate of the paper's evaluation, which were calibrated on one drive.
- *Seeds*: five of each drive, 2 to 6, with a 95 % t interval for the drive; seed 1 had been looked at before. A claim
  *holds* on a drive whose interval lies above its bound, is *contrary* where it lies below, else *open*.
- *Labels*: where the folder has them, what consumers hold is judged by them, as on the drive of the evaluation.
- *Hypothesis about C18*, formed on one seed of other drives of the benchmark: the number of a drive (image reuse on
  edges less that on cars, mean over seeds) falls with the share of its successive frames that fall into one image cell.
  Test: least squares over the drives; it is supported if the 95 % t interval of the slope lies below zero.

Similarities that look at pictures (``exact``, ``dhash``) mean nothing here; ``pose_grid``, the default, does not.
"""

import logging
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from genie_sim import plugins
from genie_sim.analysis import text_table
from genie_sim.analysis.metrics import PLACEMENTS
from genie_sim.analysis.statistics import t_quantile
from genie_sim.build import Prepared
from genie_sim.core.genies import SIMILARITY_METHODS
from genie_sim.core.similarity import SIMILARITIES
from genie_sim.errors import UserError
from genie_sim.messages import Header, Image
from genie_sim.paper.checks import BASELINES
from genie_sim.paper.evidence import interval, rounded
from genie_sim.paper.facts import METHODS, ratio
from genie_sim.paper.replicate import outcome_of
from genie_sim.perception.sources import Recordings
from genie_sim.perception.trace import Trace
from genie_sim.perception.tracking import CAMERA, FRAME_NS, sequences, tracking_trace
from genie_sim.perception.truth_table import make_truth
from genie_sim.recording import provenance
from genie_sim.runner import on_frames
from genie_sim.scenario.scenario import Scenario, load_scenario
from genie_sim.units import NS_PER_S

SCENARIOS = ("3car_homo", "3car_hetero")
DETECTIONS = "pointrcnn"
MIN_SCORE = 0.3
SEEDS = (2, 3, 4, 5, 6)
SHARE, AHEAD = (
    0.6,
    0.2,
)  # of the drive: what a car drives, and how far it is ahead of the car before
SAME_CELL = "same_cell_share"
FIRST = "improvement_first_answer"

FACTS = (
    SAME_CELL,
    *(f"improvement_{answer}_answer:{baseline}" for answer in ("first", "fresh") for baseline in BASELINES.values()),
    "under_deadline_share:genie",
    *(f"{name}_reuse{how}:{where}" for name in ("image", "object") for how in ("", "_pooled") for where in PLACEMENTS),
    *(f"confidence_boost:{where}" for where in PLACEMENTS),
    *(f"{name}:{method.name}" for name in ("object_precision", "ghost_share") for method in METHODS),
)  # fmt: skip

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class DriveJob:
    """One run: a scenario on a sequence of the tracking benchmark in KITTI's folder ``root``, with a seed."""

    root: Path
    sequence: str
    scenario: str
    seed: int


Row = dict[
    str, Any
]  # of one run: sequence, scenario, seed, drive_s (how long the whole drive is), and FACTS
OfDrive = Mapping[str, Row]  # by scenario


@dataclass(frozen=True, slots=True)
class Direction:
    """One claim as a number of each drive and seed, made of a fact, which the paper says is more than
    ``bound``; without a ``claim``, what is worth knowing beside the paper's."""

    claim: str
    says: str
    number: Callable[[OfDrive, str], float]
    name: str  # of the fact
    bound: float = 0.0


def _values(drive: OfDrive, name: str) -> list[float]:
    """The fact in every scenario; one with a role or a baseline over both baselines, or on cars and on edges."""
    of = (
        f"{name}:{what}"
        for what in (BASELINES.values() if name.startswith("improvement") else PLACEMENTS)
    )
    names = [name] if ":" in name else list(of)
    return [row[one] for row in drive.values() for one in names]


def _mean(drive: OfDrive, name: str) -> float:
    return float(np.mean(_values(drive, name)))


def _least(drive: OfDrive, name: str) -> float:
    return min(_values(drive, name))


def _least_gap(drive: OfDrive, name: str) -> float:
    """Edges minus cars, in the scenario where it is smaller."""
    on_cars, on_edges = (_values(drive, f"{name}:{placement}") for placement in PLACEMENTS)
    return float(np.min(np.subtract(on_edges, on_cars)))


def _over_remote(drive: OfDrive, name: str) -> float:
    """Genie minus remote execution, mean over the scenarios."""
    genie, remote = (_values(drive, f"{name}:{method}") for method in ("genie", "remote"))
    return float(np.mean(np.subtract(genie, remote)))


def _faster_server(drive: OfDrive, name: str) -> float:
    """Heterogeneous minus homogeneous, mean over cars and edges."""
    homo, hetero = (_mean({scenario: drive[scenario]}, name) for scenario in SCENARIOS)
    return hetero - homo


def _over_images(drive: OfDrive, name: str) -> float:
    return ratio(_mean(drive, name), _mean(drive, "image_reuse"))


DIRECTIONS = (
    Direction(
        "C1", "improvement over local and remote, first answer (the paper: 0.82)", _mean, FIRST
    ),
    Direction("C1", "the same, fresh answer", _mean, "improvement_fresh_answer"),
    Direction("C4", "smallest of these, first answer", _least, FIRST),
    Direction(
        "C3", "share of frames answered in 33 ms", _least, "under_deadline_share:genie", 0.99
    ),
    Direction(
        "C13", "object reuse / image reuse (the paper: 4)", _over_images, "object_reuse", 1.0
    ),
    Direction("C16", "object reuse, heterogeneous - homogeneous", _faster_server, "object_reuse"),
    Direction("C18", "image reuse, remote - local", _least_gap, "image_reuse"),
    Direction("C18", "the same, pooled over Genies", _least_gap, "image_reuse_pooled"),
    Direction("C21", "image reuse, heterogeneous - homogeneous", _faster_server, "image_reuse"),
    Direction("C22", "confidence boost, remote - local", _least_gap, "confidence_boost"),
    Direction(
        "C24", "confidence boost, heterogeneous - homogeneous", _faster_server, "confidence_boost"
    ),
    Direction("C26", "smallest confidence boost", _least, "confidence_boost"),
    Direction("", "share of ghosts in what is held, Genie - remote", _over_remote, "ghost_share"),
)
C18 = next(direction for direction in DIRECTIONS if direction.claim == "C18")


def jobs() -> list[DriveJob]:
    """Every scenario and seed on every sequence in $GENIE_SIM_KITTI/tracking that can be read; a log line says which
    can not, and why. UserError where there is none."""
    from genie_sim.perception.perceive import kitti_folder

    root = kitti_folder(None)
    found = sequences(root / "tracking" / "training")
    if not found:
        raise UserError(
            f"{root / 'tracking'}: no sequences of KITTI's tracking benchmark here (training/oxts/0000.txt)"
        )
    usable = []
    for sequence in found:
        try:
            prepare_drive(DriveJob(root, sequence, SCENARIOS[0], SEEDS[0]))
        except UserError as error:
            log.warning("drives: sequence %s is left out: %s", sequence, error)
        else:
            usable.append(sequence)
    if not usable:
        raise UserError(f"{root / 'tracking'}: none of the {len(found)} sequences here can be used")
    return [
        DriveJob(root, sequence, scenario, seed)
        for sequence in usable
        for scenario in SCENARIOS
        for seed in SEEDS
    ]


@lru_cache(maxsize=1)
def _recordings(root: Path, sequence: str) -> Recordings:
    """The trace of a sequence, and what is really there, if the folder has its labels. Raises ``UserError``."""
    trace = tracking_trace(root / "tracking", sequence, DETECTIONS, MIN_SCORE)
    labelled = (root / "tracking" / "training" / "label_02" / f"{sequence}.txt").is_file()
    return Recordings(
        trace, truth=make_truth(root, f"tracking/{sequence}", trace) if labelled else None
    )


def prepare_drive(job: DriveJob) -> Prepared:
    """The scenario on the sequence. Raises ``UserError``."""
    recordings = _recordings(job.root, job.sequence)
    drive_s = _drive_s(recordings.main)
    settings = []
    for index in range(len(load_scenario(job.scenario).cars)):
        begin_s = index * AHEAD * drive_s
        settings.append(
            f"cars[{index}].route.window=[{begin_s:.3f} s, {begin_s + SHARE * drive_s:.3f} s]"
        )
    scenario = load_scenario(job.scenario, settings, job.seed)
    cameras = tuple(camera.model_copy(update={"recording": CAMERA}) for camera in scenario.cameras)
    return on_frames(scenario.model_copy(update={"cameras": cameras}), recordings)


def run_drive(job: DriveJob) -> Row:
    prepared = prepare_drive(job)
    trace = _recordings(job.root, job.sequence).main
    facts = outcome_of(prepared).facts | {SAME_CELL: same_cell_share(prepared.scenario, trace)}
    about = {
        "sequence": job.sequence,
        "scenario": job.scenario,
        "seed": job.seed,
        "drive_s": _drive_s(trace),
    }
    return about | {name: rounded(facts.get(name, math.nan)) for name in FACTS}


def same_cell_share(scenario: Scenario, trace: Trace) -> float:
    """Of a drive's frames, the share to which a Genie's cache gives the key of the frame before."""
    key = plugins.make(
        "similarity", scenario.genie.similarity, SIMILARITIES, SIMILARITY_METHODS
    ).key
    frames = trace.frames[CAMERA]
    keys = [
        key(Image(Header(one.stamp_ns, CAMERA, ""), 0, one.digest, one.dhash, one.pose, 0.0))
        for one in frames
    ]
    return ratio(sum(before == after for before, after in pairwise(keys)), len(keys) - 1)


def _drive_s(trace: Trace) -> float:
    return len(trace.frames[CAMERA]) * FRAME_NS / NS_PER_S


def directions(driven: Sequence[Row]) -> list[dict[str, Any]]:
    """For each claim its number on each drive with a 95 % interval over seeds, the median and range of these, and on
    how many drives it holds, is contrary, and is open."""
    found = []
    for direction in DIRECTIONS:
        known = _intervals(direction, driven)
        means = [mean for mean, _, _ in known.values()]
        spread = (float(np.median(means)), min(means), max(means)) if means else (None, None, None)
        found.append(
            {
                "claim": direction.claim,
                "says": direction.says,
                "bound": direction.bound,
                **dict(zip(("median", "low", "high"), spread, strict=True)),
                "holds": sum(low > direction.bound for _, low, _ in known.values()),
                "contrary": sum(high <= direction.bound for _, _, high in known.values()),
                "drives": len(known),
                "numbers": known,
            }
        )
    return found


def _intervals(direction: Direction, driven: Sequence[Row]) -> dict[str, list[float]]:
    """Mean and interval of a claim's number on each drive where every seed gave one."""
    runs: dict[str, dict[int, dict[str, Row]]] = {}
    for row in driven:
        runs.setdefault(row["sequence"], {}).setdefault(row["seed"], {})[row["scenario"]] = row
    numbers = {
        drive: np.array([direction.number(run, direction.name) for run in seeds.values()])
        for drive, seeds in runs.items()
    }
    known = {
        name: interval(values) for name, values in numbers.items() if not np.isnan(values).any()
    }
    return {name: [rounded(end) for end in ends] for name, ends in known.items()}


def hypothesis(driven: Sequence[Row]) -> dict[str, Any] | None:
    """The declared test of C18: least squares of its number on the share of successive frames in one image cell, with
    the slope's 95 % t interval; ``zero_at`` is the share at which the line crosses zero. ``None`` where fewer than 3
    drives, or all alike, make no line."""
    from scipy.stats import linregress

    shares = {row["sequence"]: row[SAME_CELL] for row in driven}
    points = {name: [shares[name], mean] for name, (mean, _, _) in _intervals(C18, driven).items()}
    n = len(points)
    if n < 3 or not np.ptp(list(points.values()), axis=0).all():
        return None
    line = linregress(*zip(*points.values(), strict=True))
    half = t_quantile(n - 2) * line.stderr
    values = {
        "slope": line.slope,
        "low": line.slope - half,
        "high": line.slope + half,
        "r": line.rvalue,
        "zero_at": -line.intercept / line.slope,
    }
    found = {name: rounded(value) for name, value in values.items()}
    return {**found, "n": n, "supported": found["high"] < 0, "points": points}


def write(folder: Path, driven: Sequence[Row]) -> str:
    """``drives.csv`` (each run), ``drives.json`` (each claim on each drive), a part of ``verdicts.md``; its table."""
    import pandas as pd

    found = {
        "seeds": list(SEEDS),
        "directions": directions(driven),
        "hypothesis": hypothesis(driven),
    }
    with (folder / "drives.csv").open(
        "w", encoding="utf-8", newline=""
    ) as file:  # of a path pandas makes a URI
        pd.DataFrame(driven).to_csv(file, index=False)
    provenance.write_json(folder / "drives.json", found)
    table = markdown(found)
    count = len({row["sequence"] for row in driven})
    about = f"{count} sequences of KITTI's tracking benchmark, three cars, PointRCNN's detections:"
    with (folder / "verdicts.md").open("a", encoding="utf-8") as document:
        document.write(f"\n## On other drives\n\n{about}\n\n{table}\n")
    return table


def markdown(found: Mapping[str, Any]) -> str:
    """The claims over the drives as a table, and what became of the hypothesis."""
    rows = []
    for one in found["directions"]:
        spread = (
            "-"
            if one["median"] is None
            else "{median:.3g} ({low:.3g} to {high:.3g})".format_map(one)
        )
        holds, unclear = (
            f"{one['holds']} of {one['drives']}",
            one["drives"] - one["holds"] - one["contrary"],
        )
        rows.append(
            [
                one["claim"],
                one["says"],
                f"{one['bound']:g}",
                spread,
                holds,
                str(one["contrary"]),
                str(unclear),
            ]
        )
    headings = [
        "",
        "number of each drive",
        "more than",
        "median (range)",
        "holds",
        "contrary",
        "open",
    ]
    table, tested = text_table.markdown(headings, rows), found["hypothesis"]
    if tested is None:
        return table
    text = (
        "C18 on the share of successive frames in one image cell: slope {slope:.3g} ({low:.3g} to {high:.3g}), "
        "r = {r:.2f}, n = {n}, zero at {zero_at:.2f}. The hypothesis that it falls is {said}."
    )
    return f"{table}\n\n{text.format(**tested, said='supported' if tested['supported'] else 'not supported')}"
