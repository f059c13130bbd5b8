"""Cameras that fail: they show nothing, or the same picture again and again."""

from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

from genie_sim.core.messages import CameraPose, Detection, Image
from genie_sim.sim.content import bent
from genie_sim.sim.fault import Fault, Strike
from genie_sim.sim.network import Network


@dataclass(frozen=True)
class CameraFault(Fault):
    """The cameras of the car ``target`` fail.

    A frozen camera repeats the first picture of the fault. The car believes the picture to be new,
    so that objects seem to move along with it.
    """

    target: str
    """The car."""

    shows: Literal["frozen", "nothing"] = "frozen"
    """The same picture again and again, or nothing: its frames are dropped."""

    befalls = "car"
    dropped_by = "camera"

    def strike(self, network: Network) -> Strike:
        pictures: dict[str, Image] = {}  # the first of each camera

        def sense(image: Image) -> Image | None:
            if self.shows == "nothing":
                return None
            picture = pictures.setdefault(image.header.frame_id, image)
            if picture is image:
                return image
            content = bent(picture.content, partial(_moved_all, picture.pose, image.pose))
            return replace(picture, header=image.header, pose=image.pose, content=content)

        senses, failing = network.senses(self.target), (sense, self.dropped_by)
        senses.append(failing)
        yield
        senses.remove(failing)


def _moved_all(
    before: CameraPose, after: CameraPose, objects: tuple[Detection, ...]
) -> tuple[Detection, ...]:
    """Objects where they seem to be: as far ahead of the later pose as they were of the earlier, at
    their own height.
    """
    places = []
    for item in objects:
        if item.location is not None:
            east_m, north_m, _ = before.carried(item.location, after)
            item = item.with_location((east_m, north_m, item.location[2]))
        places.append(item)
    return tuple(places)
