"""What other readings and other values of the open parameters give, on the same seeds as the evaluation itself.

What is known is not run again: an arm whose set-up is that of the evaluation or of another arm has its facts, and
where only Genie's settings differ, the baselines do what they did.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from genie_sim.paper.assumptions import Assumptions
from genie_sim.paper.checks import ALL, BOTH_IMAGES, BOTH_OBJECTS, load_claims
from genie_sim.paper.claims import holds_under
from genie_sim.paper.evidence import Claim, Evidence, interval
from genie_sim.paper.facts import METHODS, Facts, of_baselines
from genie_sim.paper.replicate import Job, Progress, prepare_job, run_jobs

EVERY_METHOD = tuple(method.name for method in METHODS)

Base = Mapping[str, Sequence[Facts]]  # the evaluation's own, by scenario


class Arm(NamedTuple):
    """One other reading, or one value of one parameter; ``plausible``: ``yes``, ``arguable`` or ``no``."""

    name: str
    settings: tuple[str, ...]
    methods: tuple[str, ...]
    plausible: str


class _Setup(NamedTuple):
    """What a run depends on besides scenario and seed."""

    world: str
    genie: str
    methods: tuple[str, ...]


@dataclass(frozen=True)
class Arms:
    """The evidence of each arm, whether each is plausible, and the sweeps as curves.

    ``seeds``: how many each arm has. An arm that sets what the evaluation uses anyway is in the curves only.
    """

    evidence: Mapping[str, Evidence]
    plausible: Mapping[str, str]
    sweeps: Sequence[Mapping[str, Any]]
    seeds: int

    def holding(self, claim: Claim) -> tuple[list[str], int]:
        """The arms under which a claim's test holds, and in how many it could be tried."""
        found = holds_under(claim, self.evidence)
        return [f"{name} (plausible: {self.plausible[name]})" for name, holds in found.items() if holds], len(found)

    def as_json(self) -> dict[str, Any]:
        """For ``sensitivity.json``."""
        found = {claim.id: holds_under(claim, self.evidence) for claim in load_claims()}
        held = {claim: [name for name, holds in of.items() if holds] for claim, of in found.items()}
        variants = {name: one for name, one in self.evidence.items() if "=" not in name}
        return {
            "seeds": self.seeds,
            "sweeps": self.sweeps,
            "variants": {name: _reuse(one) | {"plausible": self.plausible[name]} for name, one in variants.items()},
            "claims_that_hold_under": held,
            "arms_that_try": {claim: len(of) for claim, of in found.items()},
        }


def arms_of(assumptions: Assumptions) -> Iterator[Arm]:
    """Every variant with all methods, every sweep value with Genie alone."""
    for variant in assumptions.variants:
        yield Arm(variant.name, variant.settings, EVERY_METHOD, variant.plausible)
    for sweep in assumptions.sweeps:
        low, high = sweep.plausible
        for value in sweep.values:
            name = f"{sweep.parameter}={value:g}"
            yield Arm(name, (name,), ("genie",), "yes" if low <= value <= high else "no")


def run_arms(
    assumptions: Assumptions, settings: tuple[str, ...], seeds: Sequence[int], base: Base, workers: int,
    progress: Progress | None,
) -> Arms:  # fmt: skip
    """Runs what is not known yet of every arm; ``base`` has the same settings and seeds."""
    arms = list(arms_of(assumptions))
    ours = _setup(Job(ALL[-1], seeds[0], settings))
    setups = {arm.name: _setup(Job(ALL[-1], seeds[0], (*settings, *arm.settings), arm.methods), ours) for arm in arms}
    facts = {ours: base}
    first = {setups[arm.name]: arm for arm in reversed(arms) if setups[arm.name] != ours}
    jobs = [
        Job(scenario, seed, (*settings, *arm.settings), ("genie",) if setup.world == ours.world else arm.methods)
        for setup, arm in first.items()
        for scenario in ALL
        for seed in seeds
    ]
    outcomes = iter(run_jobs(jobs, workers, progress, "other readings"))
    for setup in first:
        facts[setup] = {
            scenario: [
                {**(of_baselines(one) if setup.world == ours.world else {}), **next(outcomes).facts}
                for one in base[scenario]
            ]
            for scenario in ALL
        }
    evidence = {name: Evidence({("base", one): facts[setup][one] for one in ALL}) for name, setup in setups.items()}
    others = {name: one for name, one in evidence.items() if setups[name] != ours}
    return Arms(others, {arm.name: arm.plausible for arm in arms}, _curves(assumptions, settings, evidence), len(seeds))


def _setup(job: Job, ours: _Setup | None = None) -> _Setup:
    """Of a job. Where the world is ours, what all of our methods do is known, once Genie has run."""
    prepared = prepare_job(job)
    scenario = prepared.scenario.model_dump_json(exclude={"genie", "methods"})
    world = f"{scenario} {sorted(prepared.frames.digests().items())}"
    methods = ours.methods if ours is not None and world == ours.world else job.methods
    return _Setup(world, str(prepared.scenario.genie), methods)


def _curves(
    assumptions: Assumptions, settings: tuple[str, ...], evidence: Mapping[str, Evidence]
) -> list[dict[str, Any]]:
    used = dict(setting.split("=", 1) for setting in settings)
    return [
        {
            "parameter": sweep.parameter,
            "title": sweep.parameter.removesuffix("_m").removesuffix("_hz").split(".")[-1].replace("_", " "),
            "unit": sweep.unit,
            "paper": sweep.paper,
            "used": float(used[sweep.parameter]) if sweep.parameter in used else None,
            "points": [{"value": value} | _reuse(evidence[f"{sweep.parameter}={value:g}"]) for value in sweep.values],
        }
        for sweep in assumptions.sweeps
    ]


def _reuse(evidence: Evidence) -> dict[str, tuple[float, float, float]]:
    return {
        "object_reuse": interval(evidence.mean_of(ALL, BOTH_OBJECTS)),
        "image_reuse": interval(evidence.mean_of(ALL, BOTH_IMAGES)),
        "first_answer_ms": interval(evidence.mean_of(ALL, ["first_answer_mean:genie"])),
        "fresh_answer_ms": interval(evidence.mean_of(ALL, ["fresh_answer_mean:genie"])),
    }
