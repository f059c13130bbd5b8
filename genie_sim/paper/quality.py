"""What the answers are worth: the objects that consumers hold at each instant, against what is really in view then.

The paper does not measure it. Here every run on a labelled trace does (``recording.held``): KITTI's annotators did not
label everything, so precision is a lower bound and ghosts an upper one, the same for all methods. ``floor`` is the
detector's own answer without any delay.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from genie_sim.analysis import correctness
from genie_sim.paper.evidence import Evidence, interval
from genie_sim.paper.facts import METHODS, Facts
from genie_sim.recording.columns import Columns

JUDGED = (*(method.name for method in METHODS), correctness.FLOOR)
SHARES = (
    "object_precision", "object_recall_static", "object_recall_moving", "streaming_f1", "ghost_share",
    *(f"ghost_share_{cause}" for cause in correctness.CAUSES),
)  # fmt: skip
UNITS = dict.fromkeys(SHARES, "1") | {"gospa": "m", "held_age": "s", "place_error": "m"}


def facts_of(held: Columns) -> Facts:
    """``number:method`` of one run, and ``number:floor``; NaN where not defined, nothing without a truth table."""
    found = (
        correctness.of_held(held, [method.name for method in METHODS], intervals=False)
        if len(held)
        else ()
    )
    return {
        f"{one.metric}:{one.component or one.method}": math.nan if one.value is None else one.value
        for one in found
        if one.metric in UNITS
    }


def summarise(evidence: Evidence, scenarios: Sequence[str]) -> list[dict[str, Any]]:
    """Means over scenarios of each number, by method, with 95 % intervals over seeds; none where nothing was judged."""
    rows: list[dict[str, Any]] = []
    for method in JUDGED:
        for name, unit in UNITS.items():
            values = evidence.mean_of(scenarios, [f"{name}:{method}"])
            if not np.isnan(values).any():
                found = dict(zip(("value", "low", "high"), interval(values), strict=True))
                rows.append(
                    {"method": method, "name": name, "unit": unit, **found, "n": len(values)}
                )
    return rows
