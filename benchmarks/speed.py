"""How long a user waits for genie-sim, and what its simulation costs beside plain SimPy and other
simulators.

    python benchmarks/speed.py [--quick] [--peers PYTHON] [--also PART ...] [--markdown]

``--quick`` takes less than a minute, all of it a few. ``--peers`` names a Python that has leafsim,
ciw and salabim; what it lacks is left out. ``--also`` measures what takes long: ``reproduce``,
``fleet_1000``, ``sweep``. ``--markdown`` writes the tables of docs/speed.md anew.

What is compared takes turns, round by round; tables have the medians of the rounds, and the ratios
of these.
"""

from __future__ import annotations

import argparse
import gc
import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks import plain_simpy
from benchmarks.peers import PEERS, run_peer
from benchmarks.plain_simpy import Answer, Fleet, Frame
from genie_sim.analysis.renderers import markdown_rows
from genie_sim.base.errors import UserError
from genie_sim.core.messages import Detections, Header
from genie_sim.links.wire import Wire
from genie_sim.record import provenance
from genie_sim.runs import build
from genie_sim.runs.prepare import Prepared, prepare
from genie_sim.runs.simulate import simulate
from genie_sim.scenario.reading import load_scenario, read_scenario
from genie_sim.scenario.scenario import Scenario
from genie_sim.sim.clock import Clock
from genie_sim.sim.host import Host
from tools.page_tables import filled

REPOSITORY = Path(__file__).resolve().parent.parent
PAGE = REPOSITORY / "docs" / "speed.md"
CARS_AN_EDGE = 10
DRIVE_S = 2.0  # of a fleet's car, on each lap
STARTS_S = 12  # of the 15.4 s long drive; where on it a fleet's cars may start
NOT_MEASURED = "not measured"
PARTS = ("reproduce", "fleet_1000", "sweep")
Block = str  # a part of the page


@dataclass(frozen=True)
class Sizes:
    """How much is measured: how often, with which fleets (cars, and how many laps each drives with
    one camera), and for which fleets the growth of the cost of a frame. The cost of a frame is that
    of ``least_frames`` at least.
    """

    rounds: int
    laps: int
    least_frames: int
    fleets: Mapping[int, int]
    growth: Sequence[int]


FULL = Sizes(
    rounds=5,
    laps=10,
    least_frames=5_000,
    fleets={3: 100, 100: 5},
    growth=(3, 1000),
)
QUICK = Sizes(rounds=1, laps=10, least_frames=2_000, fleets={3: 20, 100: 1}, growth=(3, 30))


# What a user waits for


@dataclass(frozen=True)
class Spent:
    """What a command took: processor time of it and of the processes that it started, time on the
    wall, and the most memory that one of these processes had.
    """

    cpu_s: float
    wall_s: float
    memory_mb: float


# A small process starts the command and tells what it took. Linux counts the memory of whoever
# starts a process as that of the started one, so this program, which is large, starts none itself.
MEASURE = """
import resource, subprocess, sys, time
began_s = time.perf_counter()
status = subprocess.run(sys.argv[1:], stdout=sys.stderr).returncode
wall_s = time.perf_counter() - began_s
used = resource.getrusage(resource.RUSAGE_CHILDREN)
unit = 1 if sys.platform == "darwin" else 1024
print(used.ru_utime + used.ru_stime, wall_s, used.ru_maxrss * unit / 1e6)
sys.exit(status)
"""


def genie_sim(*arguments: str) -> Spent:
    """Runs ``genie-sim`` in a folder of its own. Raises ``UserError`` if it fails."""
    command = [sys.executable, "-c", MEASURE, sys.executable, "-m", "genie_sim", *arguments]
    environment = {**os.environ, "PYTHONPATH": str(REPOSITORY)}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)  # as installed: compiled once
    with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryFile("w+") as said:
        measured = subprocess.run(
            command,
            cwd=folder,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=said,
            text=True,
            check=False,
        )
        if measured.returncode:
            said.seek(0)
            last = (said.read().strip().splitlines() or ["it says nothing"])[-1]
            raise UserError(f"genie-sim {' '.join(arguments)}: {last}")
    return Spent(*map(float, measured.stdout.split()))


def waits(rounds: int, also: Sequence[str]) -> Block:
    """The commands that a user gives."""
    scenario = str(REPOSITORY / "scenarios/street_3car_hetero.yaml")
    commands = {
        "`genie-sim --help`": (("--help",), rounds),
        "`genie-sim run scenarios/street_3car_hetero.yaml`": (("run", scenario), rounds),
        "`genie-sim reproduce --quick`": (("reproduce", "--quick"), int("reproduce" in also)),
        "`genie-sim reproduce`": (("reproduce",), int("reproduce" in also)),
        "`genie-sim run fleet_1000`": (("run", "fleet_1000"), int("fleet_1000" in also)),
        f"`genie-sim {' '.join(sweep(1))}`": (sweep(1), int("sweep" in also)),
        f"`genie-sim {' '.join(sweep(2))}`": (sweep(2), int("sweep" in also)),
    }
    spent: dict[str, list[Spent]] = {text: [] for text in commands}
    failed: dict[str, str] = {}
    for number in range(rounds):
        for text, (arguments, times) in commands.items():
            if number < times and text not in failed:
                try:
                    spent[text].append(genie_sim(*arguments))
                except UserError as error:
                    failed[text] = str(error).replace("|", "/")
    rows = []
    for text, found in spent.items():
        if found:
            columns = zip(*((one.wall_s, one.cpu_s, one.memory_mb) for one in found), strict=True)
            wall_s, cpu_s, memory_mb = map(median, columns)
            rows.append((text, f"{wall_s:.2f}", f"{cpu_s:.2f}", f"{memory_mb:.0f}"))
        else:
            rows.append((text, failed.get(text, NOT_MEASURED), "", ""))
    header = ("command", "wall time [s]", "processor time [s]", "most memory of a process [MB]")
    return markdown_rows([header, *rows], [True] * 3)


def sweep(jobs: int) -> tuple[str, ...]:
    """Fifteen points with two seeds each, on so many workers."""
    return "sweep", "confidence", "--seeds", "2", "--jobs", str(jobs)


# The cost of a frame


def laps(method: str, count: int, **changes: Any) -> Scenario:
    """``street_3car_hetero`` with one method, driven so often."""
    return replace(
        load_scenario("street_3car_hetero", [f"methods=[{method}]", f"cars[*].route.laps={count}"]),
        **changes,
    )


def fleet(cars: int, method: str, laps: int = 1, cameras: int | None = None) -> Scenario:
    """So many cars on the one shipped street, each a tenth of a second of the drive ahead of the
    one before, with an edge server for every ten.

    ``cameras``: only the first so many of each car; then nothing but frames is recorded.
    """
    begins_s = [number / 10 % STARTS_S for number in range(cars)]
    edges = [f"edge{number + 1}" for number in range(-(-cars // CARS_AN_EDGE))]
    scenario = read_scenario(
        {
            "name": "fleet",
            "methods": [method],
            "edges": [{"name": edge, "device": "quadro_rtx_4000"} for edge in edges],
            "cars": [
                {
                    "name": f"car{number + 1}",
                    "device": "jetson_tx2",
                    "edge": edges[number // CARS_AN_EDGE],
                    "route": {
                        "window": [f"{begin_s:.1f} s", f"{begin_s + DRIVE_S:.2f} s"],
                        "laps": laps,
                    },
                }
                for number, begin_s in enumerate(begins_s)
            ],
        }
    )
    if cameras is None:
        return scenario
    return replace(scenario, cameras=scenario.cameras[:cameras], record=())


def timed(run: Callable[[], Any]) -> tuple[float, Any]:
    """The processor time of a call [s], and what it returns. What was there before is not searched
    for garbage meanwhile.
    """
    gc.collect()
    gc.freeze()
    began_s = time.process_time()
    result = run()
    cpu_s = time.process_time() - began_s
    gc.unfreeze()
    return cpu_s, result


def frame_us(prepared: Prepared, least_frames: int = 1) -> float:
    """Processor time of a frame [us], from the building of the world to the last answer, in as many
    runs as give so many frames.
    """

    def run() -> int:
        frames = 0
        while frames < least_frames:
            frames += len(simulate(prepared)["frames"])
        return frames

    cpu_s, frames = timed(run)
    return 1e6 * cpu_s / frames


def in_turn(rounds: int, cases: Mapping[str, Callable[[], float]]) -> dict[str, float]:
    """The median of each case; in every round each has its turn."""
    values: dict[str, list[float]] = {name: [] for name in cases}
    for _ in range(rounds):
        for name, measure in cases.items():
            values[name].append(measure())
    return {name: median(of_case) for name, of_case in values.items()}


def costs(sizes: Sizes) -> Block:
    """What a frame of ``street_3car_hetero`` costs, under each method."""
    many = f"{sizes.laps} laps"
    cases = {
        "`local`, `record: []`": laps("local", sizes.laps, record=()),
        "`remote`, `record: []`": laps("remote", sizes.laps, record=()),
        "Genie, lap 1, `record: []`": laps("genie", 1, record=()),
        "Genie, lap 1, all tables": laps("genie", 1),
        f"Genie, {many}, `record: []`": laps("genie", sizes.laps, record=()),
        f"Genie, {many}, all tables": laps("genie", sizes.laps),
    }
    measures = {
        name: partial(frame_us, prepare(scenario), sizes.least_frames)
        for name, scenario in cases.items()
    }
    rows = [(name, f"{us:.0f}") for name, us in in_turn(sizes.rounds, measures).items()]
    return markdown_rows([("run", "processor time of a frame [µs]"), *rows], [True])


# Like for like


def plain_fleet(prepared: Prepared) -> Fleet:
    """What ``plain_simpy`` needs to simulate the ``remote`` of a scenario whose cars, edges and
    links are each of one kind.
    """
    setup = build.setup(prepared, prepared.scenario.methods[0])
    car = setup.cars[0]
    wire = setup.links[car.name]
    assert isinstance(wire, Wire) and not (wire.jitter_ns or wire.loss) and wire.rate_up_bps
    cameras = [list(_frames(setup, car, camera)) for car in setup.cars for camera in setup.cameras]
    edge_of = {car.name: str(car.edge) for car in setup.cars}
    car_hop = setup.devices[setup.cars[0].device].hop
    edge_hop = setup.devices[setup.edges[0].device].hop
    return Fleet(
        edge_of,
        cameras,
        car_hop_ns=(car_hop.fixed_ns, car_hop.per_megabyte_ns),
        edge_hop_ns=(edge_hop.fixed_ns, edge_hop.per_megabyte_ns),
        bits_a_s=wire.rate_up_bps,
        flight_ns=wire.delay_ns,
    )


def _frames(setup: Any, car: Any, camera: Any) -> Iterator[Frame]:
    """What a camera of a car takes, by the settings of its route."""
    (edge,) = (edge for edge in setup.edges if edge.name == car.edge)
    host = Host(Clock(), edge.name, setup.devices[edge.device], seed=setup.seed)
    begin_ns, end_ns = car.route.window_ns
    taken = [
        frame
        for frame in setup.frames[car.name][camera.recording]
        if begin_ns <= frame.stamp_ns < end_ns
    ]
    for lap in range(car.route.laps):
        lap_ns = lap * (end_ns - begin_ns + car.route.pause_ns)
        start_ns = car.route.start_ns + camera.phase_ns - begin_ns + lap_ns
        for frame in taken:
            header = Header(start_ns + frame.stamp_ns, camera.name, car.name)
            size = frame.size_bytes if camera.size_bytes is None else camera.size_bytes
            answer = Detections(header, frame.detections)
            yield Frame(
                car.name,
                camera.name,
                header.stamp_ns,
                size,
                answer.size_bytes,
                host.detection_ns(header),
            )


def answers_of(prepared: Prepared) -> list[Answer]:
    """The answers that genie-sim gives."""
    columns = simulate(prepared)["frames"].columns()
    names = ("car", "stream", "stamp_ns", "result_answer_ns")
    rows = zip(*(columns[name].tolist() for name in names), strict=True)
    return [
        (str(car), str(stream), int(stamp_ns), int(answer_ns))
        for car, stream, stamp_ns, answer_ns in rows
        if answer_ns == answer_ns and answer_ns is not None
    ]


def like_for_like(sizes: Sizes, peers_python: str) -> Block:
    """genie-sim's ``remote`` beside plain SimPy and other simulators, with the same fleets."""
    rows = []
    for cars, times in sizes.fleets.items():
        rows += compared(cars, times, sizes.rounds, peers_python)
    header = (
        "cars",
        "simulator",
        "processor time of a frame [µs]",
        "over plain SimPy's",
        "frames answered",
        "of plain SimPy's answers",
    )
    return markdown_rows([header, *rows], [False, True, True, True, True])


def compared(cars: int, times: int, rounds: int, peers_python: str) -> list[tuple[str, ...]]:
    """The rows of one fleet, whose cars drive so many laps."""
    prepared = prepare(fleet(cars, "remote", times, cameras=1))
    plain = plain_fleet(prepared)
    by_hand, ours = "plain SimPy, by hand", "genie-sim"
    expected = set(plain_simpy.simulate(plain))
    answers = {by_hand: expected, ours: set(answers_of(prepared))}
    skipped: dict[str, str] = {}

    def simpy_us() -> float:
        return 1e6 * timed(lambda: plain_simpy.simulate(plain))[0] / plain.frames

    def peer_us(name: str) -> float:
        answer = run_peer(peers_python, name, plain)
        if "skipped" in answer:
            skipped[title(name)] = answer["skipped"]
            return float("nan")
        answers[title(name)] = {tuple(one) for one in answer["answers"]}
        return float(1e6 * answer["cpu_s"] / plain.frames)

    cases: dict[str, Callable[[], float]] = {by_hand: simpy_us, ours: lambda: frame_us(prepared)}
    costs_us = in_turn(rounds, cases | {title(name): partial(peer_us, name) for name in PEERS})
    rows = []
    for name, us in costs_us.items():
        if name in skipped:
            rows.append((f"{cars:,}", name, skipped[name], "", "", ""))
        else:
            share = f"{len(answers[name]) / plain.frames:.0%}"
            same = len(answers[name] & expected) / len(expected)
            same_text = "all" if answers[name] == expected else f"{same:.0%}"
            rows.append(
                (f"{cars:,}", name, f"{us:.1f}", f"{us / costs_us[by_hand]:.2f}", share, same_text)
            )
    return rows


def title(peer: str) -> str:
    return {"leafsim": "LEAF", "ciw": "Ciw"}.get(peer, peer)


# Growth


def growth(sizes: Sizes) -> Block:
    """What a frame of a Genie run costs in ever larger fleets, each beside the smallest."""
    cases = {
        f"{cars:,}": partial(frame_us, prepare(fleet(cars, "genie")), sizes.least_frames)
        for cars in sizes.growth
    }
    costs_us = in_turn(min(sizes.rounds, 3), cases)
    smallest_us = next(iter(costs_us.values()))
    rows = [(cars, f"{us:.0f}", f"{us / smallest_us:.2f}") for cars, us in costs_us.items()]
    header = ("cars", "processor time of a frame [µs]", f"over that with {sizes.growth[0]} cars")
    return markdown_rows([header, *rows], [True, True])


# The page


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


def about(command: str) -> Block:
    lines = {**machine(), "made by": f"`{command}`"}
    return "\n".join(f"- {what}: {text}" for what, text in lines.items())


def measure(
    sizes: Sizes, command: str, peers_python: str, also: Sequence[str]
) -> Iterator[tuple[str, Block]]:
    """Every table, by the name of its place in the page."""
    yield "waits", waits(sizes.rounds, also)
    yield "frames", costs(sizes)
    yield "peers", like_for_like(sizes, peers_python)
    yield "growth", growth(sizes)
    yield "machine", about(command)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n\n")[0])
    parser.add_argument("--quick", action="store_true", help="less of all: less than a minute")
    parser.add_argument(
        "--peers", default=sys.executable, metavar="PYTHON", help="has leafsim, ciw, salabim"
    )
    parser.add_argument(
        "--also", nargs="+", default=(), choices=PARTS, metavar="PART", help=", ".join(PARTS)
    )
    parser.add_argument("--markdown", action="store_true", help="write docs/speed.md anew")
    given = parser.parse_args()
    command = "python benchmarks/speed.py" + " --quick" * given.quick
    command += f" --also {' '.join(given.also)}" if given.also else ""
    blocks = {}
    for name, block in measure(QUICK if given.quick else FULL, command, given.peers, given.also):
        blocks[name] = block
        print(f"\n{name}\n\n{block}", flush=True)
    if given.markdown:
        PAGE.write_text(filled(PAGE.read_text(encoding="utf-8"), blocks), encoding="utf-8")


if __name__ == "__main__":
    main()
