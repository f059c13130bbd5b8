"""A table's columns as numpy arrays: what numbers, figures and pages are computed from. pandas is for users only."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import pandas as pd

Array = np.ndarray[Any, Any]
Floats = np.ndarray[Any, np.dtype[np.float64]]
NO_TEXT = -1


class Text:
    """A column of text: ``names``, sorted, and of each row the place of its name there, ``NO_TEXT`` for none.

    Compared with a text it gives a mask, like an array; its codes sort as the texts do.
    """

    def __init__(self, codes: Array, names: Sequence[str]) -> None:
        self.codes = codes
        self.names = tuple(names)

    @classmethod
    def of(cls, codes: Array, names: Sequence[str]) -> "Text":
        """The same for names in any order, each of which may occur more than once."""
        ordered = sorted(set(names))
        place = {name: index for index, name in enumerate(ordered)}
        return cls(
            np.array([*(place[name] for name in names), NO_TEXT], dtype=np.int32)[codes], ordered
        )

    def __len__(self) -> int:
        return len(self.codes)

    def __getitem__(self, rows: Any) -> "Text":
        return Text(self.codes[rows], self.names)

    def __eq__(self, name: object) -> Any:
        return self.isin([name])

    def __ne__(self, name: object) -> Any:
        return ~self.isin([name])

    __hash__ = None  # type: ignore[assignment]  # it is a column, and equal to nothing

    def isin(self, names: Iterable[Any]) -> Array:
        """Which rows have one of these names."""
        wanted = [self.names.index(name) for name in names if name in self.names]
        if len(wanted) == 1:
            return np.asarray(self.codes == wanted[0])
        return np.isin(self.codes, wanted)

    @property
    def known(self) -> Array:
        """Which rows have a text."""
        return np.asarray(self.codes != NO_TEXT)

    def unique(self) -> list[str]:
        """The names that occur, sorted."""
        return [self.names[code] for code in np.unique(self.codes) if code != NO_TEXT]

    def tolist(self) -> list[str | None]:
        """The text of each row."""
        names = [*self.names, None]
        return [names[code] for code in self.codes.tolist()]

    def codes_in(self, names: Sequence[str]) -> Array:
        """The place of each row's text among other names, ``NO_TEXT`` where it is not there."""
        place = {name: index for index, name in enumerate(names)}
        return np.array(
            [*(place.get(name, NO_TEXT) for name in self.names), NO_TEXT], dtype=np.int64
        )[self.codes]


class Columns:
    """Columns of equal length by name: numpy arrays, and ``Text``. An unknown number is NaN, an unknown flag None.

    ``places``: of the rows that are meant, all of them if ``None``; a column is only copied when it is asked for.
    """

    def __init__(self, columns: Mapping[str, Any], places: Array | None = None) -> None:
        self._whole = columns
        self._places = places
        self._chosen: dict[str, Any] = {}

    @classmethod
    def of(cls, table: "Columns | pd.DataFrame") -> "Columns":
        """The same for a pandas table, whose categories and texts become ``Text``."""
        return (
            table
            if isinstance(table, Columns)
            else cls({str(name): _column(table[name]) for name in table})
        )

    def __getitem__(self, name: str) -> Any:
        if self._places is None:
            return self._whole[name]
        if name not in self._chosen:
            self._chosen[name] = self._whole[name][self._places]
        return self._chosen[name]

    def __len__(self) -> int:
        return (
            len(next(iter(self._whole.values()), ())) if self._places is None else len(self._places)
        )

    @property
    def names(self) -> list[str]:
        """Of the columns, in order."""
        return list(self._whole)

    def floats(self, name: str) -> Floats:
        """A column of numbers, NaN where unknown."""
        values: Floats = self[name].astype(np.float64)
        return values

    def rows(self, chosen: Any) -> "Columns":
        """These rows: a mask, places or a slice."""
        places = np.arange(len(self)) if self._places is None else self._places
        return Columns(self._whole, places[chosen])

    def where(self, **texts: str) -> "Columns":
        """The rows with these texts."""
        chosen = np.ones(len(self), dtype=bool)
        for name, text in texts.items():
            chosen &= self[name] == text
        return self.rows(chosen)

    def assign(self, **columns: Any) -> "Columns":
        """With these columns; a text is meant for every row."""
        whole = {name: self[name] for name in self.names}
        for name, one in columns.items():
            whole[name] = (
                Text(np.zeros(len(self), dtype=np.int32), [one]) if isinstance(one, str) else one
            )
        return Columns(whole)

    def groups(self, name: str) -> "Iterator[tuple[str, Columns]]":
        """The rows of each text of a column, sorted by it; they keep their order."""
        column: Text = self[name]
        order = np.argsort(column.codes, kind="stable")
        codes, begins = np.unique(column.codes[order], return_index=True)
        for code, places in zip(
            codes.tolist(), np.split(order, begins[1:]), strict=False
        ):  # no codes: one empty part
            if code != NO_TEXT:
                yield column.names[code], self.rows(places)

    def by(self, name: str) -> "Columns":
        """The rows in the order of a column of numbers, ties as they are."""
        return self.rows(np.argsort(self[name], kind="stable"))

    def to_frame(self) -> "pd.DataFrame":
        """As a pandas table: text is categorical."""
        import pandas as pd

        frame: dict[str, Any] = {}
        for name in self.names:
            one = self[name]
            if isinstance(one, Text):
                one = pd.Categorical.from_codes(one.codes, pd.Index(one.names, dtype="str"))
            frame[name] = one
        return pd.DataFrame(frame)


def concat(parts: Sequence[Columns]) -> Columns:
    """The rows of several tables with the same columns."""
    made: dict[str, Any] = {}
    for name in parts[0].names:
        columns = [part[name] for part in parts]
        made[name] = joined(columns) if isinstance(columns[0], Text) else np.concatenate(columns)
    return Columns(made)


def joined(columns: Sequence[Text]) -> Text:
    """The rows of several columns of text."""
    names = sorted({name for column in columns for name in column.names})
    return Text(np.concatenate([column.codes_in(names) for column in columns]), names)


def _column(values: "pd.Series[Any]") -> Any:
    import pandas as pd

    if isinstance(values.dtype, pd.CategoricalDtype):
        return Text.of(values.cat.codes.to_numpy(), [str(name) for name in values.cat.categories])
    if pd.api.types.infer_dtype(values) == "string":
        codes, names = pd.factorize(values)
        return Text.of(codes, [str(name) for name in names])
    return values.to_numpy()
