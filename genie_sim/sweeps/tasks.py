"""What a worker does: it simulates the runs of a task and writes their metrics into one Parquet part. And where the
workers are: processes on this machine (``Local``), or a Dask cluster (``Dask``).

A worker is a process here, under a batch system, or on a Dask cluster. It needs no file but the folder of the parts:
traces come with ``Shared``, packed, and are unpacked once in each worker.
"""

import functools
import hashlib
import os
import pickle
import traceback
from collections.abc import Generator, Mapping, Sequence
from dataclasses import astuple, dataclass, replace
from pathlib import Path

import genie_sim
from genie_sim import runner
from genie_sim.analysis import metrics
from genie_sim.build import Prepared
from genie_sim.errors import UserError
from genie_sim.parallel import in_processes
from genie_sim.paths import atomic_write
from genie_sim.perception.sources import Frames
from genie_sim.recording.results import Metric
from genie_sim.recording.tables import Column, Schema, Table
from genie_sim.scenario.scenario import Scenario

SCHEDULER_TIMEOUT_S = 10
WORKERS_TIMEOUT_S = 120
PART = Schema(
    "sweep_part",
    "One row per run and metric; a run's rows are in the order in which metrics are computed.",
    (
        Column("run_id", "text", "", "hash of everything that decides the run's outcome"),
        Column("metric", "text", "", "name of the metric"),
        Column("method", "text", "", "the method that was simulated"),
        Column("placement", "text", "", "of Genies: car or edge; else all"),
        Column("component", "text", "", "of an improvement: the baseline; else empty"),
        Column("value", "float64", "", "null: not defined in this run", True),
        Column("unit", "text", "", "of value, low and high"),
        Column("low", "float64", "", "see analysis.metrics", True),
        Column("high", "float64", "", "see analysis.metrics", True),
        Column("n", "int64", "", "what the metric was computed over: frames, requests, updates"),
    ),
)


@dataclass(frozen=True, slots=True)
class Run:
    """One run: its scenario, and the key of its frames in ``Shared`` (``None``: they are the seed's own). ``frames``:
    about how many it simulates; ``place``: which point and seed it belongs to, in words."""

    run_id: str
    scenario: Scenario
    source: str | None
    frames: float
    place: str


@dataclass(frozen=True, slots=True)
class Task:
    """Runs that one worker does in one go, the folder that gets their part, and the version they are meant for."""

    runs: tuple[Run, ...]
    folder: str
    genie_sim: str = genie_sim.__version__

    @property
    def part(self) -> Path:
        """The file of their metrics; named by its content, so that a task that is done twice leaves one file."""
        content = hashlib.sha256(" ".join(run.run_id for run in self.runs).encode()).hexdigest()
        return Path(self.folder) / f"{content[:16]}.parquet"


@dataclass(frozen=True, slots=True)
class Failure:
    """A run that raised something: what it said, and the whole traceback."""

    run_id: str
    error: str
    traceback: str


@dataclass(frozen=True, slots=True)
class Finished:
    """What became of a task: how many of its runs are in its part, and those that failed."""

    runs: int
    failures: tuple[Failure, ...] = ()


Shared = Mapping[str, Frames]  # the frames of all runs, by their keys


def run_task(task: Task, packed: bytes) -> Finished:
    """Simulates the runs of a task and writes their part. What one run raises does not keep the others from being done.
    ``packed``: what the tasks share, pickled. Raises ``UserError``."""
    if task.genie_sim != genie_sim.__version__:
        raise UserError(
            f"a worker has genie-sim {genie_sim.__version__}, the sweep {task.genie_sim}: install the same"
        )
    frames = _unpacked(packed)
    table = Table(PART)
    failures: list[Failure] = []
    for run in task.runs:
        try:
            known = None if run.source is None else frames[run.source]
            found = measured(
                runner.prepare(run.scenario)
                if known is None
                else runner.on_frames(run.scenario, known)
            )
        except Exception as error:
            failures.append(
                Failure(run.run_id, f"{type(error).__name__}: {error}", traceback.format_exc())
            )
            continue
        for metric in found:
            table.append((run.run_id, *astuple(metric)))
    finished = Finished(len(task.runs) - len(failures), tuple(failures))
    if not finished.runs:
        return finished
    with atomic_write(task.part) as beside:
        task.part.parent.mkdir(parents=True, exist_ok=True)
        table.write(beside)
        with beside.open("rb") as written:  # on the disk before it has its name
            os.fsync(written.fileno())
    return finished


def measured(prepared: Prepared) -> Sequence[Metric]:
    """Simulates one run: the metrics of its methods and of their Genies, not of single resources: a fleet has many."""
    needed = (
        "lookups",
        "resources",
        "poses",
        "objects",
        "answers",
        "held",
    )  # by the metrics of a sweep
    record = tuple(one for one in prepared.expanded.record if one in needed)
    scenario = prepared.expanded.model_copy(update={"record": record})
    tables = runner.simulate(replace(prepared, expanded=scenario))
    used = {
        table.name: table.columns()
        for table in (tables.frames, tables.lookups, tables.answers, tables.held)
    }
    return metrics.compute(runner.methods_of(prepared), used)


@functools.lru_cache(maxsize=1)
def _unpacked(packed: bytes) -> Shared:
    frames: Shared = pickle.loads(packed)
    return frames


class Local:
    """Processes on this machine (joblib)."""

    def __init__(self, jobs: int) -> None:
        self.workers = jobs

    def run(self, tasks: Sequence[Task], shared: Shared) -> Generator[Finished, None, None]:
        """What became of each task, as it is done."""
        run = functools.partial(run_task, packed=pickle.dumps(shared))
        return in_processes(run, tasks, self.workers, ordered=False)

    def close(self) -> None:
        """Nothing is left open."""


class Dask:
    """The workers of a running Dask scheduler; they and this process share a file system."""

    def __init__(self, scheduler: str) -> None:
        try:
            from distributed import Client
        except ImportError:
            raise UserError(
                "--backend dask: Dask is not installed: pip install 'genie-sim[dask]'"
            ) from None
        self._where = f"--scheduler {scheduler}"
        try:
            self._client = Client(scheduler, timeout=SCHEDULER_TIMEOUT_S)
        except (OSError, ValueError, TypeError) as error:
            raise UserError(f"{self._where}: no Dask scheduler answers there") from error
        try:
            self._client.wait_for_workers(1, timeout=WORKERS_TIMEOUT_S)
        except TimeoutError:
            self.close()
            raise UserError(
                f"{self._where}: has no workers, and got none in {WORKERS_TIMEOUT_S} s"
            ) from None
        self.workers: int = max(1, sum(self._client.nthreads().values()))

    def run(self, tasks: Sequence[Task], shared: Shared) -> Generator[Finished, None, None]:
        """What became of each task, as it is done. Dask gives the tasks of a lost worker to the others.

        What the tasks share is itself the result of a task: each worker fetches it once, and it cannot get lost.
        """
        from distributed import CancelledError, KilledWorker, as_completed

        packed = self._client.submit(bytes, pickle.dumps(shared))
        futures = [
            self._client.submit(run_task, task, packed, key=f"genie-sim-{task.part.stem}")
            for task in tasks
        ]
        try:
            for future in as_completed(futures):
                yield future.result()
        except KilledWorker as error:
            raise UserError(
                f"{self._where}: a task was lost with several workers, for want of memory?"
            ) from error
        except (CancelledError, OSError) as error:
            raise UserError(f"{self._where}: the connection to the scheduler was lost") from error
        finally:
            self._client.cancel([*futures, packed])

    def close(self) -> None:
        """Says good-bye to the scheduler."""
        self._client.close()
