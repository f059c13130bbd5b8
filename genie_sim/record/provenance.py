"""The origin of a result (run id and ``run.json``), and result folders that are written
atomically.
"""

import functools
import hashlib
import json
import logging
import os
import platform
import re
import secrets
import shutil
import tempfile
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

from genie_sim.base.errors import UserError, as_user_error, first_line, short_repr
from genie_sim.base.paths import (
    PARTIAL,
    atomic_write,
    locked,
    read_bytes,
    read_text,
    sha256_of,
    sync_file,
    sync_folder,
    uninterrupted,
    usable,
)
from genie_sim.base.text import one_line
from genie_sim.record.tables import other_format
from genie_sim.version import PACKAGE_FOLDER, VERSION

log = logging.getLogger(__name__)
RESULT_FORMAT = 6
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
EARLIER = ".earlier"  # the name of a result while another takes its place
_LEFTOVER = re.compile(
    rf"\.(?P<name>.+)\.[0-9a-f]{{8}}{re.escape(PARTIAL)}(?P<earlier>{re.escape(EARLIER)})?"
)
_SIGNED = re.compile(rb"(.*)\n<!-- as genie-sim wrote it: ([0-9a-f]{16}) -->\n", re.DOTALL)
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


def check_writable(out: Path) -> None:
    """Raises ``UserError`` unless ``out``, which need not exist, can hold result folders. Leaves
    nothing behind.
    """
    with usable(out, "no results can be written there (--out says where else)"):
        existing = next(path for path in (out, *out.absolute().parents) if path.exists())
        tempfile.TemporaryFile(dir=existing).close()


def check_replaceable(final: Path) -> None:
    """Raises ``UserError`` unless a result folder can take the place of ``final``: nothing else is
    ever deleted.
    """
    with usable(final, "cannot be read"):
        is_replaceable = not final.exists() or (
            final.is_dir() and ((final / "run.json").is_file() or not any(final.iterdir()))
        )
    if not is_replaceable or not final.name:
        raise UserError(
            f"{final}: contains files that are not a genie-sim result; choose another --out"
        )


Attempt = Callable[[str], AbstractContextManager[None]]


class NotDerivedError(UserError):
    """Results are kept, but not all that is made of them could be made."""


@contextmanager
def derived(folder: Path) -> Iterator[Attempt]:
    """What is made of the results in a folder, which are kept whatever becomes of it: each thing is
    made within a ``with`` of its own, which says its name.

    Raises ``NotDerivedError`` at the end if one could not be made, whatever a library raised; a
    line has told why. Ctrl-C says what is kept.
    """
    missing = []

    @contextmanager
    def attempt(name: str) -> Iterator[None]:
        try:
            yield
        except Exception as error:
            is_told = isinstance(error, UserError)
            why = str(error) if is_told else f"{name}: {type(error).__name__}: {first_line(error)}"
            log.error("%s", one_line(why.removeprefix(f"{folder}{os.sep}")))
            missing.append(name)
        except KeyboardInterrupt:
            raise KeyboardInterrupt(f"the results are kept in {folder}, without {name}") from None

    yield attempt
    if missing:
        raise NotDerivedError(f"{folder}: the results are kept, but without {', '.join(missing)}")


@contextmanager
def result_folder(final: Path, shown: Collection[str] = ()) -> Iterator[Path]:
    """A folder to fill, which takes the place of ``final`` once it is complete and on the disk, and
    vanishes if that fails. What killed processes have left beside it is cleared away.

    Of an earlier result in that place the files that it had written go, and, unless the new one has
    its label and its bytes, those whose names are ``shown``, which were made of them; all others
    are somebody's and stay.
    """
    check_replaceable(final)
    # absolute: code of the user's own may change the current folder meanwhile
    place = final.absolute()
    partial = place.with_name(f".{final.name}.{secrets.token_hex(4)}{PARTIAL}")
    is_kept = False
    try:
        with ExitStack() as locks:
            with usable(final):
                final.parent.mkdir(parents=True, exist_ok=True)
                with locked(final.parent):  # nobody clears it away before its lock is held
                    clear_away(final.parent)
                    partial.mkdir()
                    locks.enter_context(locked(partial))
            yield partial
            with usable(final):
                _take_over(place, partial, shown)
                _sync(partial)
                with uninterrupted():
                    _take_place(partial, place)
                    is_kept = True
                    sync_folder(place.parent)
    except UserError as error:
        if str(partial) not in str(error):
            raise
        raise UserError(str(error).replace(str(partial), str(final))) from error
    except KeyboardInterrupt:
        if is_kept:
            raise KeyboardInterrupt(f"the results are kept in {final}") from None
        raise
    finally:
        with uninterrupted():
            shutil.rmtree(partial, ignore_errors=True)


def _take_over(earlier: Path, folder: Path, shown: Collection[str]) -> None:
    """Files of an earlier result that are not its own come into the folder, too."""
    if earlier.is_symlink() or not earlier.is_dir():
        return
    for summary in shown:
        keep_edited(earlier / summary)
    before, now = _about(earlier), _about(folder)
    keys = ("run_id", "label", "digests")
    is_same = bool(now) and all(before.get(key) == now.get(key) for key in keys)
    stale = {*before.get("digests", ()), "run.json", *(() if is_same else shown)}
    for where, folders, files in os.walk(earlier):
        for path in (Path(where, name) for name in (*folders, *files)):
            name = path.relative_to(earlier)
            is_file = path.is_file() and not path.is_symlink()
            if name.as_posix() in stale or os.path.lexists(folder / name) or PARTIAL in path.name:
                continue
            if path.is_symlink():
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                (folder / name).symlink_to(path.readlink())
            elif is_file:
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                try:
                    os.link(path, folder / name)
                except OSError:  # a file system without links
                    shutil.copy2(path, folder / name)


def _about(folder: Path) -> dict[str, Any]:
    """What a result says of itself; nothing where it cannot be read."""
    with suppress(UserError):
        about = read_json(contained(folder, "run.json"))
        if isinstance(about, dict) and isinstance(about.get("digests"), dict):
            return about
    return {}


def _sync(folder: Path) -> None:
    """Returns once every file in a folder is on the disk."""
    for path in folder.rglob("*"):
        if path.is_dir():
            sync_folder(path)
        elif path.is_file():
            sync_file(path)
    sync_folder(folder)


def _take_place(partial: Path, final: Path) -> None:
    """Renames ``partial`` to ``final``. An earlier ``final`` goes once that is done, and comes back
    if it fails.
    """
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
        if earlier.is_symlink():
            earlier.unlink()
        else:
            shutil.rmtree(earlier)


def clear_away(folder: Path) -> None:
    """Removes folders of processes that were killed: nobody holds their locks. A result that one of
    them was about to replace comes back.
    """
    for leftover in folder.glob(f".*{PARTIAL}*"):
        name = _LEFTOVER.fullmatch(leftover.name)
        if name is None:
            continue
        final = folder / name["name"]
        with suppress(OSError), locked(leftover, wait=False):  # another process may still use it
            if name["earlier"] and not final.exists():
                leftover.rename(final)
            else:
                shutil.rmtree(leftover)


def write_json(path: Path, value: object, *, sort_keys: bool = True) -> None:
    """JSON to read by eye and to compare by line. Raises ``UserError``."""
    text = json.dumps(value, indent=2, sort_keys=sort_keys, ensure_ascii=False)
    write_text(path, f"{text}\n")


def write_text(path: Path, text: str) -> None:
    """A text in a new folder, in UTF-8. Raises ``UserError``."""
    with usable(path):
        path.write_text(text, encoding="utf-8")


def write_summary(path: Path, text: str) -> None:
    """Writes a text that people may edit, with its digest in the last line. Raises
    ``UserError``.
    """
    keep_edited(path)
    signature = hashlib.sha256(text.encode()).hexdigest()[:16]
    with atomic_write(path) as beside:
        beside.write_text(
            f"{text}\n<!-- as genie-sim wrote it: {signature} -->\n", encoding="utf-8"
        )


def keep_edited(path: Path) -> None:
    """Gives a summary that was edited since it was written another name, before it is replaced or
    removed, and says so. Raises ``UserError``.
    """
    if path.is_symlink() or not path.is_file() or path.suffix != ".md":
        return
    try:
        content = read_bytes(path)
    except UserError:
        if path.exists():
            raise
        return  # another process has removed it
    signed = _SIGNED.fullmatch(content)
    if signed is None or hashlib.sha256(signed[1]).hexdigest()[:16] != signed[2].decode():
        digest = hashlib.sha256(content).hexdigest()[:8]
        kept = path.with_name(f"{path.stem}.edited-{digest}{path.suffix}")
        with usable(path, "was edited, and cannot be renamed"), suppress(FileNotFoundError):
            path.replace(kept)
        log.warning("%s: was edited; that is kept as %s", path, kept.name)


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


@contextmanager
def of_this_version(folder: Path | None) -> Iterator[None]:
    """While the results in a folder are put to use: what another version wrote there, or somebody
    changed since, may lack anything. Raises ``UserError`` then; without a folder the fault is not
    the results'.
    """
    try:
        yield
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
        if folder is None:
            raise
        raise UserError(
            f"{folder}: not written by this version of genie-sim: {short_repr(error)}"
        ) from error


def read_run_json(folder: Path) -> dict[str, Any]:
    """The provenance of a result folder. Raises ``UserError`` for anything else."""
    path = contained(folder, "run.json")
    if not path.exists():
        runs = "; a run is a folder in its runs/" if (folder / "runs").is_dir() else ""
        raise UserError(f"{folder}: not a result folder: it has no run.json{runs}")
    run = read_mapping(path)
    if run.get("format") != RESULT_FORMAT:
        raise UserError(other_format(path, run.get("format"), RESULT_FORMAT))
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
