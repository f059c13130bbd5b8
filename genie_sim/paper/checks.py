"""The test of each of the paper's claims: arithmetic on replicated runs, no opinion yet.

All thresholds stand in the claim's line of ``claims.yaml``.
"""

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from genie_sim.analysis.genie_metrics import GENIE_PLACEMENTS
from genie_sim.paper import table1
from genie_sim.paper.claims import (
    Claim,
    Finding,
    all_positive,
    arithmetic,
    full_run,
    in_every_run,
    load_claims,
    matches,
    row,
    within,
)
from genie_sim.paper.evidence import BASE, Effect, Effects, Evidence, Values, more
from genie_sim.paper.numbers import EARLY_PERCENTILES, Number, placed
from genie_sim.scenario.profiles import load_profile

HO = ("1car_homo", "2car_homo", "3car_homo")
HE = ("1car_hetero", "2car_hetero", "3car_hetero")
ALL = (*HO, *HE)
ALONE = (HO[0], HE[0])
SHARED = (*HO[1:], *HE[1:])  # where there is somebody to share with
PAIRS = tuple(zip(HO, HE, strict=True))
CASE = "case_study"
EARLY = tuple(f"first_answer_p{percent}" for percent in EARLY_PERCENTILES)
FIRST = Number("first_answer_mean")
# method -> the scenarios in which a car's board, or an equal one, detects
BOARDS = {"local": ALL, "remote": HO}
BASELINES = {"L": "local", "R": "remote"}
BOTH_OBJECTS = tuple(placed("object_reuse", placement) for placement in GENIE_PLACEMENTS)
BOTH_IMAGES = tuple(placed("image_reuse", placement) for placement in GENIE_PLACEMENTS)
BOTH_BOOSTS = tuple(placed("confidence_boost", placement) for placement in GENIE_PLACEMENTS)
EDGE_BOOST = placed("confidence_boost", "edge")


def judge(evidence: Evidence) -> list[dict[str, Any]]:
    """The row of every claim, in the paper's order."""
    full = full_run()
    return [
        row(claim, finding_of(claim, evidence), full.get(claim.id, "")) for claim in load_claims()
    ]


def finding_of(claim: Claim, evidence: Evidence) -> Finding | None:
    """What a claim's test finds; ``None`` without a run that it needs."""
    try:
        return CHECKS[claim.id](evidence, claim)
    except KeyError:  # a run that this evaluation did not make
        return None


def improvements(evidence: Evidence, answer: str = "first") -> Values:
    """1 - mean(DG) / mean(baseline), a row for each of 6 scenarios x {L, R}."""
    mean = f"{answer}_answer_mean"
    return np.array(
        [
            1 - _over(evidence, scenario, Number(mean), Number(mean, baseline))
            for scenario in ALL
            for baseline in BASELINES.values()
        ]
    )


def _c1(evidence: Evidence, claim: Claim) -> Finding:
    results = np.mean(improvements(evidence, "result"))
    note = f"of results, detected or cached, {100 * results:.0f} %"
    return matches(claim, improvements(evidence).mean(axis=0), note=note)


def _c2(evidence: Evidence, claim: Claim) -> Finding:
    largest = improvements(evidence).max(axis=0)
    return matches(claim, 1 - largest, shown=largest)


def _c3(evidence: Evidence, claim: Claim) -> Finding:
    worst = np.min([evidence.of(s, Number("under_deadline_share")) for s in ALL], axis=0)
    results = np.min([evidence.of(s, Number("result_under_deadline_share")) for s in ALL])
    note = f"of results, detected or cached, {100 * results:.0f} %"
    return within(claim, worst, claim.expect, note=note)


def _c4(evidence: Evidence, claim: Claim) -> Finding:
    effects: dict[str, Effect] = {}
    for scenario in ALL:
        for letter, baseline in BASELINES.items():
            most = claim.also if (scenario, letter) == (HE[0], "R") else claim.expect
            for part in ("mean", "p95"):
                name = f"first_answer_{part}"
                ratio = _over(evidence, scenario, Number(name), Number(name, baseline))
                effects[f"{scenario} {letter} {part}"] = Effect(most - ratio, ratio)
    legs = [
        {name: effect for name, effect in effects.items() if f" {letter} " in name}
        for letter in BASELINES
    ]
    nearest = _over(evidence, HE[0], FIRST, FIRST._replace(method="remote"))
    return all_positive(nearest, *legs)


def _c5(evidence: Evidence, claim: Claim) -> Finding:
    larger = np.max([_ratio(evidence, s[2], s[0], FIRST) for s in (HO, HE)], axis=0)
    return within(claim, larger, high=claim.expect)


def _c6(evidence: Evidence, claim: Claim) -> Finding:
    ratios = [_ratio(evidence, he, ho, FIRST) for ho, he in PAIRS]
    return matches(claim, _furthest(ratios), shown=ratios[-1])


def _c7(evidence: Evidence, claim: Claim) -> Finding:
    ratios = [_over(evidence, HE[0], Number(p, "remote"), Number(p)) for p in EARLY]
    return matches(claim, _furthest(ratios), shown=ratios[-1])


def _c8(evidence: Evidence, claim: Claim) -> Finding:
    mean = FIRST._replace(method="remote")
    of_car1 = mean._replace(component="car1")
    served = {
        f"{step}, the server's car": effect
        for step, effect in _steps(evidence, HE, of_car1).items()
    }
    difference = evidence.of(HE[2], of_car1) - evidence.of(HE[0], of_car1)
    return all_positive(difference, _steps(evidence, HE, mean), served)


def _c9(evidence: Evidence, claim: Claim) -> Finding:
    shares = [
        evidence.of(scenario, Number("under_deadline_share", method))
        for method, scenarios in BOARDS.items()
        for scenario in scenarios
    ]
    return within(claim, np.max(shares, axis=0), high=claim.expect)


def _c12(evidence: Evidence, claim: Claim) -> Finding:
    bars = [
        evidence.of(s, placed("object_reuse", where)) for s in ALL for where in GENIE_PLACEMENTS
    ]
    highest = max(bars, key=lambda bar: float(np.nan_to_num(bar).mean()))
    ends = [
        np.nan_to_num(evidence.of(s, placed("object_reuse_highest", where))).mean()
        for s in ALL
        for where in GENIE_PLACEMENTS
    ]
    return matches(claim, highest, note=f"highest running ratio {100 * max(ends):.0f} %")


def _c14(evidence: Evidence, claim: Claim) -> Finding:
    return _object_trend(evidence, HO, falling=True)


def _c15(evidence: Evidence, claim: Claim) -> Finding:
    return _object_trend(evidence, HE)


def _object_trend(evidence: Evidence, scenarios: Sequence[str], falling: bool = False) -> Finding:
    most, least = (evidence.mean_of([s], BOTH_OBJECTS) for s in (scenarios[2], scenarios[0]))
    return all_positive(most - least, _steps(evidence, scenarios, *BOTH_OBJECTS, falling=falling))


def _c16(evidence: Evidence, claim: Claim) -> Finding:
    means = [[evidence.mean_of([s], BOTH_OBJECTS) for s in scenarios] for scenarios in (HO, HE)]
    gaps = [he - ho for ho, he in zip(*means, strict=True)]
    higher = {
        f"{cars} car{'s' * (cars > 1)}": more(he, ho)
        for cars, (ho, he) in enumerate(zip(*means, strict=True), 1)
    }
    growing = {"1 to 2 cars": more(gaps[1], gaps[0]), "2 to 3 cars": more(gaps[2], gaps[1])}
    return all_positive(gaps[2], higher, growing)


def _c19(evidence: Evidence, claim: Claim) -> Finding:
    stored, reused = (
        {f"{s} {label}": effect for s, effect in _more_on("edge", evidence, ALONE, name).items()}
        for name, label in (("stored_images", "stored"), ("image_reuse", "reuse"))
    )
    return all_positive(_mean_effect(reused), stored, reused)


def _c20(evidence: Evidence, claim: Claim) -> Finding:
    twice: dict[str, Effect] = {}
    above: dict[str, Effect] = {}
    early: dict[str, Effect] = {}
    ratios = []
    for scenario in SHARED:
        high = evidence.of(scenario, placed("image_reuse_highest", "car"))
        first = HO[0] if scenario in HO else HE[0]
        alone = evidence.of(first, placed("image_reuse_highest", "car"))
        bar = evidence.of(scenario, placed("image_reuse", "car"))
        peak_at = evidence.of(scenario, placed("image_peak_at", "car"))
        twice[f"{scenario} twice the mean"] = more(high, claim.expect * bar)
        above[f"{scenario} above 1 car"] = more(high, alone)
        early[f"{scenario} early"] = Effect(claim.also - peak_at, peak_at)
        ratios.append(high / bar)
    return all_positive(np.mean(ratios, axis=0), twice, above, early)


def _c21(evidence: Evidence, claim: Claim) -> Finding:
    legs = [
        {
            f"{he} {place} {label}": more(evidence.of(he, number), evidence.of(ho, number))
            for ho, he in PAIRS
            for label, number in (
                ("mean", placed("image_reuse", place)),
                ("highest", placed("image_reuse_highest", place)),
            )
        }
        for place in GENIE_PLACEMENTS
    ]
    on_edges = {name: effect for leg in legs for name, effect in leg.items() if "edge mean" in name}
    return all_positive(_mean_effect(on_edges), *legs)


def _c23(evidence: Evidence, claim: Claim) -> Finding:
    return _per_car(evidence, EDGE_BOOST)


def _c24(evidence: Evidence, claim: Claim) -> Finding:
    ratios = [_ratio(evidence, he, ho, EDGE_BOOST) for ho, he in PAIRS]
    by_cars = ", ".join(
        f"{cars} car{'s' * (cars > 1)} {np.mean(ratio):.2f}" for cars, ratio in enumerate(ratios, 1)
    )
    return matches(claim, np.mean(ratios, axis=0), note=by_cars)


def _c25(evidence: Evidence, claim: Claim) -> Finding:
    return _per_car(evidence, placed("stored_confidence", "edge"))


def _c26(evidence: Evidence, claim: Claim) -> Finding:
    effects = {
        f"{s} {place}": Effect(
            evidence.of(s, placed("confidence_boost", place)),
            evidence.of(s, placed("stored_confidence", place)),
        )
        for s in ALL
        for place in GENIE_PLACEMENTS
    }
    on_edges = [effect for name, effect in effects.items() if name.endswith("edge")]
    return all_positive(
        np.mean([boost.effect / boost.value for boost in on_edges], axis=0), effects
    )


def _c28(evidence: Evidence, claim: Claim) -> Finding:
    legs = [
        {
            f"{s} {label}": more(
                evidence.mean_of([s], names), evidence.mean_of([s], names, "no_edge_sharing")
            )
            for s in SHARED
        }
        for label, names in (
            ("images", BOTH_IMAGES),
            ("objects", BOTH_OBJECTS),
            ("boost", BOTH_BOOSTS),
        )
    ]
    return all_positive(_mean_effect(legs[1]), *legs)


def _c29(evidence: Evidence, claim: Claim) -> Finding:
    slowest = np.max(evidence.of(CASE, Number("first_answer_max", component="car2")))
    late = evidence.of(CASE, Number("first_answer_p99", component="car2"))
    return within(claim, late, high=claim.expect, note=f"the slowest answer takes {slowest:.0f} ms")


def _c30(evidence: Evidence, claim: Claim) -> Finding:
    mean, median = (
        _over(evidence, CASE, *(Number(name, component=car) for car in ("car2", "car1")))
        for name in ("first_answer_mean", "first_answer_p50")
    )
    return matches(claim, mean, note=f"of medians {np.mean(median):.2f} times")


def _c31(evidence: Evidence, claim: Claim) -> Finding:
    reused = evidence.of(CASE, Number("object_reuse", component="car2/genie"))
    return all_positive(reused, {"car2": Effect(reused, 0 * reused)})


def _c33(evidence: Evidence, claim: Claim) -> Finding:
    shared, faint = (
        np.sum([evidence.of(s, Number(name)) for s in (*ALL, CASE)], axis=0)
        for name in ("objects_shared", "unconfident_objects_shared")
    )
    return in_every_run(claim, faint, at_most=True, note=f"of {shared.sum():,.0f} shared")


def _c34(evidence: Evidence, claim: Claim) -> Finding:
    late = Number("late_result_share")
    ratio = _over(evidence, HO[0], late, late._replace(method="local"), variant="cut_link")
    answered = evidence.of(HO[0], Number("late_answered_share"), "cut_link")
    return in_every_run(claim, ratio, note=f"any answer: {100 * np.mean(answered):.0f} %")


def _c36(evidence: Evidence, claim: Claim) -> Finding:
    first, second = (Number("detector_runs", component=lap) for lap in ("lap1", "lap2"))
    ratios = {s: _over(evidence, s, second, first) for s in ALONE}
    effects = {s: Effect(claim.expect - ratio, ratio) for s, ratio in ratios.items()}
    by_edge = ", ".join(
        f"{scenario} {100 * np.mean(effect.effect):.1f} %" for scenario, effect in effects.items()
    )
    return all_positive(_mean_effect(effects), effects, note=by_edge)


def _c37(evidence: Evidence, claim: Claim) -> Finding:
    by_model = {cell.model: cell for cell in table1.cells() if cell.device == "A4500"}
    small, large = (by_model[model] for model in ("YOLOv8s", "DETR-ResNet-101"))
    right = not any(cell.misprinted or cell.printed_ms != cell.ours_ms for cell in (small, large))
    return arithmetic(right, small.speedup or np.nan, f"DETR-ResNet-101 {large.speedup:.2f}")


def _c38(evidence: Evidence, claim: Claim) -> Finding:
    slowest = max(load_profile(name).median_ns("yolov8s") for name in table1.devices().values())
    return arithmetic(slowest / 1e6 < claim.expect, slowest / 1e6)


def _c39(evidence: Evidence, claim: Claim) -> Finding:
    cells = table1.cells()
    misprints = [
        f"{cell.model} on {cell.device} {cell.printed_speedup:.2f} should be {cell.speedup:.2f}"
        for cell in cells
        if cell.misprinted
    ]
    equal_cells = sum(cell.printed_ms == cell.ours_ms for cell in cells)
    note = f"{len(misprints)} misprints: {', '.join(misprints)}"
    return arithmetic(equal_cells == 24 and len(misprints) == claim.expect, equal_cells, note)


Check = Callable[[Evidence, Claim], Finding]
CHECKS: dict[str, Check] = {
    "C1": _c1,
    "C2": _c2,
    "C3": _c3,
    "C4": _c4,
    "C5": _c5,
    "C6": _c6,
    "C7": _c7,
    "C8": _c8,
    "C9": _c9,
    "C10": lambda e, c: matches(
        c, _ratio(e, HE[0], HO[0], Number("accelerator_rate", "remote", component="edge1"))
    ),
    "C11": lambda e, c: matches(c, e.mean_of(ALL, BOTH_OBJECTS)),
    "C12": _c12,
    "C13": lambda e, c: matches(c, e.mean_of(ALL, BOTH_OBJECTS) / e.mean_of(ALL, BOTH_IMAGES)),
    "C14": _c14,
    "C15": _c15,
    "C16": _c16,
    "C17": lambda e, c: _gap("car", e, ALONE, "object_reuse"),
    "C18": lambda e, c: _gap("edge", e, SHARED, "image_reuse"),
    "C19": _c19,
    "C20": _c20,
    "C21": _c21,
    "C22": lambda e, c: _gap("edge", e, ALL, "confidence_boost"),
    "C23": _c23,
    "C24": _c24,
    "C25": _c25,
    "C26": _c26,
    "C27": lambda e, c: matches(c, e.mean_of(ALL, [Number("handling_ms")])),
    "C28": _c28,
    "C29": _c29,
    "C30": _c30,
    "C31": _c31,
    "C32": lambda e, c: within(
        c, e.mean_of(ALL, [Number("image_to_objects_bytes", "remote")]), c.expect
    ),
    "C33": _c33,
    "C34": _c34,
    "C35": lambda e, c: in_every_run(c, e.mean_of(ALL, [Number("detector_untouched")])),
    "C36": _c36,
    "C37": _c37,
    "C38": _c38,
    "C39": _c39,
}


def _ratio(evidence: Evidence, scenario: str, reference: str, number: Number) -> Values:
    """A number in one scenario over the same in another."""
    return evidence.of(scenario, number) / evidence.of(reference, number)


def _over(
    evidence: Evidence, scenario: str, number: Number, reference: Number, *, variant: str = BASE
) -> Values:
    """A number over another one in the same scenario."""
    return evidence.of(scenario, number, variant) / evidence.of(scenario, reference, variant)


def _furthest(ratios: Sequence[Values]) -> Values:
    """Those whose mean is the furthest from 1."""
    return max(ratios, key=lambda ratio: abs(float(np.mean(ratio)) - 1.0))


def _mean_effect(effects: Effects) -> Values:
    return np.asarray(np.mean([effect.effect for effect in effects.values()], axis=0))


def _steps(
    evidence: Evidence, scenarios: Sequence[str], *numbers: Number, falling: bool = False
) -> dict[str, Effect]:
    """That the mean of the numbers rises, or falls, from 1 to 2 and from 2 to 3 cars."""
    means = [evidence.mean_of([scenario], numbers) for scenario in scenarios]
    setting = "ho" if scenarios is HO else "he"
    return {
        f"{setting} {cars} to {cars + 1} cars": more(*((a, b) if falling else (b, a)))
        for cars, (a, b) in enumerate(pairwise(means), start=1)
    }


def _per_car(evidence: Evidence, number: Number) -> Finding:
    """That it rises with each car, with homogeneous and with heterogeneous edges."""
    gains = [evidence.of(s[2], number) - evidence.of(s[0], number) for s in (HO, HE)]
    legs = [_steps(evidence, scenarios, number) for scenarios in (HO, HE)]
    return all_positive(np.mean(gains, axis=0), *legs)


def _more_on(
    place: str, evidence: Evidence, scenarios: Sequence[str], name: str
) -> dict[str, Effect]:
    """That it is larger on edges than on cars, or the other way round, by scenario."""
    there, elsewhere = sorted(
        (placed(name, where) for where in GENIE_PLACEMENTS),
        key=lambda number: number.placement != place,
    )
    return {s: more(evidence.of(s, there), evidence.of(s, elsewhere)) for s in scenarios}


def _gap(place: str, evidence: Evidence, scenarios: Sequence[str], name: str) -> Finding:
    effects = _more_on(place, evidence, scenarios, name)
    return all_positive(_mean_effect(effects), effects)
