"""The committed results are those of this code: what it simulates is compared with their rows.

The numbers of ``results/paper`` are a run each of a scenario and a seed. Two seeds of the six
scenarios are run again each time, all ten at night. Where the sources differ from those that made
the results, a declared sample of the other readings is run, too.

When a change is meant: ``genie-sim reproduce --out results/paper``, then
``python -m tests.paper.test_reproduce``, and ``python -m tests.paper.test_regression "reason"``;
the reason goes, word for word, into CHANGELOG.md.
"""

from __future__ import annotations

import functools
import hashlib
import json
import sys
from pathlib import Path

import pytest

from genie_sim.paper import rows, sources
from genie_sim.paper.checks import ALL, CASE
from genie_sim.paper.evidence import BASE
from genie_sim.paper.readings import MAIN, load_reading
from genie_sim.paper.reproduce import calibrated_settings, declared_seeds
from genie_sim.paper.runs import EvaluationRun
from genie_sim.scenario.yaml_input import read_mapping

REPOSITORY = Path(__file__).resolve().parents[2]
PAPER = REPOSITORY / "results" / "paper"
CHANGE = Path(__file__).with_name("regression.json")
SAMPLE = read_mapping(sources.ASSUMPTIONS)["evaluation"]["sample"]


@functools.cache
def committed():
    return rows.read(PAPER)


def differences(reading: str, scenario: str, seed: int) -> list[str]:
    """What a run gives that the committed row does not say, answer quality left out."""
    settings = load_reading(reading).settings(calibrated_settings())
    found = EvaluationRun(scenario, seed, settings).simulate().facts
    known = committed()[reading, BASE, scenario][seed]
    return rows.differences({fact: known[fact] for fact in known if fact in found}, found)


def check(reading: str, scenario: str, seed: int) -> None:
    changed = differences(reading, scenario, seed)
    assert not changed, "\n".join(
        [
            f"{reading}, {scenario}, seed {seed}: {len(changed)} numbers differ from results/paper",
            f"{__file__} says what to do",
            *changed[:20],
        ]
    )


@pytest.mark.slow
@pytest.mark.parametrize("seed", declared_seeds()[:2])
@pytest.mark.parametrize("scenario", ALL)
def test_two_seeds_of_the_six_scenarios_give_the_committed_rows(scenario: str, seed: int):
    check(MAIN, scenario, seed)


@pytest.mark.nightly
@pytest.mark.parametrize("scenario", [*ALL, CASE])
@pytest.mark.parametrize("seed", declared_seeds())
def test_all_seeds_give_the_committed_rows(scenario: str, seed: int):
    """And the verdicts follow from these rows (``test_reproduce``)."""
    check(MAIN, scenario, seed)


def test_the_results_say_which_sources_made_them():
    known = json.loads((PAPER / "run.json").read_text())["sources"]
    assert known.keys() == sources.digests().keys()


@pytest.mark.slow
@pytest.mark.parametrize("reading", SAMPLE["readings"])
@pytest.mark.parametrize("scenario", SAMPLE["scenarios"])
def test_results_of_other_sources_are_refused_unless_a_sample_is_equal(reading, scenario):
    if json.loads((PAPER / "run.json").read_text())["sources"] == sources.digests():
        return  # made by this code
    for seed in SAMPLE["seeds"]:
        check(reading, scenario, seed)


def test_a_number_that_differs_is_named():
    facts = committed()[MAIN, BASE, ALL[0]][1]
    fact = next(fact for fact, value in sorted(facts.items()) if value > 0)
    assert rows.differences(facts, facts) == []
    assert rows.differences(facts, facts | {fact: facts[fact] * (1 + 1e-9)}) == []
    (line,) = rows.differences(facts, facts | {fact: facts[fact] * 1.01})
    assert line.startswith(f"{fact}: ") and " is now " in line
    assert rows.differences(facts, {f: v for f, v in facts.items() if f != fact}) == [str(fact)]


def test_the_reason_of_the_last_change_stands_in_the_changelog():
    change = json.loads(CHANGE.read_text())
    digest = hashlib.sha256((PAPER / rows.FILE).read_bytes()).hexdigest()
    assert change["rows"] == digest, f"results/paper changed: {__file__} says what to do"
    text = " ".join((REPOSITORY / "CHANGELOG.md").read_text(encoding="utf-8").split())
    assert " ".join(change["reason"].split()) in text, (
        f"CHANGELOG.md does not say: {change['reason']}"
    )


if __name__ == "__main__":
    digest = hashlib.sha256((PAPER / rows.FILE).read_bytes()).hexdigest()
    CHANGE.write_text(json.dumps({"reason": sys.argv[1], "rows": digest}, indent=1) + "\n")
