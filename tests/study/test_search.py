"""Searches whose front is known, through the whole machinery: Optuna, runs in parts, report."""

from __future__ import annotations

import math
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import pytest

from genie_sim.base.errors import UserError
from genie_sim.record.results import MetricValue
from genie_sim.study.search import Search
from genie_sim.study.search_design import Point, load
from genie_sim.study.search_report import Pick
from genie_sim.study.tasks import LocalWorkers

FIRST, SECOND = "first_answer_p95", "fresh_answer_mean"  # both to be made small
RANGE = {"from": 0, "to": 1}
TABLES = ("points.csv", "designs.csv", "differences.csv")
AS_IT_IS = Point("as it is", "", {})  # the method of the scenario


class Case(NamedTuple):
    """One run's drive and seed."""

    drive: str
    seed: int


# the values of parameters and the case, to values of metrics
Function = Callable[[Mapping[str, Any], Case], Mapping[str, float | None]]


@dataclass(frozen=True)
class MadeUpRun:
    """A run whose metrics are a function of its point and its case."""

    run_id: str
    values: Mapping[str, Any]
    case: Case
    function: Function
    place: str = "made up"
    frames: float = 1.0

    def measure(self, shared: Any, folder: Path) -> Mapping[str, Sequence[MetricValue]]:
        numbers = self.function(self.values, self.case)
        return {
            self.run_id: [
                MetricValue(name, "m", "all", "", value, "ms") for name, value in numbers.items()
            ]
        }


class MadeUp(Search):
    """A search of made-up runs; keeps which cases were asked for."""

    def __init__(self, data: Mapping[str, Any], function: Function, out: str, jobs: int) -> None:
        self.function = function
        self.cases: list[Case] = []
        super().__init__(load(data), Path(out), LocalWorkers(jobs))

    def _check(self) -> str:
        return ""

    def references(self):
        return [AS_IT_IS]

    def planned(self, point, part):
        if point.values.get("x") == "broken":
            raise UserError("a design that cannot be run")
        cases = [Case(drive, seed) for drive in part.drives for seed in part.seeds]
        self.cases += cases
        values = point.values or {"x": 0, "y": 1}
        return [
            (
                case.seed if len(part.drives) == 1 else case.drive,
                MadeUpRun(
                    f"{sorted(values.items())} {case} {self.function.__name__}",
                    values,
                    case,
                    self.function,
                ),
            )
            for case in cases
        ]

    def _write_design(self, pick: Pick) -> None:
        """There is no scenario."""


def space(**parameters: Any) -> dict[str, Any]:
    return {name: {"set": f"method.{name}", **way} for name, way in parameters.items()}


def search_of(parameters: Mapping[str, Any], **more: Any) -> dict[str, Any]:
    return {
        "name": "made-up",
        "scenario": "street_1car_homo",
        "methods": {"m": {"method": "local", "space": dict(parameters)}},
        "objectives": {"minimize": [FIRST, SECOND]},
        "points": 20,
        "seeds": {"tuning": 3, "held_out": 3},
        **more,
    }


LIST = space(x={"list": [0, 1, 2, 3]}, y={"list": [0, 1]})


def noise(case: Case, size: float = 0.001) -> float:
    """The same for all points of a seed, as with common random numbers."""
    return size * math.sin(1000 * case.seed)


def discrete(values: Mapping[str, Any], case: Case) -> dict[str, float]:
    """The front: y = 0, and of x = 3 the first objective equals that of x = 2."""
    x, y = values["x"], values["y"]
    return {
        FIRST: 10.0 - min(x, 2) + y + noise(case),
        SECOND: 20.0 + 2 * x + y + noise(case),
    }


def bytes_of(folder: Path) -> dict[str, bytes]:
    """The tables of a search."""
    return {name: (folder / name).read_bytes() for name in TABLES}


class Found(NamedTuple):
    """A finished search: its tuned designs, its picks, and itself."""

    designs: pd.DataFrame
    picks: list[Pick]
    search: MadeUp

    def table(self, name: str) -> pd.DataFrame:
        path = self.search.folder / f"{name}.csv"
        return pd.read_csv(path, keep_default_na=False, na_values=[""])

    @property
    def bytes(self) -> dict[str, bytes]:
        return bytes_of(self.search.folder)


def run(data: Mapping[str, Any], function: Function, out: str = "out", jobs: int = 1) -> Found:
    search = MadeUp(data, function, out, jobs)
    search.run()
    designs, picks = search.finish(pictures=False)
    return Found(designs[designs["tuned"]], picks, search)


# The front and its constraints


def test_the_front_of_a_small_space_is_the_known_one():
    designs = run(search_of(LIST), discrete).designs
    assert sorted(zip(designs["x"], designs["y"], strict=True)) == [(0, 0), (1, 0), (2, 0)]


def test_maximized_objectives_are_made_large():
    data = search_of(LIST, objectives={"maximize": FIRST, "minimize": SECOND})
    designs = run(data, discrete).designs
    # large first means y = 1 and x = 0; small second y = 0
    assert sorted(zip(designs["x"], designs["y"], strict=True)) == [(0, 0), (0, 1)]


def test_designs_keep_the_constraints():
    data = search_of(LIST, subject_to=f"{SECOND} <= 22.5")
    designs = run(data, discrete).designs
    assert sorted(designs["x"]) == [0, 1] and designs["within_constraints"].all()


def test_a_metric_may_be_objective_and_constraint_and_the_constraint_alone():
    data = search_of(
        LIST, objectives={"minimize": FIRST}, subject_to=[f"{FIRST} >= 9", f"{SECOND} <= 21"]
    )
    found = run(data, discrete)
    assert set(found.designs["x"]) <= {0, 1} and (found.designs[FIRST] > 8.9).all()
    assert {FIRST, SECOND} <= set(found.table("points").columns)


def test_a_bound_from_below_and_in_percent():
    design = load(search_of(LIST, subject_to=["streaming_f1 >= 80 %", f"{FIRST} <= 3e1"]))
    assert [(c.at_most, c.bound) for c in design.constraints] == [(False, 0.8), (True, 30.0)]
    assert design.constraints[0].excess(0.7) == pytest.approx(0.1)
    assert design.constraints[1].excess(29.0) == -1


def test_where_no_point_keeps_the_constraints_that_is_said():
    with pytest.raises(UserError, match=f"none of 20 points keeps {SECOND} <= 1; see points.csv"):
        run(search_of(LIST, subject_to=f"{SECOND} <= 1"), discrete)
    assert len(pd.read_csv("out/made-up/points.csv")) == 20


# Two sets


def reversed_later(values: Mapping[str, Any], case: Case) -> dict[str, float]:
    """From seed 4 on the best becomes the worst."""
    x = values["x"] if case.seed <= 3 else -values["x"]
    return {FIRST: 10.0 - x, SECOND: 20.0 + 2 * values["y"] + case.seed}


def test_the_search_never_sees_the_held_out_set():
    search = MadeUp(search_of(LIST), reversed_later, "out", 1)
    search.run()
    assert {case.seed for case in search.cases} == {1, 2, 3}
    search.cases.clear()
    table, _ = search.finish(pictures=False)
    assert {case.seed for case in search.cases} == {4, 5, 6}
    designs = table[table["tuned"]]
    assert set(designs["x"]) == {3}, "chosen by the tuning set, where 3 is the best"
    assert designs[FIRST].tolist() == [13.0], "reported by the held-out set, where it is the worst"


def test_another_held_out_set_changes_no_point():
    first = run(search_of(LIST, points=6), reversed_later, "first").bytes
    more = {"tuning": 3, "held_out": [77, 78, 91]}
    second = run(search_of(LIST, points=6, seeds=more), reversed_later, "second").bytes
    assert first["points.csv"] == second["points.csv"]
    assert first["designs.csv"] != second["designs.csv"]


def test_drives_are_split_as_well_and_are_what_intervals_are_over():
    def by_drive(values: Mapping[str, Any], case: Case) -> dict[str, float]:
        return {FIRST: 10.0 - values["x"] + len(case.drive), SECOND: 1.0 + case.seed}

    drives = {
        "tuning": {"a": {"perception.trace": "a"}},
        "held_out": {"bb": {"perception.trace": "b"}, "dddd": {"perception.trace": "d"}},
    }
    found = run(search_of(LIST, drives=drives), by_drive)
    assert {case.drive for case in found.search.cases[:40]} == {"a"}
    value, low, high = found.designs[[FIRST, f"{FIRST} low", f"{FIRST} high"]].iloc[0]
    # drives with means 9 and 11: the t quantile with one degree of freedom is 12.706
    assert (value, high - value) == pytest.approx((10.0, 12.706), abs=1e-3)
    assert found.designs[f"{SECOND} low"].iloc[0] == found.designs[f"{SECOND} high"].iloc[0]
    assert low == pytest.approx(10 - 12.706, abs=1e-3)


# Which designs are equal


def nothing_but_noise(values: Mapping[str, Any], case: Case) -> dict[str, float]:
    """``y`` makes the first objective smaller and the second larger, by less than the seeds do;
    ``x`` does so by much more.
    """
    rng = np.random.default_rng([case.seed, int(values["x"]), int(values["y"])])
    small = 0.001 * values["y"]
    return {
        FIRST: 10.0 - values["x"] - small + 0.1 * rng.standard_normal(),
        SECOND: 20.0 + values["x"] + small + 0.1 * rng.standard_normal(),
    }


def test_designs_that_cannot_be_told_apart_are_said_to_be_equal():
    data = search_of(LIST, points=24, seeds={"tuning": 5, "held_out": 8})
    designs = run(data, nothing_but_noise).designs
    has_twin = 0
    for _, design in designs.iterrows():
        others = [name for name in design["equal_to"].split(", ") if name.startswith("m-")]
        twins = designs[(designs["x"] == design["x"]) & (designs["design"] != design["design"])]
        assert sorted(others) == sorted(twins["design"])
        has_twin += len(twins)
    assert has_twin


def test_differences_are_paired_by_seed():
    """Seeds differ by far more than designs; the intervals of differences are narrow all the
    same.
    """

    def seeds_differ(values: Mapping[str, Any], case: Case) -> dict[str, float]:
        return {
            FIRST: 10.0 * case.seed - values["x"],
            SECOND: 7.0 * case.seed + values["x"] + 0.001 * case.seed * values["x"],
        }

    found = run(search_of(LIST), seeds_differ)
    differences = found.table("differences")
    first = differences[differences["metric"] == FIRST]
    assert (first["high"] - first["low"]).max() < 1e-9
    assert set(first["value"].abs()) == {0, 1, 2, 3}, "y changes nothing"
    assert (found.designs[f"{FIRST} high"] - found.designs[f"{FIRST} low"]).min() > 10


def test_three_designs_are_chosen_by_the_tuning_set_and_told_with_held_out_numbers():
    def priced(values: Mapping[str, Any], case: Case) -> dict[str, float]:
        late = 0.1 if case.seed > 3 else 0.0
        accuracy = {0: 0.80, 1: 0.795, 2: 0.70, 3: 0.5}[values["x"]]
        return {
            "streaming_f1": accuracy - late + noise(case),
            FIRST: 40.0 - 10 * values["x"] + noise(case),
            "ghost_share": 0.5 - 0.1 * values["x"] + 0.01 * values["y"] + noise(case),
        }

    objectives = {"maximize": "streaming_f1", "minimize": [FIRST, "ghost_share"]}
    picks = run(search_of(LIST, objectives=objectives), priced).picks
    assert [(pick.file, pick.values) for pick in picks] == [
        ("most_accurate", {"x": 0, "y": 0}),
        ("cheapest", {"x": 1, "y": 0}),
        ("fastest", {"x": 3, "y": 0}),
    ]
    assert "streaming F1 69.9 (" in picks[0].text
    assert picks[1].text.startswith(f"Cheapest within 0.01: {picks[1].design}.")


# Bytes, kills, more points


def mixed(values: Mapping[str, Any], case: Case) -> dict[str, float]:
    x = values["x"]
    if "z" not in values:
        return {FIRST: 2 - x + noise(case), SECOND: 1 + x}
    return {FIRST: x + values["z"] + noise(case), SECOND: (1 - x) ** 2 + values["z"] + values["n"]}


MIXED = search_of(
    {
        "kind": {"list": {"plain": {"spread": "default"}, "rich": {"spread": "loaded"}}},
        **space(
            x={"range": {"from": 0.01, "to": 1, "scale": "log"}},
            z={"range": RANGE, "when": {"kind": "rich"}},
            n={"range": {"from": 1, "to": 3, "whole": True}, "when": {"kind": ["rich"]}},
        ),
    },
    points=14,
    batch=4,
    seeds={"tuning": 3, "held_out": 2},
    subject_to=f"{SECOND} <= 3",
)


@pytest.mark.slow
def test_the_same_seed_gives_the_same_bytes_in_any_number_of_processes():
    one = run(MIXED, mixed, "one").bytes
    assert run(MIXED, mixed, "two", jobs=2).bytes == one
    assert run({**MIXED, "seed": 2}, mixed, "three").bytes["points.csv"] != one["points.csv"]


class Killed(BaseException):
    """Not caught by anything, like a signal."""


# 12 runs, 2 of the reference, then the held-out ones
SHORT = {**MIXED, "points": 6, "batch": 2, "seeds": {"tuning": 2, "held_out": 2}}


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a short search that is done; only looked at and copied."""
    out = tmp_path_factory.mktemp("done")
    run(SHORT, mixed, str(out))
    return out


@pytest.mark.parametrize("after", [0, 3, 8, 15])
def test_a_killed_search_goes_on_as_if_nothing_had_been(
    after: int, done: Path, monkeypatch: pytest.MonkeyPatch
):
    simulated: list[str] = []
    measure = MadeUpRun.measure

    def counted(self: MadeUpRun, *arguments: Any) -> Any:
        if len(simulated) == after:
            raise Killed
        simulated.append(self.run_id)
        return measure(self, *arguments)

    monkeypatch.setattr(MadeUpRun, "measure", counted)
    with pytest.raises(Killed):
        run(SHORT, mixed, "killed")
    before = set(kept("killed"))
    after = 10**6
    simulated.clear()
    assert run(SHORT, mixed, "killed").bytes == bytes_of(done / "made-up")
    assert not before & set(simulated), "what was written is not run again"


def kept(out: str) -> list[str]:
    """The runs that are in a search's folder."""
    parts = Path(out).glob("made-up/parts/*.parquet")
    return [run_id for part in parts for run_id in pd.read_parquet(part)["run_id"].unique()]


def test_a_search_that_is_done_runs_nothing_again(done: Path, monkeypatch: pytest.MonkeyPatch):
    shutil.copytree(done, "out")
    monkeypatch.setattr(MadeUpRun, "measure", None)  # cannot be called
    assert run(SHORT, mixed).bytes == bytes_of(done / "made-up")


def test_more_points_go_on_from_those_that_are_there(done: Path):
    shutil.copytree(done, "out")
    before = set(kept("out"))
    few = pd.read_csv(done / "made-up" / "points.csv", keep_default_na=False, na_values=[""])
    many = run({**SHORT, "points": 8}, mixed).table("points")
    assert len(few) == 6 and len(many) == 8 and len(kept("out")) > len(before)
    pd.testing.assert_frame_equal(many.iloc[:6][few.columns], few, check_dtype=False)


# Points that fail, and wrong input


def test_points_that_cannot_be_run_fail_and_are_told_of():
    parameters = space(x={"list": ["broken", 0, 2]})
    found = run(
        search_of(parameters), lambda values, case: {FIRST: float(values["x"]), SECOND: 1.0}
    )
    points = found.table("points")
    failed = points[points["state"] == "FAIL"]
    assert set(failed["x"]) == {"broken"}
    assert set(failed["reason"]) == {"a design that cannot be run"}
    assert found.designs["x"].tolist() == ["0"]


def test_where_all_points_fail_the_first_reason_is_told():
    with pytest.raises(UserError, match="all 20 points failed; the first: a design that cannot"):
        run(search_of(space(x={"list": ["broken"]})), discrete)


def test_an_objective_that_no_run_records():
    data = search_of(LIST, objectives={"minimize": [FIRST, "ghost_share"]})
    with pytest.raises(UserError, match=r"objectives: ghost_share: no run records it; .*known: fi"):
        run(data, discrete)


def test_a_point_without_an_objective_in_every_run_fails():
    """At x = 0 there is nothing of which a share could be a ghost; at x = 1 not with each seed."""

    def sometimes(values: Mapping[str, Any], case: Case) -> dict[str, float | None]:
        x = values["x"]
        ghosts = {} if x == 0 else {"ghost_share": None if x == 1 and case.seed == 2 else 0.1 * x}
        return {FIRST: 10.0 - x + noise(case), **ghosts}

    found = run(search_of(LIST, objectives={"minimize": [FIRST, "ghost_share"]}), sometimes)
    points = found.table("points")
    assert set(points.loc[points["state"] == "FAIL", "x"]) == {0, 1}
    assert set(points["reason"].dropna()) == {"ghost_share is not defined in every run"}
    assert set(found.designs["x"]) <= {2, 3}


def test_the_folder_of_something_else_is_refused():
    Path("out/made-up").mkdir(parents=True)
    Path("out/made-up/notes.txt").write_text("mine")
    with pytest.raises(UserError, match="holds something else than a search"):
        run(MIXED, mixed)
    assert [path.name for path in Path("out/made-up").iterdir()] == ["notes.txt"]
