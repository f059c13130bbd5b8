"""The runs of an evaluation: what the words of its settings make of a scenario, and what comes
out.
"""

from __future__ import annotations

from dataclasses import replace

import pytest

import genie_sim as gs
from genie_sim.base.errors import UserError
from genie_sim.core.rules import GenieRules
from genie_sim.paper.definitions import USUAL, Definitions
from genie_sim.paper.facts import Fact
from genie_sim.paper.readings import load_reading
from genie_sim.paper.reproduce import calibrated_settings, check, declared_seeds, runs_of
from genie_sim.paper.runs import EvaluationRun, simulate
from genie_sim.scenario.reading import load_scenario
from genie_sim.sim import nodes

BASE = calibrated_settings()
OTHER = Definitions(boost="per_object")


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


def test_bench_plays_the_whole_bag_on_every_board_a_second_apart():
    settings = load_reading("bench").settings(BASE)
    scenario = EvaluationRun("3car_hetero", 1, settings).load()
    assert [(car.route.window_ns, car.route.start_ns, car.route.laps) for car in scenario.cars] == [
        (None, index * 1_000_000_000, 2) for index in range(3)
    ]
    genie = scenario.genie
    assert (genie.similarity.name, genie.object_map.location_key) == ("exact", "exact")
    assert (genie.car_learns, genie.share_filter) == ("own", "all")
    blind = EvaluationRun("case_study", 1, settings).load().genie
    assert blind.similarity.name == "pose_grid", "a car without cameras has only its position"


def test_two_passes_changes_nothing_else():
    settings = [load_reading(name).settings(BASE) for name in ("default", "two_passes")]
    base, other = (EvaluationRun("3car_hetero", 1, mine).load() for mine in settings)
    assert (base.genie.passes, other.genie.passes) == (1, 2)
    assert replace(base, genie=GenieRules()) == replace(other, genie=GenieRules())


def test_a_link_is_cut_in_mid_run_and_only_there():
    for (variant, _), (run, *_) in runs_of(BASE, [1]).items():
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


def test_a_run_is_simulated_once_and_judged_under_each_of_its_definitions():
    run = EvaluationRun("1car_homo", 1, BASE, ("genie",), definitions=(USUAL, OTHER))
    outcome = run.simulate()
    usual, other = (outcome.facts[definitions] for definitions in (USUAL, OTHER))
    different = {fact.metric for fact in usual if repr(usual[fact]) != repr(other[fact])}
    assert different == {"confidence_boost"}
    assert not outcome.tables, "no figure shows it"


def test_it_is_the_run_of_the_public_interface():
    """Whoever writes the evaluation's settings down gets its numbers."""
    run = EvaluationRun("1car_hetero", 3, BASE)
    found, plain = run.facts(), gs.run(run.load())
    metrics = plain.metrics.query("method == 'genie'").set_index(["metric", "placement"])["value"]
    for metric, placement in (
        ("first_answer_mean", "all"),
        ("image_reuse", "car"),
        ("object_reuse", "edge"),
        ("confidence_boost", "edge"),
    ):
        assert found[Fact(metric, placement=placement)] == metrics[metric, placement], metric


def test_the_number_of_processes_does_not_change_a_number():
    runs = [
        EvaluationRun(scenario, seed, BASE, ("genie",))
        for scenario in ("1car_homo", "2car_hetero")
        for seed in (1, 2)
    ]
    alone, together = ([repr(one.facts) for one in simulate(runs, n)] for n in (1, 2))
    assert alone == together


# What an observer sees of a run

SHORT = load_scenario("1car_homo", ["cars[0].route.window=[0 s, 0.3 s]"])


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
    found = EvaluationRun("1car_homo", 1, ("cars[0].route.window=[0 s, 0.3 s]",)).facts()
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


@pytest.mark.parametrize("options", [{"workers": 2}, {"seeds": 2}, {"out": "results"}])
def test_an_observer_is_for_one_run_in_memory(options):
    with pytest.raises(gs.UserError, match="observer: is for one run in memory"):
        gs.run(SHORT, observer=Seen(), **options)
