"""Paths as users write them, and files that are complete or not there at all."""

import functools
import os
import re
import signal
import stat
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from io import BufferedReader
from pathlib import Path
from typing import NamedTuple, TypeVar

from genie_sim.base.add_ons import INSTALL_ROS
from genie_sim.base.errors import UserError, as_user_error

PARTIAL = ".partial"
BAGS = (".bag", ".mcap", ".db3")  # files of ROS; a ROS 2 bag is a folder with a metadata.yaml
REMEMBERED_FILES = 16  # of each kind
MARKED_BYTES = 1024  # within which a file tells its kind
MAX_TEXT_BYTES = 2**26  # of a text or JSON, which is read as a whole
Content = TypeVar("Content")


class OutputKind(NamedTuple):
    """A kind of file that users ask for by its path: what it is, and how each such file begins, as
    a regular expression. Of a kind without one people edit the files: none is ever replaced.
    """

    what: str
    begin: bytes = b""

    def check(self, path: Path) -> None:
        """Raises ``UserError`` where a file of this kind may not be written: what is there already,
        such as an input, is replaced by its own kind alone, or if it is empty or a link.
        """
        if not self.begin and os.path.lexists(path):
            raise UserError(f"{path}: is there already; say where else")
        if path.is_file() and not path.is_symlink() and path.stat().st_size:
            with regular(path) as file:
                begin = file.read(MARKED_BYTES)
            if not re.match(self.begin, begin, re.DOTALL):
                raise UserError(f"{path}: is there already, and is no {self.what}; say where else")


def expanded(path: str | Path) -> Path:
    """``~/results`` to a folder of the user, where the shell has not done it, as in
    ``--out=~/results``.
    """
    try:
        return Path(path).expanduser()
    except RuntimeError:  # no such user: the path stays as it is
        return Path(path)


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Ctrl-C and SIGTERM wait until it is over: it puts right what is half done."""
    # no other thread may say what signals do
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    caught: list[int] = []
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    heard = {number: handler for number, handler in before.items() if callable(handler)}
    for number in heard:
        signal.signal(number, lambda number, _: caught.append(number))
    try:
        yield
    finally:
        for number, handler in heard.items():
            signal.signal(number, handler)
        for asked in caught[:1]:
            signal.raise_signal(asked)


@contextmanager
def working_folder_kept() -> Iterator[None]:
    """The working folder is the same after it as before, wherever code of the user's own goes."""
    try:
        folder = Path.cwd()
    except OSError:  # it is gone
        yield
        return
    try:
        yield
    finally:
        with suppress(OSError):
            os.chdir(folder)


def usable(path: Path, what: str = "cannot be written") -> AbstractContextManager[None]:
    """Where the machine refuses what is done within it, that is a ``UserError``: the path,
    ``what``, and why.
    """
    return as_user_error(f"{path}: {what}", OSError)


def read_bytes(path: Path) -> bytes:
    """All bytes of a regular file. Raises UserError for anything else: a device or a pipe may have
    no end.
    """
    with regular(path) as file:
        return file.read()


def sha256_of(path: Path) -> str:
    """The sha256 of a regular file, in hex. Raises ``UserError``."""
    import hashlib

    with regular(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def check_is_file(path: Path, where: str = "", more: str = "") -> None:
    """Raises ``UserError`` unless a path, which users wrote as ``where``, is that of a file: what
    there is instead, and ``more``.
    """
    where = where or str(path)
    with as_user_error(where, OSError):  # a name longer than the file system allows
        if path.exists() and (path.suffix in BAGS or (path / "metadata.yaml").is_file()):
            told = "is a ROS bag, which 'genie-sim import bag' of the add-on reads"
            raise UserError(f"{where}: {told}: {INSTALL_ROS}")
        if not path.is_file():
            what = "is a folder, not a file" if path.is_dir() else "is a device or a pipe"
            raise UserError(f"{where}: {what if path.exists() else 'no such file'}{more}")


@contextmanager
def regular(path: Path) -> Iterator[BufferedReader]:
    """A regular file, open. Raises UserError for anything else, and for what fails within it."""
    with as_user_error(f"{path}: cannot be read", OSError, ValueError):
        if not stat.S_ISREG(path.stat().st_mode):
            raise UserError(f"{path}: cannot be read: not a regular file")
        with path.open("rb") as file:
            yield file


def remembered(read: Callable[[Path], Content]) -> Callable[[str | Path], Content]:
    """A reader that does not read a file again that is as it was. What it returns must be
    immutable.
    """

    @functools.lru_cache(REMEMBERED_FILES)
    def content(path: Path, state: tuple[int, ...]) -> Content:
        return read(path)

    @functools.wraps(read)
    def reader(path: str | Path) -> Content:
        path = Path(path)
        try:
            about = path.stat()
        except (OSError, ValueError):
            return read(path)  # which says what is wrong
        return content(path, (about.st_dev, about.st_ino, about.st_size, about.st_mtime_ns))

    return reader


def read_text(path: Path, limit_bytes: int = MAX_TEXT_BYTES) -> str:
    """The text of a regular file in UTF-8, with or without its mark, lines ending in a newline.
    Raises UserError, also for a file of more bytes than the limit.
    """
    with usable(path, "cannot be read"):
        size_bytes = path.stat().st_size
    if size_bytes > limit_bytes:
        raise UserError(f"{path}: cannot be read: {size_bytes:,} bytes, more than {limit_bytes:,}")
    data = read_bytes(path)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise UserError(f"{path}: line {line}: is not UTF-8 text") from error
    return text.replace("\r\n", "\n").replace("\r", "\n")


@contextmanager
def atomic_write(path: Path, kind: OutputKind | None = None) -> Iterator[Path]:
    """A temporary path in the folder of ``path``: the file written there replaces ``path`` when it
    is complete and on the disk, and is deleted if that fails. Raises ``UserError``, before anything
    is written if ``path`` is a folder or a device, or if this ``kind`` of file may not replace it.
    """
    with usable(path):
        if path.exists() and not path.is_file():
            raise UserError(
                f"{path}: cannot be written: {'a folder' if path.is_dir() else 'no file'} of that"
                " name"
            )
        if kind is not None:
            kind.check(path)
        beside = path.with_name(f".{path.name}.{os.urandom(4).hex()}{PARTIAL}")
        try:
            yield beside
            replace_durably(beside, path)
        finally:
            with suppress(OSError):
                beside.unlink()


def replace_durably(source: Path, target: Path) -> None:
    """Renames a complete file to ``target``: after a power failure there is the old or the new
    file.

    The bytes reach the disk before the name does; file systems may reorder the two otherwise.
    """
    sync_file(source)
    source.replace(target)
    sync_folder(target.parent)


def sync_file(path: Path) -> None:
    """Returns once the bytes of a file are on the disk."""
    with path.open("r+b") as file:
        os.fsync(file.fileno())


def sync_folder(folder: Path) -> None:
    """Returns once the names in a folder are on the disk, where the system can do that."""
    if sys.platform == "win32":  # a folder cannot be opened there
        return
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        with suppress(OSError):  # some network file systems refuse
            os.fsync(descriptor)
    finally:
        os.close(descriptor)


@contextmanager
def locked(folder: Path, wait: bool = True) -> Iterator[None]:
    """Holds the lock of a folder, which tells other processes, however this one ends, whether it is
    still there.

    Raises ``OSError`` where the folder is gone, or, without ``wait``, where another process holds
    the lock or the file system knows no locks. With it such a file system is no obstacle.
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
