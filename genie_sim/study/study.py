"""Runs a sweep, or what is missing of it, and makes its tables, figures and page once every run is
there.
"""

import hashlib
import json
import logging
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from genie_sim.analysis import metrics, registry, renderers
from genie_sim.analysis.seed_runs import SWEEP_FILE, load_seeds, read_about
from genie_sim.base.errors import UserError
from genie_sim.base.paths import atomic_write, usable
from genie_sim.base.progress import Progress
from genie_sim.base.settings import plain_data
from genie_sim.record import folders, provenance
from genie_sim.report import pages, template
from genie_sim.report.output import DEFAULT_OUTPUT, SHOWN, Output
from genie_sim.scenario.scenario import Scenario
from genie_sim.study import tables
from genie_sim.study.design import Design
from genie_sim.study.plan import Plan, plan
from genie_sim.study.work import Parts

log = logging.getLogger(__name__)
TABLES = ("runs.parquet", "table.parquet")
# besides the parts
RESULTS = (*TABLES, "table.csv", "summary.md")


class UnfinishedError(UserError):
    """Other shards of a study have not run yet."""


@dataclass
class Study:
    """A sweep in its folder, ``out/<name>``. Runs that are in the folder, from whichever sweep, are
    not run again. ``label`` is what the user calls it, or empty; ``methods`` are those that every
    point is run with, none for those of its scenario.
    """

    design: Design
    folder: Path
    plan: Plan
    label: str = ""
    methods: Sequence[str] = ()

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
        check_folder(out / design.name)
        planned = plan(design, where, progress, base=base, methods=methods, reports=reports)
        study = cls(design, out / design.name, planned, label, methods)
        study._find_place()
        return study

    def _find_place(self) -> None:
        """Another sweep that is finished keeps its folder: this one goes to one of its own, with
        the runs that both have. Raises ``UserError``.
        """
        earlier, self.folder = self.folder, folder_of(self.folder, self.plan)
        if self.folder != earlier:
            self._parts.borrow(Parts(earlier), self.plan.runs)

    def run(
        self,
        jobs: int,
        shard: tuple[int, int] = (1, 1),
        progress: Progress | None = None,
    ) -> None:
        """Runs what is missing of a shard ``(i, n)``, in so many processes. Raises ``UserError``;
        where runs failed, when all others are done.
        """
        self._find_place()
        number, shards = shard
        of_shard = set(sorted(self.plan.runs)[number - 1 :: shards])
        runs = [run for run_id, run in self.plan.runs.items() if run_id in of_shard]
        incomplete = [run.run_id for run in runs if not run.is_kept(self.folder)]
        self._parts.done(self.plan.runs)  # parts that cannot be read are refused before tables go
        is_same = not incomplete and self._is_as_written()
        names = (*RESULTS, *(() if is_same else SHOWN))
        replaced = [provenance.contained(self.folder, name) for name in names]
        for path in replaced:  # all of them, before the first is removed
            if path.exists() and not path.is_file():
                raise UserError(f"{path}: no file of a sweep, which would replace it: move it away")
        with usable(self._parts.parts):
            self._parts.parts.mkdir(parents=True, exist_ok=True)
        self._write_about()
        for path in replaced:  # of fewer points or seeds
            folders.keep_edited(path)
            path.unlink(missing_ok=True)
        self._parts.run(runs, jobs, progress, incomplete)

    def finish(self, output: Output = DEFAULT_OUTPUT) -> None:
        """Makes the tables and what ``output`` says. Raises ``UserError``: ``UnfinishedError``
        where runs are missing.
        """
        self._find_place()  # another sweep of this name may have ended in the meantime
        kept_ids = {run_id for run_id, run in self.plan.runs.items() if run.is_kept(self.folder)}
        done, runs = len(self._parts.done(kept_ids)), len(self.plan.runs)
        if done < runs:
            text = f"{done:,} of {runs:,} runs are in {self.folder}; the last shard makes the table"
            raise UnfinishedError(text)
        self._write()
        if not self.design.axes:
            self._show_seeds(output)
        elif output.page:
            self._draw()

    def _show_seeds(self, output: Output) -> None:
        """Writes what ``output`` says of runs of several seeds, and pages that single ones lack."""
        from genie_sim.analysis.figures import makers

        runs = load_seeds(self.folder)
        with folders.derived(self.folder) as attempt:
            for run in runs.runs if output.page else ():
                if run.folder is not None and not (page := run.folder / template.NAME).exists():
                    with attempt(str(page.relative_to(self.folder))):
                        template.write(page, pages.of_run(run, makers(run)))
            output.make(runs, self.folder, attempt)

    @property
    def _parts(self) -> Parts:
        return Parts(self.folder)

    def _is_as_written(self) -> bool:
        """Whether the folder has the tables of these very runs, under this label: then its page and
        its figures show them.
        """
        try:
            about = read_about(self.folder)
            digests = provenance.digests(self.folder, TABLES)
        except UserError:
            return False
        state = about.get("digests"), about.get("label", "")
        return state == (digests, self.label) and {*about["run_ids"]} == self.plan.runs.keys()

    def _write(self) -> None:
        """Writes the tables."""
        columns = list(self.design.columns.values())
        runs = tables.of_runs(self.plan.entries, columns, self._parts.read(self.plan.runs.keys()))
        about = json.dumps({"sweep": self._settings()}, sort_keys=True).encode()
        tables.write_parquet(runs, self.folder / "runs.parquet", about)
        table = tables.of_points(runs, columns, self._words)
        tables.write_parquet(table, self.folder / "table.parquet", about)
        with atomic_write(self.folder / "table.csv") as beside:
            beside.write_text(renderers.csv_of_table(table), encoding="utf-8")
        self._write_about()  # another sweep of this name may have begun in the meantime
        self._parts.tidy()

    def _draw(self) -> None:
        from genie_sim.analysis.figures import save_all
        from genie_sim.study.sweep import Sweep

        with folders.derived(self.folder) as attempt, attempt("figures"):
            folder = provenance.contained(self.folder, "figures")
            save_all(Sweep.read(self.folder).figures(), folder, ("svg", "png"))

    def _settings(self) -> dict[str, object]:
        plain: dict[str, object] = plain_data(self.design)
        return plain

    @cached_property
    def _words(self) -> registry.Words:
        """What metrics of the user's own say of themselves."""
        own = [name for run in self.plan.runs.values() for name in run.scenario.metrics]
        return metrics.words_of_code(dict.fromkeys(own))

    def _facts(self) -> dict[str, dict[str, Any]]:
        """Of each method what it is called, and whether it is a baseline."""
        runs, seed = self.plan.runs, self.design.seeds[0]  # one of each point
        scenarios = (
            runs[entry.run_id].scenario for entry in self.plan.entries if entry.seed == seed
        )
        return {
            entry.name: entry.facts(method)
            for scenario in scenarios
            for entry, method in zip(scenario.methods, scenario.new_methods().values(), strict=True)
        }

    def _write_about(self) -> None:
        of_methods = self._facts()
        table_names = [name for name in TABLES if (self.folder / name).is_file()]
        about = {
            "format": provenance.RESULT_FORMAT,
            **({"label": self.label} if self.label else {}),
            "sweep": self._settings(),
            "points": self.design.runs // len(self.design.seeds),
            "runs": len(self.plan.runs),
            "run_ids": sorted(self.plan.runs),
            "methods": list(self.methods),
            "titles": {name: facts["title"] for name, facts in of_methods.items()},
            "baselines": [name for name, facts in of_methods.items() if facts["baseline"]],
            "metrics": self._words,
            "digests": provenance.digests(self.folder, table_names),
            **provenance.environment(),
        }
        with atomic_write(self.folder / SWEEP_FILE) as beside:
            provenance.write_json(beside, about, sort_keys=False)  # axes keep their order


def check_folder(folder: Path) -> None:
    """Raises ``UserError`` unless the folder is new, empty or a sweep's, and can be written."""
    folders.check_writable(folder)
    problem = ""
    try:
        if folder.is_dir() and any(folder.iterdir()):
            read_about(folder)
    except (OSError, UserError) as error:
        is_sweep = (folder / SWEEP_FILE).is_file()
        problem = str(error) if is_sweep else f"{folder}: holds something else than a sweep"
    if problem:
        raise UserError(f"{problem}; choose another --out")


def folder_of(folder: Path, planned: Plan) -> Path:
    """The folder, unless it has tables of a run that is not planned: a sweep goes on there, or
    grows. Another one has a folder of its own beside it, so that nothing is overwritten. Raises
    ``UserError``.
    """
    if not (folder / SWEEP_FILE).exists():
        return folder
    about = read_about(folder)
    if not about.get("digests") or {*about["run_ids"]} <= planned.runs.keys():
        return folder
    digest = hashlib.sha256(" ".join(sorted(planned.runs)).encode()).hexdigest()[:8]
    other = folder.with_name(f"{folder.name}-{digest}")
    check_folder(other)
    log.warning("%s: holds another sweep; this one is in %s", folder, other)
    return other
