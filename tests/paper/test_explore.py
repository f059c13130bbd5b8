"""The design over the paper's open choices: the same wherever it is run, and it goes on where it
ended.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from genie_sim.cli import app
from genie_sim.errors import UserError
from genie_sim.paper import explore
from genie_sim.paper.checks import load_claims
from genie_sim.paper.evaluation_run import EvaluationRun
from genie_sim.paper.runs import Outcome, simulate
from genie_sim.study.parts import Parts

CLAIMS = [claim.id for claim in load_claims() if claim.kind != "table"]
POINTS = explore.points(explore.design()["points"])


def row(number, holds):
    """A finished point; ``holds``: of some claims whether they do, the others never hold."""
    return {"point": str(number), **POINTS[number], **dict.fromkeys(CLAIMS, "0"), **holds}


def test_levels_are_drawn_evenly_and_more_points_begin_with_the_same():
    assert explore.points(10) == POINTS[:10]
    for name, levels in explore.levels().items():
        drawn = [point[name] for point in POINTS[:64]]
        assert {drawn.count(level) for level in levels} <= {
            64 // len(levels) + shift for shift in (-1, 0, 1)
        }, name


@pytest.mark.parametrize("name", explore.design()["choices"])
def test_every_level_makes_another_scenario_and_the_first_is_the_defaults(name):
    choices = explore.design()["choices"]
    usual = [setting for choice in choices.values() for setting in next(iter(choice.values()))]
    made = []
    for settings in choices[name].values():
        run = EvaluationRun("3car_hetero", 1, (*usual, *settings))
        made.append(run.prepare().scenario.to_yaml())
    assert len(set(made)) == len(made)
    calibrated = ["overlap=0.35", "gate_m=0.25"]
    if name not in ("routes", "location"):  # which are fitted
        assert (
            made[0]
            == EvaluationRun("3car_hetero", 1, tuple(calibrated)).prepare().scenario.to_yaml()
        )


def test_every_claim_is_judged_at_a_point(tmp_path):
    runs = explore.runs_of(2, POINTS[2])
    outcomes = simulate(list(runs.values()), Parts(tmp_path), 1)
    facts = {
        place: outcome.judged[run.definitions[0]]
        for (place, run), outcome in zip(runs.items(), outcomes, strict=True)
    }
    judged = explore.judged(2, POINTS[2], facts)
    assert {name: judged[name] for name in POINTS[2]} == POINTS[2]
    assert {judged[claim] for claim in CLAIMS} <= {"0", "1", ""}
    assert sum(judged[claim] == "" for claim in CLAIMS) < 6
    assert POINTS[2]["threshold"] == "stored"
    assert judged["C33"] == "", "where C_T is a percentile of what is stored, nothing decides it"


@pytest.fixture
def simulated(monkeypatch):
    """The numbers of the points that were simulated, in a made-up world in which every second point
    has the first claim.
    """
    ran = []

    def world(runs, *_):
        ran.extend(dict.fromkeys(run.seed - explore.design()["first_seed"] for run in runs))
        return [Outcome({run.definitions[0]: {}}) for run in runs]

    def judged(number, point, facts):
        return row(number, {"C1": str(number % 2)})

    monkeypatch.setattr(explore, "simulate", world)
    monkeypatch.setattr(explore, "judged", judged)
    return ran


def test_points_that_are_there_are_not_run_again(tmp_path, simulated):
    explore.explore(tmp_path, 1, count=5)
    assert simulated == [0, 1, 2, 3, 4]
    simulated.clear()
    found = explore.explore(tmp_path, 1, count=9)
    assert simulated == [5, 6, 7, 8]
    assert (found["points"], found["claims"]["C1"]["holds"]) == (9, round(4 / 9, 3))
    simulated.clear()
    assert explore.explore(tmp_path, 1, count=9) == found and simulated == []


def test_points_of_another_design_are_refused(tmp_path, simulated, monkeypatch):
    explore.explore(tmp_path, 1, count=3)
    monkeypatch.setitem(explore.design(), "sequence", 18)
    with pytest.raises(
        UserError, match="point 0 is of another design; name another folder with --out"
    ):
        explore.explore(tmp_path, 1, count=3)


def test_a_design_goes_on_with_the_runs_that_are_done(tmp_path, monkeypatch):
    """Its second run is interrupted: the first is not simulated again."""
    monkeypatch.setattr(explore, "RUNS", [("base", ("1car_homo", "2car_homo"), (), ("genie",))])
    monkeypatch.setattr(explore, "answers", lambda rows: {"points": len(rows)})
    monkeypatch.setattr("genie_sim.study.parts.TASK_FRAMES", 1)
    measure, ran = EvaluationRun.measure, []

    def interrupted(run, *arguments):
        if len(ran) == 1:
            raise KeyboardInterrupt
        ran.append(run.scenario)
        return measure(run, *arguments)

    monkeypatch.setattr(EvaluationRun, "measure", interrupted)
    with pytest.raises(KeyboardInterrupt):
        explore.explore(tmp_path, 1, count=1)
    assert not (tmp_path / "points.csv").exists()
    monkeypatch.setattr(
        EvaluationRun, "measure", lambda run, *a: ran.append(run.scenario) or measure(run, *a)
    )
    assert explore.explore(tmp_path, 1, count=1) == {"points": 1}
    assert sorted(ran) == ["1car_homo", "2car_homo"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["explore.json", "points.csv"]


def test_what_drives_a_claim_is_found_and_chance_is_not():
    noise = np.random.default_rng(1)
    rows = [
        row(n, {"C1": str(int(point["passes"] == "two")), "C2": str(noise.integers(2))})
        for n, point in enumerate(POINTS)
    ]
    found = explore.answers(rows)["claims"]
    name, driver = next(iter(found["C1"]["drivers"].items()))
    assert (name, driver["holds_at"]) == ("passes", {"one": 0.0, "two": 1.0})
    assert driver["share_of_variance"] == pytest.approx(1.0, abs=0.02)
    assert max(of["share_of_variance"] for of in found["C2"]["drivers"].values()) < 0.2
    assert found["C3"] == {"tried": len(POINTS), "holds": 0.0, "drivers": {}}


def test_the_share_of_variance_is_that_beyond_chance():
    """Omega squared by hand: of 2 in all, 1.5 is within the levels, and a degree of freedom is
    worth 0.25.
    """
    holds, drawn = np.array([0.0, 0, 0, 1, 1, 1, 1, 0]), np.array([*"aaaabbbb"])
    assert explore._explained(holds, drawn) == pytest.approx((2 - 1.5 - 0.25) / (2 + 0.25))


def test_pairs_that_hardly_ever_hold_together_are_found():
    holds = [
        {"C1": n % 2, "C2": 1 - n % 2, "C3": n % 2 if n >= 8 else 1 - n % 2, "C4": n == 1}
        for n in range(64)
    ]
    for n, of in enumerate(holds):
        of["C5"] = n // 2 % 2  # which has nothing to do with the others
    rows = [
        row(n, {claim: str(int(held)) for claim, held in of.items()}) for n, of in enumerate(holds)
    ]
    found = explore.answers(rows)["against_each_other"]
    assert [tuple(one.values()) for one in found] == [
        (["C1", "C2"], 16.0, 0),
        (["C2", "C3"], 16.0, 4),
    ]


def test_a_half_that_predicts_the_other_is_told_from_one_that_does_not():
    halves = explore.design()["halves"]
    first, second = halves.values()

    def split(other):
        rows = [
            row(n, dict.fromkeys(first, str(n % 2)) | dict.fromkeys(second, str(other(n))))
            for n in range(64)
        ]
        return {one["by"]: one for one in explore.answers(rows)["split"]}[next(iter(halves))]

    same, unrelated = split(lambda n: n % 2), split(lambda n: n // 2 % 2)
    assert (same["own"], same["other"], same["other_of_all"], same["r"]) == (1.0, 1.0, 0.5, 1.0)
    assert same["other"] > same["chance"][1]
    assert (
        unrelated["own"] == 1.0
        and unrelated["chance"][0] < unrelated["other"] < unrelated["chance"][1]
    )


def test_what_is_committed_is_what_the_points_say_and_what_the_paper_page_shows():
    """If not: ``genie-sim reproduce --explore`` runs what is missing, and prints the tables for
    docs/paper.md.
    """
    root = Path(__file__).resolve().parents[2]
    rows = explore.read_points(root / "results/explore/points.csv")
    assert [{name: row[name] for name in explore.levels()} for row in rows] == POINTS
    found = json.loads((root / "results/explore/explore.json").read_text())
    assert found == explore.answers(rows)
    page = (root / "docs/paper.md").read_text(encoding="utf-8")
    assert page.split("<!-- explore:begin -->")[1].split("<!-- explore:end -->")[
        0
    ].strip() == explore.text(found)


def test_what_does_not_go_with_explore_is_refused():
    told = CliRunner().invoke(app, ["reproduce", "--explore", "--quick"])
    assert told.exit_code != 0 and "--explore: cannot be combined with" in (
        told.output + str(told.exception)
    )
