"""Correctness metrics, computed from the tables ``answers`` and ``held``.

Sums are over answers or instants (micro averages); intervals are from blocks of one second.
"""

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from genie_sim.analysis.metric import (
    HIGHER,
    LOWER,
    RIGHT_F1,
    ZERO_DELAY,
    Metric,
    Ratio,
    Rows,
    Views,
    Where,
    quotient,
)
from genie_sim.analysis.statistics import Blocks, Measured
from genie_sim.record.columns import Columns
from genie_sim.record.records import CONSUMER
from genie_sim.record.results import MethodInfo

CORRECTNESS, LAPS = "Correctness", "Laps"
CAUSES = ("moved_away", "never_there", "duplicate")  # of false objects
HITS = {
    "all": ("own_cache", "edge_cache", "peer_cache"),
    "car": ("own_cache",),
    "edge": ("edge_cache", "peer_cache"),
}


class AnswerRows(Rows):
    """The answers under a method, which come from caches anywhere, on cars, or on edges."""


class HeldRows(Rows):
    """What consumers hold at each instant under a method, or the zero-delay detector."""


class Lap(NamedTuple):
    """What consumers hold in one lap."""

    held: Columns


def views(
    tables: Mapping[str, Columns], methods: Mapping[str, MethodInfo], intervals: bool
) -> Views:
    """What ``answers`` and ``held`` say of each method, and ``held`` of each lap."""
    if "answers" in tables:
        yield from answer_views(tables["answers"], methods)
    if "held" in tables:
        yield from held_views(tables["held"], methods)
        yield from lap_views(tables["held"], tables["frames"], methods)


def answer_views(answers: Columns, methods: Iterable[str]) -> Views:
    """The answers of each method, by where the cache is that a result comes from."""
    blocks = Blocks(answers["car"], answers["stamp_ns"])
    for method in methods:
        chosen = answers["method"] == method
        for placement in HITS:
            where = Where(method, placement)
            yield where, AnswerRows(answers, chosen, blocks, where)


def held_views(held: Columns, methods: Iterable[str], intervals: bool = True) -> Views:
    """What the consumers hold at each instant, and, as component ``zero_delay``, the zero-delay
    detector, which stands under the first method that a car drives with and holds for all.
    """
    blocks = Blocks(held["car"], held["stamp_ns"], intervals)
    zero_delay = held["what"] == ZERO_DELAY
    for method in methods:
        chosen = held["method"] == method
        for component, what in (("", ~zero_delay), (ZERO_DELAY, zero_delay)):
            where = Where(method, component=component)
            yield where, HeldRows(held, chosen & what, blocks, where)


def lap_views(held: Columns, frames: Columns, methods: Iterable[str]) -> Views:
    """Each lap as component; nothing where no car drives its route more than once."""
    if not len(frames) or not frames["lap"].max():
        return
    for method in methods:
        of_method = held.where(method=method, what=CONSUMER)
        laps = _laps(of_method, frames.where(method=method))
        for lap in np.unique(laps).tolist():
            yield Where(method, component=f"lap {lap + 1}"), Lap(of_method.rows(laps == lap))


def _laps(held: Columns, frames: Columns) -> Any:
    """In which lap its car is at each judged instant, from 0."""
    laps = np.zeros(len(held), dtype=int)
    for car in held["car"].unique():
        of_car = frames.where(car=car)
        numbers, stamps_ns = of_car["lap"], of_car["stamp_ns"]
        begins_ns = [stamps_ns[numbers == lap].min() for lap in np.unique(numbers)]
        rows = held["car"] == car
        laps[rows] = np.searchsorted(begins_ns, held["stamp_ns"][rows], side="right") - 1
    return laps


class ProxyF1(Ratio):
    """F1 of answers, against a proxy for the truth."""

    better = HIGHER
    section = CORRECTNESS
    view = AnswerRows
    table = "answers"
    reads = "answers: which, served, detected, matched"

    def __init__(self, which: str, answer: str) -> None:
        self.only = MappingProxyType({"which": which})
        self.title = f"proxy F1, {answer}"
        self.meaning = (
            f"F1 of the {answer}s, against the detector's own answer to the same frame (a proxy "
            "for the truth)."
        )

    def counts(self, rows: Rows) -> Any:
        counts = super().counts(rows)
        return counts & (rows.where.placement == "all")

    def terms(self, rows: Columns) -> tuple[Any, Any]:
        served, detected, matched = map(rows.floats, ("served", "detected", "matched"))
        return 2 * matched, served + detected


class WrongHits(Ratio):
    """Share of the cache hits with an F1 below 80 % against the detector's own answer to the same
    frame (a proxy for the truth).
    """

    title = "wrong cache hits"
    better = LOWER
    section = CORRECTNESS
    view = AnswerRows
    table = "answers"
    only = MappingProxyType({"which": "result"})
    reads = "answers: which, served, detected, matched, source"

    def counts(self, rows: Rows) -> Any:
        return super().counts(rows) & rows.table["source"].isin(HITS[rows.where.placement])

    def terms(self, rows: Columns) -> tuple[Any, Any]:
        served, detected, matched = map(rows.floats, ("served", "detected", "matched"))
        # two empty answers agree
        return 2 * matched < RIGHT_F1 * (served + detected), np.ones(len(rows))


class HeldRatio(Ratio):
    """A ratio of sums of columns over what consumers hold at each instant."""

    section = CORRECTNESS
    view = HeldRows
    table = "held"
    only = MappingProxyType({"what": CONSUMER})
    above: tuple[str, ...] = ()
    """The columns whose sum is above; a column may count twice."""

    below: tuple[str, ...] = ()
    """The columns whose sum is below."""

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        if "reads" not in vars(cls):
            cls.reads = f"held: {', '.join(dict.fromkeys((*cls.above, *cls.below)))}"

    def counts(self, rows: Rows) -> Any:
        return rows.chosen

    def terms(self, rows: Columns) -> tuple[Any, Any]:
        return sum(rows[name] for name in self.above), sum(rows[name] for name in self.below)


class HeldMean(HeldRatio):
    """The mean of the column ``above``, weighted with the column ``below``, if there is one."""

    def terms(self, rows: Columns) -> tuple[Any, Any]:
        values = rows[self.above[0]]
        weights = rows[self.below[0]] if self.below else np.ones(len(rows))
        return values * weights, weights


class ObjectPrecision(HeldRatio):
    """Share of the held objects that are in view at that instant."""

    title = "streaming precision"
    better = HIGHER
    above = ("right",)
    below = ("held",)


class ObjectRecall(HeldRatio):
    """Share of the objects in view that the consumer holds at that instant."""

    title = "recall of visible objects"
    better = HIGHER
    above = ("right",)
    below = ("visible_static", "visible_moving")


class StaticRecall(HeldRatio):
    """Recall of the visible objects that stand still."""

    title = "recall of static objects"
    better = HIGHER
    above = ("found_static",)
    below = ("visible_static",)


class MovingRecall(HeldRatio):
    """Recall of the visible objects that move."""

    title = "recall of moving objects"
    better = HIGHER
    above = ("found_moving",)
    below = ("visible_moving",)


class StreamingF1(HeldRatio):
    """F1 of the objects that the consumer holds at each instant, against those in view then."""

    title = "streaming F1"
    better = HIGHER
    above = ("right", "right")
    below = ("held", "visible_static", "visible_moving")


class FalseObjects(HeldRatio):
    """Share of the held objects without a true object of their class within 2 m."""

    title = "false objects"
    better = LOWER
    above = ("held", "right")
    below = ("held",)

    def terms(self, rows: Columns) -> tuple[Any, Any]:
        return rows["held"] - rows["right"], rows["held"]


class MovedAway(HeldRatio):
    """Share of the held objects that were there and left."""

    title = "false objects: moved away"
    better = LOWER
    above = ("moved_away",)
    below = ("held",)


class NeverThere(HeldRatio):
    """Share of the held objects that never were there."""

    title = "false objects: never there"
    better = LOWER
    above = ("never_there",)
    below = ("held",)


class Duplicates(HeldRatio):
    """Share of the held objects that are held twice."""

    title = "false objects: duplicates"
    better = LOWER
    above = ("duplicate",)
    below = ("held",)


class Gospa(HeldMean):
    """Mean GOSPA distance from the held objects to those in view."""

    title = "GOSPA"
    unit = "m"
    better = LOWER
    above = ("gospa_m",)


class HeldAge(HeldMean):
    """Mean time since the held objects were detected."""

    title = "age of held objects"
    unit = "s"
    better = LOWER
    above = ("age_s",)
    below = ("held",)


class PlaceError(HeldMean):
    """Mean distance of the right held objects to the true ones."""

    title = "position error"
    unit = "m"
    better = LOWER
    above = ("error_m",)
    below = ("right",)


class LapRecall(Metric):
    """Recall of visible objects in one lap of the cars' routes."""

    title = "recall in a lap"
    better = HIGHER
    section = LAPS
    view = Lap
    measure: HeldRatio = ObjectRecall()
    reads = "held: right, visible_static, visible_moving"

    def of(self, view: Lap) -> Measured:
        above, below = (int(np.sum(part)) for part in self.measure.terms(view.held))
        return quotient(above, below, below)


class LapF1(LapRecall):
    """Streaming F1 in one lap of the cars' routes."""

    title = "streaming F1 in a lap"
    measure = StreamingF1()
    reads = "held: right, visible_static, visible_moving, held"


ANSWERS = {
    "first_proxy_f1": ProxyF1("first", "first answer"),
    "result_proxy_f1": ProxyF1("result", "result"),
    "wrong_hit_share": WrongHits(),
}
HELD = {
    "object_precision": ObjectPrecision(),
    "object_recall": ObjectRecall(),
    "object_recall_static": StaticRecall(),
    "object_recall_moving": MovingRecall(),
    "streaming_f1": StreamingF1(),
    "ghost_share": FalseObjects(),
    "ghost_share_moved_away": MovedAway(),
    "ghost_share_never_there": NeverThere(),
    "ghost_share_duplicate": Duplicates(),
    "gospa": Gospa(),
    "held_age": HeldAge(),
    "place_error": PlaceError(),
}
METRICS = {**ANSWERS, **HELD, "lap_recall": LapRecall(), "lap_f1": LapF1()}
