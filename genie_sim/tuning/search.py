"""A search in its folder: points, then the report on the held-out set."""

import contextlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from genie_sim import build, report
from genie_sim.errors import UserError
from genie_sim.parallel import workers_here
from genie_sim.paths import atomic_write, locked, usable
from genie_sim.perception.sources import Progress
from genie_sim.recording import provenance
from genie_sim.scenario.scenario import load_scenario
from genie_sim.settings import plain_data
from genie_sim.study.parts import Parts
from genie_sim.study.tables import write_csv, write_parquet
from genie_sim.study.tasks import DaskWorkers, LocalWorkers
from genie_sim.tuning import tables
from genie_sim.tuning.design import SearchDesign
from genie_sim.tuning.evaluation import Candidate, DesignRuns, Plans, ScenarioPlans
from genie_sim.tuning.front import means, replicates
from genie_sim.tuning.picks import Pick, picks
from genie_sim.tuning.searcher import (
    ROWS,
    STORAGES,
    MethodSearch,
    check_identity,
    open_storage,
    readable,
)
from genie_sim.tuning.tables import Reported
from genie_sim.version import VERSION

if TYPE_CHECKING:
    import pandas as pd

FORMAT = 1
ABOUT = "search.json"
TABLES = ("points", "designs", "differences", "importance")
# of earlier answers
RESULTS = (*(f"{name}.*" for name in TABLES), "designs/*.yaml", "figures/*", "report.html")


@dataclass(frozen=True)
class SearchStatus:
    """What there is: the folder, how many points there are to try, and how many have been tried."""

    folder: Path
    points: int
    tried: int
    picks: Sequence[Pick] = ()

    @property
    def complete(self) -> bool:
        return self.tried >= self.points


class Search:
    """A search in its folder, ``out/<name>``. What is in the folder is not done again.

    Parameters
    ----------
    design : SearchDesign
        What is searched.
    out : Path
        The folder that gets the search's folder.
    storage : str
        ``journal`` or ``sqlite``: where points are kept.
    plans : Plans, optional
        What makes runs of designs; by default the scenario.

    Raises
    ------
    UserError
        For a design that does not fit the scenario, and for a folder of something else.
    """

    def __init__(
        self, design: SearchDesign, out: Path, storage: str = "journal", plans: Plans | None = None
    ) -> None:
        self.design = design
        self.folder = out / design.name
        self.parts = Parts(self.folder)
        if plans is None:
            plans = ScenarioPlans(design)
            plans.check()
        self.plans = plans
        self._storage = storage
        _check(self.folder)

    @cached_property
    def searches(self) -> list[MethodSearch]:
        """Of each method. Raises ``UserError`` for the storage of another search."""
        with usable(self.folder):
            self.parts.parts.mkdir(parents=True, exist_ok=True)
        storage = open_storage(self.folder, self._storage)
        searches = []
        for method, space in self.design.methods.items():
            with readable(self.folder / STORAGES[self._storage]):
                search = MethodSearch(self.design, method, storage)
            identity = self.design.identity() | {"methods": plain_data(space)}
            check_identity(search.study, {**identity, "genie_sim": VERSION}, self.folder)
            searches.append(search)
        return searches

    def run(
        self,
        workers: LocalWorkers | DaskWorkers | None = None,
        shard: tuple[int, int] = (1, 1),
        progress: Progress | None = None,
    ) -> None:
        """Tries the points of a shard ``(i, n)`` that are missing. Raises ``UserError``, also while
        another process runs the same shard.
        """
        with self._turn(shard):
            evaluation = self._evaluation(workers)
            total = self.design.points * len(self.searches)
            for search in self.searches:
                search.shard = shard
                search.run(evaluation, lambda _, method: self._tell(progress, total, method))

    def finish(
        self,
        workers: LocalWorkers | DaskWorkers | None = None,
        progress: Progress | None = None,
        pictures: bool = True,
    ) -> SearchStatus:
        """Runs the front on the held-out set, and writes tables, designs, and with ``pictures``
        figures and page, if all points have been tried. Raises ``UserError``.
        """
        points = self.design.points * len(self.searches)
        if not all(search.is_finished for search in self.searches):
            return SearchStatus(self.folder, points, self._tried)
        reported = self._report(self._evaluation(workers), progress)
        with usable(self.folder):
            for pattern in RESULTS:
                for path in self.folder.glob(pattern):
                    path.unlink()
            chosen, written = self._write(reported)
            if pictures:
                self._draw(written)
        self.parts.tidy()
        return SearchStatus(self.folder, points, self._tried, chosen)

    @property
    def _tried(self) -> int:
        return sum(min(search.finished, self.design.points) for search in self.searches)

    def _tell(self, progress: Progress | None, total: int, method: str) -> None:
        if progress is not None:
            progress(self._tried, total, method)

    def _evaluation(self, workers: LocalWorkers | DaskWorkers | None) -> DesignRuns:
        here = LocalWorkers(workers_here()) if workers is None else workers
        return DesignRuns(self.design.targets, self.plans, self.parts, here)

    @contextlib.contextmanager
    def _turn(self, shard: tuple[int, int]) -> Iterator[None]:
        """Holds the lock of a shard."""
        name = "{}-of-{}".format(*shard)
        folder = self.folder / "shards" / name
        with usable(self.folder):
            folder.mkdir(parents=True, exist_ok=True)
        with contextlib.ExitStack() as stack:
            try:
                stack.enter_context(locked(folder, wait=False))
            except BlockingIOError:
                raise UserError(f"{self.folder}: another process runs shard {name}") from None
            except OSError:
                pass  # a file system without locks
            with usable(self.folder):
                self._write_about()
            yield

    def _report(self, evaluation: DesignRuns, progress: Progress | None) -> list[Reported]:
        """The designs of every front, run on the held-out set; first the methods of the scenario as
        they are.
        """
        part = self.design.held_out
        references = self.plans.references() if isinstance(self.plans, ScenarioPlans) else []
        chosen: list[tuple[Candidate, Any]] = [
            (Candidate(name, "", {}), None) for name in references
        ]
        for search in self.searches:
            front = search.front()
            chosen += [
                (
                    search.candidate(trial.number, search.values(trial)),
                    means(trial.user_attrs[ROWS]),
                )
                for trial in front
            ]
        if all(tuning is None for _, tuning in chosen):
            raise UserError(f"{self.folder}: {self._why_none()}")
        if progress is not None:
            progress(self._tried, self._tried, f"reporting {len(chosen)} designs")
        rows = evaluation.measure([candidate for candidate, _ in chosen], part, part.cases)
        reported = []
        for (candidate, tuning), of_cases in zip(chosen, rows, strict=True):
            if isinstance(of_cases, str):
                raise UserError(f"{self.folder}: {candidate.name}: on the held-out set: {of_cases}")
            reported.append(Reported(candidate, tuning, replicates(of_cases, part)))
        return reported

    def _why_none(self) -> str:
        """Why no point is on a front."""
        states = tables.of_points(self.design, self.searches)
        if not (states["state"] == "failed").all():
            texts = " and ".join(constraint.text for constraint in self.design.constraints)
            return f"none of {len(states)} points keeps {texts}; see points.csv"
        return f"all {len(states)} points failed; the first: {states['reason'].iloc[0]}"

    def _write(
        self, reported: Sequence[Reported]
    ) -> "tuple[list[Pick], Mapping[str, pd.DataFrame]]":
        """The tables, the designs in words, and what the folder says of itself."""
        from genie_sim.tuning.importance import importance

        described = {"search": plain_data(self.design), "format": FORMAT}
        about = json.dumps(described, sort_keys=True).encode()
        written: Mapping[str, pd.DataFrame] = {
            "points": tables.of_points(self.design, self.searches),
            "designs": tables.of_designs(self.design, self.searches, reported),
            "differences": tables.of_differences(self.design, reported),
            "importance": importance(self.design, self.searches),
        }
        for name, table in written.items():
            write_parquet(table, self.folder / f"{name}.parquet", about)
            write_csv(table, self.folder / f"{name}.csv")
        chosen = picks(self.design, reported)
        if isinstance(self.plans, ScenarioPlans):
            self._write_designs(self.plans, chosen)
        self._write_about(chosen)
        return chosen, written

    def _write_designs(self, plans: ScenarioPlans, chosen: Sequence[Pick]) -> None:
        """A scenario that ``run`` takes for each design in words."""
        folder = self.folder / "designs"
        folder.mkdir(exist_ok=True)
        part = self.design.held_out
        drive = next(iter(part.drives))
        for pick in chosen:
            scenario = plans.scenario(pick.candidate, part, drive)
            with atomic_write(folder / f"{pick.file}.yaml") as beside:
                beside.write_text(scenario.to_yaml(), encoding="utf-8")

    def _draw(self, written: "Mapping[str, pd.DataFrame]") -> None:
        """Figures and page."""
        from genie_sim.analysis import figures as of_runs
        from genie_sim.tuning import figures, page

        (self.folder / "figures").mkdir(exist_ok=True)
        drawn = figures.of_search(
            self.design, written["designs"], written["importance"], self._titles()
        )
        for name, figure in drawn:
            of_runs.save(figure, self.folder / "figures", name)
        report.write_text(self.folder / report.NAME, page.page(self.folder))

    def _titles(self) -> dict[str, str]:
        """What figures and pages call each method."""
        if not isinstance(self.plans, ScenarioPlans):
            return {method: method for method in self.design.methods}
        scenario = load_scenario(self.design.scenario)
        titles = {method["name"]: method["title"] for method in build.method_facts(scenario)}
        part = self.design.tuning
        for method in self.design.methods:
            tuned = self.plans.scenario(
                Candidate(method, method, {}), part, next(iter(part.drives))
            )
            titles[method] = build.method_facts(tuned)[0]["title"]
        return titles

    def _write_about(self, chosen: Sequence[Pick] = ()) -> None:
        parts = (self.design.tuning, self.design.held_out)
        written = [f"{name}.parquet" for name in TABLES]
        present = [name for name in written if (self.folder / name).is_file()]
        about = {
            "format": FORMAT,
            "search": plain_data(self.design),
            "seeds": {"tuning": parts[0].seeds, "held_out": parts[1].seeds},
            "drives": {"tuning": list(parts[0].drives), "held_out": list(parts[1].drives)},
            "tried": self._tried,
            "titles": self._titles(),
            "picks": [pick.plain() for pick in chosen],
            "digests": provenance.digests(self.folder, present),
            **provenance.environment(),
        }
        with atomic_write(self.folder / ABOUT) as beside:
            provenance.write_json(beside, about)


def _check(folder: Path) -> None:
    """Raises ``UserError`` unless the folder is new, empty or a search's, and can be written."""
    provenance.check_writable(folder)
    with usable(folder, "cannot be read"):
        is_new = not folder.is_dir() or not any(folder.iterdir())
    if is_new:
        return
    try:
        about = provenance.read_json(folder / ABOUT)
        is_search = isinstance(about, dict) and about.get("format") == FORMAT
    except (OSError, ValueError, UserError):
        is_search = False
    if not is_search:
        raise UserError(f"{folder}: holds something else than a search; choose another --out")
