"""Methods with settings of their own, faults, and the cameras of single cars: read, written,
refused in one line.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import Any

import pytest

from genie_sim.base.errors import UserError
from genie_sim.base.settings import plain_data
from genie_sim.runs.folder import run_in_memory
from genie_sim.runs.prepare import prepare
from genie_sim.scenario.reading import load_scenario, read_scenario
from genie_sim.scenario.scenario import Scenario, as_yaml
from genie_sim.scenario.yaml_input import parse
from tests.make import drive, street

CARS: dict[str, Any] = {
    "name": "x",
    "edges": [{"name": "edge1", "device": "agx_xavier"}, {"name": "edge2", "device": "agx_xavier"}],
    "cars": [
        {"name": "car1", "device": "jetson_tx2", "edge": "edge1"},
        {"name": "car2", "device": "jetson_tx2"},
    ],
}
SMALL = {
    "name": "small",
    "method": "genie",
    "title": "Genie with 10 entries",
    "genie": {"eviction": "lru", "capacity": "10 entries"},
}
OUTAGE = {"fault": "outage", "target": "car1", "begin": "5 s", "end": "8 s"}
AGAIN = {"fault": "outage", "target": "edges", "mean_time_between": "60 s", "mean_duration": "2 s"}
HAND_OVER = {
    "fault": "hand_over",
    "target": "car1",
    "begin": "5 s",
    "edge": "edge2",
    "gap": "80 ms",
}
FRONT = {"name": "front", "recording": "02", "phase": "5 ms", "size": "1 MB"}


def scenario(**settings: Any) -> Scenario:
    return read_scenario({**CARS, **settings})


def with_cameras(cameras: object) -> Scenario:
    return scenario(cars=[{**CARS["cars"][0], "cameras": cameras}])


def refusal(**settings: Any) -> str:
    with pytest.raises(UserError) as error:
        scenario(**settings)
    assert "\n" not in str(error.value)
    return str(error.value)


@pytest.mark.parametrize(
    "settings",
    [
        {"methods": ["genie", SMALL]},
        {"methods": [{"name": "paper", "method": "genie", "genie": {"algorithm": "literal"}}]},
        {
            "methods": [
                {
                    "method": "my.code:Own",
                    "depth": 3,
                    "model": "yolov8s",
                    "edge_network": {"delay": "5 ms"},
                }
            ]
        },
        {"faults": [OUTAGE, AGAIN, HAND_OVER]},
        {"faults": [{"fault": "my.code:Fog", "target": "car1", "begin": "1 s", "density": 0.5}]},
        {"cars": [{**CARS["cars"][0], "cameras": [FRONT]}]},
        {"cars": [{**CARS["cars"][0], "link": {"model": "my.code:Tunnel", "length_m": 300}}]},
        {"perception": {"source": "my.code:Frames", "rate_hz": 30}},
    ],
    ids=lambda settings: next(iter(settings)),
)
def test_the_resolved_scenario_reads_back(settings: dict[str, Any]) -> None:
    original = scenario(**settings)
    assert read_scenario(parse(as_yaml(plain_data(original)), "resolved")) == original


def test_an_entry_overrides_the_settings_of_the_scenario() -> None:
    setting = scenario(methods=["genie", SMALL], genie={"view_range": "30 m"}, queue_length=2)
    usual, small = setting.method_settings.values()
    assert (usual.genie.eviction, small.genie.eviction) == ("fifo", "lru")
    assert (usual.genie.view_range_m, small.genie.view_range_m) == (30.0, 30.0)
    assert small.queue_length == 2
    assert [entry.facts(entry.new()) for entry in setting.methods] == [
        {"name": "genie", "title": "Genie (DG)", "baseline": False},
        {"name": "small", "title": "Genie with 10 entries", "baseline": False},
    ]


def test_the_literal_preset_of_one_entry_leaves_the_others_alone() -> None:
    setting = scenario(
        methods=["genie", {"name": "paper", "method": "genie", "genie": {"algorithm": "literal"}}]
    )
    usual, paper = (setting.method_settings[entry.name].genie for entry in setting.methods)
    assert (usual.pending_index, paper.pending_index) == ("across_topics", "per_topic")
    assert (usual.object_map.rule, paper.object_map.rule) == ("noisy_or", "literal")


def test_two_entries_of_a_method_differ_only_by_their_settings() -> None:
    again = {"name": "again", "method": "genie"}
    waits = {"name": "waits", "method": "genie", "genie": {"miss_policy": "blocking"}}
    frames = drive(scenario(methods=["genie", again, waits]), street(seconds=4.0))["frames"]
    first, second, other = (
        rows.drop(columns="method").reset_index(drop=True)
        for _, rows in frames.groupby("method", observed=True, sort=False)
    )
    assert first.equals(second)
    published = ["car", "stream", "frame", "stamp_ns"]
    assert other[published].equals(first[published]) and not other.equals(first)


def test_a_car_may_have_cameras_of_its_own() -> None:
    setting = with_cameras([FRONT])
    frames = drive(replace(setting, methods=setting.methods[:1]), street(seconds=1.0))["frames"]
    assert set(frames["stream"].astype(str)) == {"front"} and len(frames) == 10


def test_hand_overs_may_be_written_in_any_order() -> None:
    back = {**HAND_OVER, "begin": "7 s", "edge": "edge1"}
    assert len(scenario(faults=[back, HAND_OVER]).faults) == 2


def test_a_recording_that_a_car_s_own_camera_names_must_be_there() -> None:
    with pytest.raises(
        UserError, match=r"^scenario: cars\[0\].cameras\[0\].recording: unknown recording '09'"
    ):
        drive(with_cameras([{**FRONT, "recording": "09"}]), street(seconds=1.0))


def test_pictures_are_encoded_where_there_are_such_pictures():
    setting = scenario(
        methods=["remote", {"name": "jpeg", "method": "remote", "image_encoding": "jpeg80"}]
    )
    prepared = prepare(setting)
    assert set(prepared.encoded) == {("jpeg80", "car1")}  # car2 sends nothing
    assert prepared.facts["traces"]["jpeg80 of car1"] == prepared.encoded["jpeg80", "car1"].digest
    with pytest.raises(
        UserError,
        match=r"image_encoding: unknown image encoding 'jpeg79'.*: jpeg80, jpeg90, png, raw",
    ):
        scenario(image_encoding="jpeg79")
    town = scenario(perception={"source": "town", "duration": "1 s"}, image_encoding="jpeg80")
    with pytest.raises(
        UserError,
        match=r"^scenario: image_encoding: source 'town' has no pictures to encode: leave it 'raw'",
    ):
        prepare(town)


def test_settings_of_methods_are_worked_out_once_a_run(monkeypatch):
    resolved: list[int] = []
    resolve = Scenario.__dict__["method_settings"].func

    def counted(self: Scenario) -> Any:
        resolved.append(len(self.methods))
        return resolve(self)

    counting = cached_property(counted)
    counting.__set_name__(Scenario, "method_settings")
    monkeypatch.setattr(Scenario, "method_settings", counting)
    short = [f"cars[{car}].route.window=[0 s, 0.3 s]" for car in range(3)]
    run_in_memory(load_scenario("street_3car_hetero", short))
    assert resolved == [3]


def test_a_scenario_that_is_changed_has_settings_of_its_own():
    setting = load_scenario("street_3car_hetero")
    changed = replace(setting, queue_length=7)
    assert {one.queue_length for one in setting.method_settings.values()} == {1}
    assert {one.queue_length for one in changed.method_settings.values()} == {7}
