"""What a fault changes of the messages that hosts exchange, and of what their cameras take.

A host is bent where its messages cross its border: what leaves it over links passes the outward
functions, what comes the inward ones. So every method meets the same fault, and what the nodes of
one host exchange stays as it is.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

from genie_sim.core.messages import CameraPose, Detection, Detections, Image, Look, Message
from genie_sim.sim.content import Objects, bent

# Gives a message as it goes on to, or comes from, a host of this name; ``None``: it is lost.
Change = Callable[[Message, str], Message | None]
Sense = Callable[[Image], Image | None]


@dataclass(frozen=True)
class Bend:
    """A change at the border of a host.

    ``inward`` gives what arrives there, from a message and the host that it comes from; ``outward``
    what leaves it, from a message and the host that it goes to. ``None``: it is lost; ``cause``
    names what drops it, where anything may be lost.
    """

    inward: Change
    outward: Change
    cause: str = ""


class Border(NamedTuple):
    """The two ends of a link as its messages see them: what is changed at each."""

    source: str
    destination: str
    at_source: list[Bend]
    at_destination: list[Bend]

    def leave(self, message: Message) -> Message | str:
        """The message as it leaves, or what it is lost by."""
        for bend in self.at_source:
            outside = bend.outward(message, self.destination)
            if outside is None:
                return bend.cause
            message = outside
        return message

    def enter(self, message: Message) -> Message | str:
        """The message as it arrives, or what it is lost by."""
        for bend in self.at_destination:
            inside = bend.inward(message, self.source)
            if inside is None:
                return bend.cause
            message = inside
        return message


NO_BORDER = Border("", "", [], [])


def shifted(message: Message, east_m: float, north_m: float) -> Message:
    """A message with all of its places elsewhere: poses, and objects in the world."""
    if isinstance(message, Image):
        pose = _shifted_pose(message.pose, east_m, north_m)
        change = partial(_shifted_all, east_m=east_m, north_m=north_m)
        return replace(message, pose=pose, content=bent(message.content, change))
    if isinstance(message, Detections):
        look = message.look
        if look is not None:
            look = _shifted_look(look, east_m, north_m)
        objects = _shifted_all(message.objects, east_m, north_m)
        return replace(message, objects=objects, look=look)
    return message


def _shifted_look(look: Look, east_m: float, north_m: float) -> Look:
    return look._replace(
        pose=_shifted_pose(look.pose, east_m, north_m),
        detections=_shifted_all(look.detections, east_m, north_m),
    )


def _shifted_all(objects: Objects, east_m: float, north_m: float) -> Objects:
    return tuple(_shifted_object(item, east_m, north_m) for item in objects)


def _shifted_object(item: Detection, east_m: float, north_m: float) -> Detection:
    if item.location is None:
        return item
    east, north, up = item.location
    return item.with_location((east + east_m, north + north_m, up))


def _shifted_pose(pose: CameraPose, east_m: float, north_m: float) -> CameraPose:
    return pose._replace(east_m=pose.east_m + east_m, north_m=pose.north_m + north_m)
