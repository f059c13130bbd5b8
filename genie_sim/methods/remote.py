"""Remote execution (R): the detector on the edge server answers every frame."""

from genie_sim.sim.station import IMAGES, OBJECTS, Method, Place, Station, Uplink


class Remote(Method):
    """Each car's frames go to its edge's detector."""

    title = "remote (R)"
    baseline = True

    def on_car(self, place: Place) -> Station | None:
        if not place.sees:
            return None
        return Station(uplink=Uplink(IMAGES, OBJECTS) if place.joined else None)
