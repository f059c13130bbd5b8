"""Tables as LaTeX for an article: rules of ``booktabs``, columns of ``siunitx``, a caption, a
label, and a note for every sign.

A value stands above its interval, so a table of three methods fits a column of two.
"""

import textwrap
from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

from genie_sim.analysis.text_table import LATEX
from genie_sim.base.text import one_line

if TYPE_CHECKING:
    from genie_sim.analysis.result_table import Cell, ResultTable, Row

PACKAGES = ("booktabs", "siunitx")
MAX_NARROW = 3  # columns of numbers in a column of two
MAX_WIDE = 6  # and over both
MAX_ROWS = 25  # with intervals below them they take the height of a page
HEADING_CHARACTERS = 14
UNDEFINED = "--"


def table(table: "ResultTable", label: str) -> str:
    """A floating table, over both columns of a page if one is too narrow. What fits no page is
    divided into several tables, with the notes below the last.

    Parameters
    ----------
    table : ResultTable
        Its title is the caption.
    label : str
        What ``\\ref`` names the table by; further parts end in ``-2`` and so on.
    """
    parts = [
        table.part(columns, rows)
        for rows in _blocks(len(table.rows), MAX_ROWS)
        for columns in _blocks(len(table.columns), MAX_WIDE)
    ]
    texts = []
    for number, part in enumerate(parts, 1):
        is_last = number == len(parts)
        of_parts = f" (part {number} of {len(parts)})" if len(parts) > 1 else ""
        wide = len(part.columns) > MAX_NARROW
        texts.append(
            floating(
                _tabular(part, wide),
                caption=f"{table.title}{of_parts}",
                label=label if number == 1 else f"{label}-{number}",
                notes=table.notes if is_last else (),
                signs=_signs(part),
                wide=wide,
            )
        )
    return "\n".join(texts)


def _blocks(length: int, most: int) -> list[slice]:
    """As few slices of about equal length as there must be for none to be longer than ``most``."""
    count = max(-(-length // most), 1)
    ends = [length * number // count for number in range(count + 1)]
    return [slice(first, end) for first, end in pairwise(ends)]


def _tabular(table: "ResultTable", wide: bool) -> str:
    formats = [
        _format([row.cells[place] for row in table.rows]) for place in range(len(table.columns))
    ]
    width = 0.30 if wide else 0.34
    lines = [
        rf"\begin{{tabular}}{{@{{}}>{{\raggedright\arraybackslash}}p{{{width:.2f}\linewidth}}",
        *(f"  {numbers}" for numbers in formats),
        r"  @{}}",
        r"\toprule",
        " & ".join([escaped(table.corner), *map(_heading, table.columns)]).strip() + r" \\",
        r"\midrule",
        *(line for row in table.rows for line in _lines(row, _marks(table, row))),
        r"\bottomrule",
        r"\end{tabular}",
    ]
    return "\n".join(lines)


def _marks(table: "ResultTable", row: "Row") -> list[str]:
    """The marks of a row's intervals that the table explains."""
    return [mark for mark in table.marks if any(cell.mark == mark for cell in row.cells)]


def _signs(table: "ResultTable") -> list[str]:
    """What the signs of a table mean, in LaTeX."""
    used = dict.fromkeys(mark for row in table.rows for mark in _marks(table, row))
    signs = [rf"\textsuperscript{{{mark}}} {escaped(table.marks[mark])}." for mark in used]
    if not all(cell.is_defined for row in table.rows for cell in row.cells):
        signs.append("--: not defined.")
    return signs


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


def _value(cell: "Cell") -> str:
    """A number as siunitx reads it; anything else in braces, so that siunitx takes it for text."""
    if isinstance(cell.value, str):
        return escaped(cell.value)
    if cell.value is None or not cell.is_defined:
        return f"{{{UNDEFINED}}}"
    return printed(cell.value, cell.sign)


def _ends(cell: "Cell") -> str:
    """The interval in brackets; none that is no wider than the number is exact."""
    if cell.low is None or cell.high is None:
        return ""
    low, high = printed(cell.low, cell.sign), printed(cell.high, cell.sign)
    return "" if low == high == _value(cell) else rf"{{\scriptsize [{low}, {high}]}}"


def _format(cells: Sequence["Cell"]) -> str:
    """The column in which all these numbers stand with their points below each other; one of
    texts is ragged.
    """
    if any(isinstance(cell.value, str) for cell in cells):
        return "l"
    numbers = [_value(cell) for cell in cells if cell.is_defined]
    parts = [number.lstrip("+-").partition(".") for number in numbers]
    whole = max((len(before) for before, _, _ in parts), default=1)
    decimals = max((len(after) for _, _, after in parts), default=0)
    signed = any(number[0] in "+-" for number in numbers)
    sign = "+" if signed else ""
    more = ", retain-explicit-plus" if signed else ""
    return f"S[table-format={sign}{whole}.{decimals}{more}]"


def _heading(heading: str) -> str:
    """In braces, so that siunitx takes it for text; long ones in lines of their own."""
    lines = textwrap.wrap(one_line(heading), HEADING_CHARACTERS) or [""]
    stacked = r"\\{}".join(map(escaped, lines))  # braces: a line may begin with "["
    return rf"{{\shortstack{{{stacked}}}}}"


def _lines(row: "Row", marks: Sequence[str]) -> list[str]:
    """The row, and below it the intervals if there are any."""
    raised = "".join(rf"\textsuperscript{{{mark}}}" for mark in marks)
    lines = [[escaped(row.title) + raised, *map(_value, row.cells)]]
    if any(ends := [_ends(cell) for cell in row.cells]):
        lines.append(["", *ends])
    return [" & ".join(line).strip() + r" \\" for line in lines]


def key(name: str) -> str:
    """The name with nothing but letters, digits and hyphens."""
    return "".join(letter if letter.isalnum() and letter.isascii() else "-" for letter in name)
