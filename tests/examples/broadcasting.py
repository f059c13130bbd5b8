"""A car on its own for tests of methods that broadcast: its host, its frames, what it sees."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from genie_sim.base.seeds import Draws
from genie_sim.core.messages import (
    Detection,
    Detections,
    Header,
    Image,
    Publish,
)
from genie_sim.sim.method import IMAGES, LOCAL, OBJECTS, HostContext, Interceptor
from genie_sim.tracks.laws import ASSUMED
from genie_sim.tracks.track import Motion
from tests.make import MS


def host(name: str) -> HostContext:
    return HostContext(
        name=name,
        gets_images=True,
        has_edge=False,
        genie=None,
        draws=lambda *names: Draws(1, name, *names),
        names_changes=False,
        laws=ASSUMED,
        edges=(),
    )


def made(method: Any, name: str) -> Interceptor:
    """The interceptor of a car under a method."""
    return method.on_car(host(name)).interceptor((IMAGES,), (OBJECTS,))


def thing(
    label: str, place: tuple[float, float], ms: int, by: str = "car9", speed: tuple = (0.0, 0.0)
) -> Detection:
    """An object that a car has tracked, seen at a time."""
    header = Header(ms * MS, "camera", by)
    motion = Motion(speed, 0.3, 0.95, header)
    return Detection(label, 0.9, None, (*place, 0.0), 0.95, "map", motion, header)


def published(effects: Iterable[Any], topic: str) -> list[Any]:
    return [one.message for one in effects if isinstance(one, Publish) and one.topic == topic]


def watch(
    car: Interceptor, frames: Iterable[Image], objects: tuple[Detection, ...], topic: str
) -> tuple[list[Any], list[Detections]]:
    """Shows the car frames with the same objects in each, and their detector's answers 50 ms later;
    returns what it broadcasts, and its answers.
    """
    told, answers = [], []
    for frame in frames:
        now_ns = frame.header.stamp_ns
        told += published(car.on_message(IMAGES, frame, now_ns), topic)
        answer = Detections(frame.header, objects, "detector", "detector")
        effects = car.on_message(OBJECTS + LOCAL, answer, now_ns + 50 * MS)
        answers += published(effects, OBJECTS)
    return told, answers
