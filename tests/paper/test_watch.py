"""What no table tells of a run, on worlds of a few nodes made by hand."""

from __future__ import annotations

import dataclasses
import math
from types import SimpleNamespace

import pytest

from genie_sim.core.messages import Header
from genie_sim.core.rules import GenieRules, Percentile
from genie_sim.core.thresholds import threshold_of
from genie_sim.paper.watch import DETECTOR, OBJECTS, WorldObserver
from genie_sim.sim.method import DETECTOR as NODE
from genie_sim.sim.method import OBJECTS as TOPIC
from tests import make

RULES = GenieRules()


def by_text(numbers):
    """The numbers by their metric, and by their placement where they have one."""
    return {
        of.metric if of.placement == "all" else f"{of.metric}:{of.placement}": value
        for of, value in numbers.items()
    }


class Map(list):
    """Objects with these confidences, and a C_T."""

    def __init__(self, confidences, threshold):
        super().__init__(SimpleNamespace(confidence=one) for one in confidences)
        self.threshold = threshold


class Graph:
    """Keeps who listens to what, and what the master calls the topics of its nodes."""

    def __init__(self, name, *nodes, topics=(("/image_raw",), ("/objects",))):
        self.name = name
        self.nodes = nodes
        self.heard = []
        self.topics = topics

    def subscribe(self, topic, node):
        self.heard.append(topic)

    def topics_of(self, name):
        return self.topics


def detector(host="edge1", topics=(("/image_raw-local",), ("/objects-local",)), **has):
    node = SimpleNamespace(
        name=f"{host}{DETECTOR}", subscribes=("/image_raw",), publishes=("/objects",)
    )
    vars(node).update(has)
    return Graph(host, node, topics=topics)


def genie(host, *confidences, threshold=0.6):
    pure = SimpleNamespace(object_map=Map(confidences, threshold))
    return Graph(host, SimpleNamespace(name=f"{host}/genie", pure=pure))


def world(*graphs):
    network = SimpleNamespace(graphs=dict(enumerate(graphs)))
    return SimpleNamespace(network=network, edges={"edge1": None, "edge2": None})


def answer(*confidences):
    objects = (make.seen(None, score=one) for one in confidences)
    return make.answer(Header(1, "camera_02", "car1"), *objects)


def watched(*worlds, rules=RULES, heard=()):
    """The numbers of the worlds of some methods."""
    observer = WorldObserver(rules)
    for method, one in worlds:
        observer.before(method, one)
        observer.after(method, one)
    for message in heard:
        observer.deliver("/objects", message, "edge1/genie")
    return by_text(observer.numbers())


def test_nodes_and_topics_are_called_so():
    assert (f"/{NODE}", TOPIC) == (DETECTOR, OBJECTS)


def test_stored_confidence_is_the_mean_over_the_objects_of_cars_and_of_edges():
    nodes = [genie("car1", 0.2, 0.4), genie("car2", 0.9), genie("edge1", 0.6, 0.8), genie("edge2")]
    facts = watched(("genie", world(*nodes)))
    assert facts["stored_confidence:car"] == pytest.approx(0.5)
    assert facts["stored_confidence:edge"] == pytest.approx(0.7)
    assert math.isnan(watched(("genie", world(genie("car1", 0.5))))["stored_confidence:edge"])


def with_threshold(threshold, *heard):
    """What is told of objects that are shared under this C_T."""
    rules = dataclasses.replace(
        RULES, object_map=dataclasses.replace(RULES.object_map, threshold=threshold)
    )
    one = genie("edge1", threshold=threshold_of(threshold).value)
    facts = watched(("genie", world(one)), rules=rules, heard=heard)
    return facts["objects_shared"], facts["unconfident_objects_shared"]


def test_shared_objects_are_counted_those_below_c_t_apart():
    assert with_threshold(0.6, answer(0.6, 0.59, 0.9), answer(0.1), answer()) == (4, 2)


def test_below_a_c_t_that_moves_nothing_is_counted_and_that_is_no_zero():
    shared, unconfident = with_threshold(Percentile(60.0), answer(0.1, 0.9))
    assert shared == 2 and math.isnan(unconfident)


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
    assert node.heard == topics


def test_a_detector_is_the_same_with_and_without_a_genie_and_its_topics_are_not():
    alone = detector(topics=(("/image_raw",), ("/objects",)))
    assert (
        watched(("remote", world(alone)), ("genie", world(detector())))["detector_untouched"] == 1
    )
    assert watched(("genie", world(alone)))["detector_untouched"] == 0, "the Genie is not before it"
    two = world(alone, detector("car1"))
    assert watched(("genie", two))["detector_untouched"] == 0, "nor before each of two"
    for harm in ({"publish": print}, {"subscribes": ("/image_raw-local",)}):
        facts = watched(("remote", world(detector())), ("genie", world(detector(**harm))))
        assert facts["detector_untouched"] == 0, harm
