"""What each part of a frame's way takes of the mean response times."""

from collections.abc import Mapping
from itertools import product
from typing import NamedTuple

import numpy as np

from genie_sim.analysis.frame_metrics import ANSWERS
from genie_sim.analysis.metric import LOWER, Metric, Views, Where
from genie_sim.analysis.statistics import Measured
from genie_sim.base.units import NS_PER_MS
from genie_sim.record.columns import Columns
from genie_sim.record.results import MethodInfo

# what each part of a mean took, by answer
PART = {"first": "first_answer_part", "fresh": "fresh_answer_part"}


class PartOfTime(NamedTuple):
    """What a part took of all frames that got an answer [ns], and how many these are."""

    answer: str
    sum_ns: float
    n: int


def views(
    tables: Mapping[str, Columns], methods: Mapping[str, MethodInfo], intervals: bool
) -> Views:
    """Each part of the time of each method's answers, with the part as component."""
    if "steps" not in tables:
        return
    steps, frames = tables["steps"], tables["frames"]
    for method, answer in product(methods, PART):
        answered = frames.where(method=method).floats(f"{answer}_answer_ns")
        n = int((~np.isnan(answered)).sum())
        rows = steps.where(method=method)
        rows = rows.rows(rows["which"].isin((answer, "both")))
        parts = rows["part"]
        sums_ns = np.bincount(parts.codes, rows["end_ns"] - rows["begin_ns"], len(parts.names))
        for part, sum_ns in zip(parts.names, sums_ns.tolist(), strict=True):
            if n and sum_ns:
                yield Where(method, component=part), PartOfTime(answer, sum_ns, n)


class PartOfAnswer(Metric):
    """Where the time until an answer goes."""

    unit = "ms"
    better = LOWER
    view = PartOfTime

    def __init__(self, answer: str) -> None:
        self._answer = answer
        self.title = f"part of the {ANSWERS[answer]}"
        self.meaning = (
            "Mean time that a part takes from when a frame reaches the queue of its first ROS node "
            f"to its {ANSWERS[answer]}."
        )
        self.reads = f"steps: which, part, begin_ns, end_ns; frames: {answer}_answer_ns"

    def of(self, view: PartOfTime) -> Measured | None:
        """Over all frames that got the answer; the parts add up to the mean response time."""
        if view.answer != self._answer:
            return None
        return Measured(view.sum_ns / view.n / NS_PER_MS, n=view.n)


METRICS = {name: PartOfAnswer(answer) for answer, name in PART.items()}
