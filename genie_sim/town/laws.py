"""The laws of a detector: how likely it misses an object, its score, and where it places it.

They are read from ``laws.json``, fitted on a real trace (``benchmarks/town_fit``). A Gaussian copula ties the looks at
one object together: each look has a standard normal number

    z = object_weight * Z(object) + view_weight * Z(object, view) + look_weight * Z(object, look)

of which the first part stays with the object, the second changes gradually as camera and object move, and the third
is new each time. The object is missed where z falls below the quantile of the miss probability at its range; above
it, the score rises with z through the quantiles of the scores seen at that range. Two such numbers of their own place
it, along the line of sight and across.
"""

import functools
import json
from collections.abc import Mapping, Sequence
from importlib import resources
from itertools import accumulate
from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np

from genie_sim.core.geometry import Array
from genie_sim.perception.trace import SCORE_DECIMALS
from genie_sim.town.noise import smooth_normals
from genie_sim.town.rules import MOST_VIEW_M

GROUP_OF = {"car": "vehicles", "truck": "vehicles", "bus": "vehicles"}  # all others: persons
STEPS_PER_Z, MIDDLE = (
    32.0,
    32 * 7,
)  # tables cover z from -7 to 7: three numbers of at most 3.7, weights of norm 1
VIEW_STEP_M = 0.25
PLACE_DECIMALS = 6
PRONE = 1 << 12
GHOST_LABELS = {"vehicles": "car", "persons": "person"}
RANGES = MOST_VIEW_M + 2  # rows of a table, one a metre


class Copula(NamedTuple):
    """The weights of what stays with the object, of what changes with the view and of what is new at each look, and
    the normal numbers of the views, in steps of ``VIEW_STEP_M``."""

    object_weight: float
    view_weight: float
    look_weight: float
    views: Sequence[float] | Array


class Copulas(NamedTuple):
    """The same of all groups, by their places, and their tables (groups, RANGES, steps of z)."""

    view_weight: Array
    look_weight: Array
    views: Array
    table: Array


class GroupLaws:
    """One group's laws as tables by range [m] and z; a score of 0 is a miss.

    Of ``PRONE`` objects so many are ``prone`` to get another label at times: ``names`` are the running shares of
    65,536 looks, and the names.
    """

    __slots__ = (
        "across",
        "across_m",
        "along",
        "along_m",
        "names",
        "place",
        "prone",
        "score",
        "scores",
    )

    def __init__(self, fitted: Mapping[str, Any], place: int) -> None:
        self.place = place  # among all groups
        found, placed = fitted["found"], fitted["place"]
        self.score, self.along, self.across = (
            _copula(fitted[f"{name}_correlation"]) for name in ("score", "along", "across")
        )
        self.scores = _score_table(found)
        self.along_m = _place_table(placed, "along_m")
        self.across_m = _place_table(placed, "across_m")
        self.names: tuple[tuple[int, str], ...] = ()
        self.prone = 0


class TransientLaw(NamedTuple):
    """False positives that are seen once: how many per frame; quantiles of their ranges [m] and of their scores."""

    label: str
    per_frame: float
    range_m: tuple[float, ...]
    scores: tuple[float, ...]


class DetectorLaws:
    """All laws: of real objects, of ghosts that stand at places where nothing is, and of transient ones."""

    def __init__(self, fitted: Mapping[str, Any]) -> None:
        self.provenance: Mapping[str, Any] = fitted["provenance"]
        self.digest = str(
            fitted.get("digest", "")
        )  # given when they were fitted; it seeds what towns draw from them
        called = fitted["vehicle_names"]
        running = accumulate(round(share * 0x10000) for _, share in called["names"])
        names = tuple(
            (share, str(name)) for share, (name, _) in zip(running, called["names"], strict=True)
        )
        self.groups: list[GroupLaws] = []
        self._real = {name: self._group(group) for name, group in fitted["groups"].items()}
        self._real["vehicles"].names, self._real["vehicles"].prone = (
            names,
            round(called["prone"] * PRONE),
        )
        self._ghosts = {
            name: self._group(group) for name, group in fitted["ghosts"].items() if group["places"]
        }
        named = (("score", "scores"), ("along", "along_m"), ("across", "across_m"))
        self.copulas = [self._together(*names) for names in named]
        smooth_normals.cache_clear()  # each group has its row by now
        ghosts = [(GHOST_LABELS[name], group) for name, group in sorted(fitted["ghosts"].items())]
        self.ghosts_per_100m = {
            label: float(group["per_100m"]) for label, group in ghosts if group["places"]
        }
        self.transient = tuple(
            TransientLaw(
                label,
                group["fleeting_a_frame"],
                tuple(group["fleeting_range_m"]),
                tuple(group["fleeting_scores"]),
            )
            for label, group in ghosts
        )

    def _together(self, name: str, table_name: str) -> Copulas:
        """Of all groups, of which each then has a row: they are large."""
        weights = np.array([getattr(group, name)[1:3] for group in self.groups]).T
        views = np.stack([getattr(group, name).views for group in self.groups])
        tables = np.stack([getattr(group, table_name) for group in self.groups])
        for group, row, table in zip(self.groups, views, tables, strict=True):
            setattr(group, name, getattr(group, name)._replace(views=row))
            setattr(group, table_name, table)
        return Copulas(weights[0], weights[1], views, tables)

    def _group(self, fitted: Mapping[str, Any]) -> GroupLaws:
        self.groups.append(GroupLaws(fitted, len(self.groups)))
        return self.groups[-1]

    def of(self, label: str, real: bool = True) -> GroupLaws:
        """The laws for a class. Lights, signs, furniture and bicycles have no labels in KITTI that the detector could
        be judged by: they follow the laws of persons, which is assumed."""
        return (self._real if real else self._ghosts)[GROUP_OF.get(label, "persons")]


@functools.cache
def detector_laws() -> DetectorLaws:
    """The laws that come with genie-sim."""
    text = resources.files("genie_sim.town").joinpath("laws.json").read_text(encoding="utf-8")
    return DetectorLaws(json.loads(text))


def _copula(fitted: Mapping[str, float]) -> Copula:
    shares = fitted["object"], fitted["view"], max(0.0, 1.0 - fitted["object"] - fitted["view"])
    of_object, of_view, of_look = (share**0.5 for share in shares)
    return Copula(of_object, of_view, of_look, smooth_normals(VIEW_STEP_M / fitted["smooth_m"]))


def quantile(quantiles: Sequence[float], u: float) -> float:
    """The value below which a share ``u`` in [0, 1) lies, of evenly spaced quantiles."""
    place = u * (len(quantiles) - 1)
    i = int(place)
    return quantiles[i] + (quantiles[i + 1] - quantiles[i]) * (place - i)


def _by_range(centres_m: Sequence[float], values: Sequence[float]) -> Array:
    """Values at every metre, in straight lines between the middles of the bins."""
    values_at: Array = np.interp(np.arange(RANGES), centres_m, values)
    return values_at


def _quantiles_by_range(centres_m: Sequence[float], rows: Sequence[Sequence[float]]) -> Array:
    """Quantiles (RANGES, n) at every metre."""
    return np.array([_by_range(centres_m, column) for column in zip(*rows, strict=True)]).T


def _score_table(found: Mapping[str, Any]) -> Array:
    miss = _by_range(found["range_m"], found["miss"])[:, None]
    quantiles = _quantiles_by_range(found["range_m"], found["scores"])
    share = (_share(0.5) - miss) / (1.0 - miss)
    levels = np.linspace(0.0, 1.0, quantiles.shape[1])
    scores = np.array([np.interp(u, levels, row) for u, row in zip(share, quantiles, strict=True)])
    return _table(np.where(_share(0.5) > miss, scores, 0.0), SCORE_DECIMALS)


def _place_table(place: Mapping[str, Any], name: str) -> Array:
    quantiles = _quantiles_by_range(place["range_m"], place[name])
    levels = np.linspace(0.0, 1.0, quantiles.shape[1])
    return _table(
        np.array([np.interp(_share(0.5), levels, row) for row in quantiles]), PLACE_DECIMALS
    )


def _share(step: float) -> Array:
    """The share of z below each column of a table, or so many steps above it."""
    columns = np.arange(2 * MIDDLE + 2)
    return np.array(
        [NormalDist().cdf(z) for z in ((columns + step - MIDDLE) / STEPS_PER_Z).tolist()]
    )


def _table(values: Array, decimals: int) -> Array:
    rounded: Array = np.round(values, decimals)
    return rounded
