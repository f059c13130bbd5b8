"""Result folders that are written atomically, and what is made of the results in them."""

import hashlib
import logging
import os
import re
import secrets
import shutil
import tempfile
from collections.abc import Callable, Collection, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

from genie_sim.base.errors import UserError, first_line
from genie_sim.base.paths import (
    PARTIAL,
    atomic_write,
    locked,
    read_bytes,
    sync_file,
    sync_folder,
    uninterrupted,
    usable,
)
from genie_sim.base.text import one_line
from genie_sim.record.provenance import contained, read_json

log = logging.getLogger(__name__)
EARLIER = ".earlier"  # the name of a result while another takes its place
_LEFTOVER = re.compile(
    rf"\.(?P<name>.+)\.[0-9a-f]{{8}}{re.escape(PARTIAL)}(?P<earlier>{re.escape(EARLIER)})?"
)
_SIGNED = re.compile(rb"(.*)\n<!-- as genie-sim wrote it: ([0-9a-f]{16}) -->\n", re.DOTALL)


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
            if name.as_posix() in stale or os.path.lexists(folder / name):
                continue
            if _LEFTOVER.fullmatch(path.name):
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
