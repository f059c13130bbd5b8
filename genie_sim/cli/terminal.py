"""What the command line shows besides results: lists, progress.

Everything fits the terminal's width and needs no colour.
"""

import os
import shutil
import signal
import sys
import textwrap
import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from genie_sim.base import add_ons
from genie_sim.base.docstrings import docstring
from genie_sim.base.errors import unknown
from genie_sim.base.plugins import own_faults_told

if TYPE_CHECKING:
    from genie_sim.base.import_report import ImportReport

PROGRESS_VARIABLE = "GENIE_SIM_PROGRESS"  # of the environment; "off": neither bar nor lines
SHOW_EVERY_S = 0.2  # at least, between two states of progress on a terminal
LINE_EVERY_S = 10  # and between its lines where there is none


def width() -> int:
    """Columns of the terminal; 100 where there is none."""
    return shutil.get_terminal_size((100, 24)).columns


def listing(rows: Iterable[tuple[str, str]], columns: int | None) -> Iterator[str]:
    """A line for each name with what it is; wrapped to ``columns``, ``None`` for a line each, for
    other programs.
    """
    for name, about in rows:
        line = f"{name:28} {about}".rstrip()
        if columns is None or len(line) <= columns:
            yield line
        else:
            yield from textwrap.wrap(line, columns, subsequent_indent="    ")


class Commands(click.Group):
    """The commands, under one roof: a misspelt one is answered with the nearest; Ctrl-C or SIGTERM
    ends any with one line and status 130, and a reader that has gone away ends it quietly.
    """

    add_on_group = ""  # the group of entry points through which packages add commands

    def add_command(self, cmd: click.Command, name: str | None = None) -> None:
        """One of them."""
        super().add_command(_with_help(cmd), name)

    def list_commands(self, ctx: Any) -> list[str]:
        """In the order in which they are written."""
        return list(self.commands)

    def get_command(self, ctx: Any, cmd_name: str) -> click.Command | None:
        own = super().get_command(ctx, cmd_name)
        if own is not None or not self.add_on_group or ctx.resilient_parsing:
            return own
        command: click.Command | None = add_ons.offered(self.add_on_group, cmd_name)
        return command and _with_help(command)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        name = args[0]
        if self.get_command(ctx, name) is None and not name.startswith("-"):
            ctx.fail(unknown("command", name, self.list_commands(ctx)))
        return super().resolve_command(ctx, args)

    def invoke(self, ctx: Any) -> Any:
        try:
            with _terminable(), own_faults_told():
                return super().invoke(ctx)
        except KeyboardInterrupt as stop:
            click.echo(f"genie-sim: interrupted; {str(stop) or 'nothing was written'}", err=True)
            raise SystemExit(130) from None
        except BrokenPipeError:
            drop_output()
            raise SystemExit(0) from None


def _with_help(command: click.Command) -> click.Command:
    """A command with its help under ``python -OO``, too."""
    command.help = command.help or docstring(command.callback)
    return command


@contextmanager
def resumable(folder: Path) -> Iterator[None]:
    """Ctrl-C says where finished runs are kept."""
    try:
        yield
    except KeyboardInterrupt as stop:
        text = str(stop) or f"finished runs are kept in {folder}"
        raise KeyboardInterrupt(text) from None


@contextmanager
def _terminable() -> Iterator[None]:
    """SIGTERM, which batch systems send when the time is up, is taken for Ctrl-C: what is half done
    is cleared away.
    """
    # no other may say what signals do
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before or signal.SIG_DFL)


def open_closed_streams() -> None:
    """Where the shell has closed one, as with ``>&-``, what is printed goes nowhere."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, Path(os.devnull).open("w"))  # noqa: SIM115 - as long as the program runs


def drop_output() -> None:
    """Lets go of what cannot be printed any more, or Python would try again at its end, and
    complain.
    """
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def machine_said(error: OSError | MemoryError) -> str:
    """Why the machine would not go on, in one line; with the file if it is known."""
    if isinstance(error, MemoryError):
        return "not enough memory"
    where = "" if error.filename is None else f"{os.fsdecode(error.filename)}: "
    return f"{where}{error.strerror or error}"


def tell(report: "ImportReport") -> None:
    """Prints the report of an import below what it belongs to."""
    for line in report.lines():
        click.echo(f"  {line}")


class ProgressBar:
    """How far a command is, on stderr: on a terminal one line that is written over, elsewhere a
    line with each tenth that is done, but none within ``LINE_EVERY_S`` of the last; nothing where
    the environment has ``GENIE_SIM_PROGRESS=off``. Called with how much is done, how much there is,
    and what is going on; ``unit`` says of what.
    """

    def __init__(self, unit: str) -> None:
        self._unit = unit
        self._tenths, self._told_s = 0, time.monotonic()
        self._on_terminal = sys.stderr.isatty()
        self._is_on = os.environ.get(PROGRESS_VARIABLE) != "off"

    def __enter__(self) -> "ProgressBar":
        return self

    def __call__(self, done: float, total: float, what: str = "") -> None:
        number = ",.1f" if isinstance(total, float) else ","
        text = f"{done:{number}} of {total:{number}} {self._unit}".strip()
        text = f"{text}, {what}" if what else text
        tenths = int(10 * done / total) if total else 0
        passed_s = time.monotonic() - self._told_s
        if self._on_terminal and passed_s >= SHOW_EVERY_S:
            self._write(f"\r{text[: width() - 1]:{width() - 1}}")
        elif not self._on_terminal and passed_s >= LINE_EVERY_S and self._tenths < tenths < 10:
            self._tenths = tenths
            self._write(f"genie-sim: {text}\n")

    def __exit__(self, *_: object) -> None:
        if self._on_terminal:
            self._write(f"\r{' ' * (width() - 1)}\r")

    def _write(self, text: str) -> None:
        self._told_s = time.monotonic()
        try:
            if self._is_on:
                click.echo(text, nl=False, err=True)
        except (OSError, ValueError):  # nobody reads them any more
            self._is_on = False
