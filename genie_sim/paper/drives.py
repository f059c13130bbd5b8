"""The claims on other drives: every sequence of KITTI's tracking benchmark, so that no conclusion
hangs on one street.

Declared before any of it was run:

- *Sequences*: all that the folder holds; the paper does not say which drives it played.
- *Detections*: PointRCNN's as published, from a score of 0.3 on. They have places in space; no
  pictures are needed.
- *Scenarios*: the three cars of ``3car_homo`` and ``3car_hetero``, as shipped but for two things.
  All four streams show recording 02, the only one that has detections. The cars' windows keep their
  proportion to the drive: each car 60 % of it, a fifth ahead of the car before.
- *Nothing is fitted*: neither the overlap nor the gate of the paper's evaluation, which were
  calibrated on one drive.
- *Seeds*: five of each drive, 2 to 6, with a 95 % t interval for the drive; seed 1 had been looked
  at before. A claim *holds* on a drive whose interval lies above its bound, is *contrary* where it
  lies below, else *open*.
- *Labels*: where the folder has them, what consumers hold is judged by them, as on the drive of the
  evaluation.
- *Hypothesis about C18*, formed on one seed of other drives of the benchmark: the number of a drive
  (image reuse on edges less that on cars, mean over seeds) falls with the share of its successive
  frames that fall into one image cell. Test: least squares over the drives; it is supported if the
  95 % t interval of the slope lies below zero.

Similarities that look at pictures (``exact``, ``dhash``) mean nothing here; ``pose_grid``, the
default, does not.
"""

import logging
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from genie_sim.analysis import text_table
from genie_sim.analysis.genie_metrics import PLACEMENTS
from genie_sim.analysis.statistics import t_quantile
from genie_sim.build import Prepared
from genie_sim.core.rules import SIMILARITY
from genie_sim.errors import UserError
from genie_sim.messages import Header, Image
from genie_sim.paper.checks import BASELINES
from genie_sim.paper.definitions import USUAL
from genie_sim.paper.evaluation_run import FRAMES_A_RUN, metrics_of, simulated
from genie_sim.paper.evidence import interval, rounded
from genie_sim.paper.facts import METHODS, Fact, placed, ratio
from genie_sim.paper.runs import facts_in, run_parts
from genie_sim.perception.sources import Recordings
from genie_sim.perception.trace import Trace
from genie_sim.perception.tracking import CAMERA, FRAME_NS, sequences, tracking_trace
from genie_sim.perception.truth_table import make_truth
from genie_sim.recording import provenance
from genie_sim.recording.results import Metric
from genie_sim.runner import facts as facts_of_outcome
from genie_sim.runner import on_frames
from genie_sim.scenario.scenario import Scenario, load_scenario
from genie_sim.study.parts import Parts, Progress
from genie_sim.study.tasks import Shared
from genie_sim.units import NS_PER_S

SCENARIOS = ("3car_homo", "3car_hetero")
DETECTIONS = "pointrcnn"
MIN_SCORE = 0.3
SEEDS = (2, 3, 4, 5, 6)
# of the drive: what a car drives, and how far it is ahead of the car before
SHARE, AHEAD = 0.6, 0.2
SAME_CELL = Fact("same_cell_share")
FIRST = "improvement_first_answer"

FACTS = (
    SAME_CELL,
    *(
        Fact(f"improvement_{answer}_answer", component=baseline)
        for answer in ("first", "fresh")
        for baseline in BASELINES.values()
    ),
    Fact("under_deadline_share"),
    *(
        placed(f"{name}_reuse{how}", placement)
        for name in ("image", "object")
        for how in ("", "_pooled")
        for placement in PLACEMENTS
    ),
    *(placed("confidence_boost", placement) for placement in PLACEMENTS),
    *(
        Fact(name, method.name)
        for name in ("object_precision", "ghost_share")
        for method in METHODS
    ),
)

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class DriveRun:
    """A scenario with a seed on a sequence of the tracking benchmark in KITTI's folder ``root``."""

    root: Path
    sequence: str
    scenario: str
    seed: int

    @property
    def run_id(self) -> str:
        """Names everything that decides the outcome."""
        return provenance.run_id(facts_of_outcome(self.prepare()))

    @property
    def frames(self) -> float:
        return FRAMES_A_RUN

    @property
    def place(self) -> str:
        return f"sequence {self.sequence}, {self.scenario}, seed {self.seed}"

    def measure(self, shared: Shared, folder: Path) -> Mapping[str, Sequence[Metric]]:
        """Simulates it; its facts as metrics."""
        prepared = self.prepare()
        _, judged = simulated(prepared)
        trace = _recordings(self.root, self.sequence).main
        share = same_cell_share(prepared.scenario, trace)
        return {self.run_id: metrics_of(judged[USUAL] | {SAME_CELL: share})}

    def prepare(self) -> Prepared:
        """The scenario on the sequence. Raises ``UserError``."""
        recordings = _recordings(self.root, self.sequence)
        drive_s = _drive_s(recordings.main)
        settings = []
        for index in range(len(load_scenario(self.scenario).cars)):
            begin_s = index * AHEAD * drive_s
            end_s = begin_s + SHARE * drive_s
            settings.append(f"cars[{index}].route.window=[{begin_s:.3f} s, {end_s:.3f} s]")
        scenario = load_scenario(self.scenario, settings, self.seed)
        cameras = tuple(replace(camera, recording=CAMERA) for camera in scenario.cameras)
        return on_frames(replace(scenario, cameras=cameras), recordings)


# Of one run: sequence, scenario, seed, drive_s (how long the whole drive is), and each of FACTS
# under its name in words, which is its column in drives.csv.
Row = dict[str, Any]
OfDrive = Mapping[str, Row]  # by scenario


@dataclass(frozen=True, slots=True)
class Direction:
    """One claim as a number of each drive and seed, made of a fact, which the paper says is more
    than ``bound``; without a ``claim``, what is worth knowing beside the paper's.
    """

    claim: str
    says: str
    number: Callable[[OfDrive, str], float]
    metric: str
    bound: float = 0.0


def _values(drive: OfDrive, metric: str) -> list[float]:
    """A metric's values in every scenario: an improvement's over both baselines, the Genies' on
    cars and on edges.
    """
    if metric.startswith("improvement"):
        facts = [Fact(metric, component=baseline) for baseline in BASELINES.values()]
    elif metric == "under_deadline_share":
        facts = [Fact(metric)]
    else:
        facts = [placed(metric, placement) for placement in PLACEMENTS]
    return _of_facts(drive, facts)


def _of_facts(drive: OfDrive, facts: Sequence[Fact]) -> list[float]:
    return [row[str(fact)] for row in drive.values() for fact in facts]


def _mean(drive: OfDrive, metric: str) -> float:
    return float(np.mean(_values(drive, metric)))


def _smallest(drive: OfDrive, metric: str) -> float:
    return min(_values(drive, metric))


def _smallest_gap(drive: OfDrive, metric: str) -> float:
    """Edges minus cars, in the scenario where it is smaller."""
    on_cars, on_edges = (_of_facts(drive, [placed(metric, place)]) for place in PLACEMENTS)
    return float(np.min(np.subtract(on_edges, on_cars)))


def _over_remote(drive: OfDrive, metric: str) -> float:
    """Genie minus remote execution, mean over the scenarios."""
    genie, remote = (_of_facts(drive, [Fact(metric, method)]) for method in ("genie", "remote"))
    return float(np.mean(np.subtract(genie, remote)))


def _faster_server(drive: OfDrive, metric: str) -> float:
    """Heterogeneous minus homogeneous, mean over cars and edges."""
    homo, hetero = (_mean({scenario: drive[scenario]}, metric) for scenario in SCENARIOS)
    return hetero - homo


def _over_images(drive: OfDrive, metric: str) -> float:
    return ratio(_mean(drive, metric), _mean(drive, "image_reuse"))


DIRECTIONS = (
    Direction(
        "C1", "improvement over local and remote, first answer (the paper: 0.82)", _mean, FIRST
    ),
    Direction("C1", "the same, fresh answer", _mean, "improvement_fresh_answer"),
    Direction("C4", "smallest of these, first answer", _smallest, FIRST),
    Direction("C3", "share of frames answered in 33 ms", _smallest, "under_deadline_share", 0.99),
    Direction(
        "C13", "object reuse / image reuse (the paper: 4)", _over_images, "object_reuse", 1.0
    ),
    Direction("C16", "object reuse, heterogeneous - homogeneous", _faster_server, "object_reuse"),
    Direction("C18", "image reuse, remote - local", _smallest_gap, "image_reuse"),
    Direction("C18", "the same, pooled over Genies", _smallest_gap, "image_reuse_pooled"),
    Direction("C21", "image reuse, heterogeneous - homogeneous", _faster_server, "image_reuse"),
    Direction("C22", "confidence boost, remote - local", _smallest_gap, "confidence_boost"),
    Direction(
        "C24", "confidence boost, heterogeneous - homogeneous", _faster_server, "confidence_boost"
    ),
    Direction("C26", "smallest confidence boost", _smallest, "confidence_boost"),
    Direction("", "share of ghosts in what is held, Genie - remote", _over_remote, "ghost_share"),
)
C18 = next(direction for direction in DIRECTIONS if direction.claim == "C18")


def all_runs() -> list[DriveRun]:
    """Every scenario and seed on every sequence in $GENIE_SIM_KITTI/tracking that can be read; a
    log line says which can not, and why. UserError where there is none.
    """
    from genie_sim.perception.perceive import kitti_folder

    root = kitti_folder(None)
    names = sequences(root / "tracking" / "training")
    if not names:
        raise UserError(
            f"{root / 'tracking'}: no sequences of KITTI's tracking benchmark here "
            "(training/oxts/0000.txt)"
        )
    usable = []
    for sequence in names:
        try:
            DriveRun(root, sequence, SCENARIOS[0], SEEDS[0]).prepare()
        except UserError as error:
            log.warning("drives: sequence %s is left out: %s", sequence, error)
        else:
            usable.append(sequence)
    if not usable:
        raise UserError(f"{root / 'tracking'}: none of the {len(names)} sequences here can be used")
    return [
        DriveRun(root, sequence, scenario, seed)
        for sequence in usable
        for scenario in SCENARIOS
        for seed in SEEDS
    ]


@lru_cache(maxsize=1)
def _recordings(root: Path, sequence: str) -> Recordings:
    """The trace of a sequence, and what is really there, if the folder has its labels. Raises
    ``UserError``.
    """
    trace = tracking_trace(root / "tracking", sequence, DETECTIONS, min_score=MIN_SCORE)
    labelled = (root / "tracking" / "training" / "label_02" / f"{sequence}.txt").is_file()
    return Recordings(
        trace, truth=make_truth(root, f"tracking/{sequence}", trace) if labelled else None
    )


def simulate(
    runs: Sequence[DriveRun], parts: Parts, workers: int, progress: Progress | None = None
) -> list[Row]:
    """The rows of all runs, in their order; what is in ``parts`` already is not run again."""
    run_parts(runs, parts, workers, progress)
    run_ids = [run.run_id for run in runs]
    facts = facts_in(parts, run_ids)
    rows = []
    for run, run_id in zip(runs, run_ids, strict=True):
        row: Row = {"sequence": run.sequence, "scenario": run.scenario, "seed": run.seed}
        row["drive_s"] = _drive_s(_recordings(run.root, run.sequence).main)
        for fact in FACTS:
            row[str(fact)] = rounded(facts[run_id].get(fact, math.nan))
        rows.append(row)
    return rows


def same_cell_share(scenario: Scenario, trace: Trace) -> float:
    """Of a drive's frames, the share to which a Genie's cache gives the key of the frame before."""
    key = SIMILARITY.make(scenario.genie.similarity).key
    frames = trace.frames[CAMERA]
    keys = [
        key(
            Image(Header(frame.stamp_ns, CAMERA, ""), 0, frame.digest, frame.dhash, frame.pose, 0.0)
        )
        for frame in frames
    ]
    return ratio(sum(before == after for before, after in pairwise(keys)), len(keys) - 1)


def _drive_s(trace: Trace) -> float:
    return len(trace.frames[CAMERA]) * FRAME_NS / NS_PER_S


def directions(driven: Sequence[Row]) -> list[dict[str, Any]]:
    """For each claim its number on each drive with a 95 % interval over seeds, the median and range
    of these, and on how many drives it holds, is contrary, and is open.
    """
    summaries = []
    for direction in DIRECTIONS:
        intervals = _intervals(direction, driven)
        means = [mean for mean, _, _ in intervals.values()]
        spread = (float(np.median(means)), min(means), max(means)) if means else (None, None, None)
        summaries.append(
            {
                "claim": direction.claim,
                "says": direction.says,
                "bound": direction.bound,
                **dict(zip(("median", "low", "high"), spread, strict=True)),
                "holds": sum(low > direction.bound for _, low, _ in intervals.values()),
                "contrary": sum(high <= direction.bound for _, _, high in intervals.values()),
                "drives": len(intervals),
                "numbers": intervals,
            }
        )
    return summaries


def _intervals(direction: Direction, driven: Sequence[Row]) -> dict[str, list[float]]:
    """Mean and interval of a claim's number on each drive where every seed gave one."""
    runs: dict[str, dict[int, dict[str, Row]]] = {}
    for row in driven:
        runs.setdefault(row["sequence"], {}).setdefault(row["seed"], {})[row["scenario"]] = row
    numbers = {
        drive: np.array([direction.number(run, direction.metric) for run in seeds.values()])
        for drive, seeds in runs.items()
    }
    intervals = {
        name: interval(values) for name, values in numbers.items() if not np.isnan(values).any()
    }
    return {name: [rounded(end) for end in ends] for name, ends in intervals.items()}


def hypothesis(driven: Sequence[Row]) -> dict[str, Any] | None:
    """The declared test of C18: least squares of its number on the share of successive frames in
    one image cell, with the slope's 95 % t interval; ``zero_at`` is the share at which the line
    crosses zero. ``None`` where fewer than 3 drives, or all alike, make no line.
    """
    from scipy.stats import linregress

    shares = {row["sequence"]: row[str(SAME_CELL)] for row in driven}
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
    numbers = {name: rounded(value) for name, value in values.items()}
    return {**numbers, "n": n, "supported": numbers["high"] < 0, "points": points}


def write(folder: Path, driven: Sequence[Row]) -> str:
    """``drives.csv`` (each run), ``drives.json`` (each claim on each drive), a part of
    ``verdicts.md``; its table.
    """
    import pandas as pd

    outcome = {
        "seeds": list(SEEDS),
        "directions": directions(driven),
        "hypothesis": hypothesis(driven),
    }
    # of a path pandas makes a URI
    with (folder / "drives.csv").open("w", encoding="utf-8", newline="") as file:
        pd.DataFrame(driven).to_csv(file, index=False)
    provenance.write_json(folder / "drives.json", outcome)
    table = markdown(outcome)
    count = len({row["sequence"] for row in driven})
    about = f"{count} sequences of KITTI's tracking benchmark, three cars, PointRCNN's detections:"
    with (folder / "verdicts.md").open("a", encoding="utf-8") as document:
        document.write(f"\n## On other drives\n\n{about}\n\n{table}\n")
    return table


def markdown(outcome: Mapping[str, Any]) -> str:
    """The claims over the drives as a table, and what became of the hypothesis."""
    rows = [
        [
            direction["claim"],
            direction["says"],
            f"{direction['bound']:g}",
            _spread(direction),
            f"{direction['holds']} of {direction['drives']}",
            str(direction["contrary"]),
            str(direction["drives"] - direction["holds"] - direction["contrary"]),
        ]
        for direction in outcome["directions"]
    ]
    headings = ["", "number of each drive", "more than", "median (range)"]
    table = text_table.markdown([*headings, "holds", "contrary", "open"], rows)
    tested = outcome["hypothesis"]
    if tested is None:
        return table
    verdict = "supported" if tested["supported"] else "not supported"
    text = (
        "C18 on the share of successive frames in one image cell: slope {slope:.3g} ({low:.3g} to "
        "{high:.3g}), r = {r:.2f}, n = {n}, zero at {zero_at:.2f}. The hypothesis that it falls is "
    )
    return f"{table}\n\n{text.format(**tested)}{verdict}."


def _spread(direction: Mapping[str, Any]) -> str:
    if direction["median"] is None:
        return "-"
    return "{median:.3g} ({low:.3g} to {high:.3g})".format_map(direction)
