"""Paths as users write them, and files that are complete or not there at all."""

import os
import secrets
import stat
import sys
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path

from genie_sim.errors import UserError, as_user_error

PARTIAL = ".partial"


def expanded(path: str | Path) -> Path:
    """``~/results`` to a folder of the user, where the shell has not done it, as in ``--out=~/results``."""
    try:
        return Path(path).expanduser()
    except RuntimeError:  # nobody's home: a name like any other
        return Path(path)


def usable(path: Path, what: str = "cannot be written") -> AbstractContextManager[None]:
    """Where the machine refuses what is done within it, that is a ``UserError``: the path, ``what``, and why."""
    return as_user_error(f"{path}: {what}", OSError)


def read_bytes(path: Path) -> bytes:
    """All bytes of a regular file. Raises UserError for anything else: a device or a pipe may have no end."""
    with as_user_error(f"{path}: cannot be read", OSError, ValueError):
        if not stat.S_ISREG(path.stat().st_mode):
            raise UserError(f"{path}: cannot be read: not a regular file")
        return path.read_bytes()


def read_text(path: Path) -> str:
    """The text of a regular file in UTF-8, lines ending in a newline. Raises UserError."""
    with as_user_error(f"{path}: not a text file", UnicodeDecodeError):
        text = read_bytes(path).decode("utf-8")
    return text.replace("\r\n", "\n").replace("\r", "\n")


@contextmanager
def atomic_write(path: Path) -> Iterator[Path]:
    """A temporary path in the folder of ``path``: the file written there replaces ``path`` when it is complete, and is
    deleted if that fails. Raises ``UserError``, before anything is written if ``path`` is a folder or a device."""
    with usable(path):
        if path.exists() and not path.is_file():
            raise UserError(
                f"{path}: cannot be written: {'a folder' if path.is_dir() else 'no file'} of that name"
            )
        beside = path.with_name(f".{path.name}.{secrets.token_hex(4)}{PARTIAL}")
        try:
            yield beside
            beside.replace(path)
        finally:
            with suppress(OSError):
                beside.unlink()


@contextmanager
def locked(folder: Path, wait: bool = True) -> Iterator[None]:
    """Holds the lock of a folder, which tells other processes, however this one ends, whether it is still there.

    Raises ``OSError`` where the folder is gone, or, without ``wait``, where another process holds the lock or the file
    system knows no locks. With it such a file system is no obstacle.
    """
    if sys.platform == "win32":
        if not wait:
            raise OSError("folders have no locks here")
        yield
        return
    import fcntl

    number = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        with suppress(*[OSError] * wait):  # a file system without locks
            fcntl.flock(number, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        if not os.path.samestat(os.fstat(number), folder.stat()):
            raise FileNotFoundError(folder)
        yield
    finally:
        os.close(number)
