"""Spaces of methods: which parameters count where, and what a point sets."""

from __future__ import annotations

from typing import Any

import pytest

from genie_sim.settings import SettingError, from_plain
from genie_sim.tuning.design import load
from genie_sim.tuning.space import Space, as_json, is_active

RULE = {"set": "genie.object_map.rule", "list": ["ema", "noisy_or"]}
RATE = {
    "set": "genie.object_map.rate",
    "range": {"from": 0.1, "to": 0.9},
    "when": {"rule": "ema"},
}
RADIUS = {"set": "method.radius", "range": {"from": 0.1, "to": 0.4}}
CASES = {"list": {"near": {"genie.view_range": "30 m"}, "far": {"genie.view_range": "90 m"}}}
NESTED = {"set": "seed", "list": [1, 2], "when": {"rule": ["noisy_or"], "view": ["near", "far"]}}


def space(**parameters: Any) -> Space:
    return from_plain(Space, {"method": "genie", "set": {"seed": 5}, "space": parameters})


def test_a_parameter_counts_where_those_before_it_have_the_values_it_names():
    of = space(rule=RULE, rate=RATE)
    rate = of.parameters["rate"]
    assert is_active(rate, {"rule": "ema"})
    assert not is_active(rate, {"rule": "noisy_or"}) and not is_active(rate, {})
    assert is_active(of.parameters["rule"], {})


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"rate": RATE, "rule": RULE}, "unknown earlier parameter 'rule'"),
        ({"rule": RULE, "rate": {**RATE, "when": {"rule": "max"}}}, "unknown rule 'max'"),
        ({"radius": RADIUS, "rate": {**RATE, "when": {"radius": 0.2}}}, "radius is a range"),
        ({"point": RULE}, "is a column of the tables"),
        ({"rule": {"set": "seed"}}, "must have either 'range' or 'list', has none"),
        (
            {"rule": {**RADIUS, "list": [1]}},
            "must have either 'range' or 'list', has range and list",
        ),
        ({"rule": {"list": [1, 2]}}, "say which setting"),
        ({"rule": {**RULE, "list": ["ema", "ema"]}}, "the value 'ema' comes twice"),
    ],
)
def test_spaces_that_cannot_be(parameters: dict[str, Any], message: str):
    with pytest.raises(SettingError) as error:
        space(**parameters)
    assert message in error.value.message


def test_fixed_settings_take_parameters_out_and_decide_conditions():
    of = space(rule=RULE, rate=RATE, view=CASES)
    assert {*of.free({})} == {"rule", "rate", "view"}
    assert {*of.free({"genie.view_range": "50 m"})} == {"rule", "rate"}
    assert of.known({"genie.object_map.rule": "ema", "seed": 1}) == {"rule": "ema"}
    assert of.known({"genie.view_range": "90 m"}) == {"view": "far"}
    assert of.known({}) == {}


def test_a_point_sets_the_method_and_the_scenario():
    of = space(rule=RULE, radius=RADIUS, view=CASES)
    values = {"rule": "ema", "radius": 0.25, "view": "far"}
    assert of.overrides("best", values, {"seed": 1, "record": ["held"]}) == (
        'methods=[{"name": "best", "method": "genie", "radius": 0.25}]',
        "seed=5",
        'record=["held"]',
        'genie.object_map.rule="ema"',
        'genie.view_range="90 m"',
    )
    titled = from_plain(Space, {"method": "genie", "title": "Süß", "space": {"rule": RULE}})
    (first, *_) = titled.overrides("best", {}, {})
    assert first == 'methods=[{"name": "best", "method": "genie", "title": "Süß"}]'
    assert as_json("ü") == '"ü"'


def test_samples_use_every_value_of_lists_and_both_ends_of_ranges():
    of = space(rule=RULE, rate=RATE, view=CASES, nested=NESTED)
    samples = list(of.samples({}))
    assert [values["rate"] for name, values in samples if name == "rate"] == [0.1, 0.9]
    assert all(values["rule"] == "ema" for name, values in samples if name == "rate")
    assert [values["rule"] for name, values in samples if name == "rule"] == ["ema", "noisy_or"]
    nested = [values for name, values in samples if name == "nested"]
    assert nested == [{"rule": "noisy_or", "view": "near", "nested": level} for level in (1, 2)]
    fixed = {"genie.object_map.rule": "noisy_or"}
    assert {name for name, _ in of.samples(fixed)} == {"view", "nested"}


def test_a_drawn_number_has_six_digits_and_stays_within_its_range():
    radius = space(radius=RADIUS).parameters["radius"]
    assert radius.rounded(0.123456789) == 0.123457
    assert radius.rounded(0.09) == 0.1 and radius.rounded(0.41) == 0.4


def test_changes_of_a_search_are_added_to_its_settings_and_replace_all_else():
    search = {
        "scenario": "1car_homo",
        "set": {"record": ["held"], "queue_length": 3},
        "methods": {"remote": {"method": "remote", "space": {"rule": RULE}}},
        "objectives": {"maximize": "streaming_f1", "minimize": "first_answer_p95"},
        "points": 3,
        "batch": 3,
    }
    changes = {"set": {"queue_length": 4, "spread": "loaded"}, "points": 5}
    design = load(search, changes=changes)
    assert design.settings == {"record": ["held"], "queue_length": 4, "spread": "loaded"}
    assert design.points == 5 and design.batch == 3
    plain = {key: value for key, value in search.items() if key != "set"}
    assert load(plain, changes={"set": {"queue_length": 4}}).settings == {"queue_length": 4}
