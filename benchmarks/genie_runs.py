"""Genie's side of the speed benchmark: whole runs, where their time and memory go, and what they
cost as they grow.
"""

from __future__ import annotations

import cProfile
import json
import math
import os
import pstats
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import count
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
from genie_sim.engine import PURE

from benchmarks.station import PERIOD_NS, Outcome
from genie_sim.build import Prepared
from genie_sim.parallel import max_memory_bytes
from genie_sim.recording.records import Tables
from genie_sim.runner import Progress, prepare, simulate
from genie_sim.scenario.scenario import Scenario, load_scenario, read_scenario
from genie_sim.seeds import stream
from genie_sim.sim.clock import Clock

REPOSITORY = Path(__file__).resolve().parent.parent
CARS_PER_EDGE = 10
ROUTE_S = 12  # where on the 15.4 s drive cars may start
BLOCKS = 22  # each way, of fleet_1000's town
LAP_S = 10.2  # 3car_hetero: a window of 9.2 s and a pause of 1 s


def three_cars(laps: int, cameras: int | None = None, *, method: str = "genie") -> Scenario:
    """``3car_hetero`` with one method only, driven so often; with ``cameras``, only the first so
    many of each car.
    """
    of_cars = (f"cars[{car}].route.laps={laps}" for car in range(3))
    scenario = load_scenario("3car_hetero", [f"methods=[{method}]", *of_cars])
    return replace(scenario, cameras=scenario.cameras[:cameras])


def fleet(cars: int, drive_s: float) -> Scenario:
    """So many cars on the one shipped street, each a tenth of a second of the drive ahead of the
    one before, with an edge for every ten that shares with the edges before and after it. Each
    drives for ``drive_s``.
    """
    return read_scenario(
        {"name": "fleet", "methods": ["genie"], "edges": _edges(cars), "cars": _cars(cars, drive_s)}
    )


def town(cars: int, drive_s: float) -> Scenario:
    """``fleet_1000`` with so many cars in a town as densely driven, and so with as many edges to a
    car.
    """
    blocks = max(round(BLOCKS * math.sqrt(cars / 1000)), 2)
    of_town = (f"perception.duration={drive_s} s", f"perception.town.blocks=[{blocks}, {blocks}]")
    return load_scenario("fleet_1000", ["methods=[genie]", f"fleet.cars={cars}", *of_town])


FLEETS: dict[str, Callable[[int, float], Scenario]] = {"street": fleet, "town": town}


def _edges(cars: int) -> list[dict[str, Any]]:
    names = [f"edge{number + 1}" for number in range(-(-cars // CARS_PER_EDGE))]
    beside = [
        [*names[max(place - 1, 0) : place], *names[place + 1 : place + 2]]
        for place in range(len(names))
    ]
    return [
        {"name": name, "device": "agx_xavier", "neighbours": neighbours}
        for name, neighbours in zip(names, beside, strict=True)
    ]


def _cars(cars: int, drive_s: float) -> list[dict[str, Any]]:
    begins_s = [number / 10 % ROUTE_S for number in range(cars)]
    return [
        {
            "name": f"car{number + 1}",
            "device": "jetson_tx2",
            "edge": f"edge{number // CARS_PER_EDGE + 1}",
            "route": {"window": [f"{begin_s:.1f} s", f"{begin_s + drive_s:.2f} s"]},
        }
        for number, begin_s in enumerate(begins_s)
    ]


def phases_ns(cameras: int) -> tuple[int, ...]:
    """When each of the station's cameras takes its first frame: anywhere in the first period."""
    drawn: np.ndarray[Any, Any] = stream(1, "speed", "phases").integers(PERIOD_NS, size=cameras)
    return tuple(int(phase_ns) for phase_ns in drawn)


def run_genie(prepared: Prepared, times: int = 1) -> Outcome:
    """Whole runs, from the building of the world to the last answer, with all tables. Preparing is
    not timed: it is done once for any number of runs.
    """
    frames = 0
    began_s = time.process_time()
    for _ in range(times):
        frames += len(simulate(prepared)["frames"])
    return Outcome(frames, time.process_time() - began_s)


@dataclass(frozen=True)
class Work:
    """What one run does for its frames."""

    frames: int
    events: int
    table_rows: dict[str, int]


def work_of(prepared: Prepared) -> Work:
    """Counts the SimPy events and the rows of a run."""
    tables, events = _counted(prepared)
    return Work(len(tables["frames"]), events, {name: len(table) for name, table in tables.items()})


def _counted(prepared: Prepared, progress: Progress | None = None) -> tuple[Tables, int]:
    """A run's tables, and how many events its worlds had."""
    after, events = Clock.after, count()

    def counted(clock: Clock, delay_ns: int, *what: Any) -> None:
        next(events)
        after(clock, delay_ns, *what)

    with mock.patch.object(Clock, "after", counted):
        tables = simulate(prepared, progress)
    return tables, next(events)


@dataclass(frozen=True)
class Drive:
    """Processor time [s] at each simulated instant [s] while the cars drive: from the first to the
    last frame, without the building of the world before and the wait for late answers after it.
    """

    simulated_s: tuple[float, ...]
    cpu_s: tuple[float, ...]
    frames: int
    events: int
    cameras: int

    @property
    def cost_s(self) -> float:
        """Processor time a frame."""
        return (self.cpu_s[-1] - self.cpu_s[0]) / self.frames

    def between(self, begin_s: float, end_s: float) -> float:
        """Processor time [s] from one simulated instant to another."""
        begin, end = np.interp([begin_s, end_s], self.simulated_s, self.cpu_s)
        return float(end - begin)


def drive(prepared: Prepared) -> Drive:
    """A run, with the clock read ten times a simulated second. Processor time: what else runs on
    the machine counts less than in wall time, and these runs are too long to take turns with
    others.
    """
    instants: list[tuple[float, float]] = []

    def tell(simulated_s: float, end_s: float, _: str) -> None:
        if not instants or simulated_s > instants[-1][0]:
            instants.append((simulated_s, time.process_time()))

    tables, events = _counted(prepared, tell)
    simulated_s, cpu_s = zip(*instants, strict=True)
    cameras = len(prepared.drives) * len(prepared.scenario.cameras)
    return Drive(simulated_s, cpu_s, len(tables["frames"]), events, cameras)


@dataclass(frozen=True)
class Footprint:
    """Memory at the end of a run, all tables in hand."""

    frames: int
    table_bytes: dict[str, int]
    process_bytes: int


def _printed_by(call: str, variables: Mapping[str, str] | None = None) -> Any:
    """The JSON that a call of this module prints in a process of its own."""
    ran = subprocess.run(
        [sys.executable, "-c", f"from benchmarks import genie_runs; genie_runs.{call}"],
        cwd=REPOSITORY,
        env={**os.environ, **(variables or {})},
        check=True,
        capture_output=True,
        text=True,
    )
    return json.loads(ran.stdout)


def footprint(laps: int) -> Footprint:
    """Of a run in a process of its own, so that nothing that ran before counts."""
    return Footprint(**_printed_by(f"print_footprint({laps})"))


def print_footprint(laps: int) -> None:
    """Runs ``3car_hetero`` in this process and prints its footprint as JSON."""
    # where long tables wait, as in the result folder of a run
    with tempfile.TemporaryDirectory() as folder:
        tables = simulate(prepare(three_cars(laps)), spill=Path(folder))
        table_bytes = {name: table.size_bytes for name, table in tables.items()}
        print(json.dumps(asdict(Footprint(len(tables["frames"]), table_bytes, _resident_bytes()))))


def _resident_bytes() -> int:
    """The memory of this process now; where the system does not tell, the most it ever had."""
    status = Path("/proc/self/status")
    if status.is_file():
        lines = status.read_text(encoding="utf-8").splitlines()
        return 1024 * next(int(line.split()[1]) for line in lines if line.startswith("VmRSS:"))
    return max_memory_bytes() or 0


def bytes_per_frame(short: Footprint, long: Footprint) -> dict[str, float]:
    """What one more frame takes: by table, ``all tables`` and ``whole process``. Whatever a run of
    any length takes cancels out.
    """
    frames = long.frames - short.frames
    grown = {
        name: (long.table_bytes[name] - short.table_bytes[name]) / frames
        for name in short.table_bytes
    }
    return {
        **grown,
        "all tables": sum(grown.values()),
        "whole process": (long.process_bytes - short.process_bytes) / frames,
    }


@dataclass(frozen=True)
class Hot:
    """A function in the profile: calls a frame and its share of all time, calls it makes left
    out.
    """

    where: str
    calls_per_frame: float
    share: float


def profile(entries: int) -> Sequence[Hot]:
    """Where the time of ``3car_hetero``'s first lap goes, the most expensive first, in plain
    Python: cProfile does not see what is compiled.
    """
    return [Hot(**hot) for hot in _printed_by(f"print_profile({entries})", {PURE: "1"})]


def print_profile(entries: int) -> None:
    """Profiles a run in this process and prints the ``Hot`` as JSON. cProfile makes small functions
    look dearer than they are.
    """
    profiler = cProfile.Profile()
    tables = profiler.runcall(simulate, prepare(three_cars(1)))
    timed: dict[tuple[str, int, str], Any] = pstats.Stats(profiler).stats  # type: ignore[attr-defined]
    whole_s = sum(own_s for _, _, own_s, _, _ in timed.values())
    dearest = sorted(timed.items(), key=lambda item: item[1][2], reverse=True)[:entries]
    frames = len(tables["frames"])
    hot = [
        Hot(_where(place), calls / frames, own_s / whole_s)
        for place, (_, calls, own_s, _, _) in dearest
    ]
    print(json.dumps([asdict(one) for one in hot]))


def _where(place: tuple[str, int, str]) -> str:
    """``sim/log.py: answered``; code outside the project by its package, built-ins by their
    name.
    """
    file, _, function = place
    if file == "~":
        name = function.strip("<>").replace("built-in method ", "").replace("method ", "")
        return name.partition(" at 0x")[0]
    parts = Path(file).parts
    root = parts.index("genie_sim") + 1 if "genie_sim" in parts else len(parts) - 2
    return f"{'/'.join(parts[root:])}: {function}"
