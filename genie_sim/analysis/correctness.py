"""How right answers are, as arithmetic on the tables ``answers`` and ``held``.

Sums are over answers or instants (micro averages); intervals are those of ``metrics``, from blocks of one second.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from genie_sim.analysis.statistics import Blocks, share
from genie_sim.recording.results import Metric

if TYPE_CHECKING:
    import pandas as pd

RIGHT_F1 = 0.8  # a cache hit below it is a wrong hit
HITS = {"all": ("own_cache", "edge_cache", "peer_cache"), "car": ("own_cache",), "edge": ("edge_cache", "peer_cache")}


def of_answers(answers: pd.DataFrame, methods: Sequence[str]) -> Iterator[Metric]:
    """Precision, recall and F1 of first and fresh answers against the detector's own answer to the frame (a proxy), and
    the share of cache hits whose F1 is below ``RIGHT_F1``, by where the cache is."""
    blocks = Blocks(answers["car"], answers["stamp_ns"])
    method, which, source = (answers[name].to_numpy(dtype=str) for name in ("method", "which", "source"))
    served, detected, matched = (answers[name].to_numpy(float) for name in ("served", "detected", "matched"))
    wrong = 2 * matched < RIGHT_F1 * (served + detected)  # two empty answers agree
    for name in methods:
        for answer in ("first", "fresh"):
            mine, where = (method == name) & (which == answer), (name, "all", "")
            if mine.any():
                yield share(blocks, f"{answer}_proxy_precision", where, mine * matched, mine * served)
                yield share(blocks, f"{answer}_proxy_recall", where, mine * matched, mine * detected)
                yield share(blocks, f"{answer}_proxy_f1", where, mine * 2 * matched, mine * (served + detected))
        for placement, sources in HITS.items():
            hits = (method == name) & (which == "fresh") & np.isin(source, sources)
            if hits.any():
                yield share(blocks, "wrong_hit_share", (name, placement, ""), hits & wrong, hits)
