"""Other readings and values: on the evaluation's own seeds, nothing run twice, and told from what
nobody tried.
"""

from __future__ import annotations

from dataclasses import replace

import pytest

from genie_sim.paper import arms, verdict_table
from genie_sim.paper.assumptions import Sweep, Variant, load_assumptions
from genie_sim.paper.checks import ALL, load_claims
from genie_sim.paper.claims import Verdict
from genie_sim.paper.definitions import USUAL
from genie_sim.paper.evaluation_run import EvaluationRun
from genie_sim.paper.evidence import Finding
from genie_sim.paper.facts import Fact, of_baselines, placed
from genie_sim.paper.readings import load_reading
from genie_sim.paper.reproduce import last_calibration
from genie_sim.paper.runs import EvaluationRuns, Outcome
from genie_sim.study.parts import Parts

CLAIMS = {claim.id: claim for claim in load_claims()}
DEFAULT = load_reading("default").as_json()
SEEDS = (1, 2, 3, 4)
FEW = replace(
    load_assumptions(),
    variants=tuple(
        Variant(name=name, settings=(setting,), plausible=plausible, why="")
        for name, setting, plausible in (
            ("other_rule", "genie.object_map.rule=ema", "yes"),
            ("ideal_link", "links=ideal", "arguable"),
            ("half_a_metre", "genie.similarity={name: pose_grid, cell: 0.5 m}", "yes"),
        )
    ),
    sweeps=tuple(
        Sweep(
            parameter=parameter,
            unit="1",
            values=values,
            plausible=(0.7, 2.0),
            paper="not given",
        )
        for parameter, values in (("image_cell_m", (0.5, 1.0)), ("min_score", (0.3, 0.7)))
    ),
)


LATE = Fact("under_deadline_share", "local")
GAIN = Fact("improvement_first_answer", component="local")


def made_up(level):
    return {
        placed(f"{kind}_reuse", place): level
        for kind in ("image", "object")
        for place in ("car", "edge")
    }


@pytest.fixture
def found(monkeypatch, tmp_path):
    """The few arms of a made-up world, in which the other rule reuses 31 % of the objects, and the
    jobs it took.
    """
    ran = []

    def world(wanted, *_):
        ran.extend(wanted)
        local = {LATE: 0.0, GAIN: 0.9}
        facts_of_runs = [
            made_up(0.31 if "genie.object_map.rule=ema" in run.settings else 0.6)
            | (local if "local" in run.methods else {})
            for run in wanted
        ]
        return [Outcome({USUAL: facts}) for facts in facts_of_runs]

    monkeypatch.setattr("genie_sim.paper.runs.simulate", world)
    runs = EvaluationRuns(Parts(tmp_path), 1)
    runs(
        [EvaluationRun(scenario, seed, last_calibration()) for scenario in ALL for seed in SEEDS],
        "claims",
    )
    ran.clear()
    return arms.run_arms(FEW, last_calibration(), SEEDS, runs), ran


def test_every_arm_has_the_seeds_of_the_evaluation(found):
    made, ran = found
    assert {job.seed for job in ran} == set(SEEDS)
    assert made.seeds == made.as_json()["seeds"] == len(SEEDS)
    assert all(one.seeds == len(SEEDS) for one in made.evidence.values())


def test_an_arm_is_as_plausible_as_was_said_before(found):
    made, _ = found
    assert made.plausible == {
        "other_rule": "yes",
        "ideal_link": "arguable",
        "half_a_metre": "yes",
        "image_cell_m=0.5": "no",
        "image_cell_m=1": "yes",
        "min_score=0.3": "no",
        "min_score=0.7": "yes",
    }


def test_what_is_known_is_not_run_again(found):
    made, ran = found
    runs = {(job.settings[-1], job.methods) for job in ran}
    assert runs == {
        ("genie.object_map.rule=ema", ("genie",)),  # the baselines do what they did
        ("links=ideal", ("local", "remote", "genie")),
        ("genie.similarity={name: pose_grid, cell: 0.5 m}", ("genie",)),
        ("min_score=0.7", ("genie",)),
    }
    assert len(ran) == 4 * len(ALL) * len(SEEDS)
    known = {name: one.of(ALL[0], LATE)[0] == 0 for name, one in made.evidence.items()}
    with_baselines = ["other_rule", "ideal_link", "half_a_metre", "image_cell_m=0.5"]
    assert [name for name, has in known.items() if has] == with_baselines
    gains = {name: one.of(ALL[0], GAIN)[0] for name, one in made.evidence.items()}
    assert [name for name, gain in gains.items() if gain == 0.9] == ["ideal_link"], (
        "no other Genie's improvement"
    )


def test_a_value_that_the_evaluation_uses_is_a_point_of_the_curve_but_no_other_reading(found):
    made, _ = found
    assert set(made.evidence) == {
        "other_rule",
        "ideal_link",
        "half_a_metre",
        "image_cell_m=0.5",
        "min_score=0.7",
    }
    assert [point["object_reuse"][0] for point in made.sweeps[0]["points"]] == pytest.approx(
        [0.6, 0.6]
    )
    assert list(made.as_json()["variants"]) == ["other_rule", "ideal_link", "half_a_metre"]


def test_a_reading_that_changes_a_single_run_is_another_reading():
    """Some readings change what only some scenarios do."""
    outcomes = {
        (scenario, seed): Outcome({USUAL: made_up(0.6)}) for scenario in ALL for seed in SEEDS
    }
    changed = (ALL[-1], SEEDS[-1])

    class WithOneChange:
        def has_baselines(self, run: EvaluationRun) -> bool:
            return False

        def __call__(self, wanted: list[EvaluationRun], what: str) -> list[Outcome]:
            return [
                Outcome({USUAL: made_up(0.7)})
                if "genie.object_map.rule=ema" in run.settings
                and (run.scenario, run.seed) == changed
                else outcomes[run.scenario, run.seed]
                for run in wanted
            ]

    rules = replace(FEW, variants=FEW.variants[:2], sweeps=())
    made = arms.run_arms(rules, (), SEEDS, WithOneChange())  # type: ignore[arg-type]
    assert set(made.evidence) == {"other_rule"}, "the ideal link changes nothing here"


def test_where_a_claim_holds_where_not_and_where_nobody_tried(found):
    made, _ = found
    assert made.holding(CLAIMS["C11"]) == (["other_rule (plausible: yes)"], 5)
    assert made.holding(CLAIMS["C13"]) == ([], 5)
    assert made.holding(CLAIMS["C9"]) == ([], 0), "R is missing"
    assert made.holding(CLAIMS["C30"]) == ([], 0), "no arm runs the case study"
    missed = Finding(0.6, 0.5, 0.7, len(SEEDS), "1", holds=False, direction=True)
    said = {}
    for name in ("C11", "C13", "C30"):
        row = verdict_table.row(Verdict(CLAIMS[name], missed, "not reproduced", False), made)
        said[name] = verdict_table.document([row], [DEFAULT], [])
    assert (
        "Holds under 1 of the 5 other readings and values that were tried, 4 seeds each: other_rule"
        in said["C11"]
    )
    assert (
        "Holds under none of the 5 other readings and values that were tried, 4 seeds each."
        in said["C13"]
    )
    assert "Not tried under any other reading or value" in said["C30"]


def test_a_quick_evaluation_says_nothing_of_other_readings():
    missed = Finding(0.6, 0.5, 0.7, 4, "1", holds=False, direction=True)
    row = verdict_table.row(Verdict(CLAIMS["C11"], missed, "not reproduced", False))
    assert row["holds_under"] is None and row["tried_under"] is None
    document = verdict_table.document([row], [DEFAULT], [])
    assert "tried" not in document.split("## Table I")[0].split("## Each claim")[1]


def test_baselines_do_the_same_whatever_genie_s_settings_are():
    settings = (*last_calibration(), "genie.object_map.rule=ema")
    base = EvaluationRun("1car_hetero", 1, last_calibration()).facts()
    whole = EvaluationRun("1car_hetero", 1, settings).facts()
    alone = EvaluationRun("1car_hetero", 1, settings, ("genie",)).facts()
    merged = {**of_baselines(base), **alone}
    missing = set(whole) - set(merged)
    assert all(fact.metric.startswith("improvement_") for fact in missing), missing
    assert merged == pytest.approx({name: whole[name] for name in merged}, nan_ok=True, rel=0)
    boost = placed("confidence_boost", "car")
    assert whole[boost] != base[boost]
