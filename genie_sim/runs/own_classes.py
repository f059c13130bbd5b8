"""Frame sources of the user's own, checked before a run: they are data, in which a mistake would be
seen nowhere else. What other classes of the user's own return is checked by the tests in
``tests/conformance``.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from genie_sim.base.contracts import (
    BOOLEAN,
    MAPPING,
    POSITIVE,
    SEQUENCE,
    SHARE,
    TEXT,
    WHOLE,
    Contract,
    is_number,
    require,
)
from genie_sim.base.errors import UserError, short_repr
from genie_sim.data.frame_source import Drive, Frames

POSE = Contract(
    "a CameraPose of four numbers",
    lambda value: isinstance(value, tuple) and len(value) == 4 and all(map(is_number, value)),
)
DETECTIONS = Contract(
    "a tuple of Detection",
    lambda value: (
        isinstance(value, tuple | list)
        and all(hasattr(item, "label") and hasattr(item, "location") for item in value)
    ),
)
FRAME_FIELDS = {
    "stamp_ns": WHOLE,
    "pose": POSE,
    "digest": TEXT,
    "dhash": Contract(
        "a whole number of 64 bits", lambda value: WHOLE.holds(value) or _is_hash(value)
    ),
    "detections": DETECTIONS,
    "size_bytes": WHOLE,
    "horizontal_fov_rad": POSITIVE,
}
TEXT_BY_NAME = Contract(
    "a mapping from name to text",
    lambda value: (
        isinstance(value, Mapping)
        and all(isinstance(item, str) for pair in value.items() for item in pair)
    ),
)
MAPPING_BY_NAME = Contract(
    "a mapping from name to a mapping",
    lambda value: (
        isinstance(value, Mapping)
        and all(
            isinstance(name, str) and isinstance(facts, Mapping) for name, facts in value.items()
        )
    ),
)


def _is_hash(value: Any) -> bool:
    return isinstance(value, int | np.integer) and 0 <= int(value) < 2**64


def check_base(own: Any, what: str, base: type[Any]) -> None:
    """Raises ``UserError`` for an object of the user's own that is of no subclass of ``base``."""
    if not isinstance(own, base):
        raise UserError(
            f"{what}: must be of a subclass of {base.__name__} in {base.__module__}, "
            f"not {short_repr(own)}"
        )


def check_frames(frames: Any, owner: str) -> None:
    """Checks what the ``open`` of a frame source of the user's own returned. Raises
    ``UserError``.
    """
    check_base(frames, f"{owner}: what open() returns", Frames)
    require(owner, "seeded", frames.seeded, BOOLEAN)
    require(owner, "digests()", frames.digests(), TEXT_BY_NAME)
    require(owner, "provenance()", frames.provenance(), MAPPING_BY_NAME)


def check_drive(drive: Any, owner: str) -> None:
    """Checks a drive of an own source, frame by frame. Raises ``UserError``."""
    check_base(drive, f"{owner}: what drive() returns", Drive)
    require(owner, "drive().name", getattr(drive, "name", None), TEXT)
    recordings = require(owner, "drive().frames", getattr(drive, "frames", None), MAPPING)
    for recording, frames in recordings.items():
        require(owner, "a key of drive().frames", recording, TEXT)
        field = f"drive().frames[{recording!r}]"
        require(owner, field, frames, SEQUENCE)
        for index, frame in enumerate(frames):
            _check_frame(frame, owner, f"{field}[{index}]")
            if index and frame.stamp_ns <= frames[index - 1].stamp_ns:
                raise UserError(
                    f"{owner}: {field}[{index}].stamp_ns is {frame.stamp_ns}, but must be above "
                    f"{frames[index - 1].stamp_ns}, that of the frame before"
                )


def _check_frame(frame: Any, owner: str, field: str) -> None:
    for name, contract in FRAME_FIELDS.items():
        require(owner, f"{field}.{name}", getattr(frame, name, None), contract)
    for detection in frame.detections:
        require(owner, f"{field}.detections: label", detection.label, TEXT)
        require(owner, f"{field}.detections: score", detection.score, SHARE)
