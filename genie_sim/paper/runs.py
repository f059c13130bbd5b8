"""The runs of an evaluation: each is simulated once, whichever readings and variants ask for it."""

import time
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Protocol

from genie_sim.paper.definitions import USUAL, Definitions
from genie_sim.paper.evaluation_run import EVERY_METHOD, KEPT_TABLES, EvaluationRun, SetupKey
from genie_sim.paper.facts import Fact, Facts, of_baselines
from genie_sim.recording import tables
from genie_sim.recording.columns import Columns
from genie_sim.study.parts import Parts, Progress
from genie_sim.study.tasks import LocalWorkers, StudyRun

Key = tuple[SetupKey, int]  # and the seed


@dataclass(frozen=True)
class Outcome:
    """What came out of a run: facts under each of its definitions, and where its tables lie by
    name, if they were kept.
    """

    judged: Mapping[Definitions, Facts]
    paths: Mapping[str, Path] = field(default_factory=dict)

    @property
    def facts(self) -> Facts:
        """With the usual definitions."""
        return self.judged[USUAL]

    def table(self, name: str) -> Columns:
        """A table that was kept. Raises ``UserError`` for one that cannot be read."""
        return tables.read(self.paths[name], KEPT_TABLES[name])


class Simulate(Protocol):
    """Simulates runs; ``what`` they are for is shown beside the progress bar."""

    def __call__(self, runs: Sequence[EvaluationRun], what: str) -> list[Outcome]: ...


def simulate(
    runs: Sequence[EvaluationRun], parts: Parts, workers: int, progress: Progress | None = None
) -> list[Outcome]:
    """What came out of each run, in their order; what is in ``parts`` already is not run again.

    ``progress`` is told how many are done, of how many.
    """
    run_parts(runs, parts, workers, progress)
    keys = [run.judgement_id(definitions) for run in runs for definitions in run.definitions]
    facts = facts_in(parts, keys)
    return [
        Outcome(
            {definitions: facts[run.judgement_id(definitions)] for definitions in run.definitions},
            {name: run.table_path(parts.parts, name) for name in KEPT_TABLES if run.keep_tables},
        )
        for run in runs
    ]


def run_parts(
    runs: Sequence[StudyRun], parts: Parts, workers: int, progress: Progress | None = None
) -> None:
    """Runs what is missing in a folder, in processes on this machine. Raises ``UserError``."""
    parts.parts.mkdir(parents=True, exist_ok=True)
    parts.run(runs, LocalWorkers(workers), progress=progress)


def facts_in(parts: Parts, keys: Collection[str]) -> dict[str, Facts]:
    """The facts that are kept under each of the keys."""
    facts: dict[str, Facts] = {key: {} for key in keys}
    shared: dict[tuple[str, ...], Fact] = {}  # one key for the same fact of all runs
    for rows in parts.columns(keys):
        names = zip(*(rows[field].tolist() for field in Fact._fields), strict=True)
        values = rows.floats("value").tolist()
        for key, name, value in zip(rows["run_id"].tolist(), names, values, strict=True):
            fact = shared.get(name)
            if fact is None:
                fact = shared[name] = Fact(*name)
            facts[key][fact] = value
    return facts


@dataclass
class EvaluationRuns:
    """Simulates runs on ``workers`` processes, and remembers what came out.

    Runs that other settings bring to the same scenario are one. Of a run that wants Genie alone in
    a world where the baselines have run, their facts are there, too. ``progress`` counts the runs
    that were asked for.
    """

    parts: Parts
    workers: int
    progress: Progress | None = None
    _outcomes: dict[Key, tuple[EvaluationRun, Outcome]] = field(default_factory=dict)
    _baselines: dict[tuple[str, int], Outcome] = field(default_factory=dict)  # by world and seed

    def __call__(self, runs: Sequence[EvaluationRun], what: str) -> list[Outcome]:
        """What came out of each run."""
        missing: dict[Key, EvaluationRun] = {}
        for run in runs:
            key = _key(run)
            if key not in self._outcomes or not _covers(self._outcomes[key][0], run):
                missing[key] = _merged(missing[key], run) if key in missing else run
        known = len(runs) - len(missing)

        def tell(done: float, _: float, failed: str) -> None:
            if self.progress is not None:
                self.progress(known + done, len(runs), f"{what} {failed}".rstrip())

        outcomes = simulate(list(missing.values()), self.parts, self.workers, tell)
        for (key, run), outcome in zip(missing.items(), outcomes, strict=True):
            self._remember(key, run, outcome)
        if not missing:
            tell(0, 0, "")
        return [self._outcomes[_key(run)][1] for run in runs]

    def has_baselines(self, run: EvaluationRun) -> bool:
        """Whether the baselines have run in the run's world."""
        setup, seed = _key(run)
        return (setup.world, seed) in self._baselines

    def _remember(self, key: Key, run: EvaluationRun, outcome: Outcome) -> None:
        setup, seed = key
        place = setup.world, seed
        if run.methods == EVERY_METHOD:
            self._baselines[place] = outcome
        elif place in self._baselines:
            baselines = self._baselines[place].judged
            judged = {
                definitions: of_baselines(baselines.get(definitions, {})) | facts
                for definitions, facts in outcome.judged.items()
            }
            outcome = replace(outcome, judged=judged)
        self._outcomes[key] = run, outcome


class BatchProgress:
    """Progress over several batches of runs, in runs; forwards to a progress bar."""

    def __init__(self, total: int, progress: Progress | None) -> None:
        self._total = total
        self._before = 0
        self._progress = progress
        self.began_s = time.perf_counter()

    def __call__(self, done: float, of: float, what: str) -> None:
        if self._progress is not None:
            self._progress(self._before + done, max(self._total, self._before + of), what)
        if done == of:
            self._before += int(of)


def _covers(finished: EvaluationRun, run: EvaluationRun) -> bool:
    """Whether a run gave all that another of the same set-up and seed asks for."""
    return (
        {*run.methods} <= {*finished.methods}
        and {*run.definitions} <= {*finished.definitions}
        and finished.keep_tables >= run.keep_tables
        and finished.judged >= run.judged
    )


def _merged(first: EvaluationRun, second: EvaluationRun) -> EvaluationRun:
    """One run for two of the same set-up and seed."""
    return replace(
        first,
        methods=max(first.methods, second.methods, key=len),
        keep_tables=first.keep_tables or second.keep_tables,
        judged=first.judged or second.judged,
        definitions=tuple(dict.fromkeys((*first.definitions, *second.definitions))),
    )


def _key(run: EvaluationRun) -> Key:
    return run.setup_key, run.seed
