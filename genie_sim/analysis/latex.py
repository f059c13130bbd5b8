"""Tables of metrics as LaTeX for an article: rules of ``booktabs``, columns of ``siunitx``, a
caption, a label, and a note for every sign.

A value stands above its interval, so a table of three methods fits a column of two.
"""

import textwrap
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

from genie_sim.analysis.compare import (
    DRAWN,
    SEEDS,
    WITHOUT_TRUTH,
    ComparedRuns,
    Difference,
    as_metrics,
    compared,
)
from genie_sim.analysis.registry import METRICS, WINDOW_REQUESTS
from genie_sim.analysis.seed_runs import SeedRuns, seeds_text
from genie_sim.analysis.summary import about_seeds, main_table
from genie_sim.analysis.text_table import LATEX
from genie_sim.recording.results import Metric, Run
from genie_sim.text import one_line

PRICES = ("bytes_up_per_frame", "energy_per_frame")
PACKAGES = ("booktabs", "siunitx")
MAX_NARROW = 3  # columns of numbers in a column of two
MAX_WIDE = 6  # and over both
MAX_ROWS = 25  # with intervals below them they take the height of a page
HEADING_CHARACTERS = 14
UNDEFINED = "--"
ENERGY = "energy_"  # how metrics of energy begin
WINDOWS, RANGE = "a", "b"  # marks of intervals that are no 95 % intervals
ABOUT_ONE_RUN = "In brackets: 95 % intervals inside the run, over blocks of one second"
MARK_NOTES = {
    WINDOWS: f"lowest and highest ratio of any {WINDOW_REQUESTS} requests in a row of any Genie",
    RANGE: "with every power at the lower and at the upper end of its range",
}


class Number(NamedTuple):
    """A number as it is printed, with the ends of its interval if it has one."""

    value: str
    ends: tuple[str, str] | None = None


class NumberRow(NamedTuple):
    """A row of numbers. ``mark`` is a key of the table's notes, or empty."""

    label: str
    numbers: Sequence[Number | None]
    mark: str = ""


def tables(run: Run | SeedRuns) -> str:
    """The main table of a run, or of several seeds, then with the paired differences of its methods
    from the first one.
    """
    text = main(run)
    if isinstance(run, SeedRuns) and len(run.methods) > 1:
        text += "\n" + differences(compared([run]), name=run.title)
    return text


def of_comparison(comparison: ComparedRuns) -> str:
    """The values of each method under each setting, then the paired differences."""
    metrics, methods = as_metrics(comparison)
    by_place = {(metric.metric, metric.method): metric for metric in metrics}
    several = any(len(arm.runs) > 1 for arm in comparison.arms)
    names = list(dict.fromkeys(metric.metric for metric in metrics))
    rows = [
        _row(
            METRICS[name].label, [by_place.get((name, method.name)) for method in methods], several
        )
        for name in names
    ]
    about = "means, in brackets their 95 % intervals over seeds" if several else ABOUT_ONE_RUN
    name = " and ".join(comparison.names)
    values = table(
        [method.title for method in methods],
        rows,
        caption=f"{name}, compared",
        label=f"tab:{key(name)}",
        notes=[f"{about[0].upper()}{about[1:]}.", comparison.warning],
    )
    return f"{values}\n{differences(comparison)}"


def main(run: Run | SeedRuns) -> str:
    """The main table."""
    several = isinstance(run, SeedRuns)
    screen = main_table(run)
    about = about_seeds(run) if isinstance(run, SeedRuns) else f"{ABOUT_ONE_RUN}."
    rows = [_row(row.label, row.metrics, several) for row in screen.rows]
    seeds = seeds_text([of_seed.seed for of_seed in run.runs])
    return table(
        screen.headings,
        rows,
        caption=f"{run.title}: response times, correctness and cost ({seeds})",
        label=f"tab:{key(run.title)}",
        notes=[about, *screen.note.split("\n"), run.warning],
    )


def differences(comparison: ComparedRuns, name: str = "") -> str:
    """What each method differs by from the one that it is compared with."""
    name = name or " and ".join(comparison.names)
    titles = {arm.label: arm.title for arm in comparison.arms}
    judged = any(row.metric == "streaming_f1" for row in comparison.rows)
    metrics = (*(DRAWN if judged else WITHOUT_TRUTH), *PRICES)
    rows = [row for row in comparison.rows if row.metric in metrics and row.difference is not None]
    compared_with = list(dict.fromkeys((row.arm, row.against) for row in rows))
    by_place = {(row.metric, row.arm): row for row in rows}
    references = list(dict.fromkeys(against for _, against in compared_with))
    against = f"the same method, {comparison.names[0]}"
    if len(references) == 1:
        against = titles[references[0]]
    lines = []
    for metric in dict.fromkeys(row.metric for row in rows):
        of_metric = [by_place.get((metric, arm)) for arm, _ in compared_with]
        lines.append(NumberRow(METRICS[metric].label, [_gap(row) for row in of_metric]))
    by = {row.by for row in rows if row.by}
    over = "seeds" if by == {SEEDS} else " and ".join(sorted(by))
    n = max((row.n for row in rows), default=0)
    return table(
        [titles[arm] for arm, _ in compared_with],
        lines,
        caption=f"{name}: paired differences from {against}",
        label=f"tab:{key(name)}-differences",
        notes=[
            f"In brackets: 95 % intervals of the paired differences, over {n} {over}. Differences"
            " of shares are in percentage points.",
            comparison.warning,
        ],
    )


def table(
    headings: Sequence[str],
    rows: Sequence[NumberRow],
    *,
    caption: str,
    label: str,
    notes: Sequence[str],
) -> str:
    """A floating table, over both columns of a page if one is too narrow. What fits no page is
    divided into several tables.

    Parameters
    ----------
    headings : sequence of str
        Of the columns of numbers.
    rows : sequence of NumberRow
        Each with a number, or ``None``, for every heading.
    caption, label : str
        Plain text, and what ``\\ref`` names the table by; further parts end in ``-2`` and so on.
    notes : sequence of str
        What stands below it, besides what marks and ``--`` mean.
    """
    parts = [
        (headings[columns], [row._replace(numbers=row.numbers[columns]) for row in rows[block]])
        for block in _blocks(len(rows), MAX_ROWS)
        for columns in _blocks(len(headings), MAX_WIDE)
    ]
    texts = []
    for number, (part_headings, part_rows) in enumerate(parts, 1):
        part_of = f" (part {number} of {len(parts)})" if len(parts) > 1 else ""
        texts.append(
            _one_table(
                part_headings,
                part_rows,
                caption=f"{caption}{part_of}",
                label=label if number == 1 else f"{label}-{number}",
                notes=notes if number == len(parts) else (),
            )
        )
    return "\n".join(texts)


def _blocks(length: int, most: int) -> list[slice]:
    """As few slices of about equal length as there must be for none to be longer than ``most``."""
    count = max(-(-length // most), 1)
    ends = [length * number // count for number in range(count + 1)]
    return [slice(first, end) for first, end in pairwise(ends)]


def _one_table(
    headings: Sequence[str],
    rows: Sequence[NumberRow],
    *,
    caption: str,
    label: str,
    notes: Sequence[str],
) -> str:
    """A floating table that fits a page."""
    wide = len(headings) > MAX_NARROW
    formats = [_format([row.numbers[place] for row in rows]) for place in range(len(headings))]
    width = 0.30 if wide else 0.34
    lines = [
        rf"\begin{{tabular}}{{@{{}}>{{\raggedright\arraybackslash}}p{{{width:.2f}\linewidth}}",
        *(f"  S[{numbers}]" for numbers in formats),
        r"  @{}}",
        r"\toprule",
        " & ".join(["", *map(_heading, headings)]).strip() + r" \\",
        r"\midrule",
        *(line for row in rows for line in _lines(row)),
        r"\bottomrule",
        r"\end{tabular}",
    ]
    marks = dict.fromkeys(row.mark for row in rows if row.mark)
    below = [rf"\textsuperscript{{{mark}}} {escaped(MARK_NOTES[mark])}." for mark in marks]
    if any(number is None for row in rows for number in row.numbers):
        below.append("--: not defined.")
    text = "\n".join([*lines, ""])
    return floating(text, caption=caption, label=label, notes=notes, signs=below, wide=wide)


def floating(
    tabular: str,
    *,
    caption: str,
    label: str,
    notes: Sequence[str],
    signs: Sequence[str] = (),
    wide: bool,
) -> str:
    """A tabular in a float.

    Parameters
    ----------
    tabular : str
        In LaTeX.
    caption, label : str
        Plain text, and what ``\\ref`` names the table by.
    notes : sequence of str
        Plain text below it.
    signs : sequence of str
        In LaTeX: what signs mean, after the notes.
    wide : bool
        Whether it spans both columns of a page.
    """
    environment = "table*" if wide else "table"
    lines = [
        f"% needs \\usepackage{{{','.join(PACKAGES)}}}",
        rf"\begin{{{environment}}}[!t]",
        r"\centering",
        r"\setlength{\tabcolsep}{3pt}",
        rf"\caption{{{escaped(caption)}}}",
        rf"\label{{{label}}}",
        r"\footnotesize",
        tabular.rstrip(),
    ]
    below = " ".join([*(escaped(note) for note in notes if note), *signs])
    if below:
        lines += ["", r"\smallskip", rf"\parbox{{\linewidth}}{{{below}}}"]
    return "\n".join([*lines, rf"\end{{{environment}}}", ""])


def escaped(text: str) -> str:
    """Text in which no character is a command of LaTeX."""
    return one_line(text).translate(LATEX)


def printed(value: float, sign: str = "") -> str:
    """A number to three significant digits as siunitx reads it: without commas and exponents."""
    if value == 0:
        return "0"
    places = max(2 - int(f"{value:e}".partition("e")[2]), 0)
    text = f"{value:{sign}.{places}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def _row(label: str, metrics: Sequence[Metric | None], several: bool) -> NumberRow:
    name = next((metric.metric for metric in metrics if metric is not None), "")
    mark = ""
    if not several and any(metric is not None and metric.low is not None for metric in metrics):
        mark = WINDOWS if "_reuse" in name else RANGE if name.startswith(ENERGY) else ""
    return NumberRow(label, [_number(metric) for metric in metrics], mark)


def _number(metric: Metric | None) -> Number | None:
    if metric is None or metric.value is None:
        return None
    factor = METRICS[metric.metric].factor
    ends = None
    if metric.low is not None and metric.high is not None:
        ends = printed(factor * metric.low), printed(factor * metric.high)
    return _without_width(Number(printed(factor * metric.value), ends))


def _gap(row: Difference | None) -> Number | None:
    if row is None or row.difference is None:
        return None
    factor, ends = METRICS[row.metric].factor, None
    if row.low is not None and row.high is not None:
        ends = printed(factor * row.low, "+"), printed(factor * row.high, "+")
    return _without_width(Number(printed(factor * row.difference, "+"), ends))


def _without_width(number: Number) -> Number:
    """Without an interval that is no wider than the number is exact."""
    is_point = number.ends is not None and {*number.ends} == {number.value}
    return number._replace(ends=None) if is_point else number


def _format(numbers: Sequence[Number | None]) -> str:
    """The keys of a column in which all these numbers stand with their points below each other."""
    parts = [number.value.lstrip("+-").partition(".") for number in numbers if number is not None]
    whole = max((len(before) for before, _, _ in parts), default=1)
    decimals = max((len(after) for _, _, after in parts), default=0)
    signed = any(number.value[0] in "+-" for number in numbers if number is not None)
    sign = "+" if signed else ""
    return f"table-format={sign}{whole}.{decimals}" + (", retain-explicit-plus" if signed else "")


def _heading(heading: str) -> str:
    """In braces, so that siunitx takes it for text; long ones in lines of their own."""
    lines = textwrap.wrap(one_line(heading), HEADING_CHARACTERS) or [""]
    stacked = r"\\{}".join(map(escaped, lines))  # braces: a line may begin with "["
    return rf"{{\shortstack{{{stacked}}}}}"


def _lines(row: NumberRow) -> list[str]:
    """The row, and below it the intervals if there are any."""
    mark = rf"\textsuperscript{{{row.mark}}}" if row.mark else ""
    values = [f"{{{UNDEFINED}}}" if number is None else number.value for number in row.numbers]
    lines = [" & ".join([escaped(row.label) + mark, *values]) + r" \\"]
    ends = [number.ends if number is not None else None for number in row.numbers]
    if any(ends):
        brackets = [rf"{{\scriptsize [{pair[0]}, {pair[1]}]}}" if pair else "" for pair in ends]
        lines.append(" & ".join(["", *brackets]).strip() + r" \\")
    return lines


def key(name: str) -> str:
    """The name with nothing but letters, digits and hyphens."""
    return "".join(letter if letter.isalnum() and letter.isascii() else "-" for letter in name)
