"""Spoofed objects: an attacker tells of something that is not there."""

import math
from dataclasses import dataclass, field

from genie_sim.base.settings import Share
from genie_sim.core.messages import SHARED, Detection, Header, Motion
from genie_sim.core.view import ViewSector
from genie_sim.faults.attacks.attack import Attack, AttackedScene
from genie_sim.sim.bends import Objects
from genie_sim.sim.fault import AffectedNetwork

SIGMA_M = 0.5  # how certain the place of the object is said to be


@dataclass(kw_only=True)
class Spoof(Attack):
    """An attacking car shows an object ahead of itself, an edge server one ahead of each of its
    cars.
    """

    ahead_m: float = 20.0
    """How far ahead of the camera the object is when the attack begins."""

    moves: bool = False
    """Whether it stays so far ahead of the car, as something that drives ahead of it."""

    label: str = "car"
    """Its class."""

    score: Share = 0.95
    """The detector's score, and what trackers say of its existence."""

    _places: dict[tuple[str, str], tuple[str, tuple[float, float, float]]] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    def start(self, network: AffectedNetwork, attacker: str) -> None:
        for key in [key for key in self._places if key[0] == attacker]:
            del self._places[key]

    def forge(self, objects: Objects, scene: AttackedScene) -> Objects:
        _, frame_id, car = scene.header
        pose, key = scene.pose, (scene.attacker, car)
        stream, place = self._places.get(key, (frame_id, None))
        if place is None or (self.moves and stream == frame_id):
            east_m = pose.east_m + self.ahead_m * math.cos(pose.heading_rad)
            north_m = pose.north_m + self.ahead_m * math.sin(pose.heading_rad)
            place = east_m, north_m, pose.up_m
            self._places[key] = stream, place
        sector = ViewSector(pose, scene.horizontal_fov_rad)
        if scene.source != SHARED and sector.distance_m(*place[:2]) is None:
            return objects
        motion = None
        if scene.source not in ("picture", "look", "detector"):  # a track
            sighting = Header(scene.now_ns, frame_id, f"{car}'s neighbour")
            claimed = (f"{car}'s neighbour", f"{car}'s other neighbour")
            motion = Motion((0.0, 0.0), SIGMA_M, self.score, sighting, origins=claimed)
        item = Detection(
            self.label,
            self.score,
            box=None,
            location=place,
            confidence=self.score,
            method="forged",
            motion=motion,
        )
        return (*objects, item)
