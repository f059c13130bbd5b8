"""The laws of detectors that come with the package, each measured on drives of its own.

``detector_laws.json`` is written by ``benchmarks/detector_laws.py``.
"""

import json
from collections.abc import Collection
from functools import cache
from importlib import resources
from typing import Any

from genie_sim.core.freshness.laws import ASSUMED, DetectorLaws


@cache
def _shipped() -> dict[str, dict[str, Any]]:
    """What is known of each detector, by its name."""
    path = resources.files(__package__) / "detector_laws.json"
    detectors: dict[str, dict[str, Any]] = json.loads(path.read_text(encoding="utf-8"))
    return detectors


def detector_laws(detectors: Collection[str], drives: Collection[str]) -> DetectorLaws:
    """The laws to use on drives that these detectors have looked at.

    They are the assumed ones where no laws come with the detector, where detectors are mixed, and
    on the very drives that the laws were measured on: those would be known in advance.
    """
    if len(detectors) != 1:
        return ASSUMED
    (detector,) = detectors
    known = _shipped().get(detector)
    if known is None or not set(known["drives"]).isdisjoint(drives):
        return ASSUMED
    return DetectorLaws(*(tuple(known[law]) for law in DetectorLaws._fields))
