"""The places where objects were visible lately."""

import math

from genie_sim.core.matching import Placed
from genie_sim.grid import Grid


class RecentPlaces:
    """Every place where an object of some class was visible, and when it was visible there last.

    ``reach_m`` is the farthest that ``any_near`` is asked for.
    """

    def __init__(self, reach_m: float) -> None:
        self._grid: Grid[Placed] = Grid(reach_m)
        self._last_ns: dict[Placed, int] = {}  # in order of time

    def __len__(self) -> int:
        return len(self._last_ns)

    def add(self, place: Placed, now_ns: int) -> None:
        """An object is visible at a place; instants come in order."""
        if self._last_ns.pop(place, None) is None:
            self._grid.add(self._grid.cell(place[1], place[2]), place)
        self._last_ns[place] = now_ns

    def forget(self, before_ns: int) -> None:
        """Removes the places where nothing has been visible since ``before_ns``."""
        while self._last_ns:
            place = next(iter(self._last_ns))
            if self._last_ns[place] >= before_ns:
                return
            del self._last_ns[place]
            self._grid.remove(self._grid.cell(place[1], place[2]), place)

    def any_near(self, place: Placed, reach_m: float) -> bool:
        """Whether anything of the class was visible within ``reach_m`` of a place."""
        label, east_m, north_m = place
        nearby = self._grid.inside(
            east_m - reach_m, east_m + reach_m, north_m - reach_m, north_m + reach_m
        )
        return any(
            other[0] == label and math.dist(other[1:], place[1:]) <= reach_m for other in nearby
        )
