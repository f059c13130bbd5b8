"""Settings from the command line: where they go, and what is refused in one line."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from genie_sim.base.errors import UserError
from genie_sim.scenario.overrides import Override, apply_overrides
from genie_sim.scenario.reading import load_scenario, read_scenario
from genie_sim.scenario.scenario import Scenario


def settings() -> dict[str, Any]:
    return {
        "cars": [{"name": "car1", "link": "wifi"}, {"name": "car2"}],
        "genie": {"capacity": "5 entries"},
        "edges": None,
        "seed": 3,
        "methods": ["local", {"name": "x", "method": "genie", "genie": "literal"}],
        "fleet": {"devices": "jetson_tx2"},
    }


WIFI = {"like": "wifi", "rate": "1 Mbit/s"}


@pytest.mark.parametrize(
    ("override", "path", "value"),
    [
        ("seed=5", ["seed"], 5),
        (" seed =5", ["seed"], 5),
        ("name=a=b", ["name"], "a=b"),
        ("cars[1].device=orin", ["cars", 1, "device"], "orin"),
        ("cars[2].name=car3", ["cars", 2], {"name": "car3"}),
        ("genie.view_range=50 m", ["genie"], {"capacity": "5 entries", "view_range": "50 m"}),
        ("genie.object_map.rate=0.5", ["genie", "object_map"], {"rate": 0.5}),
        ("record=[held]", ["record"], ["held"]),
        ("record[0]=held", ["record", 0], "held"),
        # what is short for a mapping
        ("cars[0].link.rate=1 Mbit/s", ["cars", 0, "link"], WIFI),
        ("cars[1].link.rate=1 Mbit/s", ["cars", 1, "link"], {"rate": "1 Mbit/s"}),
        ("genie.capacity.bytes=1 MB", ["genie", "capacity"], {"entries": 5, "bytes": "1 MB"}),
        ("fleet.devices.orin=0.5", ["fleet", "devices"], {"jetson_tx2": 1.0, "orin": 0.5}),
        ("fleet.link.delay=1 ms", ["fleet", "link"], {"like": "nr5g", "delay": "1 ms"}),
        ("methods[0].title=Own", ["methods", 0], {"method": "local", "title": "Own"}),
        ("methods[1].genie.object_map.gate=3 m", ["methods", 1, "genie", "algorithm"], "literal"),
        (
            "methods[1].genie.object_map.gate=3 m",
            ["methods", 1, "genie", "object_map", "gate"],
            "3 m",
        ),
        (
            "genie.similarity.cell=1 m",
            ["genie", "similarity"],
            {"name": "pose_grid", "cell": "1 m", "heading": "15 deg"},
        ),
        # of a method, what is not written is as in the scenario
        ("methods[0].consumer.p_min=0.5", ["methods", 0, "consumer"], {"p_min": 0.5}),
        (
            "methods[0].genie.similarity.cell=1 m",
            ["methods", 0, "genie", "similarity"],
            {"cell": "1 m"},
        ),
        # lists that are not written
        ("cameras[1].phase=5 ms", ["cameras", 1, "recording"], "03"),
        ("cameras[1].phase=5 ms", ["cameras", 1, "phase"], "5 ms"),
    ],
)
def test_a_value_goes_where_its_path_leads(override: str, path: list[Any], value: Any):
    before = settings()
    data: Any
    data, (applied,) = apply_overrides(Scenario, before, [override])
    assert applied == Override(override.partition("=")[0].strip(), f"--set {override}")
    assert before == settings()
    for step in path:
        data = data[step]
    assert data == value


@pytest.mark.parametrize("entry", ["[0]", "[*]"])
def test_a_field_below_a_short_form_changes_and_the_rest_stays(entry: str):
    overrides = ["methods=[{name: exact, method: genie, genie: literal}]"]
    plain = load_scenario("3car_hetero", overrides)
    changed = load_scenario(
        "3car_hetero", [*overrides, f"methods{entry}.genie.object_map.gate=3 m"]
    )
    before, after = (scenario.method_settings["exact"].genie for scenario in (plain, changed))
    assert before.object_map.gate_m != 3.0
    assert after == replace(before, object_map=replace(before.object_map, gate_m=3.0))


def test_a_setting_of_a_method_itself_changes_and_the_rest_stays():
    before, after = (
        load_scenario("3car_recommended", overrides).methods[5].method.parameters
        for overrides in ([], ["methods[5].every=50 ms"])
    )
    assert after == {**before, "every_ns": 50_000_000} != before


def test_of_two_the_last_counts_and_is_named_first():
    data, applied = apply_overrides(Scenario, settings(), ["seed=5", "seed=6", "name=x"])
    assert data["seed"] == 6
    assert [override.text for override in applied] == [
        "--set name=x",
        "--set seed=6",
        "--set seed=5",
    ]


def test_a_list_grows_by_one_entry_at_a_time_also_of_lists():
    data, _ = apply_overrides(Scenario, {"rows": []}, ["rows[0][0]=1", "rows[0][1]=2", "rows[1]=3"])
    assert data == {"rows": [[1, 2], 3]}


@pytest.mark.parametrize(
    ("override", "place"),
    [
        ("seed", ""),
        ("=5", ""),
        ("cars[x].name=5", ""),
        ("cars[-1].name=5", ""),
        ("cars[0]name=5", ""),
        ("cars[1234567]=5", ""),
        ("genie..x=1", ""),
        ("genie={", "line 1: "),
        ("cars[3].name=5", "cars: "),
        ("cars[*][*].name=5", ""),
        ("edges[*].name=e", "edges: "),
        ("seed[0]=1", "seed: "),
        ("seed.name=1", "seed: "),
        ("cars.device=x", "cars: "),
        ("cars[0].link[0]=1", "cars[0].link: "),
    ],
)
def test_what_cannot_be_set_is_one_line(override: str, place: str):
    with pytest.raises(UserError) as error:
        apply_overrides(Scenario, settings(), [override])
    assert str(error.value).startswith(f"--set {override}: {place}")
    assert "\n" not in str(error.value)


def test_whole_lines():
    lines = {
        "seed": "must be path=value, such as cars[0].device=orin_nano",
        "cars.device=x": "cars: is a list; did you mean cars[*].device, or cars[0].device?",
        "cars[3].name=5": "cars: has 2 entries, counted from 0; the next is cars[2]",
    }
    for override, line in lines.items():
        with pytest.raises(UserError) as error:
            apply_overrides(Scenario, settings(), [override])
        assert str(error.value) == f"--set {override}: {line}"


@pytest.mark.parametrize(
    ("overrides", "blamed", "field"),
    [
        (["seed.x=1"], 0, "seed"),
        (["genie.similarity={name: [x]}", "genie.similarity.cell=1 m"], 0, "genie.similarity.name"),
        (["seed=2", "cars[3].name=car4"], 1, "cars[3].device"),
        (["cars[*].nam=x", "seed=2"], 0, "cars[0].nam"),
        (["genie.capacity.of=1"], 0, "genie.capacity.of"),
        (["consumer.p_min=0.5", "seed=3"], 0, "consumer.p_min"),
        (["cars[0].edge=edge9", "seed=3"], 0, "cars[0].edge"),
    ],
)
def test_blame_goes_to_what_was_typed(overrides: list[str], blamed: int, field: str):
    with pytest.raises(UserError) as error:
        load_scenario("3car_hetero", overrides)
    assert str(error.value).startswith(f"--set {overrides[blamed]}: {field}: ")


def test_a_mistake_of_the_file_is_not_blamed_on_what_was_typed():
    data = {"name": "x", "cars": [{"name": "car1", "device": "jetson_tx2", "edge": "none"}]}
    with pytest.raises(UserError, match=r"^mine.yaml: cars\[0\].edge: "):
        read_scenario(data, ["cars[0].name=car2"], where="mine.yaml")


def test_a_star_stands_for_every_entry_of_a_list():
    links = ["cars[*].link=wifi", "cars[1].link=nr5g", "edges[*].device=jetson_tx2"]
    each = ["cars[0].link=wifi", "cars[1].link=nr5g", "cars[2].link=wifi"]
    scenario, named = load_scenario("3car_hetero", links), load_scenario("3car_hetero", each)
    assert [car.link for car in scenario.cars] == [car.link for car in named.cars]
    assert {edge.device for edge in scenario.edges} == {"jetson_tx2"}
