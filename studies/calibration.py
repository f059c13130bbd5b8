"""Which overlap of the routes and which gate of the object map give the paper's two reuse numbers?

    python studies/calibration.py [--jobs 2]

Exactly two parameters are fitted to exactly two numbers, by a search that always takes the same
steps: a grid over the plausible ranges of ``genie_sim/paper/assumptions.yaml``, then ever finer
grids around the best point, with Genie alone and on seeds that the evaluation never uses. Every
point is a row of ``results/calibration/points.csv``: means over scenarios, cars, edges and seeds.
The best one stands in ``genie_sim/paper/calibrated.yaml``. About four minutes on two cores.
"""

import argparse
import csv
import math
from collections.abc import Callable, Iterable
from itertools import product
from pathlib import Path

from genie_sim.base.parallel import workers_here
from genie_sim.paper.checks import ALL, BOTH_IMAGES, BOTH_OBJECTS
from genie_sim.paper.evidence import BASE, Evidence
from genie_sim.paper.readings import load_reading
from genie_sim.paper.runs import EvaluationRun, simulate
from genie_sim.paper.sources import ASSUMPTIONS
from genie_sim.scenario.yaml_input import read_mapping

OUT = Path("results/calibration")
DECLARED = read_mapping(ASSUMPTIONS)
RANGES = [parameter["range"] for parameter in DECLARED["calibrated"]["parameters"].values()]
OBJECTS, RATIO = (target["value"] for target in DECLARED["calibrated"]["targets"].values())
SEEDS = DECLARED["evaluation"]["calibration_seeds"]
STREET = load_reading("street").settings(())  # which the two are fitted for
GRID = 5  # values of each parameter, ends of its range included
REFINEMENTS = 2

Parameters = tuple[float, float]  # overlap and gate [m]
Reuse = tuple[float, float]  # of objects and of images


def misfit(reuse: Reuse) -> float:
    """Squared distance to the two numbers in natural logarithms: 0.1 is about 10 %."""
    objects, images = (max(share, 1e-3) for share in reuse)
    return math.log(objects / OBJECTS) ** 2 + math.log(objects / images / RATIO) ** 2


def search(try_points: Callable[[list[Parameters]], Iterable[Reuse]]) -> dict[Parameters, Reuse]:
    """Every point that was tried with its reuse, the best one first."""
    steps = [(high - low) / (GRID - 1) for low, high in RANGES]
    tried: dict[Parameters, Reuse] = {}
    middle, places = tuple(low for low, _ in RANGES), tuple(range(GRID))
    for _ in range(1 + REFINEMENTS):
        axes = [
            [round(at + place * step, 4) for place in places if low <= at + place * step <= high]
            for at, step, (low, high) in zip(middle, steps, RANGES, strict=True)
        ]
        new = [point for point in product(*axes) if point not in tried]
        tried |= zip(new, try_points(new), strict=True)
        middle = min(tried, key=lambda point: misfit(tried[point]))
        steps, places = [step / 2 for step in steps], (-1, 0, 1)
    return dict(sorted(tried.items(), key=lambda item: misfit(item[1])))


def simulated(points: list[Parameters], jobs: int) -> Iterable[Reuse]:
    """The reuse at each point."""
    settings = [
        (*STREET, f"overlap={overlap:g}", f"gate_m={gate_m:g}") for overlap, gate_m in points
    ]
    places = [(scenario, seed) for scenario in ALL for seed in SEEDS]
    runs = [
        EvaluationRun(*place, of_point, ("genie",)) for of_point in settings for place in places
    ]
    outcomes = simulate(runs, jobs)
    for _ in points:
        runs_of = {(BASE, scenario): [next(outcomes).facts for _ in SEEDS] for scenario in ALL}
        evidence = Evidence(runs_of)
        objects, images = (evidence.mean_of(ALL, facts) for facts in (BOTH_OBJECTS, BOTH_IMAGES))
        yield float(objects.mean()), float(images.mean())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--jobs", type=int, default=workers_here())
    parser.add_argument("--out", type=Path, default=OUT)
    options = parser.parse_args()
    tried = search(lambda points: simulated(points, options.jobs))
    options.out.mkdir(parents=True, exist_ok=True)
    with (options.out / "points.csv").open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(("overlap", "gate_m", "object_reuse", "image_reuse"))
        rows.writerows((*point, *reuse) for point, reuse in sorted(tried.items()))
    ((overlap, gate_m), (objects, images)), *_ = tried.items()
    print(
        f"overlap {overlap:g}, gate {gate_m:g} m: object reuse {objects:.3g} (paper {OBJECTS:g}), "
        f"{objects / images:.3g} times image reuse (paper {RATIO:g})"
    )


if __name__ == "__main__":
    main()
