"""Random fields over the ground: the same for every car that comes to a place, at any time."""

import math
from collections.abc import Callable
from functools import cache


class NormalField:
    """A field of standard normal numbers. Independent values stand at the corners of a grid;
    between them they are interpolated, and scaled so that the variance is 1 everywhere.

    Parameters
    ----------
    value : callable
        The standard normal number of a corner, by its numbers to the east and to the north.
    spacing_m : float
        The side of a square of the grid: about as far as values are correlated.
    """

    def __init__(self, value: Callable[[int, int], float], spacing_m: float) -> None:
        self._corner = cache(value)
        self._spacing_m = spacing_m

    def at(self, east_m: float, north_m: float) -> float:
        """The value at a place."""
        x, y = east_m / self._spacing_m, north_m / self._spacing_m
        column, row = math.floor(x), math.floor(y)
        right, upper = x - column, y - row
        total = squares = 0.0
        for place, weight in (
            ((column, row), (1 - right) * (1 - upper)),
            ((column + 1, row), right * (1 - upper)),
            ((column, row + 1), (1 - right) * upper),
            ((column + 1, row + 1), right * upper),
        ):
            total += weight * self._corner(*place)
            squares += weight * weight
        return total / math.sqrt(squares)
