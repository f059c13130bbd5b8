"""``location_key: exact``: objects by their very coordinates, and not within a gate of them."""

from genie_sim.core.messages import Location
from genie_sim.core.stored_object import StoredObject


class SameLocation:
    """The objects of a map by location: each is only at its very coordinates, as printed."""

    def __init__(self) -> None:
        self._objects: dict[Location, list[StoredObject]] = {}

    def add(self, stored: StoredObject) -> None:
        self._objects.setdefault(stored.location, []).append(stored)

    def remove(self, stored: StoredObject) -> None:
        self._objects[stored.location].remove(stored)

    def nearest(self, label: str | None, location: Location) -> StoredObject | None:
        """The oldest object of a class (``None``: of any) at a location."""
        for stored in self._objects.get(location, ()):
            if label is None or stored.label == label:
                return stored
        return None

    def at(self, location: Location) -> list[StoredObject]:
        """Every object, of any class, at a location."""
        return list(self._objects.get(location, ()))
