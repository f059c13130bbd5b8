"""The ``genie:`` section of a scenario: how the paper's Algorithms 1 and 2 are read."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, WithJsonSchema, model_validator

from genie_sim import units
from genie_sim.errors import shown
from genie_sim.scenario.fields import Count, Model, PositiveDuration, PositiveLength, PositiveSize, Probability, problem
from genie_sim.scenario.plugins import EvictionName, RuleName, SimilarityChoice, read_similarity

# What Algorithms 1 and 2 say to the letter; single settings may still be given beside ``algorithm: literal``.
LITERAL: dict[str, Any] = {
    "similarity": "exact",
    "pending_index": "per_topic",
    "header_identity": "stamp",
    "same_key_pending": "forward",
    "replay_stamp": "stored",
    "neighbour_miss": "process",
    "request_expiry": None,
    "miss_policy": "hits_only",
    "object_map": {"location_key": "exact", "one_per_location": True, "rule": "literal"},
}


def _threshold(value: object) -> object:
    if value in ("range_60", "empirical"):
        return value
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value <= 1:
        raise ValueError(f"must be a number from 0 to 1, 'range_60' or 'empirical', not {shown(value)}")
    return float(value)


_THRESHOLD_SCHEMA = WithJsonSchema(
    {"anyOf": [{"type": "number", "minimum": 0, "maximum": 1}, {"enum": ["range_60", "empirical"]}]}
)


class ObjectMapSettings(Model):
    """How Algorithm 2 is read; see ``core.object_map.ObjectMapRules``."""

    location_key: Literal["gate", "exact"] = "gate"
    gate_m: PositiveLength = Field(default=1.0, alias="gate")
    one_per_location: bool = False
    rule: RuleName = "noisy_or"
    rate: Probability = 0.1
    threshold: Annotated[float | str, BeforeValidator(_threshold), _THRESHOLD_SCHEMA] = 0.60
    forget_ns: PositiveDuration | None = Field(default=None, alias="forget")


class Capacity(Model):
    """At most so many entries, so many bytes, or both."""

    entries: Count | None = None
    size_bytes: PositiveSize | None = Field(default=None, alias="bytes")

    @model_validator(mode="after")
    def _limits_something(self) -> Self:
        if self.entries is None and self.size_bytes is None:
            problem("", "must name 'entries', 'bytes' or both")
        return self


def _capacity(value: object) -> object:
    """``1000 entries`` and ``10 MB`` for short."""
    if value is None or isinstance(value, Mapping | Capacity):
        return value
    number, _, unit = str(value).partition(" ")
    if unit == "entries" and number.isascii() and number.isdigit() and len(number) < 18:
        return {"entries": int(number)}
    try:
        units.size_bytes(value)
    except ValueError as error:
        raise ValueError(f"must be such as '1000 entries' or '10 MB', not {shown(value)}") from error
    return {"bytes": value}


_CAPACITY_SCHEMA = WithJsonSchema(
    {
        "anyOf": [
            {"type": "string", "examples": ["1000 entries", "10 MB"]},
            Capacity.model_json_schema(),
            {"type": "null"},
        ]
    }
)


class GenieSettings(Model):
    """How Algorithm 1 is read; see ``core.node.GenieRules``."""

    algorithm: Literal["default", "literal"] = "default"
    similarity: SimilarityChoice = Field(default_factory=lambda: read_similarity("pose_grid"))
    eviction: EvictionName = "unlimited"
    capacity: Annotated[Capacity | None, BeforeValidator(_capacity), _CAPACITY_SCHEMA] = None
    car_capacity: Annotated[Capacity | None, BeforeValidator(_capacity), _CAPACITY_SCHEMA] = None
    ttl_ns: PositiveDuration | None = Field(default=None, alias="ttl")
    pending_index: Literal["across_topics", "per_topic"] = "across_topics"
    header_identity: Literal["stamp_frame_origin", "stamp"] = "stamp_frame_origin"
    same_key_pending: Literal["coalesce", "forward"] = "coalesce"
    replay_stamp: Literal["request", "stored"] = "request"
    second_answer: Literal["overwrite", "first_wins", "merge"] = "overwrite"
    neighbour_miss: Literal["ignore", "process"] = "ignore"
    share_answers: Literal["broadcast", "on_request"] = "broadcast"
    share_requests: bool = True
    request_expiry_ns: PositiveDuration | None = Field(default=2 * units.NS_PER_S, alias="request_expiry")
    miss_policy: Literal["immediate", "blocking", "hits_only"] = "immediate"
    view_range_m: PositiveLength = Field(default=50.0, alias="view_range")
    fresh_objects: Literal["confident", "all"] = "confident"
    object_map: ObjectMapSettings = ObjectMapSettings()

    @model_validator(mode="before")
    @classmethod
    def _literal_preset(cls, data: Any) -> Any:
        if not isinstance(data, Mapping) or data.get("algorithm") != "literal":
            return data
        preset = {**LITERAL, **data}
        if isinstance(data.get("object_map", {}), Mapping):
            preset["object_map"] = {**LITERAL["object_map"], **data.get("object_map", {})}
        return preset

    @model_validator(mode="after")
    def _time_to_live(self) -> Self:
        if self.eviction == "ttl" and self.ttl_ns is None:
            problem("ttl", "missing; eviction 'ttl' needs it, for example 'ttl: 10 s'")
        if self.eviction in ("unlimited", "lru", "lfu") and self.ttl_ns is not None:
            problem("ttl", f"has no effect with eviction {self.eviction!r}; write 'eviction: ttl'")
        return self
