"""Verdicts on the paper's claims, and how far they depend on the choice of seeds."""

from collections import Counter
from dataclasses import dataclass, replace

import numpy as np

from genie_sim.base.seeds import stream
from genie_sim.paper.checks import CHECKS, load_claims
from genie_sim.paper.evidence import Claim, Evidence, Finding

RESAMPLES = 200
MARGINAL = 0.05  # share of resamples with another verdict from which on a verdict is marginal

VERDICTS = (
    "reproduced",
    "same direction, other size",
    "not reproduced",
    "not testable here",
    "calibrated",
    "in part",
)
REPRODUCED, DIRECTION, CONTRADICTED, UNTESTED, CALIBRATED, IN_PART = VERDICTS


@dataclass(frozen=True, slots=True)
class Verdict:
    """A claim, what was found, and what we say of it.

    ``marginal``: another set of seeds could say otherwise, as always where there is one seed and so
    no interval. ``same_as``: the claim before it that found the same number, which is counted once.
    """

    claim: Claim
    finding: Finding | None
    verdict: str
    marginal: bool
    same_as: str | None = None


def judge(evidence: Evidence, fitted: bool = True, retrodicted: bool = False) -> list[Verdict]:
    """A verdict of every claim. ``fitted``: to two of them, which are else predictions as any.
    ``retrodicted``: outcomes were in sight when the reading was chosen, so none is a prediction.
    """
    kinds = {} if fitted else {"calibrated": "prediction"}
    found: list[Verdict] = []
    for claim in load_claims():
        kind = kinds.get(claim.kind, claim.kind)
        kind = "retrodicted" if retrodicted and kind == "prediction" else kind
        verdict = judge_one(replace(claim, kind=kind), evidence)
        same = (other.claim.id for other in found if _same_number(other.finding, verdict.finding))
        found.append(replace(verdict, same_as=next(same, None)))
    return found


def _same_number(one: Finding | None, other: Finding | None) -> bool:
    """Whether two findings are one simulated number, to all that seeds say of it. Bounds that are
    met exactly, such as a share of 1, are met by many numbers: these are none.
    """
    if one is None or other is None or one.low is None or other.low is None:
        return False
    mine, its = (np.array([of.value, of.low, of.high], dtype=float) for of in (one, other))
    exact = one.value in (0.0, 1.0)
    return one.unit == other.unit and not exact and bool(np.allclose(mine, its, rtol=1e-6, atol=0))


def judge_one(claim: Claim, evidence: Evidence) -> Verdict:
    """Tests one claim, and once more on resampled seeds to see whether the verdict depends on which
    ones were drawn.
    """
    finding = look(claim, evidence)
    verdict = verdict_of(claim, finding)
    if finding is None:
        return Verdict(claim, None, verdict, False)
    random = stream(0, "claims", claim.id)
    seeds = evidence.seeds
    drawn = (tuple(sorted(random.integers(seeds, size=seeds).tolist())) for _ in range(RESAMPLES))
    others = 0
    # few seeds often give the same
    for places, times in Counter(drawn if finding.n > 1 else ()).items():
        others += times * (verdict_of(claim, look(claim, evidence.resampled(places))) != verdict)
    return Verdict(claim, finding, verdict, finding.one_seed or others > MARGINAL * RESAMPLES)


def verdict_of(claim: Claim, finding: Finding | None) -> str:
    """One of ``VERDICTS``. What was fitted is never called reproduced: it is ``calibrated`` where
    the fit succeeded.
    """
    if finding is None or not finding.known:
        return UNTESTED
    if finding.holds:
        return CALIBRATED if claim.kind == "calibrated" else REPRODUCED
    if claim.kind == "invariant":
        return CONTRADICTED
    if any(leg.holds for leg in finding.legs):
        return IN_PART
    return DIRECTION if finding.direction else CONTRADICTED


def look(claim: Claim, evidence: Evidence) -> Finding | None:
    """What a claim's test finds; ``None`` without a run that it needs."""
    try:
        return CHECKS[claim.id](evidence, claim)
    except KeyError:  # a run that this evaluation did not make
        return None
