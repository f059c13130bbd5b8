"""Finds scenarios, device profiles and traces, by path or by name.

A value with a folder or a suffix in it is a path, relative to the current folder. Anything else is
a name, looked up first in the current folder's ``scenarios``, ``scenarios/traces`` or
``device_profiles``, then in the shipped ones.
"""

import functools
import logging
from pathlib import Path
from typing import NamedTuple

from genie_sim.base.errors import UserError, as_user_error, unknown
from genie_sim.base.paths import check_is_file, expanded
from genie_sim.version import PACKAGE_FOLDER

log = logging.getLogger(__name__)


class FileKind(NamedTuple):
    """What is looked for, the folder it lives in and how its file's name ends."""

    what: str
    folder: str
    suffix: str


SCENARIO = FileKind("scenario", "scenarios", ".yaml")
SWEEP = FileKind("sweep", "scenarios/sweeps", ".yaml")
DEVICE = FileKind("device", "device_profiles", ".yaml")
LINK_RECORDING = FileKind("recorded link", "scenarios/links", ".parquet")
TRACE = FileKind("trace", "scenarios/traces", ".parquet")
TRAFFIC = FileKind("traffic", "scenarios/traffic", ".xml.gz")


def find(kind: FileKind, path_or_name: str | Path) -> Path:
    """The file meant by ``path_or_name``. Raises ``UserError`` with the known names if there is
    none.
    """
    text = str(path_or_name)
    path = expanded(text)
    if len(path.parts) > 1 or path.suffix or isinstance(path_or_name, Path):
        is_shipped = path.stem in available(kind)
        shipped_too = f"; the {kind.what} {path.stem!r} needs no path" if is_shipped else ""
        check_is_file(path, text, shipped_too)
        return path
    own, shipped = (root / kind.folder / f"{text}{kind.suffix}" for root in (Path(), _shipped()))
    with as_user_error(text, OSError):
        if own.is_file():
            _tell_of_two(own, shipped)
            return own
        if shipped.is_file():
            return shipped
    raise UserError(unknown(kind.what, text, available(kind)))


@functools.cache
def _tell_of_two(path: Path, shipped: Path) -> None:
    """Once: a name means the user's own file although one of that name and another content comes
    with genie-sim.
    """
    if (
        shipped.is_file()
        and path.resolve() != shipped.resolve()
        and path.read_bytes() != shipped.read_bytes()
    ):
        log.warning("%s is used, not what comes with genie-sim under this name", path)


def available(kind: FileKind) -> dict[str, Path]:
    """Every name that ``find`` knows, and its file; the current folder's come before the shipped
    ones.
    """
    found: dict[str, Path] = {}
    for root in (Path(), _shipped()):
        for path in sorted((root / kind.folder).glob(f"*{kind.suffix}")):
            name = path.name.removesuffix(kind.suffix)
            if "." not in name:  # NAME.truth.parquet belongs to a trace
                found.setdefault(name, path)
    return dict(sorted(found.items()))


@functools.cache
def _shipped() -> Path:
    """The data folder of an installed package, else the root of the checkout."""
    shipped = PACKAGE_FOLDER / "shipped"
    return shipped if shipped.is_dir() else PACKAGE_FOLDER.parent
