"""A Genie out of its rules. The simulator and real ROS build theirs here."""

import functools
from dataclasses import replace
from numbers import Real
from typing import Any

from genie_sim import plugins
from genie_sim.core.confidence import CONFIDENCE_RULES, ConfidenceRule
from genie_sim.core.eviction import EVICTIONS
from genie_sim.core.freshness import FRESHNESS, MUST_HAVE
from genie_sim.core.freshness.laws import ASSUMED, DetectorLaws
from genie_sim.core.freshness.never import Never
from genie_sim.core.maps import Map
from genie_sim.core.message_cache import MessageCache, PendingIndex
from genie_sim.core.node import GenieNode
from genie_sim.core.object_map import ObjectMap
from genie_sim.core.rules import GenieRules, MissPolicy
from genie_sim.core.similarity import SIMILARITIES
from genie_sim.core.track_map import TrackMap
from genie_sim.errors import UserError, short_repr
from genie_sim.messages import Detections, Header

SIMILARITY_METHODS = ("key", "index")
EVICTION_METHODS = ("stored", "used", "removed", "victim", "expires_ns")


def make_genie(
    rules: GenieRules,
    name: str,
    subscribed: tuple[str, ...],
    published: tuple[str, ...],
    *,
    on_edge: bool,
    alone: bool = False,
    miss_policy: MissPolicy | None = None,
    laws: DetectorLaws = ASSUMED,
    **middleware: Any,
) -> GenieNode:
    """The Genie called ``name`` for a node with the topics T_S and T_P.

    On an edge it serves other Genies, so it answers when it has an answer, and shares what its node finds; on a car it
    serves the consumer by the miss policy and sends only its misses up. ``alone``: nobody listens to ``-remote``.
    ``miss_policy`` overrules all that. ``laws`` are those of the detectors. ``middleware`` replaces what depends on it
    (see ``GenieNode``). Raises ``UserError`` where a plug-in of the user's own does not work.
    """
    similarity = plugins.make("similarity", rules.similarity, SIMILARITIES, SIMILARITY_METHODS)
    new_eviction = plugins.resolve("eviction", rules.eviction, EVICTIONS, EVICTION_METHODS)
    capacity = rules.capacity if on_edge or rules.car_capacity is None else rules.car_capacity

    def new_cache() -> MessageCache:
        ttl = () if rules.ttl_ns is None else (rules.ttl_ns,)
        eviction = plugins.call("eviction", rules.eviction, new_eviction, *ttl)
        return MessageCache(similarity.index(), eviction, capacity)

    if miss_policy is None:
        miss_policy = "blocking" if on_edge and rules.algorithm != "literal" else rules.miss_policy
    mine = replace(
        rules,
        share_answers=rules.share_answers if on_edge else "on_request",
        share_requests=rules.share_requests if on_edge else not alone,
        share_filter=rules.share_filter if on_edge else "confident",
        car_learns="all" if on_edge else rules.car_learns,
        miss_policy=miss_policy,
    )
    parts: dict[str, Any] = {
        "key": similarity.key,
        "new_cache": new_cache,
        "pending": PendingIndex(
            _stamp if rules.header_identity == "stamp" else None, similarity.index
        ),
        "object_map": _object_map(rules, laws, on_edge),
        "map_answer": Detections,
    }
    return GenieNode(name, subscribed, published, mine, **(parts | middleware))


def _object_map(rules: GenieRules, laws: DetectorLaws, on_edge: bool) -> Map:
    """The map that the freshness policy wants. Raises ``UserError``."""
    choice, rule = rules.object_map.freshness, confidence_rule(rules.object_map.rule)
    policy: Never = plugins.make("freshness policy", choice, FRESHNESS, MUST_HAVE)
    if not policy.tracks:
        return ObjectMap(rules.object_map, rules.view_range_m, rule, policy)
    policy.laws = laws
    return TrackMap(
        rules.object_map, policy, rule, "look" if on_edge else "map", rules.view_range_m
    )


def confidence_rule(name: str) -> ConfidenceRule:
    """A confidence rule by name. One of the user's own ends the run with one line if what it returns is no confidence.

    Raises ``UserError``."""
    own = plugins.resolve("confidence rule", name, CONFIDENCE_RULES)
    if name in CONFIDENCE_RULES:
        rule: ConfidenceRule = own
        return rule

    @functools.wraps(own)
    def checked(before: float, seen: float, rate: float) -> float:
        try:
            confidence = own(before, seen, rate)
        except Exception as error:
            raise UserError(f"confidence rule {name!r}: {type(error).__name__}: {error}") from error
        if (
            isinstance(confidence, Real)
            and not isinstance(confidence, bool)
            and 0 <= float(confidence) <= 1
        ):
            return float(confidence)
        given = f"{before:g}, {seen:g}, {rate:g}"
        made = short_repr(confidence)
        raise UserError(
            f"confidence rule {name!r}: of {given} it makes {made}, no number from 0 to 1"
        )

    checked(0.5, 0.5, 0.1)
    return checked


def chosen_plugins(rules: GenieRules) -> tuple[tuple[str, str], ...]:
    """What the rules choose by name: the kind of plug-in, and the name."""
    return (
        ("similarity", rules.similarity.name),
        ("eviction", rules.eviction),
        ("confidence rule", rules.object_map.rule),
        ("freshness policy", rules.object_map.freshness.name),
    )


def _stamp(header: Header) -> int:
    return header.stamp_ns
