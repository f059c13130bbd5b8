"""Path loss between a car and an antenna beside the street: 3GPP TR 38.901, UMi street canyon."""

import math
from collections.abc import Callable
from functools import cache
from statistics import NormalDist

from genie_sim.sim.network import Network

# TR 38.901, table 7.4.1-1 (UMi): standard deviations of the shadowing; table 7.5-6: correlation
# distances of the shadowing with and without line of sight; table 7.6.3.1-2: of the state.
LOS_SIGMA_DB, NLOS_SIGMA_DB = 4.0, 7.82
LOS_SPACING_M, NLOS_SPACING_M, STATE_SPACING_M = 10.0, 13.0, 50.0
ANTENNA_ABOVE_CAR_M = 10.0 - 1.5  # the heights of the street canyon's antenna and of its users
HZ_PER_GHZ = 1e9
PROBIT = NormalDist().inv_cdf


def los_db(distance_m: float, carrier_ghz: float) -> float:
    """With line of sight, nearer than the break point (210 m at 3.5 GHz), beyond which the loss
    grows faster.
    """
    return 32.4 + 21 * math.log10(distance_m) + 20 * math.log10(carrier_ghz)


def nlos_db(distance_m: float, carrier_ghz: float) -> float:
    """Without line of sight."""
    loss_db = 22.4 + 35.3 * math.log10(distance_m) + 21.3 * math.log10(carrier_ghz)
    return max(los_db(distance_m, carrier_ghz), loss_db)


def los_probability(ground_m: float) -> float:
    """Probability of a line of sight at a distance over the ground."""
    if ground_m <= 18:
        return 1.0
    near = 18 / ground_m
    return near + math.exp(-ground_m / 36) * (1 - near)


class NormalField:
    """A field of standard normal numbers over the ground: the same for every car that comes to a
    place, at any time. Independent values stand at the corners of a grid;
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


class StreetCanyon:
    """The path loss to one site. Line of sight and shadowing are fields over the ground.

    Parameters
    ----------
    network : Network
        Gives the random numbers.
    edge : str
        The edge at the site, also in the names of the random numbers.
    site : tuple of float
        East and north [m].
    carrier_hz : int
        The carrier's frequency.
    shadowing : bool
        Whether houses and trees shadow some places more than others.
    """

    def __init__(
        self,
        network: Network,
        edge: str,
        site: tuple[float, float],
        *,
        carrier_hz: int,
        shadowing: bool,
    ) -> None:
        self._site = site
        self._carrier_ghz = carrier_hz / HZ_PER_GHZ
        self._shadowing = shadowing

        def field(name: str, spacing_m: float) -> NormalField:
            draws = network.draws("path loss", edge, name)
            return NormalField(lambda column, row: draws.normal(f"{column} {row}"), spacing_m)

        self._state = field("line of sight", STATE_SPACING_M)
        self._los = field("shadowing", LOS_SPACING_M)
        self._nlos = field("shadowing without line of sight", NLOS_SPACING_M)

    def db(self, east_m: float, north_m: float) -> float:
        """The loss at a place."""
        ground_m = math.hypot(east_m - self._site[0], north_m - self._site[1])
        distance_m = math.hypot(ground_m, ANTENNA_ABOVE_CAR_M)
        probability = los_probability(ground_m)
        has_los = probability >= 1 or self._state.at(east_m, north_m) < PROBIT(probability)
        loss, field, sigma_db = (
            (los_db, self._los, LOS_SIGMA_DB) if has_los else (nlos_db, self._nlos, NLOS_SIGMA_DB)
        )
        shadow_db = sigma_db * field.at(east_m, north_m) if self._shadowing else 0.0
        return loss(distance_m, self._carrier_ghz) + shadow_db
