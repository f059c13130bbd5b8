"""Scenarios: what is written is what is simulated, and a mistake is told in one line before
anything runs.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from genie_sim.base import files
from genie_sim.base.errors import UserError
from genie_sim.base.plugins import resolve
from genie_sim.base.settings import (
    PlugIn,
    is_settings_class,
    keys_of,
    mark_in,
    plain_data,
    settings_of,
)
from genie_sim.core.confidence import CONFIDENCE_RULES
from genie_sim.core.eviction import EVICTIONS
from genie_sim.core.rules import LITERAL, Capacity
from genie_sim.core.similarity import SIMILARITIES
from genie_sim.data.sources import SOURCES
from genie_sim.links.presets import LINKS
from genie_sim.links.wire import Wire
from genie_sim.scenario.faults import FaultEntry
from genie_sim.scenario.fleet import Fleet
from genie_sim.scenario.methods import METHOD
from genie_sim.scenario.reading import load_scenario, read_scenario
from genie_sim.scenario.scenario import Scenario, as_yaml
from genie_sim.scenario.schema import json_schema
from genie_sim.scenario.yaml_input import parse, read_mapping
from genie_sim.sim.fault import FAULTS
from genie_sim.sim.link_model import LINK_MODELS
from genie_sim.sim.method import METHODS

ROOT = Path(__file__).parents[2]
PAPER = [f"{cars}car_{kind}" for cars in (1, 2, 3) for kind in ("homo", "hetero")]
TWO_CARS = """\
edges:
  - {name: edge1, device: agx_xavier}
cars:
  - {name: car1, device: jetson_tx2, edge: edge1}
  - {name: car2, device: jetson_tx2, edge: edge1}
"""


@pytest.fixture(autouse=True)
def a_folder_of_the_users(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An own folder with a trace in it; whether a trace can be read is not the scenario's
    business.
    """
    (tmp_path / "scenarios/traces").mkdir(parents=True)
    (tmp_path / "scenarios/traces/kitti_0005.parquet").touch()
    monkeypatch.chdir(tmp_path)


def scenario(text: str = TWO_CARS, *overrides: str) -> Scenario:
    Path("x.yaml").write_text(text)
    return load_scenario("x.yaml", overrides)


def refusal(text: str, *overrides: str) -> str:
    with pytest.raises(UserError) as error:
        scenario(text, *overrides)
    assert "\n" not in str(error.value)
    return str(error.value)


def reread(original: Scenario) -> Scenario:
    text = as_yaml(plain_data(original))
    assert text.startswith("name: "), "a line for each setting"
    Path("scenario.resolved.yaml").write_text(text)
    return load_scenario("scenario.resolved.yaml")


@pytest.mark.parametrize("name", PAPER)
def test_the_papers_six_scenarios(name: str) -> None:
    paper = load_scenario(name)
    cars = int(name[0])
    assert (paper.name, len(paper.cars), len(paper.edges)) == (name, cars, cars)
    assert [car.device for car in paper.cars] == ["jetson_tx2"] * cars
    first_edge = "quadro_rtx_4000" if name.endswith("hetero") else "agx_xavier"
    assert [edge.device for edge in paper.edges] == [first_edge] + ["agx_xavier"] * (cars - 1)
    assert [car.edge for car in paper.cars] == [edge.name for edge in paper.edges]
    routes = [(car.route.window_ns, car.route.start_ns, car.route.laps) for car in paper.cars]
    assert routes == [(None, place * 1_000_000_000, 2) for place in range(cars)]
    street = load_scenario(f"street_{name}")
    windows_s = [
        [instant_ns / 1e9 for instant_ns in car.route.window_ns or ()] for car in street.cars
    ]
    assert windows_s == [[0, 9.2], [3.1, 12.3], [6.2, 15.4]][:cars]
    hint_for_editors, *lines = (ROOT / f"scenarios/{name}.yaml").read_text().splitlines()
    assert hint_for_editors.startswith("# yaml-language-server") and len(lines) <= 25


def test_the_file_of_all_settings_shows_every_setting_at_its_default() -> None:
    shown = load_scenario("all_settings")
    small = scenario()
    own = {"name", "description", "edges", "cars"}
    for field in {setting.name for setting in settings_of(Scenario)} - own:
        assert getattr(shown, field) == getattr(small, field), field
    assert shown.cars[0] == replace(small.cars[0], name="car1")
    assert shown.cars[1] == small.cars[1]

    written = read_mapping(ROOT / "scenarios/all_settings.yaml")
    assert written["cars"][1]["link"].keys() == {"like", "model", *keys_of(Wire)}
    assert unwritten(Scenario, written) == []


def unwritten(cls: Any, written: dict[str, Any], path: str = "") -> list[str]:
    """The settings of a class and of those in it that ``written`` leaves out; of lists the first
    counts.
    """
    found = []
    for setting in settings_of(cls):
        if setting.key not in written:
            found.append(f"{path}{setting.key}")
            continue
        value = written[setting.key]
        value = value[0] if isinstance(value, list) and value else value
        if isinstance(value, dict):
            for inner in inner_classes(setting.annotation, value):
                found += unwritten(inner, value, f"{path}{setting.key}.")
    return found


def inner_classes(kind: Any, value: dict[str, Any] | None = None) -> Iterator[Any]:
    """The settings classes in a type; of a plug-in, the class that ``value`` names."""
    mark = mark_in(kind, PlugIn)
    if mark is not None and value is not None and "like" not in value:
        yield resolve(mark.what, str(value[mark.key]), mark.registry)
    if is_settings_class(kind):
        yield kind
    for argument in get_args(kind) if get_origin(kind) is not Literal else ():
        yield from inner_classes(argument)


def test_the_file_of_all_settings_names_every_choice() -> None:
    text = (ROOT / "scenarios/all_settings.yaml").read_text()
    literals = {choice for line in literal_choices(Scenario) for choice in line}
    of_sections = (
        *keys_of(Fleet),
        *keys_of(FaultEntry),
        *METHOD.keys_beside,
    )
    registries = (
        SIMILARITIES,
        EVICTIONS,
        CONFIDENCE_RULES,
        LINKS,
        LINK_MODELS,
        METHODS,
        FAULTS,
        SOURCES,
    )
    of_plug_ins = (
        setting
        for what, registry in (("fault", FAULTS), ("frame source", SOURCES))
        for name in registry
        for setting in keys_of(resolve(what, name, registry))
    )
    for choice in (*literals, *chain(*registries), *of_sections, *of_plug_ins):
        assert choice in text, choice
    for device in files.available(files.DEVICE):
        assert device in text, device


def literal_choices(kind: Any) -> Iterator[tuple[str, ...]]:
    """The choices of every setting in a type, at any depth."""
    if get_origin(kind) is Literal:
        yield get_args(kind)
    elif is_settings_class(kind):
        for setting in settings_of(kind):
            yield from literal_choices(setting.annotation)
    else:
        for argument in get_args(kind):
            yield from literal_choices(argument)


def test_the_literal_algorithm_is_a_preset() -> None:
    literal = scenario(TWO_CARS, "genie.algorithm=literal").genie
    assert literal.request_expiry_ns is None
    assert (literal.object_map.rule, literal.object_map.one_per_location) == ("literal", True)
    plain = set(LITERAL) - {"similarity", "request_expiry", "object_map"}
    assert {key: getattr(literal, key) for key in plain} == {key: LITERAL[key] for key in plain}
    mixed = scenario(
        TWO_CARS,
        "genie.algorithm=literal",
        "genie.miss_policy=blocking",
        "genie.object_map.rule=ema",
    ).genie
    assert (mixed.miss_policy, mixed.neighbour_miss) == ("blocking", "process")
    assert (mixed.object_map.rule, mixed.object_map.one_per_location) == ("ema", True)


def test_similarities_take_the_parameters_of_their_class() -> None:
    assert scenario(TWO_CARS, "genie.similarity=exact").genie.similarity.parameters == {}
    dhash = scenario(TWO_CARS, "genie.similarity={name: dhash, radius: 4}").genie.similarity
    assert dhash.parameters == {"radius": 4}
    assert scenario(TWO_CARS, "genie.similarity=dhash").genie.similarity.parameters == {"radius": 8}
    own = scenario(TWO_CARS, "genie.similarity={name: my.code:Same, cell_m: 2}").genie.similarity
    assert (own.name, own.parameters) == ("my.code:Same", {"cell_m": 2})


def test_capacities() -> None:
    assert scenario(TWO_CARS, "genie.capacity=1000 entries").genie.capacity == Capacity(
        entries=1000
    )
    assert scenario(TWO_CARS, "genie.capacity=10 MB").genie.capacity == Capacity(bytes=10**7)
    both = scenario(TWO_CARS, "genie.capacity={entries: 5, bytes: 1 MiB}").genie.capacity
    assert both == Capacity(entries=5, bytes=2**20)


def test_a_users_own_device(tmp_path: Path) -> None:
    own = (
        (ROOT / "device_profiles/jetson_tx2.yaml")
        .read_text()
        .replace("name: jetson_tx2", "name: mine")
    )
    Path("mine.yaml").write_text(own)
    assert scenario(TWO_CARS, "cars[0].device=./mine.yaml").cars[0].device == "./mine.yaml"


def test_a_whole_number_is_refused_that_would_not_read_back() -> None:
    most = 10**18 - 1
    longest = load_scenario("street_1car_homo", seed=most)
    assert reread(longest).seed == scenario(TWO_CARS, f"seed={most}").seed == most
    with pytest.raises(UserError, match="seed: must have at most 18 digits"):
        load_scenario("street_1car_homo", seed=most + 1)


@pytest.mark.parametrize("name", [*PAPER, "all_settings"])
def test_the_resolved_scenario_reads_back(name: str) -> None:
    assert reread(load_scenario(name)) == load_scenario(name)


durations = st.integers(0, 10**12).map(lambda ns: f"{ns} ns")
choices = st.fixed_dictionaries(
    {},
    optional={
        "algorithm": st.sampled_from(["default", "literal"]),
        "similarity": (
            st.sampled_from(["exact", "dhash", "my.code:Same"])
            | st.floats(1e-3, 1e3).map(
                lambda cell: {
                    "name": "pose_grid",
                    "cell": f"{cell} m",
                    "heading": f"{cell / 3} deg",
                }
            )
        ),
        "eviction": st.sampled_from(["fifo", "lru", "lfu"]),
        "capacity": st.sampled_from([None, "7 entries", "1.5 kB"]),
        "miss_policy": st.sampled_from(["immediate", "blocking", "hits_only"]),
        "request_expiry": st.none() | st.integers(10**9, 10**12).map(lambda ns: f"{ns} ns"),
        "view_range": st.floats(1e-3, 1e3).map(lambda metres: f"{metres} m"),
        "object_map": st.fixed_dictionaries(
            {
                "rate": st.floats(0, 1),
                "threshold": st.floats(0, 1) | st.just({"percentile": 60.0}),
            }
        ),
    },
)
links = st.sampled_from(sorted(LINKS)) | st.fixed_dictionaries(
    {
        "loss": st.floats(0, 1),
        "rate_up": st.integers(1, 10**10).map(lambda bps: f"{bps} bit/s"),
        "delay": durations,
    }
)
names = st.from_regex(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,10}", fullmatch=True)


@pytest.mark.slow
@settings(max_examples=40, deadline=None)  # each reads the devices' profiles twice
@given(
    names,
    st.text(st.characters(codec="utf-8", exclude_categories=("Cc", "Cs"))),
    choices,
    links,
    durations,
    names,
)
def test_whatever_is_resolved_reads_back(
    name: str, text: str, genie: Any, link: Any, start: str, camera: str
) -> None:
    original = read_scenario(
        {
            "name": name,
            "description": text,
            "perception": {"source": "recorded"},
            "cameras": [{"name": camera, "recording": camera}],
            "edges": [{"name": "an_edge", "device": "agx_xavier"}],
            "cars": [
                {
                    "name": "a_car",
                    "device": "jetson_tx2",
                    "edge": "an_edge",
                    "link": link,
                    "route": {"start": start},
                }
            ],
            "genie": genie,
        }
    )
    assert read_scenario(parse(as_yaml(plain_data(original)), "resolved")) == original


def test_of_several_mistakes_the_first_is_told_and_the_others_counted() -> None:
    told = refusal(
        TWO_CARS.replace("edge: edge1}", "edge: edge1, route: {laps: 0, start: 3}}") + "seed: x\n"
    )
    assert told == "x.yaml: seed: must be a whole number, not 'x' (and 4 more mistakes)"


def test_unknown_scenarios() -> None:
    with pytest.raises(
        UserError,
        match=r"^unknown scenario '3cars_hetero' \(did you mean '3car_hetero'\?\)",
    ):
        load_scenario("3cars_hetero")
    with pytest.raises(UserError, match=r"^./gone.yaml: no such file$"):
        load_scenario("./gone.yaml")


def test_a_schema_for_editors_comes_for_free() -> None:
    schema = json_schema("scenario")
    assert "required" not in schema, "the file's name stands for the scenario's"
    assert schema["anyOf"] == [{"required": [who]} for who in ("cars", "fleet")]
    assert schema["properties"]["start_jitter"]["anyOf"] == [
        {"type": "string", "examples": ["30 ms"]},
        {"const": 0},
    ]


@pytest.mark.slow
@given(
    st.recursive(
        st.none() | st.booleans() | st.integers() | st.text(),
        lambda x: (
            st.lists(x)
            | st.dictionaries(
                st.text()
                | st.sampled_from(
                    [
                        "cars",
                        "edges",
                        "genie",
                        "name",
                        "device",
                        "edge",
                        "link",
                        "route",
                        "like",
                        "source",
                    ]
                ),
                x,
            )
        ),
    )
)
def test_whatever_is_given_ends_in_a_scenario_or_in_one_line(data: Any) -> None:
    try:
        read_scenario({"name": "x", "cars": data, "edges": data, "genie": data, "perception": data})
    except UserError as error:
        assert str(error).startswith("scenario: ") and "\n" not in str(error)
