"""The test of each of the paper's claims: arithmetic on replicated runs, no opinion yet."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from genie_sim.analysis.metrics import PLACEMENTS
from genie_sim.paper import table1
from genie_sim.paper.evidence import BASE, Evidence, Finding, Values, above, all_positive, below, matches
from genie_sim.scenario.profiles import load_profile
from genie_sim.scenario.yaml_input import parse

HO = ("1car_homo", "2car_homo", "3car_homo")
HE = ("1car_hetero", "2car_hetero", "3car_hetero")
ALL = (*HO, *HE)
SHARED = (*HO[1:], *HE[1:])  # where there is somebody to share with
CASE = "case_study"
BASELINES = {"L": "local", "R": "remote"}
BOTH_OBJECTS = tuple(f"object_reuse:{placement}" for placement in PLACEMENTS)
BOTH_IMAGES = tuple(f"image_reuse:{placement}" for placement in PLACEMENTS)


@dataclass(frozen=True, slots=True)
class Claim:
    """One line of ``claims.yaml``."""

    id: str
    where: str
    kind: str
    claim: str
    test: str
    expect: float
    tolerance: float


def load_claims() -> list[Claim]:
    """The paper's claims, in order."""
    path = Path(__file__).with_name("claims.yaml")
    lines = parse(path.read_text(encoding="utf-8"), str(path))
    return [Claim(**{"tolerance": 0.0, **line}) for line in lines]


def improvements(evidence: Evidence, answer: str = "first") -> dict[str, Values]:
    """1 - mean(DG) / mean(baseline), for 6 scenarios x {L, R}."""
    return {
        f"{scenario} {letter}": 1
        - _over(evidence, scenario, f"{answer}_answer_mean:genie", f"{answer}_answer_mean:{baseline}")
        for scenario in ALL
        for letter, baseline in BASELINES.items()
    }


def object_bars(evidence: Evidence) -> dict[str, Values]:
    return {f"{s} {where}": evidence.of(s, f"object_reuse:{where}") for s in ALL for where in PLACEMENTS}


def _c1(evidence: Evidence, claim: Claim) -> Finding:
    fresh = np.mean(list(improvements(evidence, "fresh").values()))
    average = np.mean(list(improvements(evidence).values()), axis=0)
    return matches(average, claim.expect, claim.tolerance, note=f"fresh answer: {100 * fresh:.0f} %")


def _c3(evidence: Evidence, claim: Claim) -> Finding:
    worst = np.min([evidence.of(s, "under_deadline_share:genie") for s in ALL], axis=0)
    fresh = np.min([evidence.of(s, "fresh_under_deadline_share:genie") for s in ALL])
    return above(worst, claim.expect, near=0.5, note=f"worst scenario; fresh answer: {100 * fresh:.0f} %")


def _c4(evidence: Evidence, claim: Claim) -> Finding:
    gains = {}
    for scenario in ALL:
        for letter, baseline in BASELINES.items():
            slack = 1.1 if (scenario, letter) == ("1car_hetero", "R") else 1.0
            for part in ("mean", "p95"):
                ratio = _over(evidence, scenario, f"first_answer_{part}:genie", f"first_answer_{part}:{baseline}")
                gains[f"{scenario} {letter} {part}"] = slack - ratio
    return all_positive(gains)


def _c5(evidence: Evidence, claim: Claim) -> Finding:
    ratios = [_ratio(evidence, s[2], s[0], "first_answer_mean:genie") for s in (HO, HE)]
    return below(np.max(ratios, axis=0), claim.expect, near=1.5, note="the larger of ho and he")


def _c6(evidence: Evidence, claim: Claim) -> Finding:
    ratios = [_ratio(evidence, he, ho, "first_answer_mean:genie") for ho, he in zip(HO, HE, strict=True)]
    furthest = max(ratios, key=lambda one: abs(float(np.mean(one)) - 1.0))
    return matches(furthest, claim.expect, claim.tolerance, note="the number of cars furthest from 1")


def _c7(evidence: Evidence, claim: Claim) -> Finding:
    ratios = []
    for percent in (10, 20, 30, 40, 50):
        name = f"first_answer_p{percent}"
        ratios.append(_over(evidence, HE[0], f"{name}:remote", f"{name}:genie", "ideal_link"))
    furthest = max(ratios, key=lambda one: abs(float(np.mean(one)) - 1.0))
    found = matches(furthest, claim.expect, claim.tolerance, note="the percentile furthest from 1")
    return replace(found, direction=found.value is not None and found.value < 3.0)


def _c9(evidence: Evidence, claim: Claim) -> Finding:
    shares = [evidence.of(s, "under_deadline_share:local") for s in ALL]
    shares += [evidence.of(s, "under_deadline_share:remote") for s in HO]
    return below(np.max(shares, axis=0), claim.expect, near=0.5, note="the best board and scenario")


def _c12(evidence: Evidence, claim: Claim) -> Finding:
    bars = object_bars(evidence)
    name = max(bars, key=lambda one: float(np.nan_to_num(bars[one]).mean()))
    errors = [evidence.of(s, f"object_reuse_high:{placement}") for s in ALL for placement in PLACEMENTS]
    highest = max(float(np.nan_to_num(one).mean()) for one in errors)
    return matches(bars[name], claim.expect, claim.tolerance, note=f"{name}; highest error bar {highest:.2f}")


def _c13(evidence: Evidence, claim: Claim) -> Finding:
    ratio = evidence.mean_of(ALL, BOTH_OBJECTS) / evidence.mean_of(ALL, BOTH_IMAGES)
    found = matches(ratio, claim.expect, claim.tolerance)
    return replace(found, direction=found.low is not None and found.low > 1.0)


def _c16(evidence: Evidence, claim: Claim) -> Finding:
    gaps = [evidence.mean_of([he], BOTH_OBJECTS) - evidence.mean_of([ho], BOTH_OBJECTS) for ho, he in _pairs()]
    named = {f"{cars} car(s)": gap for cars, gap in enumerate(gaps, start=1)}
    return all_positive({**named, "1 to 2 cars": gaps[1] - gaps[0], "2 to 3 cars": gaps[2] - gaps[1]})


def _c18(evidence: Evidence, claim: Claim) -> Finding:
    found = all_positive({s: _gap(evidence, s, "image_reuse", "edge", "car") for s in SHARED})
    other = np.mean([_gap(evidence, s, "image_reuse_with_neighbours", "edge", "car") for s in SHARED])
    return replace(found, note=f"{found.note}; neighbours' requests counted too: {other:+.2f}")


def _c19(evidence: Evidence, claim: Claim) -> Finding:
    more = {f"{s} stored": _gap(evidence, s, "stored_images", "edge", "car") / 100 for s in (HO[0], HE[0])}
    return all_positive(
        more | {f"{s} reuse": _gap(evidence, s, "image_reuse", "edge", "car") for s in (HO[0], HE[0])}
    )


def _c20(evidence: Evidence, claim: Claim) -> Finding:
    steps = {}
    for scenarios in (HO, HE):
        alone = evidence.of(scenarios[0], "image_reuse_high:car")
        for scenario in scenarios[1:]:
            high = evidence.of(scenario, "image_reuse_high:car")
            steps[f"{scenario} twice the bar"] = high - claim.expect * evidence.of(scenario, "image_reuse:car")
            steps[f"{scenario} above 1 car"] = high - alone
            steps[f"{scenario} early"] = 1 / 3 - evidence.of(scenario, "image_peak_at:car")
    return all_positive(steps)


def _c21(evidence: Evidence, claim: Claim) -> Finding:
    steps = {}
    for ho, he in _pairs():
        steps[f"{he} mean"] = evidence.mean_of([he], BOTH_IMAGES) - evidence.mean_of([ho], BOTH_IMAGES)
        high = [np.maximum(*(evidence.of(s, f"image_reuse_high:{where}") for where in PLACEMENTS)) for s in (he, ho)]
        steps[f"{he} highest"] = high[0] - high[1]
    return all_positive(steps)


def _c22(evidence: Evidence, claim: Claim) -> Finding:
    found = all_positive({s: _gap(evidence, s, "confidence_boost", "edge", "car") for s in ALL})
    other = all_positive({s: _gap(evidence, s, "boost_per_object", "edge", "car") for s in ALL})
    return _with_other_reading(found, other)


def _c23(evidence: Evidence, claim: Claim) -> Finding:
    per_update, per_object = (
        all_positive(_steps(evidence, HO, f"{name}:edge") | _steps(evidence, HE, f"{name}:edge"))
        for name in ("confidence_boost", "boost_per_object")
    )
    return _with_other_reading(per_update, per_object)


def _c24(evidence: Evidence, claim: Claim) -> Finding:
    ratios = [_ratio(evidence, he, ho, "confidence_boost:edge") for ho, he in _pairs()]
    found = matches(np.mean(ratios, axis=0), claim.expect, claim.tolerance)
    others = [_ratio(evidence, he, ho, "boost_per_object:edge") for ho, he in _pairs()]
    other = matches(np.mean(others, axis=0), claim.expect, claim.tolerance)
    return _with_other_reading(replace(found, direction=found.value is not None and found.value > 1.0), other)


def _c26(evidence: Evidence, claim: Claim) -> Finding:
    boosts = {f"{s} {where}": evidence.of(s, f"confidence_boost:{where}") for s in ALL for where in PLACEMENTS}
    return all_positive(boosts)


def _c28(evidence: Evidence, claim: Claim) -> Finding:
    steps = {}
    boost = ("confidence_boost:car", "confidence_boost:edge")
    for what, names in (("images", BOTH_IMAGES), ("objects", BOTH_OBJECTS), ("boost", boost)):
        for s in SHARED:
            steps[f"{s} {what}"] = evidence.mean_of([s], names) - evidence.mean_of([s], names, "no_edge_sharing")
    return all_positive(steps)


def _c30(evidence: Evidence, claim: Claim) -> Finding:
    ratio = _over(evidence, CASE, "first_answer_mean:genie:car2", "first_answer_mean:genie:car1")
    found = matches(ratio, claim.expect, claim.tolerance)
    return replace(found, direction=found.low is not None and found.low > 1.0)


def _c33(evidence: Evidence, claim: Claim) -> Finding:
    shared = float(np.sum([evidence.of(s, "objects_shared") for s in (*ALL, CASE)]))
    bad = np.sum([evidence.of(s, "unconfident_objects_shared") for s in (*ALL, CASE)], axis=0)
    return below(bad, claim.expect, "objects", note=f"of {shared:,.0f} shared")


def _c34(evidence: Evidence, claim: Claim) -> Finding:
    ratio = _over(evidence, HO[0], "late_fresh_share:genie", "late_fresh_share:local", "cut_link")
    answered = evidence.of(HO[0], "late_answered_share:genie", "cut_link")
    return above(ratio, claim.expect, note=f"any answer: {100 * np.mean(answered):.0f} %")


def _c36(evidence: Evidence, claim: Claim) -> Finding:
    saved = {s: 1 - _over(evidence, s, "detector_runs:lap2", "detector_runs:lap1", "two_laps") for s in (HO[0], HE[0])}
    found = all_positive(saved)
    return replace(found, note=f"share of runs saved; {found.note}")


def _c37(evidence: Evidence, claim: Claim) -> Finding:
    by_model = {cell.model: cell for cell in table1.cells() if cell.device == "A4500"}
    wrong = [m for m in ("YOLOv8s", "DETR-ResNet-101") if by_model[m].misprinted or not _same_ms(by_model[m])]
    small, large = (by_model[m].speedup for m in ("YOLOv8s", "DETR-ResNet-101"))
    return _arithmetic(small, "1", not wrong, f"and {large:.2f}")


def _c38(evidence: Evidence, claim: Claim) -> Finding:
    profiles = [load_profile(name) for name in table1.DEVICES.values()]
    slowest = max(profile.median_ns("yolov8s") for profile in profiles) / 1e6
    return _arithmetic(slowest, "ms", slowest < claim.expect, "the slowest device")


def _c39(evidence: Evidence, claim: Claim) -> Finding:
    cells = table1.cells()
    misprints = [
        f"{cell.model} on {cell.device}: {cell.printed_speedup:.2f} should be {cell.speedup:.2f}"
        for cell in cells
        if cell.misprinted
    ]
    same = len(cells) == 24 and all(_same_ms(cell) for cell in cells)
    return _arithmetic(len(misprints), "misprints", same and len(misprints) == claim.expect, "; ".join(misprints))


Check = Callable[[Evidence, Claim], Finding]
CHECKS: dict[str, Check] = {
    "C1": _c1,
    "C2": lambda e, c: matches(np.max(list(improvements(e).values()), axis=0), c.expect, c.tolerance),
    "C3": _c3, "C4": _c4, "C5": _c5, "C6": _c6, "C7": _c7,
    "C8": lambda e, c: all_positive(_steps(e, HE, "first_answer_mean:remote"), unit="ms"),
    "C9": _c9,
    "C10": lambda e, c: matches(_ratio(e, HE[0], HO[0], "accelerator_rate:remote:edge1"), c.expect, c.tolerance),
    "C11": lambda e, c: matches(e.mean_of(ALL, BOTH_OBJECTS), c.expect, c.tolerance),
    "C12": _c12, "C13": _c13,
    "C14": lambda e, c: all_positive({k: -v for k, v in _steps(e, HO, *BOTH_OBJECTS).items()}),
    "C15": lambda e, c: all_positive(_steps(e, HE, *BOTH_OBJECTS)),
    "C16": _c16,
    "C17": lambda e, c: all_positive({s: _gap(e, s, "object_reuse", "car", "edge") for s in (HO[0], HE[0])}),
    "C18": _c18, "C19": _c19, "C20": _c20, "C21": _c21, "C22": _c22, "C23": _c23, "C24": _c24,
    "C25": lambda e, c: all_positive(_steps(e, HO, "stored_confidence:edge") | _steps(e, HE, "stored_confidence:edge")),
    "C26": _c26,
    "C27": lambda e, c: matches(e.mean_of(ALL, ["handling_ms"]), c.expect, c.tolerance, unit="ms"),
    "C28": _c28,
    "C29": lambda e, c: below(e.of(CASE, "first_answer_p99:genie:car2"), c.expect, "ms", near=2 * c.expect),
    "C30": _c30,
    "C31": lambda e, c: all_positive({"car2": e.of(CASE, "object_reuse:car2/genie")}),
    "C32": lambda e, c: above(e.mean_of(ALL, ["image_to_objects_bytes:remote"]), c.expect, near=10.0),
    "C33": _c33, "C34": _c34,
    "C35": lambda e, c: above(e.mean_of(ALL, ["detector_untouched"]), c.expect),
    "C36": _c36, "C37": _c37, "C38": _c38, "C39": _c39,
}  # fmt: skip


def _pairs() -> list[tuple[str, str]]:
    return list(zip(HO, HE, strict=True))


def _ratio(evidence: Evidence, above_: str, below_: str, name: str) -> Values:
    return evidence.of(above_, name) / evidence.of(below_, name)


def _over(evidence: Evidence, scenario: str, above_: str, below_: str, variant: str = BASE) -> Values:
    return evidence.of(scenario, above_, variant) / evidence.of(scenario, below_, variant)


def _steps(evidence: Evidence, scenarios: Sequence[str], *names: str) -> dict[str, Values]:
    """What one more car adds to the mean of the named facts, from 1 to 2 and from 2 to 3 cars."""
    means = [evidence.mean_of([scenario], names) for scenario in scenarios]
    setting = scenarios[0].removeprefix("1car_")
    return {f"{setting} 1 to 2 cars": means[1] - means[0], f"{setting} 2 to 3 cars": means[2] - means[1]}


def _gap(evidence: Evidence, scenario: str, name: str, more: str, less: str) -> Values:
    return evidence.of(scenario, f"{name}:{more}") - evidence.of(scenario, f"{name}:{less}")


def _with_other_reading(per_update: Finding, per_object: Finding) -> Finding:
    """The paper's boost may also be meant per stored object; the verdict is that of the boost per update."""
    value, outcome = per_object.value, "holds" if per_object.holds else "fails"
    said = f"per stored object instead of per update: {value:.3g}, {outcome}"
    return replace(per_update, note=f"{per_update.note}; {said}" if per_update.note else said)


def _same_ms(cell: table1.Cell) -> bool:
    return cell.printed_ms == cell.ours_ms


def _arithmetic(value: float | None, unit: str, holds: bool, note: str) -> Finding:
    return Finding(value, None, None, 1, unit, holds, False, note)
