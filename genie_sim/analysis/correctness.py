"""Correctness metrics, computed from the tables ``answers`` and ``held``.

Sums are over answers or instants (micro averages); intervals are from blocks of one second.
"""

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np

from genie_sim.analysis.metric import (
    HEADLINE,
    HIGHER,
    LOWER,
    MAIN,
    RIGHT_F1,
    Given,
    MethodTables,
    Metric,
    Sample,
    share_of,
)
from genie_sim.analysis.statistics import Estimate
from genie_sim.record.columns import Columns, Text
from genie_sim.record.records import CONSUMER, ZERO_DELAY

CORRECTNESS, LAPS = "Correctness", "Laps"
HITS = {
    "all": ("own_cache", "edge_cache", "peer_cache"),
    "car": ("own_cache",),
    "edge": ("edge_cache", "peer_cache"),
}


def views(tables: MethodTables) -> Iterator[Given]:
    """The answers of a method, and the hits by where the cache is; what its consumers hold at each
    instant, and in each lap; and, as component ``zero_delay``, the zero-delay detector
    (``of_all_cars``).
    """
    if "answers" in tables:
        answers = tables["answers"]
        yield Given("answers", answers)
        results = answers.where(which="result")
        for placement, sources in HITS.items():
            yield Given("hits", results.rows(results["source"].isin(sources)), placement)
    if "held" in tables:
        held = tables["held"].where(what=CONSUMER)
        yield Given("held", held)
        zero_delay = tables["held"].where(what=ZERO_DELAY)
        if len(zero_delay):
            yield Given("held", zero_delay, component=ZERO_DELAY)
        if "frames" in tables and tables["frames"]["lap"].max():
            laps = _laps(held, tables["frames"])
            for lap in np.unique(laps).tolist():
                yield Given("laps", held.rows(laps == lap), component=f"lap {lap + 1}")


def of_all_cars(held: Columns, methods: Sequence[str]) -> Columns:
    """The table with the zero-delay detector of all cars under one of these methods, the first that
    has it: it is the same for all methods, and each car has it under the first that it drives with.
    """
    is_zero_delay = held["what"] == ZERO_DELAY
    of_methods = held["method"]
    having = set(of_methods[is_zero_delay].unique())
    firsts = [method for method in methods if method in having]
    if len(firsts) < 2:
        return held
    is_moved = is_zero_delay & of_methods.isin(firsts)
    first = of_methods.names.index(firsts[0])
    codes = np.where(is_moved, first, of_methods.codes)
    return held.assign(method=Text(codes, of_methods.names))


def _laps(held: Columns, frames: Columns) -> Any:
    """In which lap its car is at each judged instant, from 0."""
    laps = np.zeros(len(held), dtype=int)
    for car, of_car in frames.groups("car"):
        lap_of_frame, stamps_ns = of_car["lap"], of_car["stamp_ns"]
        numbers = np.unique(lap_of_frame)  # a warm-up leaves out the first
        begins_ns = [stamps_ns[lap_of_frame == number].min() for number in numbers]
        rows = held["car"] == car
        places = np.searchsorted(begins_ns, held["stamp_ns"][rows], side="right") - 1
        laps[rows] = numbers[places]
    return laps


def _proxy_f1(answers: Columns) -> Sample | None:
    first = answers.where(which="first")
    if not len(first):
        return None
    return Sample(first, 2 * first["matched"], first["served"] + first["detected"])


def is_wrong(answers: Columns) -> Any:
    """Which answers have an F1 below 80 % against the detector's own; two empty ones agree."""
    return 2 * answers["matched"] < RIGHT_F1 * (answers.floats("served") + answers["detected"])


def visible(held: Columns) -> Any:
    """How many objects are in view at each instant."""
    return held["visible_static"] + held["visible_moving"]


def f1(held: Columns) -> Sample:
    """F1 of what is held."""
    return Sample(held, 2 * held["right"], held["held"] + visible(held))


def recall(held: Columns) -> Sample:
    """Share of the objects in view that are held."""
    return Sample(held, held["right"], visible(held))


def false_objects(held: Columns) -> Sample:
    """Share of the held objects that are not right."""
    return Sample(held, held["held"] - held["right"], held["held"])


def column_over(held: Columns, above: str, below: str) -> Sample:
    """Sum of a column over the sum of another."""
    return Sample(held, held[above], held[below])


def without_interval(sample: Sample) -> Estimate:
    """The ratio alone."""
    above, below = (float(part.sum()) for part in sample.terms)
    return Estimate(above / below if below else None, n=round(below))


def _of_held(title: str, better: str, meaning: str, formula: Any, **words: Any) -> Metric:
    words = {"unit": "%"} | words
    return Metric(
        title,
        better=better,
        section=CORRECTNESS,
        meaning=meaning,
        formula=formula,
        kind="held",
        **words,
    )


ANSWER_METRICS = {
    "first_proxy_f1": Metric(
        "proxy F1, first answer",
        "%",
        HIGHER,
        CORRECTNESS,
        meaning="F1 of the first answers, against the detector's own answer to the same frame (a "
        "proxy for the truth).",
        formula=_proxy_f1,
        kind="answers",
        tier=HEADLINE,
    ),
    "wrong_hit_share": Metric(
        "wrong cache hits",
        "%",
        LOWER,
        CORRECTNESS,
        meaning="Share of the cache hits with an F1 below 80 % against the detector's own answer "
        "to the same frame (a proxy for the truth).",
        formula=lambda hits: share_of(hits, is_wrong(hits)) if len(hits) else None,
        kind="hits",
        tier=MAIN,
    ),
}
HELD_METRICS = {
    "object_precision": _of_held(
        "streaming precision",
        HIGHER,
        "Share of the held objects that are right: in view at that instant, each counted once.",
        partial(column_over, above="right", below="held"),
    ),
    "object_recall": _of_held(
        "recall of visible objects",
        HIGHER,
        "Share of the objects in view that the consumer holds at that instant.",
        recall,
    ),
    "object_recall_static": _of_held(
        "recall of static objects",
        HIGHER,
        "Recall of the visible objects that stand still.",
        partial(column_over, above="found_static", below="visible_static"),
    ),
    "object_recall_moving": _of_held(
        "recall of moving objects",
        HIGHER,
        "Recall of the visible objects that move.",
        partial(column_over, above="found_moving", below="visible_moving"),
    ),
    "streaming_f1": _of_held(
        "streaming F1",
        HIGHER,
        "F1 of the objects that the consumer holds at each instant, against those in view then.",
        f1,
        tier=HEADLINE,
    ),
    "ghost_share": _of_held(
        "false objects",
        LOWER,
        "Share of the held objects that are not right: none of their class is in view within 2 m "
        "(in towns 'tolerance'), or only one that is held already.",
        false_objects,
        tier=HEADLINE,
    ),
    "ghost_share_moved_away": _of_held(
        "false objects: moved away",
        LOWER,
        "Share of the held objects that are not there, but were visible there in the 10 s before.",
        partial(column_over, above="moved_away", below="held"),
    ),
    "ghost_share_never_there": _of_held(
        "false objects: never there",
        LOWER,
        "Share of the held objects that are not there, and were not visible there in the 10 s "
        "before.",
        partial(column_over, above="never_there", below="held"),
    ),
    "ghost_share_duplicate": _of_held(
        "false objects: duplicates",
        LOWER,
        "Share of the held objects within reach of an object in view that is held already.",
        partial(column_over, above="duplicate", below="held"),
    ),
    "place_error": _of_held(
        "position error",
        LOWER,
        "Mean distance of the right held objects to the true ones.",
        lambda held: Sample(held, held["error_m"] * held["right"], held["right"]),
        unit="m",
    ),
}
METRICS = {
    **ANSWER_METRICS,
    **HELD_METRICS,
    "lap_f1": Metric(
        "streaming F1 in a lap",
        "%",
        HIGHER,
        LAPS,
        meaning="Streaming F1 in one lap of the cars' routes.",
        formula=lambda held: without_interval(f1(held)),
        kind="laps",
    ),
}
