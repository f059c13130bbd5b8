"""A short notation of numbers for tables of tests: ``image_reuse:car``,
``first_answer_mean:genie:car1``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import pandas as pd

from genie_sim.analysis.genie_metrics import GENIE_PLACEMENTS
from genie_sim.paper.evidence import Evidence
from genie_sim.paper.numbers import SCHEMA, Number, Numbers


def number(text: str) -> Number:
    """A metric, then its placement or method (none: Genie's), then its component."""
    metric, place, component, *_ = f"{text}::".split(":")
    if place in GENIE_PLACEMENTS:
        return Number(metric, placement=place, component=component)
    return Number(metric, place or "genie", component=component)


def evidence(runs: Mapping[tuple[str, str], Sequence[Numbers]]) -> Evidence:
    """Of the numbers of runs by variant and scenario, one for each seed."""
    rows = [
        (*place, seed, *of, value)
        for place, of_seeds in runs.items()
        for seed, numbers in enumerate(of_seeds, start=1)
        for of, value in numbers.items()
    ]
    return Evidence(pd.DataFrame(rows, columns=[column.name for column in SCHEMA.columns]))
