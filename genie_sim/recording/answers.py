"""Compares answers with what the detector itself finds in that very frame: a proxy of correctness without labels."""

from __future__ import annotations

from genie_sim.core.matching import SAME_M, near, pairs, placed
from genie_sim.messages import Detections, Header, Image
from genie_sim.recording.tables import Table


class Answers:
    """Compares the first and the fresh answers under one method; ``table`` gets the counts (``records.ANSWERS``).

    It knows a frame from ``published`` until its fresh answer, or until ``forget``.
    """

    def __init__(self, method: str, table: Table) -> None:
        self._method = method
        self._table = table
        self._images: dict[Header, Image] = {}

    def published(self, image: Image) -> None:
        self._images[image.header] = image

    def forget(self, header: Header) -> None:
        """No answer to this frame is expected any more."""
        self._images.pop(header, None)

    def answered(self, answer: Detections, source: str, first: bool, fresh: bool) -> None:
        """The consumer has the ``first`` answer to a frame, the ``fresh`` one, or both in one."""
        image = self._images.get(answer.header)
        if image is None:
            return
        detections = image.content.detections
        detected = placed(detections)
        if answer.objects is detections or answer.objects == detections:
            counts = len(detected), len(detected), len(detected)
        else:
            served = placed(answer.objects)
            counts = len(served), len(detected), len(pairs(near(served, detected, SAME_M)))
        stamp_ns, stream, car = answer.header
        for which, is_this in (("first", first), ("fresh", fresh)):
            if is_this:
                self._table.append((self._method, car, stream, stamp_ns, which, source, *counts))
        if fresh:
            self.forget(answer.header)
