"""The laws of a detector: how likely it misses an object, its score, and where it places it.

A Gaussian copula ties the looks at one object together: each look has a standard normal number

    z = object_weight * Z(object) + view_weight * Z(object, view) + look_weight * Z(object, look)

of which the first part stays with the object, the second changes gradually as camera and object
move, and the third is new each time. The object is missed where z falls below the quantile of the
miss probability at its range; above it, the score rises with z through the quantiles of the scores
seen at that range. Two such numbers of their own place it, along the line of sight and across.

The numbers are read from ``laws.json``, fitted on a real trace (``tools/make/town_fit``). Its
``groups`` are ``vehicles`` and ``persons``, each with

- ``found``: of some ranges [m] (``range_m``, the middles of bins) how many ``looks`` there were,
  the probability of a ``miss``, and 21 evenly spaced quantiles of the ``scores``;
- ``place``: likewise the quantiles of the errors [m], ``along_m`` the line of sight (behind the
  object is positive) and ``across_m`` it (left is positive);
- ``score_correlation``, ``along_correlation``, ``across_correlation``: the shares of the variance
  of z that stay with the ``object`` and with the ``view``, and after how many metres of change the
  numbers of views are correlated by 1/e (``smooth_m``).

``ghosts`` has the false positives by the same groups: those at ``places`` where they come back, so
many ``per_100m`` of street, with laws like those of real objects; and fleeting ones, which are seen
once, so many in a frame (``fleeting_a_frame``), with quantiles of their ranges [m] and scores.
``vehicle_names``: the share of vehicles that are ``prone`` to be called something else, and of
their looks the share with each of the ``names``. ``provenance`` says what they were fitted on.
"""

import functools
import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from importlib import resources
from itertools import accumulate
from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np

from genie_sim.base.classes import GROUPS, VEHICLES
from genie_sim.base.geometry import Array
from genie_sim.data.trace import SCORE_DECIMALS
from genie_sim.worlds.scene.keys import LOOK_NAME, OBJECT_PRONE
from genie_sim.worlds.scene.noise import ACROSS, ALONG, VIEW_STEP_M, smooth_normals

# tables cover z from -7 to 7: three numbers of at most 3.7, weights of norm 1
STEPS_PER_Z, MIDDLE = 32.0, 32 * 7
PLACE_DECIMALS = 6
MAX_VIEW_M = 100  # beyond, no law is known
RANGES = MAX_VIEW_M + 2  # rows of a table, one a metre


class Copula(NamedTuple):
    """How the score, or one of the errors of a place, is drawn and what the drawn number means.

    By group: the weights of what stays with the object, of what changes with the view and of what
    is new at each look, each (groups,); the normal numbers of the views, in rows of
    ``noise.smooth_row``, (groups, 65,536); and the value for each range and z, (groups, RANGES,
    steps).
    """

    object_weight: Array
    view_weight: Array
    look_weight: Array
    views: Array
    table: Array


class FleetingLaw(NamedTuple):
    """Fleeting false positives, which are seen once: how many per frame; quantiles of their ranges
    [m] and of their scores.
    """

    label: str
    per_frame: float
    ranges_m: tuple[float, ...]
    scores: tuple[float, ...]


class FittedLaws:
    """All laws: of real objects, of ghosts that stand at places where nothing is, and of fleeting
    ones. A score of 0 is a miss.

    An object whose ``OBJECT_PRONE`` is below the number ``prone`` of its group (groups,) gets
    another label at times: the first of ``names`` whose number is above the look's ``LOOK_NAME``,
    if there is one.
    """

    def __init__(self, fitted: Mapping[str, Any]) -> None:
        self.provenance: Mapping[str, Any] = fitted["provenance"]
        # what towns are made from, so that other laws are another town
        self.digest = hashlib.sha256(json.dumps(fitted, sort_keys=True).encode()).hexdigest()
        real, ghosts = fitted["groups"], fitted["ghosts"]
        lasting = {name: group for name, group in ghosts.items() if group["places"]}
        groups = [*real.values(), *lasting.values()]
        smooth = functools.cache(smooth_normals)  # for now: its rows are large
        self.score, self.along, self.across = (
            _copula(
                smooth,
                [group[f"{name}_correlation"] for group in groups],
                [_table(name, group) for group in groups],
                first_row=first_row,
            )
            for name, first_row in (("score", 0), ("along", ALONG), ("across", ACROSS))
        )
        kinds = [(name, True) for name in real] + [(name, False) for name in lasting]
        self._groups = {kind: number for number, kind in enumerate(kinds)}
        renamed = fitted["vehicle_names"]
        self.prone = np.zeros(len(groups), dtype=np.int64)
        self.prone[self.group_of("car")] = round(renamed["prone"] * (1 << OBJECT_PRONE.bits))
        limits = accumulate(round(share * (1 << LOOK_NAME.bits)) for _, share in renamed["names"])
        names = [str(name) for name, _ in renamed["names"]]
        self.names = tuple(zip(limits, names, strict=True))
        labelled = [(GROUPS[name][0], group) for name, group in sorted(ghosts.items())]
        self.ghosts_per_100m = {
            label: float(group["per_100m"]) for label, group in labelled if group["places"]
        }
        self.fleeting = tuple(
            FleetingLaw(
                label,
                group["fleeting_a_frame"],
                tuple(group["fleeting_range_m"]),
                tuple(group["fleeting_scores"]),
            )
            for label, group in labelled
        )

    def group_of(self, label: str, real: bool = True) -> int:
        """The group of a class. Lights, signs, furniture and bicycles have no labels in KITTI that
        the detector could be judged by: they follow the laws of persons, which is assumed.
        """
        return self._groups["vehicles" if label in VEHICLES else "persons", real]


@functools.cache
def synthetic_laws() -> FittedLaws:
    """The laws that come with genie-sim."""
    path = resources.files(__package__) / "laws.json"
    return FittedLaws(json.loads(path.read_text(encoding="utf-8")))


def _copula(
    smooth: Callable[[float], Array],
    correlations: Sequence[Mapping[str, float]],
    tables: Sequence[Array],
    *,
    first_row: int,
) -> Copula:
    """The copula of all groups, from smooth numbers (``noise.smooth_normals``) with the row that
    becomes their first, the fitted shares of the variance and the table of each.
    """
    weights = []
    for fitted in correlations:
        rest = max(0.0, 1.0 - fitted["object"] - fitted["view"])
        weights.append([share**0.5 for share in (fitted["object"], fitted["view"], rest)])
    of_object, of_view, of_look = np.array(weights).T
    views = [
        np.roll(smooth(VIEW_STEP_M / fitted["smooth_m"]), -first_row) for fitted in correlations
    ]
    return Copula(
        object_weight=of_object,
        view_weight=of_view,
        look_weight=of_look,
        views=np.stack(views),
        table=np.stack(tables),
    )


def quantile(quantiles: Sequence[float], u: float) -> float:
    """The value below which a share ``u`` in [0, 1) lies, of evenly spaced quantiles."""
    steps = u * (len(quantiles) - 1)
    i = int(steps)
    return quantiles[i] + (quantiles[i + 1] - quantiles[i]) * (steps - i)


def _by_range(centres_m: Sequence[float], values: Sequence[float]) -> Array:
    """Values at every metre, in straight lines between the middles of the bins."""
    values_at: Array = np.interp(np.arange(RANGES), centres_m, values)
    return values_at


def _quantiles_by_range(centres_m: Sequence[float], rows: Sequence[Sequence[float]]) -> Array:
    """Quantiles (RANGES, n) at every metre."""
    return np.array([_by_range(centres_m, column) for column in zip(*rows, strict=True)]).T


def _table(name: str, group: Mapping[str, Any]) -> Array:
    """The values of the copula called so, (RANGES, steps of z)."""
    if name == "score":
        return _score_table(group["found"])
    return _place_table(group["place"], f"{name}_m")


def _score_table(fitted: Mapping[str, Any]) -> Array:
    """Scores (RANGES, steps of z) from the fitted probabilities of a miss and quantiles."""
    miss = _by_range(fitted["range_m"], fitted["miss"])[:, None]
    quantiles = _quantiles_by_range(fitted["range_m"], fitted["scores"])
    share = (_shares() - miss) / (1.0 - miss)
    levels = np.linspace(0.0, 1.0, quantiles.shape[1])
    scores = np.array([np.interp(u, levels, row) for u, row in zip(share, quantiles, strict=True)])
    scores[_shares() <= miss] = 0.0
    return scores.round(SCORE_DECIMALS)


def _place_table(fitted: Mapping[str, Any], name: str) -> Array:
    """Errors of a place (RANGES, steps of z) from the fitted quantiles."""
    quantiles = _quantiles_by_range(fitted["range_m"], fitted[name])
    levels = np.linspace(0.0, 1.0, quantiles.shape[1])
    errors_m = np.array([np.interp(_shares(), levels, row) for row in quantiles])
    return errors_m.round(PLACE_DECIMALS)


@functools.cache
def _shares() -> Array:
    """The share of z below the middle of each column of a table."""
    columns = np.arange(2 * MIDDLE + 2)
    middles_z = (columns + 0.5 - MIDDLE) / STEPS_PER_Z
    return np.array([NormalDist().cdf(z) for z in middles_z.tolist()])
