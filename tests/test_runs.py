"""The runs of an evaluation: one for each scenario and seed, whoever asks for it, in whatever words."""

from __future__ import annotations

from dataclasses import replace

import pytest

from genie_sim.errors import UserError
from genie_sim.paper.readings import load_reading
from genie_sim.paper.replicate import EVERY_METHOD, Job, Outcome, prepare_job, run_job
from genie_sim.paper.reproduce import check
from genie_sim.paper.runs import Runs, _key

BASE = ("overlap=0.35", "gate_m=0.25")


@pytest.fixture
def simulated(monkeypatch):
    """The jobs that were simulated, in a made-up world where a fact tells which job gave it."""
    ran: list[Job] = []

    def world(run, jobs, *_):
        ran.extend(jobs)
        return [
            Outcome({f"which:{method}": float(len(ran)) for method in job.methods}) for job in jobs
        ]

    monkeypatch.setattr("genie_sim.paper.runs.in_parallel", world)
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
    runs = Runs(1)
    (first,) = runs([Job(scenario, 1, BASE)], "")
    (second,) = runs([Job(scenario, 1, settings)], "")
    assert (len(simulated) == 1) == known == (second is first)


def test_a_threshold_by_its_word_is_the_run_of_its_number(simulated):
    jobs = [
        Job("2car_homo", 1, (*BASE, f"genie.object_map.threshold={value}"))
        for value in ("range_60", "0.72")
    ]
    assert _key(jobs[0]) == _key(jobs[1])
    by_word, by_number = (run_job(replace(job, judged=True)).facts for job in jobs)
    assert repr(by_word) == repr(by_number)  # with NaN
    assert by_word["handling_ms"] > 0 and by_word["accelerator_rate:genie:edge1"] > 0


def test_every_seed_is_a_run_of_its_own(simulated):
    assert (
        len({id(one) for one in Runs(1)([Job("2car_homo", seed, BASE) for seed in (1, 2, 1)], "")})
        == 2
    )
    assert [job.seed for job in simulated] == [1, 2]


def test_a_job_that_wants_more_than_is_known_is_simulated_again_with_all_of_it(simulated):
    runs = Runs(1)
    plain = Job("2car_homo", 1, BASE, ("genie",), redefined=False)
    runs([plain], "")
    all_methods = replace(plain, methods=EVERY_METHOD, keep_tables=True)
    runs([all_methods, replace(plain, judged=True), replace(plain, redefined=True)], "")
    assert simulated == [plain, replace(all_methods, judged=True, redefined=True)]
    runs([replace(plain, methods=("remote",), judged=True)], "")
    assert len(simulated) == 2
    other = replace(plain, seed=2)
    for wanted in ({}, {"redefined": True}, {"keep_tables": True}, {"judged": True}):
        runs([replace(other, **wanted)], "")
    assert len(simulated) == 6


def test_other_definitions_cost_facts_of_their_own_alone():
    job = Job("1car_homo", 1, BASE, ("genie",))
    every, own = run_job(job).facts, run_job(replace(job, redefined=False)).facts
    assert {name: repr(every[name]) for name in own} == {
        name: repr(value) for name, value in own.items()
    }
    others, some = (
        set(every) - set(own),
        ("image_reuse_highest_running:car", "image_running_peak_at:car"),
    )
    assert {"first_answer_mean_from_stamp:genie", *some} <= others
    assert all("_from_stamp" in name or "_running" in name for name in others)


def test_genie_alone_has_the_baselines_of_its_world(simulated):
    runs = Runs(1)
    runs([Job("2car_homo", 1, BASE)], "")
    same, other = (
        Job("2car_homo", 1, (*BASE, setting), ("genie",))
        for setting in ("genie.passes=2", "links=ideal")
    )
    assert runs.has_baselines(same) and not runs.has_baselines(other)
    assert runs([same, other], "")[0].facts == {
        "which:local": 1.0,
        "which:remote": 1.0,
        "which:genie": 3.0,
    }
    assert set(runs([other], "")[0].facts) == {"which:genie"}


def test_progress_counts_what_is_known_too(simulated):
    told = []
    runs = Runs(1, lambda done, of, what: told.append((done, of)))
    jobs = [Job("2car_homo", seed, BASE) for seed in (1, 2)]
    runs(jobs, "")
    runs(jobs, "")
    assert told[-1] == (2, 2)


def test_bench_plays_the_whole_bag_on_every_board_a_second_apart():
    settings = load_reading("bench").settings(BASE)
    cars = prepare_job(Job("3car_hetero", 1, settings)).scenario.cars
    assert [(car.route.window_ns, car.route.start_ns, car.route.laps) for car in cars] == [
        (None, index * 1_000_000_000, 2) for index in range(3)
    ]
    genie = prepare_job(Job("3car_hetero", 1, settings)).scenario.genie
    assert (genie.similarity.name, genie.object_map.location_key) == ("exact", "exact")
    assert (genie.car_learns, genie.share_filter) == ("own", "all")
    blind = prepare_job(Job("case_study", 1, settings)).scenario.genie
    assert blind.similarity.name == "pose_grid", "a car without cameras has only its position"


def test_two_passes_changes_nothing_else():
    settings = [load_reading(name).settings(BASE) for name in ("default", "two_passes")]
    base, other = (prepare_job(Job("3car_hetero", 1, mine)) for mine in settings)
    assert (base.scenario.genie.passes, other.scenario.genie.passes) == (1, 2)
    assert base.scenario.model_dump(exclude={"genie"}) == other.scenario.model_dump(
        exclude={"genie"}
    )


@pytest.mark.parametrize("setting", ["genie.passses=2", "links=idael", "fleet=3"])
def test_a_reading_that_sets_what_no_scenario_has_is_told_before_anything_runs(setting):
    reading = load_reading("two_passes")
    wrong = reading.model_copy(
        update={"choices": (reading.choices[0].model_copy(update={"settings": (setting,)}),)}
    )
    with pytest.raises(UserError) as told:
        check(wrong)
    assert str(told.value).startswith(f"{reading.path}: choices[0].set: ")
    assert "\n" not in str(told.value)
