"""The methods of one run side by side, each in a process of its own.

Methods share nothing but the scenario and its random streams, so the tables are those of the
methods one after the other, to the byte.
"""

import functools
import json
import pickle
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from genie_sim import build
from genie_sim.build import Prepared
from genie_sim.parallel import in_processes
from genie_sim.paths import atomic_write
from genie_sim.perception.sources import Progress
from genie_sim.recording.log import Log
from genie_sim.recording.records import SCHEMAS, Tables, new_tables
from genie_sim.recording.tables import read
from genie_sim.runner import gc_disabled, prepare, simulate_method
from genie_sim.scenario.methods import MethodEntry
from genie_sim.sim.world import World

PROGRESS_EVERY_S = 0.5


@dataclass(frozen=True)
class MethodJob:
    """The ``number``-th method of a scenario, and the folder that gets its tables."""

    number: int
    folder: Path

    @property
    def progress(self) -> Path:
        """The file that says how far it is: seconds now and at the end, and what is going on."""
        return self.folder / "progress.json"


def side_by_side(
    prepared: Prepared, workers: int, progress: Progress | None = None, spill: Path | None = None
) -> Tables:
    """The tables of all methods, simulated in so many processes; see ``runner.simulate``.

    Each process prepares the scenario anew. Raises ``UserError``.
    """
    packed = pickle.dumps((prepared.scenario, prepared.devices))
    tables = new_tables(spill)
    with tempfile.TemporaryDirectory(dir=spill) as scratch:
        jobs = [
            MethodJob(number, Path(scratch) / str(number))
            for number in range(len(prepared.scenario.methods))
        ]
        for job in jobs:
            job.folder.mkdir()
        run = functools.partial(_write_tables, packed)
        with _watched(jobs, progress):
            for job in in_processes(run, jobs, workers):
                for name, table in tables.items():
                    path = job.folder / f"{name}.parquet"
                    table.extend(read(path, SCHEMAS[name]))
                    path.unlink()
    return tables


def _write_tables(packed: bytes, job: MethodJob) -> MethodJob:
    """Simulates one method and writes its tables."""
    prepared = _prepared(packed)
    earlier, entry = prepared.expanded.methods[: job.number], prepared.expanded.methods[job.number]
    tables = new_tables(job.folder)
    simulate_method(
        prepared,
        entry,
        tables,
        driven=set().union(*(_hosts(prepared, other) for other in earlier)),
        progress=_Reporter(job),
    )
    for name, table in tables.items():
        table.write(job.folder / f"{name}.parquet")
    return job


@functools.lru_cache(maxsize=1)
def _prepared(packed: bytes) -> Prepared:
    """What all methods of a run begin with, once a process."""
    scenario, devices = pickle.loads(packed)
    return prepare(scenario, devices=devices)


def _hosts(prepared: Prepared, entry: MethodEntry) -> set[str]:
    """The hosts on which a method runs something."""
    with gc_disabled():
        log = Log(entry.name, new_tables(), samples="none")
        world = World(build.setup(prepared, entry), build.method(entry), log)
        hosts = set(world.network.graphs)
        world.dismantle()
    return hosts


class _Reporter:
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
def _watched(jobs: Sequence[MethodJob], progress: Progress | None) -> Iterator[None]:
    """Tells how far the methods are together while they run."""
    end = threading.Event()

    def watch(tell: Progress) -> None:
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
                tell(sum(now_s for now_s, _, _ in begun), len(jobs) * end_s, "; ".join(running))

    if progress is None:
        yield
        return
    watcher = threading.Thread(target=watch, args=(progress,), daemon=True)
    watcher.start()
    try:
        yield
    finally:
        end.set()
        watcher.join()
