"""Verdicts on the paper's claims, and how far they depend on the choice of seeds."""

from collections import Counter
from dataclasses import dataclass, replace

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
)


@dataclass(frozen=True, slots=True)
class Verdict:
    """A claim, what was found, and what we say of it.

    ``marginal``: another set of seeds could say otherwise, as always where there is one seed and so
    no interval.
    """

    claim: Claim
    finding: Finding | None
    verdict: str
    marginal: bool


def judge(evidence: Evidence, fitted: bool = True) -> list[Verdict]:
    """A verdict of every claim. ``fitted``: to two of them, which are else predictions as any."""
    kinds = {} if fitted else {"calibrated": "prediction"}
    claims = (replace(claim, kind=kinds.get(claim.kind, claim.kind)) for claim in load_claims())
    return [judge_one(claim, evidence) for claim in claims]


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
        return VERDICTS[3]
    if finding.holds:
        return VERDICTS[4] if claim.kind == "calibrated" else VERDICTS[0]
    return VERDICTS[1] if finding.direction and claim.kind != "invariant" else VERDICTS[2]


def look(claim: Claim, evidence: Evidence) -> Finding | None:
    """What a claim's test finds; ``None`` without a run that it needs."""
    try:
        return CHECKS[claim.id](evidence, claim)
    except KeyError:  # a run that this evaluation did not make
        return None
