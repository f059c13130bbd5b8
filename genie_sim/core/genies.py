"""A Genie out of its settings. The simulator and real ROS build theirs here."""

import functools
from collections.abc import Sequence
from dataclasses import replace
from numbers import Real

from genie_sim.base import plugins
from genie_sim.base.errors import UserError, short_repr
from genie_sim.core.confidence import CONFIDENCE_RULES, ConfidenceRule
from genie_sim.core.message_cache import MessageCache
from genie_sim.core.messages import Detections
from genie_sim.core.node import SUFFIXES, GenieNode, MakeAnswer
from genie_sim.core.object_map import ObjectMap
from genie_sim.core.rules import CONFIDENCE_RULE, EVICTION, SIMILARITY, GenieRules
from genie_sim.core.similarity import Similarity


def rules_on_car(rules: GenieRules, *, alone: bool = False) -> GenieRules:
    """The settings of a car's Genie: it answers the consumer by the miss policy, and answers others
    only when they ask. Its misses go up, unless it is ``alone``: nobody listens to ``-remote``.
    """
    return replace(
        rules,
        capacity=rules.capacity_on_car,
        share_answers="on_request",
        share_requests=not alone,
        share_filter="confident",
    )


def rules_on_edge(rules: GenieRules) -> GenieRules:
    """The settings of an edge's Genie: other Genies ask it, so it answers when it has an answer,
    and it stores all that it gets.
    """
    is_literal = rules.algorithm == "literal"
    miss_policy = rules.miss_policy if is_literal else "blocking"
    return replace(rules, car_learns="all", miss_policy=miss_policy)


def make_genie(
    rules: GenieRules,
    name: str,
    inputs: Sequence[str],
    outputs: Sequence[str],
    *,
    make_answer: MakeAnswer | None = Detections,
    suffixes: tuple[str, str] = SUFFIXES,
    names_changes: bool = True,
) -> GenieNode:
    """A Genie with a cache and a map.

    Parameters
    ----------
    rules : GenieRules
        The settings, as they are in its role: ``rules_on_car``, ``rules_on_edge``.
    name, inputs, outputs, make_answer, suffixes, names_changes
        As those of ``GenieNode``.

    Raises
    ------
    UserError
        A plug-in of the user's own does not work.
    """
    similarity: Similarity = SIMILARITY.make(rules.similarity)
    new_eviction = EVICTION.resolve(rules.eviction)

    def new_cache() -> MessageCache:
        ttl = () if rules.ttl_ns is None else (rules.ttl_ns,)
        eviction = plugins.call("eviction", rules.eviction, new_eviction, *ttl)
        return MessageCache(similarity.index(), eviction, rules.capacity)

    rule = confidence_rule(rules.object_map.rule)
    return GenieNode(
        name,
        inputs,
        outputs,
        rules,
        key=similarity.key,
        new_keys=similarity.index,
        new_cache=new_cache,
        object_map=ObjectMap(rules.object_map, rules.view_range_m, rule),
        make_answer=make_answer,
        suffixes=suffixes,
        names_changes=names_changes,
    )


def confidence_rule(name: str) -> ConfidenceRule:
    """A confidence rule by name. One of the user's own ends the run with one line if what it
    returns is no confidence.

    Raises ``UserError``."""
    rule: ConfidenceRule = CONFIDENCE_RULE.resolve(name)
    if name in CONFIDENCE_RULES:
        return rule

    @functools.wraps(rule)
    def checked(before: float, sighting: float, rate: float) -> float:
        try:
            confidence = rule(before, sighting, rate)
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
            f" ({before:g}, {sighting:g}, {rate:g}); expected a number from 0 to 1"
        )

    checked(0.5, 0.5, 0.1)
    return checked
