"""The metrics of a run, among them those of the paper's Section V, as arithmetic on its tables.

``low`` and ``high`` of a metric mean, by the kind of metric:

- latencies, shares, improvements and boosts of one run: the 95 % interval from batch means over
  blocks of one second of camera time, each car (for boosts each Genie) a stratum. It covers the
  variability *inside* this run, with frames of one second correlated as they like; it says nothing
  of other seeds or drives. Of shares it is Wilson's, with as many rows as that variability stands
  for.
- reuse: the lowest and highest ratio in any window of 50 requests of any Genie (the paper's error
  bars).
- energy: with every power at the lower and at the upper end of its range.
- ``statistics.across_seeds``: the 95 % t interval over runs.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from genie_sim.analysis.metric import measured
from genie_sim.analysis.registry import METRICS, own_metrics, views
from genie_sim.base.text import significant
from genie_sim.record.columns import Columns
from genie_sim.record.results import MethodInfo, MetricValue

if TYPE_CHECKING:
    import pandas as pd

    Table = Columns | pd.DataFrame


def compute(
    methods: Sequence[MethodInfo],
    tables: "Mapping[str, Table]",
    *,
    intervals: bool = True,
    own: Sequence[str] = (),
) -> list[MetricValue]:
    """All metrics of one run, in a fixed order.

    Numbers have ten digits: those that follow may differ between processors, which add up in
    different orders.

    Parameters
    ----------
    methods : sequence of MethodInfo
        Those that ran.
    tables : mapping of str to Columns or pandas.DataFrame
        ``frames``, and what else was recorded; the columns are those of ``record.records``.
    intervals : bool
        Whether frames and boosts get intervals, too. Many runs, whose spread counts, need none.
    own : sequence of str
        Metrics of the user's own, ``package.module:Class``. Raises ``UserError`` for one that
        cannot be computed.
    """
    filled = {name: Columns.of(table) for name, table in tables.items() if len(table)}
    frames = Columns.of(tables["frames"])
    of_run = views({**filled, "frames": frames}, methods, intervals)
    return [rounded(metric) for metric in measured({**METRICS, **own_metrics(own)}, of_run)]


def rounded(metric: MetricValue) -> MetricValue:
    """A metric with its numbers as they are written down."""
    return replace(metric, value=_ten(metric.value), low=_ten(metric.low), high=_ten(metric.high))


def _ten(value: float | None) -> float | None:
    return significant(value, digits=10) if isinstance(value, float) else value
