r"""What is lost where a town is cut into cells that are simulated by themselves: joint and cut runs
of the same cars.

    python benchmarks/cells.py [--columns 2] [--rows 1] [--cars 40] [--seconds 60] [--seeds 4] \
        [--set PATH=VALUE] [--markdown]

A small town of some cells of ``fleet_1000`` is simulated as it is, and again with a part of what
crosses the borders left out. A cut run has the same cars, frames and detections at the same
instants: differences are taken seed by seed. The time that a car is in a cell for is a *visit*.
``--markdown`` writes the setting's table in docs/explanation/million-cars.md.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import pandas as pd

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks.speed_page import DOCS, filled, table
from genie_sim.analysis import metrics
from genie_sim.build import Prepared
from genie_sim.errors import UserError
from genie_sim.paper.evidence import interval
from genie_sim.parallel import workers_here
from genie_sim.recording.records import Tables
from genie_sim.recording.results import MethodInfo, Metric
from genie_sim.runner import prepare, simulate
from genie_sim.scenario.scenario import load_scenario
from genie_sim.sim.settings import Car, Edge, Route
from genie_sim.study.setups import StudySetup, measured, run_id_of
from genie_sim.study.tasks import Shared
from genie_sim.units import NS_PER_S

if TYPE_CHECKING:
    from genie_sim.perception.sources import Drive
    from genie_sim.town.town import TownDrive

PAGE = DOCS / "explanation" / "million-cars.md"
BLOCKS_A_CELL = 3  # each way, and
CARS_A_CELL = 20  # as in fleet_1000
VISIT = "."  # car7.2 is the second visit of car7
JOINT = "joint"


@dataclass(frozen=True)
class Setting:
    """What is compared: a town of so many cells, in which every car drives for ``drive_s``.
    ``overrides``: what is otherwise than in ``fleet_1000``, as for ``--set``.
    """

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
    """What a run, or the runs of several cells together, wrote down. Visits bear the names of their
    cars.
    """

    frames: pd.DataFrame
    lookups: pd.DataFrame
    resources: pd.DataFrame
    held: pd.DataFrame


@dataclass(frozen=True)
class ShownMetric:
    """A metric that is compared: how it is called in the table, and a factor and unit to show it
    in.
    """

    text: str
    metric: str
    placement: str
    factor: float = 1.0
    unit: str = ""
    digits: int = 1


def _share(text: str, metric: str, placement: str = "all") -> ShownMetric:
    return ShownMetric(text, metric, placement, 100.0, "%")


GENIE = (MethodInfo("genie", "Genie", baseline=False),)
SHOWN = (
    ShownMetric("first answer, mean", "first_answer_mean", "all", unit="ms", digits=2),
    ShownMetric("first answer, p99", "first_answer_p99", "all", unit="ms", digits=2),
    ShownMetric("fresh answer, mean", "fresh_answer_mean", "all", unit="ms"),
    ShownMetric("fresh answer, p95", "fresh_answer_p95", "all", unit="ms"),
    _share("frames with a fresh answer", "fresh_answered_share"),
    _share("image reuse, cars", "image_reuse", "car"),
    _share("image reuse, edges", "image_reuse", "edge"),
    _share("object reuse, cars", "object_reuse", "car"),
    _share("object reuse, edges", "object_reuse", "edge"),
    ShownMetric("confidence boost, cars", "confidence_boost", "car", 1000.0, "‰"),
    ShownMetric("confidence boost, edges", "confidence_boost", "edge", 1000.0, "‰"),
    _share("ghosts among the objects held", "ghost_share"),
    _share("visible objects that are held", "object_recall"),
    _share("the same, 5 s after a hand-over", "object_recall_after_hand_over"),
)
FRAMES_A_S = 10
AFTER_NS = 5 * NS_PER_S  # how long the frames after a hand-over are looked at by themselves
AFTER_HAND_OVER = "object_recall_after_hand_over"


def small_town(setting: Setting, seed: int) -> Prepared:
    """``fleet_1000``, with as many cells and cars as the setting says. Raises ``UserError``."""
    blocks = BLOCKS_A_CELL * setting.columns, BLOCKS_A_CELL * setting.rows
    settings = (
        f"fleet.cars={setting.cars}",
        f"perception.duration={setting.drive_s} s",
        f"perception.town.blocks={list(blocks)}",
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
    """Each cell by itself: its edge, and of each car its visits there. Those are all that a cell is
    told.
    """
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
    """Each car once for each time that it is in a cell, with its drive: from one hand-over to the
    next. A frame that is taken during a hand-over belongs to the new cell.
    """
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
            route = Route(start_ns=drive.start_ns + begin_ns, window_ns=(begin_ns, end_ns))
            cars.append(replace(car, name=name, edge=edge, route=route))
            drives[name] = drive
    return tuple(cars), drives


def _with(joint: Prepared, **changes: Any) -> Prepared:
    return replace(joint, expanded=replace(joint.expanded, **changes))


def _alone(joint: Prepared) -> tuple[Edge, ...]:
    return tuple(replace(edge, neighbours=()) for edge in joint.expanded.edges)


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
        tables[name].to_frame() for name in ("frames", "lookups", "resources", "held")
    )
    for of_cars in (frames, lookups, held):
        of_cars["car"] = of_cars["car"].astype(str).str.partition(VISIT)[0]
    lookups["genie"] = lookups["genie"].astype(str).str.replace(r"\.\d+/", "/", regex=True)
    return Tabled(frames, lookups, resources, held)


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


@dataclass(frozen=True, slots=True)
class CutRun:
    """The small town with a seed, simulated under one of ``CUTS``."""

    setting: Setting
    cut: str
    seed: int

    @property
    def run_id(self) -> str:
        return run_id_of(self.setting, self.cut, self.seed)

    @property
    def frames(self) -> float:
        return self.setting.cars * self.setting.drive_s * FRAMES_A_S

    @property
    def place(self) -> str:
        return f"{self.cut}, seed {self.seed}"

    def measure(self, shared: Shared, folder: Path) -> dict[str, list[Metric]]:
        """Genie's metrics, the recall after hand-overs, and counts of frames and hand-overs."""
        joint = small_town(self.setting, self.seed)
        tables = together(CUTS[self.cut](joint))
        passed = hand_overs(joint)
        recall = recall_after_hand_overs(tables.held, passed)
        beside = {
            AFTER_HAND_OVER: None if np.isnan(recall) else recall,
            "frames": float(len(tables.frames)),
            "hand_overs": float(sum(map(len, passed.values()))),
        }
        found = metrics.compute(GENIE, vars(tables))
        found += [Metric(name, "genie", "all", "", value, "1") for name, value in beside.items()]
        return {self.run_id: found}


def study(setting: Setting, seeds: int) -> list[StudySetup]:
    """Every cut with seeds 1 to ``seeds``."""
    return [
        StudySetup({"cut": cut, "seed": seed}, CutRun(setting, cut, seed))
        for seed in range(1, seeds + 1)
        for cut in CUTS
    ]


def markdown(setting: Setting, rows: pd.DataFrame) -> str:
    """What was run, the joint run's metrics, and by how much each cut misses them, with the
    interval over seeds. ``rows``: the study's metrics by cut and seed.
    """
    values = rows[rows["component"] == ""].pivot_table(
        index=["metric", "placement", "cut"], columns="seed", values="value", dropna=False
    )
    frames, passed = (values.loc[name, "all", JOINT].sum() for name in ("frames", "hand_overs"))
    seeds = values.shape[1]
    settings = ", ".join(f"`{path}`" for path in setting.overrides) or "as in `fleet_1000`"
    per_minute = passed / (seeds * setting.cars * setting.drive_s / 60)
    about = (
        f"{setting.columns} x {setting.rows} cells, {setting.cars} cars for "
        f"{setting.drive_s:g} s, {settings}, {seeds} seeds: {frames:,.0f} frames a column, "
        f"{per_minute:.2f} hand-overs a car and minute."
    )
    cuts = [cut for cut in CUTS if cut != JOINT]
    lines = []
    for shown in SHOWN:
        of_cuts = values.loc[shown.metric, shown.placement] * shown.factor
        joint = of_cuts.loc[JOINT].dropna()  # a seed without hand-overs has no frames after one
        cells = [f"{shown.text} [{shown.unit}]", f"{joint.mean():.{shown.digits}f}"]
        for cut in cuts:
            differences = (of_cuts.loc[cut] - joint)[joint.index].to_numpy()
            mean, low, high = (_signed(value, shown.digits) for value in interval(differences))
            cells.append(f"{mean} ({low} to {high})")
        lines.append(cells)
    return f"{about}\n\n{table(('', JOINT, *cuts), lines)}"


def _signed(value: float, digits: int) -> str:
    return f"{round(value, digits) + 0.0:+.{digits}f}"  # no minus before zeros


def write(name: str, block: str, page: Path = PAGE) -> None:
    """Fills a place of the page. Raises ``UserError`` where it has none of this name."""
    page.write_text(
        filled(page.read_text(encoding="utf-8"), name, block, str(page)), encoding="utf-8"
    )


def tell(done: float, of: float, failed: str) -> None:
    print(f"... {done:g} of {of:g} runs {failed}".rstrip(), file=sys.stderr)


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
        rows = measured(study(setting, given.seeds), workers_here(), progress=tell)
        text = markdown(setting, rows)
        print(text)
        if given.markdown:
            write(setting.name, text)
    except UserError as error:
        sys.exit(str(error))


if __name__ == "__main__":
    main()
