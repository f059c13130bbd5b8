"""Settings from the command line: where they go, and what is refused in one line."""

from __future__ import annotations

from typing import Any

import pytest

from genie_sim.base.errors import UserError
from genie_sim.scenario.overrides import Override, apply_overrides
from genie_sim.scenario.reading import load_scenario


def settings() -> dict[str, Any]:
    return {
        "cars": [{"name": "car1", "link": "wifi"}, {"name": "car2"}],
        "genie": {"capacity": "5 entries"},
        "edges": None,
        "seed": 3,
    }


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
        ("cars[0].link.rate=1 Mbit/s", ["cars", 0, "link"], {"like": "wifi", "rate": "1 Mbit/s"}),
        ("cars[1].link.rate=1 Mbit/s", ["cars", 1, "link"], {"rate": "1 Mbit/s"}),
    ],
)
def test_a_value_goes_where_its_path_leads(override: str, path: list[Any], value: Any):
    data: Any = settings()
    (applied,) = apply_overrides(data, [override])
    assert applied == Override(override.partition("=")[0].strip(), f"--set {override}")
    for step in path:
        data = data[step]
    assert data == value


def test_of_two_the_last_counts_and_is_named_first():
    data = settings()
    applied = apply_overrides(data, ["seed=5", "seed=6", "name=x"])
    assert data["seed"] == 6
    assert [override.text for override in applied] == [
        "--set name=x",
        "--set seed=6",
        "--set seed=5",
    ]


def test_a_list_grows_by_one_entry_at_a_time_also_of_lists():
    data: dict[str, Any] = {"rows": []}
    apply_overrides(data, ["rows[0][0]=1", "rows[0][1]=2", "rows[1]=3"])
    assert data == {"rows": [[1, 2], 3]}


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("seed", "must be path=value, such as cars[0].device=orin_nano"),
        ("=5", "must be path=value"),
        ("cars[x].name=5", "cannot read the path 'cars[x].name'; write it like cars[0].device"),
        ("cars[1234567]=5", "cannot read the path"),
        ("cars[3].name=5", "cars: has 2 entries, counted from 0; the next is cars[2]"),
        ("edges[0].name=e", "edges: is not a list in the scenario: it is null; set the whole list"),
        ("seed[0]=1", "seed: is not a list in the scenario"),
        ("seed.name=1", "seed: is 3, which has no setting 'name'"),
        ("genie.capacity.of=1", "genie.capacity: is '5 entries', which has no setting 'of'"),
        ("cars[0].link[0]=1", "cars[0].link: is not a list"),
    ],
)
def test_what_cannot_be_set_is_one_line(override: str, message: str):
    with pytest.raises(UserError) as error:
        apply_overrides(settings(), [override])
    assert str(error.value).startswith(f"--set {override}: ")
    assert message in str(error.value) and "\n" not in str(error.value)


def test_one_entry_is_counted_as_one():
    with pytest.raises(
        UserError, match=r"cars: has 1 entry, counted from 0; the next is cars\[1\]"
    ):
        apply_overrides({"cars": [{}]}, ["cars[2].name=x"])


def test_a_star_stands_for_every_entry_of_a_list():
    links = ["cars[*].link=wifi", "cars[1].link=nr5g", "edges[*].device=jetson_tx2"]
    each = ["cars[0].link=wifi", "cars[1].link=nr5g", "cars[2].link=wifi"]
    scenario, named = load_scenario("3car_hetero", links), load_scenario("3car_hetero", each)
    assert [car.link for car in scenario.cars] == [car.link for car in named.cars]
    assert {edge.device for edge in scenario.edges} == {"jetson_tx2"}


@pytest.mark.parametrize("path", ["convoy[*].link", "cars[*][*].link", "cars[0].route[*].laps"])
def test_a_star_where_no_list_is_names_the_place(path: str):
    with pytest.raises(UserError, match=r"^--set .*: is no list with entries in the scenario"):
        load_scenario("3car_hetero", [f"{path}=wifi"])
