"""How fast Genie runs are beside the idiomatic SimPy model of the same cameras, a bare loop and
other simulators.

    python benchmarks/speed.py [--quick] [--peers /path/to/python] [--markdown]

Engines take turns (Genie, SimPy, heapq, others, Genie, ...), and medians and ratios are compared,
because all are as fast as the machine happens to be. ``--quick`` takes half a minute, all of it a
few. ``--peers`` names a Python that has leafsim, ciw or salabim; what it does not have is skipped.
``--markdown`` writes docs/speed.md anew, with its figures.
"""

from __future__ import annotations

import argparse
import gc
import math
import os
import platform
import statistics
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks.both_engines import Engines
from benchmarks.fleet_parts import FleetParts

from benchmarks import both_engines, fleet_parts, genie_runs, peers, speed_page
from benchmarks.genie_runs import Drive, Hot, Work, drive, fleet, run_genie, three_cars, work_of
from benchmarks.station import ENGINES, Outcome, Station, station_of
from genie_sim.build import Prepared
from genie_sim.errors import UserError
from genie_sim.recording import provenance
from genie_sim.runner import prepare

CAMERAS_PER_CAR = 4
FIRST_LAP, ALL_LAPS, FLEET = "Genie, first lap", "Genie, {} laps", "Genie"
LEAST = ", `record: []`"  # the same with no more tables than there must be


@dataclass(frozen=True)
class Sizes:
    """How much is measured. ``fleets``: how long [s] so many cars drive; ``curves``: the fleets of
    the cost curves, the first being what the others are compared with, each driving for ``curve_s``
    as often as gives ``curve_frames``, and none that would take longer than ``longest_s``;
    ``memory_laps``: the two lengths of run between which memory grows; ``engines``: the sizes of
    what both engines run; ``parts``: the cars of the fleet that several processes simulate, and how
    long [s] they drive.
    """

    rounds: int
    laps: int
    fleets: Mapping[int, float]
    curves: Mapping[str, tuple[int, ...]]
    curve_s: float
    curve_frames: int
    longest_s: float
    minutes: int
    memory_laps: tuple[int, int]
    profile_entries: int
    engines: Mapping[str, float]
    parts: tuple[int, float]


FULL = Sizes(
    rounds=3,
    laps=10,
    fleets={100: 2.0, 1000: 1.0},
    curves={"street": (3, 10, 30, 100, 300, 1000), "town": (3, 30, 300, 3000)},
    curve_s=1.0,
    curve_frames=1000,
    longest_s=75,
    minutes=60,
    memory_laps=(60, 480),
    profile_entries=15,
    engines=both_engines.FULL,
    parts=(1000, 6.0),
)
QUICK = Sizes(
    rounds=2,
    laps=2,
    fleets={100: 1.0},
    curves={"street": (3, 30, 100), "town": (3, 30)},
    curve_s=0.5,
    curve_frames=300,
    longest_s=5,
    minutes=4,
    memory_laps=(5, 20),
    profile_entries=8,
    engines=both_engines.QUICK,
    parts=(300, 1.0),
)


@dataclass(frozen=True)
class Race:
    """What the engines did with the frames of so many cars, round by round; ``events``: a frame,
    where known.
    """

    cars: int
    rounds: Mapping[str, Sequence[Outcome]]

    def rate(self, engine: str) -> float:
        """Frames a second of processor time, median of the rounds."""
        return statistics.median(outcome.rate for outcome in self.rounds[engine])

    def ratios(self, above: str, below: str) -> list[float]:
        """The one engine's rate over the other's, within each round."""
        pairs = zip(self.rounds[above], self.rounds[below], strict=True)
        return [one.rate / other.rate for one, other in pairs]

    def ratio(self, above: str, below: str) -> float:
        """Their median."""
        return statistics.median(self.ratios(above, below))

    def events_per_frame(self, engine: str) -> float | None:
        outcome = self.rounds[engine][0]
        return None if outcome.events is None else outcome.events / outcome.frames


@dataclass(frozen=True)
class Point:
    """A fleet of the cost curve. ``growth``: its cost a frame over that of the smallest fleet,
    measured right before and after, and the same of SimPy's station; ``None``, with the reason in
    ``missing``, where it was not measured.
    """

    cars: int
    frames: int = 0
    growth: float | None = None
    anchor_growth: float | None = None
    events_per_frame: float | None = None
    prepare_ms_per_car: float | None = None
    missing: str = ""


@dataclass(frozen=True)
class Measured:
    """Everything that one run of the benchmark found out."""

    command: str
    machine: Mapping[str, str]
    engines: Engines
    parts: FleetParts
    races: Sequence[Race]
    skipped: Mapping[str, str]
    work: Mapping[str, Work]
    curves: Mapping[str, Sequence[Point]]
    hour: Drive
    memory: Mapping[str, float]
    profile: Sequence[Hot]
    versions: Mapping[str, str] = field(default_factory=dict)


def measure(sizes: Sizes, peers_python: str, command: str, tell: Callable[[str], None]) -> Measured:
    """Runs the whole benchmark; ``tell`` is told what runs."""
    tell("both engines")
    engines = both_engines.measure(sizes.rounds, sizes.engines)
    tell("a fleet in parts")
    parts = fleet_parts.measure(*sizes.parts, sizes.rounds)
    tell("3 cars")
    skipped: dict[str, str] = {}
    versions: dict[str, str] = {}
    work: dict[str, Work] = {}
    runs: dict[str, Callable[[], Outcome]] = {}
    events: dict[str, int] = {}
    for name, laps in {FIRST_LAP: 1, ALL_LAPS.format(sizes.laps): sizes.laps}.items():
        for recorded, change in {name: {}, name + LEAST: {"record": ()}}.items():
            driven, times = prepare(replace(three_cars(laps), **change)), sizes.laps // laps
            work[recorded] = work_of(driven)
            runs[recorded] = partial(run_genie, driven, times)
            events[recorded] = times * work[recorded].events
    frames = work[ALL_LAPS.format(sizes.laps)].frames
    races = [
        race(
            3,
            runs,
            events,
            frames,
            rounds=sizes.rounds,
            peers_python=peers_python,
            skipped=skipped,
            versions=versions,
        )
    ]
    for cars, drive_s in sizes.fleets.items():
        tell(f"{cars:,} cars")
        prepared = prepare(fleet(cars, drive_s))
        of_fleet = work[f"{FLEET}, {cars:,} cars"] = work_of(prepared)
        runs = {FLEET: partial(run_genie, prepared)}
        events = {FLEET: of_fleet.events}
        races.append(
            race(
                cars,
                runs,
                events,
                of_fleet.frames,
                rounds=sizes.rounds,
                peers_python=peers_python,
                skipped=skipped,
                versions=versions,
            )
        )
    tell("memory and profile")
    short, long = (genie_runs.footprint(laps) for laps in sizes.memory_laps)
    hot = genie_runs.profile(sizes.profile_entries)
    tell(f"{sizes.minutes} simulated minutes")
    laps = math.ceil(60 * sizes.minutes / genie_runs.LAP_S)
    hour = drive(prepare(three_cars(laps, cameras=1)))
    curves = {name: cost_curve(name, sizes, tell) for name in sizes.curves}
    return Measured(
        command,
        machine(),
        engines,
        parts,
        races,
        skipped,
        work,
        curves,
        hour,
        genie_runs.bytes_per_frame(short, long),
        hot,
        versions,
    )


def race(
    cars: int,
    genie: Mapping[str, Callable[[], Outcome]],
    events: Mapping[str, int],
    frames: int,
    *,
    rounds: int,
    peers_python: str,
    skipped: dict[str, str],
    versions: dict[str, str],
) -> Race:
    """All engines take turns with as many frames of as many cameras. What cannot run is left out,
    with the reason in ``skipped``.
    """
    station = station_of(frames, genie_runs.phases_ns(CAMERAS_PER_CAR * cars))
    found: dict[str, list[Outcome]] = {}
    for _ in range(rounds):
        for name, run in genie.items():
            gc.collect()
            outcome = run()
            found.setdefault(name, []).append(Outcome(outcome.frames, outcome.cpu_s, events[name]))
        for name, engine in ENGINES.items():
            gc.collect()
            found.setdefault(name, []).append(engine(station))
        for name in peers.PEERS:
            if name not in skipped and cars <= peers.MAX_CARS.get(name, cars):
                _run_peer(
                    name, station, peers_python, found=found, skipped=skipped, versions=versions
                )
    return Race(
        cars, {name: outcomes for name, outcomes in found.items() if len(outcomes) == rounds}
    )


def _run_peer(
    name: str,
    station: Station,
    python: str,
    *,
    found: dict[str, list[Outcome]],
    skipped: dict[str, str],
    versions: dict[str, str],
) -> None:
    answer = peers.run_peer(python, name, station)
    if "skipped" in answer:
        skipped[name] = answer["skipped"]
        return
    versions[name] = answer["version"]
    found.setdefault(name, []).append(Outcome(answer["frames"], answer["cpu_s"]))


@dataclass(frozen=True)
class Costs:
    """Processor time [s] of a frame in Genie runs and in SimPy's station, and what was run."""

    genie_s: float
    anchor_s: float
    frames: int
    events_per_frame: float


def cost_curve(name: str, sizes: Sizes, tell: Callable[[str], None]) -> list[Point]:
    """The cost of a frame for ever larger fleets, each compared with the smallest just before and
    after it.
    """
    make = genie_runs.FLEETS[name]
    least = sizes.curves[name][0]
    smallest = prepare(make(least, sizes.curve_s))
    before = costs(smallest, sizes.curve_frames)
    points: list[Point] = []
    took: list[tuple[int, float]] = []
    for cars in sizes.curves[name]:
        expected_s = _expected_s(took, cars)
        if expected_s > sizes.longest_s:
            points.append(
                Point(cars, missing=f"not measured: it would take about {expected_s:,.0f} s")
            )
            continue
        tell(f"{name}, {cars:,} cars")
        began_s = time.process_time()
        prepared = prepare(make(cars, sizes.curve_s))
        prepare_s = time.process_time() - began_s
        here = costs(prepared, sizes.curve_frames)
        took.append((cars, time.process_time() - began_s))
        del prepared
        after = costs(smallest, sizes.curve_frames)
        growth = 2 * here.genie_s / (before.genie_s + after.genie_s)
        anchor_growth = 2 * here.anchor_s / (before.anchor_s + after.anchor_s)
        prepare_ms = 1000 * prepare_s / cars
        points.append(
            Point(cars, here.frames, growth, anchor_growth, here.events_per_frame, prepare_ms)
        )
        before = after
    return points


def costs(prepared: Prepared, least_frames: int) -> Costs:
    """Median costs of a frame in as many runs as give so many frames."""
    genie_s, anchor_s, frames, events = [], [], 0, 0
    while frames < least_frames:
        gc.collect()
        drove = drive(prepared)
        genie_s.append(drove.cost_s)
        frames += drove.frames
        events += drove.events
        station = station_of(drove.frames, genie_runs.phases_ns(drove.cameras))
        gc.collect()
        began_s = time.process_time()
        ENGINES["simpy"](station)
        anchor_s.append((time.process_time() - began_s) / drove.frames)
    return Costs(statistics.median(genie_s), statistics.median(anchor_s), frames, events / frames)


def _expected_s(took: Sequence[tuple[int, float]], cars: int) -> float:
    """How long a fleet will take, by the growth between the two before it; at least in proportion
    to the last.
    """
    if len(took) < 2:
        return 0.0
    (fewer, fewer_s), (more, more_s) = took[-2:]
    power = max(math.log(more_s / fewer_s) / math.log(more / fewer), 1.0)
    return float(more_s * (cars / more) ** power)


def machine() -> dict[str, str]:
    """What the figures were made with."""
    made = provenance.environment()
    packages = ", ".join(f"{name} {made['packages'][name]}" for name in ("simpy", "numpy"))
    commit = (made["commit"] or "no commit")[:9]
    try:
        load = f"{os.getloadavg()[0]:.1f}"
    except (AttributeError, OSError):
        load = "unknown"
    return {
        "processor": f"{_processor()}, {os.cpu_count()} cores, load {load} at the end",
        "system": made["platform"],
        "versions": (
            f"genie-sim {made['genie_sim']} ({commit}), Python {made['python']}, {packages}"
        ),
    }


def _processor() -> str:
    cpuinfo = Path("/proc/cpuinfo")
    lines = cpuinfo.read_text(encoding="utf-8").splitlines() if cpuinfo.is_file() else []
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return models[0] if models else platform.processor() or platform.machine()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help="smaller runs: half a minute")
    parser.add_argument(
        "--peers",
        default=sys.executable,
        metavar="PYTHON",
        help="which has leafsim, ciw or salabim",
    )
    parser.add_argument(
        "--markdown", action="store_true", help="write the tables and figures of docs/speed.md"
    )
    arguments = parser.parse_args()
    command = "python benchmarks/speed.py" + " --quick" * arguments.quick
    sizes = QUICK if arguments.quick else FULL
    measured = measure(
        sizes,
        arguments.peers,
        command,
        lambda what: print(f"... {what}", file=sys.stderr, flush=True),
    )
    for name, block in speed_page.blocks(measured).items():
        print(f"\n{name}\n\n{block}")
    if arguments.markdown:
        try:
            speed_page.write(measured)
        except UserError as error:
            sys.exit(str(error))


if __name__ == "__main__":
    main()
