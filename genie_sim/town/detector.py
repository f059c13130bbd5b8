"""The town's detector: what the laws let a detector find of what a camera has in view."""

import math
from typing import Any, NamedTuple

import numpy as np

from genie_sim.core.geometry import Array
from genie_sim.messages import CameraPose, Detection
from genie_sim.perception.trace import POSITION_DECIMALS, SCORE_DECIMALS
from genie_sim.town.laws import (
    MIDDLE,
    STEPS_PER_Z,
    VIEW_STEP_M,
    Copulas,
    DetectorLaws,
    TransientLaw,
    quantile,
)
from genie_sim.town.noise import NORMAL_MASK, SMOOTH_MASK, normals
from genie_sim.town.objects import HORIZONTAL_FOV_RAD, MIDDLES_M, Things
from genie_sim.town.streets import Ints
from genie_sim.town.view import Looks, View

ALONG, ACROSS = 21 * 1021, 43 * 1021  # far apart in the gradual numbers: these are not the score's


class Found(NamedTuple):
    """What the detector finds in some looks, look by look: its class, and its score and place [m] (n, 4); ``begins`` is
    where each look's rows begin, and where the last one's end."""

    begins: list[int]
    label: Array
    placed: Array

    def of(self, look: int) -> list[Detection]:
        """What it finds in one look, in the order of the view."""
        rows = slice(self.begins[look], self.begins[look + 1])
        found = zip(self.label[rows].tolist(), self.placed[rows].tolist(), strict=True)
        return [
            Detection(label, score, None, (x, y, z), score, "town")
            for label, (score, x, y, z) in found
        ]


class SyntheticDetector:
    """Finds, misses and imagines objects as the laws say, for a camera that stands anywhere in a scene."""

    def __init__(self, things: Things, laws: DetectorLaws) -> None:
        """``things`` are all that views are of."""
        self._things = things
        self._groups, self._copulas = laws.groups, laws.copulas
        self._normals = np.array(normals())
        self._prone = np.array([group.prone for group in laws.groups])

    def detect(self, view: View, looks: Looks) -> Found:
        """What the detector finds of what is in view."""
        things, of_score, along, across = self._things, *self._copulas
        gone_m, quarter = _gone(looks)
        look, thing, range_m = view.look, view.thing, view.range_m
        step = (
            ((range_m - gone_m[look]) / VIEW_STEP_M).astype(np.int64)
            + things.offset[thing]
            + quarter[look]
        )
        bits = (things.key[thing] ^ looks.key[look]) * np.uint64(0xBF58476D1CE4E5B9)
        bits ^= bits >> np.uint64(32)

        def drawn(
            law: Copulas, of_object: Array, step: Ints, bits: Any, place: tuple[Ints, Ints]
        ) -> Array:
            group = place[0]
            z = of_object + law.view_weight[group] * law.views[group, step & SMOOTH_MASK]
            z += (
                law.look_weight[group]
                * self._normals[(bits & np.uint64(NORMAL_MASK)).astype(np.int64)]
            )
            values: Array = law.table[(*place, (z * STEPS_PER_Z + MIDDLE).astype(np.int64))]
            return values

        place = things.group[thing], (range_m + 0.5).astype(np.int64)
        score = drawn(of_score, things.score_z[thing], step, bits, place)
        kept = np.flatnonzero(score)
        look, thing, range_m, step, bits = (
            look[kept],
            thing[kept],
            range_m[kept],
            step[kept],
            bits[kept],
        )
        place = place[0][kept], place[1][kept]
        along_m = (
            drawn(along, things.along_z[thing], step + ALONG, bits >> np.uint64(12), place)
            / range_m
        )
        across_m = (
            drawn(across, things.across_z[thing], step + ACROSS, bits >> np.uint64(24), place)
            / range_m
        )
        east_m, north_m = view.east_m[kept], view.north_m[kept]
        dx, dy = east_m - looks.east_m[look], north_m - looks.north_m[look]
        placed = np.empty((len(kept), 4))
        placed[:, 0], placed[:, 3] = score[kept], things.up_m[thing]
        placed[:, 1] = (
            np.floor((east_m + along_m * dx - across_m * dy) * 1000.0 + 0.5) / 1000.0
        )  # in whole millimetres
        placed[:, 2] = np.floor((north_m + along_m * dy + across_m * dx) * 1000.0 + 0.5) / 1000.0
        begins = np.searchsorted(look, np.arange(len(looks.key) + 1)).tolist()
        return Found(begins, self._called(thing, place[0], bits), placed)

    def _called(self, thing: Ints, group: Ints, bits: Any) -> Any:
        """What the detector calls these things."""
        things = self._things
        label = things.label[thing]
        prone = np.flatnonzero(
            (things.key[thing] >> np.uint64(52)).astype(np.int64) < self._prone[group]
        )
        for row, draw in zip(
            prone.tolist(), (bits[prone] >> np.uint64(40) & np.uint64(0xFFFF)).tolist(), strict=True
        ):
            label[row] = next(
                (name for share, name in self._groups[group[row]].names if draw < share), label[row]
            )
        return label


def _gone(looks: Looks) -> tuple[Array, Ints]:
    """How far [m] a camera has gone along its street, and where the gradual numbers of its direction begin.

    The view changes as the camera goes on and the range shrinks; turning into another street is another view.
    """
    x, y, c, s = looks[:4]
    on_east = np.abs(c) > np.abs(s)
    gone_m = np.where(on_east, np.where(c > 0, x, -x), np.where(s > 0, y, -y))
    quarter = np.where(on_east, np.where(c > 0, 0, 1), np.where(s > 0, 2, 3)) * 16411
    return gone_m, quarter


def transient(law: TransientLaw, bits: int, pose: CameraPose, c: float, s: float) -> Detection:
    """A false positive that is seen once, anywhere in view of a camera."""
    range_m = quantile(law.range_m, (bits >> 16 & 0xFFFF) / 0x10000)
    angle = ((bits >> 32 & 0xFFFF) / 0x10000 - 0.5) * HORIZONTAL_FOV_RAD
    score = round(quantile(law.scores, (bits >> 48) / 0x10000), SCORE_DECIMALS)
    ahead_m, left_m = range_m * math.cos(angle), range_m * math.sin(angle)
    east_m, north_m = (
        pose.east_m + ahead_m * c - left_m * s,
        pose.north_m + ahead_m * s + left_m * c,
    )
    location = (
        round(east_m, POSITION_DECIMALS),
        round(north_m, POSITION_DECIMALS),
        MIDDLES_M[law.label],
    )
    return Detection(law.label, score, None, location, score, "town")
