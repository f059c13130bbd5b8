"""The search of one method: points are proposed by Optuna, simulated, and told to it.

Points are asked for in batches of a fixed size, so the number of processes changes no point; each
point's random numbers come from its number, so a search that was interrupted goes on as it would
have. All that is known is in Optuna's storage and in the parts.
"""

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import optuna
from optuna.distributions import BaseDistribution
from optuna.samplers import BaseSampler, NSGAIISampler, RandomSampler, TPESampler
from optuna.storages import BaseStorage, JournalStorage, RDBStorage
from optuna.storages.journal import JournalFileBackend, JournalFileSymlinkLock
from optuna.study import Study, StudyDirection
from optuna.trial import FrozenTrial, Trial, TrialState

from genie_sim.errors import UserError, as_user_error
from genie_sim.recording import provenance
from genie_sim.seeds import stream
from genie_sim.tuning.design import Case, SearchDesign
from genie_sim.tuning.evaluation import Candidate, DesignRuns, Row
from genie_sim.tuning.front import Table, dominates, is_hopeless, means
from genie_sim.tuning.space import Space, Values, is_active

STORAGES = {"journal": "search.journal", "sqlite": "search.db"}
COMPLETE, PRUNED, FAILED = "complete", "pruned", "failed"
# attributes of a trial, and of a study
SHARD, OUTCOME, REASON, ROWS, IDENTITY = "shard", "outcome", "reason", "rows", "search"

Sampling = Callable[[int], BaseSampler]
SAMPLERS: dict[str, Sampling] = {
    "tpe": lambda seed: TPESampler(seed=seed, group=True, multivariate=True),
    "nsga2": lambda seed: NSGAIISampler(seed=seed, population_size=20),
    "random": lambda seed: RandomSampler(seed=seed),
}


class NumberedSampler(BaseSampler):
    """A sampler whose random numbers depend on the point's number and on the parameter's name only:
    not on what was sampled before in this process.
    """

    def __init__(self, sampling: Sampling, seed: int, method: str) -> None:
        self._sampling = sampling
        self._seed = seed
        self._method = method
        self._of_trial = self._quiet(0)

    def _new(self, number: int, *names: str) -> BaseSampler:
        path: tuple[str | int, ...] = ("search", self._method, number, *names)
        rng = stream(self._seed, *path)
        return self._quiet(int(rng.integers(2**32)))

    def _quiet(self, seed: int) -> BaseSampler:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # parts of Optuna call themselves experimental
            return self._sampling(seed)

    def infer_relative_search_space(
        self, study: Study, trial: FrozenTrial
    ) -> dict[str, BaseDistribution]:
        self._of_trial = self._new(trial.number)
        return self._of_trial.infer_relative_search_space(study, trial)

    def sample_relative(
        self, study: Study, trial: FrozenTrial, search_space: dict[str, BaseDistribution]
    ) -> dict[str, Any]:
        return self._of_trial.sample_relative(study, trial, search_space)

    def sample_independent(
        self,
        study: Study,
        trial: FrozenTrial,
        param_name: str,
        param_distribution: BaseDistribution,
    ) -> Any:
        sampler = self._new(trial.number, param_name)
        return sampler.sample_independent(study, trial, param_name, param_distribution)


def open_storage(folder: Path, kind: str) -> BaseStorage:
    """The storage of a search in its folder. Raises ``UserError`` for one that cannot be read."""
    path = provenance.contained(folder, STORAGES[kind])
    others = [name for name in STORAGES.values() if name != path.name and (folder / name).exists()]
    if others:
        raise UserError(f"{folder}: --storage: this search is stored in {others[0]}")
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    with readable(path):
        if kind == "sqlite":
            from sqlalchemy import URL

            return RDBStorage(URL.create("sqlite", database=str(path)).render_as_string())
        lock = JournalFileSymlinkLock(str(path))
        if path.exists():
            _drop_torn_line(path, lock)
        return JournalStorage(JournalFileBackend(str(path), lock_obj=lock))


def readable(path: Path) -> Any:
    """What Optuna cannot read in a storage becomes a ``UserError``."""
    return as_user_error(f"{path}: not the storage of a search", Exception)


def _drop_torn_line(path: Path, lock: JournalFileSymlinkLock) -> None:
    """Removes the end of a journal whose last line was not written to its end, for want of space or
    of power: what is appended to it could not be read.
    """
    lock.acquire()
    try:
        with path.open("rb+") as file:
            text = file.read()
            whole = text.rfind(b"\n") + 1
            if whole < len(text):
                file.truncate(whole)
    finally:
        lock.release()


@dataclass
class MethodSearch:
    """The search of one method's space.

    Parameters
    ----------
    design : SearchDesign
        The search.
    method : str
        The name of the space.
    storage : BaseStorage
        Where points are kept.
    shard : tuple of int
        ``(i, n)``: this process tries every n-th of the points.
    """

    design: SearchDesign
    method: str
    storage: BaseStorage
    shard: tuple[int, int] = (1, 1)

    def __post_init__(self) -> None:
        sampling = SAMPLERS[self.design.sampler]
        directions = [
            StudyDirection.MAXIMIZE if objective.maximized else StudyDirection.MINIMIZE
            for objective in self.design.objectives.all
        ]
        self.study = optuna.create_study(
            storage=self.storage,
            study_name=self.method,
            directions=directions,
            sampler=NumberedSampler(sampling, self.design.seed, self.method),
            load_if_exists=True,
        )

    @property
    def space(self) -> Space:
        return self.design.methods[self.method]

    def trials(self, *states: TrialState) -> list[FrozenTrial]:
        """Points by number, of all processes."""
        return self.study.get_trials(deepcopy=False, states=states or None)

    @property
    def finished(self) -> int:
        """How many points have been tried."""
        return len(self.trials(TrialState.COMPLETE, TrialState.FAIL))

    @property
    def is_finished(self) -> bool:
        """Whether all points have been tried, by whichever process."""
        return self.finished >= self.design.points

    def run(self, evaluation: DesignRuns, told: Callable[[int, str], None]) -> None:
        """Tries the points of this shard that are missing; ``told`` how many points there are after
        each batch. Raises ``UserError``.
        """
        while batch := self._batch():
            self._try(batch, evaluation)
            told(self.finished, self.method)

    def _batch(self) -> list[Trial]:
        """The points of the batch that is open, asked for where they are missing.

        All points of a batch are asked for before the first is told of, so a batch of which some
        are told of is complete.
        """
        own, size = self._own(), self.design.batch
        number, shards = self.shard
        quota = self.design.points // shards + (number <= self.design.points % shards)
        pending = [trial for trial in own if not trial.state.is_finished()]
        last = own[len(own) // size * size :]
        is_telling = pending and (not last or any(trial.state.is_finished() for trial in last))
        missing = 0 if is_telling else min(size - len(last), quota - len(own))
        # Optuna has no public way from a trial of the storage back to one that can be told of
        trials = [Trial(self.study, trial._trial_id) for trial in pending]
        for _ in range(missing):
            trials.append(self.study.ask())
            trials[-1].set_user_attr(SHARD, list(self.shard))
            self._values(trials[-1])  # before the next one is asked for
        return trials

    def _own(self) -> list[FrozenTrial]:
        """The points of this shard. Alone on the storage, a process takes up what others left."""
        return [
            trial
            for trial in self.trials()
            if self.shard == (1, 1) or trial.user_attrs.get(SHARD) == list(self.shard)
        ]

    def _try(self, trials: Sequence[Trial], evaluation: DesignRuns) -> None:
        """Simulates points, hopeless ones with the first seeds only, and tells of them."""
        part, early = self.design.tuning, self.design.early
        cases = part.cases
        first = [case for case in cases if case.seed in part.seeds[:early]]
        candidates = [self.candidate(trial.number, self._values(trial)) for trial in trials]
        rows = evaluation.measure(candidates, part, first or cases)
        finished = self._finished_rows()
        remaining = [
            place
            for place, of_cases in enumerate(rows)
            if not isinstance(of_cases, str)
            and len(first) < len(cases)
            and not self._is_hopeless(of_cases, finished)
        ]
        complete = evaluation.measure([candidates[place] for place in remaining], part, cases)
        rows = [
            complete[remaining.index(place)] if place in remaining else of_cases
            for place, of_cases in enumerate(rows)
        ]
        for trial, of_cases in zip(trials, rows, strict=True):
            self._tell(trial, of_cases, len(cases))

    def _finished_rows(self) -> list[Table]:
        """Of each point before this batch that was run with all cases and keeps the constraints:
        signed objectives, cases by objectives.
        """
        own = self._own()
        start = own[(len(own) - 1) // self.design.batch * self.design.batch].number
        return [
            self.signed(trial.user_attrs[ROWS])
            for trial in self.trials(TrialState.COMPLETE)
            if trial.number < start
            and trial.user_attrs[OUTCOME] == COMPLETE
            and self.is_feasible(trial)
        ]

    def _is_hopeless(self, of_cases: Mapping[Case, Row], finished: Sequence[Table]) -> bool:
        """Whether the first cases leave a point no hope: an objective is not defined, a constraint
        is broken in each of them, or ``is_hopeless``.
        """
        table = np.array(list(of_cases.values()))
        if np.isnan(table).any():
            return True
        excess = self.excesses(table)
        if excess.size and bool((excess > 0).all(axis=0).any()):
            return True
        return is_hopeless(self.signed(table), finished)

    def _tell(self, trial: Trial, of_cases: Mapping[Case, Row] | str, cases: int) -> None:
        if isinstance(of_cases, str) or np.isnan(list(of_cases.values())).any():
            reason = of_cases if isinstance(of_cases, str) else "an objective is not defined"
            trial.set_user_attr(OUTCOME, FAILED)
            trial.set_user_attr(REASON, reason)
            self.study.tell(trial, state=TrialState.FAIL, skip_if_finished=True)
            return
        table = np.array(list(of_cases.values()))
        trial.set_user_attr(OUTCOME, COMPLETE if len(table) == cases else PRUNED)
        trial.set_user_attr(ROWS, table.tolist())
        mean = means(table)
        excess = self.excesses(mean[None])[0]
        for constraint, value in zip(self.design.constraints, excess, strict=True):
            trial.set_constraint(constraint.text, float(value))
        objectives = [float(value) for value in mean[: len(self.design.objectives.all)]]
        self.study.tell(trial, objectives, skip_if_finished=True)

    def signed(self, rows: Any) -> Table:
        """The objectives of rows, cases by objectives, so that less is better."""
        objectives = self.design.objectives.all
        signs = [objective.sign for objective in objectives]
        return np.asarray(rows, dtype=float)[:, : len(objectives)] * signs

    def excesses(self, rows: Any) -> Table:
        """How far rows are beyond the constraints, cases by constraints."""
        values = np.asarray(rows, dtype=float)[:, len(self.design.objectives.all) :]
        columns = [
            [constraint.excess(value) for value in values[:, place]]
            for place, constraint in enumerate(self.design.constraints)
        ]
        return np.array(columns).reshape(len(columns), len(values)).T

    def is_feasible(self, trial: FrozenTrial) -> bool:
        """Whether a point keeps the constraints, by the mean over its tuning runs."""
        return bool((self.excesses(means(trial.user_attrs[ROWS])[None]) <= 0).all())

    def candidate(self, number: int, values: Values) -> Candidate:
        """The design of a point."""
        return Candidate(f"{self.method}-{number}", self.method, values)

    def _values(self, trial: Trial) -> Values:
        """The values of a point's parameters; those that it does not have yet are drawn."""
        known = self.space.known(self.design.settings)
        values: dict[str, Any] = {}
        for name, parameter in self.space.free(self.design.settings).items():
            if not is_active(parameter, {**known, **values}):
                continue
            span = parameter.range
            if span is None:
                place = trial.suggest_categorical(name, list(range(len(parameter.levels))))
                values[name] = parameter.levels[place]
                continue
            low, high, is_log = span.low.number, span.high.number, span.scale == "log"
            if span.whole:
                values[name] = float(trial.suggest_int(name, int(low), int(high), log=is_log))
            else:
                values[name] = parameter.rounded(trial.suggest_float(name, low, high, log=is_log))
        return values

    def values(self, trial: FrozenTrial) -> Values:
        """The values of the parameters of a point that is known whole."""
        values: dict[str, Any] = {}
        for name, parameter in self.space.free(self.design.settings).items():
            if name in trial.params:
                drawn = trial.params[name]
                values[name] = (
                    parameter.levels[drawn]
                    if parameter.range is None
                    else float(drawn)
                    if parameter.range.whole
                    else parameter.rounded(drawn)
                )
        return values

    def front(self) -> list[FrozenTrial]:
        """The points within the constraints that no other one dominates, by their means over the
        tuning set; of equal designs the first.
        """
        trials = [
            trial
            for trial in self.trials(TrialState.COMPLETE)
            if trial.user_attrs[OUTCOME] == COMPLETE and self.is_feasible(trial)
        ]
        mean = [self.signed(means(trial.user_attrs[ROWS])[None])[0] for trial in trials]
        front = {
            tuple(sorted(self.values(trial).items())): trial
            for trial, own in reversed(list(zip(trials, mean, strict=True)))
            if not any(dominates(other, own) for other in mean)
        }
        return sorted(front.values(), key=lambda trial: trial.number)


def check_identity(study: Study, identity: Mapping[str, Any], where: Path) -> None:
    """Raises ``UserError`` unless the storage is new, or of this very search."""
    stored = study.user_attrs.get(IDENTITY)
    if stored is None and not study.get_trials(deepcopy=False):
        study.set_user_attr(IDENTITY, dict(identity))
        return
    if stored != identity:
        key = _first_difference(stored, identity)
        raise UserError(
            f"{where}: the storage of another search: {key} differs; choose another --out"
        )


def _first_difference(stored: Any, identity: Mapping[str, Any]) -> str:
    if not isinstance(stored, dict):
        return "everything"
    return next(str(key) for key in (*identity, *stored) if stored.get(key) != identity.get(key))
