"""Compares answers with what the detector finds in the same frames: a proxy of correctness that
needs no labels.
"""

from collections.abc import Sequence

import numpy as np

from genie_sim.base.matching import SAME_M
from genie_sim.judge.joins import GroupedPlaces, matches, near
from genie_sim.judge.objects import Objects
from genie_sim.record.columns import Codes, Columns, Text
from genie_sim.record.log import ComparedAnswer
from genie_sim.record.tables import Table

WINDOW = 1024  # answers that are compared at once


class Agreement:
    """Writes rows of ``answers`` about one method, a window of answers at once.

    ``objects`` numbers the objects of answers, perhaps for others, too.
    """

    def __init__(self, method: str, table: Table, objects: Objects, window: int = WINDOW) -> None:
        self._method = method
        self._table = table
        self._objects = objects
        self._window = window
        self._answers: list[ComparedAnswer] = []

    def add(self, answer: ComparedAnswer) -> None:
        """Notes an answer; answers come in order."""
        self._answers.append(answer)
        if len(self._answers) >= self._window:
            self.close()

    def close(self) -> None:
        """Writes the rows of all answers so far."""
        answers, self._answers = self._answers, []
        objects = self._objects
        objects.begin_window()
        sides = [answer.served for answer in answers], [answer.detected for answer in answers]
        (served, of_served), (detected, of_detected) = map(objects.numbers, sides)
        known, classes = objects.columns(), len(objects.labels)
        places = []
        for number, counts in ((served, of_served), (detected, of_detected)):
            group = np.repeat(np.arange(len(answers)), counts) * classes + known.class_[number]
            places.append(GroupedPlaces(group, known.east_m[number], known.north_m[number]))
        pairs = near(places[0], places[1], SAME_M)
        pairs = pairs.rows(np.lexsort((pairs.theirs, pairs.ours, pairs.distance_m2)))
        of_pair = places[0].group[pairs.ours[matches(pairs)]] // max(classes, 1)
        matched = np.bincount(of_pair, minlength=len(answers))
        rows = np.repeat(np.arange(len(answers)), [len(answer.which) for answer in answers])
        headers = [answer.header for answer in answers]
        columns = {
            "method": _text([self._method] * len(answers))[rows],
            "car": _text([header.origin for header in headers])[rows],
            "stream": _text([header.frame_id for header in headers])[rows],
            "stamp_ns": np.array([header.stamp_ns for header in headers], dtype=np.int64)[rows],
            "which": _text([which for answer in answers for which in answer.which]),
            "source": _text([answer.source for answer in answers])[rows],
            "served": of_served[rows],
            "detected": of_detected[rows],
            "matched": matched[rows],
        }
        self._table.extend_columns(Columns(columns))


def _text(values: Sequence[str]) -> Text:
    codes = Codes()
    return Text.of(np.array([codes[value] for value in values], dtype=np.int64), list(codes))
