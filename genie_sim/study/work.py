"""The runs of a study. A worker simulates a run and writes its metrics to a file of the run's id:
what has such a file is not run again.

Workers are processes on this machine, which read profiles and traces themselves, each once.
"""

import contextlib
import functools
import hashlib
import json
import logging
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from genie_sim.analysis import metrics
from genie_sim.analysis.seed_runs import RUNS, folder_name
from genie_sim.base.errors import UserError
from genie_sim.base.parallel import in_processes
from genie_sim.base.paths import (
    PARTIAL,
    atomic_write,
    read_text,
    regular,
    uninterrupted,
    usable,
)
from genie_sim.base.plugins import is_own_code_allowed, own_code_allowed, own_faults_told
from genie_sim.base.progress import Progress
from genie_sim.base.text import one_line
from genie_sim.record import folders, provenance
from genie_sim.record.columns import Columns
from genie_sim.record.results import FILES, METRIC_FIELDS, MetricValue
from genie_sim.report.output import DEFAULT_OUTPUT, SHOWN, Output
from genie_sim.runs import folder as run_folder
from genie_sim.runs.prepare import Prepared, SharedFrames
from genie_sim.runs.simulate import simulate
from genie_sim.scenario.scenario import Scenario

if TYPE_CHECKING:
    import pandas as pd

log = logging.getLogger(__name__)
# the tables that a sweep's metrics are from, and what must be recorded for them
MEASURED = ("frames", "lookups", "answers", "held", "hosts", "power", "faults")
NEEDED = {"lookups", "resources", "poses", "objects", "answers", "held"}
RUN_ID = re.compile("[0-9a-f]{12}")
PART = re.compile(rf"{RUN_ID.pattern}\.json")
# what ``atomic_write`` writes beside a part
BESIDE = re.compile(rf"\.{RUN_ID.pattern}\.json\.[0-9a-f]{{8}}{re.escape(PARTIAL)}")
_frames_of_process = functools.cache(SharedFrames)


@dataclass(frozen=True, slots=True)
class PointRun:
    """A scenario with one seed. ``keep``: its whole results are kept, with what ``output`` says."""

    run_id: str
    scenario: Scenario
    place: str
    keep: bool = False
    output: Output = DEFAULT_OUTPUT

    def measure(self, study: Path) -> Sequence[MetricValue]:
        """Simulates it. Raises ``UserError``, also where a file is not as it was when planned."""
        prepared = _frames_of_process().prepare(self.scenario)
        if provenance.run_id(prepared.facts) != self.run_id:
            raise UserError("genie-sim or a file is not the one that was planned with")
        if not self.keep:
            return measured(prepared)
        folder = self.results(study)
        with folders.result_folder(folder, SHOWN) as partial:
            run = run_folder.simulate_into(partial, prepared, self.run_id)
        # a page that cannot be made is looked for once more when all runs are there
        with contextlib.suppress(folders.NotDerivedError):
            self.output.write(run, folder)
        names = {value.metric for value in run.measured}  # what failed was told
        own = [name for name in self.scenario.metrics if name in names]
        return _metrics_of(prepared, run.tables, own)

    def is_kept(self, study: Path) -> bool:
        """Whether its results are there as they were written, or need not be kept."""
        if not self.keep:
            return True
        folder = self.results(study)
        try:
            about = provenance.read_run_json(folder)
        except UserError:
            return False
        try:
            provenance.check_unchanged(folder, about, FILES)
        except UserError as error:
            log.warning("%s; the run is made again", error)
            return False
        return bool(about["run_id"] == self.run_id)

    def results(self, study: Path) -> Path:
        """Their folder. Raises ``UserError`` where a link leads elsewhere."""
        return provenance.contained(study, f"{RUNS}/{folder_name(self.scenario.seed)}")


def measured(prepared: Prepared) -> Sequence[MetricValue]:
    """The metrics of a run's methods and Genies, not of single resources: a fleet has many."""
    record = tuple(name for name in prepared.scenario.record if name in NEEDED)
    tables = simulate(replace(prepared, scenario=replace(prepared.scenario, record=record)))
    columns = {name: tables[name].columns() for name in MEASURED}
    return _metrics_of(prepared, columns, prepared.scenario.metrics)


def _metrics_of(
    prepared: Prepared, tables: Mapping[str, Columns], own: Sequence[str]
) -> Sequence[MetricValue]:
    measured_tables = {name: tables[name] for name in MEASURED}
    return metrics.compute(run_folder.methods_of(prepared), measured_tables, own=own)


def _work(run: PointRun, study: Path, own_code: bool) -> tuple[str, str]:
    """What a worker does, with ``own_code`` or without. What a run raises does not keep the others
    from being done.
    """
    parts = Parts(study)
    try:
        with own_code_allowed(own_code), own_faults_told():
            parts.write(run.run_id, run.measure(study))
    except (Exception, SystemExit) as error:
        message = str(error) if isinstance(error, UserError) else f"{type(error).__name__}: {error}"
        return run.run_id, message
    return run.run_id, ""


@dataclass(frozen=True)
class Parts:
    """The metrics of finished runs, a file of JSON each, named by the run's id, in ``folder /
    "parts"``.

    A part says which versions wrote it and has a digest of its numbers. What was changed since is
    made again; files of other names are left alone.
    """

    folder: Path

    @property
    def parts(self) -> Path:
        """Raises ``UserError``, as all that reads and writes here, where a link leads elsewhere."""
        return provenance.contained(self.folder, "parts")

    def done(self, run_ids: Collection[str]) -> set[str]:
        """Those of the runs that are there. Raises ``UserError``."""
        return {run_id for run_id in run_ids if self.metrics(run_id) is not None}

    def write(self, run_id: str, metrics_of_run: Sequence[MetricValue]) -> None:
        """Keeps a run's metrics. Raises ``UserError``."""
        part = {
            "run_id": run_id,
            **provenance.environment(),
            "metrics": metrics_of_run,
            "digest": _digest(metrics_of_run),
        }
        _write(self.parts / f"{run_id}.json", json.dumps(part))

    def borrow(self, other: "Parts", run_ids: Collection[str]) -> None:
        """Takes over the runs of another study. Raises ``UserError``."""
        for run_id in other.done(run_ids) - self.done(run_ids):
            _write(self.parts / f"{run_id}.json", read_text(other.parts / f"{run_id}.json"))

    def run(
        self,
        runs: Collection[PointRun],
        jobs: int,
        progress: Progress | None = None,
        incomplete: Collection[str] = (),
    ) -> None:
        """Runs what is missing of ``runs``, those with many cars first.

        Parameters
        ----------
        runs : collection of PointRun
            In the order in which a failure is looked for to be named.
        jobs : int
            So many processes of this machine simulate them.
        progress : callable, optional
            Told how many runs are done, of how many, and how many failed.
        incomplete : collection of str
            The ids of runs whose metrics are there but not all else that they give.

        Raises
        ------
        UserError
            If a run failed, when all others are done.
        """
        done_ids = self.done([run.run_id for run in runs]) - set(incomplete)
        pending = [run for run in runs if run.run_id not in done_ids]
        tell = progress or (lambda *_: None)
        tell(len(done_ids), len(runs), "")
        pending.sort(key=lambda run: -len(run.scenario.cars) * len(run.scenario.methods))
        work = functools.partial(
            _work, study=self.folder.absolute(), own_code=is_own_code_allowed()
        )
        failed: dict[str, str] = {}
        try:
            with contextlib.closing(in_processes(work, pending, jobs, ordered=False)) as results:
                for count, (run_id, error) in enumerate(results, len(done_ids) + 1):
                    if error:
                        failed[run_id] = error
                    tell(count - len(failed), len(runs), f"{len(failed)} failed" if failed else "")
        except KeyboardInterrupt:
            with uninterrupted():  # its workers were killed in the middle of something
                folders.clear_away(provenance.contained(self.folder, RUNS))
                self._clear_parts()
            raise KeyboardInterrupt(f"finished runs are kept in {self.folder}") from None
        if failed:
            first = next(run for run in runs if run.run_id in failed)
            raise UserError(
                f"{self.folder}: {len(failed):,} of {len(runs):,} runs failed, the others are done;"
                f" {first.place}: {failed[first.run_id]}"
            )

    def read(self, run_ids: Collection[str]) -> "pd.DataFrame":
        """The metrics of these runs, which are done: ``run_id`` and the fields of
        ``MetricValue``.
        """
        import pandas as pd

        rows = [(run_id, *row) for run_id in sorted(run_ids) for row in self.metrics(run_id) or ()]
        table = pd.DataFrame(rows, columns=["run_id", *METRIC_FIELDS])
        return table.astype(
            dict.fromkeys(("value", "low", "high", "range_low", "range_high"), float)
        )

    def tidy(self) -> None:
        """Removes what killed workers left. A line tells of files that are somebody's."""
        foreign_names = self._clear_parts()
        if foreign_names:
            more = f" and {len(foreign_names) - 3:,} more" if len(foreign_names) > 3 else ""
            log.warning(
                "%s: not of a sweep, left alone: %s%s",
                self.parts,
                ", ".join(foreign_names[:3]),
                more,
            )

    def _clear_parts(self) -> list[str]:
        """Removes what killed workers left among the parts; returns the names of files that are
        somebody's.
        """
        foreign_names = []
        for path in sorted(self.parts.glob("*")):
            if BESIDE.fullmatch(path.name):
                path.unlink(missing_ok=True)
            elif not PART.fullmatch(path.name):
                foreign_names.append(one_line(path.name))
        return foreign_names

    def metrics(self, run_id: str) -> list[list[Any]] | None:
        """The metrics of a run; ``None`` where they are not there, or not as they were written.
        Raises ``UserError`` for what is no file of this folder, or was not written by genie-sim.
        """
        path = provenance.contained(self.folder, f"parts/{run_id}.json")
        if not path.exists():
            return None
        _check_own(path, run_id)
        try:
            part = provenance.read_json(path)
            if part["run_id"] == run_id and part["digest"] == _digest(part["metrics"]):
                rows: list[list[Any]] = part["metrics"]
                for row in rows:
                    MetricValue(*row).check()
                return rows
        except (UserError, LookupError, TypeError, ValueError) as error:
            log.debug("%s: %s", path, error)
        log.warning("%s: was changed since it was written: its run is made again", path)
        return None


def _check_own(path: Path, run_id: str) -> None:
    """Raises ``UserError`` for what no ``Parts`` wrote, damaged or not: it would be lost."""
    begins = json.dumps({"run_id": run_id}).removesuffix("}").encode()
    with regular(path) as file:
        if begins.startswith(file.read(len(begins))):
            return
    raise UserError(f"{path}: not written by genie-sim, which would replace it: move it away")


def _digest(rows: Sequence[Sequence[Any]]) -> str:
    return hashlib.sha256(json.dumps(rows).encode()).hexdigest()


def _write(path: Path, text: str) -> None:
    with usable(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        with atomic_write(path) as beside:
            beside.write_text(text, encoding="utf-8", errors="backslashreplace")
