"""Random fields over the ground: the same for every car that comes to a place, at any time."""

import math
from collections.abc import Callable

import numpy as np

TILE = 16  # values that are drawn at once, along each side


class NormalField:
    """A field of standard normal numbers. Independent values stand at the corners of a grid;
    between them they are interpolated, and scaled so that the variance is 1 everywhere.

    Parameters
    ----------
    stream : callable
        Gives the random generator of a tile, by its numbers to the east and to the north.
    spacing_m : float
        The side of a square of the grid: about as far as values are correlated.
    """

    def __init__(self, stream: Callable[[int, int], np.random.Generator], spacing_m: float) -> None:
        self._stream = stream
        self._spacing_m = spacing_m
        self._tiles: dict[tuple[int, int], list[list[float]]] = {}

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

    def _corner(self, column: int, row: int) -> float:
        tile = column // TILE, row // TILE
        values = self._tiles.get(tile)
        if values is None:
            values = self._stream(*tile).standard_normal((TILE, TILE)).tolist()
            self._tiles[tile] = values
        return values[column % TILE][row % TILE]
