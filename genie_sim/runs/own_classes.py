"""Frame sources of the user's own, checked before a run: they are data, in which a mistake would be
seen nowhere else. What else is wrong with a class of the user's own ends the run with its name.
"""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, NamedTuple

from genie_sim.base import plugins
from genie_sim.base.contracts import WHOLE, is_number, is_whole, require
from genie_sim.base.errors import UserError, first_line, short_repr
from genie_sim.data.frame_source import Drive, Drives
from genie_sim.scenario.scenario import Scenario

MAX_HASH = 2**64


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
        names = ", ".join(scenario.own_classes())
        if not names:
            raise
        what = f"{type(error).__name__}: {first_line(error)}"
        raise UserError(
            f"the run failed with {names}: {what}; the tests in tests/conformance say what is wrong"
        ) from error


def check_base(own: Any, what: str, base: type[Any]) -> None:
    """Raises ``UserError`` for an object of the user's own that is of no subclass of ``base``."""
    if not isinstance(own, base):
        raise UserError(
            f"{what}: must be of a subclass of {base.__name__} in {base.__module__}, "
            f"not {short_repr(own)}"
        )


class FramesOrigin(NamedTuple):
    """Where the frames of a source come from: ``Drives.digests`` and ``Drives.provenance``, once
    all drives are handed out.
    """

    digests: Mapping[str, str]
    provenance: Mapping[str, Mapping[str, Any]]


def origin_of(frames: Drives, source: str) -> FramesOrigin:
    """Of an open source by its name, checked if it is the user's own. Raises ``UserError``."""
    found = FramesOrigin(frames.digests(), frames.provenance())
    owner = plugins.own_label("frame source", source)
    if owner is not None:
        for name, told, kind in zip(FramesOrigin._fields, found, (str, Mapping), strict=True):
            holds = _is_json(told) and all(isinstance(item, kind) for item in told.values())
            what = "text" if kind is str else "a mapping that JSON can hold"
            require(holds, f"{owner}: {name}()", told, f"a mapping from name to {what}")
    return found


def _is_json(value: object) -> bool:
    try:
        return isinstance(value, Mapping) and bool(json.dumps(dict(value), allow_nan=False))
    except (TypeError, ValueError, RecursionError):
        return False


def check_drive(drive: Any, owner: str) -> None:
    """Checks a drive of an own source, frame by frame. Raises ``UserError``."""
    check_base(drive, f"{owner}: what drive() returns", Drive)
    for recording, frames in drive.frames.items():
        where = f"{owner}: drive().frames[{recording!r}]"
        require(isinstance(recording, str), where, recording, "text")
        require(len(frames) > 0, where, frames, "a sequence with at least one item")
        before_ns = -1
        for index, frame in enumerate(frames):
            _check_frame(frame, f"{where}[{index}]")
            later = f"above {before_ns}, that of the frame before"
            require(frame.stamp_ns > before_ns, f"{where}[{index}].stamp_ns", frame.stamp_ns, later)
            before_ns = frame.stamp_ns


def _check_frame(frame: Any, where: str) -> None:
    require(is_whole(frame.stamp_ns), f"{where}.stamp_ns", frame.stamp_ns, WHOLE)
    pose = frame.pose
    is_pose = isinstance(pose, tuple) and len(pose) == 4 and all(map(is_number, pose))
    require(is_pose, f"{where}.pose", pose, "a CameraPose of four numbers")
    require(is_whole(frame.size_bytes), f"{where}.size_bytes", frame.size_bytes, WHOLE)
    require(is_whole(frame.dhash, MAX_HASH), f"{where}.dhash", frame.dhash, f"{WHOLE}, of 64 bits")
    require(isinstance(frame.digest, str), f"{where}.digest", frame.digest, "text")
    fov_rad = frame.horizontal_fov_rad
    is_fov = is_number(fov_rad, 0.0) and fov_rad > 0
    require(is_fov, f"{where}.horizontal_fov_rad", fov_rad, "a number above 0")
    for detection in frame.detections:
        label, score = detection.label, detection.score
        require(isinstance(label, str), f"{where}.detections: label", label, "text")
        share = "a number from 0 to 1"
        require(is_number(score, 0.0, 1.0), f"{where}.detections: score", score, share)
