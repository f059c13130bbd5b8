"""Where cars are, and what radios know of the world."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from genie_sim.core.messages import CameraPose
from genie_sim.runs import build
from genie_sim.runs.prepare import prepare
from genie_sim.sim.places import DrivenPlace, RecordedPlace
from genie_sim.sim.settings import Route
from tests.conformance import small

S = 1_000_000_000
FRAMES = [
    SimpleNamespace(stamp_ns=stamp, pose=CameraPose(east, north, 0.0, 0.0))
    for stamp, east, north in (
        (0, 0.0, 5.0),
        (2 * S, 20.0, 5.0),
        (3 * S, 20.0, 8.0),
        (9 * S, 0.0, 0.0),
    )
]


@pytest.mark.parametrize(
    ("now_s", "place"),
    [
        (0, (0.0, 5.0)),  # it has not started
        (4, (0.0, 5.0)),
        (5, (10.0, 5.0)),  # halfway between two frames
        (6.5, (20.0, 6.5)),
        (7.5, (20.0, 8.0)),  # after the last frame of its window it stands
        (8.5, (20.0, 8.0)),  # as in the pause
        (10, (10.0, 5.0)),  # the second lap
        (99, (20.0, 8.0)),  # and the end
    ],
)
def test_a_car_that_replays_a_recording(now_s: float, place: tuple[float, float]):
    """It starts at 4 s, drives a window of 4 s twice, and pauses for a second."""
    route = Route(window_ns=(0, 4 * S), start_ns=4 * S, laps=2)
    assert RecordedPlace(route, FRAMES)(round(now_s * S)) == pytest.approx(place)


def test_a_car_of_a_town_is_where_its_drive_is_after_its_start():
    place = DrivenPlace(lambda t_ns: (t_ns / S, -t_ns / S), start_ns=2 * S, duration_ns=10 * S)
    assert [place(now_s * S) for now_s in (0, 2, 5, 90)] == [(0, 0), (0, 0), (3, -3), (10, -10)]


def test_the_place_of_a_car_is_that_of_its_frames():
    """Also with a start that is drawn, and a camera that takes its pictures later."""
    setting = small.scenario(["local"])
    prepared = prepare(setting)
    setup = build.setup(prepared, setting.methods[0])
    for car in setup.cars:
        frames = setup.frames[car.name]["left"]
        for frame in (frames[0], frames[7]):
            place = setup.places[car.name](car.route.start_ns + frame.stamp_ns)
            assert place == pytest.approx((frame.pose.east_m, frame.pose.north_m))
    assert frames[7].pose.east_m != frames[0].pose.east_m


def test_time_on_a_shared_medium_belongs_to_the_frame_that_is_carried():
    """A transmission is ended by an event of another car's: the path stays that of the frame."""
    link = {"model": "tests.conformance.own:OneAtATime", "rate": "150 Mbit/s"}
    cars = [small.car(1, link=link), small.car(2, link=link, edge="edge1")]
    setting = small.scenario(["remote"], cars=cars)
    tables = small.tables(setting)
    uplink = tables["steps"].query("part == 'uplink'")
    assert set(uplink["place"]) == {"car1->edge1", "car2->edge1"}
    assert (uplink["place"] == uplink["car"] + "->edge1").all()
    assert (uplink["end_ns"] > uplink["begin_ns"]).all()
    alone_ns = 1_397_297 * 8 * S // 150_000_000
    assert (uplink["end_ns"] - uplink["begin_ns"]).max() > 1.5 * alone_ns, (
        "they wait for each other"
    )
