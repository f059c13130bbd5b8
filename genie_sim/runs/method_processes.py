"""The methods of one run side by side, each in a process of its own.

Methods share nothing but the scenario and its random streams, so the tables are those of the
methods one after the other, to the byte.
"""

import json
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from genie_sim.base.parallel import in_processes
from genie_sim.base.paths import atomic_write
from genie_sim.base.progress import Progress
from genie_sim.record.records import SCHEMAS, Tables, new_tables
from genie_sim.record.tables import read

PROGRESS_EVERY_S = 0.5
# Adds the rows of the method with a number to empty tables.
Simulate = Callable[[int, Tables, Progress], None]


@dataclass(frozen=True)
class MethodJob:
    """The ``number``-th method of a scenario, and the folder that gets its tables."""

    number: int
    folder: Path

    @property
    def progress(self) -> Path:
        """The file that says how far it is."""
        return self.folder / "progress.json"


def side_by_side(
    simulate: Simulate,
    methods: int,
    workers: int,
    progress: Progress | None = None,
    spill: Path | None = None,
) -> Tables:
    """The tables of so many methods, in their order, simulated in so many processes.

    ``simulate`` is pickled. ``progress`` is called by another thread. With ``spill``, a folder, the
    rows of long tables wait there. Raises what ``simulate`` raises, and ``UserError`` where a
    process was killed.
    """
    tables = new_tables(spill)
    with tempfile.TemporaryDirectory(dir=spill) as scratch:
        jobs = [MethodJob(number, Path(scratch) / str(number)) for number in range(methods)]
        for job in jobs:
            job.folder.mkdir()
        with watched(jobs, progress):
            for job in in_processes(partial(_write_tables, simulate), jobs, workers):
                for name, table in tables.items():
                    path = job.folder / f"{name}.parquet"
                    table.extend_columns(read(path, SCHEMAS[name], trusted=True))
                    path.unlink()
    return tables


def _write_tables(simulate: Simulate, job: MethodJob) -> MethodJob:
    """Simulates one method and writes its tables."""
    tables = new_tables(job.folder)
    simulate(job.number, tables, Reporter(job))
    for name, table in tables.items():
        table.write(job.folder / f"{name}.parquet")
    return job


class Reporter:
    """Writes how far a method is, now and then, for the process that waits."""

    def __init__(self, job: MethodJob) -> None:
        self._job = job
        self._next_s = 0.0

    def __call__(self, now_s: float, end_s: float, text: str) -> None:
        if now_s < end_s and time.monotonic() < self._next_s:
            return
        self._next_s = time.monotonic() + PROGRESS_EVERY_S
        with atomic_write(self._job.progress) as beside:
            beside.write_text(json.dumps([now_s, end_s, text]), encoding="utf-8")


@contextmanager
def watched(jobs: Sequence[MethodJob], progress: Progress | None) -> Iterator[None]:
    """Tells how far the jobs are together while they run, and once more at the end."""
    if progress is None:
        yield
        return
    end = threading.Event()

    def watch() -> None:
        is_over = False
        while not is_over:
            is_over = end.wait(PROGRESS_EVERY_S)
            begun = [
                json.loads(job.progress.read_text(encoding="utf-8"))
                for job in jobs
                if job.progress.exists()
            ]
            if begun:
                end_s = max(of_s for _, of_s, _ in begun)
                running = [text for now_s, of_s, text in begun if now_s < of_s]
                progress(sum(now_s for now_s, _, _ in begun), len(jobs) * end_s, "; ".join(running))

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield
    finally:
        end.set()
        watcher.join()
