"""A car that lies: its pictures show a car ahead of it that is not there.

The fault bends what leaves the car, as the shipped ``gnss`` does: the edge's detector finds the
phantom in its pictures, and a map tells others of it. What the car itself finds stays as it is. The
same seam lets a captured edge forge its answers: what leaves it is a ``Detections``.
"""

import math
from dataclasses import dataclass, replace
from functools import partial

from genie_sim.extend import (
    Bend,
    CameraPose,
    Detection,
    Fault,
    Image,
    Message,
    Network,
    Objects,
    Strike,
    bent,
)


@dataclass(frozen=True)
class LyingCar(Fault):
    """The car ``target`` shows others an object ahead of each of its cameras."""

    target: str
    """The car."""

    ahead_m: float = 20.0
    """How far ahead of the camera the phantom drives."""

    label: str = "car"
    """Its class."""

    score: float = 0.95
    """How sure a detector is of it, from 0 to 1."""

    befalls = "car"

    def __post_init__(self) -> None:
        if not 0 < self.score <= 1:
            raise ValueError(f"score: must be above 0 and at most 1, but is {self.score:g}")

    def strike(self, network: Network) -> Strike:
        bend = Bend(_unchanged, self._told)
        network.bend(self.target, bend)
        yield
        network.unbend(self.target, bend)

    def _told(self, message: Message, receiver: str) -> Message:
        """What leaves a car for another host."""
        if not isinstance(message, Image):
            return message
        return replace(
            message, content=bent(message.content, partial(self._with_phantom, message.pose))
        )

    def _with_phantom(self, pose: CameraPose, objects: Objects) -> Objects:
        place = (
            pose.east_m + self.ahead_m * math.cos(pose.heading_rad),
            pose.north_m + self.ahead_m * math.sin(pose.heading_rad),
            pose.up_m,
        )
        phantom = Detection(self.label, self.score, None, place, self.score, placed_by="forged")
        return (*objects, phantom)


def _unchanged(message: Message, sender: str) -> Message:
    return message
