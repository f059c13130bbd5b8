"""Defences: what Genies with ``looks`` believe of what others tell.

A lying car shows pictures of what is not there; a captured edge server forges answers, looks and
tracks. A defence decides at an edge which looks count and which tracks cars are told, and at a car
what of that, and of the edge's answers to its own frames, it takes over. To add one, write a class
with ``Defence`` as its base and name it in ``DEFENCES`` (or in a scenario as
``package.module:Class``). Its arguments are its settings in YAML.
"""

import math
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from genie_sim.core.freshness.never import probability
from genie_sim.core.messages import Detection, Header, Look
from genie_sim.core.tracking import NEAR_M, kind_of
from genie_sim.core.view import View

OWN_LOOKS_NS = 1_000_000_000  # older looks say nothing of what is there now
CONFLICT_NS = 500_000_000  # two looks within this time should find the same
JUDGED_M = 25.0  # up to here a detector finds nearly everything


class OwnEvidence(NamedTuple):
    """What a car itself knows of an object that others tell.

    Parameters
    ----------
    misses : int
        How many looks of its own detector should have found it in the last second, and did not.
    finds : int
        How many did.
    tracked : bool
        Whether its map has such an object, however unlikely.
    """

    misses: int
    finds: int
    tracked: bool


class Defence:
    """Believes everything. Other defences override what they do otherwise.

    A ``track`` is one of an edge's map (``tracking.Track``); its ``seen_by_ns`` has the newest
    sighting [ns] of each car. ``now_ns`` is the simulated time [ns].
    """

    def counts(self, look: Look) -> bool:
        """Whether an edge's map counts a look of the car ``look.header.origin``."""
        return True

    def seen(self, track: Any, header: Header) -> None:
        """In an edge's map, a look with this header has found a track that was there before."""

    def unseen(self, track: Any, range_m: float, header: Header) -> None:
        """In an edge's map, a look with this header should have found a track, ``range_m`` metres
        from the camera, and did not.
        """

    def tells(self, track: Any, car: str, now_ns: int) -> bool:
        """Whether an edge tells a ``car``, by its name, of a track."""
        return True

    def believes(self, told: Detection, own: OwnEvidence, now_ns: int) -> bool:
        """Whether a car takes over an object that an edge tells.

        Parameters
        ----------
        told : Detection
            The object; ``told.motion.origins`` are the cars that have seen it.
        own : OwnEvidence
            What the car has seen itself.
        now_ns : int
            Simulated time [ns].
        """
        return True

    def admits(self, detection: Detection, own: OwnEvidence, now_ns: int) -> bool:
        """Whether a car takes over a ``detection`` that its edge's detector found in its own frame;
        ``own`` is what the car has seen itself.
        """
        return True


class Corroborate(Defence):
    """A car believes what at least ``n`` cars have seen lately. It counts itself as one where its
    own map has the object, too, however unlikely.

    Parameters
    ----------
    n : int
        How many cars.
    """

    def __init__(self, n: int = 2) -> None:
        if n < 1:
            raise ValueError(f"n: must be at least 1, but is {n}")
        self._n = n

    def believes(self, told: Detection, own: OwnEvidence, now_ns: int) -> bool:
        assert told.motion is not None
        return len(set(told.motion.origins)) + own.tracked >= self._n


class FreeSpace(Defence):
    """A car believes nothing that its own detector should have seen and did not.

    Parameters
    ----------
    misses : int
        How many of the car's own looks within a second must have missed the object, with none that
        found it.
    """

    def __init__(self, misses: int = 2) -> None:
        if misses < 1:
            raise ValueError(f"misses: must be at least 1, but is {misses}")
        self._misses = misses

    def believes(self, told: Detection, own: OwnEvidence, now_ns: int) -> bool:
        return own.finds > 0 or own.misses < self._misses

    def admits(self, detection: Detection, own: OwnEvidence, now_ns: int) -> bool:
        return own.finds > 0 or own.misses < self._misses


class Reputation(Defence):
    """The beta reputation system (A. Josang, R. Ismail, 15th Bled Electronic Commerce Conference,
    2002): an edge trusts a car by ``(alpha + 1) / (alpha + beta + 2)``.

    Alpha counts other cars' looks that find what the car has seen, beta those that look at the same
    place within half a second and find nothing. An edge neither counts looks of cars with too
    little trust nor tells what only they have seen.

    Parameters
    ----------
    min_trust : float
        The lowest trust with which a car is believed.
    forgetting : float
        Every look counts so much less with each one that follows.
    """

    def __init__(self, min_trust: float = 0.3, forgetting: float = 0.98) -> None:
        probability(min_trust=min_trust, forgetting=forgetting)
        self._min_trust = min_trust
        self._forgetting = forgetting
        self._counts: dict[str, tuple[float, float]] = {}  # alpha and beta of each car

    def trust(self, car: str) -> float:
        """Of a car, from 0 to 1."""
        alpha, beta = self._counts.get(car, (0.0, 0.0))
        return (alpha + 1.0) / (alpha + beta + 2.0)

    def counts(self, look: Look) -> bool:
        return self.trust(look.header.origin) >= self._min_trust

    def seen(self, track: Any, header: Header) -> None:
        self._note(track, header, found=True)

    def unseen(self, track: Any, range_m: float, header: Header) -> None:
        if range_m <= JUDGED_M:
            self._note(track, header, found=False)

    def tells(self, track: Any, car: str, now_ns: int) -> bool:
        return any(
            self.trust(origin) >= self._min_trust for origin in track.seen_by_ns if origin != car
        )

    def _note(self, track: Any, header: Header, *, found: bool) -> None:
        """A car looked where others have just seen something."""
        for origin, stamp_ns in track.seen_by_ns.items():
            if origin != header.origin and abs(header.stamp_ns - stamp_ns) <= CONFLICT_NS:
                alpha, beta = (self._forgetting * n for n in self._counts.get(origin, (0.0, 0.0)))
                self._counts[origin] = (alpha + 1.0, beta) if found else (alpha, beta + 1.0)


class Guarded(Reputation):
    """Free space and corroboration at cars, reputation at edges.

    Parameters
    ----------
    n : int
        How many cars must have seen what is told, as for ``corroborate``.
    misses : int
        As for ``free_space``.
    min_trust : float
        As for ``reputation``.
    forgetting : float
        As for ``reputation``.
    """

    def __init__(
        self, n: int = 2, misses: int = 2, min_trust: float = 0.3, forgetting: float = 0.98
    ) -> None:
        super().__init__(min_trust, forgetting)
        self._at_cars = Corroborate(n), FreeSpace(misses)

    def believes(self, told: Detection, own: OwnEvidence, now_ns: int) -> bool:
        return all(defence.believes(told, own, now_ns) for defence in self._at_cars)

    def admits(self, detection: Detection, own: OwnEvidence, now_ns: int) -> bool:
        return all(defence.admits(detection, own, now_ns) for defence in self._at_cars)


DEFENCES: dict[str, type[Defence]] = {
    "none": Defence,
    "corroborate": Corroborate,
    "free_space": FreeSpace,
    "reputation": Reputation,
    "guarded": Guarded,
}
MUST_HAVE = ("counts", "seen", "unseen", "tells", "believes", "admits")


class OwnLooks:
    """The looks of a car's own detector within the last second, apart from those of its edge."""

    def __init__(self) -> None:
        self._looks: deque[tuple[Look, View]] = deque()

    def add(self, look: Look) -> None:
        """The detector has looked."""
        self._looks.append((look, View(look)))
        newest_ns = look.header.stamp_ns
        while self._looks[0][0].header.stamp_ns < newest_ns - OWN_LOOKS_NS:
            self._looks.popleft()

    def evidence(
        self, label: str, east_m: float, north_m: float, *, now_ns: int, tracked: bool
    ) -> OwnEvidence:
        """What they say of an object.

        Parameters
        ----------
        label : str
            Its class.
        east_m, north_m : float
            Its place.
        now_ns : int
            The time [ns].
        tracked : bool
            Whether the car's map has it.
        """
        misses = finds = 0
        kind = kind_of(label)
        for look, view in self._looks:
            age_ns = now_ns - look.header.stamp_ns
            if age_ns > OWN_LOOKS_NS:
                continue
            reach_m = min(kind.gate_m, NEAR_M + kind.v_max_mps * max(age_ns, 0) * 1e-9)
            if _shows(look.detections, kind.group, (east_m, north_m), reach_m):
                finds += 1
            elif (range_m := view.range_m(east_m, north_m)) is not None and range_m <= JUDGED_M:
                misses += 1
        return OwnEvidence(misses, finds, tracked)


class Guard:
    """What a car takes over of what its edge says, by its defence and its own evidence.

    Parameters
    ----------
    defence : Defence
        Decides.
    tracked : callable
        Whether the car's map has an object of a class, at a place [m] and a time [ns].
    signed : bool
        Whether it takes over only tracks whose sightings are signed.
    """

    def __init__(
        self,
        defence: Defence,
        tracked: Callable[[str, float, float, int], bool],
        *,
        signed: bool,
    ) -> None:
        self._defence = defence
        self._tracked = tracked
        self._signed = signed
        self._own_looks = OwnLooks()

    def looked(self, look: Look) -> None:
        """The car's own detector has looked."""
        self._own_looks.add(look)

    def believes(self, told: Detection, east_m: float, north_m: float, now_ns: int) -> bool:
        """Whether a told track counts, which is now at a place."""
        assert told.motion is not None
        if self._signed and not told.motion.signed:
            return False
        return self._defence.believes(told, self._evidence(told, east_m, north_m, now_ns), now_ns)

    def admitted(self, objects: Sequence[Detection], now_ns: int) -> tuple[Detection, ...]:
        """Those that count of what the edge's detector found in a frame of the car's own."""
        return tuple(
            item
            for item in objects
            if item.location is None
            or self._defence.admits(item, self._evidence(item, *item.location[:2], now_ns), now_ns)
        )

    def _evidence(self, item: Detection, east_m: float, north_m: float, now_ns: int) -> OwnEvidence:
        tracked = self._tracked(item.label, east_m, north_m, now_ns)
        return self._own_looks.evidence(item.label, east_m, north_m, now_ns=now_ns, tracked=tracked)


def _shows(
    detections: Sequence[Detection], group: str, place: tuple[float, float], reach_m: float
) -> bool:
    """Whether one of the detections is of a group of classes and near a place."""
    return any(
        item.location is not None
        and kind_of(item.label).group == group
        and math.dist(item.location[:2], place) <= reach_m
        for item in detections
    )
