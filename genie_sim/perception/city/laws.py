"""The laws of a detector: how likely it misses an object, how sure it is of it, and where it puts it.

They are read from ``laws.json``, fitted on a real trace (``fit``). A Gaussian copula ties the looks at one object
together: each look has a standard normal number

    z = object_weight * Z(object) + view_weight * Z(object, view) + look_weight * Z(object, look)

of which the first part stays with the object, the second changes gradually as camera and object move, and the third
is new each time. The object is missed where z falls below the quantile of the miss probability at its range; above
it, the score rises with z through the quantiles of the scores seen at that range. Two such numbers of their own place
it, along the line of sight and across.
"""

from __future__ import annotations

import functools
import hashlib
import json
from bisect import bisect_right
from collections.abc import Mapping
from importlib import resources
from statistics import NormalDist
from typing import Any

GROUP_OF = {"car": "vehicles", "truck": "vehicles", "bus": "vehicles"}  # all others: persons
LOWEST_Z, STEPS_PER_Z, STEPS = -4.0, 16.0, 128
VIEW_STEP_M = 0.25
RANGES = 101  # rows of a table, one a metre

Table = tuple[tuple[float, ...], ...]


def group_of(label: str) -> str:
    """Whose laws hold for a class. Lights, signs and furniture have no labels in KITTI: those of persons, assumed."""
    return GROUP_OF.get(label, "persons")


class GroupLaws:
    """One group's laws as tables by range [m] and z; a score of 0 is a miss."""

    __slots__ = ("across_m", "along_m", "place_weights", "scores", "weights")

    def __init__(self, fitted: Mapping[str, Any]) -> None:
        found, place = fitted["found"], fitted["place"]
        self.weights = _weights(fitted["score_correlation"])
        self.place_weights = _weights(fitted["place_correlation"])
        self.scores: Table = tuple(_score_row(found, r) for r in range(RANGES))
        self.along_m: Table = tuple(_quantile_row(place, "along_m", r) for r in range(RANGES))
        self.across_m: Table = tuple(_quantile_row(place, "across_m", r) for r in range(RANGES))


class DetectorLaws:
    """All laws: per group those of real objects, and those of ghosts, which stand at places where nothing is."""

    def __init__(self, fitted: Mapping[str, Any]) -> None:
        self.fitted = fitted
        self.provenance: Mapping[str, Any] = fitted["provenance"]
        self.digest = hashlib.sha256(json.dumps(fitted, sort_keys=True).encode()).hexdigest()
        self.smooth_m = float(fitted["smooth_m"])
        self.groups = {name: GroupLaws(group) for name, group in fitted["groups"].items()}
        self.ghosts = {name: GroupLaws(group) for name, group in fitted["ghosts"].items()}
        self.ghosts_per_100m = {
            {"vehicles": "car", "persons": "person"}[name]: float(group["per_100m"])
            for name, group in fitted["ghosts"].items()
        }
        # For a true vehicle: from which z on the detector calls it something else.
        self.other_names = tuple((str(name), float(share)) for name, share in fitted["vehicle_names"])


@functools.cache
def detector_laws() -> DetectorLaws:
    """The laws that come with genie-sim."""
    text = resources.files("genie_sim.perception.city").joinpath("laws.json").read_text(encoding="utf-8")
    return DetectorLaws(json.loads(text))


def _weights(correlation: Mapping[str, float]) -> tuple[float, float, float]:
    """Weights of object, view and look, from the shares of the variance."""
    shares = correlation["object"], correlation["view"]
    return shares[0] ** 0.5, shares[1] ** 0.5, max(0.0, 1.0 - sum(shares)) ** 0.5


def _between(centres: list[float], r: float) -> tuple[int, int, float]:
    """The two bins around a range, and the weight of the second."""
    k = bisect_right(centres, r)
    if k == 0 or k == len(centres):
        k = min(max(k - 1, 0), len(centres) - 1)
        return k, k, 0.0
    return k - 1, k, (r - centres[k - 1]) / (centres[k] - centres[k - 1])


def _at(quantiles: list[float], u: float) -> float:
    place = min(max(u, 0.0), 1.0) * (len(quantiles) - 1)
    i = min(int(place), len(quantiles) - 2)
    return quantiles[i] + (quantiles[i + 1] - quantiles[i]) * (place - i)


def _mixed(rows: list[list[float]], a: int, b: int, weight: float, u: float) -> float:
    return _at(rows[a], u) * (1 - weight) + _at(rows[b], u) * weight


def _score_row(found: Mapping[str, Any], r: float) -> tuple[float, ...]:
    a, b, weight = _between(found["range_m"], r)
    miss = found["miss"][a] * (1 - weight) + found["miss"][b] * weight
    cdf = NormalDist().cdf
    row = []
    for i in range(STEPS + 2):
        z = LOWEST_Z + i / STEPS_PER_Z
        if cdf(z + 0.5 / STEPS_PER_Z) <= miss:
            row.append(0.0)
        else:
            row.append(_mixed(found["scores"], a, b, weight, (cdf(z) - miss) / (1 - miss)))
    return tuple(row)


def _quantile_row(place: Mapping[str, Any], name: str, r: float) -> tuple[float, ...]:
    a, b, weight = _between(place["range_m"], r)
    cdf = NormalDist().cdf
    return tuple(_mixed(place[name], a, b, weight, cdf(LOWEST_Z + i / STEPS_PER_Z)) for i in range(STEPS + 2))
