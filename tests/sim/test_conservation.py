"""What is published is answered, dropped or in flight; nothing appears from nowhere, whatever the
scenario says.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from genie_sim.data.trace import Trace
from genie_sim.scenario.scenario import Scenario
from genie_sim.sim.encoding import Coder
from genie_sim.sim.link import Link
from genie_sim.sim.method import DETECTOR
from genie_sim.sim.nodes import DetectorNode, InterceptorNode
from genie_sim.sim.ros_graph import Node
from genie_sim.sim.world import DRAIN_NS
from tests.make import build, fixed_device, scenario, street

TRACE = street(seconds=2.0)
SENT = Trace(
    "sent",
    TRACE.origin,
    {
        name: [replace(one, size_bytes=90_000) for one in found]
        for name, found in TRACE.frames.items()
    },
    {},
)
USUAL = None  # the profiles that are shipped
BUSY = {  # one core and a slow Genie: its own queue overflows too
    "jetson_tx2": fixed_device("jetson_tx2", detector="150 ms", genie="40 ms", cores=1),
    "agx_xavier": fixed_device("agx_xavier", detector="60 ms", genie="15 ms", cores=2),
}
SLOW_CODEC = {  # encoders drop pictures
    name: replace(one, codec=replace(one.codec, value=8.0)) for name, one in BUSY.items()
}
ALL_AT_ONCE = [{"name": f"camera_{i}", "recording": f"0{2 + i % 2}"} for i in range(4)]
LONGEST_WORK_NS = 15_000_000_000  # nothing takes longer: an image at 1 Mbit/s
LINKS = (
    "ideal",
    "ethernet_1g",
    "wifi",
    "lte",
    {"like": "ethernet_100m", "loss": 0.3, "jitter": "30 ms"},
    "ethernet_1g",
)


class Run:
    """One method, run to its planned end (``frames``) and then until nothing moves any more
    (``settled``).
    """

    def __init__(self, setting: Scenario, method: str, devices) -> None:
        self.setting, self.method = setting, method
        self.world, tables = build(setting, method, TRACE, devices, sent=SENT)
        self.world.run()
        self.frames = tables["frames"].to_frame()
        self.resources = tables["resources"].to_frame()
        self._settle()
        self.settled = tables["frames"].to_frame()
        self.lookups = tables["lookups"].to_frame()

    def _settle(self) -> None:
        before: list[int] = []
        while before != (now := [one.completed for one in self.world.network.resources]):
            before = now
            self.world.clock.run(until=self.world.clock.now + LONGEST_WORK_NS)

    def of(self, kind: type) -> dict[str, Any]:
        return {one.name: one for one in self.world.network.resources if isinstance(one, kind)}

    def arrived(self, *links: str) -> int:
        return sum(self.of(Link)[name].completed for name in links)

    def uncoded(self, *hosts: str) -> int:
        """Pictures that their encoders or decoders have dropped."""
        coders = [one for one in self.of(Coder).values() if one.name.split("/")[0] in hosts]
        assert not any(one.queued for one in coders)
        return sum(one.drops for one in coders)

    def looked_up(self, genie: str, outcome: str, requester: str = "client") -> int:
        rows = self.lookups
        mine = (
            (rows["genie"] == genie)
            & (rows["outcome"] == outcome)
            & (rows["requester"] == requester)
        )
        return int(rows.loc[mine, "requests"].sum())


def taken(node: Node | Link) -> int:
    """How many messages came to a node or link that is quiet again."""
    assert node.queued == 0
    return node.completed + node.drops


def check_frames(frames: pd.DataFrame, setting: Scenario) -> None:
    """Each row on its own, at any time of the run."""
    streams = frames.groupby(["car", "stream"], observed=True)
    for car in setting.cars:
        for camera in setting.cameras:
            mine = streams.get_group((car.name, camera.name))
            begin_ns, end_ns = car.route.window_ns or (0, 10**12)
            recorded = sum(
                begin_ns <= one.stamp_ns < end_ns for one in TRACE.frames[camera.recording]
            )
            assert mine["frame"].tolist() == list(range(recorded * car.route.laps)), (
                "every frame is published once"
            )
            assert mine["stamp_ns"].is_monotonic_increasing and mine["stamp_ns"].is_unique
    assert len(frames) == sum(len(group) for _, group in streams)

    received, first, fresh, result = (
        frames[name]
        for name in ("received_ns", "first_answer_ns", "fresh_answer_ns", "result_answer_ns")
    )
    answered = first.notna()
    assert not (result.notna() & frames["drop"].notna()).any(), "a result or dropped, not both"
    assert (received.isna() | (received >= frames["stamp_ns"])).all()
    assert (received[answered] <= first[answered]).all(), "nothing is answered before it is there"
    assert (first[result.notna()] <= result[result.notna()]).all()
    assert (result[fresh.notna()] <= fresh[fresh.notna()]).all()
    assert ((frames["source"] != "none") == answered).all()
    for column in ("served_by", "objects_served"):
        assert (frames[column].notna() == answered).all()
    assert (frames["objects_fresh"].notna() == fresh.notna()).all()
    assert (frames["objects_result"].notna() == result.notna()).all()
    not_map = answered & (frames["source"] != "map")
    assert (first[not_map] == result[not_map]).all(), "what does not come from the map is a result"
    looked, first_looked = frames["looked_ns"], frames["first_looked_ns"]
    assert (looked[fresh.notna()] >= frames["stamp_ns"][fresh.notna()]).all()
    assert first_looked[not_map].notna().all() and looked[result.notna()].notna().all()
    assert (looked[first_looked.notna()] >= first_looked[first_looked.notna()]).all()
    is_first_and_fresh = fresh.notna() & (first == fresh)
    assert (
        not frames["source"][is_first_and_fresh]
        .isin(["map", "own_cache", "edge_cache", "peer_cache"])
        .any()
    ), "what comes out of a map or a cache is never fresh"


def check_resources(run: Run) -> None:
    """What is sampled only grows, and nobody works more than all the time."""
    for _, samples in run.resources.groupby("resource", observed=True):
        for column in ("busy_ns", "completed", "dropped", "bytes"):
            known = samples[column].dropna()
            assert (known.diff().dropna() >= 0).all()
        served = samples["capacity"].notna()
        assert (samples["busy_ns"] <= samples["capacity"] * samples["t_ns"])[served].all()


def check_bytes(run: Run) -> None:
    for car in run.setting.cars:
        mine = run.settled[run.settled["car"] == car.name]
        for column, name in (
            ("bytes_up", f"{car.name}->{car.edge}"),
            ("bytes_down", f"{car.edge}->{car.name}"),
        ):
            link = run.of(Link).get(name)
            assert mine[column].sum() == (link.sent_bytes if link is not None else 0)


def check_local(run: Run, cars: Iterable[str]) -> None:
    """Cars with plain nodes: what the detector did not drop is answered by it."""
    for car in cars:
        mine = run.settled[run.settled["car"] == car]
        detector = run.of(DetectorNode)[f"{car}/{DETECTOR}"]
        assert taken(detector) == len(mine)
        assert detector.completed == mine["first_answer_ns"].notna().sum()
        assert (mine["drop"] == f"{detector.name}:/image_raw").sum() == detector.drops
        assert set(mine["source"]) <= {"own_detector", "none"} and mine["image_hit"].isna().all()


def check_remote(run: Run) -> None:
    """Up the link, through the edge's detector, down the link: what leaves one part comes to the
    next.
    """
    links, detectors = run.of(Link), run.of(DetectorNode)
    for edge in run.setting.edges:
        cars = [car.name for car in run.setting.cars if car.edge == edge.name]
        detector = detectors[f"{edge.name}/{DETECTOR}"]
        assert taken(detector) == run.arrived(
            *(f"{car}->{edge.name}" for car in cars)
        ) - run.uncoded(edge.name)
        assert detector.completed == sum(taken(links[f"{edge.name}->{car}"]) for car in cars)
    for car in run.setting.cars:
        mine = run.settled[run.settled["car"] == car.name]
        answered = mine["first_answer_ns"].notna().sum()
        if car.edge is None:
            assert answered == 0 and mine["received_ns"].isna().all(), (
                "nobody is there to receive anything"
            )
            continue
        sent = taken(links[f"{car.name}->{car.edge}"]) + run.uncoded(car.name)
        assert sent == len(mine) == mine["received_ns"].notna().sum()
        assert answered == run.arrived(f"{car.edge}->{car.name}")
        assert set(mine["source"]) <= {"edge_detector", "none"}


def check_genie(run: Run) -> None:
    links, detectors, genies = run.of(Link), run.of(DetectorNode), run.of(InterceptorNode)
    encapsulated = [car for car in run.setting.cars if car.genie]
    check_local(run, (car.name for car in run.setting.cars if not car.genie))
    for car in encapsulated:
        name = f"{car.name}/genie"
        mine = run.settled[run.settled["car"] == car.name]
        detector = detectors[f"{car.name}/{DETECTOR}"]
        up, down = f"{car.name}->{car.edge}", f"{car.edge}->{car.name}"
        came = len(mine) + detector.completed + (run.arrived(down) if car.edge is not None else 0)
        assert taken(genies[name]) == came, "frames, and answers from both sides"
        hits, misses = run.looked_up(name, "hit"), run.looked_up(name, "miss")
        assert mine["image_hit"].eq(True).sum() == hits
        assert mine["coalesced"].eq(True).sum() == run.looked_up(name, "coalesced")
        assert taken(detector) == misses, "each miss goes to the car's own detector ..."
        if car.edge is not None:
            assert taken(links[up]) + run.uncoded(car.name) == misses, "... and up the link"
    edges = [edge.name for edge in run.setting.edges]
    for edge in edges:
        name = f"{edge}/genie"
        misses = run.looked_up(name, "miss")
        if run.setting.genie.neighbour_miss == "process":
            misses += run.looked_up(name, "miss", "neighbour")
        assert taken(detectors[f"{edge}/{DETECTOR}"]) == misses
    ups = [f"{car.name}->{car.edge}" for car in encapsulated if car.edge is not None]
    came = run.arrived(*ups, *(f"{edge}->edges" for edge in edges))
    came += sum(detectors[f"{edge}/{DETECTOR}"].completed - run.uncoded(edge) for edge in edges)
    assert sum(taken(genies[f"{edge}/genie"]) for edge in edges) == came
    if not run.setting.genie.share_requests:
        assert not (run.lookups["requester"] == "neighbour").any()


def check_everything_ends(run: Run) -> None:
    """In the end no frame is in flight: it has a result, or something says that it dropped it."""
    rules = run.setting.genie
    if run.method == "genie" and (
        rules.algorithm == "literal"
        or rules.miss_policy == "hits_only"
        or rules.replay_stamp == "stored"
        or rules.header_identity == "stamp"
    ):
        return  # these readings leave frames without an answer, and nobody knows
    assert (run.settled["result_answer_ns"].notna() ^ run.settled["drop"].notna()).all()


def check(setting: Scenario, devices=None) -> None:
    for method in setting.methods:
        run = Run(setting, method.name, devices)
        for frames in (run.frames, run.settled):
            check_frames(frames, setting)
        check_resources(run)
        check_bytes(run)
        if run.method == "local":
            check_local(run, (car.name for car in setting.cars))
        elif run.method == "remote":
            check_remote(run)
        else:
            check_genie(run)
        check_everything_ends(run)


@st.composite
def scenarios(draw) -> Scenario:
    fleet = []
    for i in range(1, draw(st.integers(1, 3)) + 1):
        edge = draw(st.sampled_from((None, "edge1", f"edge{i}")))
        car: dict[str, Any] = {
            "name": f"car{i}",
            "device": "jetson_tx2",
            "edge": edge,
            "genie": draw(often),
        }
        if edge is not None:
            car["link"] = draw(st.sampled_from(LINKS))
        car["route"] = {
            "start": draw(st.sampled_from(("0 s", "0.7 s", "2.5 s"))),
            "window": draw(st.sampled_from((None, ["0.5 s", "1.5 s"]))),
            "laps": draw(st.integers(1, 2)),
        }
        fleet.append(car)
    rules: dict[str, Any] = {
        "algorithm": draw(st.sampled_from(("default", "default", "default", "literal"))),
        "miss_policy": draw(st.sampled_from(("immediate", "blocking", "hits_only"))),
        "similarity": draw(st.sampled_from(("pose_grid", "exact", "dhash"))),
        "neighbour_miss": draw(st.sampled_from(("ignore", "process"))),
        "same_key_pending": draw(st.sampled_from(("coalesce", "forward"))),
        "replay_stamp": draw(st.sampled_from(("request", "request", "stored"))),
        "share_answers": draw(st.sampled_from(("broadcast", "on_request"))),
        "share_requests": draw(st.booleans()),
        "request_expiry": draw(st.sampled_from(("2 s", "400 ms"))),
        "fresh_objects": draw(st.sampled_from(("confident", "all"))),
        "share_filter": draw(st.sampled_from(("confident", "all"))),
        "car_learns": draw(st.sampled_from(("all", "own"))),
        "passes": draw(st.sampled_from((1, 2))),
    }
    eviction = draw(st.sampled_from(("fifo", "lru", "lfu", "ttl")))
    limits = (
        {"ttl": "300 ms"}
        if eviction == "ttl"
        else {"capacity": draw(st.sampled_from((None, "3 entries", "2 kB")))}
    )
    outages = [
        {"fault": "outage", "target": car["name"], "begin": "500 ms", "end": "900 ms"}
        for car in fleet
        if car["edge"] is not None and draw(st.booleans())
    ]
    more = {"cameras": ALL_AT_ONCE, "start_jitter": "0 s"} if draw(st.booleans()) else {}
    rules |= {"eviction": eviction, **limits}
    more |= {"image_encoding": draw(st.sampled_from(("raw", "png", "jpeg80")))}
    return scenario(
        fleet, queue_length=draw(st.integers(1, 3)), genie=rules, faults=outages, **more
    )


often = st.sampled_from((True, True, False))


@settings(max_examples=20)
@given(scenarios(), st.sampled_from((USUAL, BUSY)))
@pytest.mark.slow
def test_nothing_is_lost_and_nothing_appears(setting: Scenario, devices):
    check(setting, devices)


@pytest.mark.parametrize("cars", [1, 2, 3])
def test_the_usual_cars(cars: int):
    check(scenario(cars))


def test_pictures_that_wait_too_long_for_a_slow_encoder_are_dropped():
    setting = scenario(2, image_encoding="png", cameras=ALL_AT_ONCE)
    run = Run(setting, "remote", SLOW_CODEC)
    assert (
        run.uncoded("car1")
        == run.settled["drop"].astype(str).str.startswith("car1/encoder:").sum()
        > 0
    )
    check(setting, SLOW_CODEC)


def test_what_is_in_flight_at_the_end_of_a_run_is_inside_the_world(monkeypatch: pytest.MonkeyPatch):
    """An LTE link is far too slow for four cameras: some frames are still on their way where nobody
    waits for them.
    """
    monkeypatch.setattr("genie_sim.sim.world.MAX_DRAIN_NS", DRAIN_NS)
    slow = {
        "name": "car1",
        "device": "jetson_tx2",
        "edge": "edge1",
        "link": {"like": "lte", "rate_up": "1 Mbit/s"},
    }
    run = Run(scenario([slow], queue_length=2), "remote", USUAL)
    in_flight = run.frames["first_answer_ns"].isna() & run.frames["drop"].isna()
    assert in_flight.sum() > 0
    assert not (run.settled["first_answer_ns"].isna() & run.settled["drop"].isna()).any()
