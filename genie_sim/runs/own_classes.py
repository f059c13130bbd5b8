"""Frame sources of the user's own, checked before a run: they are data, in which a mistake would be
seen nowhere else. What other classes of the user's own return is checked by the tests in
``tests/conformance``.
"""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np

from genie_sim.base import plugins
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
from genie_sim.base.errors import UserError, first_line, short_repr
from genie_sim.data.frame_source import Drive, Frames
from genie_sim.scenario.scenario import Scenario


@contextmanager
def own_code_named(scenario: Scenario) -> Iterator[None]:
    """An exception in the simulator names the classes of the user's own that take part, as a
    ``UserError``: one of them raised it, or returned what it should not.
    """
    try:
        with plugins.own_faults_told():
            yield
    except (UserError, OSError, MemoryError):
        raise
    except Exception as error:
        names = ", ".join(scenario.own_code())
        if not names:
            raise
        what = f"{type(error).__name__}: {first_line(error)}"
        raise UserError(
            f"the run failed with {names}: {what}; the tests in tests/conformance say what is wrong"
        ) from error


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
    "a mapping from name to a mapping that JSON can hold",
    lambda value: (
        isinstance(value, Mapping)
        and all(
            isinstance(name, str) and isinstance(facts, Mapping) and _is_json(dict(facts))
            for name, facts in value.items()
        )
    ),
)


def _is_json(value: Any) -> bool:
    try:
        return bool(json.dumps(value, allow_nan=False))
    except (TypeError, ValueError, RecursionError):
        return False


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


class Origin(NamedTuple):
    """Where the frames of a source come from: ``Frames.digests`` and ``Frames.provenance``, once
    all drives are handed out.
    """

    digests: Mapping[str, str]
    provenance: Mapping[str, Mapping[str, Any]]


def origin_of(frames: Frames, source: str) -> Origin:
    """Of an open source by its name, checked if it is the user's own. Raises ``UserError``."""
    found = Origin(frames.digests(), frames.provenance())
    owner = plugins.own_label("frame source", source)
    if owner is not None:
        require(owner, "digests()", found.digests, TEXT_BY_NAME)
        require(owner, "provenance()", found.provenance, MAPPING_BY_NAME)
    return found


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
