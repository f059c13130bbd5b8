"""Do the claims hold on other drives, or does a conclusion hang on one street?

    GENIE_SIM_KITTI=/where/kitti/is python studies/drives.py [--jobs 2] [--sequences 0003 0016]

Runs the main claims on every sequence of KITTI's tracking benchmark. Each run is a row of
``results/drives/runs.csv``, which ``--table`` reads without running anything. About an hour on two
cores.

Declared before any of it was run:

- *Sequences*: all that the folder holds but 0000, which is drive 2011_09_26/0005 of the evaluation;
  the paper does not say which drives it played.
- *Detections*: PointRCNN's as published, from a score of 0.3 on. They have places in space; no
  pictures are needed. Similarities that look at pictures (``exact``, ``dhash``) mean nothing here;
  ``pose_grid``, the default, does not look at them.
- *Scenarios*: ``street_3car_homo`` and ``street_3car_hetero``, as shipped but for two things.
  All four streams show recording 02, the only one that has detections. The cars' windows keep their
  proportion to the drive: each car 60 % of it, a fifth ahead of the car before.
- *Nothing is fitted*: neither the overlap nor the gate of the paper's evaluation, which were
  calibrated on one drive.
- *Seeds*: five of each drive, 2 to 6, with a 95 % t interval for the drive; seed 1 had been looked
  at before. A claim *holds* on a drive whose interval lies above its bound, is *contrary* where it
  lies below, else *open*.
- *Labels*: where the folder has them, what consumers hold is judged by them.
- *Hypothesis about C18*, formed on one seed of other drives of the benchmark: the number of a drive
  (image reuse on edges less that on cars, mean over seeds) falls with the share of its successive
  frames that fall into one image cell. Test: least squares over the drives; it is supported if the
  95 % t interval of the slope lies below zero.
"""

import argparse
import json
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

import genie_sim as gs
from genie_sim.analysis import renderers
from genie_sim.analysis.genie_metrics import GENIE_PLACEMENTS
from genie_sim.analysis.result_table import ResultTable
from genie_sim.analysis.statistics import t_quantile
from genie_sim.base.parallel import in_processes, workers_here
from genie_sim.base.settings import plain_data
from genie_sim.core.messages import Header, Image
from genie_sim.core.rules import SIMILARITY
from genie_sim.data.kitti.drive_truth import make_truth
from genie_sim.data.kitti.perceive import kitti_folder
from genie_sim.data.kitti.tracking_sequence import CAMERA, sequences
from genie_sim.data.trace import Trace, write_trace
from genie_sim.data.truth import path_beside, write_truth
from genie_sim.paper.evidence import interval
from genie_sim.paper.numbers import METHODS, Number, Numbers, of_run, placed
from tools.make.published import FRAME_NS, tracking_trace

OUT = Path("results/drives")
OF_THE_EVALUATION = "0000"
SCENARIOS = ("street_3car_homo", "street_3car_hetero")
SEEDS = (2, 3, 4, 5, 6)
SHARE, AHEAD = 0.6, 0.2  # of the drive: what a car drives, and how far it is ahead of the next
SAME_CELL = "same_cell_share:genie"
GAINS = [f"improvement_first_answer:genie:{baseline}" for baseline in ("local", "remote")]
NUMBERS = [
    *(Number("improvement_first_answer", component=baseline) for baseline in ("local", "remote")),
    Number("under_deadline_share"),
    *(
        placed(name, placement)
        for name in ("image_reuse", "image_reuse_pooled", "object_reuse")
        for placement in GENIE_PLACEMENTS
    ),
    *(placed("confidence_boost", placement) for placement in GENIE_PLACEMENTS),
    *(
        Number(name, method.name)
        for name in ("object_precision", "ghost_share")
        for method in METHODS
    ),
]

Values = np.ndarray[Any, np.dtype[np.float64]]  # drive x seed


# What is run


def trace_of(root: Path, sequence: str, folder: Path) -> tuple[Trace, Path]:
    """A sequence as a trace, its file and, where there are labels, its truth table beside it."""
    trace, path = tracking_trace(root / "tracking", sequence), folder / f"{sequence}.parquet"
    write_trace(path, trace)
    if (root / "tracking" / "training" / "label_02" / f"{sequence}.txt").is_file():
        write_truth(path_beside(path), make_truth(root, f"tracking/{sequence}", trace))
    return trace, path


def settings_of(path: Path, drive_s: float) -> tuple[str, ...]:
    """Three cars on a drive."""
    windows = [
        f"cars[{car}].route.window=[{begin_s:.3f} s, {begin_s + SHARE * drive_s:.3f} s]"
        for car, begin_s in enumerate(car * AHEAD * drive_s for car in range(3))
    ]
    cameras = gs.load_scenario(SCENARIOS[0]).cameras
    streams = [plain_data(replace(camera, recording=CAMERA)) for camera in cameras]
    return f"perception.trace={path}", *windows, f"cameras={json.dumps(streams)}"


def same_cell_share(trace: Trace) -> float:
    """Of a drive's frames, the share to which a Genie's cache gives the key of the frame before."""
    key = SIMILARITY.make(gs.load_scenario(SCENARIOS[0]).genie.similarity).key
    keys = [
        key(
            Image(Header(frame.stamp_ns, CAMERA, ""), 0, frame.digest, frame.dhash, frame.pose, 0.0)
        )
        for frame in trace.frames[CAMERA]
    ]
    return sum(before == after for before, after in pairwise(keys)) / (len(keys) - 1)


def numbers_of(job: tuple[str, int, tuple[str, ...]]) -> Numbers:
    """The numbers of a scenario with a seed, under settings."""
    scenario, seed, settings = job
    return of_run(gs.run(scenario, settings, seed=seed))


def run(root: Path, sequence: str, folder: Path, jobs: int) -> list[dict[str, Any]]:
    """The rows of a sequence. Raises ``gs.UserError`` for one whose files are broken."""
    trace, path = trace_of(root, sequence, folder)
    drive_s = len(trace.frames[CAMERA]) * FRAME_NS / 1e9
    settings, share = settings_of(path, drive_s), same_cell_share(trace)
    runs = [(scenario, seed, settings) for scenario in SCENARIOS for seed in SEEDS]
    rows = []
    for (scenario, seed, _), numbers in zip(
        runs, in_processes(numbers_of, runs, jobs), strict=True
    ):
        row = {"sequence": sequence, "scenario": scenario, "seed": seed}
        row |= {"drive_s": drive_s, SAME_CELL: share}
        rows.append(row | {str(number): numbers.get(number, math.nan) for number in NUMBERS})
    return rows


# What the claims come to


class Cube:
    """The runs as arrays of drive x seed x scenario x what is asked for."""

    def __init__(self, runs: pd.DataFrame) -> None:
        self.drives = sorted(runs["sequence"].unique())
        self._runs = runs.sort_values(
            ["sequence", "seed", "scenario"], ascending=[True, True, False]
        )

    def of(self, columns: Sequence[str]) -> Values:
        values = self._runs[list(columns)].to_numpy(dtype=float)
        return values.reshape(len(self.drives), -1, len(SCENARIOS), len(columns))

    def roles(self, metric: str) -> Values:
        """Of the Genies on cars and on edges."""
        return self.of([str(placed(metric, placement)) for placement in GENIE_PLACEMENTS])


class Direction(NamedTuple):
    """A number of each drive and seed which the paper says is more than ``bound``; without a
    ``claim``, what is worth knowing beside the paper's.
    """

    claim: str
    says: str
    number: Callable[[Cube], Values]
    bound: float = 0.0


def mean(metric: str) -> Callable[[Cube], Values]:
    return lambda runs: runs.roles(metric).mean(axis=(2, 3))


def smallest_gap(metric: str) -> Callable[[Cube], Values]:
    """Edges minus cars, in the scenario where it is smaller."""
    return lambda runs: np.diff(runs.roles(metric), axis=3).min(axis=(2, 3))


def faster_server(metric: str) -> Callable[[Cube], Values]:
    """Heterogeneous minus homogeneous, mean over cars and edges."""
    return lambda runs: np.diff(runs.roles(metric).mean(axis=3), axis=2)[:, :, 0]


def object_to_image_reuse(runs: Cube) -> Values:
    objects, images = mean("object_reuse")(runs), mean("image_reuse")(runs)
    return np.divide(objects, images, out=np.full_like(objects, np.nan), where=images != 0)


DIRECTIONS = (
    Direction(
        "C1",
        "improvement over local and remote, first answer (the paper: 0.82)",
        lambda runs: runs.of(GAINS).mean(axis=(2, 3)),
    ),
    Direction(
        "C4",
        "smallest of these, first answer",
        lambda runs: runs.of(GAINS).min(axis=(2, 3)),
    ),
    Direction(
        "C3",
        "share of frames answered in 33 ms",
        lambda runs: runs.of(["under_deadline_share:genie"]).min(axis=(2, 3)),
        0.99,
    ),
    Direction("C13", "object reuse / image reuse (the paper: 4)", object_to_image_reuse, 1.0),
    Direction("C16", "object reuse, heterogeneous - homogeneous", faster_server("object_reuse")),
    Direction(
        "C18", "image reuse, remote - local, smaller of he and ho", smallest_gap("image_reuse")
    ),
    Direction("C18", "the same, pooled over Genies", smallest_gap("image_reuse_pooled")),
    Direction("C21", "image reuse, heterogeneous - homogeneous", faster_server("image_reuse")),
    Direction(
        "C22",
        "confidence boost, remote - local, smaller of he and ho",
        smallest_gap("confidence_boost"),
    ),
    Direction(
        "C24", "confidence boost, heterogeneous - homogeneous", faster_server("confidence_boost")
    ),
    Direction(
        "C26",
        "smallest confidence boost",
        lambda runs: runs.roles("confidence_boost").min(axis=(2, 3)),
    ),
    Direction(
        "",
        "share of false objects in what cars hold, Genie - remote",
        lambda runs: np.diff(runs.of(["ghost_share:remote", "ghost_share:genie"]), axis=3).mean(
            axis=(2, 3)
        ),
    ),
)
C18 = next(direction for direction in DIRECTIONS if direction.claim == "C18")


def intervals(direction: Direction, runs: Cube) -> dict[str, tuple[float, float, float]]:
    """Mean and 95 % interval over the seeds, of each drive where every seed gave a number."""
    numbers = zip(runs.drives, direction.number(runs), strict=True)
    return {drive: interval(values) for drive, values in numbers if not np.isnan(values).any()}


def row_of(direction: Direction, runs: Cube) -> list[str]:
    """A line of the table."""
    found = intervals(direction, runs).values()
    holds = sum(low > direction.bound for _, low, _ in found)
    contrary = sum(high <= direction.bound for _, _, high in found)
    means = [mean for mean, _, _ in found]
    spread = f"{np.median(means):.3g} ({min(means):.3g} to {max(means):.3g})" if means else "-"
    counts = f"{holds} of {len(found)}", str(contrary), str(len(found) - holds - contrary)
    return [direction.claim, direction.says, f"{direction.bound:g}", spread, *counts]


def hypothesis(runs: Cube) -> str:
    """The declared test of C18: least squares, and the interval of the slope."""
    shares = dict(zip(runs.drives, runs.of([SAME_CELL])[:, 0, 0, 0], strict=True))
    points = {drive: mean for drive, (mean, _, _) in intervals(C18, runs).items()}
    x, y = [shares[drive] for drive in points], list(points.values())
    (slope, intercept), covariance = np.polyfit(x, y, 1, cov=True)
    half = t_quantile(len(points) - 2) * math.sqrt(covariance[0, 0])
    verdict = "supported" if slope + half < 0 else "not supported"
    return (
        "C18 on the share of successive frames in one image cell: slope "
        f"{slope:.3g} ({slope - half:.3g} to {slope + half:.3g}), "
        f"r = {np.corrcoef(x, y)[0, 1]:.2f}, n = {len(points)}, zero at {-intercept / slope:.2f}. "
        f"The hypothesis that it falls is {verdict}."
    )


def tables(runs: pd.DataFrame) -> str:
    """The claims over the drives, and what became of the hypothesis."""
    cube = Cube(runs)
    headings = ["", "number of each drive", "more than", "median (range)"]
    rows = [row_of(direction, cube) for direction in DIRECTIONS]
    made = ResultTable.of_texts([*headings, "holds", "contrary", "open"], rows)
    table = renderers.markdown(made).rstrip()
    return f"{table}\n\n{hypothesis(cube)}" if len(cube.drives) > 2 else table


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--jobs", type=int, default=workers_here())
    parser.add_argument("--sequences", nargs="*", metavar="NAME", help="default: all there are")
    parser.add_argument("--table", action="store_true", help="only show what runs.csv says")
    parser.add_argument("--out", type=Path, default=OUT)
    options = parser.parse_args()
    path = options.out / "runs.csv"
    if not options.table:
        root = kitti_folder(None)
        (options.out / "traces").mkdir(parents=True, exist_ok=True)
        rows = []
        found = sequences(root / "tracking" / "training")
        for sequence in options.sequences or [name for name in found if name != OF_THE_EVALUATION]:
            try:
                rows += run(root, sequence, options.out / "traces", options.jobs)
            except gs.UserError as error:
                print(f"sequence {sequence} is left out: {error}")
        if not rows:
            raise SystemExit(f"{root / 'tracking'}: no sequence can be used")
        pd.DataFrame(rows).to_csv(path, index=False, float_format="%.6g")
    print(tables(pd.read_csv(path, dtype={"sequence": str})))


if __name__ == "__main__":
    main()
