"""Runs a sweep, or what is missing of it, and makes its tables, figures and page once every run is
there.
"""

import itertools
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from genie_sim.analysis import registry
from genie_sim.analysis.seed_runs import load
from genie_sim.base.errors import UserError
from genie_sim.base.paths import atomic_write, usable
from genie_sim.base.progress import Progress
from genie_sim.base.settings import plain_data
from genie_sim.record import provenance
from genie_sim.record.tables import other_format
from genie_sim.report.output import DEFAULT_OUTPUT, Output
from genie_sim.runs.prepare import method_facts, new_methods
from genie_sim.scenario.scenario import Scenario
from genie_sim.study import tables
from genie_sim.study.design import Design
from genie_sim.study.plan import Plan, plan
from genie_sim.study.work import Parts, Workers

if TYPE_CHECKING:
    import pandas as pd

FORMAT = 2
ABOUT = "sweep.json"
TABLES = ("runs.parquet", "table.parquet", "differences.parquet")
# besides the parts
RESULTS = (*TABLES, "table.csv", "differences.csv", "summary.md")
SHOWN = ("figures/*", "report.html")


@dataclass(frozen=True)
class StudyStatus:
    """What there is: the folder, how many points and runs the sweep has, and how many runs are
    done.

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
class Study:
    """A sweep in its folder, ``out/<name>``. Runs that are in the folder, from whichever sweep, are
    not run again. ``label`` is what the user calls it, or empty.
    """

    design: Design
    folder: Path
    plan: Plan
    label: str = ""

    @classmethod
    def of(
        cls,
        design: Design,
        where: str,
        out: Path,
        progress: Progress | None = None,
        *,
        base: Scenario | None = None,
        methods: Sequence[str] = (),
        label: str = "",
        reports: bool = True,
    ) -> "Study":
        """Checks a sweep and its folder. Raises ``UserError``.

        Parameters
        ----------
        design : Design
            The sweep.
        where : str
            Where it comes from, to begin errors with.
        out : Path
            The folder that gets the sweep's folder.
        progress : callable, optional
            Told how many points are checked, of how many.
        base : Scenario, optional
            The scenario that the design names, where that is no file.
        methods : sequence of str
            Only these, at every point; none: those of the scenario.
        label : str
            What the user calls it; may be empty.
        reports : bool
            Whether runs whose results are kept have a page.
        """
        folder = out / design.name
        check_folder(folder)
        planned = plan(design, where, progress, base=base, methods=methods, reports=reports)
        return cls(design, folder, planned, label)

    def run(
        self,
        workers: Workers,
        shard: tuple[int, int] = (1, 1),
        progress: Progress | None = None,
    ) -> None:
        """Runs what is missing of a shard ``(i, n)``. Raises ``UserError``; where runs failed, when
        all others are done.
        """
        number, shards = shard
        of_shard = set(sorted(self.plan.runs)[number - 1 :: shards])
        runs = [run for run_id, run in self.plan.runs.items() if run_id in of_shard]
        lost = [run.run_id for run in runs if not run.is_kept(self.folder)]
        self._parts.done(self.plan.runs)  # parts that cannot be read are refused before tables go
        with usable(self.folder):
            (self.folder / "parts").mkdir(parents=True, exist_ok=True)
            is_same = not lost and not self.design.axes and self._is_as_written()
            self._write_about()
        self._remove(*RESULTS, *(() if is_same else SHOWN))  # of earlier axes or fewer seeds
        self._parts.run(runs, workers, progress, lost)

    def finish(self, output: Output = DEFAULT_OUTPUT) -> StudyStatus:
        """Makes the tables and what ``output`` says, if every run is done. Raises ``UserError``."""
        kept = {run_id for run_id, run in self.plan.runs.items() if run.is_kept(self.folder)}
        done = len(self._parts.done(kept))
        status = StudyStatus(
            self.folder, self.design.runs // len(self.design.seeds), len(self.plan.runs), done
        )
        if status.complete:
            with usable(self.folder):
                runs = self._write()
                if not self.design.axes:
                    output.write(load(self.folder), self.folder)
                elif output.page:
                    self._draw(runs)
        return status

    @property
    def _parts(self) -> Parts:
        return Parts(self.folder)

    def _is_as_written(self) -> bool:
        """Whether the folder has the tables of these very runs, under this label: then its page and
        its figures show them.
        """
        import pandas as pd

        try:
            about = provenance.read_json(self.folder / ABOUT)
            known = provenance.digests(self.folder, TABLES)
            runs = pd.read_parquet(self.folder / "runs.parquet", columns=["run_id"])
        except (UserError, OSError, ValueError):
            return False
        told = about.get("digests"), about.get("label", "")
        return told == (known, self.label) and {*runs["run_id"]} == self.plan.runs.keys()

    def _remove(self, *patterns: str) -> None:
        for path in itertools.chain.from_iterable(map(self.folder.glob, patterns)):
            path.unlink(missing_ok=True)

    def _write(self) -> "pd.DataFrame":
        """The tables; returns that of all runs."""
        columns = list(self.design.columns.values())
        runs = tables.of_runs(self.plan.entries, columns, self._parts.read(self.plan.runs.keys()))
        crossed = [self.design.columns[name] for name in self.design.crossed]
        about = json.dumps({"sweep": self._settings(), "format": FORMAT}, sort_keys=True).encode()
        tables.write_parquet(runs, self.folder / "runs.parquet", about)
        compared = tables.all_differences(runs, columns, crossed)
        for name, table in (("table", tables.of_points(runs, columns)), ("differences", compared)):
            tables.write_parquet(table, self.folder / f"{name}.parquet", about)
            tables.write_csv(table, self.folder / f"{name}.csv")
        self._write_about()  # another sweep of this name may have begun in the meantime
        self._parts.tidy()
        return runs

    def _draw(self, runs: "pd.DataFrame") -> None:
        from genie_sim.analysis import figures as of_runs
        from genie_sim.study import figures, printed

        (self.folder / "figures").mkdir(exist_ok=True)
        titles = printed.unique_titles(self._titles())
        footer = printed.footer_of(self.design, self.label)
        for name, figure in figures.of_sweep(self.design, runs, titles, footer):
            of_runs.save(figure, self.folder / "figures", name)

    def _settings(self) -> dict[str, object]:
        plain: dict[str, object] = plain_data(self.design)
        return plain

    def _titles(self) -> dict[str, str]:
        """What pages call each method."""
        runs, seed = self.plan.runs, self.design.seeds[0]  # one of each point
        scenarios = (
            runs[entry.run_id].scenario for entry in self.plan.entries if entry.seed == seed
        )
        methods_of_points = (method_facts(one, new_methods(one)) for one in scenarios)
        return {
            method["name"]: method["title"] for methods in methods_of_points for method in methods
        }

    def _write_about(self) -> None:
        written = [name for name in TABLES if (self.folder / name).is_file()]
        own = {name: None for run in self.plan.runs.values() for name in run.scenario.metrics}
        about = {
            "format": FORMAT,
            **({"label": self.label} if self.label else {}),
            "sweep": self._settings(),
            "points": self.design.runs // len(self.design.seeds),
            "runs": len(self.plan.runs),
            "titles": self._titles(),
            "metrics": registry.words(registry.with_formulas(own)),
            "digests": provenance.digests(self.folder, written),
            **provenance.environment(),
        }
        with atomic_write(self.folder / ABOUT) as beside:
            provenance.write_json(beside, about)


def check_folder(
    folder: Path, about_name: str = ABOUT, what: str = "sweep", format: int = FORMAT
) -> None:
    """Raises ``UserError`` unless the folder is new, empty or a sweep's (or ``what`` its
    ``about_name`` tells of), and can be written.
    """
    provenance.check_writable(folder)
    problem = ""
    try:
        if folder.is_dir() and any(folder.iterdir()):
            about = provenance.read_json(folder / about_name)
            if not isinstance(about, dict) or what not in about:
                raise ValueError
            if about.get("format") != format:
                problem = other_format(folder, about.get("format"), format)
    except (OSError, ValueError, UserError):
        problem = f"{folder}: holds something else than a {what}"
    if problem:
        raise UserError(f"{problem}; choose another --out")
