"""What methods with similarity caches share: where the caches run, and how they are set up."""

import math
from functools import partial

from genie_sim.core.node import GenieNode
from genie_sim.core.rules import Capacity
from genie_sim.methods.nearest import Nearest, key_of
from genie_sim.methods.similarity_cache import Replay, SimilarityCache, cache_node
from genie_sim.sim.method import (
    LOCAL,
    REMOTE,
    REMOTE_UPLINK,
    HostConfig,
    HostContext,
    Interceptor,
    Method,
)


def as_share(name: str, value: float) -> float:
    """``value`` if it is from 0 to 1. Raises ``ValueError``."""
    if not 0 <= value <= 1:
        raise ValueError(f"{name}: must be from 0 to 1, but is {value:g}")
    return value


def at_least(name: str, value: float, minimum: float) -> float:
    """``value`` if it is a finite number, at least ``minimum``. Raises ``ValueError``."""
    if not minimum <= value < math.inf:
        raise ValueError(f"{name}: must be at least {minimum:g}, but is {value:g}")
    return value


class SimilarityCaching(Method):
    """A cache before every detector, on cars and edges alike; cars upload what they miss, edges
    share nothing.

    ``feature`` names the images' vectors. The car computes them and sends them along with the
    image. A subclass makes the caches: ``cache``.
    """

    title = "similarity cache"
    feature = "hsv"
    replay: Replay = "camera"

    def cache(self, host: HostContext, capacity: Capacity | None) -> SimilarityCache:
        """An empty cache for a host."""
        raise NotImplementedError

    def on_car(self, host: HostContext) -> HostConfig | None:
        if not host.gets_images:
            return None  # there are no images to compare
        if host.genie is None:
            return HostConfig(detector=True)
        return HostConfig(
            detector=True,
            interceptor=partial(self._node, host, on_edge=False, forwards_misses=host.has_edge),
            uplink=REMOTE_UPLINK if host.has_edge else None,
            key=self.feature,
        )

    def on_edge(self, host: HostContext) -> HostConfig:
        if not host.gets_images:
            return HostConfig()
        node = partial(self._node, host, on_edge=True, forwards_misses=False)
        return HostConfig(detector=True, interceptor=node)

    def _node(
        self,
        host: HostContext,
        subscribed: tuple[str, ...],
        published: tuple[str, ...],
        *,
        on_edge: bool,
        forwards_misses: bool,
    ) -> GenieNode:
        """A node with a new cache; ``forwards_misses``: they go to ``-remote``, too."""
        rules = host.genie
        assert rules is not None
        own_capacity = not on_edge and rules.car_capacity is not None
        cache = self.cache(host, rules.car_capacity if own_capacity else rules.capacity)
        return cache_node(
            rules,
            f"{host.name}/cache",
            subscribed,
            published,
            key=key_of(self.feature),
            new_cache=lambda: cache,
            pending=lambda: Nearest(lambda: cache.reach),
            share_requests=forwards_misses,
        )


class LocalAndRemote(Interceptor):
    """The base of a car's interceptor that sends images to the car's own detector or up to the
    edge, and gets answers from both.

    Parameters
    ----------
    name : str
        Of the node, such as ``car1/router``.
    subscribed, published : tuple of str
        T_S and T_P of the car's detector: one topic each.
    """

    def __init__(self, name: str, subscribed: tuple[str, ...], published: tuple[str, ...]) -> None:
        self.name = name
        (self._images,) = subscribed
        (self._objects,) = published

    def subscriptions(self) -> tuple[str, ...]:
        return self._images, self._objects + LOCAL, self._objects + REMOTE

    def publications(self) -> tuple[str, ...]:
        return self._objects, self._images + LOCAL, self._images + REMOTE
