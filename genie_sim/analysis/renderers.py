"""A table of results as text: for a terminal, as Markdown, HTML, LaTeX or CSV.

Text is text in each of them: no cell can steer a terminal, end its row, be markup, or run a command
of LaTeX or a formula of a spreadsheet.
"""

import csv
import io
import math
import re
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from html import escape
from itertools import chain, pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

from genie_sim.analysis.result_table import Cell, ResultTable
from genie_sim.base.errors import UserError, unknown
from genie_sim.base.paths import OutputKind, atomic_write, usable
from genie_sim.base.text import number_text, one_line, significant
from genie_sim.record.results import NOT_ONE_RUN, TIDY_FIELDS
from genie_sim.record.tables import harmless

if TYPE_CHECKING:
    import pandas as pd

FORMATS = {"markdown": ".md", "csv": ".csv", "latex": ".tex"}
OUTPUTS = {
    "markdown": OutputKind("table in Markdown", rb"(## [^\n]*\n\n)?\|[^\n]*\n\|---"),
    "csv": OutputKind("table of metrics", rb"([^\n]*,)?metric,"),
    "latex": OutputKind("table in LaTeX", rb"% needs "),
}
GAP = 2  # characters between columns on a terminal
MIN_TITLE_WIDTH, LEGIBLE_TITLE_WIDTH = 8, 24  # characters
NOTE_WIDTH = 120  # characters in a line of Markdown

# Of Markdown, where it is not plain text: "_" inside a word, "<" and "&" before a space are that.
MARKUP = re.compile(
    r"[\\`*$~|]|(?<!\w)_|_(?!\w)|<(?=[A-Za-z/!?])|&(?=#|\w+;)|(?<=\])\(|(?<!\S)#|!(?=\[)"
)
ESCAPES = str.maketrans(
    {
        "\\": r"\textbackslash{}",
        "_": r"\_",
        "%": r"\%",
        "&": r"\&",
        "#": r"\#",
        "$": r"\$",
        "{": r"\{",
        "}": r"\}",
        "~": r"\textasciitilde{}",
        "^": r"\textasciicircum{}",
    }
)
PACKAGES = ("booktabs", "array")
MAX_NARROW = 3  # columns of numbers in a column of two
MAX_WIDE = 6  # and over both
MAX_ROWS = 25  # with intervals below them they take the height of a page
HEADING_CHARACTERS, MAX_KEY_CHARACTERS = 14, 24
UNDEFINED = "--"
LAST_LATIN = "\u00ff"  # of the letters that pdflatex knows


def checked(format: str) -> str:
    """The format, if it is known. Raises ``UserError``."""
    if format not in FORMATS:
        raise UserError(f"format: {unknown('format', format, FORMATS)}")
    return format


def write(path: Path, text: str, format: str) -> None:
    """Writes a table. Raises ``UserError``, also for a file that a sweep or an evaluation has."""
    if path.exists() and any((path.parent / about).exists() for about in NOT_ONE_RUN):
        raise UserError(f"{path}: belongs to the result in that folder; say where else")
    with usable(path):
        path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_write(path, OUTPUTS[format]) as beside:
        beside.write_text(text, encoding="utf-8")


def markdown(table: ResultTable, intervals: bool = True) -> str:
    """The title as a heading, the table, and its notes as a paragraph."""
    rows = [map(markdown_text, row) for row in (table.headings, *table.texts(intervals))]
    parts = [
        table.title and f"## {markdown_text(table.title)}",
        markdown_rows(rows, _are_numbers(table)),
        markdown_paragraph(" ".join(filter(None, table.notes))),
    ]
    return "\n\n".join(filter(None, parts)) + "\n"


def markdown_rows(rows: Iterable[Iterable[str]], are_numbers: Iterable[bool]) -> str:
    """A table of cells that are Markdown, the first row of headings; ``are_numbers`` says of each
    column but the first whether it stands at the right.
    """
    headings, *others = (" | ".join(map(one_line, row)) for row in rows)
    sides = "".join("---:|" if is_number else "---|" for is_number in are_numbers)
    return "\n".join([f"| {headings.lstrip()} |", f"|---|{sides}", *(f"| {r} |" for r in others)])


def markdown_text(text: str) -> str:
    """A text on one line of Markdown, which shows it as it is."""
    return MARKUP.sub(r"\\\g<0>", one_line(text))


def markdown_paragraph(text: str) -> str:
    """The same in lines, of which none begins a list, a quotation or a heading."""
    lines = textwrap.fill(markdown_text(text), NOTE_WIDTH)
    return re.sub(r"^(\d*)([-+>=.)])", r"\1\\\2", lines, flags=re.MULTILINE)


def _are_numbers(table: ResultTable) -> Iterator[bool]:
    """Of each column whether it holds no text."""
    for place in range(len(table.columns)):
        yield not any(isinstance(row.cells[place].value, str) for row in table.rows)


def html(table: ResultTable) -> str:
    """The title, the table and its notes as a piece of HTML; text is text."""
    below = "".join(f"<p><small>{escape(note)}</small></p>" for note in table.notes if note)
    return f"<p><b>{escape(table.title)}</b></p>{html_table(table)}{below}"


def html_table(table: ResultTable) -> str:
    """The table alone as HTML: titles and keys head their rows, intervals are in small letters."""
    corner, *columns = map(escape, table.headings)
    head = "".join(f'<th scope="col">{column}</th>' for column in columns)
    rows = zip(table.texts(intervals=False), table.texts(), strict=True)
    heads = 1 + table.keys
    body = ""
    for values, texts in rows:
        titles = "".join(f'<th scope="row">{escape(text)}</th>' for text in texts[:heads])
        body += f"<tr>{titles}{''.join(map(_html_cell, values[heads:], texts[heads:]))}</tr>"
    return f"<table><thead><tr><td>{corner}</td>{head}</tr></thead><tbody>{body}</tbody></table>"


def _html_cell(value: str, text: str) -> str:
    """A value and, if the text begins with it, what follows in small letters."""
    if not text.startswith(f"{value} ("):
        return f"<td>{escape(text)}</td>"
    return f"<td>{escape(value)} <small>{escape(text.removeprefix(value).strip())}</small></td>"


def terminal(table: ResultTable, width: int, intervals: bool = True) -> str:
    """Lines of at most ``width`` characters, from 40 on, of a table without keys.

    Long titles are wrapped, columns that do not fit beside the others stand below them, and
    each block has the rows in which it has a number.
    """
    paragraphs = [
        "\n".join(_block_lines(block, width, intervals))
        for block in _side_by_side(table, width, intervals)
    ]
    notes = [line for note in table.notes for line in textwrap.wrap(one_line(note), width)]
    return "\n\n".join([*paragraphs, "\n".join(notes)]) + "\n"


def _side_by_side(table: ResultTable, width: int, intervals: bool) -> list[ResultTable]:
    """The columns that stand side by side, in as few blocks of about equal size as leave room
    for legible titles.
    """
    texts = table.texts(intervals)
    widths = _widths([heading.split() for heading in table.columns], texts)
    longest = max((len(row.title) for row in table.rows), default=0)
    title_width = min(longest, max(LEGIBLE_TITLE_WIDTH, width // 4))
    count = len(widths)
    for size in dict.fromkeys(-(-count // blocks) for blocks in range(1, count + 1)):
        parts = [slice(first, first + size) for first in range(0, count, size)]
        if all(title_width + sum(widths[part]) <= width for part in parts) or size == 1:
            return [table.cut(part) for part in parts]
    return []


def _block_lines(table: ResultTable, width: int, intervals: bool) -> Iterator[str]:
    """The lines of a block, its headings in lines of a word each where they must."""
    known = [row for row in table.rows if any(cell.is_known for cell in row.cells)]
    texts = replace(table, rows=known).texts(intervals)
    title_width = max((len(title) for title, *_ in texts), default=0)
    headings = [[one_line(heading)] for heading in table.columns]
    widths = _widths(headings, texts)
    if title_width + sum(widths) > width:
        headings = [heading.split() for (heading,) in headings]
        widths = _widths(headings, texts)
        title_width = min(title_width, max(width - sum(widths), MIN_TITLE_WIDTH))
    height = max(map(len, headings), default=0)
    above = [[""] * (height - len(words)) + words for words in headings]
    for words in zip(*above, strict=True):
        yield _line("", title_width, words, widths)
    for title, *cells in texts:
        *lines, last = textwrap.wrap(title, title_width) or [""]
        yield from lines
        yield _line(last, title_width, cells, widths)


def _widths(headings: Sequence[Sequence[str]], texts: Sequence[Sequence[str]]) -> list[int]:
    """The width of each column with its gap [characters]; a heading has a word or more a line."""
    return [
        GAP + max(map(len, [*words, *(row[place] for row in texts)]))
        for place, words in enumerate(headings, 1)
    ]


def _line(title: str, title_width: int, cells: Sequence[str], widths: Sequence[int]) -> str:
    numbers = "".join(f"{cell:>{width}}" for cell, width in zip(cells, widths, strict=True))
    return f"{title:<{title_width}}{numbers}".rstrip()


def latex(table: ResultTable, name: str) -> str:
    """A floating table with rules of ``booktabs``, over both columns of a page if one is too
    narrow. What fits no page is divided into several tables, with the notes below the last. A value
    stands above its interval, so a table of three methods fits a column of two. A key that is that
    of the row above is not repeated.

    Parameters
    ----------
    table : ResultTable
        Its title is the caption.
    name : str
        ``\\ref`` calls the table ``tab:`` and the name; further parts end in ``-2`` and so on.
    """
    label = "".join(each if each.isalnum() and each.isascii() else "-" for each in name)
    parts = [
        table.cut(columns, rows)
        for rows in _blocks(len(table.rows), MAX_ROWS)
        for columns in _blocks(len(table.columns) - table.keys, MAX_WIDE)
    ]
    texts = []
    for number, part in enumerate(parts, 1):
        of_parts = f" (part {number} of {len(parts)})" if len(parts) > 1 else ""
        notes = [_escaped(note) for note in table.notes if note and number == len(parts)]
        below = " ".join([*notes, *_signs(part)])
        wide = len(part.columns) > MAX_NARROW
        environment = "table*" if wide else "table"
        lines = [
            f"% needs \\usepackage{{{','.join(PACKAGES)}}}{_engine(part)}",
            rf"\begin{{{environment}}}[!t]",
            r"\centering",
            r"\setlength{\tabcolsep}{3pt}\renewcommand{\arraystretch}{0.96}",
            rf"\caption{{{_escaped(table.title + of_parts)}}}",
            rf"\label{{tab:{label}{f'-{number}' if number > 1 else ''}}}",
            r"\footnotesize",
            _tabular(part, wide),
            *(["", r"\smallskip", rf"\parbox{{\linewidth}}{{{below}}}"] if below else []),
            rf"\end{{{environment}}}",
        ]
        texts.append("\n".join([*lines, ""]))
    return "\n".join(texts)


def _engine(table: ResultTable) -> str:
    """What a table of texts beyond Latin letters needs besides packages."""
    texts = [table.title, *table.headings, *table.notes, *chain(*table.texts())]
    return "" if all(text.isascii() or max(text) <= LAST_LATIN for text in texts) else ", lualatex"


def _blocks(length: int, most: int) -> list[slice]:
    """As few slices of about equal length as there must be for none to be longer than ``most``."""
    count = max(-(-length // most), 1)
    ends = [length * number // count for number in range(count + 1)]
    return [slice(first, end) for first, end in pairwise(ends)]


def _tabular(table: ResultTable, wide: bool) -> str:
    width = (0.30 if wide else 0.34) / (1 + table.keys)
    wrapped = rf">{{\raggedright\arraybackslash}}p{{{width:.2f}\linewidth}}"
    sides = ["r" if is_number else "l" for is_number in _are_numbers(table)]
    headings = [_heading(*about) for about in zip(table.columns, sides, strict=True)]
    columns, texts = [wrapped, *sides], table.texts()
    for place in range(1 + table.keys if table.keys else 0):
        is_short = all(len(row[place]) <= MAX_KEY_CHARACTERS for row in texts)
        columns[place] = "l" if is_short else wrapped
    lines = [
        rf"\begin{{tabular}}{{@{{}}{columns[0]}",
        f"  {''.join(columns[1:])}",
        r"  @{}}",
        r"\toprule",
        " & ".join([_title(table.corner), *headings]).strip() + r" \\",
        r"\midrule",
        *_body(table),
        r"\bottomrule",
        r"\end{tabular}",
    ]
    return "\n".join(lines)


def _signs(table: ResultTable) -> list[str]:
    """What the signs of a table mean, in LaTeX."""
    cells = [cell for row in table.rows for cell in row.cells]
    signs = [] if all(cell.is_defined for cell in cells) else ["--: not defined."]
    of_numbers = [cell for cell in cells if cell.is_defined and not isinstance(cell.value, str)]
    if len({bool(_ends(cell)) for cell in of_numbers}) == 2:
        signs.append("No brackets: the interval rounds to the number, or there is none.")
    return signs


def _escaped(text: str) -> str:
    """Text in which no character is a command of LaTeX."""
    return one_line(text).translate(ESCAPES)


def _number(value: float, sign: str) -> str:
    return number_text(value, sign=sign).replace("-", "$-$") if value else "0"


def _value(cell: Cell) -> str:
    if isinstance(cell.value, str):
        return _escaped(cell.value)
    if cell.value is None or not cell.is_defined:
        return UNDEFINED
    return _number(cell.value, cell.sign)


def _ends(cell: Cell) -> str:
    """The interval in brackets; nothing where its ends are written as the number is."""
    if cell.low is None or cell.high is None:
        return ""
    low, high = (_number(end, cell.sign) for end in (cell.low, cell.high))
    return "" if low == high == _value(cell) else rf"{{\scriptsize [{low}, {high}]}}"


def _heading(heading: str, side: str) -> str:
    """Long ones in lines of their own, which stand at this side."""
    lines = textwrap.wrap(one_line(heading), HEADING_CHARACTERS) or [""]
    stacked = r"\\{}".join(map(_escaped, lines))  # braces: a line may begin with "["
    return rf"\shortstack[{side}]{{{stacked}}}"


def _title(text: str) -> str:
    """Of a row. One that begins with "[" or "*" would belong to the end of the row before."""
    return re.sub(r"^(?=[\[*])", "{}", _escaped(text))


def _body(table: ResultTable) -> Iterator[str]:
    """The rows, and below each its intervals if there are any; a little space where the first of
    several keys changes.
    """
    above: list[str] = []
    for row in table.rows:
        texts = [_title(row.title), *map(_value, row.cells)]
        keys = texts[: table.keys]
        if above and above[0] != keys[0]:
            yield r"\addlinespace"
        for place in range(len(keys)):
            if keys[: place + 1] == above[: place + 1]:
                texts[place] = ""
        above = keys
        lines = [texts]
        if any(ends := [_ends(cell) for cell in row.cells]):
            lines.append(["", *ends])
        for line in lines:
            yield " & ".join(line).strip() + r" \\"


def csv_of_rows(names: Iterable[str], rows: Iterable[Sequence[Any]]) -> str:
    """All numbers as CSV, to ten digits, one that is not defined as an empty field; no cell is a
    formula to a spreadsheet.
    """
    to = io.StringIO()
    writer = csv.writer(to, lineterminator="\n")
    for row in ([*names], *rows):
        writer.writerow([_exact_cell(cell) for cell in row])
    return to.getvalue()


def csv_of_table(table: "pd.DataFrame") -> str:
    """The same of a table of numbers: the columns that say which setting, ``TIDY_FIELDS``, and
    what else there is.
    """
    names = list(map(str, table.columns))
    before = names[: names.index("metric")]
    table = table if "seed" in names else table.assign(seed=None)
    columns = dict.fromkeys((*before, *TIDY_FIELDS, *names))
    rows = table.reindex(columns=list(columns)).itertuples(index=False, name=None)
    return csv_of_rows(columns, rows)


def _exact_cell(cell: Any) -> Any:
    if isinstance(cell, float):
        return None if math.isnan(cell) else significant(cell, digits=10)
    return harmless(one_line(cell)) if isinstance(cell, str) else cell
