"""The baselines in small worlds: where their caches stand, and what a scenario may not say of
them.
"""

from __future__ import annotations

from dataclasses import replace

import pytest

from genie_sim.base import files
from genie_sim.base.errors import UserError
from genie_sim.data.trace import Trace, read_trace, write_trace
from genie_sim.runs.folder import run_in_memory
from genie_sim.scenario.reading import load_scenario
from genie_sim.sim.method import DETECTOR, METHODS
from tests.conformance import small

SIMILAR = ("sim_lru", "rnd_lru", "potluck", "foggycache")
SLOW = {"perception": {"source": "tests.conformance.own:Street", "speed_mps": 1.0}}


def wrong(method: dict, **settings) -> str:
    with pytest.raises(UserError) as error:
        run_in_memory(small.scenario([method], **settings))
    assert "\n" not in str(error.value)
    return str(error.value)


@pytest.mark.parametrize(
    ("settings", "field"),
    [
        ({"method": "sim_lru", "replay": "there"}, "replay"),
        ({"method": "central", "at": "edge7"}, "edge7"),
        ({"method": "cachier", "cloud": "edge7"}, "cloud"),
        ({"method": "rnd_lru", "genie": {"capacity": "0 entries"}}, "capacity"),
    ],
)
def test_what_only_a_run_can_refuse_names_its_field(settings: dict, field: str):
    assert field in wrong({"name": "mine", **settings})


@pytest.mark.parametrize("method", SIMILAR)
def test_frames_without_the_feature_are_named(method: str):
    said = wrong({"name": "mine", "method": method, "feature": "yolox_gap"})
    assert said.startswith(
        "scenario: methods[0].feature: the frames of street have no feature 'yolox_gap', but hsv"
    )
    assert "mine cannot run on them" in said


def test_a_trace_without_features_still_runs_what_needs_none(tmp_path):
    shipped = read_trace(files.find(files.TRACE, "kitti_0005"))
    bare = {
        camera: tuple(replace(one, features={}) for one in some[:3])
        for camera, some in shipped.frames.items()
    }
    write_trace(tmp_path / "bare.parquet", Trace("bare", shipped.origin, bare, {}))
    told = [f"perception.trace={tmp_path / 'bare.parquet'}", "cars[0].route.window=[0 s, 0.3 s]"]
    without = load_scenario(
        "street_1car_hetero", [*told, "methods=[genie, central, deadline, oracle]"]
    )
    assert len(run_in_memory(without).frames)
    with pytest.raises(
        UserError, match=r"the frames of bare have no feature 'hsv', but none: sim_lru cannot run"
    ):
        run_in_memory(load_scenario("street_1car_hetero", [*told, "methods=[genie, sim_lru]"]))


def test_the_central_cache_is_asked_by_other_edges_and_there_is_no_other():
    found = small.tables(small.scenario([{"method": "central", "at": "edge2"}], **SLOW))
    lookups = found["lookups"][found["lookups"]["kind"] == "image"]
    most = lookups.groupby("genie")["entries"].max().to_dict()
    assert most["edge1/asker"] == 0 < most["edge2/genie"]
    assert set(most) == {"edge1/asker", "edge2/genie"}
    asked = lookups[lookups["requester"] == "neighbour"]
    assert set(asked["genie"]) == {"edge2/genie"} and (asked["hits"] > 0).any()
    assert "peer_cache" in set(found["frames"]["source"])


def test_cachier_answers_from_an_edge_or_the_cloud_only():
    """The cars of the cloud's own edge are served by it; the cache of the other is filled with what
    it forwards.
    """
    found = small.tables(
        small.scenario([{"method": "cachier", "cloud": "edge1", "per_entry": "0 ms"}], **SLOW)
    )
    rows = found["frames"].dropna(subset="result_answer_ns")
    served = rows.groupby("car")["served_by"].agg(set).to_dict()
    assert served == {"car1": {f"edge1/{DETECTOR}"}, "car2": {f"edge1/{DETECTOR}", "edge2/cache"}}
    lookups = found["lookups"].groupby("genie")["entries"].max().to_dict()
    assert lookups["edge1/cloud"] == 0 < lookups["edge2/cache"]
    busy = found["resources"].groupby("resource")["busy_ns"].max()
    assert (
        busy["edge1.accelerator"]
        > 0
        == busy[["car1.accelerator", "car2.accelerator", "edge2.accelerator"]].sum()
    )


def test_cachiers_look_ups_take_their_time_and_keep_its_caches_small():
    entries = [
        {"name": f"each-{ms}", "method": "cachier", "per_entry": f"{ms} ms"} for ms in (0, 2, 200)
    ]
    street = {
        "perception": {"source": "tests.conformance.own:Street", "seconds": 12.0, "speed_mps": 4.0}
    }
    found = small.tables(small.scenario(entries, **street, record=["lookups", "resources"]))
    caches = (
        found["lookups"]
        .query("genie == 'edge1/cache' and t_ns > 5.5e9")
        .groupby("method")["entries"]
        .max()
    )
    assert caches["each-200"] == 0 < caches["each-2"] == caches["each-0"], (
        "all are asked for equally often"
    )
    cpu = found["resources"].query("resource == 'edge1.cpu'").groupby("method")["busy_ns"].max()
    assert cpu["each-2"] > 2 * cpu["each-0"]


def test_pictures_that_wait_for_one_that_is_lost_are_lost_at_the_cache():
    """They were never sent on, so no link and no detector can tell of them."""
    lossy = {"like": "ethernet_1g", "loss": 0.5}
    rows = small.frames(small.scenario(["cachier"], **SLOW, edge_network=lossy))
    small.check_conserved(rows, ["cachier"])
    assert (rows["drop"] == "edge1/cache:expired").any()


def test_cachier_wants_a_cloud_that_its_edges_reach():
    edges = [
        {"name": "edge1", "device": "agx_xavier", "neighbours": []},
        {"name": "edge2", "device": "agx_xavier", "neighbours": []},
    ]
    said = wrong({"name": "mine", "method": "cachier"}, edges=edges)
    assert said.endswith(
        "cachier: cloud: edge1 is no neighbour of edge2, and can ask it nothing; "
        "edge_neighbours says with how many edges each is connected"
    )
    assert "central: at: edge2 is no neighbour of edge1" in wrong("central", edges=edges)


def test_readings_of_the_genie_s_algorithm_are_not_those_of_a_baseline():
    frames = [
        small.frames(small.scenario(["sim_lru", "foggycache"], genie={"algorithm": algorithm}))
        for algorithm in ("default", "literal")
    ]
    assert frames[0].equals(frames[1]) and frames[0]["image_hit"].sum() > 0


def test_a_key_takes_its_time_where_it_is_made():
    """The accelerator of a car that makes ``yolox_gap`` keys has no time left for detections."""
    entries = "methods=[sim_lru, {name: gap, method: sim_lru, feature: yolox_gap, radius: 0.2}]"
    run = run_in_memory(
        load_scenario("street_1car_hetero", [entries, "cars[0].route.window=[0 s, 3 s]"])
    )
    value = {
        (one.metric, one.method, one.component): one.value
        for one in run.measured
        if one.value is not None
    }
    assert value["fresh_answer_mean", "gap", ""] > 3 * value["fresh_answer_mean", "sim_lru", ""]


def test_replays_live_in_the_world_or_before_the_camera():
    entries = [
        {"name": name, "method": "sim_lru", "radius": 0.05, "replay": name}
        for name in ("world", "camera")
    ]
    rows = small.tables(small.scenario(entries))["answers"]
    hits = rows[rows["source"].isin(["own_cache", "edge_cache"]) & (rows["which"] == "result")]
    matched = hits.groupby("method")[["served", "matched"]].sum()
    assert (matched["matched"] / matched["served"]).loc["world"] > 0.9, (
        "parked cars stay where they are"
    )
    assert len(hits[hits["method"] == "camera"]) > 20


@pytest.mark.slow
def test_oracle_hits_are_right_and_no_cache_has_more_right_ones():
    methods = ["genie", "central", *SIMILAR, "oracle"]
    run = run_in_memory(load_scenario("baselines", [f"methods={methods}"]))
    value = {(one.metric, one.method): one.value for one in run.measured if one.placement == "all"}
    assert value["wrong_hit_share", "oracle"] == 0.0
    rows = run.frames.groupby("method", observed=True)
    hits = rows["source"].agg(
        lambda one: one.isin(["own_cache", "edge_cache", "peer_cache"]).mean()
    )
    for method in SIMILAR:
        assert hits[method] * (1 - value["wrong_hit_share", method]) < hits["oracle"], method


def test_every_baseline_is_a_method_with_a_name():
    assert {*SIMILAR, "central", "cachier", "deadline", "oracle"} < set(METHODS)


@pytest.mark.parametrize(
    "method", [name for name in METHODS if name not in ("local", "remote", "genie", "recommended")]
)
def test_cars_without_cameras_edge_or_genie_are_allowed(method: str):
    """A car without cameras has nothing to compare; one without an edge is answered by its own
    detector, if at all.
    """
    cars = ["cars[0].route.window=[1 s, 1.6 s]", "cars[1].route.window=[1 s, 1.6 s]"]
    cars += ["cars[2]={name: alone, device: jetson_tx2, route: {window: [1 s, 1.6 s]}}"]
    cars += [
        "cars[3]={name: plain, device: jetson_tx2, edge: edge1, genie: false, "
        "route: {window: [1 s, 1.6 s]}}"
    ]
    own = "{name: cachier, method: cachier, cloud: edge1}" if method == "cachier" else method
    run = run_in_memory(load_scenario("street_case_study", [*cars, f"methods=[{own}]"]))
    frames = run.frames.astype({"car": str})
    answered = frames[frames["first_answer_ns"].notna()]
    assert {"car1", "plain"} <= set(answered["car"])
    assert "car2" not in set(answered["car"]), "nobody asks for it"
    if method in ("cachier", "paced_remote"):
        assert "alone" not in set(answered["car"]), "its own detector is not used"
    else:
        assert "alone" in set(answered["car"])


def test_a_car_may_have_another_capacity_than_an_edge():
    genie = {"eviction": "lru", "capacity": "4 entries", "car_capacity": "1 entries"}
    found = small.tables(
        small.scenario([{"method": "sim_lru", "radius": 0.0}], genie=genie, **SLOW)
    )
    lookups = found["lookups"][found["lookups"]["kind"] == "image"]
    most = lookups.groupby("placement")["entries"].max().to_dict()
    assert most == {"car": 1, "edge": 4}
