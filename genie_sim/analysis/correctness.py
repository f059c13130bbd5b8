"""How right answers are, as arithmetic on the tables ``answers`` and ``held``.

Sums are over answers or instants (micro averages); intervals are those of ``metrics``, from blocks of one second.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from genie_sim.analysis.statistics import Blocks, share
from genie_sim.recording.columns import Columns
from genie_sim.recording.results import Metric

RIGHT_F1 = 0.8  # a cache hit below it is a wrong hit
FLOOR = "floor"  # the detector's own answer without any delay, as a component
CAUSES = ("moved_away", "never_there", "duplicate")  # of ghosts
HITS = {
    "all": ("own_cache", "edge_cache", "peer_cache"),
    "car": ("own_cache",),
    "edge": ("edge_cache", "peer_cache"),
}
Parts = Callable[
    [Columns], tuple[Any, Any]
]  # of a ratio of sums over rows: above and below, row by row


def _visible(rows: Columns) -> Any:
    return rows["visible_static"] + rows["visible_moving"]


def _of_ghosts(cause: str) -> Parts:
    return lambda rows: (rows[cause], rows["held"])


# What the objects that somebody holds are worth: unit, and the ratio over the rows of table ``held``.
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
    """Precision, recall and F1 of first and fresh answers against the detector's own answer to the frame (a proxy), and
    the share of cache hits whose F1 is below ``RIGHT_F1``, by where the cache is."""
    blocks = Blocks(answers["car"], answers["stamp_ns"])
    method, which, source = (answers[name] for name in ("method", "which", "source"))
    served, detected, matched = map(answers.floats, ("served", "detected", "matched"))
    wrong = 2 * matched < RIGHT_F1 * (served + detected)  # two empty answers agree
    for name in methods:
        for answer in ("first", "fresh"):
            mine, where = (method == name) & (which == answer), (name, "all", "")
            if mine.any():
                yield share(
                    blocks, f"{answer}_proxy_precision", where, mine * matched, mine * served
                )
                yield share(
                    blocks, f"{answer}_proxy_recall", where, mine * matched, mine * detected
                )
                yield share(
                    blocks,
                    f"{answer}_proxy_f1",
                    where,
                    mine * 2 * matched,
                    mine * (served + detected),
                )
        for placement, sources in HITS.items():
            hits = (method == name) & (which == "fresh") & source.isin(sources)
            if hits.any():
                yield share(blocks, "wrong_hit_share", (name, placement, ""), hits & wrong, hits)


def of_held(held: Columns, methods: Sequence[str], intervals: bool = True) -> Iterator[Metric]:
    """Streaming accuracy: of what the consumers hold at each instant, and as component ``floor`` of the detector's own
    answers without any delay, which are under the method that was recorded with them and hold for all."""
    blocks = Blocks(held["car"], held["stamp_ns"], intervals)
    method, what = held["method"], held["what"]
    for name in methods:
        for component in ("", FLOOR):
            mine = (method == name) & ((what == FLOOR) == (component == FLOOR))
            if mine.any():
                for metric, (unit, parts) in HELD.items():
                    above, below = (
                        np.where(mine, np.nan_to_num(part), 0.0) for part in parts(held)
                    )
                    yield share(blocks, metric, (name, "all", component), above, below, unit)
