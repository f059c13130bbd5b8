"""The test of each of the paper's claims: arithmetic on replicated runs, no opinion yet.

A check takes the evidence of any reading and the claim's line, where all thresholds stand.
"""

from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from genie_sim.analysis.genie_metrics import PLACEMENTS
from genie_sim.paper import table1
from genie_sim.paper.evidence import (
    BASE,
    Claim,
    Effect,
    Evidence,
    Finding,
    Values,
    above,
    all_positive,
    below,
    in_every_run,
    matches,
    more,
)
from genie_sim.paper.facts import EARLY_PERCENTILES, Fact, placed
from genie_sim.scenario.profiles import load_profile
from genie_sim.scenario.yaml_input import parse

HO = ("1car_homo", "2car_homo", "3car_homo")
HE = ("1car_hetero", "2car_hetero", "3car_hetero")
ALL = (*HO, *HE)
ALONE = (HO[0], HE[0])
SHARED = (*HO[1:], *HE[1:])  # where there is somebody to share with
PAIRS = tuple(zip(HO, HE, strict=True))
CASE = "case_study"
EARLY = tuple(f"first_answer_p{percent}" for percent in EARLY_PERCENTILES)
# method -> the scenarios in which a car's board, or an equal one, detects
BOARDS = {"local": ALL, "remote": HO}
BASELINES = {"L": "local", "R": "remote"}
BOTH_OBJECTS = tuple(placed("object_reuse", placement) for placement in PLACEMENTS)
BOTH_IMAGES = tuple(placed("image_reuse", placement) for placement in PLACEMENTS)
BOTH_BOOSTS = tuple(placed("confidence_boost", placement) for placement in PLACEMENTS)


def load_claims() -> list[Claim]:
    """The paper's claims, in order."""
    path = Path(__file__).with_name("claims.yaml")
    return [Claim(**line) for line in parse(path.read_text(encoding="utf-8"), str(path))]


def improvements(evidence: Evidence, answer: str = "first") -> dict[str, Values]:
    """1 - mean(DG) / mean(baseline), for 6 scenarios x {L, R}."""
    mean = f"{answer}_answer_mean"
    return {
        f"{scenario} {letter}": 1 - _over(evidence, scenario, Fact(mean), Fact(mean, baseline))
        for scenario in ALL
        for letter, baseline in BASELINES.items()
    }


def _c1(evidence: Evidence, claim: Claim) -> Finding:
    results = np.mean(list(improvements(evidence, "result").values()))
    average = np.mean(list(improvements(evidence).values()), axis=0)
    return matches(claim, average, note=f"results: {100 * results:.0f} %")


def _c2(evidence: Evidence, claim: Claim) -> Finding:
    largest = np.max(list(improvements(evidence).values()), axis=0)
    note = f"largest improvement {100 * np.mean(largest):.1f} %; judged by what is left of the time"
    return matches(claim, 1 - largest, note=note)


def _c3(evidence: Evidence, claim: Claim) -> Finding:
    worst = np.min([evidence.of(s, Fact("under_deadline_share")) for s in ALL], axis=0)
    results = np.min([evidence.of(s, Fact("result_under_deadline_share")) for s in ALL])
    return above(claim, worst, note=f"worst scenario; results: {100 * results:.0f} %")


def _c4(evidence: Evidence, claim: Claim) -> Finding:
    legs: dict[str, dict[str, Effect]] = {"than local": {}, "than remote": {}}
    for scenario in ALL:
        for (letter, baseline), leg in zip(BASELINES.items(), legs.values(), strict=True):
            most = claim.also if (scenario, letter) == (HE[0], "R") else claim.expect
            for part in ("mean", "p95"):
                fact = f"first_answer_{part}"
                ratio = _over(evidence, scenario, Fact(fact), Fact(fact, baseline))
                leg[f"{scenario} {letter} {part}"] = Effect(most - ratio, ratio)
    return all_positive(legs)


def _c8(evidence: Evidence, claim: Claim) -> Finding:
    mean = Fact("first_answer_mean", "remote")
    of_car1 = mean._replace(component="car1")
    legs = {
        "mean over cars": _steps(evidence, HE, mean),
        "the car on the server": {
            f"{step}, car1": effect for step, effect in _steps(evidence, HE, of_car1).items()
        },
    }
    return all_positive(legs, unit="ms")


def _c12(evidence: Evidence, claim: Claim) -> Finding:
    bars = {
        f"{s} {where}": evidence.of(s, placed("object_reuse", where))
        for s in ALL
        for where in PLACEMENTS
    }
    name = max(bars, key=lambda bar: float(np.nan_to_num(bars[bar]).mean()))
    errors = [
        evidence.of(s, placed("object_reuse_high", where)) for s in ALL for where in PLACEMENTS
    ]
    highest = max(float(np.nan_to_num(error).mean()) for error in errors)
    return matches(claim, bars[name], note=f"{name}; highest error bar {highest:.2f}")


def _c16(evidence: Evidence, claim: Claim) -> Finding:
    means = [[evidence.mean_of([s], BOTH_OBJECTS) for s in scenarios] for scenarios in (HO, HE)]
    gaps = [he - ho for ho, he in zip(*means, strict=True)]
    higher = {
        f"{cars} car(s)": more(he, ho) for cars, (ho, he) in enumerate(zip(*means, strict=True), 1)
    }
    growing = {"1 to 2 cars": more(gaps[1], gaps[0]), "2 to 3 cars": more(gaps[2], gaps[1])}
    return all_positive({"higher": higher, "the more so the more cars": growing})


def _c18(evidence: Evidence, claim: Claim) -> Finding:
    return all_positive({"": _more_on("edge", evidence, SHARED, "image_reuse")})


def _c19(evidence: Evidence, claim: Claim) -> Finding:
    stored, reused = (
        {f"{s} {what}": effect for s, effect in _more_on("edge", evidence, ALONE, name).items()}
        for name, what in (("stored_images", "stored"), ("image_reuse", "reuse"))
    )
    return all_positive({"stored": stored, "reused": reused})


def _c20(evidence: Evidence, claim: Claim) -> Finding:
    legs: dict[str, dict[str, Effect]] = {"twice the bar": {}, "above 1 car": {}, "early": {}}
    for scenario in SHARED:
        high = evidence.of(scenario, placed("image_reuse_high", "car"))
        alone = evidence.of(HO[0] if scenario in HO else HE[0], placed("image_reuse_high", "car"))
        bar = evidence.of(scenario, placed("image_reuse", "car"))
        peak_at = evidence.of(scenario, placed("image_peak_at", "car"))
        legs["twice the bar"][f"{scenario} twice the bar"] = more(high, claim.expect * bar)
        legs["above 1 car"][f"{scenario} above 1 car"] = more(high, alone)
        legs["early"][f"{scenario} early"] = Effect(claim.also - peak_at, peak_at)
    return all_positive(legs)


def _c21(evidence: Evidence, claim: Claim) -> Finding:
    legs = {
        f"on {place}s": {
            f"{he} {place} {what}": more(evidence.of(he, fact), evidence.of(ho, fact))
            for ho, he in PAIRS
            for what, fact in (
                ("mean", placed("image_reuse", place)),
                ("highest", placed("image_reuse_high", place)),
            )
        }
        for place in PLACEMENTS
    }
    return all_positive(legs)


def _c28(evidence: Evidence, claim: Claim) -> Finding:
    legs = {
        what: {
            f"{s} {what}": more(
                evidence.mean_of([s], names), evidence.mean_of([s], names, "no_edge_sharing")
            )
            for s in SHARED
        }
        for what, names in (
            ("images", BOTH_IMAGES),
            ("objects", BOTH_OBJECTS),
            ("boost", BOTH_BOOSTS),
        )
    }
    return all_positive(legs)


def _c33(evidence: Evidence, claim: Claim) -> Finding:
    shared, bad = (
        np.sum([evidence.of(s, Fact(name)) for s in (*ALL, CASE)], axis=0)
        for name in ("objects_shared", "unconfident_objects_shared")
    )
    note = f"of {shared.sum():,.0f} shared"
    return in_every_run(claim, bad, at_most=True, unit="objects", note=note)


def _c34(evidence: Evidence, claim: Claim) -> Finding:
    ratio = _over(
        evidence,
        HO[0],
        Fact("late_result_share"),
        Fact("late_result_share", "local"),
        variant="cut_link",
    )
    answered = evidence.of(HO[0], Fact("late_answered_share"), "cut_link")
    return in_every_run(claim, ratio, note=f"any answer: {100 * np.mean(answered):.0f} %")


def _c31(evidence: Evidence, claim: Claim) -> Finding:
    reused = evidence.of(CASE, Fact("object_reuse", component="car2/genie"))
    return all_positive({"": {"car2": Effect(reused, 0 * reused)}})


def _c36(evidence: Evidence, claim: Claim) -> Finding:
    first, second = (Fact("detector_runs", component=lap) for lap in ("lap1", "lap2"))
    ratios = {s: _over(evidence, s, second, first, variant="two_laps") for s in ALONE}
    effects = {s: Effect(claim.expect - ratio, ratio) for s, ratio in ratios.items()}
    return all_positive({"": effects}, note="share of runs saved")


def _c37(evidence: Evidence, claim: Claim) -> Finding:
    by_model = {cell.model: cell for cell in table1.cells() if cell.device == "A4500"}
    small, large = (by_model[model] for model in ("YOLOv8s", "DETR-ResNet-101"))
    right = not any(cell.misprinted or cell.printed_ms != cell.ours_ms for cell in (small, large))
    return _arithmetic(small.speedup, "1", right, f"and {large.speedup:.2f}")


def _c39(evidence: Evidence, claim: Claim) -> Finding:
    cells = table1.cells()
    misprints = [
        f"{cell.model} on {cell.device}: {cell.printed_speedup:.2f} should be {cell.speedup:.2f}"
        for cell in cells
        if cell.misprinted
    ]
    same = len(cells) == 24 and all(cell.printed_ms == cell.ours_ms for cell in cells)
    return _arithmetic(
        len(misprints), "misprints", same and len(misprints) == claim.expect, "; ".join(misprints)
    )


# ``expect``; else effects, above 0
AT_LEAST, AT_MOST = {"C3", "C32", "C34", "C35"}, {"C5", "C9", "C29", "C33"}
Check = Callable[[Evidence, Claim], Finding]
CHECKS: dict[str, Check] = {
    "C1": _c1,
    "C2": _c2,
    "C3": _c3,
    "C4": _c4,
    "C5": lambda e, c: below(
        c, np.max([_ratio(e, s[2], s[0], Fact("first_answer_mean")) for s in (HO, HE)], axis=0)
    ),
    "C6": lambda e, c: _furthest(
        c,
        [_ratio(e, he, ho, Fact("first_answer_mean")) for ho, he in PAIRS],
        "the number of cars furthest from 1",
    ),
    "C7": lambda e, c: _furthest(
        c,
        [_over(e, HE[0], Fact(p, "remote"), Fact(p), variant="ideal_link") for p in EARLY],
        "the percentile furthest from 1",
    ),
    "C8": _c8,
    "C9": lambda e, c: below(
        c,
        np.max(
            [
                e.of(s, Fact("under_deadline_share", method))
                for method, scenarios in BOARDS.items()
                for s in scenarios
            ],
            axis=0,
        ),
        note="the best board and scenario",
    ),
    "C10": lambda e, c: matches(
        c, _ratio(e, HE[0], HO[0], Fact("accelerator_rate", "remote", component="edge1"))
    ),
    "C11": lambda e, c: matches(c, e.mean_of(ALL, BOTH_OBJECTS)),
    "C12": _c12,
    "C13": lambda e, c: matches(c, e.mean_of(ALL, BOTH_OBJECTS) / e.mean_of(ALL, BOTH_IMAGES)),
    "C14": lambda e, c: all_positive({"": _steps(e, HO, *BOTH_OBJECTS, falling=True)}),
    "C15": lambda e, c: all_positive({"": _steps(e, HE, *BOTH_OBJECTS)}),
    "C16": _c16,
    "C17": lambda e, c: all_positive({"": _more_on("car", e, ALONE, "object_reuse")}),
    "C18": _c18,
    "C19": _c19,
    "C20": _c20,
    "C21": _c21,
    "C22": lambda e, c: all_positive({"": _more_on("edge", e, ALL, "confidence_boost")}),
    "C23": lambda e, c: all_positive(_per_car(e, placed("confidence_boost", "edge"))),
    "C24": lambda e, c: matches(
        c,
        np.mean(
            [_ratio(e, he, ho, placed("confidence_boost", "edge")) for ho, he in PAIRS], axis=0
        ),
    ),
    "C25": lambda e, c: all_positive(_per_car(e, placed("stored_confidence", "edge"))),
    "C26": lambda e, c: all_positive(
        {
            "": {
                f"{s} {place}": Effect(
                    e.of(s, placed("confidence_boost", place)),
                    e.of(s, placed("stored_confidence", place)),
                )
                for s in ALL
                for place in PLACEMENTS
            }
        }
    ),
    "C27": lambda e, c: matches(c, e.mean_of(ALL, [Fact("handling_ms")]), unit="ms"),
    "C28": _c28,
    "C29": lambda e, c: below(c, e.of(CASE, Fact("first_answer_p99", component="car2")), "ms"),
    "C30": lambda e, c: matches(
        c,
        _over(
            e,
            CASE,
            Fact("first_answer_mean", component="car2"),
            Fact("first_answer_mean", component="car1"),
        ),
    ),
    "C31": _c31,
    "C32": lambda e, c: above(c, e.mean_of(ALL, [Fact("image_to_objects_bytes", "remote")])),
    "C33": _c33,
    "C34": _c34,
    "C35": lambda e, c: in_every_run(c, e.mean_of(ALL, [Fact("detector_untouched")])),
    "C36": _c36,
    "C37": _c37,
    "C38": lambda e, c: _arithmetic(
        slow := _slowest_ms("yolov8s"), "ms", slow < c.expect, "the slowest device"
    ),
    "C39": _c39,
}


def _ratio(evidence: Evidence, scenario: str, reference: str, fact: Fact) -> Values:
    """A fact in one scenario over the same in another."""
    return evidence.of(scenario, fact) / evidence.of(reference, fact)


def _over(
    evidence: Evidence, scenario: str, fact: Fact, reference: Fact, variant: str = BASE
) -> Values:
    """A fact over another one in the same scenario."""
    return evidence.of(scenario, fact, variant) / evidence.of(scenario, reference, variant)


def _furthest(claim: Claim, ratios: Sequence[Values], note: str) -> Finding:
    """Those whose mean is the furthest from 1 match."""
    return matches(
        claim, max(ratios, key=lambda ratio: abs(float(np.mean(ratio)) - 1.0)), note=note
    )


def _slowest_ms(model: str) -> float:
    """The longest median of the devices in Table I."""
    return max(load_profile(name).median_ns(model) for name in table1.DEVICES.values()) / 1e6


def _steps(
    evidence: Evidence, scenarios: Sequence[str], *facts: Fact, falling: bool = False
) -> dict[str, Effect]:
    """That the mean of the named facts rises, or falls, from 1 to 2 and from 2 to 3 cars."""
    means = [evidence.mean_of([scenario], facts) for scenario in scenarios]
    setting = scenarios[0].removeprefix("1car_")
    return {
        f"{setting} {cars} to {cars + 1} cars": more(*((a, b) if falling else (b, a)))
        for cars, (a, b) in enumerate(pairwise(means), start=1)
    }


def _per_car(evidence: Evidence, fact: Fact) -> dict[str, dict[str, Effect]]:
    """That it rises with each car, with homogeneous and with heterogeneous edges."""
    return {
        "homogeneous": _steps(evidence, HO, fact),
        "heterogeneous": _steps(evidence, HE, fact),
    }


def _more_on(
    place: str, evidence: Evidence, scenarios: Sequence[str], name: str
) -> dict[str, Effect]:
    """That it is larger on edges than on cars, or the other way round, by scenario."""
    there, elsewhere = sorted(
        (placed(name, where) for where in PLACEMENTS), key=lambda fact: fact.placement != place
    )
    return {s: more(evidence.of(s, there), evidence.of(s, elsewhere)) for s in scenarios}


def _arithmetic(value: float | None, unit: str, holds: bool, note: str) -> Finding:
    return Finding(value, None, None, n=1, unit=unit, holds=holds, direction=False, note=note)
