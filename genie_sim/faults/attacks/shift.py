"""Shifted objects: an attacker tells of real ones at wrong places."""

import math
from dataclasses import dataclass, field

from genie_sim.faults.attacks.attack import Attack, AttackedScene
from genie_sim.sim.bends import Objects
from genie_sim.sim.fault import AffectedNetwork


@dataclass(kw_only=True)
class Shift(Attack):
    """All objects of an attacker are elsewhere, in a direction that is drawn."""

    by_m: float = 3.0
    """How far."""

    _directions: dict[str, tuple[float, float]] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    def start(self, network: AffectedNetwork, attacker: str) -> None:
        if attacker not in self._directions:
            angle_rad = network.stream("shift", attacker).uniform(0, 2 * math.pi)
            self._directions[attacker] = math.cos(angle_rad), math.sin(angle_rad)

    def forge(self, objects: Objects, scene: AttackedScene) -> Objects:
        to_east, to_north = self._directions[scene.attacker]
        shifted = []
        for item in objects:
            if item.location is not None:
                east_m, north_m, up_m = item.location
                place = east_m + self.by_m * to_east, north_m + self.by_m * to_north, up_m
                item = item.with_location(place)
            shifted.append(item)
        return tuple(shifted)
