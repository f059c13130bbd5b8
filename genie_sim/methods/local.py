"""Local execution (L): every car's own detector answers its frames."""

from __future__ import annotations

from genie_sim.sim.station import Place, Station


class Local:
    """Each car runs its own detector."""

    title = "local (L)"
    baseline = True

    def on_car(self, place: Place) -> Station | None:
        return Station(detector=True) if place.sees else None

    def on_edge(self, place: Place) -> Station:
        return Station(detector=place.sees)
