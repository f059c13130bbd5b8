"""Runs a sweep, or what is missing of it, and makes its tables, figures and page once every run is there."""

import contextlib
import itertools
import json
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from genie_sim import build, files, report
from genie_sim.errors import UserError
from genie_sim.paths import PARTIAL, atomic_write, usable
from genie_sim.perception.sources import Progress
from genie_sim.recording import provenance
from genie_sim.recording.tables import other_format
from genie_sim.sweeps import tables
from genie_sim.sweeps.design import Design, load_design
from genie_sim.sweeps.plan import Plan, plan, tasks
from genie_sim.sweeps.tasks import Dask, Failure, Local

if TYPE_CHECKING:
    import pandas as pd

FORMAT = 2
ABOUT = "sweep.json"
FAILURES = "failures"
RESULTS = (
    "table.*",
    "differences.*",
    "runs.parquet",
    "figures/*",
    "report.html",
)  # besides the parts


@dataclass(frozen=True)
class Swept:
    """What there is: the folder, how many points and runs the sweep has, and how many runs are done.

    ``complete``: all of them, so the tables and figures are made.
    """

    folder: Path
    points: int
    runs: int
    done: int

    @property
    def complete(self) -> bool:
        return self.done == self.runs


@dataclass
class Sweep:
    """A sweep in its folder, ``out/<name>``. Runs that are in the folder, from whichever sweep, are not run again."""

    design: Design
    folder: Path
    plan: Plan

    @classmethod
    def load(cls, path_or_name: str | Path, out: Path, progress: Progress | None = None) -> "Sweep":
        """Reads and checks the sweep and its folder. Raises ``UserError``."""
        return cls.of(
            load_design(path_or_name), str(files.find(files.SWEEP, path_or_name)), out, progress
        )

    @classmethod
    def of(cls, design: Design, where: str, out: Path, progress: Progress | None = None) -> "Sweep":
        """Checks a sweep and its folder; ``where`` the sweep comes from. Raises ``UserError``."""
        folder = out / design.name
        _check(folder)
        return cls(design, folder, plan(design, where, progress))

    def run(
        self,
        backend: Local | Dask,
        shard: tuple[int, int] = (1, 1),
        progress: Progress | None = None,
    ) -> None:
        """Runs what is missing of a shard ``(i, n)``. Raises ``UserError``; where runs failed, when all others are
        done."""
        with usable(self.folder):
            self._parts.mkdir(parents=True, exist_ok=True)
            self._write_about()
        mine = sorted(self.plan.runs.values(), key=lambda run: run.run_id)[shard[0] - 1 :: shard[1]]
        done = tables.done_runs(self._parts)
        missing = [run for run in mine if run.run_id not in done]
        count = len(mine) - len(missing)
        if progress is not None:
            progress(count, len(mine), "")
        for path in itertools.chain.from_iterable(map(self.folder.glob, RESULTS)):
            path.unlink(missing_ok=True)  # of earlier axes or fewer seeds
        if not missing:
            return
        for run in missing:
            self._told(run.run_id).unlink(missing_ok=True)
        failures: list[Failure] = []
        with contextlib.closing(
            backend.run(tasks(missing, backend.workers, self._parts), self.plan.shared)
        ) as results:
            for finished in results:
                count += finished.runs
                failures += finished.failures
                for failure in finished.failures:
                    self._tell(failure)
                if progress is not None:
                    progress(count, len(mine), f"{len(failures)} failed" if failures else "")
        if failures:
            why = {failure.run_id: failure.error for failure in failures}
            first = next(run for run_id, run in self.plan.runs.items() if run_id in why)
            raise UserError(
                f"{self.folder}: {len(failures):,} of {len(mine):,} runs failed, the others are done; "
                f"{first.place}: {why[first.run_id]}; see {self._told(first.run_id)}"
            )
        if {run.run_id for run in mine} - tables.done_runs(self._parts):
            raise UserError(
                f"{self._parts}: the workers' parts are not there; they must write to the same file system"
            )

    def finish(self, pictures: bool = True) -> Swept:
        """Makes the tables, and with ``pictures`` figures and page, if every run is done. Raises ``UserError``."""
        done = len(tables.done_runs(self._parts) & self.plan.runs.keys())
        swept = Swept(
            self.folder, self.design.runs // len(self.design.seeds), len(self.plan.runs), done
        )
        if swept.complete:
            with usable(self.folder):
                runs = self._write()
                if pictures:
                    self._draw(runs)
        return swept

    def _told(self, run_id: str) -> Path:
        """The file that tells why a run failed."""
        return self.folder / FAILURES / f"{run_id}.txt"

    def _tell(self, failure: Failure) -> None:
        with atomic_write(self._told(failure.run_id)) as beside:
            beside.parent.mkdir(exist_ok=True)
            text = f"{self.plan.runs[failure.run_id].place}\n\n{failure.traceback}"
            beside.write_text(text, encoding="utf-8", errors="backslashreplace")

    @property
    def _parts(self) -> Path:
        return self.folder / "parts"

    def _write(self) -> "pd.DataFrame":
        """The tables; returns that of all runs."""
        columns = list(self.design.columns.values())
        runs = tables.of_runs(
            self.plan.entries, columns, tables.read_parts(self._parts, self.plan.runs.keys())
        )
        crossed = [self.design.columns[name] for name in self.design.crossed]
        about = json.dumps({"sweep": self._settings(), "format": FORMAT}, sort_keys=True).encode()
        tables.write_parquet(runs, self.folder / "runs.parquet", about)
        compared = tables.all_differences(runs, columns, crossed)
        for name, table in (("table", tables.of_points(runs, columns)), ("differences", compared)):
            tables.write_parquet(table, self.folder / f"{name}.parquet", about)
            tables.write_csv(table, self.folder / f"{name}.csv")
        self._write_about()  # another sweep of this name may have begun in the meantime
        for leftover in self._parts.glob(f".*{PARTIAL}"):
            leftover.unlink(missing_ok=True)  # of workers that were killed
        shutil.rmtree(
            self.folder / FAILURES, ignore_errors=True
        )  # of runs that a plug-in has since been mended for
        return runs

    def _draw(self, runs: "pd.DataFrame") -> None:
        from genie_sim.analysis import figures as of_runs
        from genie_sim.sweeps import figures, page

        (self.folder / "figures").mkdir(exist_ok=True)
        titles, seeds = self._titles(), self.design.seeds
        shown = ", ".join(map(str, seeds)) if len(seeds) <= 5 else f"{len(seeds)} seeds"
        points = self.design.runs // len(seeds)
        footer = (
            f"sweep {self.design.name} of {self.design.scenario}, {points} points, seeds {shown}"
        )
        told = {
            name: title if list(titles.values()).count(title) == 1 else name
            for name, title in titles.items()
        }
        titled = runs.assign(method=runs["method"].map(told))
        for name, figure in figures.of_sweep(self.design, titled, footer):
            of_runs.save(figure, self.folder / "figures", name)
        report.write_text(self.folder / report.NAME, page.page(self.folder))

    def _settings(self) -> dict[str, object]:
        return self.design.model_dump(mode="json", by_alias=True)

    def _titles(self) -> dict[str, str]:
        """What pages call each method."""
        runs, seed = self.plan.runs, self.design.seeds[0]  # one of each point
        found = (
            build.method_facts(runs[one.run_id].scenario)
            for one in self.plan.entries
            if one.seed == seed
        )
        return {method["name"]: method["title"] for methods in found for method in methods}

    def _write_about(self) -> None:
        about = {
            "format": FORMAT,
            "sweep": self._settings(),
            "points": self.design.runs // len(self.design.seeds),
            "runs": len(self.plan.runs),
            "titles": self._titles(),
            **provenance.environment(),
        }
        with atomic_write(self.folder / ABOUT) as beside:
            provenance.write_json(beside, about)


def _check(folder: Path) -> None:
    """Raises ``UserError`` unless the folder is new, empty or a sweep's, and can be written."""
    provenance.check_writable(folder)
    problem = ""
    try:
        if folder.is_dir() and any(folder.iterdir()):
            about = provenance.read_json(folder / ABOUT)
            if not isinstance(about, dict) or "sweep" not in about:
                raise ValueError
            if about.get("format") != FORMAT:
                problem = other_format(folder, about.get("format"), FORMAT)
    except (OSError, ValueError, UserError):
        problem = f"{folder}: holds something else than a sweep"
    if problem:
        raise UserError(f"{problem}; choose another --out")
