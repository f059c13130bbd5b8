"""Tables of a comparison."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from genie_sim.analysis import renderers
from genie_sim.analysis.compare import (
    BLOCKS,
    SEEDS,
    ComparedRuns,
    Difference,
    as_metrics,
)
from genie_sim.analysis.metric import SHORT
from genie_sim.analysis.registry import cell, definition, shown
from genie_sim.analysis.result_table import Cell, ResultTable, Row
from genie_sim.analysis.statistics import MIN_SEEDS
from genie_sim.record.results import TIDY_FIELDS, MetricValue

COLUMNS = ("of", "value", "against", "its value", "difference", "95 % interval", "so", "pairs")
FIELDS = ("setting", *TIDY_FIELDS, "against", "by", "verdict", "variance_ratio")
MANY = 10  # intervals, of which it is told how many miss
RATIO = "variance ratio"  # the title of a column
ONE_RUN = (
    "Blocks of one second tell how sure a difference is inside these runs; other seeds and drives "
    "may differ by more."
)
ABOUT_NEGLIGIBLE = "Negligible: a difference below 1 % of the value."
ABOUT_RATIO = (
    "Variance ratio: that of the paired differences over the sum of both variances; 1 if pairing "
    "gains nothing."
)


def text(comparison: ComparedRuns, format: str = "markdown") -> str:
    """The numbers; markdown and LaTeX round, csv does not. Raises UserError for another format."""
    if renderers.checked(format) == "csv":
        changed = [comparison.warning] if comparison.warning else []
        return renderers.csv_of_rows(FIELDS, tidy_rows(comparison), changed)
    if format == "markdown":
        return renderers.markdown(
            replace(pairs(comparison), notes=[comparison.left_out, comparison.warning])
        )
    name = " and ".join(comparison.names)
    return f"{renderers.latex(values(comparison), name)}\n{differences_latex(comparison, name)}"


def tidy_rows(comparison: ComparedRuns) -> Iterator[tuple[Any, ...]]:
    """The numbers of each arm, then the differences, each with the columns ``FIELDS``: ``against``
    names the arm from which a value is a difference, ``by`` what its interval is over.
    """
    arms = {arm.label: arm for arm in comparison.arms}
    for metric in as_metrics(comparison)[0]:
        arm = arms[metric.method]
        number = replace(metric, method=arm.method.name)
        yield (arm.setting, *number.of_seed(arm.seed), "", "", "", None)
    for row in comparison.rows:
        if row.difference is not None:
            arm = arms[row.arm]
            number = MetricValue(
                row.metric,
                arm.method.name,
                "all",
                "",
                value=row.difference,
                unit=row.unit,
                low=row.low,
                high=row.high,
                n=row.n,
            )
            of_difference = (row.against, row.by, row.verdict, row.variance_ratio)
            yield (arm.setting, *number.of_seed(arm.seed), *of_difference)


def about(comparison: ComparedRuns) -> str:
    """What the intervals are over, what is left out, and how sure all of them together are."""
    sentences = [f"{comparison.by[0].upper()}{comparison.by[1:]}."]
    if _has_ratios(comparison.rows):
        sentences.append(ABOUT_RATIO)
    if any(row.by == BLOCKS for row in comparison.rows):
        sentences.append(ONE_RUN)
    if any(row.by == SEEDS and row.n < MIN_SEEDS for row in comparison.rows):
        sentences.append(f"No intervals of fewer than {MIN_SEEDS} seeds.")
    if any(row.verdict == "negligible" for row in comparison.rows):
        sentences.append(ABOUT_NEGLIGIBLE)
    intervals = sum(row.low is not None for row in comparison.rows)
    if intervals >= MANY:
        sentences.append(f"Of {intervals} intervals, about one in twenty misses by chance.")
    return " ".join(filter(None, [*sentences, comparison.left_out]))


def pairs(comparison: ComparedRuns) -> ResultTable:
    """Each metric of each arm that is compared, beside that of the arm it is compared with; over
    several seeds with what pairing gained.
    """
    has_ratios = _has_ratios(comparison.rows)
    titles = {arm.label: arm.title for arm in comparison.arms}
    rows = []
    for row in comparison.rows:
        if row.against:
            metric = definition(row.metric)
            value, its_value = (
                metric.cell(number)._replace(unit=metric.unit)
                for number in (row.value, row.against_value)
            )
            points = "percentage points" if metric.unit == "%" else metric.unit
            cells = [
                Cell(titles[row.arm]),
                value,
                Cell(titles[row.against]),
                its_value,
                metric.cell(row.difference, sign="+")._replace(unit=points),
                metric.cell(None, row.low, row.high, sign="+"),
                Cell(row.verdict or None),
                Cell(row.n or None),
                *([_ratio(row)] if has_ratios else []),
            ]
            rows.append(Row(metric.title, cells))
    columns = (*COLUMNS, RATIO) if has_ratios else COLUMNS
    return ResultTable(columns, rows, corner="metric")


def values(comparison: ComparedRuns) -> ResultTable:
    """The numbers of each arm."""
    metrics, methods = as_metrics(comparison)
    by_place = {(metric.metric, metric.method): metric for metric in metrics}
    several = any(len(arm.runs) > 1 for arm in comparison.arms)
    about = (
        "Means, in brackets their 95 % intervals over seeds."
        if several
        else "In brackets: 95 % intervals inside the run, over blocks of one second."
    )
    return ResultTable(
        columns=[method.title for method in methods],
        rows=[
            Row(definition(name).label, [cell(by_place.get((name, arm.name))) for arm in methods])
            for name in dict.fromkeys(metric.metric for metric in metrics)
        ],
        title=f"{' and '.join(comparison.names)}: main results",
        notes=[about, comparison.left_out, comparison.warning],
    )


def differences_latex(comparison: ComparedRuns, name: str) -> str:
    """The table of differences in LaTeX, of results of this name."""
    return renderers.latex(differences(comparison, name), f"{name}-differences")


def differences(comparison: ComparedRuns, name: str) -> ResultTable:
    """What each method differs by from the one that it is compared with; over several seeds with
    what pairing gained, beside it.
    """
    titles = {arm.label: arm.title for arm in comparison.arms}
    measured = [row.metric for row in comparison.rows]
    metrics = comparison.metrics or shown(SHORT, measured)
    rows = [row for row in comparison.rows if row.metric in metrics and row.difference is not None]
    by_place = {(row.metric, row.arm): row for row in rows}
    references = {row.against for row in rows}
    against = f"the same method, {comparison.names[0]}"
    if len(references) == 1:
        against = titles[references.pop()]
    arms = list(dict.fromkeys(row.arm for row in rows))
    by = {row.by for row in rows if row.by}
    over = "seeds" if by == {SEEDS} else " and ".join(sorted(by))
    n = max((row.n for row in rows), default=0)
    parts = [_difference, _ratio] if _has_ratios(rows) else [_difference]
    return ResultTable(
        columns=[name for arm in arms for name in (titles[arm], RATIO)[: len(parts)]],
        rows=[
            Row(
                definition(metric).label,
                [part(by_place.get((metric, arm))) for arm in arms for part in parts],
            )
            for metric in dict.fromkeys(row.metric for row in rows)
        ],
        title=f"{name}: paired differences from {against}",
        notes=[
            f"In brackets: 95 % intervals of the paired differences, over {n} {over}. Differences"
            " of shares are in percentage points.",
            comparison.left_out,
            _negligible(rows, titles),
            *([ABOUT_RATIO] if len(parts) > 1 else []),
            comparison.warning,
        ],
    )


def _negligible(rows: Sequence[Difference], titles: Mapping[str, str]) -> str:
    """Which differences are below 1 % of the value; empty if none is."""
    which = [
        f"{definition(row.metric).title} of {titles[row.arm]}"
        for row in rows
        if row.verdict == "negligible"
    ]
    return f"Negligible, below 1 % of the value: {', '.join(which)}." if which else ""


def _difference(row: Difference | None) -> Cell:
    if row is None:
        return Cell()
    return definition(row.metric).cell(row.difference, row.low, row.high, sign="+")


def _ratio(row: Difference | None) -> Cell:
    """What pairing leaves of the variance."""
    ratio = None if row is None else row.variance_ratio
    return Cell() if ratio is None else Cell(round(ratio, 2))


def _has_ratios(rows: Sequence[Difference]) -> bool:
    return any(row.variance_ratio is not None for row in rows)
