"""Settings of the paper's Genie that change nothing beside paced looks, and are refused there."""

from collections.abc import Collection, Iterator, Mapping
from typing import Any

from genie_sim.base.errors import short_repr
from genie_sim.base.settings import SettingError, join, plain_data, plain_default, settings_of
from genie_sim.core.freshness import FRESHNESS
from genie_sim.core.rules import GenieRules

# What decides about stored answers, requests of neighbours and what they are answered.
OF_MESSAGES = (
    "similarity",
    "eviction",
    "capacity",
    "car_capacity",
    "ttl",
    "pending_index",
    "header_identity",
    "same_key_pending",
    "replay_stamp",
    "second_answer",
    "neighbour_miss",
    "share_answers",
    "request_expiry",
    "fresh_objects",
    "share_filter",
    "car_learns",
)
OF_PLACES = ("location_key", "gate", "one_per_location")  # a map of tracks has gates of its own
OF_CONFIDENCE = ("rule", "rate", "threshold", "confidence_source")  # existence decides instead


def check_effect(rules: GenieRules, written: Mapping[str, Any] | None = None) -> None:
    """Raises ``SettingError`` for the first setting that looks leave without an effect.

    Settings count that differ from their defaults and, where ``written`` is given (the mapping that
    was read), are named there: what a method only inherits may have an effect on others.
    """
    if rules.looks is None:
        return
    with_cache = rules.looks.edge == "in_front"
    for name, value in _changed(rules, () if with_cache else OF_MESSAGES, written):
        raise _refusal(name, value, "looks, which keep no answers")
    if rules.pass_time_ns is not None:
        for name, value in _changed(rules, ("passes",), written):
            raise _refusal(name, value, "a pass_time of its own")
    policy = FRESHNESS.get(rules.object_map.freshness.name)
    names: tuple[str, ...] = () if with_cache else OF_PLACES
    if policy is not None and policy.by_existence:
        names += OF_CONFIDENCE
    inner = None if written is None else written.get("object_map", {})
    if isinstance(inner, Mapping | None):
        for name, value in _changed(rules.object_map, names, inner):
            freshness = rules.object_map.freshness.name
            raise _refusal(join("object_map", name), value, f"freshness {freshness!r}")


def _changed(
    settings: Any, names: Collection[str], written: Mapping[str, Any] | None
) -> Iterator[tuple[str, Any]]:
    """Those of the named settings that were written and are not as by default, as in YAML."""
    cls: Any = type(settings)
    data = plain_data(settings)
    for setting in settings_of(cls):
        key = setting.key
        is_given = key in names and (written is None or key in written)
        if is_given and data[key] != plain_default(setting):
            yield key, data[key]


def _refusal(field: str, value: object, beside: str) -> SettingError:
    return SettingError(field, f"{short_repr(value)} has no effect with {beside}; leave it out")
