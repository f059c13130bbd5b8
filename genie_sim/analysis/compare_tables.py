"""The table of a comparison."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from genie_sim.analysis import renderers
from genie_sim.analysis.compare import BLOCKS, SEEDS, ComparedRuns, as_metrics
from genie_sim.analysis.result_table import Cell, ResultTable, Row
from genie_sim.analysis.statistics import MIN_SEEDS, has_interval
from genie_sim.record.results import TIDY_FIELDS, MetricValue

COLUMNS = ("of", "value", "against", "its value", "difference", "so")
FIELDS = ("setting", *TIDY_FIELDS, "against", "by", "verdict")
MANY = 10  # intervals, of which it is told how many miss
ONE_RUN = (
    "Blocks of one second tell how sure a difference is inside these runs; other seeds and drives "
    "may differ by more."
)
NO_INTERVAL = "no interval"
ABOUT_NO_INTERVAL = "No interval: one seed gives none of that metric."
ABOUT_NO_SPREAD = "No interval of seeds that are all equal, or of a percentile of too few answers."
ABOUT_NEGLIGIBLE = "Negligible: a difference below 1 % of the value."
ABOUT_SHARES = "Differences of shares are in percentage points."


def text(comparison: ComparedRuns, format: str = "markdown") -> str:
    """The numbers; markdown and LaTeX round, csv does not. Raises UserError for another format."""
    if renderers.checked(format) == "csv":
        return renderers.csv_of_rows(FIELDS, tidy_rows(comparison))
    table = pairs(comparison)
    if format == "markdown":
        return renderers.markdown(replace(table, notes=[comparison.left_out]))
    name = " and ".join(comparison.names)
    titled = replace(table, title=f"{name}: paired differences", notes=[about(comparison)])
    return renderers.latex(titled, name)


def tidy_rows(comparison: ComparedRuns) -> Iterator[tuple[Any, ...]]:
    """The numbers of each arm, then the differences, each with the columns ``FIELDS``: ``against``
    names the arm from which a value is a difference, ``by`` what its interval is over.
    """
    arms = {arm.label: arm for arm in comparison.arms}
    for metric in as_metrics(comparison)[0]:
        arm = arms[metric.method]
        number = metric._replace(method=arm.method.name)
        yield (arm.setting, *number.of_seed(arm.seed), "", "", "")
    for row in comparison.rows:
        if row.against is not None and row.difference is not None:
            arm = row.arm
            number = MetricValue(
                row.metric,
                arm.method.name,
                "all",
                "",
                value=row.difference,
                unit=row.about.unit_in_files,
                low=row.low,
                high=row.high,
                n=row.n or None,
            )
            against = row.against.label
            yield (arm.setting, *number.of_seed(arm.seed), against, row.by, row.verdict)


def about(comparison: ComparedRuns) -> str:
    """What the intervals are over, what is left out, and how sure all of them together are."""
    sentences = [f"{comparison.by[0].upper()}{comparison.by[1:]}."]
    warm_ups = {run.warm_up for arm in comparison.arms for run in arm.runs.values()}
    if warm_ups != {""} and len(warm_ups) == 1:  # others are settings that differ
        sentences.append(f"All {warm_ups.pop()}.")
    if any(row.about.unit == "%" for row in comparison.rows if row.against):
        sentences.append(ABOUT_SHARES)
    if any(row.by == BLOCKS and row.low is not None for row in comparison.rows):
        sentences.append(ONE_RUN)
    if any(row.difference is not None and not (row.by or row.verdict) for row in comparison.rows):
        sentences.append(ABOUT_NO_INTERVAL)
    if any(row.by == SEEDS and not has_interval(row.n) for row in comparison.rows):
        sentences.append(f"No intervals of fewer than {MIN_SEEDS} seeds.")
    if any(row.by == SEEDS and has_interval(row.n) and row.low is None for row in comparison.rows):
        sentences.append(ABOUT_NO_SPREAD)
    if any(row.verdict == "negligible" for row in comparison.rows):
        sentences.append(ABOUT_NEGLIGIBLE)
    intervals = sum(row.low is not None for row in comparison.rows)
    if intervals >= MANY:
        sentences.append(f"Of {intervals} intervals, about one in twenty misses by chance.")
    return " ".join(filter(None, [*sentences, comparison.left_out]))


def pairs(comparison: ComparedRuns) -> ResultTable:
    """Each metric of each arm that is compared, beside that of the arm it is compared with, and the
    difference with its interval.
    """
    rows = []
    for row in comparison.rows:
        if row.against is not None:
            metric = row.about
            cells = [
                Cell(row.arm.title),
                metric.cell(row.value),
                Cell(row.reference),
                metric.cell(row.against_value),
                metric.cell(row.difference, row.low, row.high, sign="+"),
                Cell(row.verdict or (None if row.difference is None else NO_INTERVAL)),
            ]
            rows.append(Row(metric.label, cells))
    return ResultTable(COLUMNS, rows, corner="metric")
