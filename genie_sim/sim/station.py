"""What a method puts on a host: the seam between the world and the schemes that are compared in it.

A method says, for every car and every edge, whether a detector runs there, what pure node stands before it, and which
topics are joined to whom. The world builds that, in the same way for every method.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from genie_sim.core.freshness.laws import DetectorLaws
from genie_sim.core.rules import GenieRules
from genie_sim.messages import Effect, Message, Observation

IMAGES = "/image_raw"
OBJECTS = "/detection/image_detector/objects"
DETECTOR = "vision_darknet_detect"


class Interceptor(Protocol):
    """A pure node, such as a Genie: messages in, effects out. It has no clock and no middleware of its own.

    A class that inherits from this one has no deadlines, and nothing to lose, unless it says so.
    """

    name: str

    def subscriptions(self) -> tuple[str, ...]: ...

    def publications(self) -> tuple[str, ...]: ...

    def on_message(
        self, topic: str, message: Message, now_ns: int, sender: str | None = None
    ) -> list[Effect]: ...

    def next_deadline_ns(self) -> int | None:
        """When ``on_deadline`` wants to be called, if no message comes before."""
        return None

    def on_deadline(self, now_ns: int) -> list[Effect]:
        """The time has come."""
        return []

    def cache_entries(self) -> int:
        """How many answers its cache holds, where each of them takes its time (``Station.per_entry_ns``)."""
        return 0

    def on_void(self) -> Sequence[Observation]:
        """A fault takes its state: each request that it owes an answer is ``Expired``, its objects ``Forgotten``."""
        return ()


MakeInterceptor = Callable[
    [tuple[str, ...], tuple[str, ...]], Interceptor
]  # from T_S and T_P of the node behind it


@dataclass(frozen=True)
class Place:
    """What a method is told about a host.

    ``sees``: pictures come here, from the host's own cameras or from cars; else only positions do. ``joined``: the car
    has an edge. ``genie`` are the rules of Genies here, ``None`` where the scenario wants none. ``stream`` gives a
    random generator by names, the same for this host under every method. ``records_changes``: whether observations are
    to name the objects of a map that changed. ``laws`` are those of the detectors. ``edges`` are all edges, in order,
    ``neighbours`` those that an edge is joined to.
    """

    name: str
    sees: bool
    joined: bool
    genie: GenieRules | None
    stream: Callable[..., np.random.Generator]
    records_changes: bool
    laws: DetectorLaws
    edges: tuple[str, ...]
    neighbours: Sequence[str] = ()


class Uplink(NamedTuple):
    """What goes up from a car to its edge's images, and the topic on which the edge's answers come down."""

    up: str
    down: str


@dataclass(frozen=True)
class Station:
    """What stands on a host. ``interceptor`` takes over the topics of the detector, or its names where none runs.

    ``uplink`` joins a car to its edge. ``hears`` are the topics of neighbouring edges that reach this edge. ``key``
    names the feature that the interceptor makes of every picture, which takes its time here; whoever gets the picture
    from it gets the key, too. To look the key up takes ``per_entry_ns`` of CPU time for each entry of the cache.
    ``free``: what the interceptor does takes no time, as that of a bound may.
    """

    detector: bool = False
    interceptor: MakeInterceptor | None = None
    uplink: Uplink | None = None
    hears: tuple[str, ...] = ()
    key: str | None = None
    free: bool = False
    per_entry_ns: int = 0


class Method:
    """A scheme that answers the cars' frames. ``baseline``: others are compared with it.

    A class that inherits from this one is no baseline and has a detector on every edge that gets pictures, unless it
    says so.
    """

    title: str
    baseline = False

    def on_car(self, place: Place) -> Station | None:
        """What stands on a car; ``None`` where nothing would answer it, and it stays at home."""
        raise NotImplementedError

    def on_edge(self, place: Place) -> Station:
        """What stands on an edge server."""
        return Station(detector=place.sees)
