"""Where a result comes from: its run id, its ``run.json``, and a folder that is there whole or not at all."""

import hashlib
import json
import os
import platform
import re
import secrets
import shutil
import subprocess
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from importlib import metadata
from pathlib import Path
from typing import Any

import genie_sim
from genie_sim.errors import UserError, as_user_error, short_repr
from genie_sim.paths import PARTIAL, locked, read_text, usable
from genie_sim.recording.tables import other_format

RESULT_FORMAT = 4
NEEDED: dict[
    str, tuple[type, str]
] = {  # of run.json, whatever is done with a result; others are told when they lack
    "run_id": (str, "text"),
    "facts.scenario": (dict, "a mapping"),
    "facts.scenario.name": (str, "text"),
    "facts.scenario.seed": (int, "a whole number"),
    "facts.devices": (dict, "a mapping"),
    "facts.traces": (dict, "a mapping"),
    "facts.methods": (list, "a list"),
}
EARLIER = ".earlier"  # the name of a result while another takes its place
_LEFT = re.compile(
    rf"\.(?P<name>.+)\.[0-9a-f]{{8}}{re.escape(PARTIAL)}(?P<earlier>{re.escape(EARLIER)})?"
)
PACKAGES = ("simpy", "numpy", "pandas", "pyarrow", "pydantic", "matplotlib")


def run_id(facts: Mapping[str, Any]) -> str:
    """12 hex digits of the hash of everything that decides a run's outcome."""
    text = json.dumps(facts, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def digests(folder: Path) -> dict[str, str]:
    """sha256 of each table of a result folder, by file name."""
    return {
        path.name: hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.glob("*.parquet"))
    }


def environment() -> dict[str, Any]:
    """What may differ between two runs of the same id: versions, machine, commit (``None`` outside a checkout)."""
    return {
        "genie_sim": genie_sim.__version__,
        "python": platform.python_version(),
        "platform": platform.platform(),
        "packages": {name: metadata.version(name) for name in PACKAGES},
        "commit": _commit(),
    }


def check_writable(out: Path) -> None:
    """Raises ``UserError`` unless ``out``, which need not exist, can hold result folders. Leaves nothing behind."""
    with usable(out, "no results can be written there"):
        existing = next(path for path in (out, *out.absolute().parents) if path.exists())
        tempfile.TemporaryFile(dir=existing).close()


def check_replaceable(final: Path) -> None:
    """Raises ``UserError`` unless a result folder can take the place of ``final``: nothing else is ever deleted."""
    with usable(final, "cannot be read"):
        free = not final.exists() or (
            final.is_dir() and ((final / "run.json").is_file() or not any(final.iterdir()))
        )
    if not free or not final.name:
        raise UserError(f"{final}: holds something else than a result; choose another --out")


@contextmanager
def result_folder(final: Path) -> Iterator[Path]:
    """A folder to fill, which takes the place of ``final`` once it is complete, and vanishes if that fails. What
    killed processes have left beside it is cleared away."""
    check_replaceable(final)
    partial = final.with_name(f".{final.name}.{secrets.token_hex(4)}{PARTIAL}")
    try:
        with usable(final), ExitStack() as held:
            final.parent.mkdir(parents=True, exist_ok=True)
            with locked(final.parent):  # nobody clears the new folder away before its lock is held
                _clear_away(final.parent)
                partial.mkdir()
                held.enter_context(locked(partial))
            yield partial
            _take_place(partial, final)
    finally:
        shutil.rmtree(partial, ignore_errors=True)


def _take_place(partial: Path, final: Path) -> None:
    """Renames ``partial`` to ``final``. An earlier ``final`` goes once that is done, and comes back if it fails."""
    if not final.exists():
        partial.rename(final)
        return
    earlier = partial.with_name(f"{partial.name}{EARLIER}")
    with locked(final):
        final.rename(earlier)
        try:
            partial.rename(final)
        except BaseException:
            earlier.rename(final)
            raise
        shutil.rmtree(earlier)


def _clear_away(folder: Path) -> None:
    """Removes folders of processes that were killed: nobody holds their locks. A result that one of them was about to
    replace comes back."""
    for left in folder.glob(f".*{PARTIAL}*"):
        found = _LEFT.fullmatch(left.name)
        with suppress(OSError), locked(left, wait=False):  # locked, or gone: somebody else's affair
            final = folder / found["name"] if found else left
            if found and found["earlier"] and not final.exists():
                left.rename(final)
            elif found:
                shutil.rmtree(left)


def write_json(path: Path, value: object) -> None:
    """JSON to read by eye and to compare by line."""
    path.write_text(
        json.dumps(value, indent=2, sort_keys=True, ensure_ascii=False) + "\n", encoding="utf-8"
    )


def read_json(path: Path) -> Any:
    """What a file of JSON holds. Raises ``UserError``."""
    with as_user_error(f"{path}: cannot be read", ValueError, RecursionError):
        return json.loads(read_text(path))


@contextmanager
def of_this_version(folder: Path | None) -> Iterator[None]:
    """While the results in a folder are put to use: what another version wrote there, or somebody changed since, may
    lack anything. Raises ``UserError`` then; without a folder the fault is not the results'."""
    try:
        yield
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
        if folder is None:
            raise
        raise UserError(
            f"{folder}: not the results of this version of genie-sim: {short_repr(error)}"
        ) from error


def read_run_json(folder: Path) -> dict[str, Any]:
    """The provenance of a result folder. Raises ``UserError`` for anything else."""
    path = folder / "run.json"
    if not path.exists():
        raise UserError(f"{folder}: not a result folder: it has no run.json")
    run = read_json(path)
    if not isinstance(run, dict) or run.get("format") != RESULT_FORMAT:
        found = run.get("format") if isinstance(run, dict) else None
        raise UserError(other_format(path, found, RESULT_FORMAT))
    for field, (kind, what) in NEEDED.items():
        value: Any = run
        for name in field.split("."):
            value = value.get(name) if isinstance(value, dict) else None
        if not isinstance(value, kind):
            raise UserError(f"{path}: {field}: missing, or not {what}")
    return run


def _commit() -> str | None:
    """The commit of a checkout, marked where files differ from it."""
    root = Path(genie_sim.__file__).parents[1]
    if not (root / ".git").exists():
        return None
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
