"""The plain and the compiled engine beside SimPy's station, each in a process of its own.

    python -m benchmarks.both_engines [--rounds 3] [--quick]

Without a cache, ``remote`` and ``local`` do the same work as the station and more: topics, links,
a row a frame. Genie does what the paper's does. Each run takes turns with a station of as many
frames and cameras in the same process, and ratios are taken within such a pair.
"""

from __future__ import annotations

import argparse
import gc
import json
import os
import statistics
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import Any

from benchmarks.genie_runs import REPOSITORY, fleet, phases_ns, run_genie, three_cars
from benchmarks.station import Outcome, simpy_station, station_of
from genie_sim.engine import ENGINE, PURE
from genie_sim.runner import prepare
from genie_sim.scenario.scenario import Scenario

PLAIN, COMPILED = "plain Python", "compiled"
CAMERAS_PER_CAR = 4


@dataclass(frozen=True)
class Case:
    """What both engines run: ``make`` gives a scenario of so many ``cars``, which is run ``times``
    in a row. ``goal``: what the compiled engine is to reach, in frames a second over the station's.
    """

    make: Callable[[], Scenario]
    goal: float
    cars: int = 3
    times: int = 1


def nothing_recorded(make: Callable[[], Scenario]) -> Scenario:
    """The scenario with no more tables than there must be."""
    return replace(make(), record=())


def cases(laps: int, lap_times: int, cars: int, fleet_s: float) -> dict[str, Case]:
    """All cases by name, as pages have them; like for like first."""
    lap, all_laps = partial(three_cars, 1), partial(three_cars, laps)
    remote = partial(three_cars, laps, method="remote")
    local = partial(three_cars, laps, method="local")
    large = partial(fleet, cars, fleet_s)
    return {
        "`remote`": Case(partial(nothing_recorded, remote), goal=1.3),
        "`local`": Case(partial(nothing_recorded, local), goal=2.0),
        "Genie, first lap": Case(partial(nothing_recorded, lap), goal=0.20, times=lap_times),
        f"Genie, {laps} laps": Case(partial(nothing_recorded, all_laps), goal=0.65),
        "Genie, first lap, all tables": Case(lap, goal=0.07, times=lap_times),
        f"Genie, {laps} laps, all tables": Case(all_laps, goal=0.22),
        f"Genie, {cars:,} cars": Case(partial(nothing_recorded, large), goal=0.25, cars=cars),
    }


FULL = {"laps": 10, "lap_times": 5, "cars": 1000, "fleet_s": 1.0}
QUICK = {"laps": 2, "lap_times": 1, "cars": 1000, "fleet_s": 0.3}


@dataclass(frozen=True)
class Pair:
    """Processor time [s] of so many frames, and of the station with as many."""

    frames: int
    genie_sim_s: float
    station_s: float


@dataclass(frozen=True)
class Engines:
    """What both engines did, round by round, by case; ``missing`` says why one was not measured."""

    goals: Mapping[str, float]
    pairs: Mapping[str, Mapping[str, Sequence[Pair]]]
    missing: Mapping[str, str]

    def microseconds(self, engine: str, case: str) -> float:
        """Processor time of a frame [us], median of the rounds."""
        return statistics.median(
            1e6 * pair.genie_sim_s / pair.frames for pair in self.pairs[engine][case]
        )

    def over_station(self, engine: str, case: str) -> float:
        """Frames a second over the station's, median of the rounds."""
        return statistics.median(
            pair.station_s / pair.genie_sim_s for pair in self.pairs[engine][case]
        )


def measure(rounds: int, sizes: Mapping[str, Any]) -> Engines:
    """Both engines take turns, each time in a new process."""
    pairs: dict[str, dict[str, list[Pair]]] = {}
    missing: dict[str, str] = {}
    for _ in range(rounds):
        for engine in (PLAIN, COMPILED):
            if engine in missing:
                continue
            answer = in_a_process(engine, sizes)
            if "missing" in answer:
                missing[engine] = answer["missing"]
                continue
            of_engine = pairs.setdefault(engine, {})
            for case, pair in answer["pairs"].items():
                of_engine.setdefault(case, []).append(Pair(**pair))
    goals = {name: case.goal for name, case in cases(**sizes).items()}
    return Engines(goals, pairs, missing)


def in_a_process(engine: str, sizes: Mapping[str, Any]) -> dict[str, Any]:
    """One round of an engine: its ``pairs``, or why it is ``missing``."""
    settings = {**os.environ, PURE: "1" if engine == PLAIN else "0"}
    ran = subprocess.run(
        [sys.executable, "-m", "benchmarks.both_engines", "--here", json.dumps(sizes)],
        cwd=REPOSITORY,
        env=settings,
        check=True,
        capture_output=True,
        text=True,
    )
    answer: dict[str, Any] = json.loads(ran.stdout.splitlines()[-1])
    if engine == COMPILED and not answer["is_compiled"]:
        return {"missing": answer["title"]}
    return answer


def here(sizes: Mapping[str, Any]) -> dict[str, Any]:
    """All cases with the engine of this process."""
    pairs = {name: asdict(raced(case)) for name, case in cases(**sizes).items()}
    return {"is_compiled": ENGINE.is_compiled, "title": ENGINE.title, "pairs": pairs}


def raced(case: Case) -> Pair:
    """One case, and the station right after it."""
    prepared = prepare(case.make())
    gc.collect()
    outcome: Outcome = run_genie(prepared, case.times)
    station = station_of(outcome.frames, phases_ns(CAMERAS_PER_CAR * case.cars))
    gc.collect()
    return Pair(outcome.frames, outcome.cpu_s, simpy_station(station).cpu_s)


def rows(engines: Engines) -> list[tuple[str, ...]]:
    """A row a case: what each engine took for a frame [us], frames a second over the station's,
    and the goal.
    """
    found = []
    for case, goal in engines.goals.items():
        cells: list[str] = []
        for engine in (PLAIN, COMPILED):
            if engine in engines.missing:
                cells += ["", ""]
                continue
            took_us, ratio = engines.microseconds(engine, case), engines.over_station(engine, case)
            cells += [f"{took_us:.1f}", f"{ratio:.3g}"]
        found.append((case, *cells, f"{goal:g}"))
    return found


HEADER = (
    "run",
    "plain Python [µs a frame]",
    "over SimPy's",
    "compiled [µs a frame]",
    "over SimPy's",
    "goal, compiled",
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--quick", action="store_true", help="smaller runs")
    parser.add_argument("--here", metavar="SIZES", help="one round in this process, as JSON")
    arguments = parser.parse_args()
    if arguments.here:
        print(json.dumps(here(json.loads(arguments.here))))
        return
    engines = measure(arguments.rounds, QUICK if arguments.quick else FULL)
    for row in (HEADER, *rows(engines)):
        print("  ".join(f"{cell:>28}" for cell in row))
    for engine, reason in engines.missing.items():
        print(f"{engine} was not measured: {reason}")


if __name__ == "__main__":
    main()
