"""How the paper's Algorithms 1 and 2 are read: every open choice is a setting. The defaults are the
readings under which the algorithms work; ``LITERAL`` is what is printed.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from genie_sim.base import units
from genie_sim.base.errors import short_repr
from genie_sim.base.marks import Bounds, Count, Share, Short
from genie_sim.base.plugins import Choice
from genie_sim.base.setting_errors import SettingError
from genie_sim.base.settings import PlugIn
from genie_sim.core.confidence import CONFIDENCE_RULES
from genie_sim.core.eviction import EVICTIONS
from genie_sim.core.similarity import SIMILARITIES

# What Algorithms 1 and 2 say to the letter; single settings may still be given beside ``algorithm:
# literal``.
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


SIMILARITY = PlugIn("similarity", SIMILARITIES, ("key", "index"), default="pose_grid")
EVICTION = PlugIn("eviction", EVICTIONS, ("stored", "used", "removed", "victim", "expires_ns"))
CONFIDENCE_RULE = PlugIn("confidence rule", CONFIDENCE_RULES)


MissPolicy = Literal["immediate", "blocking", "hits_only"]
POSE_GRID = Choice("pose_grid", {"cell_m": 1.0, "heading_rad": math.radians(15.0)})


@dataclass(frozen=True)
class Percentile:
    """C_T is a percentile of the confidences of all objects that a map holds."""

    percentile: Annotated[float, Bounds(above=0, maximum=100)]
    """C_T is this percentile, by nearest rank, of the confidences of all stored objects. Each Genie
    has its own, and it changes with every sighting."""


@dataclass(frozen=True)
class ObjectMapRules:
    """How Algorithm 2 is read."""

    location_key: Literal["gate", "exact"] = "gate"
    """When two sightings are one object, within `gate`, or with equal coordinates (the literal
    reading)."""

    gate_m: Annotated[float, Bounds(above=0)] = 1.0
    """Largest distance at which two sightings of a class are one object. Fitted to the paper's
    reuse in `reproduce`."""

    one_per_location: bool = False
    """Whether any object at a location, of whatever class, keeps out a second one (lines 4 and 7 as
    printed)."""

    rule: Annotated[str, CONFIDENCE_RULE] = "noisy_or"
    """How confidence changes with a sighting, or a function of your own. The printed formula (line
    5) lowers it; `noisy_or` does what the text says."""

    rate: Share = 0.1
    """λ of Algorithm 2, the rate of the confidence rule."""

    threshold: Share | Percentile = 0.60
    """C_T, from which on objects are shared and answered. The paper's 60 % may be read as a number,
    or as a percentile of the confidences stored now."""

    forget_after_ns: Annotated[int, Bounds(above=0)] | None = None
    """After this time without a sighting the map forgets an object; `null`: never, as in the
    paper, whose map only grows."""


@dataclass(frozen=True)
class Capacity:
    """At most so many entries, so many bytes, or both."""

    entries: Count | None = None
    """Largest number of stored answers."""

    bytes: Annotated[int, units.SIZE, Bounds(above=0)] | None = None
    """Largest size of all stored answers together."""

    def __post_init__(self) -> None:
        if self.entries is None and self.bytes is None:
            raise SettingError("", "must name 'entries', 'bytes' or both")

    @classmethod
    def expand(cls, value: object) -> object:
        """``1000 entries`` and ``10 MB`` for short."""
        if value is None or isinstance(value, Mapping | cls):
            return value
        number, _, unit = str(value).partition(" ")
        if unit == "entries" and number.isascii() and number.isdigit() and len(number) < 18:
            return {"entries": int(number)}
        try:
            units.size_bytes(value)
        except ValueError as error:
            text = f"must be such as '1000 entries' or '10 MB', not {short_repr(value)}"
            raise SettingError("", text) from error
        return {"bytes": value}

    def holds(self, entries: int, size_bytes: int) -> bool:
        """Whether there is room for so much."""
        return (self.entries is None or entries <= self.entries) and (
            self.bytes is None or size_bytes <= self.bytes
        )


CapacityField = Annotated[Capacity | None, Short(("1000 entries", "10 MB"))]


@dataclass(frozen=True)
class GenieRules:
    """How Algorithm 1 is read."""

    algorithm: Literal["default", "literal"] = "default"
    """`literal` follows the letter of the paper in every setting below; nothing is ever reused
    then."""

    similarity: Annotated[Choice, SIMILARITY] = POSE_GRID
    """When two images are the same. The paper does not say; `pose_grid` is its "arrives at the same
    spot"."""

    eviction: Annotated[str, EVICTION] = "fifo"
    """Which answer is evicted when the cache is full: the oldest (`fifo`), that used least recently
    or least often, what is older than `ttl`; or a class of your own. The paper's cache only
    grows: without a capacity nothing is evicted."""

    capacity: CapacityField = None
    """Largest size of a Genie's cache, in entries or bytes; unlimited by default, as in the
    paper."""

    car_capacity: CapacityField = None
    """The capacity for Genies on cars; by default the same."""

    ttl_ns: Annotated[int, Bounds(above=0)] | None = None
    """How long an answer stays valid, where `eviction` is `ttl`."""

    pending_index: Literal["across_topics", "per_topic"] = "across_topics"
    """How an answer is matched to its request. Algorithm 1, line 7, is `per_topic`, which never
    matches, since an answer comes on another topic than its request."""

    header_identity: Literal["stamp_frame_origin", "stamp"] = "stamp_frame_origin"
    """What identifies a header. Algorithm 1 uses the `stamp`, which two cars may share."""

    same_key_pending: Literal["coalesce", "forward"] = "coalesce"
    """Whether a request equal to a pending one waits for that one's answer, or is processed too
    (line 12)."""

    replay_stamp: Literal["request", "stored"] = "request"
    """Which header a replayed answer carries, that of the request, or the stored one (line 19)."""

    neighbour_miss: Literal["ignore", "process"] = "ignore"
    """What a Genie does with a neighbour's request that it cannot answer (lines 13 to 15):
    nothing, or run it and broadcast the answer."""

    share_answers: Literal["broadcast", "on_request"] = "broadcast"
    """Whether an edge's detection goes to all neighbours, or only to the one that asked."""

    share_requests: bool = True
    """Whether misses go to neighbours. `false` is an ablation."""

    request_expiry_ns: Annotated[int, Bounds(above=0)] | None = 2_000_000_000
    """After this time an unanswered request is forgotten. Assumed; `null` is the literal reading:
    when 10,000 later ones have come."""

    miss_policy: MissPolicy = "immediate"
    """What a client gets on a miss: the map's objects at once and the detection later, the first
    detection, or nothing (the literal reading). Only `immediate` can give the paper's
    latencies."""

    view_range_m: Annotated[float, Bounds(above=0)] = 50.0
    """Objects of the map are in view up to this distance. Assumed."""

    fresh_objects: Literal["confident", "all"] = "confident"
    """Whether objects below C_T in the node's own fresh answer reach the clients on its own host.
    Cars that send requests over a link never get them."""

    share_filter: Literal["confident", "all"] = "confident"
    """Whether C_T filters what edges send each other, too, or only what cars get ("with the cars
    requesting information")."""

    car_learns: Literal["all", "own"] = "all"
    """Whether a car's Genie stores the answers of its edge, or only those of its own detector ("fed
    into Node Z"). A phantom Genie, which has no detector, always does."""

    passes: Annotated[int, Bounds(minimum=1, maximum=2)] = 1
    """How often a Genie's CPU time (`genie` in the device profile) is charged for a frame that it
    answers itself, from its cache or map: once, for the request, or twice, for the answer as well.
    In both cases an answer of a detector or of another Genie is charged once, when it comes in.
    Other methods with a cache are charged alike. Real ROS ignores this setting."""

    object_map: ObjectMapRules = ObjectMapRules()
    """How sightings become objects, and objects become confident."""

    def __post_init__(self) -> None:
        if self.eviction == "ttl" and self.ttl_ns is None:
            raise SettingError("ttl", "missing; eviction 'ttl' needs it, for example 'ttl: 10 s'")
        if self.eviction in ("fifo", "lru", "lfu") and self.ttl_ns is not None:
            text = f"has no effect with eviction {self.eviction!r}; write 'eviction: ttl'"
            raise SettingError("ttl", text)

    @property
    def capacity_on_car(self) -> Capacity | None:
        """The capacity of a Genie on a car."""
        return self.capacity if self.car_capacity is None else self.car_capacity

    @classmethod
    def expand(cls, value: object) -> object:
        """What the name of an algorithm stands for, below the settings beside it."""
        if isinstance(value, str):
            value = {"algorithm": value}
        if not isinstance(value, Mapping):
            return value
        return _below(LITERAL, value) if value.get("algorithm") == "literal" else value


def _below(preset: Mapping[str, Any], settings: Mapping[str, Any]) -> dict[str, Any]:
    """A preset with the given settings above it, sections setting by setting."""
    result = {**preset, **settings}
    for name, section in preset.items():
        if isinstance(section, Mapping) and isinstance(settings.get(name, {}), Mapping):
            result[name] = {**section, **settings.get(name, {})}
    return result
