"""Local execution (L): every car's own detector answers its frames."""

from genie_sim.sim.station import Method, Place, Station


class Local(Method):
    """Each car runs its own detector."""

    title = "local (L)"
    baseline = True

    def on_car(self, place: Place) -> Station | None:
        return Station(detector=True) if place.sees else None
