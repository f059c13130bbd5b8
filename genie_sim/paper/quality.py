"""Answer quality: the objects that consumers hold at each instant, against what is really in view
then.

The paper does not measure it. Here every run on a labelled trace does (``judge.map_accuracy``):
KITTI's annotators did not label everything, so precision is a lower bound and ghosts an upper one,
the same for all methods. ``zero_delay`` is the detector's own answer without any delay.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from genie_sim.analysis import correctness, metrics
from genie_sim.analysis.metric import ZERO_DELAY
from genie_sim.analysis.registry import METRICS
from genie_sim.paper.evidence import Evidence, interval
from genie_sim.paper.facts import METHODS, Fact, Facts
from genie_sim.record.columns import Columns
from genie_sim.record.records import CONSUMER

JUDGED = (*(method.name for method in METHODS), ZERO_DELAY)
ACCURACY = (
    "object_precision",
    "object_recall_static",
    "object_recall_moving",
    "streaming_f1",
    "ghost_share",
    *(f"ghost_share_{cause}" for cause in correctness.CAUSES),
    "gospa",
    "place_error",
)


def facts_of(held: Columns) -> Facts:
    """The metrics in ``ACCURACY`` of one run, by method; the detector without delay is one of the
    methods. Empty without a truth table.

    The first method drives the cars that have a detector: those without one have no zero delay.
    """
    if not len(held):
        return {}
    held = held.rows((held["what"] == CONSUMER) | (held["method"] == METHODS[0].name))
    rows = metrics.compute(METHODS, {"held": held}, intervals=False)
    return {
        Fact(row.metric, row.component or row.method): math.nan if row.value is None else row.value
        for row in rows
        if row.metric in ACCURACY
    }


def summarise(evidence: Evidence, scenarios: Sequence[str]) -> list[dict[str, Any]]:
    """Means over scenarios of each number, by method, with 95 % intervals over seeds; none where
    nothing was judged.
    """
    rows: list[dict[str, Any]] = []
    for method in JUDGED:
        for name in ACCURACY:
            values = evidence.mean_of(scenarios, [Fact(name, method)])
            if not np.isnan(values).any():
                mean, low, high = interval(values)
                rows.append(
                    {
                        "method": method,
                        "name": name,
                        "unit": METRICS[name].unit_in_files,
                        "value": mean,
                        "low": low,
                        "high": high,
                        "n": len(values),
                    }
                )
    return rows
