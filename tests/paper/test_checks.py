"""Every claim's test on facts made by hand: where it must hold, where it must not, and where it
points the other way.

Numbers that a test must not look at are there, too, and contradict it.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from genie_sim.paper import table1
from genie_sim.paper.checks import ALL, CASE, CHECKS, HE, HO, SHARED
from genie_sim.paper.claims import HOLDS, NO, PARTLY, load_claims
from genie_sim.scenario.profiles import load_profile
from tests.paper import notation
from tests.paper.notation import number

CLAIMS = {claim.id: claim for claim in load_claims()}
SEEDS = 4
L, R, DG = "local", "remote", "genie"


def six(name, *values):
    """A fact of the six scenarios: 1, 2, 3 cars homogeneous, then heterogeneous. One value is meant
    for all of them.
    """
    return [
        ("base", s, name, v)
        for s, v in zip(ALL, values if len(values) == 6 else values * 6, strict=True)
    ]


def at(scenario, name, value, variant="base"):
    return [(variant, scenario, name, value)]


def both(name, *values):
    """The same on cars and on edges."""
    return six(f"{name}:car", *values) + six(f"{name}:edge", *values)


def evidence(*parts):
    """What comes later replaces what came before; a list has a value for each seed."""
    runs = {}
    for variant, scenario, name, value in (one for part in parts for one in part):
        of_seeds = runs.setdefault((variant, scenario), [{} for _ in range(SEEDS)])
        for facts, single in zip(
            of_seeds, value if isinstance(value, list) else [value] * SEEDS, strict=True
        ):
            facts[number(name)] = single
    return notation.evidence(runs)


def times(answer, part, genie, local, remote):
    named = zip((DG, L, R), (genie, local, remote), strict=True)
    return [
        one for method, values in named for one in six(f"{answer}_answer_{part}:{method}", *values)
    ]


def early(*remote):
    """Percentiles of R, where Genie's are 10 ms."""
    found = []
    for percent, value in zip((10, 20, 30, 40, 50), remote, strict=True):
        name = f"first_answer_p{percent}"
        found += at(HE[0], f"{name}:remote", value) + at(HE[0], f"{name}:genie", 10.0)
    return found


def on_time(worst):
    return six("under_deadline_share:genie", 1, worst, 1, 1, 1, 1) + six(
        "under_deadline_share:remote", 0
    )


LATE = times("result", "mean", [70], [100], [100])
FASTER = (  # C4: one car with the server may be up to 10 % slower than R, and is 5 % slower
    times("first", "mean", [10], [100], [50])
    + times("first", "p95", [20], [200], [100])
    + at(HE[0], "first_answer_mean:remote", 10 / 1.05)
    + at(HE[0], "first_answer_p95:remote", 20 / 1.05)
)
RATES = six("accelerator_rate:remote:edge1", 15, 1, 1, 60, 1, 1) + six(
    "accelerator_rate:genie:edge1", 1
)
ALONE_MORE = six("image_reuse:car", 0.9, 0.1, 0.1, 0.9, 0.1, 0.1)  # C18 is not about one car
CAR1 = six("first_answer_mean:remote:car1", 90, 80, 70, 60, 66, 72)
STORED = six("stored_images:car", 100) + six("stored_images:edge", 130, 0, 0, 150, 0, 0)
OWN = six("image_reuse:car", 0.1)
HIGH = (
    six("image_reuse:car", 0.3)
    + six("image_reuse_highest:car", 0.5, 0.8, 0.8, 0.6, 0.8, 0.8)
    + six("image_peak_at:car", 0.2)
    + six("image_reuse:edge", 0.7)
)
WINDOWS = (
    both("image_reuse", 0.2, 0.2, 0.2, 0.3, 0.3, 0.3)
    + six("image_reuse_highest:car", 0.5, 0.5, 0.5, 0.6, 0.6, 0.6)
    + six("image_reuse_highest:edge", 0.4, 0.4, 0.4, 0.7, 0.7, 0.7)
)
BOOST = six("confidence_boost:car", 0.01) + six("confidence_boost:edge", 0.02)
CONFIDENT = both("stored_confidence", 0.7)
PER_OBJECT = six("boost_per_object:car", 0.05) + six("boost_per_object:edge", 0.03)
UNSHARED = [
    one
    for s in SHARED
    for place in ("car", "edge")
    for name, value in (("image_reuse", 0.2), ("object_reuse", 0.5), ("confidence_boost", 0.01))
    for one in at(s, f"{name}:{place}", value, "no_edge_sharing")
]
SHARING = both("image_reuse", 0.3) + both("object_reuse", 0.6) + both("confidence_boost", 0.02)
LEAKS = [
    one
    for s in (*ALL, CASE)
    for one in at(s, "objects_shared", 1000) + at(s, "unconfident_objects_shared", 0)
]


def case(**values):
    """Of the car without cameras and of the other one; its median is far from its tail."""
    known = {"first_answer_p99:genie:car2": 38.0, "first_answer_mean:genie:car1": 10.0} | values
    others = {
        "first_answer_p50:genie:car2": 5.0,
        "first_answer_p99:genie:car1": 99.0,
        "object_reuse:genie:car1/genie": 0.5,
    }
    return [one for name, value in (others | known).items() for one in at(CASE, name, value)]


def laps(homo, hetero):
    """Detector runs of the second lap, of 100 in the first."""
    found = []
    for scenario, runs in ((HO[0], homo), (HE[0], hetero)):
        found += at(scenario, "detector_runs:genie:lap1", 100)
        found += at(scenario, "detector_runs:genie:lap2", runs)
        found += at(scenario, "detector_runs", 100 + runs)
    return found


def cut(genie, local):
    named = {
        "late_result_share:genie": genie,
        "late_result_share:local": local,
        "late_answered_share:genie": 1.0,
    }
    whole = at(HO[0], "late_result_share:genie", 0.01) + at(HO[0], "late_result_share:local", 0.5)
    return whole + [
        one for name, value in named.items() for one in at(HO[0], name, value, "cut_link")
    ]


# claim, numbers, the verdict, the number that is shown
TABLE = [
    (
        "C1",
        LATE
        + times("first", "mean", [10], [40, 50, 50, 50, 50, 50], [40, 100, 100, 100, 100, 100]),
        HOLDS,
        10 / 12,
    ),
    ("C1", LATE + times("first", "mean", [10], [100], [100]), PARTLY, 0.9),
    ("C1", LATE + times("first", "mean", [10], [8], [8]), NO, -0.25),
    ("C2", times("first", "mean", [10], [20, 20, 20, 20, 20, 200], [20]), HOLDS, 0.05),
    ("C2", times("first", "mean", [10], [20, 20, 20, 20, 20, 400], [20]), PARTLY, 0.025),
    ("C2", times("first", "mean", [10], [8], [8]), NO, 1.25),
    (
        "C3",
        on_time(0.992) + six("result_under_deadline_share:genie", 0.3, 0.3, 0.12, 0.3, 0.3, 0.3),
        HOLDS,
        0.992,
    ),
    ("C3", on_time(0.9) + six("result_under_deadline_share:genie", 1), PARTLY, 0.9),
    ("C3", on_time(0.4) + six("result_under_deadline_share:genie", 1), NO, 0.4),
    ("C4", FASTER, HOLDS, (10.8 + 8 + 0.1) / 24),
    ("C4", FASTER + at(HE[1], "first_answer_p95:remote", 20.0), PARTLY, (10.8 + 7.2 + 0.1) / 24),
    ("C4", FASTER + at(HE[1], "first_answer_mean:remote", 9.5), PARTLY, None),
    ("C4", FASTER + at(HE[0], "first_answer_mean:local", 9.5), PARTLY, None),
    ("C4", FASTER + at(HE[0], "first_answer_mean:remote", 8.8), PARTLY, None),
    ("C5", six("first_answer_mean:genie", 10, 99, 10.5, 10, 99, 10.9), HOLDS, 1.09),
    ("C5", six("first_answer_mean:genie", 10, 10, 12, 10, 10, 10.9), PARTLY, 1.2),
    ("C5", six("first_answer_mean:genie", 10, 10, 10, 10, 10, 16), NO, 1.6),
    ("C6", six("first_answer_mean:genie", 10, 10, 10, 10.5, 10, 9.2), HOLDS, 0.92),
    ("C6", six("first_answer_mean:genie", 10, 10, 10, 10.5, 10, 8.5), NO, 0.85),
    ("C6", six("first_answer_mean:genie", 10, 10, 10, 10.5, 20, 10), NO, 2.0),
    ("C7", early(10, 11, 12, 11, 9), HOLDS, 1.2),
    ("C7", early(22, 10, 10, 10, 10), NO, 2.2),
    ("C7", early(10, 10, 10, 10, 35), NO, 3.5),
    ("C8", CAR1 + six("first_answer_mean:remote", 90, 80, 70, 60, 70, 85), HOLDS, None),
    ("C8", CAR1 + six("first_answer_mean:remote", 70, 80, 90, 60, 60, 85), PARTLY, None),
    ("C8", CAR1 + six("first_answer_mean:remote", 70, 80, 90, 85, 70, 60), PARTLY, None),
    (
        "C9",
        six("under_deadline_share:local", 0, 0, 0, 0, 0, 0.005)
        + six("under_deadline_share:remote", 0, 0.008, 0, 1, 1, 1),
        HOLDS,
        0.008,
    ),
    (
        "C9",
        six("under_deadline_share:local", 0, 0, 0, 0.3, 0, 0)
        + six("under_deadline_share:remote", 0),
        PARTLY,
        0.3,
    ),
    ("C9", six("under_deadline_share:local", 0) + six("under_deadline_share:remote", 0.9), NO, 0.9),
    ("C10", RATES, HOLDS, 4.0),
    ("C10", RATES + at(HE[0], "accelerator_rate:remote:edge1", 45), PARTLY, 3.0),
    ("C10", RATES + at(HE[0], "accelerator_rate:remote:edge1", 10), NO, 2 / 3),
    (
        "C11",
        six("object_reuse:car", 0.1, 0.2, 0.2, 0.2, 0.2, 1.2) + six("object_reuse:edge", 0.27),
        HOLDS,
        0.31,
    ),
    ("C11", both("object_reuse", 0.63), NO, 0.63),
    ("C11", both("object_reuse", 0.05), NO, 0.05),
    (
        "C12",
        six("object_reuse:car", 0.1, 0.67, 0.1, 0.1, 0.1, 0.1)
        + six("object_reuse:edge", 0.2)
        + six("object_reuse_highest:car", 0.9)
        + six("object_reuse_highest:edge", 0.9, 0.9, 0.9, 0.96, 0.9, 0.9),
        HOLDS,
        0.67,
    ),
    (
        "C12",
        six("object_reuse:car", 0.67) + six("object_reuse:edge", 0, 0, 0, 0, 0, 0.83),
        NO,
        0.83,
    ),
    ("C12", both("object_reuse", 0.3), NO, 0.3),
    (
        "C13",
        six("object_reuse:car", 0.3)
        + six("object_reuse:edge", 0.5)
        + six("image_reuse:car", 0.05)
        + six("image_reuse:edge", 0.15),
        HOLDS,
        4.0,
    ),
    ("C13", both("object_reuse", 0.4) + both("image_reuse", 0.2), PARTLY, 2.0),
    ("C13", both("object_reuse", 0.4) + both("image_reuse", 0.8), NO, 0.5),
    (
        "C14",
        six("object_reuse:car", 0.5, 0.4, 0.3, 0.1, 0.2, 0.3) + six("object_reuse:edge", 0.4),
        HOLDS,
        0.05,
    ),
    (
        "C14",
        six("object_reuse:car", 0.5, 0.5, 0.3, 0.1, 0.2, 0.3) + six("object_reuse:edge", 0.4),
        PARTLY,
        0.05,
    ),
    (
        "C14",
        six("object_reuse:car", 0.3, 0.4, 0.5, 0.3, 0.2, 0.1) + six("object_reuse:edge", 0.4),
        NO,
        -0.05,
    ),
    (
        "C15",
        six("object_reuse:car", 0.3, 0.2, 0.1, 0.3, 0.4, 0.5) + six("object_reuse:edge", 0.4),
        HOLDS,
        0.05,
    ),
    (
        "C15",
        six("object_reuse:car", 0.3, 0.2, 0.1, 0.3, 0.3, 0.5) + six("object_reuse:edge", 0.4),
        PARTLY,
        0.05,
    ),
    (
        "C15",
        six("object_reuse:car", 0.1, 0.2, 0.3, 0.5, 0.4, 0.3) + six("object_reuse:edge", 0.4),
        NO,
        -0.05,
    ),
    ("C16", both("object_reuse", 0.3, 0.3, 0.3, 0.31, 0.33, 0.36), HOLDS, 0.03),
    (
        "C16",
        both("object_reuse", 0.25, 0.25, 0.25, 0.5, 0.5, 0.75),
        PARTLY,
        (0.25 + 0.25 + 0.5 + 0 + 0.25) / 5,
    ),
    ("C16", both("object_reuse", 0.3, 0.3, 0.3, 0.36, 0.33, 0.31), PARTLY, 0.01),
    (
        "C17",
        six("object_reuse:car", 0.5, 0, 0, 0.6, 0, 0) + six("object_reuse:edge", 0.3),
        HOLDS,
        0.25,
    ),
    (
        "C17",
        six("object_reuse:car", 0.3, 1, 1, 0.6, 1, 1) + six("object_reuse:edge", 0.3),
        PARTLY,
        0.15,
    ),
    (
        "C17",
        six("object_reuse:car", 0.3, 1, 1, 0.3, 1, 1) + six("object_reuse:edge", 0.5),
        NO,
        -0.2,
    ),
    ("C18", ALONE_MORE + six("image_reuse:edge", 0, 0.3, 0.3, 0, 0.3, 0.5), HOLDS, 0.25),
    ("C18", ALONE_MORE + six("image_reuse:edge", 1, 0.1, 0.3, 1, 0.3, 0.3), PARTLY, 0.15),
    ("C18", ALONE_MORE + six("image_reuse:edge", 1, 0, 0, 1, 0, 0), NO, -0.1),
    (
        "C19",
        STORED + OWN + six("image_reuse:edge", 0.2, 0, 0, 0.3, 0, 0),
        HOLDS,
        (0.3 + 0.5 + 0.1 + 0.2) / 4,
    ),
    (
        "C19",
        STORED + OWN + six("image_reuse:edge", 0.1, 1, 1, 0.3, 1, 1),
        PARTLY,
        (0.3 + 0.5 + 0 + 0.2) / 4,
    ),
    (
        "C19",
        STORED + OWN + six("image_reuse:edge", 0, 1, 1, 0.3, 1, 1),
        PARTLY,
        (0.3 + 0.5 - 0.1 + 0.2) / 4,
    ),
    (
        "C19",
        six("stored_images:car", 200)
        + six("stored_images:edge", 100)
        + OWN
        + six("image_reuse:edge", 0.4),
        PARTLY,
        -0.35,
    ),
    ("C20", HIGH, HOLDS, (4 * 0.2 + 2 * 0.3 + 2 * 0.2 + 4 * (1 / 3 - 0.2)) / 12),
    ("C20", HIGH + at(HE[2], "image_peak_at:car", 1 / 3), PARTLY, None),
    ("C20", HIGH + at(HO[1], "image_peak_at:car", 0.5), PARTLY, None),
    ("C20", HIGH + at(HO[2], "image_reuse:car", 0.45), PARTLY, None),
    ("C20", HIGH + at(HE[0], "image_reuse_highest:car", 0.9), PARTLY, None),
    (  # one car of its own kind is what several are above
        "C20",
        HIGH
        + at(HO[0], "image_reuse_highest:car", 0.9)
        + at(HE[1], "image_reuse_highest:car", 0.95)
        + at(HE[2], "image_reuse_highest:car", 0.95),
        PARTLY,
        None,
    ),
    ("C21", WINDOWS, HOLDS, None),
    ("C21", WINDOWS + at(HE[2], "image_reuse_highest:edge", 0.4), PARTLY, None),
    ("C21", WINDOWS + at(HE[1], "image_reuse:edge", 0.15), PARTLY, None),
    ("C22", BOOST + PER_OBJECT, HOLDS, 0.01),
    ("C22", BOOST + PER_OBJECT + at(HO[1], "confidence_boost:edge", 0.01), PARTLY, 0.05 / 6),
    ("C22", BOOST + PER_OBJECT + six("confidence_boost:car", 0.03), NO, -0.01),
    (
        "C22",
        BOOST + six("boost_per_object:car", 0) + six("boost_per_object:edge", 0.5),
        HOLDS,
        0.01,
    ),
    (
        "C23",
        six("confidence_boost:edge", 0.01, 0.02, 0.03, 0.02, 0.03, 0.06) + PER_OBJECT,
        HOLDS,
        0.015,
    ),
    (
        "C23",
        six("confidence_boost:edge", 0.01, 0.01, 0.03, 0.02, 0.03, 0.04) + PER_OBJECT,
        PARTLY,
        0.01,
    ),
    (
        "C23",
        six("confidence_boost:edge", 0.03, 0.02, 0.01, 0.02, 0.03, 0.09) + PER_OBJECT,
        PARTLY,
        None,
    ),
    (
        "C24",
        six("confidence_boost:edge", 0.02, 0.02, 0.02, 0.022, 0.0224, 0.0246) + PER_OBJECT,
        HOLDS,
        1.15,
    ),
    (
        "C24",
        six("confidence_boost:edge", 0.02, 0.02, 0.02, 0.03, 0.03, 0.03) + PER_OBJECT,
        PARTLY,
        1.5,
    ),
    (
        "C24",
        six("confidence_boost:edge", 0.02, 0.02, 0.02, 0.019, 0.019, 0.019) + PER_OBJECT,
        NO,
        0.95,
    ),
    (
        "C25",
        six("stored_confidence:edge", 0.7, 0.72, 0.74, 0.7, 0.73, 0.76)
        + six("stored_confidence:car", 0.5),
        HOLDS,
        0.025,
    ),
    ("C25", six("stored_confidence:edge", 0.7, 0.72, 0.72, 0.7, 0.73, 0.76), PARTLY, 0.02),
    ("C25", six("stored_confidence:edge", 0.7, 0.72, 0.74, 0.76, 0.73, 0.7), PARTLY, None),
    ("C26", BOOST + CONFIDENT, HOLDS, 0.015),
    ("C26", BOOST + CONFIDENT + at(HO[2], "confidence_boost:car", 0), PARTLY, 0.17 / 12),
    ("C26", BOOST + CONFIDENT + six("confidence_boost:car", -0.03), NO, -0.005),
    ("C27", six("handling_ms", 8.6, 8.6, 8.6, 8.6, 8.6, 9.8), HOLDS, 8.8),
    ("C27", six("handling_ms", 9.68), NO, 9.68),
    ("C27", six("handling_ms", 0.9), NO, 0.9),
    ("C28", SHARING + UNSHARED, HOLDS, (0.1 + 0.1 + 0.01) / 3),
    ("C28", SHARING + UNSHARED + at(HE[1], "confidence_boost:car", 0.0), PARTLY, None),
    ("C28", SHARING + UNSHARED + both("confidence_boost", 0.009), PARTLY, None),
    ("C29", case(), HOLDS, 38.0),
    ("C29", case(**{"first_answer_p99:genie:car2": 60.0}), PARTLY, 60.0),
    ("C29", case(**{"first_answer_p99:genie:car2": 90.0}), NO, 90.0),
    ("C30", case(**{"first_answer_mean:genie:car2": 13.0}), HOLDS, 1.3),
    ("C30", case(**{"first_answer_mean:genie:car2": 21.0}), PARTLY, 2.1),
    ("C30", case(**{"first_answer_mean:genie:car2": 8.0}), NO, 0.8),
    ("C31", case(**{"object_reuse:genie:car2/genie": 0.9}), HOLDS, 0.9),
    ("C31", case(**{"object_reuse:genie:car2/genie": [0.0, 0.0, 0.0, 0.4]}), NO, 0.1),
    ("C31", case(**{"object_reuse:genie:car2/genie": 0.0}), NO, 0.0),
    ("C32", six("image_to_objects_bytes:remote", 300, 300, 300, 300, 300, 60), HOLDS, 260),
    ("C32", six("image_to_objects_bytes:remote", 50), PARTLY, 50),
    ("C32", six("image_to_objects_bytes:remote", 5), NO, 5),
    ("C33", LEAKS, HOLDS, 0),
    ("C33", LEAKS + at(CASE, "unconfident_objects_shared", 1), NO, 1),
    (
        "C33",
        LEAKS
        + at(HO[0], "unconfident_objects_shared", 2)
        + at(HE[2], "unconfident_objects_shared", 3),
        NO,
        5,
    ),
    ("C34", cut(0.6, 0.3), HOLDS, 2.0),
    ("C34", cut(0.27, 0.3), NO, 0.9),
    ("C34", cut(0.0, 0.3), NO, 0.0),
    ("C35", six("detector_untouched", 1), HOLDS, 1),
    ("C35", six("detector_untouched", 1, 1, 1, 1, [1, 1, 1, 0], 1), NO, 1 - 1 / 6),
    ("C35", six("detector_untouched", 0), NO, 0),
    ("C36", laps(30, 20), HOLDS, 0.75),
    ("C36", laps(100, 20), PARTLY, 0.4),
    ("C36", laps(120, 110), NO, -0.15),
]


# the table shows another number than decides, or one of several effects
SHOWN = {f"C{n}" for n in (2, 4, 6, 7, 8, *range(14, 24), 25, 26, 28, 31, 33, 34, 35, 36)}


@pytest.mark.parametrize(("claim", "facts", "expected", "value"), TABLE)
def test_a_check_says_what_its_numbers_say(claim, facts, expected, value):
    found = CHECKS[claim](evidence(facts), CLAIMS[claim])
    assert found.verdict == expected
    if value is not None and claim not in SHOWN:
        assert found.values == pytest.approx([value] * SEEDS, abs=1e-9)


@pytest.mark.parametrize(
    ("claim", "facts", "shown"),
    [
        ("C2", times("first", "mean", [10], [20, 20, 20, 20, 20, 200], [20]), 0.95),
        ("C4", FASTER, 1.05),
        ("C6", six("first_answer_mean:genie", 10, 10, 10, 10.5, 10, 9.2), 0.92),
        ("C7", early(10, 11, 12, 11, 9), 0.9),
        ("C8", CAR1 + six("first_answer_mean:remote", 90, 80, 70, 60, 70, 85), 12),
        ("C14", both("object_reuse", 0.5, 0.4, 0.3, 0.1, 0.2, 0.3), -0.2),
        ("C15", both("object_reuse", 0.5, 0.4, 0.3, 0.1, 0.2, 0.3), 0.2),
        ("C16", both("object_reuse", 0.3, 0.3, 0.3, 0.31, 0.33, 0.36), 0.06),
        ("C19", STORED + OWN + six("image_reuse:edge", 0.2, 0, 0, 0.3, 0, 0), 0.15),
        ("C20", HIGH, np.mean([0.8 / 0.3])),
        ("C21", WINDOWS, 0.1),
        ("C26", BOOST + CONFIDENT, 0.02 / 0.7),
        ("C28", SHARING + UNSHARED, 0.1),
        ("C36", laps(30, 20), 0.75),
    ],
)
def test_the_table_shows_one_leg_whatever_decides(claim, facts, shown):
    found = CHECKS[claim](evidence(facts), CLAIMS[claim])
    assert found.values == pytest.approx([shown] * SEEDS, abs=1e-9)


def test_parts_that_fail_are_named_and_one_whole_leg_is_a_part():
    """C16: higher with the fast server for every number of cars, but not the more so."""
    gaps = evidence(both("object_reuse", 0.3, 0.3, 0.3, 0.36, 0.33, 0.31))
    found = CHECKS["C16"](gaps, CLAIMS["C16"])
    assert found.verdict == "partly"
    others = "1 to 2 cars (contrary), 2 to 3 cars (contrary)"
    assert found.note == f"3 of 5 effects hold, the others: {others}"
    boost = evidence(SHARING + UNSHARED + both("confidence_boost", 0.009))
    found = CHECKS["C28"](boost, CLAIMS["C28"])
    assert (found.verdict, found.note) == ("partly", "8 of 12 effects hold, the others: 4 contrary")


def test_what_the_verdict_hangs_on_stands_beside_it():
    """C24 on one car, C29 on the slowest answer, C30 on the mean."""
    boosts = six("confidence_boost:edge", 0.01, 0.02, 0.02, 0.018, 0.02, 0.02)
    found = CHECKS["C24"](evidence(boosts), CLAIMS["C24"])
    assert found.note == "1 car 1.80, 2 cars 1.00, 3 cars 1.00"
    late = case(**{"first_answer_max:genie:car2": 47.6})
    assert CHECKS["C29"](evidence(late), CLAIMS["C29"]).note == "the slowest answer takes 48 ms"
    medians = {"first_answer_mean:genie:car2": 13.0, "first_answer_p50:genie:car1": 10.0}
    found = CHECKS["C30"](evidence(case(**medians)), CLAIMS["C30"])
    assert (found.verdict, found.note) == ("holds", "of medians 0.50 times")


def test_object_reuse_of_both_roles_counts_where_they_point_in_opposite_directions():
    """C16: cars gain .4 with the fast server and edges lose .2, .3, .1 with one, two, three
    cars.
    """
    cars = six("object_reuse:car", 0.1, 0.1, 0.1, 0.5, 0.5, 0.5)
    edges = six("object_reuse:edge", 0.6, 0.6, 0.6, 0.4, 0.3, 0.5)
    found = CHECKS["C16"](evidence(cars + edges), CLAIMS["C16"])
    assert found.note == "4 of 5 effects hold, the others: 1 to 2 cars (contrary)"


@pytest.mark.parametrize(
    ("claim", "facts", "worst"),
    [
        ("C33", LEAKS + at(HO[0], "unconfident_objects_shared", [0, 0, 0, 3]), 3),
        ("C34", cut([0.6, 0.6, 0.6, 0.27], 0.3), 0.9),
        ("C35", six("detector_untouched", [1, 1, 1, 0]), 0),
    ],
)
def test_an_invariant_is_decided_by_its_worst_run(claim, facts, worst):
    found = CHECKS[claim](evidence(facts), CLAIMS[claim])
    assert found.verdict == "no" and found.values == pytest.approx([worst])


def test_every_claim_of_simulated_numbers_is_there_three_times():
    for place in range(1, 37):
        outcomes = [expected for claim, _, expected, _ in TABLE if claim == f"C{place}"]
        assert outcomes[0] == HOLDS and HOLDS not in outcomes[1:3], place
        assert len(outcomes) >= 3


def test_comparisons_are_paired_by_seed():
    """Two cars' times move together from seed to seed; their ratio does not move."""
    other, mine = [10.0, 20.0, 30.0, 40.0], [13.0, 26.0, 39.0, 52.0]
    facts = case(**{"first_answer_mean:genie:car1": other, "first_answer_mean:genie:car2": mine})
    found = CHECKS["C30"](evidence(facts), CLAIMS["C30"])
    assert found.values == pytest.approx([1.3] * 4)


# Table I: arithmetic on what is printed


def cells(**changed):
    """Table I with one field of one cell changed."""
    (model, device), fields = changed.pop("at"), changed
    found = table1.cells()
    return [
        dataclasses.replace(one, **fields) if (one.model, one.device) == (model, device) else one
        for one in found
    ]


@pytest.mark.parametrize(
    ("claim", "change", "holds"),
    [
        ("C37", {"at": ("YOLOv8s", "A4500"), "ours_ms": 5.6}, False),
        ("C37", {"at": ("DETR-ResNet-101", "A4500"), "printed_speedup": 10.5}, False),
        ("C37", {"at": ("YOLOv8m", "A4500"), "ours_ms": 1.0}, True),
        ("C37", {"at": ("YOLOv8s", "Orin"), "ours_ms": 1.0}, True),
        ("C39", {"at": ("YOLOv8m", "A4500"), "printed_speedup": 8.58}, False),
        ("C39", {"at": ("YOLOv8l", "Orin"), "printed_speedup": 3.6}, False),
        ("C39", {"at": ("DETR-ResNet-101-DC5", "Nano"), "ours_ms": 900.0}, False),
        ("C39", {"at": ("YOLOv8s", "AGX")}, True),
    ],
)
def test_the_table_s_claims_hold_only_where_every_number_is_right(
    claim, change, holds, monkeypatch
):
    found = cells(**change)
    monkeypatch.setattr(table1, "cells", lambda: found)
    assert CHECKS[claim](evidence(), CLAIMS[claim]).verdict == (HOLDS if holds else NO)


def test_table_i_as_it_is():
    small, slow, misprints = (
        CHECKS[claim](evidence(), CLAIMS[claim]) for claim in ("C37", "C38", "C39")
    )
    assert (small.values, small.note) == (pytest.approx(27.6 / 5.5), "DETR-ResNet-101 10.37")
    assert slow.values == 27.6
    assert misprints.note == (
        "2 misprints: YOLOv8m on A4500 2.46 should be 8.58, YOLOv8l on A4500 2.70 should be 9.48"
    )
    assert {small.verdict, slow.verdict, misprints.verdict} == {HOLDS}


@pytest.mark.parametrize(("slowest_ms", "holds"), [(32.9, True), (33.0, False), (60.0, False)])
def test_a_small_model_must_be_fast_enough_on_every_device(slowest_ms, holds, monkeypatch):
    def load(name):
        profile = load_profile(name)
        ns = round(slowest_ms * 1e6) if name == "agx_xavier" else 5_000_000
        yolo = dataclasses.replace(profile.models["yolov8s"], median_ns=ns)
        return dataclasses.replace(profile, models={**profile.models, "yolov8s": yolo})

    monkeypatch.setattr("genie_sim.paper.checks.load_profile", load)
    found = CHECKS["C38"](evidence(), CLAIMS["C38"])
    assert (found.values, found.verdict) == (slowest_ms, HOLDS if holds else NO)
