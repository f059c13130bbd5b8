"""The origin of a result: its run id, what its ``run.json`` tells, and whether its files are those
that were written.
"""

import functools
import hashlib
import json
import logging
import os
import platform
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from genie_sim.base.errors import UserError, as_user_error, short_repr
from genie_sim.base.paths import (
    read_text,
    sha256_of,
    usable,
)
from genie_sim.base.text import one_line
from genie_sim.version import PACKAGE_FOLDER, VERSION

log = logging.getLogger(__name__)
# Of every result folder, in run.json or sweep.json: one more when a table, a column, a field of
# ``MetricValue`` or a fact is another, or means something else. Every run id changes with it.
RESULT_FORMAT = 7
# Of run.json, required by every command; other fields are checked where they are used.
REQUIRED: dict[str, tuple[type, str]] = {
    "run_id": (str, "text"),
    "facts.scenario": (dict, "a mapping"),
    "facts.scenario.name": (str, "text"),
    "facts.scenario.seed": (int, "a whole number"),
    "facts.devices": (dict, "a mapping"),
    "facts.traces": (dict, "a mapping"),
    "facts.methods": (list, "a list"),
    "metrics": (dict, "a mapping"),
    "rows": (dict, "a mapping"),
}
METHOD = {"name": (str, "text"), "title": (str, "text"), "baseline": (bool, "true or false")}
COMMIT_FILE = "commit.txt"  # of an installed package, written by hatch_build.py
PACKAGES = ("simpy", "numpy", "pandas", "pyarrow", "matplotlib", "onnxruntime")


def run_id(facts: Mapping[str, Any]) -> str:
    """12 hex digits of the hash of everything that decides a run's outcome."""
    text = json.dumps(facts, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def digests(folder: Path, names: Iterable[str]) -> dict[str, str]:
    """sha256 of these files of a result folder, by name. Raises ``UserError`` for one that is not
    there.
    """
    found = {}
    for name in sorted(names):
        path = contained(folder, name)
        if not path.exists():
            raise UserError(f"{path}: no such file")
        found[name] = sha256_of(path)
    return found


def contained(folder: Path, name: str) -> Path:
    """The path of a file of a result folder. Raises ``UserError`` where a link leads out of the
    folder: its files may be anybody's, and nothing outside of it is read or written by its names.
    """
    path = folder / name
    with as_user_error(f"{path}: cannot be read", OSError, RuntimeError):
        inside = path.resolve().is_relative_to(folder.resolve())
    if not inside:
        raise UserError(f"{path}: a link out of the result folder, which is not followed")
    return path


def check_unchanged(folder: Path, about: Mapping[str, Any], names: Iterable[str]) -> None:
    """Raises ``UserError`` if one of these files of a result folder is not there, or not what its
    digest says, or if the facts of a run are not those that its id stands for. ``about`` is the
    folder's ``run.json`` or ``sweep.json``.
    """
    known = about.get("digests")
    expected = known if isinstance(known, dict) else {}
    changed = ["run.json"] if "facts" in about and not _is_of_its_id(about) else []
    changed += [name for name, sha in digests(folder, names).items() if expected.get(name) != sha]
    if changed:
        raise UserError(
            f"{folder}: changed since the results were written: {', '.join(changed)}; "
            "make them again"
        )


def environment() -> dict[str, Any]:
    """What may differ between two runs of the same id: versions, machine, commit (``None``
    where neither a checkout nor the installed package tells it).
    """
    return {
        "genie_sim": VERSION,
        "python": platform.python_version(),
        "platform": platform.platform(),
        "packages": dict(_packages()),
        "commit": _commit(),
    }


@functools.cache  # a sweep asks at every run
def _packages() -> Mapping[str, str]:
    """The versions of those that are installed."""
    from importlib import metadata

    versions = {}
    for name in PACKAGES:
        with suppress(metadata.PackageNotFoundError):
            versions[name] = metadata.version(name)
    return versions


def other_versions(about: Mapping[str, Any]) -> list[str]:
    """Versions that have changed since a result was made, a line each: ``pyarrow: 26.0.1
    when it was made, 15.0.0 now``.
    """
    packages = about.get("packages")
    before = {name: about.get(name) for name in ("genie_sim", "python")}
    before |= packages if isinstance(packages, Mapping) else {}
    now = {"genie_sim": VERSION, "python": platform.python_version(), **_packages()}
    return [
        one_line(f"{name}: {version or 'unknown'} when it was made, {now.get(name, 'none')} now")
        for name, version in before.items()
        if version != now.get(name)
    ]


def write_json(path: Path, value: object, *, sort_keys: bool = True) -> None:
    """JSON to read by eye and to compare by line. Raises ``UserError``."""
    text = json.dumps(value, indent=2, sort_keys=sort_keys, ensure_ascii=False)
    write_text(path, f"{text}\n")


def write_text(path: Path, text: str) -> None:
    """A text in a new folder, in UTF-8. Raises ``UserError``."""
    with usable(path):
        path.write_text(text, encoding="utf-8")


def read_json(path: Path) -> Any:
    """What a file of JSON holds. Raises ``UserError``."""
    with as_user_error(f"{path}: cannot be read", ValueError, RecursionError):
        return json.loads(read_text(path))


def read_mapping(path: Path) -> dict[str, Any]:
    """A file of JSON that holds a mapping. Raises ``UserError``."""
    content = read_json(path)
    if not isinstance(content, dict):
        raise UserError(f"{path}: must hold a mapping, not {short_repr(content)}")
    return content


def check_format(path: Path, about: Mapping[str, Any]) -> None:
    """Raises ``UserError`` unless what a result says of itself in this file is of the format that
    this version writes.
    """
    version = about.get("format")
    if version == RESULT_FORMAT:
        return
    if isinstance(version, int) and version < RESULT_FORMAT:
        raise UserError(
            f"{path}: made by an older genie-sim: format {version}, this one reads "
            f"{RESULT_FORMAT}; run it again"
        )
    told = "says no format" if version is None else f"format {short_repr(version)}"
    raise UserError(f"{path}: {told}, this genie-sim reads {RESULT_FORMAT}")


@contextmanager
def of_this_version(folder: Path | None) -> Iterator[None]:
    """While the results in a folder are put to use: what another version wrote there, or somebody
    changed since, may lack anything. Raises ``UserError`` then, which does not hide a fault of the
    program's own; without a folder the fault is not the results'.
    """
    try:
        yield
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
        if folder is None:
            raise
        raise UserError(
            f"{folder}: not written by this version of genie-sim, or that has a fault: "
            f"{short_repr(error)}; genie-sim --debug shows where"
        ) from error


def read_run_json(folder: Path) -> dict[str, Any]:
    """The provenance of a result folder. Raises ``UserError`` for anything else."""
    path = contained(folder, "run.json")
    if not path.exists():
        inner = [*folder.glob("*/run.json"), *folder.glob("runs/*/run.json")]
        hint = f"; {min(inner).parent} is one" if inner else ""
        why = f"it has no run.json{hint}" if os.path.lexists(folder) else "it does not exist"
        raise UserError(f"{folder}: not a result folder: {why}")
    run = read_mapping(path)
    check_format(path, run)
    for field, (kind, what) in REQUIRED.items():
        value: Any = run
        for name in field.split("."):
            value = value.get(name) if isinstance(value, dict) else None
        if type(value) is not kind:
            raise UserError(f"{path}: {field}: missing, or not {what}")
    where, names = f"{path}: facts.methods", set()
    for place, method in enumerate(run["facts"]["methods"]):
        if not isinstance(method, dict) or method.keys() != METHOD.keys():
            raise UserError(f"{where}[{place}]: must be a mapping of {', '.join(METHOD)}")
        for name, (kind, what) in METHOD.items():
            if type(method[name]) is not kind:
                raise UserError(f"{where}[{place}].{name}: must be {what}")
        names.add(method["name"])
    if not names or len(names) < len(run["facts"]["methods"]):
        raise UserError(f"{where}: none, or several of one name")
    return run


def _is_of_its_id(run: Mapping[str, Any]) -> bool:
    """Whether the facts in a ``run.json`` are those that its run id stands for."""
    try:
        return run_id(run["facts"]) == str(run["run_id"])
    except (TypeError, ValueError):  # numbers or keys that no run has
        return False


def _commit() -> str | None:
    """The commit of a checkout, marked where files differ from it, or the one that an installed
    package was built from.
    """
    root = PACKAGE_FOLDER.parent
    if not (root / ".git").exists():
        path = PACKAGE_FOLDER / "shipped" / COMMIT_FILE
        return path.read_text(encoding="utf-8").strip() if path.is_file() else None
    import subprocess

    try:
        git = [
            "git",
            "-C",
            os.fspath(root),
            "describe",
            "--always",
            "--abbrev=12",
            "--dirty",
            "--exclude=*",
        ]
        return subprocess.run(
            git, capture_output=True, text=True, timeout=10, check=True
        ).stdout.strip()
    except (OSError, subprocess.SubprocessError):
        return None
