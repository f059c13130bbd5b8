"""Compares answers with what the detector finds in the same frames: a proxy of correctness that
needs no labels.
"""

from collections.abc import Sequence

import numpy as np

from genie_sim.base.matching import SAME_M
from genie_sim.judge.joins import Array, GroupedPlaces, matches, near, pair_codes
from genie_sim.judge.objects import LabelCodes, ShownObjects
from genie_sim.record.columns import Codes, Columns, Text
from genie_sim.record.log import ComparedAnswer
from genie_sim.record.tables import Table

WINDOW = 1024  # answers that are compared at once


class Agreement:
    """Writes rows of ``answers`` about one method, a window of answers at once."""

    def __init__(self, method: str, table: Table, window: int = WINDOW) -> None:
        self._method = method
        self._table = table
        self._labels = LabelCodes()
        self._window = window
        self._answers: list[ComparedAnswer] = []

    def add(self, answer: ComparedAnswer) -> None:
        """Notes an answer; answers come in order."""
        self._answers.append(answer)
        if len(self._answers) >= self._window:
            self._write()

    def close(self) -> None:
        """There are no more answers."""
        self._write()

    def _write(self) -> None:
        """Writes the rows of the window."""
        answers, self._answers = self._answers, []
        served, of_served = ShownObjects.of([answer.served for answer in answers], self._labels)
        detected, of_detected = ShownObjects.of(
            [answer.detected for answer in answers], self._labels
        )
        answer_of = np.repeat(np.arange(len(answers)), of_served)
        pairs = near(
            self._places(served, answer_of),
            self._places(detected, np.repeat(np.arange(len(answers)), of_detected)),
            SAME_M,
        )
        matched = np.bincount(answer_of[matches(pairs).ours], minlength=len(answers))
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

    def _places(self, objects: ShownObjects, answer: Array) -> GroupedPlaces:
        """Where objects are; those of one answer and class are a group."""
        group = pair_codes(answer, objects.class_, len(self._labels.codes))
        return GroupedPlaces(group, objects.east_m, objects.north_m)


def _text(values: Sequence[str]) -> Text:
    codes = Codes()
    return Text.of(np.array([codes[value] for value in values], dtype=np.int64), list(codes))
