"""What a worker does: it simulates the runs of a task and writes their metrics into one Parquet
part. Workers are processes on this machine (``LocalWorkers``), or those of a Dask cluster
(``DaskWorkers``).

A worker needs no file but the folder of the parts: traces come with ``Shared``, packed, and are
unpacked once in each worker.
"""

import functools
import hashlib
import logging
import pickle
import secrets
import traceback
from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

from genie_sim.analysis import metrics
from genie_sim.analysis.seed_runs import RUNS, folder_name
from genie_sim.base.errors import UserError
from genie_sim.base.parallel import in_processes
from genie_sim.base.paths import PARTIAL, replace_durably, sha256_of, usable
from genie_sim.data.source import Frames
from genie_sim.record import provenance
from genie_sim.record.columns import Columns
from genie_sim.record.results import MetricValue, changed_files
from genie_sim.record.tables import Column, Schema, Table
from genie_sim.report.output import DEFAULT_OUTPUT, Output
from genie_sim.runs import folder as run_folder
from genie_sim.runs.prepare import Prepared, prepare, prepare_with_frames
from genie_sim.runs.simulate import simulate
from genie_sim.scenario.scenario import Scenario
from genie_sim.version import VERSION

SCHEDULER_TIMEOUT_S = 10
WORKERS_TIMEOUT_S = 120
log = logging.getLogger(__name__)
# the tables that a part's metrics are from
MEASURED = (
    "frames",
    "lookups",
    "answers",
    "held",
    "hosts",
    "power",
    "faults",
)
PART = Schema(
    "sweep_part",
    "One row per run and metric; a run's rows are in the order in which metrics are computed.",
    (
        Column("run_id", "text", "", "hash of everything that decides the run's outcome"),
        Column("metric", "text", "", "name of the metric"),
        Column("method", "text", "", "the method that was simulated"),
        Column("placement", "text", "", "of Genies: car or edge; else all"),
        Column("component", "text", "", "of an improvement: the baseline; else empty"),
        Column("value", "float64", "", "null: not defined in this run", nullable=True),
        Column("unit", "text", "", "of value, low and high"),
        Column("low", "float64", "", "see analysis.metrics", nullable=True),
        Column("high", "float64", "", "see analysis.metrics", nullable=True),
        Column("n", "int64", "", "what the metric was computed over: frames, requests, updates"),
    ),
)


Shared = Mapping[str, Frames]  # the frames of all runs, by their keys


class StudyRun(Protocol):
    """One simulation of a study. It is pickled and sent to a worker."""

    @property
    def run_id(self) -> str:
        """Names everything that decides the outcome."""

    @property
    def frames(self) -> float:
        """About how many frames it simulates, under all methods."""

    @property
    def place(self) -> str:
        """Which set-up and seed it belongs to, in words."""

    def measure(self, shared: Shared, folder: Path) -> Mapping[str, Sequence[MetricValue]]:
        """Simulates it. Returns metrics by the id that they are kept under: the run's own, and ids
        beginning with it where the same simulation is judged in several ways. What is no metric
        goes into files in ``folder``.
        """


@dataclass(frozen=True, slots=True)
class PointRun:
    """A point of a design with one seed: its scenario, and the key of its frames in ``Shared``
    (``None``: they are the seed's own). ``keep`` is whether its whole results are kept beside the
    parts, and ``output`` what else is written then.
    """

    run_id: str
    scenario: Scenario
    source: str | None
    frames: float
    place: str
    keep: bool = False
    output: Output = DEFAULT_OUTPUT

    def measure(self, shared: Shared, folder: Path) -> Mapping[str, Sequence[MetricValue]]:
        """The metrics of its methods."""
        prepared = (
            prepare(self.scenario)
            if self.source is None
            else prepare_with_frames(self.scenario, shared[self.source])
        )
        if not self.keep:
            return {self.run_id: measured(prepared)}
        path = self._results(folder.parent)
        with provenance.result_folder(path) as partial:
            run = run_folder.write(partial, prepared, self.run_id, output=self.output)
        return {self.run_id: _metrics_of(prepared, run.tables)}

    def is_kept(self, study_folder: Path) -> bool:
        """Whether its results are where they are to be kept, as they were written, or need not be
        kept.
        """
        if not self.keep:
            return True
        folder = self._results(study_folder)
        try:
            about = provenance.read_run_json(folder)
            changed = changed_files(folder, about)
        except UserError:
            return False
        if changed:
            names = ", ".join(changed)
            log.warning("%s: %s: changed since: the run is made again", folder, names)
        return about["run_id"] == self.run_id and not changed

    def _results(self, study_folder: Path) -> Path:
        return study_folder / RUNS / folder_name(self.scenario.seed)


@dataclass(frozen=True, slots=True)
class Task:
    """Runs that one worker does in one go, the folder that gets their part, and the version they
    are meant for.
    """

    runs: tuple[StudyRun, ...]
    folder: str
    genie_sim: str = VERSION

    @property
    def part(self) -> Path:
        """The file of their metrics, without the digest of its content that its name gets when it
        is whole. A task that is done twice leaves one file.
        """
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


def run_task(task: Task, packed: bytes) -> Finished:
    """Simulates the runs of a task and writes their part. What one run raises does not keep the
    others from being done. ``packed``: what the tasks share, pickled. Raises ``UserError``.
    """
    if task.genie_sim != VERSION:
        raise UserError(
            f"a worker has genie-sim {VERSION}, the sweep {task.genie_sim}: install the same"
        )
    shared = _unpacked(packed)
    table = Table(PART)
    failures: list[Failure] = []
    for run in task.runs:
        try:
            judgements = run.measure(shared, Path(task.folder))
        except (Exception, SystemExit) as error:
            what = f"{type(error).__name__}: {error}"
            failures.append(Failure(run.run_id, what, traceback.format_exc()))
            continue
        for key, metrics_of_run in judgements.items():
            for metric in metrics_of_run:
                table.append((key, *metric.row))
    finished = Finished(len(task.runs) - len(failures), tuple(failures))
    if not finished.runs:
        return finished
    with usable(task.part):
        task.part.parent.mkdir(parents=True, exist_ok=True)
        beside = task.part.with_name(f".{task.part.name}.{secrets.token_hex(4)}{PARTIAL}")
        table.write(beside)
        digest = content_digest(beside)
        replace_durably(beside, task.part.with_stem(f"{task.part.stem}-{digest}"))
    return finished


def content_digest(path: Path) -> str:
    """What the name of a part ends with: it says whether the file was changed since."""
    return sha256_of(path)[:16]


def measured(prepared: Prepared) -> Sequence[MetricValue]:
    """Simulates one run: the metrics of its methods and of their Genies, not of single resources: a
    fleet has many.
    """
    # by the metrics of a sweep
    needed = {"lookups", "resources", "poses", "objects", "answers", "held"}
    record = tuple(table_name for table_name in prepared.scenario.record if table_name in needed)
    scenario = replace(prepared.scenario, record=record)
    tables = simulate(replace(prepared, scenario=scenario))
    return _metrics_of(prepared, {name: tables[name].columns() for name in MEASURED})


def _metrics_of(prepared: Prepared, tables: Mapping[str, Columns]) -> Sequence[MetricValue]:
    used = {name: tables[name] for name in MEASURED}
    return metrics.compute(run_folder.methods_of(prepared), used, own=prepared.scenario.metrics)


@functools.lru_cache(maxsize=1)
def _unpacked(packed: bytes) -> Shared:
    frames: Shared = pickle.loads(packed)
    return frames


class LocalWorkers:
    """Processes on this machine (joblib)."""

    def __init__(self, jobs: int) -> None:
        self.workers = jobs

    def run(self, tasks: Sequence[Task], shared: Shared) -> Generator[Finished, None, None]:
        """What became of each task, as it is done."""
        run = functools.partial(run_task, packed=pickle.dumps(shared))
        return in_processes(run, tasks, self.workers, ordered=False)

    def close(self) -> None:
        """Nothing is left open."""


class DaskWorkers:
    """The workers of a running Dask scheduler; they and this process share a file system."""

    def __init__(self, scheduler: str) -> None:
        try:
            from distributed import Client
        except ImportError:
            raise UserError(
                "--scheduler: dask is not installed: pip install 'genie-sim[dask]'"
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
        """What became of each task, as it is done. Dask gives the tasks of a lost worker to the
        others.

        What the tasks share is itself the result of a task: each worker fetches it once, and it
        cannot get lost.
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
        """Closes the connection to the scheduler."""
        self._client.close()
