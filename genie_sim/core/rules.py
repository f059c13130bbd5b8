"""How the paper's Algorithms 1 and 2 are read: every open choice as a plain value. The defaults are the readings under
which the algorithms work; ``LITERAL`` is what is printed."""

import math
from dataclasses import dataclass, field
from typing import Any, Literal

from genie_sim.plugins import Choice

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


MissPolicy = Literal["immediate", "blocking", "hits_only"]
NEVER = Choice("never")
SIMILARITY = Choice("pose_grid", {"cell_m": 1.0, "heading_rad": math.radians(15.0)})


@dataclass(frozen=True)
class Percentile:
    """C_T is this percentile, by nearest rank, of the confidences of all objects that a map holds."""

    percentile: float


@dataclass(frozen=True)
class ObjectMapRules:
    """How Algorithm 2 is read.

    ``location_key``: ``gate`` (the nearest object of the class within ``gate_m``) or ``exact`` (equal coordinates).
    ``one_per_location``: any object at a location blocks a second (lines 4 and 7 as printed), classes not told apart.
    ``rule`` is the confidence rule by name, ``rate`` its lambda. ``threshold``: C_T as a number, ``range_60``,
    ``empirical`` (60th percentile of the first scores seen so far) or a percentile of what is stored now.
    ``confidence_source``: every object of every answer counts as a sighting (``sightings``), or echoes do not
    (``origins``): only what a detector found counts, and of each car at most once a second. ``freshness``: the policy,
    by name, that says when an object is not believed in any more.
    """

    location_key: Literal["gate", "exact"] = "gate"
    gate_m: float = 1.0
    one_per_location: bool = False
    rule: str = "noisy_or"
    rate: float = 0.1
    threshold: float | str | Percentile = 0.60
    confidence_source: Literal["sightings", "origins"] = "sightings"
    freshness: Choice = NEVER


@dataclass(frozen=True)
class Capacity:
    """At most so many entries, so many bytes, or both."""

    entries: int | None = None
    bytes: int | None = None

    def __post_init__(self) -> None:
        if self.entries is None and self.bytes is None:
            raise ValueError("must name 'entries', 'bytes' or both")

    def holds(self, entries: int, size_bytes: int) -> bool:
        """Whether there is room for so much."""
        return (self.entries is None or entries <= self.entries) and (
            self.bytes is None or size_bytes <= self.bytes
        )


@dataclass(frozen=True)
class GenieRules:
    """How Algorithm 1 is read.

    ``similarity`` and ``eviction`` are plug-ins by name; ``capacity`` limits every message cache, ``car_capacity``
    those on cars instead. ``pending_index``: an answer is found by its header ``across_topics``, or only ``per_topic``
    as printed, where it can never match because it comes on another topic than its request. ``header_identity``:
    ``stamp_frame_origin`` or ``stamp``. ``same_key_pending``: a request equal to a pending one may ``coalesce`` with
    it, or is run again (``forward``). ``replay_stamp``: a replayed answer carries the header of the ``request`` or the
    ``stored`` one. ``second_answer``: a later answer to the same request may ``overwrite`` the first, leave it
    (``first_wins``) or add its objects (``merge``). ``neighbour_miss``: a neighbour's request that is not in the cache
    is ignored (``ignore``) or run and broadcast (``process``). ``share_answers``: the own node's answers go to all
    (``broadcast``) or to the requester (``on_request``). ``share_requests``: misses are published on ``-remote``.
    ``request_expiry_ns``: after this time an unanswered request is forgotten, ``None`` for never. ``miss_policy``: a
    client whose request misses gets the map's objects in view at once and the detection later (``immediate``), the
    first detection (``blocking``) or nothing (``hits_only``). ``view_range_m`` limits what is in view.
    ``fresh_objects``: only ``confident`` objects reach clients, or those on the node's own host get ``all`` of what it
    finds. ``share_filter``: edges send each other ``confident`` objects only, or ``all`` (C_T towards cars only).
    ``car_learns``: a car's Genie stores ``all`` answers, or its ``own`` node's only: the edge's just go on to clients.
    ``passes``: an answer that a Genie makes itself, from its cache or map, costs nothing beside its request (1), or as
    much again (2).
    """

    algorithm: Literal["default", "literal"] = "default"
    similarity: Choice = SIMILARITY
    eviction: str = "unlimited"
    capacity: Capacity | None = None
    car_capacity: Capacity | None = None
    ttl_ns: int | None = None
    pending_index: Literal["across_topics", "per_topic"] = "across_topics"
    header_identity: Literal["stamp_frame_origin", "stamp"] = "stamp_frame_origin"
    same_key_pending: Literal["coalesce", "forward"] = "coalesce"
    replay_stamp: Literal["request", "stored"] = "request"
    second_answer: Literal["overwrite", "first_wins", "merge"] = "overwrite"
    neighbour_miss: Literal["ignore", "process"] = "ignore"
    share_answers: Literal["broadcast", "on_request"] = "broadcast"
    share_requests: bool = True
    request_expiry_ns: int | None = 2_000_000_000
    miss_policy: MissPolicy = "immediate"
    view_range_m: float = 50.0
    fresh_objects: Literal["confident", "all"] = "confident"
    share_filter: Literal["confident", "all"] = "confident"
    car_learns: Literal["all", "own"] = "all"
    passes: int = 1
    object_map: ObjectMapRules = field(default_factory=ObjectMapRules)

    def __post_init__(self) -> None:
        if self.eviction == "ttl" and self.ttl_ns is None:
            raise ValueError("ttl: missing; eviction 'ttl' needs it, for example 'ttl: 10 s'")
        if self.eviction in ("unlimited", "lru", "lfu") and self.ttl_ns is not None:
            raise ValueError(
                f"ttl: has no effect with eviction {self.eviction!r}; write 'eviction: ttl'"
            )
