"""The runs of an evaluation: each is simulated once, whichever readings, variants and sweeps ask for it."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import NamedTuple

from genie_sim.core.object_map import RANGE_60
from genie_sim.core.rules import GenieRules
from genie_sim.paper.facts import of_baselines
from genie_sim.paper.replicate import (
    EVERY_METHOD,
    Job,
    Outcome,
    Progress,
    in_parallel,
    prepare_job,
    run_job,
)


class _Setup(NamedTuple):
    """What a run comes from besides its seed: the world as every method finds it, and how Genie works in it."""

    world: str
    genie: str


Key = tuple[_Setup, int]  # and the seed
MORE = ("keep_tables", "judged", "redefined")  # what a job may want besides


@dataclass
class Runs:
    """Simulates jobs on ``workers`` processes, and remembers what came out.

    Jobs that other settings bring to the same scenario are one run. Of a job that wants Genie alone in a world where
    the baselines have run, their facts are there, too. ``progress`` counts the jobs that were asked for.
    """

    workers: int
    progress: Progress | None = None
    _known: dict[Key, tuple[Job, Outcome]] = field(default_factory=dict)
    _baselines: dict[tuple[str, int], Outcome] = field(default_factory=dict)  # by world and seed

    def __call__(self, jobs: Sequence[Job], what: str) -> list[Outcome]:
        """What came out of each job."""
        missing: dict[Key, Job] = {}
        for job in jobs:
            key = _key(job)
            if key not in self._known or not _covers(self._known[key][0], job):
                missing[key] = _both(missing[key], job) if key in missing else job
        before = len(jobs) - len(missing)

        def tell(done: float, _: float, what: str) -> None:
            if self.progress is not None:
                self.progress(before + done, len(jobs), what)

        outcomes = in_parallel(run_job, list(missing.values()), self.workers, tell, what)
        for (key, job), outcome in zip(missing.items(), outcomes, strict=True):
            self._learn(key, job, outcome)
        if not missing:
            tell(0, 0, what)
        return [self._known[_key(job)][1] for job in jobs]

    def has_baselines(self, job: Job) -> bool:
        """Whether the baselines have run in the job's world."""
        setup, seed = _key(job)
        return (setup.world, seed) in self._baselines

    def _learn(self, key: Key, job: Job, outcome: Outcome) -> None:
        place = key[0].world, key[1]
        if job.methods == EVERY_METHOD:
            self._baselines[place] = outcome
        elif place in self._baselines:
            outcome = replace(
                outcome, facts=of_baselines(self._baselines[place].facts) | outcome.facts
            )
        self._known[key] = job, outcome


def _covers(done: Job, job: Job) -> bool:
    """Whether a job gave all that another of the same setup and seed asks for."""
    return {*job.methods} <= {*done.methods} and all(
        getattr(done, name) >= getattr(job, name) for name in MORE
    )


def _both(one: Job, other: Job) -> Job:
    """One run for two jobs of the same setup and seed."""
    methods = max(one.methods, other.methods, key=len)
    return replace(
        one, methods=methods, **{name: getattr(one, name) or getattr(other, name) for name in MORE}
    )


def _key(job: Job) -> Key:
    return _setup(job.scenario, job.settings), job.seed


@cache
def _setup(scenario: str, settings: tuple[str, ...]) -> _Setup:
    """What a scenario is under these settings, in whatever words. What makes one scenario with one seed makes one with
    every seed: all that a seed decides is where on the street the cars begin, and what is random."""
    prepared = prepare_job(Job(scenario, 1, settings))
    world = prepared.scenario.model_dump_json(exclude={"genie", "methods"})
    seen = prepared.frames.digests()
    digests = [seen[car] for car in prepared.drives]
    return _Setup(
        hashlib.sha256(f"{world} {digests}".encode()).hexdigest(),
        str(_in_numbers(prepared.scenario.genie)),
    )


def _in_numbers(rules: GenieRules) -> GenieRules:
    """The same rules, C_T as the number that a word stands for."""
    if rules.object_map.threshold != "range_60":
        return rules
    return replace(rules, object_map=replace(rules.object_map, threshold=RANGE_60))
