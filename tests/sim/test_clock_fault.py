"""A clock that is off: stamps at the border of a host, and what does not depend on them."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pandas as pd
import pytest

from genie_sim.api import load_scenario
from genie_sim.core.messages import CameraPose, Detection, Detections, Header, Image, Look, Motion
from genie_sim.faults.clock import ClockFault
from genie_sim.runs.prepare import prepare
from genie_sim.runs.simulate import simulate
from genie_sim.sim.bends import Border
from tests.conformance import small

S, MS = 1_000_000_000, 1_000_000
POSE = CameraPose(1.0, 2.0, 1.6, 0.3)
OWN, OTHER = Header(3 * S, "camera_0", "car1"), Header(4 * S, "camera_1", "car2")
SEEN = Detection("car", 0.9, None, (10.0, 20.0, 0.5), 0.9)


def image(header: Header) -> Image:
    return Image(header, 100, "camera_0/abc", 7, POSE, 1.2)


def answer(header: Header, look: Header) -> Detections:
    tracked = replace(SEEN, motion=Motion((1.0, 0.0), 0.5, 0.9, look), seen_in=look)
    halves = (replace(tracked, seen_in=None), replace(tracked, motion=None))
    objects = (SEEN, tracked, *halves)
    return Detections(
        header, objects, look=Look(look, POSE, 1.2, (SEEN,)), valid_ns=5 * S, seen_in=look
    )


class Borders:
    """The borders of hosts whose clocks are off from 2 s on."""

    def __init__(self, *faults: ClockFault) -> None:
        self.clock = SimpleNamespace(now=2 * S)
        self.bends = {fault.target: [] for fault in faults}
        for fault in faults:
            fault.begin(self)  # type: ignore[arg-type]

    def bend(self, host: str, bend) -> None:
        self.bends[host].append(bend)

    def cross(self, message, source: str, destination: str):
        bends = (self.bends.get(host, []) for host in (source, destination))
        border = Border(source, destination, *bends)
        return border.enter(border.leave(message))


def test_what_a_car_sends_is_late_and_what_it_hears_early_by_the_error():
    """50 ms ahead at 2 s and 100 ppm more: 50.1 ms at 3 s, 50.2 ms at 4 s, 50.3 ms at 5 s."""
    borders = Borders(ClockFault("car1", 50 * MS, 100.0))
    sent = borders.cross(image(OWN), "car1", "edge1")
    assert sent.header == (3 * S + 50_100_000, "camera_0", "car1") and sent.pose == POSE
    heard = borders.cross(answer(OWN, OTHER), "edge1", "car1")
    early = Header(4 * S - 50_200_000, "camera_1", "car2")
    assert heard.header == OWN, "sent before the fault, it has its own stamp"
    assert heard.look.header == heard.seen_in == heard.objects[1].seen_in == early
    assert heard.objects[1].motion.seen == early and heard.objects[0] == SEEN
    moving, seen_only = heard.objects[2:]
    assert moving.motion.seen == early and moving.seen_in is None
    assert seen_only.seen_in == early and seen_only.motion is None
    assert heard.valid_ns == 5 * S - 50_300_000
    assert heard.looked_ns == 4 * S and heard.seen_in.original == OTHER, "tables are in true time"
    assert borders.cross(image(OTHER), "car2", "edge1") == image(OTHER)


@pytest.mark.parametrize("drift_ppm", [-50.0, 0.0, 33.0])
def test_frames_come_back_under_their_own_stamps(drift_ppm: float):
    """Over a car and an edge that are both off, however long it takes, also after the fault."""
    car, edge = ClockFault("car1", -7 * MS, drift_ppm), ClockFault("edge1", 11 * MS, 20.0)
    borders = Borders(car, edge)
    header = Header(3 * S + 1, "camera_0", "car1")
    there = borders.cross(image(header), "car1", "edge1").header
    assert there != header and there.original is header
    assert abs(there.stamp_ns - header.stamp_ns + 18 * MS) < MS
    borders.clock.now = 9 * S
    car.end(borders), edge.end(borders)  # type: ignore[arg-type]
    back = borders.cross(answer(there, there), "edge1", "car1")
    assert back.header is back.look.header is back.seen_in is header
    later = Header(9 * S, "camera_0", "car1")
    assert borders.cross(image(later), "car1", "edge1").header is later


def frames(faults: list, method: str) -> pd.DataFrame:
    return small.frames(small.scenario([method], faults=faults))


@pytest.mark.parametrize("target", ["car1", "edge1"])
def test_who_compares_no_times_is_not_affected(target: str):
    fault = {"fault": "clock", "target": target, "offset": "90 ms", "begin": "0.5 s", "end": "1 s"}
    pd.testing.assert_frame_equal(frames([fault], "remote"), frames([], "remote"))


@pytest.mark.slow
def test_a_map_that_forgets_is_affected_and_tables_are_in_true_time():
    genie = {"method": "genie", "genie": {"object_map": {"freshness": "existence"}}}
    fault = {"fault": "clock", "target": "car1", "offset": "-500 ms", "begin": "1 s"}
    tables = []
    for faults in ([fault], []):
        settings = {"methods": [genie], "faults": faults, "record": ["lookups", "objects"]}
        tables.append(simulate(prepare(load_scenario("street_3car_hetero", settings))))
    objects, usual = (table["objects"].to_frame() for table in tables)
    assert not objects.equals(usual)
    frames, lookups = (tables[0][name].to_frame() for name in ("frames", "lookups"))
    taken = set(frames["stamp_ns"])
    assert set(frames["looked_ns"].dropna()) <= taken
    assert set(lookups["stamp_ns"]) <= taken and (lookups["genie"] == "edge1/genie").any()
