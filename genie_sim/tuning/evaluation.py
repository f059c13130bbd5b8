"""From designs to runs, and from runs to the numbers that a search goes by."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple, Protocol

from genie_sim.errors import UserError, unknown
from genie_sim.scenario.scenario import Scenario, load_scenario, with_methods
from genie_sim.study.parts import Parts
from genie_sim.study.plan import SharedFrames, runs_of
from genie_sim.study.tasks import DaskWorkers, LocalWorkers, Shared, StudyRun
from genie_sim.tuning.design import Case, Part, SearchDesign, Target
from genie_sim.tuning.space import Values, as_json

if TYPE_CHECKING:
    import pandas as pd

Row = tuple[float, ...]  # a number for each target; nan where it is not defined


class Candidate(NamedTuple):
    """A design: a method with a value for each parameter that counts.

    ``method`` is the name of a space, or empty for a method of the scenario as it is, which
    ``name`` then is the name of.
    """

    name: str
    method: str
    values: Values


class Plans(Protocol):
    """What makes runs of candidates."""

    def runs(
        self, candidate: Candidate, part: Part, cases: Sequence[Case]
    ) -> Mapping[Case, StudyRun]:
        """A run for each case. Raises ``UserError`` for a design that cannot be run."""

    @property
    def shared(self) -> Shared:
        """The frames that runs name by their keys."""


@dataclass
class ScenarioPlans:
    """Runs of the scenario of a search."""

    design: SearchDesign
    world: SharedFrames = field(default_factory=SharedFrames)

    @property
    def shared(self) -> Shared:
        return self.world.frames

    def runs(
        self, candidate: Candidate, part: Part, cases: Sequence[Case]
    ) -> Mapping[Case, StudyRun]:
        runs: dict[Case, StudyRun] = {}
        for drive in dict.fromkeys(case.drive for case in cases):
            seeds = [case.seed for case in cases if case.drive == drive]
            prepared = self.world.prepare(self.scenario(candidate, part, drive))
            for seed, run in zip(seeds, runs_of(prepared, seeds, candidate.name), strict=True):
                runs[Case(drive, seed)] = run
        return runs

    def scenario(self, candidate: Candidate, part: Part, drive: str) -> Scenario:
        """The scenario of a design on one drive. Raises ``UserError``."""
        fixed = self.design.settings | part.drives[drive]
        if candidate.method:
            space = self.design.methods[candidate.method]
            overrides = space.overrides(candidate.method, candidate.values, fixed)
            return load_scenario(self.design.scenario, overrides)
        shared = {path: value for path, value in fixed.items() if not path.startswith("method.")}
        overrides = tuple(f"{path}={as_json(value)}" for path, value in shared.items())
        scenario = load_scenario(self.design.scenario, overrides)
        return with_methods(scenario, [candidate.name])

    def references(self) -> list[str]:
        """The methods of the scenario, which are reported as they are."""
        return [entry.name for entry in load_scenario(self.design.scenario).methods]

    def check(self) -> None:
        """Every value of every list, and the ends of every range, make a scenario. Raises
        ``UserError`` naming method and parameter.
        """
        part = self.design.tuning
        for name in self.references():
            for drive in part.drives:
                self.world.prepare(self.scenario(Candidate(name, "", {}), part, drive))
        for name, space in self.design.methods.items():
            for parameter, values in space.samples(self.design.settings):
                try:
                    for drive in part.drives:
                        candidate = Candidate(name, name, values)
                        self.world.prepare(self.scenario(candidate, part, drive))
                except UserError as error:
                    text = str(error).removeprefix("--set ")
                    raise UserError(
                        f"{self.design.name}: methods.{name}.space.{parameter}: {text}"
                    ) from error


@dataclass
class DesignRuns:
    """Simulates designs, each run once, and reads their numbers."""

    targets: Sequence[Target]
    plans: Plans
    parts: Parts
    workers: LocalWorkers | DaskWorkers
    _rows: dict[str, Row] = field(default_factory=dict)  # by run

    def measure(
        self, candidates: Sequence[Candidate], part: Part, cases: Sequence[Case]
    ) -> list[dict[Case, Row] | str]:
        """For each candidate a row of numbers by case, or why it cannot be run.

        Raises ``UserError`` where a run fails, or where no run records one of the targets.
        """
        planned: list[Mapping[Case, StudyRun] | str] = []
        for candidate in candidates:
            try:
                planned.append(self.plans.runs(candidate, part, cases))
            except UserError as error:
                planned.append(str(error))
        runs = {
            run.run_id: run
            for by_case in planned
            if not isinstance(by_case, str)
            for run in by_case.values()
        }
        self.parts.run(list(runs.values()), self.workers, self.plans.shared)
        self._read([run_id for run_id in runs if run_id not in self._rows])
        return [
            by_case
            if isinstance(by_case, str)
            else {case: self._rows[run.run_id] for case, run in by_case.items()}
            for by_case in planned
        ]

    def _read(self, run_ids: Sequence[str]) -> None:
        if not run_ids:
            return
        table = self.parts.read(run_ids)
        recorded = table.dropna(subset=["value"])
        by_run: dict[str, dict[Target, float]] = {run_id: {} for run_id in run_ids}
        wanted = recorded[recorded["metric"].isin([target.metric for target in self.targets])]
        columns = ("run_id", "metric", "placement", "component", "value")
        for run_id, metric, placement, component, value in zip(
            *(wanted[name] for name in columns), strict=True
        ):
            by_run[run_id][Target(metric, placement, component)] = value
        for target in self.targets:
            if not any(target in values for values in by_run.values()):
                self._refuse(target, recorded)
        for run_id, values in by_run.items():
            self._rows[run_id] = tuple(values.get(target, math.nan) for target in self.targets)

    def _refuse(self, target: Target, recorded: "pd.DataFrame") -> None:
        """Says where a metric is recorded, or which ones are."""
        own = recorded.loc[recorded["metric"] == target.metric, ["placement", "component"]]
        texts = {Target(target.metric, *place).text for place in own.itertuples(index=False)}
        raise UserError(
            f"objectives: {target.text}: no run records it; "
            + (
                f"{target.metric} is recorded as {', '.join(sorted(texts))}"
                if texts
                else unknown("recorded metric", target.metric, set(recorded["metric"]))
            )
        )
