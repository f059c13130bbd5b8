"""Streets of which the truth is known, and how what is held is judged."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from genie_sim.core.messages import CameraPose, Detection, Detections, Header, Image, Location
from genie_sim.judge.consumers import ConsumerJudge
from genie_sim.record.records import HELD
from genie_sim.record.tables import Table
from tests.make import S

POSE = CameraPose(0.0, 0.0, 1.6, 0.0)


class Thing(NamedTuple):
    label: str
    location: Location
    moving: bool = False


def thing(label: str, east_m: float, north_m: float = 0.0, moving: bool = False) -> Thing:
    return Thing(label, (east_m, north_m, 0.8), moving)


@dataclass(frozen=True)
class Frame:
    """What the camera took at the origin, looking east."""

    visible: Sequence[Thing]
    hidden: Sequence[Thing] = ()
    detections: tuple[Detection, ...] = ()


class Street:
    """Knows cars and people."""

    cameras, tolerance_m, range_m = None, 2.0, 40.0

    def knows(self, label: str) -> bool:
        return label in ("car", "truck", "person")

    def visible(self, frame: Any) -> Sequence[Thing]:
        return frame.visible

    def are_there(
        self, frames: Sequence[Any], labels: Sequence[str], east_m: Any, north_m: Any
    ) -> Any:
        return np.array(
            [
                any(
                    it.label == label and math.dist(it.location[:2], place) <= self.tolerance_m
                    for it in (*frame.visible, *frame.hidden)
                )
                for frame, label, *place in zip(frames, labels, east_m, north_m, strict=True)
            ]
        )


def is_there(truth: Any, frame: Any, label: str, east_m: float, north_m: float) -> bool:
    """Whether a truth knows anything of a class at one place."""
    place = np.array([east_m]), np.array([north_m])
    return bool(truth.are_there([frame], [label], *place)[0])


Step = tuple[Frame, Sequence[Detection] | None]


def judged(
    *steps: Step,
    earlier_cars: Sequence[str] = ("car1",),
    what: str = "consumer",
    objects: Table | None = None,
) -> list[dict[str, Any]]:
    """A frame each 100 ms, and after each the answer to it that the consumer is handed, if any: the
    rows.
    """
    table = Table(HELD)
    judge = ConsumerJudge("genie", {"car1": Street()}, table, earlier_cars, held_objects=objects)
    for number, (frame, answer) in enumerate(steps):
        header = Header(number * S // 10, "camera_02", "car1")
        judge.published(Image(header, 1000, "", 0, POSE, 1.4, frame))
        if answer is not None:
            judge.answered(Detections(header, tuple(answer)), header.stamp_ns + S // 20)
    judge.close()
    rows = table.to_frame()
    return rows[rows["what"] == what].to_dict("records")


def last(*steps: Step) -> dict[str, Any]:
    return judged(*steps)[-1]
