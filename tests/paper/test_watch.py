"""What no table tells of a run, on worlds of a few nodes made by hand."""

from __future__ import annotations

import dataclasses
import math
from types import SimpleNamespace

import pytest

from genie_sim.core.messages import Detection, Detections, Header
from genie_sim.core.node import GenieNode
from genie_sim.core.rules import GenieRules
from genie_sim.paper.watch import WorldObserver
from genie_sim.sim.nodes import DetectorNode, InterceptorNode

# Stand-ins are made of the simulator's classes without what these need to run.

RULES = GenieRules()


def by_text(facts):
    """The facts by their metric, and by their placement where they have one."""
    return {
        fact.metric if fact.placement == "all" else f"{fact.metric}:{fact.placement}": value
        for fact, value in facts.items()
    }


class Graph:
    """Keeps who listens to what, and what the master calls the topics of each node."""

    def __init__(self, topics=(("/image_raw",), ("/objects",))):
        self.heard = []
        self.topics = topics

    def subscribe(self, topic, node):
        self.heard.append(topic)

    def topics_of(self, name):
        return self.topics


def made(kind, **has):
    node = object.__new__(kind)
    node.__dict__.update(has)
    return node


def detector(name="edge1/detector", topics=(("/image_raw-local",), ("/objects-local",)), **has):
    return made(
        DetectorNode,
        name=name,
        subscribes=("/image_raw",),
        publishes=("/objects",),
        graph=Graph(topics),
        **has,
    )


def genie(host, *confidences):
    pure = made(GenieNode, object_map=[SimpleNamespace(confidence=one) for one in confidences])
    return made(InterceptorNode, host=SimpleNamespace(name=host), pure=pure, graph=Graph())


def world(*nodes):
    network = SimpleNamespace(resources=nodes)
    return SimpleNamespace(network=network, edges={"edge1": None, "edge2": None})


def answer(*confidences):
    objects = tuple(Detection("car", one, None, None, one) for one in confidences)
    return Detections(Header(1, "camera_02", "car1"), objects)


def watched(*worlds, rules=RULES):
    watch = WorldObserver(rules)
    for method, one in worlds:
        watch.before(method, one)
        watch.after(method, one)
    return by_text(watch.facts())


def test_stored_confidence_is_the_mean_over_the_objects_of_cars_and_of_edges():
    nodes = [genie("car1", 0.2, 0.4), genie("car2", 0.9), genie("edge1", 0.6, 0.8), genie("edge2")]
    facts = watched(("genie", world(*nodes)))
    assert facts["stored_confidence:car"] == pytest.approx(0.5)
    assert facts["stored_confidence:edge"] == pytest.approx(0.7)
    assert math.isnan(watched(("genie", world(genie("car1", 0.5))))["stored_confidence:edge"])


def test_shared_objects_are_counted_those_below_c_t_apart():
    watch = WorldObserver(RULES)
    assert RULES.object_map.threshold == 0.6
    watch.deliver("/objects", answer(0.6, 0.59, 0.9), "edge1/genie")
    watch.deliver("/objects-remote", answer(0.1), "edge1/genie")
    watch.deliver("/objects", answer(), "edge1/genie")
    facts = by_text(watch.facts())
    assert (facts["objects_shared"], facts["unconfident_objects_shared"]) == (4, 2)


def test_a_c_t_by_its_word_is_known():
    maps = dataclasses.replace(RULES.object_map, threshold="range_60")
    watch = WorldObserver(dataclasses.replace(RULES, object_map=maps))
    watch.deliver("/objects", answer(0.71, 0.73), "edge1/genie")
    assert by_text(watch.facts())["unconfident_objects_shared"] == 1


def test_below_a_c_t_that_moves_nothing_is_counted_and_that_is_no_zero():
    maps = dataclasses.replace(RULES.object_map, threshold="cell_60")
    observer = WorldObserver(dataclasses.replace(RULES, object_map=maps))
    observer.deliver("/objects", answer(0.1, 0.9), "edge1/genie")
    facts = by_text(observer.facts())
    assert facts["objects_shared"] == 2 and math.isnan(facts["unconfident_objects_shared"])


@pytest.mark.parametrize(
    ("changed", "host", "topics"),
    [
        (
            {},
            "car1",
            ["/detection/image_detector/objects", "/detection/image_detector/objects-remote"],
        ),
        ({"fresh_objects": "all"}, "car1", ["/detection/image_detector/objects-remote"]),
        (
            {"fresh_objects": "all"},
            "edge1",
            ["/detection/image_detector/objects", "/detection/image_detector/objects-remote"],
        ),
        ({"share_filter": "all"}, "edge1", ["/detection/image_detector/objects"]),
    ],
)
def test_it_listens_to_all_that_c_t_is_for(changed, host, topics):
    node = genie(host)
    WorldObserver(dataclasses.replace(RULES, **changed)).before("genie", world(node))
    assert node.graph.heard == topics


def test_a_detector_is_the_same_with_and_without_a_genie_and_its_topics_are_not():
    alone = detector(topics=(("/image_raw",), ("/objects",)))
    assert (
        watched(("remote", world(alone)), ("genie", world(detector())))["detector_untouched"] == 1
    )
    assert watched(("genie", world(alone)))["detector_untouched"] == 0, "the Genie is not before it"
    two = world(alone, detector("car1/detector"))
    assert watched(("genie", two))["detector_untouched"] == 0, "nor before each of two"
    for harm in ({"publish": print}, {"subscribes": ("/image_raw-local",)}):
        other = detector()
        other.__dict__.update(harm)
        facts = watched(("remote", world(detector())), ("genie", world(other)))
        assert facts["detector_untouched"] == 0, harm
