"""A Genie out of a scenario's ``genie:`` settings. The simulator and real ROS build theirs here."""

from __future__ import annotations

import functools
import hashlib
import importlib
import inspect
import sys
from collections.abc import Callable, Hashable, Mapping
from pathlib import Path
from typing import Any

from genie_sim.core.confidence import CONFIDENCE_RULES, ConfidenceRule
from genie_sim.core.eviction import EVICTIONS, Eviction
from genie_sim.core.message_cache import MessageCache, PendingIndex
from genie_sim.core.node import GenieNode, GenieRules, detections_of_map
from genie_sim.core.object_map import ObjectMap, ObjectMapRules
from genie_sim.core.similarity import SIMILARITIES
from genie_sim.errors import UserError, shown, unknown
from genie_sim.messages import Header
from genie_sim.scenario.genie_settings import GenieSettings

METHODS: dict[str, tuple[str, ...]] = {  # what a class of the user's own must have
    "similarity": ("key", "index"),
    "eviction": ("stored", "used", "removed", "victim", "expires_ns"),
}


def make_genie(
    settings: GenieSettings,
    name: str,
    subscribed: tuple[str, ...],
    published: tuple[str, ...],
    *,
    on_edge: bool,
    alone: bool = False,
    miss_policy: str | None = None,
    **middleware: Any,
) -> GenieNode:
    """The Genie called ``name`` for a node with the topics T_S and T_P.

    On an edge it serves other Genies, so it answers when it has an answer, and shares what its node finds; on a car it
    serves the consumer by the miss policy and sends only its misses up. ``alone``: nobody listens to ``-remote``.
    ``miss_policy`` overrules all that. ``middleware`` replaces what depends on it (see ``GenieNode``).
    """
    chosen = settings.similarity
    similarity = _made(
        "similarity", chosen.name, _resolve("similarity", chosen.name, SIMILARITIES), **chosen.parameters
    )
    new_eviction = _resolve("eviction", settings.eviction, EVICTIONS)
    capacity = settings.capacity if on_edge or settings.car_capacity is None else settings.car_capacity

    def eviction() -> Eviction:
        ttl = () if settings.ttl_ns is None else (settings.ttl_ns,)
        made: Eviction = _made("eviction", settings.eviction, new_eviction, *ttl)
        return made

    def new_cache() -> MessageCache:
        limits = (capacity.entries, capacity.size_bytes) if capacity is not None else (None, None)
        return MessageCache(similarity.index(), eviction(), *limits)

    if miss_policy is None:
        miss_policy = "blocking" if on_edge and settings.algorithm != "literal" else settings.miss_policy
    rules = GenieRules(
        pending_index=settings.pending_index,
        header_identity=settings.header_identity,
        same_key_pending=settings.same_key_pending,
        replay_stamp=settings.replay_stamp,
        second_answer=settings.second_answer,
        neighbour_miss=settings.neighbour_miss,
        share_answers=settings.share_answers if on_edge else "on_request",
        share_requests=settings.share_requests if on_edge else not alone,
        request_expiry_ns=settings.request_expiry_ns,
        miss_policy=miss_policy,
        view_range_m=settings.view_range_m,
        fresh_objects=settings.fresh_objects,
    )
    parts: dict[str, Any] = {
        "key": similarity.key,
        "new_cache": new_cache,
        "pending": PendingIndex(_identity(settings.header_identity), similarity.index),
        "object_map": _object_map(settings),
        "map_answer": detections_of_map,
    }
    return GenieNode(name, subscribed, published, rules, **(parts | middleware))


def _object_map(settings: GenieSettings) -> ObjectMap:
    chosen = settings.object_map
    rules = ObjectMapRules(
        rule=_resolve("confidence rule", chosen.rule, CONFIDENCE_RULES),
        rate=chosen.rate,
        location_key=chosen.location_key,
        gate_m=chosen.gate_m,
        one_per_location=chosen.one_per_location,
        threshold=chosen.threshold,
        forget_ns=chosen.forget_ns,
    )
    return ObjectMap(rules, view_cell_m=settings.view_range_m)


def _identity(name: str) -> Callable[[Header], Hashable]:
    if name == "stamp":
        return lambda header: header.stamp_ns
    return lambda header: header


def own_code(settings: GenieSettings) -> dict[str, str]:
    """sha256 of the module of each class of the user's own that the settings name: it decides the outcome, too."""
    chosen: tuple[tuple[str, str, Mapping[str, Any]], ...] = (
        ("similarity", settings.similarity.name, SIMILARITIES),
        ("eviction", settings.eviction, EVICTIONS),
        ("confidence rule", settings.object_map.rule, CONFIDENCE_RULES),
    )
    return {name: _code_of(_resolve(what, name, known)) for what, name, known in chosen if name not in known}


def _code_of(own: Any) -> str:
    try:
        return hashlib.sha256(Path(inspect.getfile(inspect.unwrap(own))).read_bytes()).hexdigest()
    except (TypeError, OSError):  # made in a notebook, or without a file of its own
        return "unknown"


def _made(what: str, name: str, own: Any, *arguments: Any, **parameters: Any) -> Any:
    """What a class or function, perhaps of the user's own, makes of these arguments."""
    try:
        return own(*arguments, **parameters)
    except (TypeError, ValueError) as error:
        raise UserError(f"{what} {name!r}: {error}") from error


def _checked(name: str, own: Callable[[float, float, float], float]) -> ConfidenceRule:
    """A rule of the user's own that cannot spoil a map: what is no confidence ends the run with one line."""

    @functools.wraps(own)
    def rule(before: float, seen: float, rate: float) -> float:
        confidence = own(before, seen, rate)
        if isinstance(confidence, int | float) and 0 <= confidence <= 1:
            return confidence
        given = f"{before:g}, {seen:g}, {rate:g}"
        raise UserError(f"confidence rule {name!r}: of {given} it makes {shown(confidence)}, no number from 0 to 1")

    _made("confidence rule", name, rule, 0.5, 0.5, 0.1)
    return rule


def _resolve(what: str, name: str, registry: Mapping[str, Any]) -> Any:
    """An entry of ``registry``, or a class of the user's own written ``package.module:Class``.

    The module may lie in the current folder, also for the installed command, where Python does not look by itself.
    """
    if name in registry:
        return registry[name]
    module_name, _, class_name = name.partition(":")
    if not class_name:
        raise UserError(unknown(what, name, registry))
    if "" not in sys.path:
        sys.path.append("")
    try:
        own = getattr(importlib.import_module(module_name), class_name)
    except (ImportError, AttributeError, SyntaxError) as error:
        raise UserError(f"{what} {name!r}: {error}") from error
    if what == "confidence rule":
        return _checked(name, own)
    lacking = [method for method in METHODS[what] if not hasattr(own, method)]
    if lacking:
        raise UserError(f"{what} {name!r}: has no method {', '.join(lacking)}; needs {', '.join(METHODS[what])}")
    return own
