r"""What is lost where a town is cut into cells that are simulated by themselves: joint and cut runs of the same cars.

    python benchmarks/cells.py [--columns 2] [--rows 1] [--cars 40] [--seconds 60] [--seeds 4] [--set PATH=VALUE] \
        [--markdown]

A small town of some cells of ``fleet_1000`` is simulated as it is, and again with a part of what crosses the borders
left out. A cut run has the same cars, frames and detections at the same instants: differences are taken seed by seed.
The time that a car is in a cell for is a *visit*. ``--markdown`` writes the setting's table in
docs/explanation/million-cars.md.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np
import pandas as pd

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks.speed_page import DOCS, filled, table
from genie_sim.analysis import metrics
from genie_sim.build import Prepared
from genie_sim.errors import UserError
from genie_sim.paper.evidence import Values, interval
from genie_sim.parallel import in_processes, workers_here
from genie_sim.recording.records import Tables
from genie_sim.recording.results import MethodInfo
from genie_sim.runner import prepare, simulate
from genie_sim.scenario.parts import Car, Edge, Route
from genie_sim.scenario.scenario import load_scenario
from genie_sim.units import NS_PER_S

if TYPE_CHECKING:
    from genie_sim.perception.sources import Drive
    from genie_sim.town.town import Drive as TownDrive

PAGE = DOCS / "explanation" / "million-cars.md"
BLOCKS_A_CELL = 3  # each way, and
CARS_A_CELL = 20  # as in fleet_1000
VISIT = "."  # car7.2 is the second visit of car7
JOINT = "joint"


@dataclass(frozen=True)
class Setting:
    """What is compared: a town of so many cells, in which every car drives for ``drive_s``. ``overrides``: what is
    otherwise than in ``fleet_1000``, as for ``--set``."""

    columns: int = 2
    rows: int = 1
    cars: int = 2 * CARS_A_CELL
    drive_s: float = 60.0
    overrides: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Its place in the page."""
        return ", ".join((f"cut {self.columns} x {self.rows}", *self.overrides))


@dataclass(frozen=True)
class Tabled:
    """What a run, or the runs of several cells together, wrote down. Visits bear the names of their cars."""

    frames: pd.DataFrame
    lookups: pd.DataFrame
    resources: pd.DataFrame
    held: pd.DataFrame


@dataclass(frozen=True)
class Figure:
    """A metric that is compared: how it is called in the table, and a factor and unit to show it in."""

    text: str
    name: str
    role: str
    factor: float = 1.0
    unit: str = ""
    digits: int = 1


def _share(text: str, name: str, role: str = "genie") -> Figure:
    return Figure(text, name, role, 100.0, "%")


GENIE = (MethodInfo("genie", "Genie", baseline=False),)
FIGURES = (
    Figure("first answer, mean", "first_answer_mean", "genie", unit="ms", digits=2),
    Figure("first answer, p99", "first_answer_p99", "genie", unit="ms", digits=2),
    Figure("fresh answer, mean", "fresh_answer_mean", "genie", unit="ms"),
    Figure("fresh answer, p95", "fresh_answer_p95", "genie", unit="ms"),
    _share("frames with a fresh answer", "fresh_answered_share"),
    _share("image reuse, cars", "image_reuse", "car"),
    _share("image reuse, edges", "image_reuse", "edge"),
    _share("object reuse, cars", "object_reuse", "car"),
    _share("object reuse, edges", "object_reuse", "edge"),
    Figure("confidence boost, cars", "confidence_boost", "car", 1000.0, "‰"),
    Figure("confidence boost, edges", "confidence_boost", "edge", 1000.0, "‰"),
    _share("ghosts among the objects held", "ghost_share"),
    _share("visible objects that are held", "object_recall"),
)
AFTER_NS = 5 * NS_PER_S  # how long the frames after a hand-over are looked at by themselves
AFTER = _share("the same, 5 s after a hand-over", "object_recall")  # last in every row of values


def small_town(setting: Setting, seed: int) -> Prepared:
    """``fleet_1000``, with as many cells and cars as the setting says. Raises ``UserError``."""
    settings = (
        f"fleet.cars={setting.cars}",
        f"perception.duration={setting.drive_s} s",
        f"perception.town.blocks=[{BLOCKS_A_CELL * setting.columns}, {BLOCKS_A_CELL * setting.rows}]",
        "record=[lookups, held]",
        *setting.overrides,
    )
    return prepare(load_scenario("fleet_1000", settings, seed))


def without_sharing(joint: Prepared) -> Prepared:
    """Edges hear nothing of each other. Cars bring along what they know."""
    return _with(joint, edges=_alone(joint))


def arriving_empty(joint: Prepared) -> Prepared:
    """Every visit is a car of its own, which knows nothing at first. Edges share."""
    cars, drives = visits(joint)
    return replace(_with(joint, cars=cars, faults=(), start_jitter_ns=0), drives=drives)


def apart(joint: Prepared) -> list[Prepared]:
    """Each cell by itself: its edge, and of each car its visits there. Those are all that a cell is told."""
    cars, drives = visits(joint)
    found = []
    for edge in _alone(joint):
        mine = tuple(car for car in cars if car.edge == edge.name)
        cell = _with(joint, edges=(edge,), cars=mine, faults=(), start_jitter_ns=0)
        found.append(replace(cell, drives={car.name: drives[car.name] for car in mine}))
    return found


def hand_overs(joint: Prepared) -> dict[str, list[tuple[int, str]]]:
    """When each car is handed over [ns], in order of time, and to which edge."""
    found: dict[str, list[tuple[int, str]]] = {car.name: [] for car in joint.expanded.cars}
    for fault in joint.expanded.faults:
        assert fault.begin_ns is not None, "a fleet has hand-overs only"
        found[fault.target].append((fault.begin_ns, fault.fault.parameters["edge"]))
    return found


def visits(joint: Prepared) -> tuple[tuple[Car, ...], dict[str, Drive]]:
    """Each car once for each time that it is in a cell, with its drive: from one hand-over to the next. A frame that is
    taken during a hand-over belongs to the new cell."""
    cars: list[Car] = []
    drives: dict[str, Drive] = {}
    handed_over = hand_overs(joint)
    for car in joint.expanded.cars:
        drive = cast("TownDrive", joint.drives[car.name])
        since = [
            (0, car.edge),
            *((at_ns - drive.start_ns, edge) for at_ns, edge in handed_over[car.name]),
        ]
        until_ns = [*(begin_ns for begin_ns, _ in since[1:]), drive.duration_ns]
        for number, ((begin_ns, edge), end_ns) in enumerate(zip(since, until_ns, strict=True), 1):
            name = car.name if number == 1 else f"{car.name}{VISIT}{number}"
            route = Route().model_copy(
                update={"start_ns": drive.start_ns + begin_ns, "window_ns": (begin_ns, end_ns)}
            )
            cars.append(car.model_copy(update={"name": name, "edge": edge, "route": route}))
            drives[name] = drive
    return tuple(cars), drives


def _with(joint: Prepared, **changes: object) -> Prepared:
    return replace(joint, expanded=joint.expanded.model_copy(update=changes))


def _alone(joint: Prepared) -> tuple[Edge, ...]:
    return tuple(edge.model_copy(update={"neighbours": ()}) for edge in joint.expanded.edges)


CUTS: Mapping[str, Callable[[Prepared], list[Prepared]]] = {
    JOINT: lambda joint: [joint],
    "edges do not share": lambda joint: [without_sharing(joint)],
    "cars arrive empty": lambda joint: [arriving_empty(joint)],
    "apart: both": apart,
}


def together(cells: Sequence[Prepared]) -> Tabled:
    """Simulates cells one after the other and puts their tables together."""
    ran = [_tabled(simulate(cell)) for cell in cells if cell.expanded.cars]

    return Tabled(
        pd.concat([one.frames for one in ran], ignore_index=True),
        pd.concat([one.lookups for one in ran], ignore_index=True),
        pd.concat([one.resources for one in ran], ignore_index=True),
        pd.concat([one.held for one in ran], ignore_index=True),
    )


def _tabled(tables: Tables) -> Tabled:
    frames, lookups, resources, held = (
        one.to_frame() for one in (tables.frames, tables.lookups, tables.resources, tables.held)
    )
    for of_cars in (frames, lookups, held):
        of_cars["car"] = of_cars["car"].astype(str).str.partition(VISIT)[0]
    lookups["genie"] = lookups["genie"].astype(str).str.replace(r"\.\d+/", "/", regex=True)
    return Tabled(frames, lookups, resources, held)


def figures_of(tabled: Tabled) -> list[float]:
    """The figures of a run, in the order of ``FIGURES`` and in their units; NaN where one is not defined."""
    found = {
        (one.metric, one.method if one.placement == "all" else one.placement): one.value
        for one in metrics.compute(GENIE, vars(tabled))
    }
    values = (found.get((figure.name, figure.role)) for figure in FIGURES)
    return [
        np.nan if value is None else value * figure.factor
        for value, figure in zip(values, FIGURES, strict=True)
    ]


def recall_after_hand_overs(
    held: pd.DataFrame, handed_over: Mapping[str, Sequence[tuple[int, str]]]
) -> float:
    """The share of visible objects that are held, soon after their car was handed over."""
    soon = np.zeros(len(held), dtype=bool)
    for car, passed in handed_over.items():
        mine = ((held["car"] == car) & (held["what"] == "consumer")).to_numpy()
        for at_ns, _ in passed:
            soon |= mine & held["stamp_ns"].between(at_ns, at_ns + AFTER_NS).to_numpy()
    visible = int((held["visible_static"] + held["visible_moving"])[soon].sum())
    return float(held["right"][soon].sum()) / visible if visible else np.nan


@dataclass(frozen=True)
class Compared:
    """``values[cut][seed, figure]``, the last of them ``AFTER``, and the frames and hand-overs of the joint runs."""

    setting: Setting
    values: Mapping[str, Values]
    frames: int
    hand_overs: int


def compare(
    setting: Setting, seeds: int, workers: int = 1, tell: Callable[[str], None] = lambda _: None
) -> Compared:
    """Runs every cut with seeds 1 to ``seeds``; ``tell`` is told what is done."""
    ran = []
    for one in in_processes(partial(_of_seed, setting), range(1, seeds + 1), workers):
        ran.append(one)
        tell(f"{len(ran)} of {seeds} seeds")
    values = {cut: np.array([of_cuts[cut] for of_cuts, _, _ in ran]) for cut in CUTS}
    return Compared(
        setting, values, sum(frames for _, frames, _ in ran), sum(passed for *_, passed in ran)
    )


def _of_seed(setting: Setting, seed: int) -> tuple[dict[str, list[float]], int, int]:
    """The figures of each cut; frames and hand-overs of the joint run."""
    joint = small_town(setting, seed)
    tables = {cut: together(make(joint)) for cut, make in CUTS.items()}
    passed = hand_overs(joint)
    figures = {
        cut: [*figures_of(one), recall_after_hand_overs(one.held, passed) * AFTER.factor]
        for cut, one in tables.items()
    }
    return figures, len(tables[JOINT].frames), sum(map(len, passed.values()))


def markdown(compared: Compared) -> str:
    """What was run, the joint run's figures, and by how much each cut misses them, with the interval over seeds."""
    setting, seeds = compared.setting, len(compared.values[JOINT])
    settings = ", ".join(f"`{one}`" for one in setting.overrides) or "as in `fleet_1000`"
    per_minute = compared.hand_overs / (seeds * setting.cars * setting.drive_s / 60)
    about = (
        f"{setting.columns} x {setting.rows} cells, {setting.cars} cars for {setting.drive_s:g} s, {settings}, "
        f"{seeds} seeds: {compared.frames:,} frames a column, {per_minute:.2f} hand-overs a car and minute."
    )
    rows = []
    for place, figure in enumerate((*FIGURES, AFTER)):
        joint = compared.values[JOINT][:, place]
        known = ~np.isnan(joint)  # a seed without hand-overs has no frames after one
        cells = [f"{figure.text} [{figure.unit}]", f"{np.mean(joint[known]):.{figure.digits}f}"]
        for cut in list(CUTS)[1:]:
            differences = (compared.values[cut][:, place] - joint)[known]
            mean, low, high = (_signed(value, figure.digits) for value in interval(differences))
            cells.append(f"{mean} ({low} to {high})")
        rows.append(cells)
    return f"{about}\n\n{table(('', JOINT, *list(CUTS)[1:]), rows)}"


def _signed(value: float, digits: int) -> str:
    return f"{round(value, digits) + 0.0:+.{digits}f}"  # no minus before zeros


def write(name: str, block: str, page: Path = PAGE) -> None:
    """Fills a place of the page. Raises ``UserError`` where it has none of this name."""
    page.write_text(
        filled(page.read_text(encoding="utf-8"), name, block, str(page)), encoding="utf-8"
    )


def main() -> None:
    usual = Setting()
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument(
        "--columns", type=int, default=usual.columns, help="cells from west to east"
    )
    parser.add_argument("--rows", type=int, default=usual.rows, help="cells from south to north")
    parser.add_argument("--cars", type=int, default=usual.cars)
    parser.add_argument(
        "--seconds", type=float, default=usual.drive_s, help="that every car drives"
    )
    parser.add_argument(
        "--set", action="append", default=[], metavar="PATH=VALUE", help="other than in fleet_1000"
    )
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument(
        "--markdown",
        action="store_true",
        help="write the table of docs/explanation/million-cars.md",
    )
    given = parser.parse_args()
    setting = Setting(given.columns, given.rows, given.cars, given.seconds, tuple(given.set))
    try:
        compared = compare(
            setting, given.seeds, workers_here(), lambda done: print(f"... {done}", file=sys.stderr)
        )
        text = markdown(compared)
        print(text)
        if given.markdown:
            write(setting.name, text)
    except UserError as error:
        sys.exit(str(error))


if __name__ == "__main__":
    main()
