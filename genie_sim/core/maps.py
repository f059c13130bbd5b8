"""What a Genie needs of an object map, be it the paper's (``object_map``) or one of tracks
(``track_map``).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

from genie_sim.core.messages import (
    Answer,
    CameraPose,
    Detection,
    Header,
    Location,
    MapChange,
    ObjectLookups,
)

# With ``confidence_source: origins`` a car's sightings of an object count once in this time.
ORIGIN_NS = 1_000_000_000


@dataclass(slots=True)
class Viewer:
    """Who asks, and from where its camera looks."""

    header: Header
    pose: CameraPose
    horizontal_fov_rad: float


@dataclass(slots=True)
class LookupCounts:
    """How often the map was asked for one message; the fields are those of
    ``messages.ObjectLookups``.
    """

    requests: int
    hits: int
    updates: int = 0
    boost_sum: float = 0.0
    changes: tuple[MapChange, ...] = ()
    forgotten: tuple[MapChange, ...] = ()


@dataclass(slots=True)
class EnhancedAnswer:
    """What the enhanced cache (Algorithm 2) makes of an answer.

    ``answer`` has all its objects, with the map's confidences. Of these only some leave the Genie:
    ``to_clients`` and ``to_neighbours`` (other Genies) are the answer with those. ``lookups`` is
    ``None`` for an answer whose type holds no objects.
    """

    answer: Answer
    to_clients: Answer
    to_neighbours: Answer
    lookups: LookupCounts | None = None

    @classmethod
    def of_one(cls, answer: Answer, lookups: LookupCounts | None = None) -> "EnhancedAnswer":
        """One answer for everybody."""
        return cls(answer, answer, answer, lookups)


class MapObject(Protocol):
    """An object of a map. ``number`` is its own: the map gives each one once."""

    number: int
    label: str
    confidence: float

    @property
    def location(self) -> Location: ...


class Map:
    """An object map. Times are those of the Genie's clock [ns]. By itself it never has objects, and
    what the node finds goes to everybody as it is.
    """

    @property
    def threshold(self) -> float:
        """C_T: from which confidence on an object may leave the Genie."""
        return 0.0

    def __len__(self) -> int:
        return 0

    def __iter__(self) -> Iterator[MapObject]:
        return iter(())

    def forget(self, now_ns: int) -> Sequence[MapObject]:
        """Removes and returns the objects whose time is over."""
        return ()

    def enhanced_cache_new_data(
        self,
        answer: Answer,
        viewer: Viewer | None,
        now_ns: int,
        *,
        own: bool,
        names_changes: bool,
        leaves: bool = True,
    ) -> EnhancedAnswer:
        """Algorithm 2, EnhancedCacheNewData: the map learns from an answer.

        Parameters
        ----------
        answer : Answer
            What a node or another Genie answered.
        viewer : Viewer or None
            Whose request it answers, where that is known.
        now_ns : int
            Time of the Genie's clock [ns].
        own : bool
            Whether the encapsulated node gave the answer.
        names_changes : bool
            Whether the look-ups name the objects that changed.
        leaves : bool
            Whether the answer is stored or goes on; if not, only the look-ups of the result count.
        """
        return EnhancedAnswer.of_one(answer)

    def enhanced_cache_boost_data(
        self, answer: Answer, header: Header, viewer: Viewer | None, now_ns: int
    ) -> EnhancedAnswer:
        """Algorithm 2, EnhancedCacheBoostData: what the map adds to a stored answer that is about
        to be replayed for the request with this header.
        """
        return EnhancedAnswer.of_one(answer)

    def visible(
        self, viewer: Viewer, range_m: float, now_ns: int
    ) -> tuple[tuple[Detection, ...], int | None]:
        """The objects in view that may leave, and the time that their places are predicted for, if
        they are.
        """
        return (), None


def as_change(stored: MapObject) -> MapChange:
    """An object of a map as the log tells of it."""
    return MapChange(stored.number, stored.label, stored.location, stored.confidence)


def object_lookups(header: Header, kind: str, counts: LookupCounts, objects: int) -> ObjectLookups:
    """The counts of one message as the log tells of them; the map holds so many ``objects``."""
    return ObjectLookups(
        header,
        kind,
        requests=counts.requests,
        hits=counts.hits,
        updates=counts.updates,
        boost_sum=counts.boost_sum,
        objects=objects,
        changes=counts.changes,
        forgotten=counts.forgotten,
    )


def counts_again(counted_ns: dict[str, int], header: Header) -> bool:
    """Whether a sighting in the frame with this header counts although its car's earlier ones did:
    after a second. ``counted_ns`` has the stamp of the last one that counted, by car.
    """
    last_ns = counted_ns.get(header.origin)
    if last_ns is not None and header.stamp_ns - last_ns < ORIGIN_NS:
        return False
    counted_ns[header.origin] = header.stamp_ns
    return True
