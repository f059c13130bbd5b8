"""The shipped frame sources, a street of the tests' own, and cameras that one car has and another
has not.
"""

from __future__ import annotations

from typing import Any

import pytest

from genie_sim.base.errors import UserError
from genie_sim.base.settings import plain_data
from genie_sim.data.sources import SOURCES
from genie_sim.runs.folder import run_in_memory
from genie_sim.runs.prepare import prepare
from genie_sim.scenario.reading import read_scenario
from genie_sim.scenario.scenario import Scenario
from tests.conformance import small
from tests.conformance.frame_sources import FrameSourceConformance
from tests.conformance.own import Street

STREET = "tests.conformance.own:Street"
BLOCKS = {"town": {"blocks": [2, 2]}, "source": "town", "duration": "2 s"}
ROUTE = {"window": ["1 s", "3 s"]}
NUMBERED = [
    {"name": "camera_02", "recording": "02"},
    {"name": "camera_03", "recording": "03", "phase": "25 ms"},
]


def test_every_shipped_source_is_tested_here():
    assert set(SOURCES) == {"recorded", "town", "traffic"}


@pytest.mark.parametrize("source", [{"source": "recorded", "trace": "kitti_0005"}])
class TestRecorded(FrameSourceConformance):
    cameras = NUMBERED
    route = ROUTE


@pytest.mark.parametrize("source", [BLOCKS])
class TestTown(FrameSourceConformance):
    cameras = NUMBERED


@pytest.mark.parametrize(
    "source", [{"source": "traffic", "fcd": "sumo_grid", "begin": "62 s", "duration": "2 s"}]
)
class TestTraffic(FrameSourceConformance):
    cameras = NUMBERED

    def scenario(self, source: dict[str, Any], **more: Any) -> Scenario:
        names = "veh_east.8", "veh_bus.1"
        cars = [small.car(number, name=name) for number, name in enumerate(names, 1)]
        return small.scenario(
            perception=source, cameras=self.cameras, cars=cars, start_jitter="0 s", **more
        )


@pytest.mark.parametrize(
    "source", [{"source": STREET}, {"source": STREET, "seconds": 1.0, "speed_mps": 9.0}]
)
class TestStreet(FrameSourceConformance):
    pass


def test_a_source_of_ones_own_is_run_and_decides_the_run():
    run = run_in_memory(small.scenario(["local"]))
    assert run.facts["traces"] == {"street": "2.0 5.0"}
    assert f"frame source {STREET}" in run.facts["plugins"]
    other = run_in_memory(
        small.scenario(["local"], perception={"source": STREET, "speed_mps": 6.0})
    )
    assert other.run_id != run.run_id


def test_cars_with_cameras_of_their_own():
    """One car has the scenario's two, one has one of its own: other frames, the same street."""
    own = [{"name": "roof", "recording": "right", "phase": "7 ms", "size": "20 kB"}]
    scenario = small.scenario(["remote"], cars=[small.car(1), small.car(2, cameras=own)])
    rows = small.frames(scenario)
    assert set(rows.query("car == 'car1'")["stream"]) == {"camera_0", "camera_1"}
    mine = rows.query("car == 'car2'")
    assert set(mine["stream"]) == {"roof"} and len(mine) == 20
    assert set(mine["bytes_up"]) == {20_000} and mine["fresh_answer_ns"].notna().all()
    alone = small.frames(small.scenario(["remote"])).query("car == 'car1'")
    theirs = rows.query("car == 'car1'")
    assert alone["stamp_ns"].tolist() == theirs["stamp_ns"].tolist(), "car1 does not feel that"
    written = read_scenario(plain_data(scenario))
    assert written == scenario


def test_a_recording_that_is_not_there_names_car_and_trace():
    own = [{"name": "roof", "recording": "up"}]
    field = r"^scenario: cars\[1\]\.cameras\[0\]\.recording: "
    with pytest.raises(
        UserError,
        match=field + r"unknown recording 'up'",
    ):
        prepare(small.scenario(cars=[small.car(1), small.car(2, cameras=own)]))
    recorded = {
        "perception": {"source": "recorded", "trace": "kitti_0005"},
        "cameras": small.CAMERAS,
    }
    with pytest.raises(
        UserError,
        match=r"^scenario: cameras\[0\]\.recording: .*02, 03 \(car1 drives .*0005.*\)$",
    ):
        prepare(small.scenario(**recorded))


@pytest.mark.parametrize(
    ("source", "message"),
    [
        (
            {"source": "recorde"},
            r"perception.*unknown frame source 'recorde' \(did you mean 'recorded'\?\)",
        ),
        (
            {"source": STREET, "secnds": 1.0},
            r"perception.secnds: unknown parameter of .*:Street 'secnds' \(did you mean 'seconds'",
        ),
        ({"source": "tests.conformance.own:Radio", "slot_ms": 1.0}, "has no open"),
        ({"source": "tests.conformance.own:Nobody"}, "has no attribute 'Nobody'"),
        ({"source": "recorded", "trace": "nowhere"}, "perception.trace: unknown trace 'nowhere'"),
    ],
)
def test_a_source_that_does_not_work_is_one_line(source, message: str):
    with pytest.raises(UserError, match=message) as error:
        prepare(small.scenario(perception=source))
    assert "\n" not in str(error.value)


class NoSource:
    """Opens frames, but is no ``FrameSource``."""

    def open(self, seed, origin, progress=None):
        return Street()


def test_a_source_without_the_base_class_is_told_which():
    source = f"{__name__}:NoSource"
    message = (
        f"^frame source '{source}': must be of a subclass of FrameSource in "
        "genie_sim.data.frame_source, not "
    )
    with pytest.raises(UserError, match=message):
        prepare(small.scenario(perception={"source": source}))


class Backwards(Street):
    """Its frames are in the wrong order."""

    def _frames(self, camera):
        return super()._frames(camera)[::-1]


def test_frames_out_of_order_are_one_line():
    source = {"source": f"{__name__}:Backwards", "seconds": 1.0}
    message = r"\[1\]\.stamp_ns is 800000000, but must be above 900000000"
    with pytest.raises(UserError, match=message):
        prepare(small.scenario(perception=source))


def test_a_scenario_is_read_without_running_code_of_ones_own():
    """It is run only by ``run``, which says so: here not even its module is looked for."""
    nowhere = "nowhere_at_all:Nothing"
    scenario = small.scenario(
        [nowhere],
        perception={"source": nowhere},
        faults=[{"fault": nowhere, "target": "car1", "begin": "1 s"}],
        cars=[small.car(1, link={"model": nowhere}), small.car(2)],
        genie={"eviction": nowhere, "similarity": nowhere, "object_map": {"rule": nowhere}},
    )
    with pytest.raises(UserError, match="No module named 'nowhere_at_all'"):
        scenario.own_code_digests()
