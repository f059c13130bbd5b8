"""Run-time probes for facts that no table records: what Genies share and store, and whether
detectors are left as they are.
"""

import math
from typing import TYPE_CHECKING

from genie_sim.core.messages import Detections, Message
from genie_sim.core.node import GenieNode
from genie_sim.core.thresholds import RANGE_60
from genie_sim.paper.facts import Fact, Facts, placed
from genie_sim.sim.method import OBJECTS, REMOTE
from genie_sim.sim.nodes import DetectorNode, InterceptorNode
from genie_sim.sim.ros_graph import Subscriber

if TYPE_CHECKING:
    from genie_sim.core.rules import GenieRules
    from genie_sim.sim.world import World


class WorldObserver(Subscriber):
    """Watches the worlds of one run, method by method (``runs.simulate.Observer``).

    Counts the objects that Genies share under C_T, those below it apart. Where a scenario says so,
    C_T is not for what edges send each other, and not for what a car's own node finds.
    """

    def __init__(self, rules: "GenieRules") -> None:
        self.address = "claims"
        self._rules = rules
        threshold = (
            RANGE_60 if rules.object_map.threshold == "range_60" else rules.object_map.threshold
        )
        # None: a threshold that moves, below which nothing can be counted from outside
        self._threshold = threshold if isinstance(threshold, float) else None
        self._shared = self._unconfident = 0
        self._stored: dict[str, list[float]] = {"car": [], "edge": []}
        self._detectors: dict[str, set[tuple[object, ...]]] = {}
        self._behind_genie = True

    def before(self, method: str, world: "World") -> None:
        """Looks at the nodes of a world that is about to run, and listens to its Genies."""
        for node in world.network.resources:
            if isinstance(node, DetectorNode):
                self._detectors.setdefault(node.name, set()).add(_fingerprint(node))
                if method == "genie":
                    self._behind_genie &= node.graph.topics_of(node.name) != (
                        node.subscribes,
                        node.publishes,
                    )
            if isinstance(node, InterceptorNode):
                if node.host.name in world.edges or self._rules.fresh_objects == "confident":
                    node.graph.subscribe(OBJECTS, self)
                if self._rules.share_filter == "confident":
                    node.graph.subscribe(OBJECTS + REMOTE, self)

    def deliver(self, topic: str, message: Message, sender: str) -> None:
        """Of the graph: what a Genie published."""
        assert isinstance(message, Detections)
        objects, threshold = message.objects, self._threshold
        self._shared += len(objects)
        if threshold is not None:  # no sum of a generator: this runs for each object that is shared
            for detection in objects:
                if detection.confidence < threshold:
                    self._unconfident += 1

    def after(self, method: str, world: "World") -> None:
        """Looks at the maps of a world that has run."""
        for node in world.network.resources:
            if isinstance(node, InterceptorNode) and isinstance(node.pure, GenieNode):
                placement = "edge" if node.host.name in world.edges else "car"
                self._stored[placement] += [stored.confidence for stored in node.pure.object_map]

    def facts(self) -> Facts:
        """Of all worlds together."""
        same = all(len(fingerprints) == 1 for fingerprints in self._detectors.values())
        facts = {
            Fact("detector_untouched"): float(same and self._behind_genie),
            Fact("objects_shared"): float(self._shared),
            Fact("unconfident_objects_shared"): (
                math.nan if self._threshold is None else float(self._unconfident)
            ),
        }
        for placement, confidences in self._stored.items():
            mean = sum(confidences) / len(confidences) if confidences else math.nan
            facts[placed("stored_confidence", placement)] = mean
        return facts


def _fingerprint(node: DetectorNode) -> tuple[object, ...]:
    """The node itself, whatever the master calls its topics: its class, what it has of its own,
    such as a method that was exchanged, and what of that is plain.
    """
    own = vars(node)
    plain = [(name, own[name]) for name in own if isinstance(own[name], str | int | tuple | None)]
    return (type(node), tuple(own), tuple(sorted(plain)))
