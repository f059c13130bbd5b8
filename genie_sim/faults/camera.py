"""Cameras that fail: they show nothing, or the same picture again and again."""

import math
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Literal

from genie_sim.core.messages import CameraPose, Detection, Image
from genie_sim.faults.targets import FaultOfHost
from genie_sim.sim.bends import bent
from genie_sim.sim.fault import AffectedNetwork


@dataclass
class CameraFault(FaultOfHost):
    """The cameras of the car ``target`` fail.

    A frozen camera repeats the first picture of the fault. The car believes the picture to be new,
    so that objects seem to move along with it.
    """

    target: str
    """The car."""

    shows: Literal["frozen", "nothing"] = "frozen"
    """The same picture again and again, or nothing: its frames are dropped."""

    _pictures: dict[str, Image] = field(default_factory=dict, init=False, repr=False, compare=False)

    befalls = "car"
    dropped_by = "camera"

    def begin(self, network: AffectedNetwork) -> None:
        self._pictures.clear()
        network.senses(self.target).append((self._sense, self.dropped_by))

    def end(self, network: AffectedNetwork) -> None:
        network.senses(self.target).remove((self._sense, self.dropped_by))

    def _sense(self, image: Image) -> Image | None:
        if self.shows == "nothing":
            return None
        picture = self._pictures.setdefault(image.header.frame_id, image)
        if picture is image:
            return image
        return replace(
            picture,
            header=image.header,
            pose=image.pose,
            content=bent(picture.content, partial(_moved_all, picture.pose, image.pose)),
        )


def _moved_all(
    before: CameraPose, after: CameraPose, objects: tuple[Detection, ...]
) -> tuple[Detection, ...]:
    """Objects where they seem to be: as far ahead of the later pose as they were of the earlier."""
    turn_rad = after.heading_rad - before.heading_rad
    cosine, sine = math.cos(turn_rad), math.sin(turn_rad)
    moved = []
    for item in objects:
        if item.location is not None:
            east, north, up = item.location
            ahead, aside = east - before.east_m, north - before.north_m
            place = (
                after.east_m + cosine * ahead - sine * aside,
                after.north_m + sine * ahead + cosine * aside,
                up,
            )
            item = item.with_location(place)
        moved.append(item)
    return tuple(moved)
