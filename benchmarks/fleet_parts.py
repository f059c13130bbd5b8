"""One fleet in a town, simulated by one process and by several, which take turns.

    python -m benchmarks.fleet_parts [--cars 1000] [--seconds 6] [--rounds 3] [--workers 2]

Each run is a process of its own, which prepares the fleet and then simulates it; the time of that
counts. Wall time means something on an idle machine alone; where other programs run, the processor
time of the busiest process, over that of one process, tells what an idle machine could reach.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace

from benchmarks.genie_runs import REPOSITORY, town
from genie_sim.runner import prepare, simulate_with


@dataclass(frozen=True)
class Parts:
    """What so many processes took for a fleet: wall time and the processor time of all [s]."""

    workers: int
    frames: int
    wall_s: float
    cpu_s: float


@dataclass(frozen=True)
class FleetParts:
    """A fleet in one process and in several, round by round, by the number of processes."""

    cars: int
    seconds: float
    rounds: Mapping[int, Sequence[Parts]]

    def rows(self) -> list[tuple[str, ...]]:
        """A row for each number of processes; medians of the rounds."""
        return [
            (
                f"{workers}",
                f"{of_workers[0].frames:,}",
                f"{statistics.median(parts.wall_s for parts in of_workers):.1f}",
                f"{statistics.median(parts.cpu_s for parts in of_workers):.1f}",
                f"{self.times_as_fast(workers):.2f}",
            )
            for workers, of_workers in self.rounds.items()
        ]

    def times_as_fast(self, workers: int) -> float:
        """By the wall time of one process over that of several, median of the rounds."""
        pairs = zip(self.rounds[1], self.rounds[workers], strict=True)
        return statistics.median(one.wall_s / several.wall_s for one, several in pairs)


HEADER = ("processes", "frames", "wall time [s]", "processor time of all [s]", "times as fast")


def measure(cars: int, seconds: float, rounds: int, workers: Sequence[int] = (2,)) -> FleetParts:
    """All numbers of processes take turns."""
    found: dict[int, list[Parts]] = {}
    for _ in range(rounds):
        for count in (1, *workers):
            found.setdefault(count, []).append(in_a_process(count, cars, seconds))
    return FleetParts(cars, seconds, found)


def in_a_process(workers: int, cars: int, seconds: float) -> Parts:
    """One run of so many processes."""
    sizes = json.dumps({"workers": workers, "cars": cars, "seconds": seconds})
    ran = subprocess.run(
        [sys.executable, "-m", "benchmarks.fleet_parts", "--here", sizes],
        cwd=REPOSITORY,
        check=True,
        capture_output=True,
        text=True,
    )
    return Parts(**json.loads(ran.stdout.splitlines()[-1]))


def here(workers: int, cars: int, seconds: float) -> Parts:
    """One run that this process begins; the processes of parts are its children."""
    prepared = prepare(replace(town(cars, seconds), record=("resources",)))
    began_s, busy_s = time.perf_counter(), _busy_s()
    tables = simulate_with(prepared, workers)
    return Parts(workers, len(tables["frames"]), time.perf_counter() - began_s, _busy_s() - busy_s)


def _busy_s() -> float:
    """Processor time of this process and of those of its children that have ended [s]."""
    from joblib.externals.loky import get_reusable_executor

    get_reusable_executor().shutdown(wait=True)
    return sum(os.times()[:4])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--cars", type=int, default=1000)
    parser.add_argument("--seconds", type=float, default=6.0, help="how long all drive")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--workers", type=int, nargs="+", default=[2])
    parser.add_argument("--here", metavar="SIZES", help="one run of this process, as JSON")
    given = parser.parse_args()
    if given.here:
        print(json.dumps(asdict(here(**json.loads(given.here)))))
        return
    measured = measure(given.cars, given.seconds, given.rounds, given.workers)
    for row in (HEADER, *measured.rows()):
        print("  ".join(f"{cell:>25}" for cell in row))


if __name__ == "__main__":
    main()
