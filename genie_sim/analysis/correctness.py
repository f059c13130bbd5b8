"""How right answers are, as arithmetic on the tables ``answers`` and ``held``.

Sums are over answers or instants (micro averages); intervals are those of ``metrics``, from blocks of one second.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from genie_sim.analysis.statistics import Blocks, Floats, NoBlocks, around, share
from genie_sim.recording.columns import Columns
from genie_sim.recording.results import Metric

RIGHT_F1 = 0.8  # a cache hit below it is a wrong hit
FLOOR = "floor"  # the detector's own answer without any delay, as a component
CAUSES = ("moved_away", "never_there", "duplicate")  # of ghosts
HITS = {"all": ("own_cache", "edge_cache", "peer_cache"), "car": ("own_cache",), "edge": ("edge_cache", "peer_cache")}


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
                yield share(blocks, f"{answer}_proxy_precision", where, mine * matched, mine * served)
                yield share(blocks, f"{answer}_proxy_recall", where, mine * matched, mine * detected)
                yield share(blocks, f"{answer}_proxy_f1", where, mine * 2 * matched, mine * (served + detected))
        for placement, sources in HITS.items():
            hits = (method == name) & (which == "fresh") & source.isin(sources)
            if hits.any():
                yield share(blocks, "wrong_hit_share", (name, placement, ""), hits & wrong, hits)


def of_held(held: Columns, methods: Sequence[str], intervals: bool = True) -> Iterator[Metric]:
    """Streaming accuracy: of what the consumers hold at each instant, and as component ``floor`` of the detector's own
    answers without any delay, which are under the method that was recorded with them and hold for all."""
    blocks = Blocks(held["car"], held["stamp_ns"]) if intervals else NoBlocks()
    method, what = held["method"], held["what"]
    for name in methods:
        for component in ("", FLOOR):
            mine = (method == name) & ((what == FLOOR) == (component == FLOOR))
            if mine.any():
                yield from _of_rows(held, blocks, mine, (name, "all", component))


def _of_rows(held: Columns, blocks: Blocks, mine: Floats, where: tuple[str, str, str]) -> Iterator[Metric]:
    count = {name: np.where(mine, held.floats(name), 0.0) for name in held.names[4:-3]}
    served, right = count["held"], count["right"]
    static, moving = count["visible_static"], count["visible_moving"]
    visible = static + moving
    yield share(blocks, "object_precision", where, right, served)
    yield share(blocks, "object_recall", where, right, visible)
    yield share(blocks, "object_recall_static", where, count["found_static"], static)
    yield share(blocks, "object_recall_moving", where, count["found_moving"], moving)
    yield share(blocks, "streaming_f1", where, 2 * right, served + visible)
    yield share(blocks, "ghost_share", where, served - right, served)
    for cause in CAUSES:
        yield share(blocks, f"ghost_share_{cause}", where, count[cause], served)
    gospa_m, age_s, error_m = (np.nan_to_num(held.floats(name)) for name in held.names[-3:])
    yield _mean(blocks, "gospa", where, gospa_m, mine.astype(float), "m")
    yield _mean(blocks, "held_age", where, age_s, served, "s")
    yield _mean(blocks, "place_error", where, error_m, right, "m")


def _mean(blocks: Blocks, name: str, where: tuple[str, str, str], values: Floats, weights: Floats, unit: str) -> Metric:
    n = int(weights.sum())
    if not n:
        return Metric(name, *where, None, unit)
    value = float((values * weights).sum() / n)
    return Metric(
        name, *where, value, unit, *around(value, blocks.half_width(blocks.influence(values * weights, weights))), n
    )
