"""Paced looks that cannot be: each in one line that names the field, the value and the choices."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from genie_sim.base.errors import UserError
from genie_sim.runs.prepare import notes, prepare
from genie_sim.scenario.reading import load_scenario, read_scenario
from genie_sim.scenario.yaml_input import parse

NO_EFFECT = "has no effect with looks, which keep no answers; leave it out"
TRACKS = "'never' does not track, which 'looks' need; known: track, existence, recommended"
POLICY = "has no effect with freshness 'recommended'; leave it out"
LRU = "methods=[{name: paced, method: genie, genie: {algorithm: recommended, eviction: lru}}]"


@pytest.mark.parametrize(
    ("genie", "message"),
    [
        ("similarity: exact", f"similarity: 'exact' {NO_EFFECT}"),
        ("similarity: {cell: 2 m}", "similarity: {'name': 'pose_grid', 'cell': '2 m', "),
        ("eviction: lru", f"eviction: 'lru' {NO_EFFECT}"),
        ("ttl: 10 s, eviction: ttl", f"eviction: 'ttl' {NO_EFFECT}"),
        ("capacity: 9 entries", f"capacity: {{'entries': 9, 'bytes': None}} {NO_EFFECT}"),
        ("car_capacity: 9 entries", f"car_capacity: {{'entries': 9, 'bytes': None}} {NO_EFFECT}"),
        ("pending_index: per_topic", f"pending_index: 'per_topic' {NO_EFFECT}"),
        ("header_identity: stamp", f"header_identity: 'stamp' {NO_EFFECT}"),
        ("same_key_pending: forward", f"same_key_pending: 'forward' {NO_EFFECT}"),
        ("replay_stamp: stored", f"replay_stamp: 'stored' {NO_EFFECT}"),
        ("second_answer: merge", f"second_answer: 'merge' {NO_EFFECT}"),
        ("neighbour_miss: process", f"neighbour_miss: 'process' {NO_EFFECT}"),
        ("share_answers: on_request", f"share_answers: 'on_request' {NO_EFFECT}"),
        ("request_expiry: 1 s", f"request_expiry: '1 s' {NO_EFFECT}"),
        ("fresh_objects: all", f"fresh_objects: 'all' {NO_EFFECT}"),
        ("share_filter: all", f"share_filter: 'all' {NO_EFFECT}"),
        ("car_learns: own", f"car_learns: 'own' {NO_EFFECT}"),
        ("passes: 2", "passes: 2 has no effect with a pass_time of its own; leave it out"),
        ("object_map: {gate: 2 m}", f"object_map.gate: '2 m' {POLICY}"),
        ("object_map: {location_key: exact}", f"object_map.location_key: 'exact' {POLICY}"),
        ("object_map: {one_per_location: true}", f"object_map.one_per_location: True {POLICY}"),
        ("object_map: {rule: ema}", f"object_map.rule: 'ema' {POLICY}"),
        ("object_map: {rate: 0.3}", f"object_map.rate: 0.3 {POLICY}"),
        ("object_map: {threshold: 0.3}", f"object_map.threshold: 0.3 {POLICY}"),
        (
            "object_map: {confidence_source: origins}",
            f"object_map.confidence_source: 'origins' {POLICY}",
        ),
        (
            "miss_policy: blocking",
            "miss_policy: must be 'immediate' with 'looks', which answer at once, not 'blocking'",
        ),
        ("object_map: {freshness: never}", f"object_map.freshness: {TRACKS}"),
        (
            "edge: behind",
            "edge: unknown field; did you mean 'cars[0].edge' or 'genie.looks.edge' or "
            "'cars[0].further_uplinks[0].edge'?",
        ),
        (
            "looks: {edge: behind}",
            "looks.edge: unknown edge 'behind' (did you mean 'beside'?); known: beside, in_front,"
            " none",
        ),
        (
            "looks: {edge: none, told: {gate: 1 m}}",
            "looks.told: needs a Genie beside edges, so 'edge: beside', not 'none'",
        ),
        ("looks: {every: -1 ms}", "looks.every: must not be negative, but is '-1 ms'"),
        ("looks: {in_flight: 0}", "looks.in_flight: must be at least 1, not 0"),
        ("looks: {stale: 0 ms}", "looks.stale: must be more than zero, but is '0 ms'"),
        ("looks: {own: some}", "looks.own: unknown own 'some'; known: all, free, rest"),
        ("looks: {view_margin: -1 deg}", "looks.view_margin: must not be negative"),
        ("looks: {told: autoo}", "looks.told: unknown told 'autoo' (did you mean 'auto'?)"),
        ("looks: {told: {gate: -1 m}}", "looks.told.gate: must not be negative, but is '-1 m'"),
        ("looks: {told: {self: -1 m}}", "looks.told.self: must not be negative, but is '-1 m'"),
        ("looks: {told: {reach: 0 m}}", "looks.told.reach: must be more than zero"),
        ("looks: {told: {fresh: 0 s}}", "looks.told.fresh: must be more than zero"),
        ("looks: {told: {p_min: 1.2}}", "looks.told.p_min: must be from 0 to 1, not 1.2"),
        ("looks: {told: {gate: 2 m}}", "looks.told: cars replay recordings at different times"),
    ],
)
def test_what_cannot_be_with_paced_looks_is_refused(genie: str, message: str):
    entry = f"{{name: paced, method: genie, genie: {{algorithm: recommended, {genie}}}}}"
    refused(f"methods=[{entry}]", f"methods[0].genie.{message}")


@pytest.mark.parametrize(
    ("genie", "overrides", "source"),
    [
        ("similarity: exact", [], None),
        ("", ["methods[0].genie.similarity=exact"], "--set methods[0].genie.similarity=exact: "),
    ],
)
def test_the_file_or_the_option_is_named(
    genie: str, overrides: list[str], source: str | None, tmp_path: Path
):
    path = tmp_path / "paced.yaml"
    entry = f"{{name: paced, method: genie, genie: {{algorithm: recommended, {genie}}}}}"
    car = "{name: car1, device: jetson_tx2}"
    path.write_text(f"name: paced\nmethods: [{entry}]\ncars: [{car}]\n")
    with pytest.raises(UserError) as error:
        load_scenario(path, overrides)
    refusal = f"methods[0].genie.similarity: 'exact' {NO_EFFECT}"
    assert str(error.value) == (source or f"{path}: ") + refusal


def test_what_only_other_methods_use_is_not_refused():
    """A setting of the whole scenario concerns the paper's Genie beside the recommended one."""
    methods = "methods=[genie, {name: paced, method: genie, genie: {algorithm: recommended}}]"
    scenario = load_scenario("street_1car_homo", [methods, "genie.similarity=exact"])
    assert scenario.method_settings[scenario.methods[0].name].genie.similarity.name == "exact"


def test_a_car_without_cameras_has_a_cache_with_settings():
    """What is refused is that the cars of this scenario cannot be told of one another."""
    genie = "algorithm: recommended, similarity: {cell: 2 m}, looks: {told: {gate: 1 m}}"
    with pytest.raises(UserError, match=r"genie\.looks\.told: cars replay recordings"):
        load_scenario(
            "street_case_study", [f"methods=[{{name: paced, method: genie, genie: {{{genie}}}}}]"]
        )


def test_a_genie_in_front_of_edges_has_a_cache():
    """So its settings have an effect."""
    load_scenario(
        "street_1car_homo", [LRU.replace("eviction", "looks: {edge: in_front}, eviction")]
    )
    places = "looks: {edge: in_front}, object_map: {gate: 2 m}, eviction"
    load_scenario("street_1car_homo", [LRU.replace("eviction", places)])


@pytest.mark.parametrize(
    ("edge", "tells"), [("beside", True), ("none", False), ("in_front", False)]
)
def test_only_a_genie_beside_the_edge_tells_by_itself(edge: str, tells: bool):
    """In a town, where all cars are in one world."""
    entry = (
        f"{{name: mine, method: genie, genie: {{algorithm: recommended, looks: {{edge: {edge}}}}}}}"
    )
    scenario = load_scenario("town_recommended", [f"methods=[{entry}]"])
    looks = scenario.method_settings[scenario.methods[0].name].genie.looks
    assert looks is not None and (looks.told is not None) == tells


def test_without_a_genie_beside_the_edge_nobody_is_told_that_it_is_silent():
    entry = "{name: mine, method: genie, genie: {algorithm: recommended, looks: {edge: none}}}"
    assert notes(load_scenario("street_3car_hetero", [f"methods=[{entry}]"])) == []


def test_every_setting_written_out_is_read_back():
    scenario = load_scenario("street_1car_homo", ["genie=recommended"])
    assert read_scenario(parse(scenario.to_yaml(), "written")) == scenario


def test_the_time_to_pass_a_message_on_needs_looks():
    refused("genie.pass_time=1 ms", "genie.pass_time: has no effect without 'looks'")


def refused(override: str, message: str) -> Any:
    with pytest.raises(UserError) as error:
        load_scenario("street_1car_homo", [override])
    assert message in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize(("every", "told"), [("20 ms", True), ("75 ms", False), ("0 s", False)])
def test_looks_more_often_than_there_are_frames(every: str, told: bool, caplog: Any):
    """One stream of 10 Hz; 75 ms is what everybody gets."""
    settings = ["cameras=[{name: c, recording: '02'}]", "genie.algorithm=recommended"]
    scenario = load_scenario("street_1car_homo", [*settings, f"genie.looks.every={every}"])
    with caplog.at_level("WARNING"):
        prepare(scenario)
    line = f"street_1car_homo: genie.looks.every: {every} is less than 103.2"
    assert [text.startswith(line) for text in caplog.messages] == [True] * told
