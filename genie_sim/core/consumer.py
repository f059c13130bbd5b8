"""What a car does with the answers that it is handed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from genie_sim.messages import Detection, Detections, Image

MERGE_M = 1.0  # objects of two streams nearer than this are one


class Consumer(Protocol):
    """What a car believes is around it."""

    def on_frame(self, image: Image) -> None:
        """The car took a frame, to which answers will come."""

    def on_answer(self, answer: Detections, now_ns: int) -> None:
        """The car has been handed an answer."""

    def held(self, now_ns: int) -> Sequence[Detection]:
        """The objects that it believes in at this instant."""


class Newest:
    """Holds the objects of each camera stream's newest answer; of several at one place the first."""

    def __init__(self) -> None:
        self._newest: dict[str, Detections] = {}

    def on_frame(self, image: Image) -> None:
        """It needs none."""

    def on_answer(self, answer: Detections, now_ns: int) -> None:
        stream = answer.header.frame_id
        held = self._newest.get(stream)
        if held is None or answer.header.stamp_ns >= held.header.stamp_ns:
            self._newest[stream] = answer

    def held(self, now_ns: int) -> Sequence[Detection]:
        kept: list[Detection] = []
        places: dict[str, list[tuple[float, float]]] = {}
        for stream in sorted(self._newest):
            for one in self._newest[stream].objects:
                if one.location is None:
                    continue
                east_m, north_m, _ = one.location
                known = places.setdefault(one.label, [])
                if not any((e - east_m) ** 2 + (n - north_m) ** 2 < MERGE_M**2 for e, n in known):
                    known.append((east_m, north_m))
                    kept.append(one)
        return kept
