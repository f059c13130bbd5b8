"""The finished runs of a study in its folder: what is there is not run again."""

import contextlib
import logging
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from genie_sim.base.errors import UserError
from genie_sim.base.paths import PARTIAL, atomic_write
from genie_sim.base.progress import Progress
from genie_sim.record import tables
from genie_sim.record.columns import Columns
from genie_sim.study.tasks import (
    PART,
    DaskWorkers,
    Failure,
    LocalWorkers,
    Shared,
    StudyRun,
    Task,
    content_digest,
)

if TYPE_CHECKING:
    import pandas as pd

log = logging.getLogger(__name__)
TASK_FRAMES = 30_000  # about ten seconds of work, which is what a kill may cost a worker
MIN_TASKS_A_WORKER = 4  # so that no worker waits long for the last one


@dataclass(frozen=True)
class Parts:
    """The parts in ``folder / "parts"``, and in ``folder / "failures"`` why runs failed."""

    folder: Path
    _ids: dict[Path, frozenset[str]] = field(default_factory=dict, repr=False, compare=False)
    _whole: dict[tuple[Path, int], bool] = field(default_factory=dict, repr=False, compare=False)

    @property
    def parts(self) -> Path:
        return self.folder / "parts"

    @property
    def failures(self) -> Path:
        return self.folder / "failures"

    def done(self) -> set[str]:
        """The ids of all runs that are there."""
        return {run_id for path in self._paths() for run_id in self._ids_in(path)}

    def run(
        self,
        runs: Collection[StudyRun],
        workers: LocalWorkers | DaskWorkers,
        shared: Shared | None = None,
        progress: Progress | None = None,
        *,
        lost: Collection[str] = (),
    ) -> None:
        """Runs what is missing of ``runs``. Where runs failed, the others are done all the same.

        Parameters
        ----------
        runs : collection of StudyRun
            In the order in which a failure is looked for to be named.
        workers : LocalWorkers or DaskWorkers
            Where they are simulated.
        shared : mapping of str to Frames, optional
            The frames that the runs name by their keys.
        progress : callable, optional
            Told how many runs are done, of how many, and how many failed.
        lost : collection of str
            The ids of runs whose metrics are there but not all else that they give.

        Raises
        ------
        UserError
            If a run failed, or the workers wrote to another file system.
        """
        done = self.done() - set(lost)
        missing = [run for run in runs if run.run_id not in done]
        count = len(runs) - len(missing)
        if progress is not None:
            progress(count, len(runs), "")
        if not missing:
            return
        for run in missing:
            self._failure(run.run_id).unlink(missing_ok=True)
        failures: dict[str, Failure] = {}
        tasks = tasks_of(missing, workers.workers, self.parts)
        with contextlib.closing(workers.run(tasks, shared or {})) as results:
            for finished in results:
                count += finished.runs
                failures |= {failure.run_id: failure for failure in finished.failures}
                self._write_failures(finished.failures, missing)
                if progress is not None:
                    progress(count, len(runs), f"{len(failures)} failed" if failures else "")
        if failures:
            first = next(run for run in runs if run.run_id in failures)
            raise UserError(
                f"{self.folder}: {len(failures):,} of {len(runs):,} runs failed, "
                f"the others are done; {first.place}: {failures[first.run_id].error}; "
                f"see {self._failure(first.run_id)}"
            )
        if {run.run_id for run in missing} - self.done():
            raise UserError(
                f"{self.parts}: the workers' parts are not there; they must write to the same "
                "file system"
            )

    def read(self, run_ids: Collection[str]) -> "pd.DataFrame":
        """The metrics of these runs, each once: the columns of ``PART``."""
        import pandas as pd

        texts = {column.name: str for column in PART.columns if column.kind == "text"}
        return pd.concat([part.to_frame().astype(texts) for part in self.columns(run_ids)])

    def columns(self, run_ids: Collection[str]) -> Iterator[Columns]:
        """The same, part by part."""
        remaining = set(run_ids)
        for path in self._paths():
            wanted = remaining & self._ids_in(path)
            if wanted:
                part = tables.read(path, PART)
                yield part.rows(part["run_id"].isin(wanted))
                remaining -= wanted

    def tidy(self) -> None:
        """Removes what killed workers left, and reasons of failures that are mended."""
        import shutil

        for leftover in self.parts.glob(f".*{PARTIAL}"):
            leftover.unlink(missing_ok=True)
        for path in self.parts.glob("*.parquet"):
            if not self._is_whole(path):
                path.unlink(missing_ok=True)
        shutil.rmtree(self.failures, ignore_errors=True)

    def _paths(self) -> list[Path]:
        paths = self.parts.glob("[!.]*.parquet")
        return sorted(path for path in paths if self._is_whole(path))

    def _is_whole(self, path: Path) -> bool:
        """Whether a part is as it was written. The runs of another one are made again."""
        written = path, path.stat().st_mtime_ns  # one that is made again has the same name
        if written not in self._whole:
            self._whole[written] = path.stem.rpartition("-")[2] == content_digest(path)
            if not self._whole[written]:
                log.warning("%s: was changed since it was written: its runs are made again", path)
        return self._whole[written]

    def _ids_in(self, path: Path) -> frozenset[str]:
        """The runs of a part, whose name stands for its content: it is read once."""
        if path not in self._ids:
            self._ids[path] = frozenset(tables.read(path, PART)["run_id"].unique())
        return self._ids[path]

    def _failure(self, run_id: str) -> Path:
        """The file that tells why a run failed."""
        return self.failures / f"{run_id}.txt"

    def _write_failures(self, failures: Sequence[Failure], runs: Sequence[StudyRun]) -> None:
        if not failures:
            return
        places = {run.run_id: run.place for run in runs}
        self.failures.mkdir(exist_ok=True)
        for failure in failures:
            text = f"{places[failure.run_id]}\n\n{failure.traceback}"
            with atomic_write(self._failure(failure.run_id)) as partial:
                partial.write_text(text, encoding="utf-8", errors="backslashreplace")


def tasks_of(runs: Sequence[StudyRun], workers: int, folder: Path) -> list[Task]:
    """Runs grouped into tasks of about equal length, the longest first."""
    largest = min(TASK_FRAMES, sum(run.frames for run in runs) / (MIN_TASKS_A_WORKER * workers))
    groups: list[list[StudyRun]] = []
    room = 0.0
    for run in sorted(runs, key=lambda run: (-run.frames, run.run_id)):
        if run.frames > room:
            groups.append([])
            room = largest
        groups[-1].append(run)
        room -= run.frames
    return [Task(tuple(group), str(folder.absolute())) for group in groups]
