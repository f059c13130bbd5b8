"""Compares the first answer to each frame with what is really there, where the drives know that."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Protocol

from genie_sim.messages import Detections, Header, Image, Location
from genie_sim.recording.tables import Table

Placed = tuple[str, Location]  # an object's class, and where it is


class Town(Protocol):
    """Knows where everything really is."""

    def is_there(self, label: str, east_m: float, north_m: float, range_m: float, t_ns: int) -> bool: ...


class Truth:
    """Judges one method's first answers; ``table`` gets the counts (see ``records.TRUTH``).

    ``begin_ns`` is when the drive of each car begins on the town's clock. ``reach_m`` is how far a served object may be
    from the real one, ``range_m`` within which distance objects belong in an answer.
    """

    def __init__(
        self,
        method: str,
        town: Town,
        begin_ns: Mapping[str, int],
        reach_m: float,
        range_m: float,
        table: Table,
    ) -> None:
        self._method = method
        self._town = town
        self._begin_ns = begin_ns
        self._reach_m = reach_m
        self._range_m = range_m
        self._table = table
        self._unanswered: dict[Header, Image] = {}

    def published(self, image: Image) -> None:
        self._unanswered[image.header] = image

    def answered(self, answer: Detections, source: str) -> None:
        """An answer is in the consumer's hands; only the first to a frame counts."""
        image = self._unanswered.pop(answer.header, None)
        if image is None:
            return
        header, pose, reach_m = answer.header, image.pose, self._reach_m
        served = [(one.label, one.location) for one in answer.objects if one.location is not None]
        view = [(one.label, one.location) for one in image.content.truth()]
        not_in_view = self._without(served, view)
        t_ns = self._begin_ns[header.origin] + image.content.stamp_ns
        ghosts = sum(not self._town.is_there(label, at[0], at[1], reach_m, t_ns) for label, at in not_in_view)
        relevant = [
            (label, at) for label, at in view if math.hypot(at[0] - pose.east_m, at[1] - pose.north_m) <= self._range_m
        ]
        found = len(relevant) - len(self._without(relevant, served))
        counts = len(served), len(served) - ghosts, len(not_in_view), len(relevant), found
        self._table.append((self._method, header.origin, header.frame_id, header.stamp_ns, source, *counts))

    def _without(self, objects: list[Placed], others: list[Placed]) -> list[Placed]:
        """The objects that have none of their class within reach among the others."""
        places: dict[str, list[Location]] = {}
        for label, at in others:
            places.setdefault(label, []).append(at)
        reach_m2 = self._reach_m**2
        found = []
        for one in objects:
            label, (east_m, north_m, _) = one
            for there in places.get(label, ()):
                away_east_m, away_north_m = there[0] - east_m, there[1] - north_m
                if away_east_m * away_east_m + away_north_m * away_north_m <= reach_m2:
                    break
            else:
                found.append(one)
        return found
