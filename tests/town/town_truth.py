"""What really is somewhere in a town, for the tests."""

from __future__ import annotations

from genie_sim.town.town import Town


def truth_near(town: Town, east_m: float, north_m: float, range_m: float, t_ns: int):
    """Everything that really is within a distance of a place at a time, by number."""
    near = town.streets.near(east_m, north_m, range_m, t_ns * 1e-9)
    return tuple(sorted((item for item in near if item.real), key=lambda item: item.number))
