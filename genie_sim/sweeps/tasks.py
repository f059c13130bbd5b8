"""What a worker does: it simulates the runs of a task and writes their metrics into one Parquet part.

A worker is a process here, under a batch system, or on a Dask cluster. It needs no file but the folder of the parts:
profiles and traces come with ``Shared``, packed, and are unpacked once in each worker.
"""

from __future__ import annotations

import functools
import hashlib
import os
import pickle
import traceback
from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass
from pathlib import Path

import genie_sim
from genie_sim import runner
from genie_sim.analysis import metrics
from genie_sim.build import Prepared
from genie_sim.errors import UserError
from genie_sim.paths import atomic_write
from genie_sim.perception.sources import Frames
from genie_sim.recording.results import Metric
from genie_sim.recording.tables import Column, Schema, Table
from genie_sim.scenario.profiles import DeviceProfile
from genie_sim.scenario.scenario import Scenario

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
    """One run: its scenario, and the key of its frames in ``Shared`` (``None``: they are the seed's own).

    ``frames``: about how many it simulates.

    ``place``: which point and seed it belongs to, in words.
    """

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


@dataclass(frozen=True, slots=True)
class Shared:
    """The device profiles (as JSON) and frames of all runs."""

    devices: Mapping[str, str]
    frames: Mapping[str, Frames]

    def packed(self) -> bytes:
        """For the way to the workers."""
        return pickle.dumps(self)


def run_task(task: Task, packed: bytes) -> Finished:
    """Simulates the runs of a task and writes their part. What one run raises does not keep the others from being done.
    Raises ``UserError``."""
    if task.genie_sim != genie_sim.__version__:
        raise UserError(f"a worker has genie-sim {genie_sim.__version__}, the sweep {task.genie_sim}: install the same")
    devices, frames = _unpacked(packed)
    table = Table(PART)
    failures: list[Failure] = []
    for run in task.runs:
        try:
            if run.source is None:
                prepared = runner.prepare(run.scenario, devices=devices)
            else:
                prepared = runner.on_frames(run.scenario, frames[run.source], devices)
            found = measured(prepared)
        except Exception as error:
            failures.append(Failure(run.run_id, f"{type(error).__name__}: {error}", traceback.format_exc()))
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
    tables = runner.simulate(prepared)
    none = tables.resources.columns().rows([])
    used = (tables.frames.columns(), tables.lookups.columns(), none, tables.answers.columns(), tables.held.columns())
    return metrics.compute(runner.methods_of(prepared), *used)


@functools.lru_cache(maxsize=1)
def _unpacked(packed: bytes) -> tuple[dict[str, DeviceProfile], Mapping[str, Frames]]:
    shared: Shared = pickle.loads(packed)
    return {name: DeviceProfile.model_validate_json(text) for name, text in shared.devices.items()}, shared.frames
