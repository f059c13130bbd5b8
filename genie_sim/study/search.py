"""A search: Optuna proposes points, they are simulated, and the best are run again on seeds and
drives that the search has not seen.

Nothing of Optuna is stored. A search that goes on asks for the same points again, in batches of a
fixed size, and finds their runs in its folder by ids that name everything that decides a run. So
what was simulated before a scenario or a file was edited is never taken for what comes after.
"""

import hashlib
import logging
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, cast

import optuna
from optuna.samplers import TPESampler
from optuna.trial import Trial, TrialState

from genie_sim.base.errors import UserError, unknown
from genie_sim.base.paths import atomic_write, usable
from genie_sim.base.progress import Progress
from genie_sim.base.settings import plain_data
from genie_sim.record import provenance
from genie_sim.scenario.reading import load_scenario
from genie_sim.scenario.scenario import Scenario
from genie_sim.study import search_report as report
from genie_sim.study.design import Level
from genie_sim.study.parts import Parts
from genie_sim.study.plan import SharedFrames, runs_of
from genie_sim.study.search_design import (
    Parameter,
    Part,
    Point,
    SearchDesign,
    Settings,
    Space,
    Values,
    as_overrides,
    target_of,
)
from genie_sim.study.study import check_folder
from genie_sim.study.tables import write_csv
from genie_sim.study.tasks import DaskWorkers, LocalWorkers, StudyRun

if TYPE_CHECKING:
    import pandas as pd

log = logging.getLogger(__name__)

FORMAT = 2
ABOUT = "search.json"
CHANGED = "the search, its scenario or a file that it uses has changed"

PlannedRuns = list[tuple[int | str, StudyRun]]  # each with its seed or drive


class Search:
    """A search in its folder, ``out/<name>``. Runs that are in the folder are not run again.

    Parameters
    ----------
    design : SearchDesign
        What is searched.
    out : Path
        The folder that gets the search's folder.
    workers : LocalWorkers or DaskWorkers
        What simulates.

    Raises
    ------
    UserError
        For a design that does not fit the scenario, and for a folder of something else.
    """

    def __init__(
        self, design: SearchDesign, out: Path, workers: LocalWorkers | DaskWorkers
    ) -> None:
        self.design = design
        self.folder = out / design.name
        self.studies: dict[str, optuna.Study] = {}
        self._workers = workers
        self._parts = Parts(self.folder)
        self._world = SharedFrames()
        self._points: dict[str, Point] = {}
        check_folder(self.folder, ABOUT, "search", FORMAT)
        self._decided_by = self._check()

    def run(self, progress: Progress | None = None) -> None:
        """Tries the points. Raises ``UserError``."""
        with usable(self.folder):
            self._parts.parts.mkdir(parents=True, exist_ok=True)
            self._tell_of_changes()
            self._write_about()
        points = self.design.points
        for place, (method, space) in enumerate(self.design.methods.items()):
            study = self.studies[method] = _study(self.design, method)
            for tried in range(0, points, self.design.batch):
                if progress is not None:
                    total = points * len(self.design.methods)
                    progress(place * points + tried, total, method)
                with _quiet():
                    self._try(study, space, min(self.design.batch, points - tried))

    def finish(
        self, progress: Progress | None = None, pictures: bool = True
    ) -> "tuple[pd.DataFrame, list[report.Pick]]":
        """Runs the front on the held-out set. Writes the tables, the designs in words, and with
        ``pictures`` the figures; returns the table of designs, and the designs in words. Raises
        ``UserError``, also where the scenario or a file was edited since the search began.
        """
        if self._check() != self._decided_by:
            raise UserError(f"{self.folder}: {CHANGED} while it ran; run the same command again")
        with usable(self.folder):
            for pattern in ("*.csv", "designs/*.yaml", "figures/*"):  # of earlier answers
                for path in self.folder.glob(pattern):
                    path.unlink()
        points = report.of_points(self.studies)
        write_csv(points, self.folder / "points.csv")
        front = self.front()
        if not front:
            raise UserError(f"{self.folder}: {self._why_none(points)}")
        designs = [*self.references(), *front]
        if progress is not None:
            total = len(self._points)
            progress(total, total, f"reporting {len(designs)} designs")
        part = self.design.held_out
        numbers = self.measured({point: self.planned(point, part) for point in designs})
        differences = report.of_differences(numbers)
        table = report.of_designs(self.design, designs, numbers, differences)
        picks = report.picks(self.design, front, table)
        studies = {name: study for name, study in self.studies.items() if study.best_trials}
        with usable(self.folder), _quiet():
            write_csv(table, self.folder / "designs.csv")
            write_csv(differences, self.folder / "differences.csv")
            for pick in picks:
                self._write_design(pick)
            if pictures:
                report.draw(self.design, studies, self.folder / "figures")
            self._write_about(picks)
        self._parts.tidy()
        return table, picks

    def front(self) -> dict[Point, list[float]]:
        """The points within the constraints that no other one of their method dominates, with their
        objectives over the tuning set; of equal designs the first.
        """
        front: dict[tuple[str, str], tuple[Point, list[float]]] = {}
        for method, study in self.studies.items():
            for trial in sorted(study.best_trials, key=lambda trial: trial.number):
                point = self._points[f"{method}-{trial.number}"]
                front.setdefault((method, str(point.values)), (point, trial.values))
        return dict(front.values())

    def references(self) -> list[Point]:
        """The methods of the scenario, which are reported as they are."""
        entries = load_scenario(self.design.scenario).methods
        return [Point(entry.name, "", {}) for entry in entries]

    def planned(self, point: Point, part: Part) -> PlannedRuns:
        """The runs of a point, each with what intervals are over: its drive, or with one drive its
        seed. Raises ``UserError``.
        """
        return [
            (run.scenario.seed if len(part.drives) == 1 else drive, run)
            for drive, settings in part.drives.items()
            for run in runs_of(self.scenario(point, settings), self._world, part.seeds, point.name)
        ]

    def scenario(self, point: Point, of_drive: Settings) -> Scenario:
        """The scenario of a point with the settings of a drive. Raises ``UserError``."""
        fixed = self.design.settings | of_drive
        if point.method:
            space = self.design.methods[point.method]
            overrides = space.overrides(point.method, point.values, fixed)
            return load_scenario(self.design.scenario, overrides)
        of_all = {path: value for path, value in fixed.items() if not path.startswith("method.")}
        return load_scenario(self.design.scenario, as_overrides(of_all), methods=[point.name])

    def measured(self, planned: Mapping[Point, PlannedRuns]) -> "pd.DataFrame":
        """Simulates what is missing. One row per design, run and target: design, seed (or drive),
        run_id, metric (the target), method, placement and component (empty), unit and value. A
        target that is not defined in every run of a design has no rows.

        Raises ``UserError`` where a run fails, or where no run records one of the targets.
        """
        import pandas as pd

        runs = {run.run_id: run for of_point in planned.values() for _, run in of_point}
        self._parts.run(list(runs.values()), self._workers, self._world.frames)
        places = pd.DataFrame(
            [
                (point.name, replicate, run.run_id)
                for point, of_point in planned.items()
                for replicate, run in of_point
            ],
            columns=["design", "seed", "run_id"],
        )
        recorded = self._parts.read(runs.keys())
        keys = zip(recorded["metric"], recorded["placement"], recorded["component"], strict=True)
        named = recorded.assign(
            metric=[target_of(*key) for key in keys], method="", placement="", component=""
        )
        for target in self.design.targets:
            if target not in set(named["metric"]):
                self._refuse(target, sorted(set(named["metric"])))
        wanted = named[named["metric"].isin(self.design.targets)]
        columns = ["run_id", "metric", "method", "placement", "component", "unit", "value"]
        rows = places.merge(wanted[columns], on="run_id")
        defined = rows.groupby(["design", "metric"])["value"].transform("count")
        counts = {point.name: len(of_point) for point, of_point in planned.items()}
        return rows[defined == rows["design"].map(counts)]

    def _refuse(self, target: str, recorded: Sequence[str]) -> None:
        """Says where a metric is recorded, or which ones are."""
        metric = target.partition("/")[0]
        own = [text for text in recorded if text.partition("/")[0] == metric]
        text = (
            f"{metric} is recorded as {', '.join(own)}"
            if own
            else unknown("recorded metric", target, recorded)
        )
        raise UserError(f"objectives: {target}: no run records it; {text}")

    def _check(self) -> str:
        """Prepares points that together use every value of every list, the ends of every range and
        every drive; returns a digest of all that decides their outcome. Raises ``UserError``.
        """
        part = self.design.tuning._replace(seeds=self.design.tuning.seeds[:1])
        references = self.references()
        with self._at("set"):
            planned = [self.planned(point, part) for point in references]
        for drive, settings in self.design.held_out.drives.items():
            with self._at(f"drives.held_out.{drive}"):
                SharedFrames().prepare(self.scenario(references[0], settings))
        for method, space in self.design.methods.items():
            for parameter, values in space.samples(self.design.settings):
                with self._at(f"methods.{method}.space.{parameter}"):
                    planned.append(self.planned(Point(method, method, values), part))
        run_ids = [run.run_id for of_point in planned for _, run in of_point]
        return hashlib.sha256(" ".join(run_ids).encode()).hexdigest()

    @contextmanager
    def _at(self, field: str) -> Iterator[None]:
        """Names a field of the search in front of what is wrong with a setting."""
        try:
            yield
        except UserError as error:
            text = str(error).removeprefix("--set ")
            raise UserError(f"{self.design.name}: {field}: {text}") from error

    def _tell_of_changes(self) -> None:
        """Once, if runs in the folder are of other settings, scenario or files."""
        about = self.folder / ABOUT
        if about.is_file() and provenance.read_json(about).get("decided_by") != self._decided_by:
            log.warning("%s: %s since the last time: points are run anew", self.folder, CHANGED)

    def _try(self, study: optuna.Study, space: Space, count: int) -> None:
        """Asks for points, simulates them on the tuning set, and tells of them."""
        trials: dict[Point, Trial] = {}
        planned: dict[Point, PlannedRuns] = {}
        for trial in [study.ask() for _ in range(count)]:
            values = _drawn(trial, space, self.design.settings)
            point = Point(f"{study.study_name}-{trial.number}", study.study_name, values)
            self._points[point.name] = point
            try:
                planned[point] = self.planned(point, self.design.tuning)
                trials[point] = trial
            except UserError as error:
                _fail(study, trial, str(error))
        if not planned:
            return
        numbers = self.measured(planned)
        for point, trial in trials.items():
            self._tell(study, trial, numbers[numbers["design"] == point.name])

    def _tell(self, study: optuna.Study, trial: Trial, numbers: "pd.DataFrame") -> None:
        """Tells of a point: its means over the tuning set."""
        means = numbers.groupby("metric")["value"].mean()
        undefined = [target for target in self.design.targets if target not in means]
        if undefined:
            _fail(study, trial, f"{undefined[0]} is not defined in every run")
            return
        for constraint in self.design.constraints:
            value = float(means[constraint.target])
            trial.set_user_attr(constraint.target, value)
            trial.set_constraint(constraint.shorten(), constraint.excess(value))
        study.tell(trial, [float(means[target]) for target in self.design.objectives.targets])

    def _why_none(self, points: "pd.DataFrame") -> str:
        """Why no point is on a front."""
        failed = points[points["state"] == "FAIL"]
        if len(failed) == len(points):
            return f"all {len(points)} points failed; the first: {failed['reason'].iloc[0]}"
        texts = " and ".join(constraint.shorten() for constraint in self.design.constraints)
        return f"none of {len(points)} points keeps {texts}; see points.csv"

    def _write_design(self, pick: report.Pick) -> None:
        """A scenario that ``run`` takes."""
        drive = next(iter(self.design.held_out.drives.values()))
        path = self.folder / "designs" / f"{pick.file}.yaml"
        path.parent.mkdir(exist_ok=True)
        with atomic_write(path) as beside:
            text = self.scenario(self._points[pick.design], drive).to_yaml()
            beside.write_text(text, encoding="utf-8")

    def _write_about(self, picks: Sequence[report.Pick] = ()) -> None:
        """What the folder says of itself."""
        about = {
            "format": FORMAT,
            "search": plain_data(self.design),
            "decided_by": self._decided_by,
            "picks": [pick._asdict() for pick in picks],
            **provenance.environment(),
        }
        with atomic_write(self.folder / ABOUT) as beside:
            provenance.write_json(beside, about)


def _study(design: SearchDesign, method: str) -> optuna.Study:
    """An empty study of a method's space."""
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    with _quiet():
        study = optuna.create_study(
            study_name=method,
            directions=["maximize" if sign < 0 else "minimize" for sign in design.objectives.signs],
            sampler=TPESampler(seed=design.seed, group=True, multivariate=True),
        )
        study.set_metric_names(list(design.objectives.targets))
    return study


@contextmanager
def _quiet() -> Iterator[None]:
    """Parts of Optuna warn that they are experimental."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


def _drawn(trial: Trial, space: Space, fixed: Settings) -> Values:
    """The values of a point's parameters, drawn where they are free."""

    def draw(name: str, parameter: Parameter) -> Level:
        column, span = space.column(name), parameter.range
        if span is None:
            return cast(Level, trial.suggest_categorical(column, parameter.levels))
        low, high, is_log = span.low.number, span.high.number, span.scale == "log"
        if span.whole:
            return float(trial.suggest_int(column, int(low), int(high), log=is_log))
        return trial.suggest_float(column, low, high, log=is_log)

    return space.chosen(fixed, draw)


def _fail(study: optuna.Study, trial: Trial, reason: str) -> None:
    trial.set_user_attr("reason", reason)
    study.tell(trial, state=TrialState.FAIL)
