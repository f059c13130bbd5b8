"""A small version of the evaluation gives the committed numbers: a change of any of them is a
commit with its reason.

When a change is meant: ``python tests/paper/test_regression.py "reason"`` writes the new numbers;
the reason goes, word for word, into CHANGELOG.md. Then ``genie-sim reproduce --out results/paper``
and ``python tests/paper/test_reproduce.py``.
"""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path

import pytest

from genie_sim.analysis.genie_metrics import PLACEMENTS
from genie_sim.paper.checks import ALL, CASE
from genie_sim.paper.reproduce import calibrated_settings
from genie_sim.paper.runs import EvaluationRun
from tests.paper.notation import fact

REPOSITORY = Path(__file__).resolve().parents[2]
COMMITTED = Path(__file__).with_name("regression.json")
RELATIVE = 1e-6  # sums of floats may end differently on another machine
SCENARIOS = (*ALL, CASE)
SMALL = (
    *(
        f"{answer}_answer_mean:{method}"
        for answer in ("first", "result")
        for method in ("local", "remote", "genie")
    ),
    *(f"result_answered_share:{method}" for method in ("local", "remote", "genie")),
    *(
        f"{name}:{where}"
        for name in ("image_reuse", "object_reuse", "confidence_boost")
        for where in PLACEMENTS
    ),
    *(f"{name}:{where}" for name in ("stored_images", "stored_objects") for where in PLACEMENTS),
    "detector_runs",
    "objects_shared",
)


def small_version(scenario: str) -> dict[str, float]:
    """A few numbers of a scenario with one seed: what the regression test compares."""
    facts = EvaluationRun(scenario, 1, calibrated_settings()).facts()
    return {
        f"{scenario} {name}": float(f"{facts[fact(name)]:.9g}")
        for name in SMALL
        if fact(name) in facts
    }


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_the_small_evaluation_gives_the_committed_numbers(scenario: str):
    committed = {
        name: number
        for name, number in json.loads(COMMITTED.read_text())["numbers"].items()
        if name.split()[0] == scenario
    }
    found = small_version(scenario)
    assert found.keys() == committed.keys()
    changed = [
        f"{name}: {committed[name]:g} is now {found[name]:g}"
        for name in committed
        if not math.isclose(committed[name], found[name], rel_tol=RELATIVE, abs_tol=1e-12)
    ]
    assert not changed, "\n".join(
        [f"{len(changed)} of {len(committed)} changed; {__file__} says what to do", *changed]
    )


def test_numbers_are_committed_of_these_scenarios_alone():
    numbers = json.loads(COMMITTED.read_text())["numbers"]
    assert {name.split()[0] for name in numbers} == set(SCENARIOS)


def test_the_reason_of_the_last_change_stands_in_the_changelog():
    reason = json.loads(COMMITTED.read_text())["reason"]
    text = " ".join((REPOSITORY / "CHANGELOG.md").read_text(encoding="utf-8").split())
    assert " ".join(reason.split()) in text, f"CHANGELOG.md does not say: {reason}"


if __name__ == "__main__":
    numbers = {
        name: number for scenario in SCENARIOS for name, number in small_version(scenario).items()
    }
    COMMITTED.write_text(
        json.dumps({"reason": sys.argv[1], "numbers": numbers}, indent=1, sort_keys=True) + "\n"
    )
