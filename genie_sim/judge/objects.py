"""The objects of many answers, as columns."""

from array import array
from collections.abc import Sequence
from itertools import chain, compress
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from genie_sim.base.classes import class_of
from genie_sim.core.messages import Detection
from genie_sim.judge.joins import Array
from genie_sim.record.columns import Codes

_label = attrgetter("label")
_location = attrgetter("location")
_motion = attrgetter("motion")


class LabelCodes(dict[str, tuple[int, int]]):
    """Of each label its code and that of its class; both stand in ``codes``."""

    def __init__(self) -> None:
        super().__init__()
        self.codes: Codes = Codes()

    def __missing__(self, label: str) -> tuple[int, int]:
        codes = self.codes[label], self.codes[class_of(label)]
        self[label] = codes
        return codes


class ShownObjects(NamedTuple):
    """Columns (n,), a row per object: codes of its label and of its class, where it is [m], and of
    a track its velocity [m/s], else 0.
    """

    label: Array
    class_: Array
    east_m: Array
    north_m: Array
    velocity_east_mps: Array
    velocity_north_mps: Array

    @classmethod
    def of(
        cls, lists: Sequence[Sequence[Detection]], labels: LabelCodes
    ) -> "tuple[ShownObjects, Array]":
        """Those objects of some lists that have a place, list by list, and how many there are in
        each list.
        """
        objects = list(chain.from_iterable(lists))
        is_placed = [item.location is not None for item in objects]
        placed = list(compress(objects, is_placed))
        ends = np.cumsum([0, *map(len, lists)])
        counts = np.diff(np.cumsum([0, *is_placed])[ends])
        codes = array("q", chain.from_iterable([labels[label] for label in map(_label, placed)]))
        places = array("d", chain.from_iterable(map(_location, placed)))
        velocities_mps = np.zeros((len(placed), 2))
        motions = list(map(_motion, placed))
        if any(motions):
            for row, motion in enumerate(motions):
                if motion is not None:
                    velocities_mps[row] = motion.velocity_mps
        columns = cls(
            *np.frombuffer(codes, dtype=np.int64).reshape(-1, 2).T,
            *np.frombuffer(places).reshape(-1, 3).T[:2],
            *velocities_mps.T,
        )
        return columns, counts
