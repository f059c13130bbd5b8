"""A detector, whatever it runs, and what it finds in one picture.

What each must have is ``ImageDetector``; what it may have beside, each by itself:
``FeatureDetector``, ``ThreadedDetector``, ``TellingDetector``.
"""

from numbers import Real
from pathlib import Path
from typing import Any, ClassVar, Protocol, runtime_checkable

import numpy as np

from genie_sim.base.errors import UserError, short_repr
from genie_sim.base.import_report import ImportReport
from genie_sim.data.detectors.boxes import MIN_SCORE, SHARES, DetectedBox, is_share

FARTHEST_PX = 1e6  # that a box may lie from the corner of its picture


class ImageDetector(Protocol):
    """What ``perceive`` needs of a detector. One that runs a network is best derived from
    ``OnnxDetector``.

    Parameters
    ----------
    weights : Path
        The file of its weights.
    size : tuple of int, optional
        Width and height of the network's input, in pixels; by default the network's own.
    min_score : float
        The lowest score, above 0 and below 1, of what ``detect`` returns.
    providers, threads, classes : optional
        As in ``DetectorSettings``; given only where they are not as usual there.
    """

    name: ClassVar[str]
    """What traces and scenarios call it."""

    file_name: ClassVar[str]
    """How the file of its weights is called."""

    size: tuple[int, int]
    """Width and height of its input, in pixels."""

    sha256: str
    """Of its weights, 64 hexadecimal digits."""

    def __init__(
        self, weights: Path, size: tuple[int, int] | None = None, min_score: float = MIN_SCORE
    ) -> None: ...

    def detect(self, image_bgr: np.ndarray) -> list[DetectedBox]:
        """Road users and furniture in a picture, best score first.

        Parameters
        ----------
        image_bgr : ndarray of uint8, shape (height, width, 3)
            The picture: blue, green and red from 0 to 255.
        """
        ...


@runtime_checkable
class FeatureDetector(Protocol):
    """A detector that has features of a picture, too."""

    def look(self, image_bgr: np.ndarray) -> tuple[list[DetectedBox], dict[str, bytes]]:
        """Is asked in place of ``detect``: the same list, and the features of the picture by name,
        those of one name as bytes of one length.
        """
        ...


@runtime_checkable
class ThreadedDetector(Protocol):
    """A detector that looks at pictures on several threads."""

    threads: int
    """How many it takes for one picture."""


@runtime_checkable
class TellingDetector(Protocol):
    """A detector that has something to tell at the end."""

    def tell(self, report: ImportReport) -> None:
        """What was found out about its network, and what of its answers was not used."""
        ...


def tell_network(report: ImportReport, detector: ImageDetector | None) -> None:
    """Reports what a detector tells at the end, if it does."""
    if isinstance(detector, TellingDetector):
        detector.tell(report)


def look(
    image_bgr: np.ndarray, detector: ImageDetector
) -> tuple[list[DetectedBox], dict[str, bytes]]:
    """What a detector finds in a picture, and the features of its network by name. Raises
    ``UserError`` for what one of the user's own gives that is no list of boxes, or for boxes that
    are no pixels of this picture.
    """
    where = f"detector {type(detector).__name__}"
    boxes: Any
    features: Any = {}
    if isinstance(detector, FeatureDetector):
        where += ": look()"
        answer: Any = detector.look(image_bgr)
        if not (isinstance(answer, tuple) and len(answer) == 2 and isinstance(answer[1], dict)):
            raise UserError(
                f"{where} gave {short_repr(answer)}; it must give what detect() does and a dict of "
                "features"
            )
        boxes, features = answer
    else:
        where += ": detect()"
        boxes = detector.detect(image_bgr)
    wrong: list[Any] = [boxes]
    if isinstance(boxes, list | tuple):
        wrong = [box for box in boxes if not _is_detected_box(box)]
    if wrong:
        raise UserError(
            f"{where} gave {short_repr(wrong[0])}; it must give a list of DetectedBox(label, score "
            "from 0 to 1, (x1, y1, x2, y2) in pixels)"
        )
    height, width = image_bgr.shape[:2]
    places = np.array([box for _, _, box in boxes], dtype=float).reshape(-1, 4)
    if is_share(places[(places[:, :2] > 0).any(axis=1)]):  # what the corner cuts may be small
        raise UserError(f"{where}: {SHARES}")
    low, high = places[:, :2], places[:, 2:]
    size = np.array([width, height])
    # a box that is cut at the border may be empty there
    touching = ((low == size) | (high == 0)) & (low < high)
    outside = (touching | (low > size) | (high < 0)).any(axis=1)
    if outside.any():
        first = short_repr(boxes[int(outside.argmax())])
        raise UserError(
            f"{where} gave {first}, outside of its picture of {width} x {height} pixels"
        )
    return list(boxes), features


def _is_detected_box(found: Any) -> bool:
    """Whether it is what a trace can hold: a label, a score, and a box whose ends are in order."""
    try:
        label, score, (x1, y1, x2, y2) = found
    except (TypeError, ValueError):
        return False
    if not (isinstance(found, tuple) and isinstance(label, str) and label):
        return False
    numbers = (score, x1, y1, x2, y2)
    if any(not isinstance(x, Real) or isinstance(x, bool) for x in numbers):
        return False
    is_near = all(abs(x) < FARTHEST_PX for x in numbers)
    return bool(is_near and 0 <= score <= 1 and x1 <= x2 and y1 <= y2)
