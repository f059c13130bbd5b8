"""Run-time probes for numbers that no table records: what Genies share and store, and whether
detectors are left as they are.
"""

import math
from typing import Any

from genie_sim.paper.numbers import Number, Numbers, placed

# How names of nodes end, and the topic of what is found.
GENIE, DETECTOR = "/genie", "/vision_darknet_detect"
OBJECTS = "/detection/image_detector/objects"


class WorldObserver:
    """Watches the worlds of all methods of a run (``observer`` of ``gs.run``).

    Counts the objects that Genies share under C_T, those below it apart. Where a scenario says so,
    C_T is not for what edges send each other, and not for what a car's own node finds.

    Parameters
    ----------
    rules : GenieRules
        The scenario's settings of Genies.
    """

    address = "claims"  # as a subscriber

    def __init__(self, rules: Any) -> None:
        self._rules = rules
        threshold = rules.object_map.threshold
        self.is_fixed = isinstance(threshold, float)
        # None: a threshold that moves, below which nothing can be counted from outside
        self._threshold: float | None = None
        self.shared = self.unconfident = 0
        self.stored: dict[str, list[float]] = {"car": [], "edge": []}
        self.detectors: set[tuple[str, tuple[object, ...]]] = set()
        self.behind_genie = True

    def before(self, method: str, world: Any) -> None:
        """Looks at the nodes of a world that is about to run, and listens to its Genies."""
        for graph in world.network.graphs.values():
            for node in graph.nodes:
                if node.name.endswith(DETECTOR):
                    self.detectors.add((node.name, _fingerprint(node)))
                    if method == "genie":
                        topics = node.subscribes, node.publishes
                        self.behind_genie &= graph.topics_of(node.name) != topics
                elif node.name.endswith(GENIE):
                    if self.is_fixed:
                        self._threshold = node.pure.object_map.threshold
                    if graph.name in world.edges or self._rules.fresh_objects == "confident":
                        graph.subscribe(OBJECTS, self)
                    if self._rules.share_filter == "confident":
                        graph.subscribe(f"{OBJECTS}-remote", self)

    def deliver(self, topic: str, message: Any, sender: str) -> None:
        """Of the graph: what a Genie published."""
        threshold = self._threshold
        self.shared += len(message.objects)
        if threshold is not None:  # no sum of a generator: this runs for each object that is shared
            for detection in message.objects:
                if detection.confidence < threshold:
                    self.unconfident += 1

    def after(self, method: str, world: Any) -> None:
        """Looks at the maps of a world that has run."""
        for graph in world.network.graphs.values():
            placement = "edge" if graph.name in world.edges else "car"
            for node in graph.nodes:
                if node.name.endswith(GENIE):
                    objects = node.pure.object_map
                    self.stored[placement] += [stored.confidence for stored in objects]

    def numbers(self) -> Numbers:
        """What was seen in all worlds together."""
        is_untouched = len(self.detectors) == len({name for name, _ in self.detectors})
        numbers = {
            Number("detector_untouched"): float(is_untouched and self.behind_genie),
            Number("objects_shared"): float(self.shared),
            Number("unconfident_objects_shared"): (
                float(self.unconfident) if self.is_fixed else math.nan
            ),
        }
        for placement, confidences in self.stored.items():
            mean = math.fsum(confidences) / len(confidences) if confidences else math.nan
            numbers[placed("stored_confidence", placement)] = mean
        return numbers


def _fingerprint(node: Any) -> tuple[object, ...]:
    """The node itself, whatever the master calls its topics: its class, what it has of its own,
    such as a method that was exchanged, and what of that is plain.
    """
    attributes = vars(node)
    plain = [
        (name, attributes[name])
        for name in attributes
        if isinstance(attributes[name], str | int | tuple | None)
    ]
    return (type(node), tuple(attributes), tuple(sorted(plain)))
