"""Runs broken input through the program, in this process: it works, one clear line says why not, or
it is a bug.
"""

from __future__ import annotations

import random
import resource
import signal
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

from genie_sim.base.errors import UserError

SEED = 20_240_901
PATIENCE_S = 20.0
MAX_BYTES = 2 * 2**30  # of memory, at any moment of a case
MAX_ADDRESSES = 8 * 2**30  # what asks for more than this is told that there is none
LONGEST_LINE = 12_000  # it may quote two words of 5,000 letters that somebody has typed

Case = Callable[[random.Random], object]


class Hang(BaseException):
    """No exception of the program's: nothing there may catch it."""


@dataclass(frozen=True)
class Target:
    """Something that reads. ``prepare`` gets a folder of its own and returns what does one case
    with a generator.

    A case may return anything, or raise a ``UserError`` (or one of ``errors``, as the function that
    is called says of itself). ``share`` are its cases of 2,000.
    """

    name: str
    share: int
    prepare: Callable[[Path], Case]
    errors: tuple[type[Exception], ...] = (UserError,)


@dataclass
class Tally:
    """What became of a target's cases; ``bugs`` are their numbers with what went wrong."""

    cases: int = 0
    worked: int = 0
    refused: int = 0
    tracebacks: int = 0
    hangs: int = 0
    large: int = 0
    peak_bytes: int = 0
    bugs: list[str] = field(default_factory=list)


def run(
    target: Target, folder: Path, numbers: range, seed: int = SEED, most_bugs: int = 20
) -> Tally:
    """Does these cases of a target. Each has a generator of its own, so that it can be done again
    alone.
    """
    tally = Tally()
    case = target.prepare(folder)
    limit = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (MAX_ADDRESSES, limit[1]))
    try:
        _run(target, case, numbers, seed, tally, most_bugs)
    finally:
        resource.setrlimit(resource.RLIMIT_AS, limit)
    return tally


def _run(
    target: Target, case: Case, numbers: range, seed: int, tally: Tally, most_bugs: int
) -> None:
    for number in numbers:
        tally.cases += 1
        _forget_peak()
        try:
            with _patience(PATIENCE_S):
                case(random.Random(f"{seed} {target.name} {number}"))
            tally.worked += 1
        except target.errors as error:
            if "\n" in str(error) or len(str(error)) > LONGEST_LINE:
                tally.tracebacks += 1
                tally.bugs.append(f"{target.name} {number}: no clear line: {str(error)[:300]!r}")
            tally.refused += 1
        except Hang:
            tally.hangs += 1
            tally.bugs.append(
                f"{target.name} {number}: longer than {PATIENCE_S:.0f} s\n{traceback.format_exc()}"
            )
        except Exception:
            tally.tracebacks += 1
            tally.bugs.append(f"{target.name} {number}:\n{traceback.format_exc()}")
        peak_bytes = _peak_bytes()
        tally.peak_bytes = max(tally.peak_bytes, peak_bytes)
        if peak_bytes > MAX_BYTES:
            tally.large += 1
            tally.bugs.append(f"{target.name} {number}: took {peak_bytes / 2**20:,.0f} MB")
        if len(tally.bugs) >= most_bugs:
            break


def table(tallies: dict[str, Tally]) -> str:
    """What came out, as a table in Markdown."""
    lines = [
        "| input | cases | worked | one clear line | tracebacks | hangs | above 2 GB | peak [MB] |",
        "|---|---:|---:|---:|---:|---:|---:|---:|",
    ]
    total = Tally()
    for tally in tallies.values():
        for name in ("cases", "worked", "refused", "tracebacks", "hangs", "large"):
            setattr(total, name, getattr(total, name) + getattr(tally, name))
        total.peak_bytes = max(total.peak_bytes, tally.peak_bytes)
    for name, tally in {**tallies, "all": total}.items():
        numbers = (tally.cases, tally.worked, tally.refused, tally.tracebacks, tally.hangs)
        numbers += (tally.large, tally.peak_bytes // 2**20)
        lines.append(f"| {name} | " + " | ".join(f"{number:,}" for number in numbers) + " |")
    return "\n".join(lines)


def _forget_peak() -> None:
    """Has Linux measure the most memory of this process anew."""
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")


def _peak_bytes() -> int:
    """The most memory that this process had since; 0 where that cannot be known."""
    with suppress(OSError):
        for line in Path("/proc/self/status").read_text().splitlines():
            if line.startswith("VmHWM:"):
                return 1024 * int(line.split()[1])
    return 0


@contextmanager
def _patience(seconds: float) -> Iterator[None]:
    def give_up(*_: object) -> None:
        raise Hang

    before = signal.signal(signal.SIGALRM, give_up)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
