"""A table of results: cells in rows and columns. ``renderers`` writes it."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from genie_sim.base.text import number_text, one_line

UNKNOWN = "-"  # the text of a value that is not defined


class Cell(NamedTuple):
    """A number with its interval, or a text.

    Parameters
    ----------
    value : float, str or None
        In the unit that is shown. NaN is not defined; ``None``: there is no such number.
    low, high : float or None
        The ends of its interval. Without a value, the cell is the interval alone.
    sign : str
        ``+`` writes the sign of positive numbers, too.
    """

    value: float | str | None = None
    low: float | None = None
    high: float | None = None
    sign: str = ""

    @property
    def is_known(self) -> bool:
        """Whether there is anything in it, if only NaN."""
        return self.value is not None or self.low is not None

    @property
    def is_defined(self) -> bool:
        """Whether it has a text, or a number that is defined."""
        return isinstance(self.value, str) or not (self.value is None or math.isnan(self.value))

    def text(self, intervals: bool = True) -> str:
        """Three digits, and the interval in brackets."""
        if isinstance(self.value, str):
            return self.value
        ends = ""
        if intervals and self.low is not None and self.high is not None:
            low, high = (number_text(end, sign=self.sign) for end in (self.low, self.high))
            ends = f"{low} to {high}"
        if self.value is None or math.isnan(self.value):
            return ends or UNKNOWN
        text = number_text(self.value, sign=self.sign)
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
    keys : int
        How many columns, the first ones, say with the row's title what the row is of.
    """

    columns: Sequence[str]
    rows: Sequence[Row]
    title: str = ""
    notes: Sequence[str] = ()
    corner: str = ""
    keys: int = 0

    @classmethod
    def of_texts(
        cls, headings: Sequence[str], rows: Iterable[Sequence[str]], title: str = ""
    ) -> "ResultTable":
        """A table of texts alone; the first of each row is its title."""
        made = [Row(first, [Cell(text) for text in texts]) for first, *texts in rows]
        return cls(headings[1:], made, title, corner=headings[0])

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

    def cut(self, columns: slice, rows: slice = slice(None)) -> "ResultTable":
        """The table with its keys, some of its other columns, and some of its rows."""
        keys = self.keys
        chosen = [
            row._replace(cells=[*row.cells[:keys], *row.cells[keys:][columns]])
            for row in self.rows[rows]
        ]
        titles = [*self.columns[:keys], *self.columns[keys:][columns]]
        return replace(self, columns=titles, rows=chosen)

    def without_empty_columns(self) -> "ResultTable":
        """The table without columns in which nothing is known."""
        known = [
            place
            for place in range(len(self.columns))
            if any(row.cells[place].is_known for row in self.rows)
        ]
        rows = [row._replace(cells=[row.cells[place] for place in known]) for row in self.rows]
        return replace(self, columns=[self.columns[place] for place in known], rows=rows)
