"""Correctness metrics, computed from the tables ``answers`` and ``held``.

Sums are over answers or instants (micro averages); intervals are those of ``metrics``, from blocks
of one second.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from genie_sim.analysis.registry import RIGHT_F1, ZERO_DELAY
from genie_sim.analysis.statistics import Blocks, share
from genie_sim.recording.columns import Columns
from genie_sim.recording.results import Metric

CAUSES = ("moved_away", "never_there", "duplicate")  # of ghosts
HITS = {
    "all": ("own_cache", "edge_cache", "peer_cache"),
    "car": ("own_cache",),
    "edge": ("edge_cache", "peer_cache"),
}
# of a ratio of sums over rows: above and below, row by row
Parts = Callable[[Columns], tuple[Any, Any]]


def _visible(rows: Columns) -> Any:
    return rows["visible_static"] + rows["visible_moving"]


def _of_ghosts(cause: str) -> Parts:
    return lambda rows: (rows[cause], rows["held"])


# Accuracy metrics of held objects: unit, and the ratio over the rows of table ``held``.
HELD: dict[str, tuple[str, Parts]] = {
    "object_precision": ("1", lambda rows: (rows["right"], rows["held"])),
    "object_recall": ("1", lambda rows: (rows["right"], _visible(rows))),
    "object_recall_static": ("1", lambda rows: (rows["found_static"], rows["visible_static"])),
    "object_recall_moving": ("1", lambda rows: (rows["found_moving"], rows["visible_moving"])),
    "streaming_f1": ("1", lambda rows: (2 * rows["right"], rows["held"] + _visible(rows))),
    "ghost_share": ("1", lambda rows: (rows["held"] - rows["right"], rows["held"])),
    **{f"ghost_share_{cause}": ("1", _of_ghosts(cause)) for cause in CAUSES},
    "gospa": ("m", lambda rows: (rows["gospa_m"], np.ones(len(rows)))),
    "held_age": ("s", lambda rows: (rows["age_s"] * rows["held"], rows["held"])),
    "place_error": ("m", lambda rows: (rows["error_m"] * rows["right"], rows["right"])),
}


def of_answers(answers: Columns, methods: Sequence[str]) -> Iterator[Metric]:
    """Precision, recall and F1 of first answers and results against the detector's own answer to
    the frame (a proxy), and the share of cache hits whose F1 is below ``RIGHT_F1``, by where the
    cache is.
    """
    blocks = Blocks(answers["car"], answers["stamp_ns"])
    method, which, source = (answers[name] for name in ("method", "which", "source"))
    served, detected, matched = map(answers.floats, ("served", "detected", "matched"))
    wrong = 2 * matched < RIGHT_F1 * (served + detected)  # two empty answers agree
    proxies = {
        "precision": (matched, served),
        "recall": (matched, detected),
        "f1": (2 * matched, served + detected),
    }
    for name in methods:
        for answer in ("first", "result"):
            rows = (method == name) & (which == answer)
            if not rows.any():
                continue
            for measure, (above, below) in proxies.items():
                yield share(
                    blocks,
                    f"{answer}_proxy_{measure}",
                    (name, "all", ""),
                    part=rows * above,
                    whole=rows * below,
                )
        for placement, sources in HITS.items():
            hits = (method == name) & (which == "result") & source.isin(sources)
            if hits.any():
                where = (name, placement, "")
                yield share(blocks, "wrong_hit_share", where, part=hits & wrong, whole=hits)


def of_held(held: Columns, methods: Sequence[str], intervals: bool = True) -> Iterator[Metric]:
    """Streaming accuracy of what the consumers hold at each instant, and, as component
    ``zero_delay``, of the zero-delay detector, which stands under the first method that a car
    drives with and holds for all.
    """
    blocks = Blocks(held["car"], held["stamp_ns"], intervals)
    method, what = held["method"], held["what"]
    for name in methods:
        for component in ("", ZERO_DELAY):
            rows = (method == name) & ((what == ZERO_DELAY) == (component == ZERO_DELAY))
            if not rows.any():
                continue
            for metric, (unit, parts) in HELD.items():
                above, below = (np.where(rows, np.nan_to_num(part), 0.0) for part in parts(held))
                where = (name, "all", component)
                yield share(blocks, metric, where, part=above, whole=below, unit=unit)


def of_laps(held: Columns, frames: Columns, methods: Sequence[str]) -> Iterator[Metric]:
    """Recall and streaming F1 of what consumers hold in each lap, with the lap as component;
    nothing where no car drives its route more than once.
    """
    if not len(frames) or not frames["lap"].max():
        return
    for name in methods:
        judged = held.where(method=name, what="consumer")
        laps = _laps(judged, frames.where(method=name))
        for lap in np.unique(laps).tolist():
            of_lap = judged.rows(laps == lap)
            for metric, source in (("lap_recall", "object_recall"), ("lap_f1", "streaming_f1")):
                above, below = (int(np.sum(part)) for part in HELD[source][1](of_lap))
                yield Metric(
                    metric,
                    name,
                    "all",
                    f"lap {lap + 1}",
                    value=above / below if below else None,
                    unit="1",
                    n=below,
                )


def _laps(judged: Columns, frames: Columns) -> Any:
    """In which lap its car is at each judged instant, from 0."""
    laps = np.zeros(len(judged), dtype=int)
    for car in judged["car"].unique():
        of_car = frames.where(car=car)
        numbers, stamps_ns = of_car["lap"], of_car["stamp_ns"]
        begins_ns = [stamps_ns[numbers == lap].min() for lap in np.unique(numbers)]
        rows = judged["car"] == car
        laps[rows] = np.searchsorted(begins_ns, judged["stamp_ns"][rows], side="right") - 1
    return laps
