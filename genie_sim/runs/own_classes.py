"""Classes of the user's own in a run: what is wrong with one ends the run with its name."""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, NamedTuple

from genie_sim.base import plugins
from genie_sim.base.contracts import require
from genie_sim.base.errors import UserError, first_line, short_repr
from genie_sim.data.frame_source import Drives
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
