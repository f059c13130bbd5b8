"""Compares the first answer to each frame with what is really there, where the drives know that."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping
from typing import Protocol

from genie_sim.messages import Detections, Header, Image, Location


class TrueObject(Protocol):
    """Something that is really there."""

    @property
    def label(self) -> str: ...

    @property
    def location(self) -> Location: ...


class Town(Protocol):
    """Knows where everything really is."""

    def truth_near(self, east_m: float, north_m: float, range_m: float, t_ns: int) -> Collection[TrueObject]: ...


class Truth:
    """Judges one method's first answers; ``add`` takes the counts (see ``TruthTable``).

    ``begin_ns`` is when the drive of each car begins on the town's clock. ``reach_m`` is how far a served object may be
    from the real one, ``range_m`` how far away an object is wanted in an answer.
    """

    def __init__(
        self,
        method: str,
        town: Town,
        begin_ns: Mapping[str, int],
        reach_m: float,
        range_m: float,
        add: Callable[..., None],
    ) -> None:
        self._method = method
        self._town = town
        self._begin_ns = begin_ns
        self._reach_m = reach_m
        self._range_m = range_m
        self._add = add
        self._unanswered: dict[Header, Image] = {}

    def published(self, image: Image) -> None:
        self._unanswered[image.header] = image

    def answered(self, answer: Detections, source: str) -> None:
        """An answer is in the consumer's hands; only the first to a frame counts."""
        image = self._unanswered.pop(answer.header, None)
        if image is None:
            return
        header, pose = answer.header, image.pose
        served = [(one.label, one.location) for one in answer.objects if one.location is not None]
        view = [(one.label, one.location) for one in image.content.truth()]
        true = 0
        if served:
            farthest_m = max(math.hypot(at[0] - pose.east_m, at[1] - pose.north_m) for _, at in served)
            t_ns = self._begin_ns[header.origin] + image.content.stamp_ns
            near = self._town.truth_near(pose.east_m, pose.north_m, farthest_m + self._reach_m, t_ns)
            true = self._matched(served, ((one.label, one.location) for one in near))
        wanted = [
            (label, at) for label, at in view if math.hypot(at[0] - pose.east_m, at[1] - pose.north_m) <= self._range_m
        ]
        not_in_view = len(served) - self._matched(served, view)
        counts = len(served), true, not_in_view, len(wanted), self._matched(wanted, served)
        self._add(self._method, header.origin, header.frame_id, header.stamp_ns, source, *counts)

    def _matched(self, objects: Iterable[tuple[str, Location]], others: Iterable[tuple[str, Location]]) -> int:
        """How many objects have one of their class within reach among the others."""
        places: dict[str, list[Location]] = {}
        for label, at in others:
            places.setdefault(label, []).append(at)
        count, reach_m2 = 0, self._reach_m**2
        for label, at in objects:
            east_m, north_m = at[0], at[1]
            for there in places.get(label, ()):
                if (there[0] - east_m) ** 2 + (there[1] - north_m) ** 2 <= reach_m2:
                    count += 1
                    break
        return count
