"""Parquet files of rows that are placed around one geodetic origin: traces and truth tables.

The metadata of such a file are the version of its format, the origin, the digest of its content,
and where it comes from.
"""

import hashlib
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from genie_sim.base import parquet
from genie_sim.base.errors import UserError
from genie_sim.base.geometry import Geodetic
from genie_sim.base.units import MAX_M

if TYPE_CHECKING:
    import pyarrow

FORMAT_VERSION = 1
FACTS = ("origin", "digest", "provenance")  # of all files, besides the version
MAX_ORIGIN = (90.0, 180.0, 1e5)
# Of a plane that nobody placed on Earth: some place must be written down, no result depends on it.
SOMEWHERE: Geodetic = (0.0, 0.0, 0.0)


def content_digest(content: Sequence[Any]) -> str:
    """The sha256 of numbers, texts, lists and mappings."""
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def write(
    path: Path,
    schema: "pyarrow.Schema",
    rows: Iterable[Mapping[str, Any]],
    content: Any,
    names: Sequence[str],
) -> None:
    """Writes a file, whole or not at all; the same content gives the same bytes with the same
    pyarrow. Raises UserError where the folder cannot be written.

    Parameters
    ----------
    path : where to write
    schema : of the rows
    rows : values by column
    content : has as attributes its ``origin``, as latitude [deg], longitude [deg] and altitude [m],
        its ``digest``, the ``content_digest`` of what the rows say, its ``provenance``, and those
        of ``names``
    names : of more metadata, each written where it is not ``None``
    """
    values = {name: getattr(content, name) for name in (*FACTS, *names)}
    about = {name: value for name, value in values.items() if value is not None}
    parquet.write(path, schema, rows, {"format_version": FORMAT_VERSION, **about})


def check_replaceable(path: Path, names: Sequence[str]) -> None:
    """Raises ``UserError`` for a file that is there and that ``write`` with these ``names`` did not
    make.
    """
    parquet.check_replaceable(path, ("format_version", *FACTS, *names))


def read(
    path: Path,
    what: str,
    schema: "pyarrow.Schema",
    *texts: str,
    optional: Callable[[str], bool] = lambda _: False,
) -> "tuple[pyarrow.Table, dict[str, Any]]":
    """The columns of ``schema`` in a file, those ``optional`` that are there, and its metadata, of
    which ``texts`` names more than all files have.

    Raises UserError, naming file and field, for a missing, truncated or foreign file, another
    version of the format, broken metadata, and columns that are missing or have empty values.
    """

    def columns(file_schema: "pyarrow.Schema", about: Mapping[str, Any]) -> list[str]:
        version = about.get("format_version")
        if version != FORMAT_VERSION:
            raise UserError(
                f"{path}: format_version: {what} has version {version!r}, "
                f"this genie-sim reads {FORMAT_VERSION}"
            )
        parquet.check_columns(path, file_schema, schema)
        return [*schema.names, *filter(optional, file_schema.names)]

    table, about = parquet.read(path, what, columns)
    kinds = {"origin": list, "digest": str, "provenance": dict} | dict.fromkeys(texts, str)
    for name, kind in kinds.items():
        if not isinstance(about.get(name), kind):
            raise UserError(f"{path}: metadata: {name!r} is missing or not a {kind.__name__}")
    origin = about["origin"]
    if not is_origin(origin):
        raise UserError(f"{path}: metadata: origin {origin!r} is not latitude, longitude, altitude")
    about["origin"] = tuple(origin)
    for name in table.column_names:
        if table.column(name).null_count:
            raise UserError(f"{path}: column {name!r} has empty values")
    return table, about


def check_digest(path: Path, digest: str, about: Mapping[str, Any]) -> None:
    """Raises UserError unless a file's content has the digest that its metadata give."""
    if digest != about["digest"]:
        raise UserError(
            f"{path}: content does not match its own digest {about['digest'][:12]}: "
            "file was altered"
        )


def is_origin(values: Sequence[Any]) -> bool:
    """Whether values are the latitude [deg], longitude [deg] and altitude [m] of a place."""
    return len(values) == len(MAX_ORIGIN) and all(
        in_range([value], limit) for value, limit in zip(values, MAX_ORIGIN, strict=True)
    )


def in_range(values: Sequence[Any], limit: float = MAX_M) -> bool:
    """Whether all values are numbers, neither infinite nor larger than ``limit``."""
    return all(isinstance(value, (int, float)) and abs(value) <= limit for value in values)
