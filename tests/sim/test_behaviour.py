"""What cars, edges and Genies do together: without a link, with a shared edge, on the second lap,
among neighbours.
"""

from __future__ import annotations

from typing import Any

import pandas as pd
import pytest

from genie_sim.scenario.scenario import Scenario
from tests.make import drive, fixed_device, scenario, street

MS = 1_000_000
CUT_NS = 2_000_000_000
TWO_CAMERAS = [
    {"name": "camera_02", "recording": "02"},
    {"name": "camera_03", "recording": "03", "phase": "25 ms"},
]
STEADY = {
    "jetson_tx2": fixed_device("jetson_tx2", detector="310 ms", genie="9 ms"),
    "agx_xavier": fixed_device("agx_xavier", detector="65 ms", genie="9 ms"),
}
# What a Genie adds to the way of an image and its answer: twice its own time, and one more hop for
# each (the answer's depends on its size).
THROUGH_GENIE_NS = 9 * MS + 3_094_594 + 9 * MS


def car(name: str, edge: str | None, link: Any = None, **route: Any) -> dict[str, Any]:
    described = {"name": name, "device": "jetson_tx2", "edge": edge, "route": route}
    return described if link is None else {**described, "link": link}


def of_methods(setting: Scenario, **how: Any) -> dict[str, pd.DataFrame]:
    frames = drive(setting, **how)["frames"]
    return {
        str(name): rows.reset_index(drop=True)
        for name, rows in frames.groupby("method", observed=True)
    }


def of(method: str, cars: Any, how: dict[str, Any] | None = None, **settings: Any) -> pd.DataFrame:
    """The frames of one method."""
    return of_methods(scenario(cars, methods=[method], **settings), **(how or {}))[method]


def answered(frames: pd.DataFrame) -> pd.DataFrame:
    return frames[frames["first_answer_ns"].notna()]


def rows(frames: pd.DataFrame) -> list[tuple[Any, ...]]:
    """Comparable: unknown values equal each other."""
    return list(
        frames.astype(object).where(frames.notna(), None).itertuples(index=False, name=None)
    )


# Without an edge

CUT = {"fault": "outage", "target": "car1", "begin": "2 s"}
WAYS_TO_BE_ALONE = [
    pytest.param(car("car1", "edge1"), [CUT], CUT_NS, id="link cut in mid run"),
    pytest.param(
        car("car1", "edge1", {"like": "ethernet_1g", "loss": 1.0}),
        [],
        0,
        id="link that loses everything",
    ),
    pytest.param(car("car1", None), [], 0, id="no edge"),
]


@pytest.mark.parametrize(("lonely", "faults", "since_ns"), WAYS_TO_BE_ALONE)
def test_a_car_alone_goes_on_exactly_as_with_its_own_nodes(
    lonely: dict[str, Any], faults: list[dict[str, str]], since_ns: int
):
    """Every image is new (similarity exact): the Genie answers the frames that the detector alone
    would have answered, each later by the Genie's own time and not a nanosecond more.
    """
    rules = {"miss_policy": "blocking", "similarity": "exact"}
    both = {"methods": ["local", "genie"], "faults": faults}
    setting = scenario([lonely], cameras=TWO_CAMERAS, genie=rules, **both)
    methods = of_methods(setting, devices=STEADY)
    local, genie = (
        answered(methods[name][methods[name]["stamp_ns"] >= since_ns])
        for name in ("local", "genie")
    )
    assert len(local) > 8
    assert set(genie["source"]) == {"own_detector"}
    assert genie[["stream", "frame"]].values.tolist() == local[["stream", "frame"]].values.tolist()
    late_ns = genie["first_answer_ns"].to_numpy() - local["first_answer_ns"].to_numpy()
    answer_hop_ns = 300_000 + 2 * (26 + 400 * genie["objects_served"].to_numpy(dtype=int))
    assert (late_ns == THROUGH_GENIE_NS + answer_hop_ns).all()


@pytest.mark.parametrize(("lonely", "faults", "since_ns"), WAYS_TO_BE_ALONE)
def test_a_car_alone_has_an_answer_to_every_frame_at_once(
    lonely: dict[str, Any], faults: list[dict[str, str]], since_ns: int
):
    """By default a miss is answered from the map, and no frame is dropped because the edge is
    gone.
    """
    methods = of_methods(scenario([lonely], faults=faults, methods=["local", "genie"]))
    genie = methods["genie"][methods["genie"]["stamp_ns"] >= since_ns]
    assert genie["first_answer_ns"].notna().all()
    assert set(genie["source"]) <= {"map", "own_cache", "own_detector"}
    response_ms = (genie["first_answer_ns"] - genie["received_ns"]) / MS
    assert response_ms.max() < 50
    local = methods["local"][methods["local"]["stamp_ns"] >= since_ns]
    assert genie["result_answer_ns"].notna().sum() >= answered(local).shape[0]


def test_the_edge_helps_until_the_link_is_cut_and_again_when_it_is_back():
    cut = {**CUT, "end": "4 s"}
    genie = of("genie", 1, genie={"miss_policy": "blocking"}, faults=[cut])
    helped = answered(genie)[answered(genie)["source"].str.startswith("edge")]
    instants_ns = helped["first_answer_ns"]
    during = (instants_ns > CUT_NS + 200 * MS) & (instants_ns < 2 * CUT_NS)
    assert (instants_ns < CUT_NS).any() and not during.any() and (instants_ns > 2 * CUT_NS).any()


def test_remote_frames_of_a_car_without_an_edge_are_lost_and_not_on_their_way():
    frames = of("remote", [car("car1", "edge1"), car("car2", None)])
    mine = frames[frames["car"] == "car2"]
    assert len(mine) and set(mine["drop"]) == {"car2:no_edge"} and answered(mine).empty
    assert "car1:no_edge" not in set(frames["drop"])


def test_a_run_waits_for_whatever_is_still_on_a_slow_link():
    """1.4 MB at 400 kbit/s take 28 s, the one that waits behind it another 28 s; two cameras share
    the queue of one.
    """
    slow = {"like": "ethernet_1g", "rate_up": "400 kbit/s"}
    fleet = [car("car1", "edge1", slow)]
    frames = of("remote", fleet, {"devices": STEADY}, cameras=TWO_CAMERAS)
    assert not (frames["first_answer_ns"].isna() & frames["drop"].isna()).any(), (
        "nothing is left in flight"
    )
    late_ns = answered(frames)["first_answer_ns"] - answered(frames)["stamp_ns"]
    assert late_ns.min() > 20_000_000_000 and frames["first_answer_ns"].max() > 60_000_000_000


def test_remote_alone_answers_nothing_while_the_link_is_cut():
    """Why Genie keeps the car's own nodes."""
    remote = of("remote", 1, faults=[CUT])
    assert answered(remote)["stamp_ns"].max() < CUT_NS
    assert set(remote[remote["stamp_ns"] > CUT_NS]["drop"]) == {"car1->edge1:outage"}


def test_a_car_with_plain_nodes_is_not_helped():
    plain = {**car("car1", "edge1"), "genie": False}
    fleet = [plain, car("car2", "edge1")]
    methods = of_methods(scenario(fleet, methods=["local", "genie"]))
    both = [
        methods[name][methods[name]["car"] == "car1"].drop(columns="method")
        for name in ("local", "genie")
    ]
    assert rows(both[0]) == rows(both[1])


# A shared edge, laps, neighbours


def test_one_edge_serves_two_cars_and_answers_the_second_from_its_cache():
    fleet = [car("car1", "edge1"), car("car2", "edge1", start="3 s")]
    tables = drive(scenario(fleet, methods=["genie"], genie={"miss_policy": "blocking"}))
    genie = tables["frames"]
    second = answered(genie[genie["car"] == "car2"])
    assert (second["source"] == "edge_cache").mean() > 0.3
    assert set(second["served_by"]) <= {
        "edge1/genie",
        "edge1/vision_darknet_detect",
        "car2/genie",
    } | {"car2/vision_darknet_detect"}
    assert not (tables["lookups"]["requester"] == "neighbour").any(), "there is nobody else to ask"


def test_two_cars_get_less_out_of_one_remote_edge_than_out_of_two():
    shared, own = (
        of("remote", [car("car1", "edge1"), car("car2", edge)]) for edge in ("edge1", "edge2")
    )
    assert len(answered(shared)) < 0.6 * len(answered(own))


def test_on_its_second_lap_a_car_finds_what_it_has_seen_and_computes_less():
    tables = drive(scenario([car("car1", "edge1", laps=2)], methods=["genie"]))
    genie = tables["frames"]
    hits = genie.groupby("lap")["image_hit"].apply(lambda one: one.astype(float).mean())
    assert hits[1] > hits[0] + 0.3
    # in the pause, when all work is done
    ends_ns = genie[genie["lap"] == 0]["stamp_ns"].max() + 900 * MS
    runs = tables["resources"]
    runs = runs[runs["resource"].str.endswith("accelerator")]
    total = runs.groupby("resource", observed=True)["completed"].max()
    first_lap = runs[runs["t_ns"] <= ends_ns].groupby("resource", observed=True)["completed"].max()
    assert ((total - first_lap) < first_lap).all(), (
        "each detector runs less often on the second lap"
    )


def test_on_a_grid_of_1_mm_nothing_is_the_same_place_before_the_second_lap():
    fine = {"similarity": {"name": "pose_grid", "cell": "1 mm"}}
    genie = of("genie", [car("car1", "edge1", laps=2)], genie=fine)
    hits = genie.groupby("lap")["image_hit"].apply(lambda one: one.astype(float).mean())
    assert hits[0] == 0.0 and hits[1] > 0.3


def test_two_cameras_that_one_recording_stands_for_never_take_the_same_image():
    """camera_00 (grey) replays the recording of camera_02 (colour) 50 ms later; byte for byte they
    differ.
    """
    genie = of("genie", [car("car1", "edge1")], genie={"similarity": "exact"})
    assert genie["image_hit"].notna().all()
    assert not genie["image_hit"].any() and not genie["coalesced"].any()


ASKING = {"miss_policy": "blocking", "share_answers": "on_request"}


def test_what_a_neighbour_has_cached_reaches_another_car():
    fleet = [car("car1", "edge1"), car("car2", "edge2", start="3 s")]
    genie = of("genie", fleet, genie=ASKING)
    peers = genie[genie["source"] == "peer_cache"]
    assert set(peers["car"].astype(str)) == {"car2"} and set(peers["served_by"]) == {"edge1/genie"}
    assert len(peers) > 20


def test_what_a_neighbour_publishes_is_in_one_s_own_edge_s_cache():
    fleet = [car("car1", "edge1"), car("car2", "edge2", start="3 s")]
    genie = of("genie", fleet, genie={"miss_policy": "blocking"})
    second = answered(genie[genie["car"] == "car2"])
    assert (second["source"] == "edge_cache").sum() > 20 and not (
        second["source"] == "peer_cache"
    ).any()


def test_edges_that_do_not_ask_are_not_asked_but_share_objects_all_the_same():
    fleet = [car("car1", "edge1"), car("car2", "edge2", start="3 s")]
    rules = {"miss_policy": "blocking", "share_requests": False}
    tables = drive(scenario(fleet, methods=["genie"], genie=rules))
    genie = tables["frames"]
    assert not (genie["source"] == "peer_cache").any()
    lookups = tables["lookups"]
    assert not (lookups["requester"] == "neighbour").any()
    sightings = lookups[(lookups["genie"] == "edge2/genie") & (lookups["kind"] == "sighting")]
    assert (sightings["car"] == "car1").any()


def test_cars_that_never_meet_give_each_other_nothing():
    """Windows of the street that do not overlap, more than a camera's view apart."""
    fleet = [
        car("car1", "edge1", window=["0 s", "2 s"]),
        car("car2", "edge2", window=["20 s", "22 s"], start="3 s"),
    ]
    frames = of("genie", fleet, {"trace": street(seconds=22.0)}, genie=ASKING)
    second = answered(frames[frames["car"] == "car2"])
    assert len(second) > 10 and not second["source"].isin(("edge_cache", "peer_cache")).any()


def test_the_algorithm_to_the_letter_never_hits():
    """Answers come on another topic than their requests, so none is ever found by its header."""
    fleet = [car("car1", "edge1", laps=2), car("car2", "edge2", laps=2)]
    tables = drive(scenario(fleet, methods=["genie"], genie={"algorithm": "literal"}))
    lookups = tables["lookups"]
    assert len(lookups) > 100 and lookups["hits"].sum() == 0
    assert (lookups["entries"] == 0).all()
    genie = tables["frames"]
    assert len(genie) > 0 and answered(genie).empty


# The same numbers for everybody


def test_all_methods_see_the_same_frames():
    methods = of_methods(scenario([car("car1", "edge1", laps=2), car("car2", None, start="1 s")]))
    published = [frame[["car", "stream", "frame", "lap", "stamp_ns"]] for frame in methods.values()]
    assert len(published) == 3
    assert rows(published[0]) == rows(published[1]) == rows(published[2])


def test_another_car_does_not_change_the_random_numbers_of_the_first():
    """Start, service times and so every answer of car1 alone are those of car1 beside car2."""
    alone, together = (of_methods(scenario(cars)) for cars in (1, 2))
    for method in ("local", "remote"):
        beside = together[method][together[method]["car"] == "car1"]
        assert rows(alone[method]) == rows(beside)
    mine, other = (
        together["local"][together["local"]["car"] == name]["stamp_ns"] for name in ("car1", "car2")
    )
    assert mine.min() != other.min(), "each car has a start of its own"


def test_the_same_seed_gives_the_same_tables_and_another_seed_others():
    trace = street(seconds=2.0)
    first, again, other = (drive(scenario(2, seed=seed), trace) for seed in (5, 5, 6))
    for name, table in first.items():
        assert rows(table) == rows(again[name])
        assert rows(table) != rows(other[name])
