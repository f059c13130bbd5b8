"""The runs of an evaluation: what they are, that they are kept, and that a run of their name and
seed has the same numbers.
"""

from __future__ import annotations

import json
import math

import pytest

import genie_sim as gs
from genie_sim.base.errors import UserError
from genie_sim.paper import runs
from genie_sim.paper.numbers import Number
from genie_sim.paper.reproduce import reproduce
from genie_sim.paper.runs import EvaluationRun, planned, simulate
from genie_sim.paper.sources import SET_UPS
from genie_sim.paper.watch import WorldObserver
from genie_sim.scenario.reading import load_scenario
from genie_sim.sim import nodes

SECOND_NS = 1_000_000_000


@pytest.mark.parametrize("name", SET_UPS)
def test_every_board_plays_the_whole_bag_twice_a_second_after_the_one_before(name):
    scenario = load_scenario(name)
    for place, car in enumerate(scenario.cars):
        assert car.route.start_ns == place * SECOND_NS
        assert car.route.laps == 2 and car.route.window_ns is None


def test_the_runs_are_those_of_the_claims_each_with_an_id():
    every = planned([1, 2])
    assert len({run.run_id for run in every}) == len(every) == 2 * (7 + 4 + 1)
    cut = [run for run in every if run.variant == "cut_link"]
    assert [run.scenario.name for run in cut] == ["1car_homo"] * 2
    assert len(cut[0].scenario.faults) == 1
    alone = next(run for run in every if run.variant == "no_edge_sharing")
    assert not alone.scenario.genie.share_requests
    assert alone.scenario.genie.share_answers == "on_request"
    assert [run.run_id for run in planned([1])] == [
        run.run_id for run in every if run.scenario.seed == 1
    ]


def short(name="1car_homo", seed=1) -> EvaluationRun:
    scenario = load_scenario(name, ["cars[0].route.window=[3 s, 3.4 s]"], seed=seed)
    return EvaluationRun(f"{seed:012x}", scenario, f"{name}, seed {seed}")


def test_finished_runs_are_not_run_again_and_lost_curves_are(tmp_path, monkeypatch):
    pair = [short(seed=1), short(seed=2)]
    first, drawn = simulate(pair, tmp_path, workers=1)
    assert {*first["seed"]} == {1, 2} and drawn
    made = []

    def counted(scenario, **options):
        made.append(scenario.seed)
        return run_in_memory(scenario, **options)

    run_in_memory = runs.run_in_memory
    monkeypatch.setattr(runs, "run_in_memory", counted)
    again, _ = simulate(pair, tmp_path, workers=1)
    assert made == []
    assert first.equals(again)
    pair[1].curves(tmp_path).write_bytes(b"damaged")
    simulate([*pair, short(seed=3)], tmp_path, workers=1)
    assert sorted(made) == [2, 3]


def test_an_interrupted_evaluation_goes_on_and_leaves_no_result(tmp_path, monkeypatch):
    def interrupt(done, of, what):
        if done == 1:
            raise KeyboardInterrupt

    monkeypatch.setattr(runs, "planned", lambda seeds: [short(seed=1), short(seed=2)])
    with pytest.raises(KeyboardInterrupt):
        reproduce(tmp_path / "out", seeds=2, workers=1, progress=interrupt)
    assert [path.name for path in tmp_path.iterdir()] == ["out.runs"]
    assert len([*(tmp_path / "out.runs" / "parts").glob("*.json")]) == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["1car_hetero", pytest.param("case_study", marks=pytest.mark.nightly)]
)
def test_a_run_has_every_number_of_the_evaluation_s_row(name, tmp_path):
    """``run NAME --seed 3`` in every metric."""
    chosen = [run for run in planned([3]) if run.scenario.name == name and run.variant == "base"]
    table, _ = simulate(chosen, tmp_path, workers=1)
    row = {Number(*map(str, of[3:7])): of[7] for of in table.itertuples(index=False)}
    measured = gs.run(name, seed=3).measured
    assert len(measured) > 60
    for metric in measured:
        of = Number(metric.metric, metric.method, metric.placement, metric.component)
        value = math.nan if metric.value is None else metric.value
        assert json.dumps(row[of]) == json.dumps(float(value)), of


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
    observer = WorldObserver(SHORT.genie)
    gs.run(SHORT, observer=observer)
    assert observer.numbers()[Number("detector_untouched")] == (harm == "nothing")


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


def test_an_observer_is_for_a_run_in_memory():
    with pytest.raises(gs.UserError, match="observer: "):
        gs.run(SHORT, observer=Seen(), out="results")
