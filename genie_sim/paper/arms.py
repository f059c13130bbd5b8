"""What other readings and other values of the open parameters give, on the same seeds as the
evaluation itself.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

from genie_sim.paper.assumptions import Assumptions
from genie_sim.paper.checks import ALL, BOTH_IMAGES, BOTH_OBJECTS, load_claims
from genie_sim.paper.claims import holds_under
from genie_sim.paper.evaluation_run import EVERY_METHOD, GENIE_ALONE, EvaluationRun
from genie_sim.paper.evidence import BASE, Claim, Evidence, interval
from genie_sim.paper.facts import Fact
from genie_sim.paper.runs import EvaluationRuns


class Arm(NamedTuple):
    """One other reading, or one value of one parameter; ``plausible``: ``yes``, ``arguable`` or
    ``no``.
    """

    name: str
    settings: tuple[str, ...]
    methods: tuple[str, ...]
    plausible: str


@dataclass(frozen=True)
class Arms:
    """The evidence of each arm, whether each is plausible, and the sweeps as curves.

    ``seeds``: how many each arm has. An arm that sets what the evaluation uses anyway is in the
    curves only.
    """

    evidence: Mapping[str, Evidence]
    plausible: Mapping[str, str]
    sweeps: Sequence[Mapping[str, Any]]
    seeds: int

    def holding(self, claim: Claim) -> tuple[list[str], int]:
        """The arms under which a claim's test holds, and in how many it could be tried."""
        outcomes = self._outcomes[claim.id]
        return [
            f"{name} (plausible: {self.plausible[name]})"
            for name, holds in outcomes.items()
            if holds
        ], len(outcomes)

    def as_json(self) -> dict[str, Any]:
        """For ``sensitivity.json``."""
        held = {
            claim: [name for name, holds in outcomes.items() if holds]
            for claim, outcomes in self._outcomes.items()
        }
        variants = {name: evidence for name, evidence in self.evidence.items() if "=" not in name}
        return {
            "seeds": self.seeds,
            "sweeps": self.sweeps,
            "variants": {
                name: _reuse(evidence) | {"plausible": self.plausible[name]}
                for name, evidence in variants.items()
            },
            "claims_that_hold_under": held,
            "arms_that_try": {claim: len(outcomes) for claim, outcomes in self._outcomes.items()},
        }

    @cached_property
    def _outcomes(self) -> dict[str, dict[str, bool]]:
        """Of each claim, whether its test holds under each arm that can try it."""
        return {claim.id: holds_under(claim, self.evidence) for claim in load_claims()}


def arms_of(assumptions: Assumptions) -> Iterator[Arm]:
    """Every variant with all methods, every sweep value with Genie alone."""
    for variant in assumptions.variants:
        yield Arm(variant.name, variant.settings, EVERY_METHOD, variant.plausible)
    for sweep in assumptions.sweeps:
        low, high = sweep.plausible
        for value in sweep.values:
            name = f"{sweep.parameter}={value:g}"
            plausible = "yes" if low <= value <= high else "no"
            yield Arm(name, (name,), GENIE_ALONE, plausible)


def run_arms(
    assumptions: Assumptions, settings: tuple[str, ...], seeds: Sequence[int], runs: EvaluationRuns
) -> Arms:
    """Runs every arm, Genie alone where the evaluation's baselines do what they did."""
    places = [(scenario, seed) for scenario in ALL for seed in seeds]
    ours = runs(
        [EvaluationRun(scenario, seed, settings) for scenario, seed in places], "other readings"
    )
    arms, wanted = list(arms_of(assumptions)), []
    for arm in arms:
        for scenario, seed in places:
            run = EvaluationRun(scenario, seed, (*settings, *arm.settings), arm.methods)
            wanted.append(replace(run, methods=GENIE_ALONE) if runs.has_baselines(run) else run)
    outcomes = runs(wanted, "other readings")
    evidence, others = {}, {}
    for number, arm in enumerate(arms):
        of_arm = outcomes[number * len(places) : (number + 1) * len(places)]
        facts = {place: outcome.facts for place, outcome in zip(places, of_arm, strict=True)}
        evidence[arm.name] = Evidence(
            {(BASE, scenario): [facts[scenario, seed] for seed in seeds] for scenario in ALL}
        )
        if any(outcome is not other for outcome, other in zip(of_arm, ours, strict=True)):
            others[arm.name] = evidence[arm.name]
    return Arms(
        others,
        {arm.name: arm.plausible for arm in arms},
        _curves(assumptions, settings, evidence),
        len(seeds),
    )


def _curves(
    assumptions: Assumptions, settings: tuple[str, ...], evidence: Mapping[str, Evidence]
) -> list[dict[str, Any]]:
    used = dict(setting.split("=", 1) for setting in settings)
    return [
        {
            "parameter": sweep.parameter,
            "title": sweep.parameter.removesuffix("_m")
            .removesuffix("_hz")
            .split(".")[-1]
            .replace("_", " "),
            "unit": sweep.unit,
            "paper": sweep.paper,
            "used": float(used[sweep.parameter]) if sweep.parameter in used else None,
            "points": [
                {"value": value} | _reuse(evidence[f"{sweep.parameter}={value:g}"])
                for value in sweep.values
            ],
        }
        for sweep in assumptions.sweeps
    ]


def _reuse(evidence: Evidence) -> dict[str, tuple[float, float, float]]:
    times = {
        f"{answer}_answer_ms": [Fact(f"{answer}_answer_mean")] for answer in ("first", "fresh")
    }
    facts = {"object_reuse": BOTH_OBJECTS, "image_reuse": BOTH_IMAGES, **times}
    return {name: interval(evidence.mean_of(ALL, averaged)) for name, averaged in facts.items()}
