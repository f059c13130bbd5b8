"""The tables of a sweep: every run, and every point with intervals across its seeds.

They are made from the parts alone and depend on the sweep and its runs' ids only: not on who ran
what, when, in which order, or how often it was interrupted.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from genie_sim.analysis.registry import NO_WORDS, Words
from genie_sim.analysis.tidy import across_seeds
from genie_sim.base.errors import UserError, unknown
from genie_sim.base.parquet import METADATA_KEY
from genie_sim.base.paths import atomic_write
from genie_sim.study.plan import Entry

if TYPE_CHECKING:
    import pandas as pd

BEFORE_AXES = ("point", "seed", "run_id")  # the first columns of ``of_runs``


def of_runs(
    entries: Sequence[Entry], columns: Sequence[str], measured: "pd.DataFrame"
) -> "pd.DataFrame":
    """One row per point, seed and metric: the axes' values, what was measured, and its interval
    inside the run.
    """
    import pandas as pd

    rows = sorted((entry.point, entry.seed, entry.run_id, *entry.levels) for entry in entries)
    places = pd.DataFrame(rows, columns=[*BEFORE_AXES, *columns])
    return places.merge(measured, on="run_id", how="left")  # keeps the order of both


def of_points(
    runs: "pd.DataFrame", columns: Sequence[str], own: Words = NO_WORDS
) -> "pd.DataFrame":
    """One row per point and metric: mean over the seeds, 95 % t interval, and the number of runs
    that define it. ``own`` is what is said of metrics of the user's own.
    """
    means = across_seeds(runs, ["point"], own=own)
    places = runs[["point", *columns]].drop_duplicates("point")
    return places.merge(means, on="point", how="left")


def differences(
    runs: "pd.DataFrame", columns: Sequence[str], along: str, to: Any
) -> "pd.DataFrame":
    """Paired differences of every metric: each value of the column ``along`` minus the value
    ``to``, seed by seed.

    ``runs`` is ``of_runs`` with the axes in ``columns``; ``along`` is one of them or ``method``.
    Returns the axes, the metric, its mean difference ``value``, the 95 % t interval ``low`` and
    ``high``, and in ``n`` the pairs that define it. Raises ``UserError`` for a column or a value
    that is not there.
    """
    choices = [*columns, "method"]
    if along not in choices:
        raise UserError(f"differences: {unknown('column', along, choices)}")
    values = list(dict.fromkeys(runs[along].dropna()))
    if to not in values:
        raise UserError(f"differences: {along}: {unknown('value', str(to), map(str, values))}")
    key_columns = [*columns, "method", "metric", "placement", "component", "unit", "seed"]
    paired_by = [name for name in key_columns if name != along]
    reference = runs[runs[along] == to][[*paired_by, "value"]]
    compared = runs[(runs[along] != to) & runs["metric"].notna()]
    both = compared.merge(reference, on=paired_by, suffixes=("", "_reference"))
    gaps = both.assign(value=both["value"] - both["value_reference"])
    return across_seeds(gaps, columns, differences=True).drop(columns=["range_low", "range_high"])


def write_parquet(table: "pd.DataFrame", path: Path, about: bytes) -> None:
    """``about`` is what the file says of itself. Raises ``UserError``."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    with_metadata = pa.Table.from_pandas(table, preserve_index=False).replace_schema_metadata(
        {METADATA_KEY: about}
    )
    with atomic_write(path) as beside, beside.open("wb") as file:  # of a path pyarrow makes a URI
        pq.write_table(with_metadata, file, compression="zstd", version="2.6")
