"""The committed results are those of this code: what it simulates is compared with their rows.

The numbers of ``results/paper`` are a run each of a scenario and a seed. The row of one car is run
again each time, two seeds of the six scenarios in continuous integration, all ten at night.

When a change is meant: ``genie-sim reproduce --out results/paper``, then
``python -m studies.paper_pages``; the reason goes into the commit's message.
"""

from __future__ import annotations

import functools
from pathlib import Path

import pytest

from genie_sim.paper import numbers
from genie_sim.paper.checks import ALL, CASE
from genie_sim.paper.numbers import Number, Numbers
from genie_sim.paper.reproduce import declared_seeds
from genie_sim.paper.runs import planned

REPOSITORY = Path(__file__).resolve().parents[2]
PAPER = REPOSITORY / "results" / "paper"


@functools.cache
def committed() -> dict[tuple[str, int], Numbers]:
    """The numbers of the runs without a variant, by scenario and seed."""
    known: dict[tuple[str, int], Numbers] = {}
    for variant, scenario, seed, *of, value in numbers.read(PAPER).itertuples(index=False):
        if variant == "base":
            known.setdefault((scenario, seed), {})[Number(*map(str, of))] = value
    return known


def check(scenario: str, seed: int, tmp_path: Path) -> None:
    (run,) = (
        run for run in planned([seed]) if (run.scenario.name, run.variant) == (scenario, "base")
    )
    found = {
        Number(one.metric, one.method, one.placement, one.component): (
            float("nan") if one.value is None else one.value
        )
        for one in run.measure(tmp_path)
    }
    known = committed()[scenario, seed]
    both = known.keys() & found.keys()  # a metric may come or go without a change of numbers
    assert len(both) > 100
    changed = numbers.differences(*({of: row[of] for of in both} for row in (known, found)))
    assert not changed, "\n".join(
        [
            f"{scenario}, seed {seed}: {len(changed)} numbers differ from results/paper",
            f"{__file__} says what to do",
            *changed[:20],
        ]
    )


def test_one_car_gives_the_committed_row(tmp_path: Path):
    check("1car_homo", 1, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("scenario", ALL)
def test_the_six_scenarios_give_the_committed_rows(scenario, tmp_path):
    check(scenario, 2, tmp_path)


@pytest.mark.nightly
@pytest.mark.parametrize("scenario", [*ALL, CASE])
@pytest.mark.parametrize("seed", declared_seeds())
def test_all_seeds_give_the_committed_rows(scenario, seed, tmp_path):
    """And the verdicts follow from these rows (``test_reproduce``)."""
    check(scenario, seed, tmp_path)
