"""Numbers of any runs as one table, a row a number and seed: their means over seeds, and the means
of differences, with 95 % t intervals; and such a table as runs, to compare them. Runs of several
seeds, sweeps and comparisons use it.
"""

from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from genie_sim.analysis.registry import NO_WORDS, Words, definition
from genie_sim.analysis.statistics import has_interval
from genie_sim.base.errors import UserError, short_repr
from genie_sim.base.text import significant
from genie_sim.record import provenance
from genie_sim.record.results import METRIC_FIELDS, NUMBERS, MethodInfo, MetricValue, Run

if TYPE_CHECKING:
    import pandas as pd

NUMBER = ["metric", "method", "placement", "component", "unit"]  # the columns that tell which
NEGLIGIBLE = 0.01  # of the value: differences below it are negligible


def across_seeds(
    runs: "pd.DataFrame",
    by: Sequence[str],
    *,
    differences: bool = False,
    own: Words = NO_WORDS,
) -> "pd.DataFrame":
    """Mean, 95 % t interval, range and, in ``n``, the count of the runs that define it, of each
    number within the groups ``by``: these columns and the fields of ``MetricValue``.

    The unit of replication is the seed: with several runs of a group under one seed, their mean
    counts once. There is no interval of fewer than ``MIN_SEEDS``, where all are equal, or of a
    percentile with too few answers. Unless they are of ``differences``, intervals end at zero and
    shares at 1. A range is the mean of those of the runs. ``own`` is what the results say of
    metrics of the user's own.
    """
    keys = [*by, *NUMBER]
    ranges = [name for name in ("range_low", "range_high") if name in runs]
    columns = {"value": "mean", **dict.fromkeys(ranges, "mean")}
    if "n" in runs:
        runs = runs.astype({"n": float})  # NaN is not known
        columns["n"] = "min"
    per_seed = runs.groupby([*keys, "seed"], sort=False, dropna=False).agg(columns)
    grouped = per_seed.groupby(keys, sort=False, dropna=False)
    spread, count = grouped["value"].std().to_numpy(), grouped["value"].count().to_numpy()
    rows = grouped.mean().reset_index().assign(n=count)
    least = grouped["n"].min().to_numpy() if "n" in runs else np.full(len(rows), np.nan)
    names, means = rows["metric"].tolist(), rows["value"].to_numpy()
    metrics = {name: definition(name, own) for name in set(names) if isinstance(name, str)}
    low, high = np.full(len(rows), np.nan), np.full(len(rows), np.nan)
    for place in np.flatnonzero(has_interval(count)).tolist():
        low[place], high[place] = metrics[names[place]].over_seeds(
            float(means[place]),
            float(spread[place]),
            int(count[place]),
            rows=least[place],
            is_cut=not differences,
        )
    rows = rows.assign(low=low, high=high)
    for name in ("range_low", "range_high"):
        if name not in rows or differences:
            rows[name] = np.nan
    for name in NUMBERS:  # ten digits: processors add up in different orders
        rows[name] = [significant(number, digits=10) for number in rows[name]]
    return rows[[*by, *METRIC_FIELDS]]


def is_negligible(difference: float | None, value: float | None) -> bool:
    """Whether a difference from a value is below 1 % of it."""
    if difference is None or value is None:
        return False
    return abs(difference) < NEGLIGIBLE * abs(value)


def cells_of(
    table: "pd.DataFrame",
    by: Sequence[str],
    methods: Sequence[MethodInfo],
    *,
    name: str,
    genie_sim: str,
    origin: object,
    label: str = "",
    words: Words = NO_WORDS,
) -> dict[str, dict[int, Run]]:
    """The cells of a table of numbers: runs that have these, and no tables.

    Parameters
    ----------
    table : DataFrame
        A row for each seed and number: its columns are ``seed`` and fields of ``MetricValue``. Only
        numbers of methods as a whole are taken.
    by : sequence of str
        The columns that say which cell it is; their names and values name it.
    methods : sequence of MethodInfo
        Those that ran.
    name : str
        Of what these are the cells, in the place of a scenario's name.
    genie_sim : str
        The version that made them.
    origin : object
        What the numbers were made from, as plain JSON values; it gives the runs their id.
    label : str
        What the user calls them; empty: by their name.
    words : mapping
        What is said of metrics of the user's own.

    Raises
    ------
    UserError
        Where two cells have one name.
    """
    facts = {
        "scenario": {"name": name},
        "devices": {},
        "genie_sim": genie_sim,
        "methods": [asdict(method) for method in methods],
    }
    run_id = provenance.run_id({"origin": origin})
    like = Run(run_id, facts, "", tables={}, measured=(), label=label, words=words)
    whole = table[(table["placement"] == "all") & (table["component"] == "")]
    fields = [field for field in METRIC_FIELDS if field in whole]
    known = whole[[*by, "seed", *fields]].astype(object).where(whole.notna(), None)
    groups: Any = known.groupby([*by, "seed"], sort=False, dropna=False)
    cells: dict[str, dict[int, Run]] = {}
    for (*levels, seed), rows in groups:
        numbers = rows[fields].itertuples(index=False, name=None)
        measured = [
            MetricValue(**{"unit": "", **dict(zip(fields, number, strict=True))})
            for number in numbers
        ]
        cell = ", ".join(
            f"{axis} {level_text(level)}" for axis, level in zip(by, levels, strict=True)
        )
        if seed in cells.setdefault(cell, {}):
            raise UserError(f"{name}: two settings are called {short_repr(cell)}")
        of_seed = {**facts, "scenario": {"name": name, "seed": seed}}
        cells[cell][seed] = replace(like, facts=of_seed, measured=measured)
    return cells


def level_text(level: object) -> str:
    """A value of an axis, in so many digits that no other value has its text."""
    if isinstance(level, float) and float(short := f"{level:g}") == level:
        return short
    return str(level)
