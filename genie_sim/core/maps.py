"""What a Genie needs of an object map, be it the paper's (``object_map``) or one of tracks (``track_map``)."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

from genie_sim.messages import (
    Answer,
    CameraPose,
    Detection,
    Header,
    Location,
    MapChange,
    ObjectLookups,
)


@dataclass(slots=True)
class Viewer:
    """Who asks, and from where its camera looks."""

    header: Header
    pose: CameraPose
    horizontal_fov_rad: float


@dataclass(slots=True)
class Learned:
    """What a map makes of an answer: the answer with the map's confidences, what of it may go to clients, what to other
    Genies, and the look-ups it took (``None`` for an answer without objects)."""

    answer: Answer
    to_clients: Answer
    to_neighbours: Answer
    lookups: ObjectLookups | None


@dataclass(slots=True)
class Boosted:
    """What a map makes of a stored answer: all of it, what of that may go to clients, and the look-ups it took."""

    answer: Answer
    to_clients: Answer
    requests: int
    hits: int


class InMap(Protocol):
    """An object of a map."""

    label: str
    confidence: float

    @property
    def location(self) -> Location: ...


class Map:
    """An object map. Times are those of the Genie's clock [ns]. By itself it never has objects, and what the node finds
    goes to everybody as it is."""

    threshold: float = 0.0  # from which confidence on an object may leave the Genie

    def __len__(self) -> int:
        return 0

    def __iter__(self) -> Iterator[InMap]:
        return iter(())

    def forget(self, now_ns: int) -> Sequence[InMap]:
        """Removes and returns the objects whose time is over."""
        return ()

    def learn(
        self,
        answer: Answer,
        viewer: Viewer | None,
        now_ns: int,
        own: bool,
        tells_changes: bool,
        leaves: bool = True,
    ) -> Learned:
        """EnhancedCacheNewData. ``viewer`` is the request's, where it is known; ``own``: the answer is that of the
        encapsulated node; ``tells_changes``: the look-ups are to name the objects that changed; ``leaves``: the answer
        is stored or goes on, else only the look-ups count."""
        return Learned(answer, answer, answer, None)

    def boost(
        self, answer: Answer, header: Header, viewer: Viewer | None, now_ns: int
    ) -> Boosted | None:
        """EnhancedCacheBoostData for a stored answer that leaves under ``header``; ``None`` if its type has no objects."""
        return None

    def visible(
        self, viewer: Viewer, range_m: float, now_ns: int
    ) -> tuple[tuple[Detection, ...], int | None]:
        """The objects in view that may leave, and the time that their places are predicted for, if they are."""
        return (), None


def as_change(one: InMap) -> MapChange:
    """An object of a map as the log tells of it."""
    return one.label, one.location, one.confidence
