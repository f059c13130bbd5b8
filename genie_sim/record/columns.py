"""A table's columns as numpy arrays, from which metrics, figures and pages are computed.

Numpy and not ``pyarrow.compute``, whose import takes a tenth of the time of a run; pandas is only
used in the public API.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from genie_sim.base.errors import UserError, unknown

if TYPE_CHECKING:
    import pandas as pd

Array = np.ndarray[Any, Any]
Floats = np.ndarray[Any, np.dtype[np.float64]]
NO_TEXT = -1  # the code of a row without a text


class Codes(dict[Any, int]):
    """A number for each key, such as a text, in the order in which they are first asked for; none
    for ``None``.
    """

    def __missing__(self, key: Any) -> int:
        if key is None:
            raise TypeError("None has no code")
        self[key] = code = len(self)
        return code


class Text:
    """A column of text, as a code for each row: the position of its text in the sorted ``names``,
    or ``NO_TEXT``.

    Compared with a text it gives a mask, like an array; its codes sort as the texts do.
    """

    def __init__(self, codes: Array, names: Sequence[str]) -> None:
        self.codes = codes
        self.names = tuple(names)

    @classmethod
    def of(cls, codes: Array, names: Sequence[str]) -> "Text":
        """Returns the column for names in any order, each of which may occur more than once."""
        sorted_names = sorted(set(names))
        return cls(_translated(codes, names, sorted_names).astype(np.int32), sorted_names)

    def __len__(self) -> int:
        return len(self.codes)

    def __getitem__(self, rows: Any) -> "Text":
        return Text(self.codes[rows], self.names)

    def __eq__(self, name: object) -> Any:
        return self.isin([name])

    def __ne__(self, name: object) -> Any:
        return ~self.isin([name])

    __hash__ = None  # type: ignore[assignment]  # compares like an array

    def isin(self, names: Iterable[Any]) -> Array:
        """Returns which rows have one of these names."""
        codes = [self.names.index(name) for name in names if name in self.names]
        if len(codes) == 1:
            return np.asarray(self.codes == codes[0])
        return np.isin(self.codes, codes)

    @property
    def has_text(self) -> Array:
        """Which rows have a text."""
        return np.asarray(self.codes != NO_TEXT)

    def unique(self) -> list[str]:
        """Returns the names that occur, sorted."""
        return [self.names[code] for code in np.unique(self.codes) if code != NO_TEXT]

    def tolist(self) -> list[str | None]:
        """Returns the text of each row."""
        names = [*self.names, None]  # NO_TEXT is the last
        return [names[code] for code in self.codes.tolist()]

    def codes_in(self, names: Sequence[str]) -> Array:
        """Returns the position of each row's text among other names, ``NO_TEXT`` where it is not
        there.
        """
        return _translated(self.codes, self.names, names)


class Columns:
    """Columns of equal length by name: numpy arrays, and ``Text``.

    What is not known is NaN in a column of numbers, which is then one of floats, None in one of
    flags, which is then one of objects, and ``NO_TEXT`` among the codes of a text.

    ``rows`` are the indices of the rows of this view; ``None`` for all rows. A column is copied
    when it is first asked for.
    """

    def __init__(self, columns: Mapping[str, Any], rows: Array | None = None) -> None:
        self._columns = columns
        self._rows = rows
        self._copies: dict[str, Any] = {}

    @classmethod
    def of(cls, table: "Columns | pd.DataFrame") -> "Columns":
        """Returns the same table as columns; categories and texts of pandas become ``Text``."""
        if isinstance(table, Columns):
            return table
        return cls({str(name): _column(table[name]) for name in table})

    def __getitem__(self, name: str) -> Any:
        if name not in self._columns:
            raise UserError(unknown("column", name, self._columns))
        if self._rows is None:
            return self._columns[name]
        if name not in self._copies:
            self._copies[name] = self._columns[name][self._rows]
        return self._copies[name]

    def __len__(self) -> int:
        if self._rows is not None:
            return len(self._rows)
        return len(next(iter(self._columns.values()), ()))

    @property
    def names(self) -> list[str]:
        """The names of the columns, in order."""
        return list(self._columns)

    def floats(self, name: str) -> Floats:
        """Returns a column of numbers, NaN where unknown."""
        values: Floats = self[name].astype(np.float64)
        return values

    def rows(self, selection: Any) -> "Columns":
        """Returns these rows: a mask, indices or a slice."""
        rows = np.arange(len(self)) if self._rows is None else self._rows
        return Columns(self._columns, rows[selection])

    def where(self, **texts: str) -> "Columns":
        """Returns the rows with these texts."""
        mask = np.ones(len(self), dtype=bool)
        for name, text in texts.items():
            mask &= self[name] == text
        return self.rows(mask)

    def assign(self, **columns: Any) -> "Columns":
        """Returns the table with these columns; a text stands in every row."""
        result = {name: self[name] for name in self.names}
        for name, column in columns.items():
            if isinstance(column, str):
                column = Text(np.zeros(len(self), dtype=np.int32), [column])
            result[name] = column
        return Columns(result)

    def groups(self, name: str) -> "Iterator[tuple[str, Columns]]":
        """Yields the rows of each text of a column, sorted by it; they keep their order."""
        column: Text = self[name]
        order = np.argsort(column.codes, kind="stable")
        codes, begins = np.unique(column.codes[order], return_index=True)
        # np.split of no rows gives one empty part, which no code goes with.
        for code, rows in zip(codes.tolist(), np.split(order, begins[1:]), strict=False):
            if code != NO_TEXT:
                yield column.names[code], self.rows(rows)

    def by(self, name: str) -> "Columns":
        """Returns the rows in the order of a column of numbers, ties as they are."""
        return self.rows(np.argsort(self[name], kind="stable"))

    def to_frame(self) -> "pd.DataFrame":
        """Returns a pandas table; text is categorical."""
        import pandas as pd

        columns: dict[str, Any] = {}
        for name in self.names:
            column = self[name]
            if isinstance(column, Text):
                categories = pd.Index(column.names, dtype="str")
                column = pd.Categorical.from_codes(column.codes, categories)
            columns[name] = column
        return pd.DataFrame(columns)


def concat(parts: Sequence[Columns]) -> Columns:
    """Returns the rows of several tables with the same columns."""
    result: dict[str, Any] = {}
    for name in parts[0].names:
        columns = [part[name] for part in parts]
        is_text = isinstance(columns[0], Text)
        result[name] = joined(columns) if is_text else np.concatenate(columns)
    return Columns(result)


def joined(columns: Sequence[Text]) -> Text:
    """Returns the rows of several columns of text."""
    names = sorted({name for column in columns for name in column.names})
    return Text(np.concatenate([column.codes_in(names) for column in columns]), names)


def _translated(codes: Array, names: Sequence[str], other_names: Sequence[str]) -> Array:
    """Returns codes for ``names`` as codes for ``other_names``."""
    positions = {name: position for position, name in enumerate(other_names)}
    table = [positions.get(name, NO_TEXT) for name in names]
    return np.array([*table, NO_TEXT], dtype=np.int64)[codes]  # NO_TEXT is the last


def _column(values: "pd.Series[Any]") -> Any:
    import pandas as pd

    if isinstance(values.dtype, pd.CategoricalDtype):
        return Text.of(values.cat.codes.to_numpy(), [str(name) for name in values.cat.categories])
    if pd.api.types.infer_dtype(values) == "string":
        codes, names = pd.factorize(values)
        return Text.of(codes, [str(name) for name in names])
    return values.to_numpy()
