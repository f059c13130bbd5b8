"""What a million cars would cost, from what one machine measures of a few: time, memory and disk,
cell by cell.

    python benchmarks/cell_costs.py [--quick] [--markdown]

Processor time of one core, memory of processes of their own, sizes of written files. ``--markdown``
writes the tables of docs/explanation/million-cars.md anew.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks.cells import BLOCKS_A_CELL, CARS_A_CELL, Setting, apart, small_town, write
from benchmarks.speed import REPOSITORY, machine
from benchmarks.speed_page import table
from genie_sim.build import Prepared
from genie_sim.errors import UserError
from genie_sim.runner import simulate
from genie_sim.scenario.scenario import Record
from genie_sim.town import Town, TownRules

FRAMES_A_S = 10
FLEET_1000: tuple[Record, ...] = ("lookups", "resources", "held")
CARS, HOUR_S = 1_000_000, 3600
# What is timed, and the memory of one cell: right at the beginning, when its caches are full, and
# later.
FULL = (
    Setting(3, 3, 180, 30.0),
    Setting(1, 1, 20, 1.0),
    Setting(1, 1, 20, 120.0),
    Setting(1, 1, 20, 360.0),
)
QUICK = (
    Setting(2, 1, 40, 5.0),
    Setting(1, 1, 20, 1.0),
    Setting(1, 1, 20, 10.0),
    Setting(1, 1, 20, 30.0),
)
TOWNS = (4, 40)  # blocks each way


@dataclass(frozen=True)
class Costs:
    """Processor time [s] of a frame: ``least_s`` of cells apart with the table of frames alone,
    ``usual_s`` with the tables of ``fleet_1000``, ``jointly_s`` of the whole town with the table of
    frames alone. ``disk``: written bytes a frame of each table. Memory in bytes: of a ``process``
    that has hardly begun, of a ``car`` that has driven for ``filled_s``, of each ``frame`` after
    that, and of a ``block`` of the town.
    """

    setting: Setting
    least_s: float
    usual_s: float
    jointly_s: float
    prepare_s: float  # a car
    disk: dict[str, float]
    filled_s: float
    process: float
    car: float
    frame: float
    block_s: float
    block: float


def measure(sizes: tuple[Setting, Setting, Setting, Setting]) -> Costs:
    """Runs all of it: two minutes for ``FULL``."""
    setting = sizes[0]
    small_town(setting, 1)  # reads the laws and profiles
    began_s = time.process_time()
    joint = small_town(setting, 1)
    prepare_s = (time.process_time() - began_s) / setting.cars
    cells = [cell for cell in apart(joint) if cell.drives]
    disk = written(_recording(joint, FLEET_1000))
    least = _frame_s([_recording(one, ()) for one in cells])
    usual = _frame_s([_recording(one, FLEET_1000) for one in cells])
    jointly = _frame_s([_recording(joint, ())])
    process, filled, later = (resident(one) for one in sizes[1:])
    car = (filled - process) / sizes[2].cars
    frame = (later - filled) / (_frames(sizes[3]) - _frames(sizes[2]))
    block_s, block = _town()
    return Costs(
        setting,
        least,
        usual,
        jointly,
        prepare_s,
        disk,
        sizes[2].drive_s,
        process,
        car,
        frame,
        block_s,
        block,
    )


def _recording(prepared: Prepared, record: tuple[Record, ...]) -> Prepared:
    scenario, expanded = (
        replace(one, record=record) for one in (prepared.scenario, prepared.expanded)
    )
    return replace(prepared, scenario=scenario, expanded=expanded)


def _frames(setting: Setting) -> int:
    return round(setting.cars * setting.drive_s * FRAMES_A_S)


def _frame_s(cells: list[Prepared]) -> float:
    """From the building of the world to the last answer."""
    frames = 0
    began_s = time.process_time()
    for cell in cells:
        frames += len(simulate(cell)["frames"])
    return (time.process_time() - began_s) / frames


def written(prepared: Prepared) -> dict[str, float]:
    """Bytes a frame of each table that is written, by its name."""
    tables = simulate(prepared)
    frames = len(tables["frames"])
    sizes = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, table in tables.items():
            if len(table):
                table.write(Path(folder) / name)
                sizes[name] = (Path(folder) / name).stat().st_size / frames
    return sizes


def resident(setting: Setting) -> int:
    """The peak memory of a process that simulates a town and holds its frames. Linux only."""
    return int(_asked(f"print_resident({setting!r})"))


def print_resident(setting: Setting) -> None:
    """Simulates in this process, and prints the most memory that it had, in bytes."""
    tables = simulate(_recording(small_town(setting, 1), ()))
    assert len(tables["frames"]) == _frames(setting)
    print(_peak_bytes())


def _peak_bytes() -> int:
    lines = Path("/proc/self/status").read_text(encoding="utf-8").splitlines()
    return 1024 * next(int(line.split()[1]) for line in lines if line.startswith("VmHWM:"))


def print_town(blocks: int) -> None:
    """Builds a town in this process, and prints how long it took [s] and the most memory that it
    had, in bytes.
    """
    began_s = time.process_time()
    _ = Town(TownRules(blocks=(blocks, blocks)), 1).streets  # laid out when asked for
    print(json.dumps([time.process_time() - began_s, _peak_bytes()]))


def _town() -> tuple[float, float]:
    """Seconds and bytes of one more block."""
    small, large = (json.loads(_asked(f"print_town({blocks})")) for blocks in TOWNS)
    more = TOWNS[1] ** 2 - TOWNS[0] ** 2
    return (large[0] - small[0]) / more, (large[1] - small[1]) / more


def _asked(call: str) -> str:
    code = f"from benchmarks.cell_costs import *; {call}"
    return subprocess.run(
        [sys.executable, "-c", code], cwd=REPOSITORY, check=True, capture_output=True, text=True
    ).stdout


def constants(costs: Costs) -> str:
    """What was measured."""
    setting = costs.setting
    cells = f"{setting.columns * setting.rows} cells, {setting.cars} cars, {setting.drive_s:g} s"
    rows = [
        (f"processor time, cells apart, `record: []` ({cells})", _micro(costs.least_s), "a frame"),
        ("the same with the tables of `fleet_1000`", _micro(costs.usual_s), "a frame"),
        ("the same cells jointly, `record: []`", _micro(costs.jointly_s), "a frame"),
        (
            f"preparing: town, drives of {setting.drive_s:g} s, cells",
            f"{1000 * costs.prepare_s:.1f} ms",
            "a car",
        ),
        ("building the town", f"{1000 * costs.block_s:.2f} ms", "a block"),
        ("memory of the town", f"{costs.block / 1e3:.1f} kB", "a block"),
        (
            "memory of a cell's process that has hardly begun",
            f"{costs.process / 1e6:.0f} MB",
            "a process",
        ),
        (
            f"memory after {costs.filled_s:g} s, with its share of the edge",
            f"{costs.car / 1e6:.2f} MB",
            "a car",
        ),
        ("memory that grows after that", f"{costs.frame:.0f} B", "a frame"),
        *((f"`{name}.parquet`", f"{size:.1f} B", "a frame") for name, size in costs.disk.items()),
    ]
    return table(("constant", "measured", "for"), rows)


def million(costs: Costs) -> str:
    """A simulated hour of a million cars: every figure with its arithmetic."""
    frames = CARS * FRAMES_A_S * HOUR_S
    cells = CARS // CARS_A_CELL
    of_cell = CARS_A_CELL * FRAMES_A_S * HOUR_S
    blocks = cells * BLOCKS_A_CELL**2
    least_h, usual_h, jointly_h = (
        frames * one / 3600 for one in (costs.least_s, costs.usual_s, costs.jointly_s)
    )
    of_frames, all_tables = costs.disk["frames"], sum(costs.disk.values())
    later = (HOUR_S - costs.filled_s) * FRAMES_A_S  # frames of a car
    car = costs.car + later * costs.frame
    car_text, process_text = f"{car / 1e6:.1f} MB", f"{costs.process / 1e6:.0f} MB"
    town = f"{blocks * costs.block_s / 60:.0f} min, {blocks * costs.block / 1e9:.0f} GB"
    rows = [
        ("frames", f"{CARS:,} cars x {FRAMES_A_S}/s x {HOUR_S:,} s", f"{frames:.2g}"),
        ("cells", f"{CARS:,} cars / {CARS_A_CELL} a cell", f"{cells:,}"),
        (
            "core hours, apart, frames only",
            f"{frames:.2g} x {_micro(costs.least_s)}",
            f"{least_h:,.0f}",
        ),
        (
            "core hours, apart, all tables",
            f"{frames:.2g} x {_micro(costs.usual_s)}",
            f"{usual_h:,.0f}",
        ),
        (
            "one cell on a core",
            f"{of_cell:,} frames x {_micro(costs.least_s)}",
            f"{of_cell * costs.least_s:.0f} s",
        ),
        (
            "cores that keep up with the clock",
            f"{least_h:,.0f} core hours / 1 h",
            f"{least_h:,.0f}",
        ),
        (
            "hours in one process, at least",
            f"{frames:.2g} x {_micro(costs.jointly_s)}",
            f"{jointly_h:,.0f}",
        ),
        (
            "memory of a car",
            f"{costs.car / 1e6:.2f} MB + {later:,.0f} frames x {costs.frame:.0f} B",
            car_text,
        ),
        (
            "memory of a cell's process",
            f"{process_text} + {CARS_A_CELL} x {car_text}",
            f"{(costs.process + CARS_A_CELL * car) / 1e6:,.0f} MB",
        ),
        (
            "memory in one process, at least",
            f"{CARS:,} x {car_text}",
            f"{CARS * car / 1e12:.1f} TB",
        ),
        (
            "disk, frames only",
            f"{frames:.2g} x {of_frames:.1f} B",
            f"{frames * of_frames / 1e12:.1f} TB",
        ),
        (
            "disk, all tables",
            f"{frames:.2g} x {all_tables:.0f} B",
            f"{frames * all_tables / 1e12:.1f} TB",
        ),
        (
            "the town in one piece",
            f"{blocks:,} x {1000 * costs.block_s:.2f} ms, {costs.block / 1e3:.1f} kB",
            town,
        ),
    ]
    return table(("a simulated hour", "arithmetic", "is"), rows, left=2)


def _micro(seconds: float) -> str:
    return f"{1e6 * seconds:.0f} µs"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument(
        "--quick", action="store_true", help="smaller runs: half a minute, and rougher figures"
    )
    parser.add_argument(
        "--markdown",
        action="store_true",
        help="write the tables of docs/explanation/million-cars.md",
    )
    given = parser.parse_args()
    costs = measure(QUICK if given.quick else FULL)
    blocks = {
        "machine": "\n".join(f"- {what}: {text}" for what, text in machine().items()),
        "constants": constants(costs),
        "million": million(costs),
    }
    for name, block in blocks.items():
        print(f"\n{name}\n\n{block}")
        try:
            if given.markdown:
                write(name, block)
        except UserError as error:
            sys.exit(str(error))


if __name__ == "__main__":
    main()
