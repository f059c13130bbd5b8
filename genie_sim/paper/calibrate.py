"""Fits exactly two parameters to exactly two published numbers, by a search that always takes the
same steps.

The overlap of the cars' routes and the gate of the object map are tried on a grid over their
physically plausible ranges, then on ever finer grids around the best point. The seeds are not those
of the evaluation.
"""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import product
from typing import Any

from genie_sim.paper.assumptions import Assumptions
from genie_sim.paper.checks import BOTH_IMAGES, BOTH_OBJECTS
from genie_sim.paper.evaluation_run import GENIE_ALONE, EvaluationRun
from genie_sim.paper.evidence import Evidence
from genie_sim.paper.runs import Simulate

GRID = 5  # values of each parameter, ends of its range included
REFINEMENTS = 2
MIN_REUSE = 1e-3  # keeps logarithms finite


@dataclass(frozen=True, slots=True)
class FitPoint:
    """One pair of parameters and what came out, as a mean over scenarios, cars, edges and
    calibration seeds.
    """

    overlap: float
    gate_m: float
    object_reuse: float
    image_reuse: float

    @property
    def ratio(self) -> float:
        return self.object_reuse / max(self.image_reuse, MIN_REUSE)

    def over(self, targets: dict[str, float]) -> tuple[float, float]:
        """The two published numbers here, as shares of their targets."""
        level = max(self.object_reuse, MIN_REUSE) / targets["object_reuse_mean"]
        return level, max(self.ratio, MIN_REUSE) / targets["object_to_image_reuse"]

    def misfit(self, targets: dict[str, float]) -> float:
        """Squared distance to the two targets, in natural logarithms: 0.1 is about 10 %, too high
        or too low alike.
        """
        return sum(math.log(share) ** 2 for share in self.over(targets))

    @property
    def settings(self) -> tuple[str, ...]:
        """As settings of an ``EvaluationRun``."""
        return f"overlap={self.overlap:g}", f"gate_m={self.gate_m:g}"


@dataclass(frozen=True, slots=True)
class Calibration:
    """The best point, every point tried, and the targets."""

    best: FitPoint
    tried: tuple[FitPoint, ...]
    targets: dict[str, float]

    @property
    def reached(self) -> bool:
        """Whether the best point is within 10 % of both targets."""
        return all(abs(share - 1) <= 0.1 for share in self.best.over(self.targets))

    def as_json(self) -> dict[str, Any]:
        """For ``calibration.json``."""
        tried = [asdict(point) | {"ratio": point.ratio} for point in self.tried]
        return {
            "best": asdict(self.best),
            "reached": self.reached,
            "targets": self.targets,
            "tried": tried,
        }


def calibrate(assumptions: Assumptions, runs: Simulate) -> Calibration:
    """The point of the plausible ranges that fits the two published numbers best; ``runs``
    simulates.
    """
    ranges = [parameter.range for parameter in assumptions.fitted]
    steps = [(high - low) / (GRID - 1) for low, high in ranges]
    tried: list[FitPoint] = []

    def attempt(middle: Sequence[float], places: Sequence[int]) -> FitPoint:
        """Tries all points so many steps away from one, within the ranges; the best point of all so
        far.
        """
        axes = [
            [round(at + i * step, 4) for i in places]
            for at, step in zip(middle, steps, strict=True)
        ]
        before = {(point.overlap, point.gate_m) for point in tried}
        new = [
            (overlap, gate_m)
            for overlap, gate_m in product(*axes)
            if ranges[0][0] <= overlap <= ranges[0][1] and ranges[1][0] <= gate_m <= ranges[1][1]
        ]
        tried.extend(_try(assumptions, [point for point in new if point not in before], runs))
        return min(tried, key=lambda point: point.misfit(assumptions.targets))

    best = attempt([low for low, _ in ranges], range(GRID))
    for _ in range(REFINEMENTS):
        steps = [step / 2 for step in steps]
        best = attempt((best.overlap, best.gate_m), (-1, 0, 1))
    return Calibration(
        best,
        tuple(sorted(tried, key=lambda point: (point.overlap, point.gate_m))),
        assumptions.targets,
    )


def max_runs(assumptions: Assumptions) -> int:
    """How many runs the search takes at most."""
    return (
        (GRID**2 + 8 * REFINEMENTS)
        * len(assumptions.scenarios)
        * len(assumptions.calibration_seeds)
    )


def _try(
    assumptions: Assumptions, points: Sequence[tuple[float, float]], runs: Simulate
) -> list[FitPoint]:
    seeds, scenarios = assumptions.calibration_seeds, assumptions.scenarios
    wanted = [
        EvaluationRun(scenario, seed, (f"overlap={overlap:g}", f"gate_m={gate_m:g}"), GENIE_ALONE)
        for overlap, gate_m in points
        for scenario in scenarios
        for seed in seeds
    ]
    outcomes = iter(runs(wanted, "calibration"))
    averages = []
    for overlap, gate_m in points:
        evidence = Evidence(
            {("base", scenario): [next(outcomes).facts for _ in seeds] for scenario in scenarios}
        )
        objects = float(evidence.mean_of(scenarios, BOTH_OBJECTS).mean())
        images = float(evidence.mean_of(scenarios, BOTH_IMAGES).mean())
        averages.append(FitPoint(overlap, gate_m, objects, images))
    return averages
