"""A table of results, written for a terminal, as Markdown, as LaTeX or as HTML."""

import math
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from html import escape
from typing import NamedTuple

from genie_sim.analysis import latex, text_table
from genie_sim.base.text import number_text, one_line

UNKNOWN = "-"  # the text of a value that is not defined
GAP = 2  # characters between columns on a terminal
MIN_TITLE_WIDTH, LEGIBLE_TITLE_WIDTH = 8, 24  # characters
NOTE_WIDTH = 120  # characters in a line of Markdown


class Cell(NamedTuple):
    """A number with its interval, or a text.

    Parameters
    ----------
    value : float, str or None
        In the unit that is shown. NaN is not defined; ``None``: there is no such number.
    low, high : float or None
        The ends of its interval. Without a value, the cell is the interval alone.
    unit : str
        What follows the number; empty where the row's title says it.
    mark : str
        A key of the table's ``marks``: what kind of interval it is. LaTeX alone shows it.
    sign : str
        ``+`` writes the sign of positive numbers, too.
    """

    value: float | str | None = None
    low: float | None = None
    high: float | None = None
    unit: str = ""
    mark: str = ""
    sign: str = ""

    @property
    def is_known(self) -> bool:
        """Whether there is anything in it."""
        return self.value is not None or self.low is not None

    @property
    def is_defined(self) -> bool:
        """Whether it has a text, or a number that is defined."""
        return isinstance(self.value, str) or not (self.value is None or math.isnan(self.value))

    def text(self, intervals: bool = True) -> str:
        """Three digits, the unit, and the interval in brackets."""
        if isinstance(self.value, str):
            return self.value
        ends = ""
        if intervals and self.low is not None and self.high is not None:
            low, high = (number_text(end, sign=self.sign) for end in (self.low, self.high))
            ends = f"{low} to {high}"
        if self.value is None or math.isnan(self.value):
            return ends or UNKNOWN
        text = f"{number_text(self.value, sign=self.sign)} {self.unit}".rstrip()
        return f"{text} ({ends})" if ends else text


class Row(NamedTuple):
    """A row: its title, and a cell for each column."""

    title: str
    cells: Sequence[Cell]


@dataclass(frozen=True)
class ResultTable:
    """Results in rows and columns.

    Parameters
    ----------
    columns : sequence of str
        The columns' titles.
    rows : sequence of Row
        Each with a cell for every column.
    title : str
        Of the table; in LaTeX its caption.
    notes : sequence of str
        What stands below it.
    corner : str
        The title of the column of row titles.
    marks : mapping of str to str
        What the cells' marks mean.
    """

    columns: Sequence[str]
    rows: Sequence[Row]
    title: str = ""
    notes: Sequence[str] = ()
    corner: str = ""
    marks: Mapping[str, str] = field(default_factory=dict)

    @property
    def headings(self) -> list[str]:
        """The titles of all columns, that of the row titles first."""
        return [self.corner, *self.columns]

    def texts(self, intervals: bool = True) -> list[list[str]]:
        """Each row as text that cannot steer a terminal, its title first."""
        return [
            [one_line(text) for text in (row.title, *(cell.text(intervals) for cell in row.cells))]
            for row in self.rows
        ]

    def part(self, columns: slice, rows: slice = slice(None)) -> "ResultTable":
        """The table with some of its columns and rows."""
        chosen = [row._replace(cells=row.cells[columns]) for row in self.rows[rows]]
        return replace(self, columns=self.columns[columns], rows=chosen)

    def without_empty_columns(self) -> "ResultTable":
        """The table with the columns in which anything is known."""
        known = [
            place
            for place in range(len(self.columns))
            if any(row.cells[place].is_known for row in self.rows)
        ]
        rows = [row._replace(cells=[row.cells[place] for place in known]) for row in self.rows]
        return replace(self, columns=[self.columns[place] for place in known], rows=rows)

    def markdown(self, intervals: bool = True) -> str:
        """The title as a heading, the table, and its notes as a paragraph."""
        table = text_table.rounded(
            "markdown", self.headings, self.texts(intervals), f"l{''.join(self._sides())}"
        )
        notes = textwrap.fill(one_line(" ".join(filter(None, self.notes))), NOTE_WIDTH)
        parts = [self.title and f"## {self.title}", table.rstrip(), notes]
        return "\n\n".join(filter(None, parts)) + "\n"

    def _sides(self) -> Iterator[str]:
        """``l`` for each column of texts, ``r`` for one of numbers."""
        for place in range(len(self.columns)):
            is_text = any(isinstance(row.cells[place].value, str) for row in self.rows)
            yield "l" if is_text else "r"

    def html(self) -> str:
        """The title, the table and its notes as a piece of HTML; text is text."""
        head = "".join(f"<th>{escape(heading)}</th>" for heading in self.headings)
        body = "".join(
            f"<tr><th>{escape(title)}</th>{''.join(f'<td>{escape(cell)}</td>' for cell in cells)}"
            "</tr>"
            for title, *cells in self.texts()
        )
        below = "".join(f"<p><small>{escape(note)}</small></p>" for note in self.notes if note)
        return (
            f"<p><b>{escape(self.title)}</b></p>"
            f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{below}"
        )

    def latex(self, name: str) -> str:
        """A floating table; ``\\ref`` calls it ``tab:`` and the name. See ``analysis.latex``."""
        return latex.table(self, f"tab:{latex.key(name)}")

    def terminal(self, width: int, intervals: bool = True) -> str:
        """Lines of at most ``width`` characters, from 40 on.

        Long titles are wrapped, columns that do not fit beside the others stand below them, and
        each block has the rows in which it has a number.
        """
        paragraphs = [
            "\n".join(block._lines(width, intervals)) for block in self._blocks(width, intervals)
        ]
        notes = [line for note in self.notes for line in textwrap.wrap(note, width)]
        return "\n\n".join([*paragraphs, "\n".join(notes)]) + "\n"

    def _blocks(self, width: int, intervals: bool) -> list["ResultTable"]:
        """The columns that stand side by side, in as few blocks of about equal size as leave room
        for legible titles.
        """
        texts = self.texts(intervals)
        widths = _widths([heading.split() for heading in self.columns], texts)
        longest = max((len(row.title) for row in self.rows), default=0)
        title_width = min(longest, max(LEGIBLE_TITLE_WIDTH, width // 4))
        count = len(widths)
        for size in dict.fromkeys(-(-count // blocks) for blocks in range(1, count + 1)):
            parts = [slice(first, first + size) for first in range(0, count, size)]
            if all(title_width + sum(widths[part]) <= width for part in parts) or size == 1:
                return [self.part(part) for part in parts]
        return []

    def _lines(self, width: int, intervals: bool) -> Iterator[str]:
        """The lines of a block, its headings in lines of a word each where they must."""
        known = [row for row in self.rows if any(cell.is_known for cell in row.cells)]
        texts = replace(self, rows=known).texts(intervals)
        title_width = max((len(title) for title, *_ in texts), default=0)
        headings = [[one_line(heading)] for heading in self.columns]
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
