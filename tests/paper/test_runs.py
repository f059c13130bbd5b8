"""The runs of an evaluation: one for each scenario and seed, whoever asks for it, in whatever
words.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from genie_sim.core.rules import GenieRules
from genie_sim.errors import UserError
from genie_sim.paper.definitions import USUAL, Definitions
from genie_sim.paper.evaluation_run import EVERY_METHOD, EvaluationRun, _read
from genie_sim.paper.facts import Fact
from genie_sim.paper.readings import load_reading
from genie_sim.paper.reproduce import check
from genie_sim.paper.runs import EvaluationRuns, Outcome, simulate
from genie_sim.study.parts import Parts

BASE = ("overlap=0.35", "gate_m=0.25")


PARTS = Parts(Path("nowhere"))
OTHER = Definitions(boost="per_object")


@pytest.fixture
def simulated(monkeypatch):
    """The jobs that were simulated, in a made-up world where a fact tells which job gave it."""
    ran: list[EvaluationRun] = []

    def world(wanted, parts, workers, progress):
        ran.extend(wanted)
        progress(len(wanted), len(wanted), "")
        return [
            Outcome(
                {
                    definitions: {Fact("which", method): float(len(ran)) for method in run.methods}
                    for definitions in run.definitions
                }
            )
            for run in wanted
        ]

    monkeypatch.setattr("genie_sim.paper.runs.simulate", world)
    return ran


@pytest.mark.parametrize(
    ("scenario", "settings", "known"),
    [
        ("2car_homo", (*BASE, "gate_m=0.25"), True),
        ("2car_homo", (*BASE, "genie.object_map.rate=0.1"), True),
        ("2car_homo", (*BASE, "quadro=quadro_rtx_4000_q31"), True),
        ("2car_hetero", (*BASE, "quadro=quadro_rtx_4000_q31"), False),
        ("1car_homo", (*BASE, "overlap=0.8"), True),
        ("2car_homo", (*BASE, "overlap=0.8"), False),
        ("2car_homo", (*BASE, "genie.passes=2"), False),
        ("2car_homo", (*BASE, "min_score=0.7"), False),
        ("2car_homo", (*BASE, "links=ideal"), False),
        ("2car_homo", (*BASE, "genie.object_map.threshold=range_60"), False),
    ],
)
def test_settings_that_make_the_same_scenario_are_one_run(simulated, scenario, settings, known):
    runs = EvaluationRuns(PARTS, 1)
    (first,) = runs([EvaluationRun(scenario, 1, BASE)], "")
    (second,) = runs([EvaluationRun(scenario, 1, settings)], "")
    assert (len(simulated) == 1) == known == (second is first)


def test_a_threshold_by_its_word_is_the_run_of_its_number(simulated):
    jobs = [
        EvaluationRun("2car_homo", 1, (*BASE, f"genie.object_map.threshold={value}"))
        for value in ("range_60", "0.72")
    ]
    assert jobs[0].setup_key == jobs[1].setup_key
    by_word, by_number = (replace(job, judged=True).facts() for job in jobs)
    assert repr(by_word) == repr(by_number)  # with NaN
    assert by_word[Fact("handling_ms")] > 0
    assert by_word[Fact("accelerator_rate", component="edge1")] > 0


def test_every_seed_is_a_run_of_its_own(simulated):
    assert (
        len(
            {
                id(one)
                for one in EvaluationRuns(PARTS, 1)(
                    [EvaluationRun("2car_homo", seed, BASE) for seed in (1, 2, 1)], ""
                )
            }
        )
        == 2
    )
    assert [job.seed for job in simulated] == [1, 2]


def test_a_job_that_wants_more_than_is_known_is_simulated_again_with_all_of_it(simulated):
    runs = EvaluationRuns(PARTS, 1)
    plain = EvaluationRun("2car_homo", 1, BASE, ("genie",))
    runs([plain], "")
    all_methods = replace(plain, methods=EVERY_METHOD, keep_tables=True)
    runs([all_methods, replace(plain, judged=True), replace(plain, definitions=(OTHER,))], "")
    assert simulated == [plain, replace(all_methods, judged=True, definitions=(USUAL, OTHER))]
    runs([replace(plain, methods=("remote",), judged=True)], "")
    assert len(simulated) == 2
    other = replace(plain, seed=2)
    for wanted in ({}, {"definitions": (OTHER,)}, {"keep_tables": True}, {"judged": True}):
        runs([replace(other, **wanted)], "")
    assert len(simulated) == 6


def test_a_run_is_simulated_once_and_judged_under_each_of_its_definitions(tmp_path):
    run = EvaluationRun(
        "1car_homo", 1, BASE, ("genie",), keep_tables=True, definitions=(USUAL, OTHER)
    )
    (outcome,) = simulate([run], Parts(tmp_path), 1)
    usual, other = (outcome.judged[definitions] for definitions in (USUAL, OTHER))
    assert {fact: repr(value) for fact, value in usual.items()} == {
        fact: repr(float(value)) for fact, value in run.facts().items()
    }
    different = {fact.metric for fact in usual if repr(usual[fact]) != repr(other[fact])}
    assert different == {"confidence_boost"}
    frames, _ = (outcome.table(name) for name in ("frames", "lookups"))
    assert set(frames.where(method="genie")["frame"]) == set(frames["frame"])
    assert len(list((tmp_path / "parts").iterdir())) == 1


def test_a_run_that_is_in_the_folder_is_not_simulated_again(tmp_path, monkeypatch):
    runs = [EvaluationRun("1car_homo", seed, BASE, ("genie",)) for seed in (1, 2)]
    first = simulate(runs[:1], Parts(tmp_path), 1)
    measured = []
    measure = EvaluationRun.measure
    monkeypatch.setattr(
        EvaluationRun, "measure", lambda run, *a: measured.append(run.seed) or measure(run, *a)
    )
    again = simulate(runs, Parts(tmp_path), 1)
    assert measured == [2]
    assert repr(again[0].facts) == repr(first[0].facts)
    assert len({run.run_id for run in (*runs, replace(runs[0], judged=True))}) == 3


def test_genie_alone_has_the_baselines_of_its_world(simulated):
    runs = EvaluationRuns(PARTS, 1)
    runs([EvaluationRun("2car_homo", 1, BASE)], "")
    same, other = (
        EvaluationRun("2car_homo", 1, (*BASE, setting), ("genie",))
        for setting in ("genie.passes=2", "links=ideal")
    )
    assert runs.has_baselines(same) and not runs.has_baselines(other)
    assert runs([same, other], "")[0].facts == {
        Fact("which", "local"): 1.0,
        Fact("which", "remote"): 1.0,
        Fact("which"): 3.0,
    }
    assert set(runs([other], "")[0].facts) == {Fact("which")}


def test_progress_counts_what_is_known_too(simulated):
    told = []
    runs = EvaluationRuns(PARTS, 1, lambda done, of, what: told.append((done, of)))
    jobs = [EvaluationRun("2car_homo", seed, BASE) for seed in (1, 2)]
    runs(jobs, "")
    runs(jobs, "")
    assert told[-1] == (2, 2)


def test_bench_plays_the_whole_bag_on_every_board_a_second_apart():
    settings = load_reading("bench").settings(BASE)
    cars = EvaluationRun("3car_hetero", 1, settings).prepare().scenario.cars
    assert [(car.route.window_ns, car.route.start_ns, car.route.laps) for car in cars] == [
        (None, index * 1_000_000_000, 2) for index in range(3)
    ]
    genie = EvaluationRun("3car_hetero", 1, settings).prepare().scenario.genie
    assert (genie.similarity.name, genie.object_map.location_key) == ("exact", "exact")
    assert (genie.car_learns, genie.share_filter) == ("own", "all")
    blind = EvaluationRun("case_study", 1, settings).prepare().scenario.genie
    assert blind.similarity.name == "pose_grid", "a car without cameras has only its position"


def test_two_passes_changes_nothing_else():
    settings = [load_reading(name).settings(BASE) for name in ("default", "two_passes")]
    base, other = (EvaluationRun("3car_hetero", 1, mine).prepare() for mine in settings)
    assert (base.scenario.genie.passes, other.scenario.genie.passes) == (1, 2)
    assert replace(base.scenario, genie=GenieRules()) == replace(other.scenario, genie=GenieRules())


@pytest.mark.parametrize("setting", ["genie.passses=2", "links=idael", "fleet=3"])
def test_a_reading_that_sets_what_no_scenario_has_is_told_before_anything_runs(setting):
    reading = load_reading("two_passes")
    wrong = replace(reading, choices=(replace(reading.choices[0], settings=(setting,)),))
    with pytest.raises(UserError) as told:
        check(wrong)
    assert str(told.value).startswith(f"{reading.path}: choices[0].set: ")
    assert "\n" not in str(told.value)


@pytest.mark.parametrize(
    "settings",
    [
        (),
        BASE,
        (*BASE, "order=reversed"),
        (*BASE, "same_bag_s=1", "laps=2"),
        (*BASE, "cars[0].route.window=[1 s, 6 s]"),
        ("overlap=1",),
    ],
)
def test_what_is_read_once_for_all_seeds_is_what_each_seed_would_read(settings):
    for seed in (1, 2, 9):
        run = EvaluationRun("3car_hetero", seed, settings)
        assert run.prepare().scenario == _read(run)
