"""What an image carries for a detector, its ``content``: a frame of the recording, a frame that a
fault has bent, or an encoded picture.
"""

from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any, NamedTuple

from genie_sim.core.messages import Detection

Objects = tuple[Detection, ...]


class BentFrame:
    """A frame in which a detector finds something else: what ``change`` makes of its detections."""

    def __init__(self, frame: Any, change: Callable[[Objects], Objects]) -> None:
        self._frame = frame
        self.change = change

    @cached_property
    def detections(self) -> Objects:
        return self.change(self._frame.detections)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._frame, name)


class EncodedContent(NamedTuple):
    """What is found in an encoded image, its size on the wire and in memory, and the raw image's
    features.
    """

    detections: Objects
    encoded_bytes: int
    raw_bytes: int
    features: Mapping[str, bytes]


def bent(content: Any, change: Callable[[Objects], Objects]) -> Any:
    """A content in which a detector finds something else."""
    if isinstance(content, EncodedContent):
        return content._replace(detections=change(content.detections))
    return BentFrame(content, change)
