"""The laws of detectors that come with the package, measured on development drives.

``detector_laws.json`` has what was counted on each drive, and ``prior_looks``, for how many looks
the assumed laws count; ``tools/make/detector_laws.py`` writes it.
"""

import json
from collections.abc import Collection, Mapping
from functools import cache
from importlib import resources
from typing import Any

from genie_sim.tracks.laws import ASSUMED, DetectorLaws
from genie_sim.tracks.measure import LawCounts, shrunk, total


@cache
def shipped() -> dict[str, Any]:
    """The file: ``prior_looks``, and by detector and drive the counts."""
    path = resources.files(__package__) / "detector_laws.json"
    known: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return known


def measured_on(detectors: Collection[str], drives: Collection[str]) -> list[str]:
    """The drives that the laws to use on these ``drives`` rest on: those on which the detector was
    measured, but for these very ones, which would be known in advance. None where detectors are
    mixed.
    """
    if len(detectors) != 1:
        return []
    (detector,) = detectors
    return [drive for drive in shipped()["counts"].get(detector, {}) if drive not in drives]


def laws_of(
    detectors: Collection[str], drives: Collection[str], prior_looks: float | None = None
) -> DetectorLaws:
    """The laws to use on drives that these detectors have looked at, shrunk towards the assumed
    ones, which count for ``prior_looks`` looks; by default for as many as the file says. The
    assumed ones where nothing was measured.
    """
    known = measured_on(detectors, drives)
    if not known:
        return ASSUMED
    (detector,) = detectors
    of_drives = [LawCounts(**shipped()["counts"][detector][drive]) for drive in known]
    weight = shipped()["prior_looks"] if prior_looks is None else prior_looks
    return shrunk(total(of_drives), weight)


def facts(detectors: Collection[str], drives: Collection[str]) -> dict[str, Any] | None:
    """What the laws to use there rest on, as plain data; ``None`` where detectors are mixed or not
    told.
    """
    if len(detectors) != 1:
        return None
    (detector,) = detectors
    is_known = detector in shipped()["counts"]
    return {
        "detector": detector,
        "is_known": is_known,
        "measured_on": measured_on(detectors, drives),
    }


def looked_at(provenance: Mapping[str, Mapping[str, Any]]) -> tuple[set[str], set[str]]:
    """The detectors that looked at the drives of a frame source, as far as its provenance tells,
    and these drives.
    """
    traces = [about for about in provenance.values() if "detector" in about]
    return (
        {str(about["detector"]) for about in traces},
        {str(about["drive"]) for about in traces if "drive" in about},
    )
