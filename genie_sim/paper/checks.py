"""The test of each of the paper's claims: arithmetic on replicated runs, no opinion yet.

A check takes the evidence of any reading and the claim's line, where all thresholds stand.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from genie_sim.analysis.genie_metrics import PLACEMENTS
from genie_sim.paper import table1
from genie_sim.paper.evidence import (
    BASE,
    Claim,
    Evidence,
    Finding,
    Values,
    above,
    all_positive,
    below,
    in_every_run,
    matches,
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
    gains = {}
    for scenario in ALL:
        for letter, baseline in BASELINES.items():
            most = claim.also if (scenario, letter) == (HE[0], "R") else claim.expect
            for part in ("mean", "p95"):
                ratio = _over(
                    evidence,
                    scenario,
                    Fact(f"first_answer_{part}"),
                    Fact(f"first_answer_{part}", baseline),
                )
                gains[f"{scenario} {letter} {part}"] = most - ratio
    return all_positive(gains)


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
    gaps = [
        evidence.mean_of([he], BOTH_OBJECTS) - evidence.mean_of([ho], BOTH_OBJECTS)
        for ho, he in PAIRS
    ]
    named = {f"{cars} car(s)": gap for cars, gap in enumerate(gaps, start=1)}
    return all_positive(
        {**named, "1 to 2 cars": gaps[1] - gaps[0], "2 to 3 cars": gaps[2] - gaps[1]}
    )


def _c18(evidence: Evidence, claim: Claim) -> Finding:
    difference = np.mean(
        list(_more_on_edges(evidence, SHARED, "image_reuse_with_neighbours").values())
    )
    note = f"neighbours' requests counted too: {difference:+.2f}"
    return all_positive(_more_on_edges(evidence, SHARED, "image_reuse"), note=note)


def _c19(evidence: Evidence, claim: Claim) -> Finding:
    stored, reused = (
        _more_on_edges(evidence, ALONE, name) for name in ("stored_images", "image_reuse")
    )
    hundreds = {f"{s} stored": images / 100 for s, images in stored.items()}
    return all_positive(hundreds | {f"{s} reuse": gap for s, gap in reused.items()})


def _c20(evidence: Evidence, claim: Claim) -> Finding:
    parts = {}
    for scenario in SHARED:
        high = evidence.of(scenario, placed("image_reuse_high", "car"))
        alone = evidence.of(HO[0] if scenario in HO else HE[0], placed("image_reuse_high", "car"))
        parts[f"{scenario} twice the bar"] = high - claim.expect * evidence.of(
            scenario, placed("image_reuse", "car")
        )
        parts[f"{scenario} above 1 car"] = high - alone
        parts[f"{scenario} early"] = claim.also - evidence.of(
            scenario, placed("image_peak_at", "car")
        )
    return all_positive(parts)


def _c21(evidence: Evidence, claim: Claim) -> Finding:
    parts = {}
    for ho, he in PAIRS:
        parts[f"{he} mean"] = evidence.mean_of([he], BOTH_IMAGES) - evidence.mean_of(
            [ho], BOTH_IMAGES
        )
        high = [
            np.maximum(*(evidence.of(s, placed("image_reuse_high", where)) for where in PLACEMENTS))
            for s in (he, ho)
        ]
        parts[f"{he} highest"] = high[0] - high[1]
    return all_positive(parts)


def _c28(evidence: Evidence, claim: Claim) -> Finding:
    parts = {}
    for what, names in (("images", BOTH_IMAGES), ("objects", BOTH_OBJECTS), ("boost", BOTH_BOOSTS)):
        for s in SHARED:
            parts[f"{s} {what}"] = evidence.mean_of([s], names) - evidence.mean_of(
                [s], names, "no_edge_sharing"
            )
    return all_positive(parts)


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
    "C8": lambda e, c: all_positive(_steps(e, HE, Fact("first_answer_mean", "remote")), unit="ms"),
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
    "C14": lambda e, c: all_positive({k: -v for k, v in _steps(e, HO, *BOTH_OBJECTS).items()}),
    "C15": lambda e, c: all_positive(_steps(e, HE, *BOTH_OBJECTS)),
    "C16": _c16,
    "C17": lambda e, c: all_positive(
        {s: -gap for s, gap in _more_on_edges(e, ALONE, "object_reuse").items()}
    ),
    "C18": _c18,
    "C19": _c19,
    "C20": _c20,
    "C21": _c21,
    "C22": lambda e, c: _or_per_object(
        e, lambda boost: all_positive(_more_on_edges(e, ALL, boost))
    ),
    "C23": lambda e, c: _or_per_object(
        e, lambda boost: all_positive(_per_car(e, placed(boost, "edge")))
    ),
    "C24": lambda e, c: _or_per_object(
        e,
        lambda boost: matches(
            c, np.mean([_ratio(e, he, ho, placed(boost, "edge")) for ho, he in PAIRS], axis=0)
        ),
    ),
    "C25": lambda e, c: all_positive(_per_car(e, placed("stored_confidence", "edge"))),
    "C26": lambda e, c: all_positive(
        {f"{s} {fact}": e.of(s, fact) for s in ALL for fact in BOTH_BOOSTS}
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
    "C31": lambda e, c: all_positive(
        {"car2": e.of(CASE, Fact("object_reuse", component="car2/genie"))}
    ),
    "C32": lambda e, c: above(c, e.mean_of(ALL, [Fact("image_to_objects_bytes", "remote")])),
    "C33": _c33,
    "C34": _c34,
    "C35": lambda e, c: in_every_run(c, e.mean_of(ALL, [Fact("detector_untouched")])),
    "C36": lambda e, c: all_positive(
        {
            s: c.expect
            - _over(
                e,
                s,
                Fact("detector_runs", component="lap2"),
                Fact("detector_runs", component="lap1"),
                "two_laps",
            )
            for s in ALONE
        },
        note="share of runs saved",
    ),
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


def _steps(evidence: Evidence, scenarios: Sequence[str], *facts: Fact) -> dict[str, Values]:
    """What one more car adds to the mean of the named facts, from 1 to 2 and from 2 to 3 cars."""
    means = [evidence.mean_of([scenario], facts) for scenario in scenarios]
    setting = scenarios[0].removeprefix("1car_")
    return {
        f"{setting} 1 to 2 cars": means[1] - means[0],
        f"{setting} 2 to 3 cars": means[2] - means[1],
    }


def _per_car(evidence: Evidence, fact: Fact) -> dict[str, Values]:
    """What one more car adds, with homogeneous and with heterogeneous edges."""
    return _steps(evidence, HO, fact) | _steps(evidence, HE, fact)


def _more_on_edges(evidence: Evidence, scenarios: Sequence[str], name: str) -> dict[str, Values]:
    """Edges minus cars, by scenario."""
    on_edges, on_cars = placed(name, "edge"), placed(name, "car")
    return {s: evidence.of(s, on_edges) - evidence.of(s, on_cars) for s in scenarios}


def _or_per_object(evidence: Evidence, test: Callable[[str], Finding]) -> Finding:
    """The test of a boost, and a note of how it comes out per stored object, unless that is what
    the reading means.
    """
    per_update, per_object = test("confidence_boost"), test("boost_per_object")
    if evidence.definitions.boost == "per_object":
        return per_update
    outcome = "holds" if per_object.holds else "fails"
    comparison = f"per stored object instead of per update: {per_object.value:.3g}, {outcome}"
    return replace(
        per_update, note=f"{per_update.note}; {comparison}" if per_update.note else comparison
    )


def _arithmetic(value: float | None, unit: str, holds: bool, note: str) -> Finding:
    return Finding(value, None, None, n=1, unit=unit, holds=holds, direction=False, note=note)
