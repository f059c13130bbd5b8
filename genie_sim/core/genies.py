"""A Genie out of its rules. The simulator and real ROS build theirs here."""

import functools
from dataclasses import replace
from numbers import Real
from typing import Any

from genie_sim.base import plugins
from genie_sim.base.errors import UserError, short_repr
from genie_sim.core.confidence import CONFIDENCE_RULES, ConfidenceRule
from genie_sim.core.message_cache import MessageCache
from genie_sim.core.messages import Detections
from genie_sim.core.node import GenieNode
from genie_sim.core.object_map import ObjectMap
from genie_sim.core.rules import (
    CONFIDENCE_RULE,
    EVICTION,
    SIMILARITY,
    GenieRules,
    MissPolicy,
)
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
    **others: Any,
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
    **others
        Arguments of ``GenieNode`` beside, or in the place of, those that follow from the settings.

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
    arguments: dict[str, Any] = {
        "key": similarity.key,
        "new_cache": new_cache,
        "new_keys": similarity.index,
        "object_map": ObjectMap(
            rules.object_map, rules.view_range_m, confidence_rule(rules.object_map.rule)
        ),
        "map_answer": Detections,
    }
    return GenieNode(name, subscribed, published, role_rules, **(arguments | others))


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
