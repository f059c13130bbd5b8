"""Searches whose front is known, through the whole machinery: storage, parts, report."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from optuna.trial import Trial

from genie_sim.errors import UserError
from genie_sim.study.tasks import LocalWorkers
from genie_sim.tuning import searcher
from genie_sim.tuning.design import Case, fixed_settings, load
from genie_sim.tuning.search import Search, SearchStatus
from tests.tuning.made_up_plans import Function, MadeUpPlans

FIRST, SECOND = "first_answer_p95", "fresh_answer_p95"  # both to be made small
RANGE = {"from": 0, "to": 1}
TABLES = ("points.csv", "designs.csv", "differences.csv", "importance.csv")


def space(**parameters: Any) -> dict[str, Any]:
    return {name: {"set": f"method.{name}", **way} for name, way in parameters.items()}


def search_of(parameters: Mapping[str, Any], **more: Any) -> dict[str, Any]:
    return {
        "name": "made-up",
        "scenario": "1car_homo",
        "methods": {"m": {"method": "local", "space": dict(parameters)}},
        "objectives": {"minimize": [FIRST, SECOND]},
        "points": 20,
        "seeds": {"tuning": 3, "held_out": 3},
        **more,
    }


LIST = space(
    x={"list": [0, 1, 2, 3]},
    y={"list": [0, 1]},
)


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


def zdt1(values: Mapping[str, Any], case: Case) -> dict[str, float]:
    """E. Zitzler, K. Deb, L. Thiele, "Comparison of multiobjective evolutionary algorithms", 2000:
    the front is ``1 - sqrt(first)``, where all parameters but ``x`` are 0.
    """
    g = 1 + 9 * (values["a"] + values["b"]) / 2
    return {
        FIRST: values["x"] + noise(case),
        SECOND: g * (1 - math.sqrt(values["x"] / g)) + noise(case),
    }


def run(
    data: Mapping[str, Any],
    function: Function,
    out: str = "out",
    jobs: int = 1,
    **more: Any,
) -> tuple[SearchStatus, MadeUpPlans]:
    plans = MadeUpPlans(function)
    search = Search(load(data), Path(out), plans=plans, **more)
    search.run(LocalWorkers(jobs))
    return search.finish(LocalWorkers(1), pictures=False), plans


def table(status: SearchStatus, name: str = "designs") -> pd.DataFrame:
    return pd.read_csv(status.folder / f"{name}.csv", keep_default_na=False, na_values=[""])


def tables(status: SearchStatus) -> dict[str, bytes]:
    return {name: (status.folder / name).read_bytes() for name in TABLES}


# The front


def test_the_front_of_a_small_space_is_the_known_one():
    status, _ = run(search_of(LIST), discrete)
    designs = table(status)
    assert sorted(zip(designs["x"], designs["y"], strict=True)) == [(0, 0), (1, 0), (2, 0)]
    assert status.complete and status.points == 20


def test_maximized_objectives_are_made_large():
    data = search_of(LIST, objectives={"maximize": FIRST, "minimize": SECOND})
    designs = table(run(data, discrete)[0])
    # large first means y = 1 and x = 0; small second y = 0
    assert sorted(zip(designs["x"], designs["y"], strict=True)) == [(0, 0), (0, 1)]


@pytest.mark.parametrize("sampler", ["tpe", "nsga2"])
def test_a_search_comes_nearer_to_the_front_of_zdt1_than_chance(sampler: str):
    parameters = space(x={"range": RANGE}, a={"range": RANGE}, b={"range": RANGE})
    away = {}
    for name in (sampler, "random"):
        data = search_of(
            parameters, points=100, batch=20, sampler=name, early=0, seeds={"tuning": 1}
        )
        designs = table(run(data, zdt1, name)[0])
        front = 1 - np.sqrt(designs[FIRST].clip(0, 1))
        away[name] = float((designs[SECOND] - front).mean())
    assert 0 < away[sampler] < 0.6 * away["random"], away


def test_of_designs_on_the_front_none_dominates_another():
    parameters = space(x={"range": RANGE}, a={"range": RANGE}, b={"range": RANGE})
    status, _ = run(search_of(parameters, points=30), zdt1)
    points, designs = table(status, "points"), table(status)
    tried = points[points["state"] == "complete"][[FIRST, SECOND]].to_numpy()
    on_front = {
        number
        for number, row in zip(points[points["state"] == "complete"]["point"], tried, strict=True)
        if not ((tried <= row).all(axis=1) & (tried < row).any(axis=1)).any()
    }
    assert {f"m-{number}" for number in on_front} == set(designs["design"])


# Constraints


def test_designs_keep_the_constraints():
    data = search_of(LIST, subject_to=f"{SECOND} <= 22.5")
    designs = table(run(data, discrete)[0])
    assert sorted(designs["x"]) == [0, 1] and designs["within_constraints"].all()


def test_a_bound_from_below_and_in_percent():
    design = load(search_of(LIST, subject_to=["streaming_f1 >= 80 %", f"{FIRST} <= 3e1"]))
    assert [(c.at_most, c.bound) for c in design.constraints] == [(False, 0.8), (True, 30.0)]
    assert design.constraints[0].excess(0.7) == pytest.approx(0.1)
    assert design.constraints[1].excess(29.0) == -1


def test_where_no_point_keeps_the_constraints_that_is_said():
    with pytest.raises(UserError, match=f"none of 20 points keeps {SECOND} <= 1; see points.csv"):
        run(search_of(LIST, subject_to=f"{SECOND} <= 1"), discrete)


# Two sets


def reversed_later(values: Mapping[str, Any], case: Case) -> dict[str, float]:
    """From seed 4 on the best becomes the worst."""
    x = values["x"] if case.seed <= 3 else -values["x"]
    return {FIRST: 10.0 - x, SECOND: 20.0 + 2 * values["y"] + case.seed}


def test_the_search_never_sees_the_held_out_set():
    plans = MadeUpPlans(reversed_later)
    search = Search(load(search_of(LIST)), Path("out"), plans=plans)
    search.run(LocalWorkers(1))
    assert {case.seed for case in plans.cases} == {1, 2, 3}
    designs = table(search.finish(LocalWorkers(1), pictures=False))
    assert {case.seed for case in plans.cases} == set(range(1, 7))
    assert set(designs["x"]) == {3}, "chosen by the tuning set, where 3 is the best"
    assert designs[FIRST].tolist() == [13.0], "reported by the held-out set, where it is the worst"


def test_another_held_out_set_changes_no_point():
    first, _ = run(search_of(LIST), reversed_later, "first")
    more = {"tuning": 3, "held_out": [77, 78, 91]}
    second, _ = run(search_of(LIST, seeds=more), reversed_later, "second")
    assert tables(first)["points.csv"] == tables(second)["points.csv"]
    assert tables(first)["designs.csv"] != tables(second)["designs.csv"]


def test_drives_are_split_as_well_and_are_what_intervals_are_over():
    def by_drive(values: Mapping[str, Any], case: Case) -> dict[str, float]:
        return {FIRST: 10.0 - values["x"] + len(case.drive), SECOND: 1.0 + case.seed}

    drives = {
        "tuning": {"a": {"perception.trace": "a"}},
        "held_out": {"bb": {"perception.trace": "b"}, "dddd": {"perception.trace": "d"}},
    }
    status, plans = run(search_of(LIST, drives=drives), by_drive)
    designs = table(status)
    assert {case.drive for case in plans.cases[:40]} == {"a"}
    value, low, high = designs[[FIRST, f"{FIRST} low", f"{FIRST} high"]].iloc[0]
    # drives with means 9 and 11: the t quantile with one degree of freedom is 12.706
    assert (value, high - value) == pytest.approx((10.0, 12.706), abs=1e-3)
    assert designs[f"{SECOND} low"].iloc[0] == designs[f"{SECOND} high"].iloc[0]
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
    data = search_of(LIST, early=0, seeds={"tuning": 5, "held_out": 8})
    designs = table(run(data, nothing_but_noise)[0])
    for _, design in designs.iterrows():
        others = str(design["equal_to"]).split(", ") if design["equal_to"] is not np.nan else []
        twins = designs[(designs["x"] == design["x"]) & (designs["design"] != design["design"])]
        assert sorted(name for name in others if name != "nan") == sorted(twins["design"])
    assert designs["group"].nunique() == 4


def test_differences_are_paired_by_seed():
    """Seeds differ by far more than designs; the intervals of differences are narrow all the
    same.
    """

    def seeds_differ(values: Mapping[str, Any], case: Case) -> dict[str, float]:
        return {
            FIRST: 10.0 * case.seed - values["x"],
            SECOND: 7.0 * case.seed + values["x"] + 0.001 * case.seed * values["x"],
        }

    status, _ = run(search_of(LIST), seeds_differ)
    differences = table(status, "differences")
    first = differences[differences["metric"] == FIRST]
    assert (first["high"] - first["low"]).max() < 1e-9
    assert set(first["value"].abs()) == {0, 1, 2, 3}, "y changes nothing"
    designs = table(status)
    assert (designs[f"{FIRST} high"] - designs[f"{FIRST} low"]).min() > 10


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
    status, _ = run(search_of(LIST, objectives=objectives), priced)
    assert [(pick.words, pick.candidate.values) for pick in status.picks] == [
        ("most accurate", {"x": 0, "y": 0}),
        ("cheapest within 0.01", {"x": 1, "y": 0}),
        ("fastest", {"x": 3, "y": 0}),
    ]
    assert "streaming F1 69.9 (" in status.picks[0].text
    name = status.picks[1].candidate.name
    assert status.picks[1].text.startswith(f"Cheapest within 0.01: {name}.")


# Bytes, kills, shards


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
)


BOUND = {**MIXED, "subject_to": f"{SECOND} <= 3"}


@pytest.mark.parametrize("sampler", ["tpe", "nsga2"])
def test_two_searches_with_the_same_seed_give_the_same_bytes(sampler: str):
    data = {**MIXED, "sampler": sampler}
    first, _ = run(data, mixed, "first")
    second, _ = run(data, mixed, "second")
    assert tables(first) == tables(second)
    assert tables(first) != tables(run({**data, "seed": 2}, mixed, "third")[0])


def test_processes_and_storage_change_no_byte():
    one, _ = run(MIXED, mixed, "one")
    assert tables(run(MIXED, mixed, "two", jobs=2)[0]) == tables(one)
    assert tables(run(MIXED, mixed, "three", storage="sqlite")[0]) == tables(one)


class Killed(BaseException):
    pass


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """The tables of a search that nobody interrupted."""
    return tables(run(BOUND, mixed, str(tmp_path_factory.mktemp("whole")))[0])


@pytest.mark.parametrize(
    ("what", "place"),
    [
        ("suggest_float", 0),  # a point without parameters
        ("suggest_float", 6),
        ("suggest_float", 13),  # a point of which some parameters are drawn
        ("set_user_attr", 4),
        ("set_user_attr", 9),  # a batch of which some points are told of
        ("set_constraint", 7),
    ],
)
def test_a_killed_search_goes_on_as_if_nothing_had_been(
    what: str, place: int, whole: dict[str, bytes], monkeypatch: pytest.MonkeyPatch
):
    count = 0
    with monkeypatch.context() as patch:
        method = getattr(Trial, what)

        def kill(*arguments: Any, **more: Any) -> Any:
            nonlocal count
            count += 1
            if count > place:
                raise Killed
            return method(*arguments, **more)

        patch.setattr(Trial, what, kill)
        with pytest.raises(Killed):
            run(BOUND, mixed, "killed")
    assert tables(run(BOUND, mixed, "killed")[0]) == whole


def test_what_has_been_simulated_is_not_simulated_again():
    status, _ = run(MIXED, mixed)
    parts = {path: path.stat().st_mtime_ns for path in status.folder.glob("parts/*.parquet")}
    before = tables(status)
    again, _ = run(MIXED, mixed)
    assert tables(again) == before
    assert parts == {
        path: path.stat().st_mtime_ns for path in status.folder.glob("parts/*.parquet")
    }


def test_more_points_go_on_from_those_that_are_there():
    few = table(run({**MIXED, "points": 6}, mixed)[0], "points")
    many = table(run({**MIXED, "points": 10}, mixed)[0], "points")
    assert len(few) == 6 and len(many) == 10
    pd.testing.assert_frame_equal(many.iloc[:6][few.columns], few, check_dtype=False)


def test_shards_share_a_storage_and_the_last_one_reports():
    plans = MadeUpPlans(mixed)
    searches = [Search(load(MIXED), Path("out"), plans=plans) for _ in range(3)]
    for number in (1, 2):
        searches[number - 1].run(LocalWorkers(1), shard=(number, 3))
        status = searches[number - 1].finish(LocalWorkers(1), pictures=False)
        assert not status.complete and not list(status.folder.glob("designs.*"))
    assert status.tried == 10
    searches[2].run(LocalWorkers(1), shard=(3, 3))
    status = searches[2].finish(LocalWorkers(1), pictures=False)
    assert status.complete and len(table(status, "points")) == 14


def test_a_shard_is_run_by_one_process_at_a_time():
    plans = MadeUpPlans(mixed)
    search = Search(load(MIXED), Path("out"), plans=plans)
    with (
        search._turn((1, 2)),
        pytest.raises(UserError, match="another process runs shard 1-of-2"),
    ):
        Search(load(MIXED), Path("out"), plans=plans).run(LocalWorkers(1), shard=(1, 2))


# Points without hope


def hopeless(values: Mapping[str, Any], case: Case) -> dict[str, float]:
    return {
        FIRST: 1 + values["x"] + 0.01 * math.sin(50 * values["x"] + case.seed),
        SECOND: 1 + values["x"] + 0.01 * math.cos(90 * values["x"] + case.seed),
    }


def test_hopeless_points_get_the_first_seeds_only():
    parameters = space(x={"range": RANGE})
    status, plans = run(
        search_of(parameters, points=40, sampler="random", seeds={"tuning": 5}), hopeless
    )
    points = table(status, "points")
    assert set(points["state"]) == {"complete", "pruned"}
    pruned, complete = (points[points["state"] == state] for state in ("pruned", "complete"))
    assert set(pruned["runs"]) == {2} and set(complete["runs"]) == {5}
    assert (pruned["point"] >= 10).all(), "nothing is known before"
    assert pruned["x"].min() > complete["x"].min()
    assert len(plans.cases) < 40 * 5


def test_a_point_that_is_not_beyond_doubt_worse_is_not_given_up():
    wiggle = np.array([[0.2, 0.0], [-0.2, 0.1], [0.0, -0.1]])
    finished = [np.array([[0.0, x]] * 3) + (-1) ** x * wiggle for x in range(10)]
    assert searcher.is_hopeless(np.array([[0.0, 50.0], [0.0, 50.0]]), finished)
    assert not searcher.is_hopeless(np.array([[-50.0, 50.0], [-50.0, 50.0]]), finished)
    assert not searcher.is_hopeless(np.array([[0.0, 0.0], [0.0, 0.0]]), finished)
    assert not searcher.is_hopeless(np.array([[0.0, 50.0], [0.0, 50.0]]), finished[:9])


def test_points_that_cannot_be_run_fail_and_are_told_of():
    parameters = space(x={"list": ["broken", 1, 2]})
    status, _ = run(
        search_of(parameters), lambda values, case: {FIRST: float(values["x"]), SECOND: 1.0}
    )
    points = table(status, "points")
    failed = points[points["state"] == "failed"]
    assert set(failed["x"]) == {"broken"}
    assert set(failed["reason"]) == {"a design that cannot be run"}
    assert table(status)["x"].tolist() == [1]


# What a parameter explains


def test_importance_tells_what_matters_from_what_does_not():
    def one_matters(values: Mapping[str, Any], case: Case) -> dict[str, float]:
        return {FIRST: 5 * values["x"] + noise(case), SECOND: 1 + values["a"] + values["b"]}

    parameters = space(x={"range": RANGE}, a={"list": [0, 1]}, b={"range": RANGE})
    data = search_of(
        parameters, points=150, batch=50, sampler="random", early=0, seeds={"tuning": 1}
    )
    rows = table(run(data, one_matters)[0], "importance").set_index(["parameter", "metric"])
    assert rows.loc[("x", FIRST), "low"] > 0.9
    # variances 1/4 and 1/12
    assert rows.loc[("a", SECOND), "low"] < 0.75 < rows.loc[("a", SECOND), "high"]
    assert rows.loc[("b", FIRST), "value"] < 0.1 and rows.loc[("b", FIRST), "low"] == 0
    assert (rows["points"] == 150).all()


# Wrong input


def test_the_storage_of_another_search_is_refused():
    run(MIXED, mixed)
    with pytest.raises(UserError, match=r"the storage of another search: early differs"):
        run({**MIXED, "early": 1}, mixed)
    with pytest.raises(UserError, match=r"--storage: this search is stored in search.journal"):
        run(MIXED, mixed, storage="sqlite")


def test_a_line_of_the_journal_that_was_not_written_to_its_end_is_left_out():
    whole, _ = run(MIXED, mixed, "whole")
    status, _ = run({**MIXED, "points": 9}, mixed)
    journal = status.folder / "search.journal"
    journal.write_bytes(journal.read_bytes()[:-20])
    for _ in range(2):
        run({**MIXED, "points": 14}, mixed)
    assert tables(run(MIXED, mixed)[0]) == tables(whole)


@pytest.mark.parametrize("lines", [1, 500])
@pytest.mark.parametrize("storage", ["journal", "sqlite"])
def test_a_storage_that_is_none_is_refused_in_one_line(storage: str, lines: int):
    status, _ = run(MIXED, mixed, storage=storage)
    path = status.folder / searcher.STORAGES[storage]
    path.write_bytes(b"no storage\n" * lines)
    with pytest.raises(UserError, match="not the storage of a search") as error:
        run(MIXED, mixed, storage=storage)
    assert "\n" not in str(error.value)


def test_a_link_out_of_the_folder_is_not_followed():
    Path("elsewhere").write_text("")
    Path("out/made-up").mkdir(parents=True)
    run(MIXED, mixed)
    Path("out/made-up/search.journal").unlink()
    Path("out/made-up/search.journal").symlink_to(Path("elsewhere").absolute())
    with pytest.raises(UserError, match="a link out of the result folder"):
        run(MIXED, mixed)


def test_the_folder_of_something_else_is_refused():
    Path("out/made-up").mkdir(parents=True)
    Path("out/made-up/notes.txt").write_text("mine")
    with pytest.raises(UserError, match="holds something else than a search"):
        run(MIXED, mixed)
    assert [path.name for path in Path("out/made-up").iterdir()] == ["notes.txt"]


def test_an_objective_that_no_run_records():
    data = search_of(LIST, objectives={"minimize": [FIRST, "ghost_share"]})
    with pytest.raises(UserError, match=r"objectives: ghost_share: no run records it; .*known: fi"):
        run(data, discrete)


def test_an_objective_that_not_every_run_records():
    """At x = 0 there is nothing of which a share could be a ghost."""

    def sometimes(values: Mapping[str, Any], case: Case) -> dict[str, float]:
        share = {"ghost_share": 0.1 * values["x"]} if values["x"] else {}
        return {FIRST: 10.0 - values["x"] + noise(case), **share}

    data = search_of(LIST, objectives={"minimize": [FIRST, "ghost_share"]})
    status, _ = run(data, sometimes)
    assert set(table(status)["x"]) <= {1, 2, 3}


def test_fixed_settings_are_read_from_texts():
    texts = ["image_encoding = raw", "genie={view_range: 30 m}", "title=a=b"]
    assert fixed_settings(texts) == {
        "image_encoding": "raw",
        "genie": {"view_range": "30 m"},
        "title": "a=b",
    }
    for wrong in ("image_encoding", "=raw"):
        with pytest.raises(UserError, match="must be path=value"):
            fixed_settings([wrong])
