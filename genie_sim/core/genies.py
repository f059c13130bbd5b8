"""A Genie out of its rules. The simulator and real ROS build theirs here."""

import functools
from dataclasses import replace
from numbers import Real
from typing import Any, Literal

from genie_sim.base import plugins
from genie_sim.base.errors import UserError, short_repr
from genie_sim.core.confidence import CONFIDENCE_RULES, ConfidenceRule
from genie_sim.core.freshness.laws import ASSUMED, DetectorLaws
from genie_sim.core.freshness.never import Never
from genie_sim.core.maps import Map
from genie_sim.core.message_cache import MessageCache
from genie_sim.core.messages import Detections
from genie_sim.core.node import GenieNode
from genie_sim.core.object_map import ObjectMap
from genie_sim.core.per_topic import PerTopicGenie
from genie_sim.core.readings import pending_index, readings_of
from genie_sim.core.recommended.paced_genie import PacedGenie
from genie_sim.core.recommended.pacing import Pacer
from genie_sim.core.recommended.told import ToldTracks
from genie_sim.core.recommended.track_map import TrackMap
from genie_sim.core.rules import (
    CONFIDENCE_RULE,
    EVICTION,
    FRESHNESS_POLICY,
    SIMILARITY,
    GenieRules,
    MissPolicy,
    ToldRules,
)
from genie_sim.core.sharing import SharingGenie
from genie_sim.core.similarity import Similarity


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

    On an edge it serves other Genies, so it answers when it has an answer, and shares what its node
    finds; on a car it serves the consumer by the miss policy and sends only its misses up.

    Parameters
    ----------
    rules : GenieRules
        The settings.
    name : str
        The Genie's name.
    subscribed, published : tuple of str
        The encapsulated node's own topics, T_S and T_P.
    on_edge : bool
        Whether it is an edge's Genie or a car's.
    alone : bool
        Whether nobody listens to ``-remote``.
    miss_policy : str, optional
        What clients get whose request missed, in the place of what settings and role say.
    laws : DetectorLaws
        Those of the detectors.
    **middleware
        Arguments of ``GenieNode`` that depend on the middleware.

    Raises
    ------
    UserError
        A plug-in of the user's own does not work.
    """
    similarity: Similarity = SIMILARITY.make(rules.similarity)
    new_eviction = EVICTION.resolve(rules.eviction)
    capacity = rules.capacity if on_edge or rules.car_capacity is None else rules.car_capacity

    def new_cache() -> MessageCache:
        ttl = () if rules.ttl_ns is None else (rules.ttl_ns,)
        eviction = plugins.call("eviction", rules.eviction, new_eviction, *ttl)
        return MessageCache(similarity.index(), eviction, capacity)

    if miss_policy is None:
        miss_policy = "blocking" if on_edge and rules.algorithm != "literal" else rules.miss_policy
    role_rules = replace(
        rules,
        share_answers=rules.share_answers if on_edge else "on_request",
        share_requests=rules.share_requests if on_edge else not alone,
        share_filter=rules.share_filter if on_edge else "confident",
        car_learns="all" if on_edge else rules.car_learns,
        miss_policy=miss_policy,
    )
    node_class = PerTopicGenie if rules.pending_index == "per_topic" else GenieNode
    arguments: dict[str, Any] = {
        "key": similarity.key,
        "new_cache": new_cache,
        "pending": pending_index(role_rules, similarity.index),
        "object_map": _object_map(rules, laws, on_edge),
        "map_answer": Detections,
        "readings": readings_of(role_rules),
    }
    return node_class(name, subscribed, published, role_rules, **(arguments | middleware))


def make_paced_genie(
    rules: GenieRules,
    name: str,
    subscribed: tuple[str, ...],
    published: tuple[str, ...],
    *,
    has_edge: bool,
    laws: DetectorLaws = ASSUMED,
    **middleware: Any,
) -> PacedGenie:
    """The Genie of a car whose ``rules`` have looks; see ``make_genie``."""
    looks = rules.looks
    assert looks is not None and looks.told != "auto"
    object_map = _track_map(rules, laws, "map")
    told = looks.told
    pacer = Pacer(every_ns=looks.every_ns, in_flight=looks.in_flight, stale_ns=looks.stale_ns)
    arguments: dict[str, Any] = {
        "pacer": pacer if has_edge else None,
        "own": looks.own,
        "object_map": object_map,
        "told": None if told is None else ToldTracks(told, object_map.contradicts),
        "map_answer": Detections,
        "view_range_m": rules.view_range_m,
    }
    return PacedGenie(name, subscribed, published, **(arguments | middleware))


def make_sharing_genie(
    rules: GenieRules,
    name: str,
    subscribed: tuple[str, ...],
    published: tuple[str, ...],
    *,
    laws: DetectorLaws = ASSUMED,
    **middleware: Any,
) -> SharingGenie:
    """The Genie beside an edge's detector that tells cars of one another's looks."""
    assert rules.looks is not None and isinstance(rules.looks.told, ToldRules)
    arguments: dict[str, Any] = {
        "object_map": _track_map(rules, laws, "look"),
        "told": rules.looks.told,
        "make_answer": Detections,
    }
    return SharingGenie(name, subscribed, published, **(arguments | middleware))


def _track_map(rules: GenieRules, laws: DetectorLaws, shares: Literal["look", "map"]) -> TrackMap:
    """The map of a Genie with looks. Raises ``UserError`` where the freshness policy tracks
    nothing.
    """
    assert rules.looks is not None
    policy: Never = FRESHNESS_POLICY.make(rules.object_map.freshness)
    if not policy.tracks:
        raise UserError(
            f"genie.object_map.freshness: {rules.object_map.freshness.name!r} does not track, which"
            " 'looks' need; use recommended, existence or track"
        )
    policy.laws = laws
    return TrackMap(
        rules.object_map,
        policy,
        confidence_rule=confidence_rule(rules.object_map.rule),
        shares=shares,
        view_range_m=rules.view_range_m,
        view_margin_rad=rules.looks.view_margin_rad,
    )


def _object_map(rules: GenieRules, laws: DetectorLaws, on_edge: bool) -> Map:
    """The map that the freshness policy wants. Raises ``UserError``."""
    policy: Never = FRESHNESS_POLICY.make(rules.object_map.freshness)
    rule = confidence_rule(rules.object_map.rule)
    if not policy.tracks:
        return ObjectMap(rules.object_map, rules.view_range_m, rule, policy)
    policy.laws = laws
    return TrackMap(
        rules.object_map,
        policy,
        confidence_rule=rule,
        shares="look" if on_edge else "map",
        view_range_m=rules.view_range_m,
    )


def confidence_rule(name: str) -> ConfidenceRule:
    """A confidence rule by name. One of the user's own ends the run with one line if what it
    returns is no confidence.

    Raises ``UserError``."""
    rule: ConfidenceRule = CONFIDENCE_RULE.resolve(name)
    if name in CONFIDENCE_RULES:
        return rule

    @functools.wraps(rule)
    def checked(before: float, seen: float, rate: float) -> float:
        try:
            confidence = rule(before, seen, rate)
        except Exception as error:
            raise UserError(f"confidence rule {name!r}: {type(error).__name__}: {error}") from error
        if (
            isinstance(confidence, Real)
            and not isinstance(confidence, bool)
            and 0 <= float(confidence) <= 1
        ):
            return float(confidence)
        raise UserError(
            f"confidence rule {name!r}: returned {short_repr(confidence)} for"
            f" ({before:g}, {seen:g}, {rate:g}); expected a number from 0 to 1"
        )

    checked(0.5, 0.5, 0.1)
    return checked
