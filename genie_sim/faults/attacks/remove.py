"""Removed objects: an attacker leaves out what is there."""

import math
from dataclasses import dataclass

from genie_sim.faults.attacks.attack import Attack, AttackedScene
from genie_sim.sim.bends import Objects


@dataclass(kw_only=True)
class Remove(Attack):
    """The attacker tells of no object near the camera, as if the street were free."""

    radius_m: float = 50.0
    """How near to the camera objects are left out."""

    def forge(self, objects: Objects, scene: AttackedScene) -> Objects:
        pose = scene.pose
        return tuple(
            item
            for item in objects
            if item.location is None
            or math.hypot(item.location[0] - pose.east_m, item.location[1] - pose.north_m)
            > self.radius_m
        )
