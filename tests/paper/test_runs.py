"""The runs of an evaluation: what the words of its settings make of a scenario, and what comes
out.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import genie_sim as gs
from genie_sim.base.errors import UserError
from genie_sim.paper import reproduce
from genie_sim.paper.evidence import rounded
from genie_sim.paper.facts import Fact, placed
from genie_sim.paper.readings import MAIN, load_reading
from genie_sim.paper.reproduce import (
    calibrated_settings,
    check,
    declared_seeds,
    outcomes_of,
    runs_of,
)
from genie_sim.paper.runs import EVERY_METHOD, EvaluationRun, simulate
from genie_sim.paper.sources import SET_UPS
from genie_sim.scenario.reading import load_scenario
from genie_sim.sim import nodes

FITTED = calibrated_settings()
STREET = load_reading("street").settings(FITTED)


def windows_s(*settings, scenario="3car_homo", seed=1):
    cars = EvaluationRun(scenario, seed, settings).load().cars
    return [tuple(t / 1e9 for t in car.route.window_ns) for car in cars]


def test_the_overlap_is_the_share_of_a_route_that_the_car_ahead_drives_too():
    assert windows_s("overlap=0") == [(0.0, 5.2), (5.2, 10.4), (10.4, 15.6)]
    assert len(set(windows_s("overlap=1"))) == 1
    (_, first_end), (second_begin, _), _ = windows_s("overlap=0.4")
    assert (first_end - second_begin) / 5.2 == pytest.approx(0.4)
    assert windows_s("overlap=0.4", "order=reversed") == windows_s("overlap=0.4")[::-1]


def test_one_car_and_three_see_the_same_street_over_the_seeds():
    """Where a car drives on average: in the middle of the street, however many there are."""
    for scenario in ("1car_homo", "2car_homo", "3car_homo"):
        windows = [
            window
            for seed in declared_seeds()
            for window in windows_s("overlap=0.1", scenario=scenario, seed=seed)
        ]
        middles = [sum(window) / 2 for window in windows]
        assert sum(middles) / len(middles) == pytest.approx(7.8, abs=0.6)
        assert all(begin >= 0 and end <= 15.6 + 1e-6 for begin, end in windows)


def test_the_car_without_cameras_drives_behind():
    (seeing, _), (blind, _) = windows_s("overlap=0.4", scenario="case_study")
    assert blind < seeing


def same_but_for_names(one, other):
    return replace(one, name="", description="") == replace(other, name="", description="")


@pytest.mark.parametrize("name", SET_UPS)
def test_the_scenarios_are_what_the_main_reading_says(name):
    reading = load_reading(MAIN)
    said = tuple(setting for choice in reading.choices for setting in choice.settings)
    assert EvaluationRun(name, 1, said).load() == EvaluationRun(name, 1).load()


def test_the_main_reading_plays_the_whole_bag_on_every_board():
    scenario = load_scenario("3car_hetero")
    assert [(car.route.window_ns, car.route.start_ns, car.route.laps) for car in scenario.cars] == [
        (None, index * 1_000_000_000, 2) for index in range(3)
    ]
    genie = scenario.genie
    assert (genie.similarity.name, genie.object_map.location_key) == ("exact", "exact")
    assert (genie.car_learns, genie.share_filter) == ("own", "all")
    blind = load_scenario("case_study").genie
    assert blind.similarity.name == "pose_grid", "a car without cameras has only its position"


@pytest.mark.parametrize("name", SET_UPS)
def test_street_is_the_scenario_of_a_street_with_what_was_fitted(name):
    """So the overlay takes back all that makes the bench."""
    overlaid = EvaluationRun(name, 3, STREET).load()
    assert same_but_for_names(overlaid, EvaluationRun(f"street_{name}", 3, FITTED).load())


def test_two_passes_changes_nothing_else():
    settings = load_reading("two_passes").settings(FITTED)
    base, other = (EvaluationRun("3car_hetero", 1, mine).load() for mine in ((), settings))
    assert (base.genie.passes, other.genie.passes) == (1, 2)
    assert base == replace(other, genie=replace(other.genie, passes=1))


def test_a_link_is_cut_in_mid_run_and_only_there():
    for (variant, _), (run, *_) in runs_of((), [1]).items():
        assert [entry.fault.name for entry in run.load().faults] == ["outage"] * (
            variant == "cut_link"
        )


@pytest.mark.parametrize("setting", ["genie.passses=2", "links=idael", "fleet=3"])
def test_a_reading_that_sets_what_no_scenario_has_is_told_before_anything_runs(setting):
    reading = load_reading("two_passes")
    wrong = replace(reading, choices=(replace(reading.choices[0], settings=(setting,)),))
    with pytest.raises(UserError) as told:
        check(wrong)
    assert str(told.value).startswith(f"{reading.path}: choices[0].set: ")
    assert "\n" not in str(told.value)


@pytest.mark.slow
def test_a_run_is_the_evaluation_s_row_of_its_name_and_seed(monkeypatch):
    """And several seeds of it are its figure: one name, one set-up, one number."""
    monkeypatch.setattr(
        "genie_sim.paper.reproduce.VARIANTS", {"base": (("1car_hetero",), (), EVERY_METHOD)}
    )
    (outcomes,) = outcomes_of([runs_of((), [3, 4])], workers=1)
    of_seeds = [outcome.facts for outcome in outcomes["base", "1car_hetero"]]
    plain = gs.run("1car_hetero", seeds=[3, 4])
    for facts, run in zip(of_seeds, plain.runs, strict=True):
        shared = 0
        for one in run.measured:
            fact = Fact(one.metric, one.method, one.placement, one.component)
            if fact in facts and one.value is not None:
                assert facts[fact] == one.value, fact
                shared += 1
        assert shared > 60
    means = plain.metrics.set_index(["metric", "method", "placement", "component"])
    for fact in (Fact("first_answer_mean"), placed("image_reuse", "edge"), Fact("answered_share")):
        shown = reproduce._metric("", fact, np.array([facts[fact] for facts in of_seeds]))
        for name in ("value", "low", "high"):
            assert shown[name] == rounded(means.loc[tuple(fact), name]), (fact, name)


def test_the_number_of_processes_does_not_change_a_number():
    runs = [
        EvaluationRun(scenario, seed, STREET, ("genie",))
        for scenario in ("1car_homo", "2car_hetero")
        for seed in (1, 2)
    ]
    alone, together = ([repr(one.facts) for one in simulate(runs, n)] for n in (1, 2))
    assert alone == together


def test_what_is_equal_in_several_runs_is_simulated_once(monkeypatch):
    """Local execution has no edges, and neither baseline has a Genie; a run that is shown is
    judged, wherever it stands.
    """
    short = "cars[0].route.window=[0 s, 0.3 s]"
    runs = [
        EvaluationRun("street_1car_homo", 1, (short, "genie.passes=2")),
        EvaluationRun("street_1car_homo", 1, (short,), shown=True),
        EvaluationRun("street_1car_hetero", 1, (short,)),
        EvaluationRun("street_1car_homo", 1, (short, "link=cut"), ("genie",)),
        EvaluationRun("street_1car_homo", 1, (short,), ("remote", "genie")),
    ]
    alone = [run.simulate() for run in runs]
    simulated = []
    run_one = gs.run

    def count(scenario, *, methods, observer):
        simulated.extend(methods)
        return run_one(scenario, methods=methods, observer=observer)

    monkeypatch.setattr("genie_sim.paper.runs.gs.run", count)
    together = simulate(runs, workers=1)
    assert sorted(simulated) == ["genie"] * 4 + ["local"] + ["remote"] * 2
    assert [repr(one.facts) for one in together] == [repr(one.facts) for one in alone]
    assert [list(one.tables) for one in together] == [[], ["frames", "lookups"], [], [], []]


# What an observer sees of a run

SHORT = load_scenario("street_1car_homo", ["cars[0].route.window=[0 s, 0.3 s]"])


@pytest.mark.parametrize("harm", ["nothing", "wraps a method", "changes its topics"])
def test_it_is_seen_when_attaching_a_genie_touches_the_node(harm, monkeypatch):
    attach_genie = nodes.attach

    def attach(graph, name, *arguments, **options):
        node = graph.node(name)
        genie = attach_genie(graph, name, *arguments, **options)
        if harm == "wraps a method":
            node.publish = node.publish
        elif harm == "changes its topics":
            node.subscribes = tuple(f"{topic}-local" for topic in node.subscribes)
        return genie

    monkeypatch.setattr("genie_sim.sim.world.attach", attach)
    found = (
        EvaluationRun("street_1car_homo", 1, ("cars[0].route.window=[0 s, 0.3 s]",))
        .simulate()
        .facts
    )
    assert found[Fact("detector_untouched")] == (harm == "nothing")


def test_a_genie_without_the_nodes_topics_ends_the_run(monkeypatch):
    attach_genie = nodes.attach

    def attach(graph, name, *arguments, **options):
        topics = {topic: topic for of_node in graph.topics_of(name) for topic in of_node}
        genie = attach_genie(graph, name, *arguments, **options)
        graph.remap(name, topics)
        return genie

    monkeypatch.setattr("genie_sim.sim.world.attach", attach)
    with pytest.raises(UserError, match="frames of car1 do not reach its detector"):
        gs.run(SHORT)


class Seen:
    """Notes what it is told."""

    def __init__(self):
        self.told = []

    def before(self, method, world):
        self.told.append((method, "before"))

    def after(self, method, world):
        self.told.append((method, "after"))


def test_an_observer_sees_each_methods_world_and_changes_nothing():
    seen = Seen()
    watched, alone = gs.run(SHORT, observer=seen), gs.run(SHORT)
    assert seen.told == [
        (method, when) for method in ("local", "remote", "genie") for when in ("before", "after")
    ]
    assert watched.metrics.equals(alone.metrics)


@pytest.mark.parametrize("options", [{"jobs": 2}, {"seeds": 2}, {"out": "results"}])
def test_an_observer_is_for_one_run_in_memory(options):
    with pytest.raises(gs.UserError, match="observer: is for one run in memory"):
        gs.run(SHORT, observer=Seen(), **options)


@pytest.mark.parametrize(
    ("server", "devices", "edges"),
    [
        ("one", ["quadro_rtx_4000", "agx_xavier", "agx_xavier"], ["edge1", "edge2", "edge3"]),
        ("all", ["quadro_rtx_4000"] * 3, ["edge1", "edge2", "edge3"]),
        ("shared", ["quadro_rtx_4000"], ["edge1"] * 3),
    ],
)
def test_the_evaluations_powerful_server_is_one_all_or_shared(server, devices, edges):
    scenario = EvaluationRun("street_3car_hetero", 1, (f"server={server}",)).load()
    assert ([edge.device for edge in scenario.edges], [car.edge for car in scenario.cars]) == (
        devices,
        edges,
    )
    alike = EvaluationRun("street_3car_homo", 1, (f"server={server}",)).load()
    assert [edge.device for edge in alike.edges] == ["agx_xavier"] * 3
    with pytest.raises(UserError, match="unknown server 'al'"):
        EvaluationRun("street_3car_homo", 1, ("server=al",)).load()
