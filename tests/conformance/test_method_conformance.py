"""The shipped methods and one of the tests' own, and what scenarios may say about methods."""

from __future__ import annotations

from dataclasses import replace

import pytest

from genie_sim.base.errors import UserError
from genie_sim.base.plugins import Choice
from genie_sim.base.settings import plain_data
from genie_sim.core.messages import Publish
from genie_sim.runs.folder import run_in_memory
from genie_sim.scenario.methods import MethodEntry
from genie_sim.scenario.reading import read_scenario
from genie_sim.sim.method import METHODS
from tests.conformance import small
from tests.conformance.methods import MethodConformance
from tests.conformance.own import Again, Latest

AGAIN = "tests.conformance.own:Again"


@pytest.mark.parametrize("method", METHODS)
class TestShipped(MethodConformance):
    pass


@pytest.mark.parametrize("method", [AGAIN])
class TestOwn(MethodConformance):
    pass


def test_a_method_of_a_name_that_nobody_knows_never_runs():
    """Neither out of a scenario nor when somebody makes the entry by hand."""
    with pytest.raises(
        UserError,
        match=r"^scenario: methods\[1\]: unknown method 'gene' \(did you mean 'genie'\?\)",
    ):
        small.scenario(["local", "gene"])
    with pytest.raises(UserError, match=r"unknown method 'gene'"):
        small.scenario([{"name": "mine", "method": "gene"}])
    entry = MethodEntry(name="gene", method=Choice("gene"))
    with pytest.raises(
        UserError,
        match=r"^unknown method 'gene' \(did you mean 'genie'\?\)",
    ):
        entry.new()
    with pytest.raises(UserError, match="unknown method 'gene'"):
        run_in_memory(replace(small.scenario(), methods=(entry,)))


@pytest.mark.parametrize(
    ("method", "message"),
    [
        ("tests.conformance.own:Nobody", "has no attribute 'Nobody'"),
        ("tests.conformance.nowhere:Again", "No module named"),
        ("tests.conformance.own:Radio", "has no title, baseline, on_car, on_edge"),
        (
            {"method": AGAIN, "evry": 3},
            r"unknown parameter of .*:Again 'evry' \(did you mean 'every'",
        ),
    ],
)
def test_a_method_of_ones_own_that_does_not_work_is_one_line(method, message: str):
    with pytest.raises(UserError, match=message) as error:
        run_in_memory(small.scenario([method]))
    assert "\n" not in str(error.value)


class Astray(Again):
    """Its answers go to a topic that it has not named."""

    def on_car(self, host):
        return replace(super().on_car(host), interceptor=lambda *_: Lost(host, 1))


class Lost(Latest):
    def on_message(self, *arguments):
        effects = super().on_message(*arguments)
        return [
            Publish("/objcts", effect.message) if isinstance(effect, Publish) else effect
            for effect in effects
        ]


def test_a_topic_that_an_own_interceptor_has_not_named_is_one_line():
    with pytest.raises(UserError, match="publishes on an unknown topic '/objcts'"):
        run_in_memory(small.scenario([f"{__name__}:Astray"]))


def test_one_method_several_times_with_other_settings():
    """Three Genies beside a plain method: each has its own rules, its own name, and its own
    rows.
    """
    entries = [
        "genie",
        {"name": "tiny", "method": "genie", "genie": {"eviction": "lru", "capacity": "2 entries"}},
        {
            "name": "strict",
            "method": "genie",
            "title": "exact Genie",
            "genie": {"similarity": "exact"},
        },
        {"name": "half", "method": AGAIN, "every": 2},
        "remote",
    ]
    slow = {"perception": {"source": "tests.conformance.own:Street", "speed_mps": 1.0}}
    scenario = small.scenario(entries, **slow)
    swapped = small.scenario([entries[1], entries[0]], **slow)
    run = run_in_memory(scenario)
    assert [one.name for one in run.methods] == ["genie", "tiny", "strict", "half", "remote"]
    assert [one.title for one in run.methods] == [
        "Genie (DG)",
        "tiny",
        "exact Genie",
        "half",
        "remote (R)",
    ]
    assert [one.baseline for one in run.methods] == [False, False, False, False, True]
    most = (
        run.lookups[run.lookups["kind"] == "image"]
        .groupby("method", observed=True)["entries"]
        .max()
    )
    assert most["tiny"] <= 2 < most["strict"] <= most["genie"] * 10
    hits = run.frames.groupby("method", observed=True)["image_hit"].sum()
    assert hits["strict"] == 0 < hits["genie"]
    assert 0 < hits["half"] < small.FRAMES * 2
    made = [small.rows(small.simulated(one)) for one in (scenario, swapped)]
    for name in ("genie", "tiny"):
        small.same(*(small.of(name, rows) for rows in made))
    assert read_scenario(plain_data(scenario)).methods == scenario.methods


def test_each_method_that_is_no_baseline_is_compared_with_each_that_is():
    run = run_in_memory(small.scenario(["remote", AGAIN, "local", "genie"]))
    compared = {
        (one.method, one.component) for one in run.measured if one.metric.startswith("improvement")
    }
    assert compared == {
        (mine, usual) for mine in ("Again", "genie") for usual in ("remote", "local")
    }
    alone = run_in_memory(small.scenario([AGAIN, "genie"]))
    assert not [one for one in alone.measured if one.metric.startswith("improvement")], (
        "nothing to compare with"
    )
