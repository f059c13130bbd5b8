"""The live map: who detects where, what cars are told, and the published directions."""

from __future__ import annotations

import pytest
from livemap import WAYS, Controller, MapServer, Reporter, Told

import genie_sim as gs
from genie_sim.base.errors import UserError
from genie_sim.core.messages import (
    Detection,
    Detections,
    Expired,
    Image,
    Look,
    Publish,
)
from genie_sim.runs.folder import run_in_memory
from genie_sim.scenario.reading import load_scenario
from genie_sim.sim.method import IMAGES, LOCAL, OBJECTS, REMOTE
from genie_sim.tracks.existence import ExistenceFilter
from genie_sim.tracks.track_map import TrackMap
from tests.conformance.methods import MethodConformance
from tests.make import frame, seen

MS = 1_000_000


@pytest.mark.parametrize("method", ["livemap:LiveMap"])
class TestConformance(MethodConformance):
    pass


def told(east_m: float, *others: str) -> Told:
    return Told("car", 0.9, None, (east_m, 0.0, 0.0), 0.9, "map", others=others)


def controller(where: str = "faster", others: int = 0) -> Controller:
    return Controller(WAYS[where], probe_ns=1000 * MS, others=others)


def tried() -> Controller:
    """Both ways were tried: 300 ms on board, 150 ms at the edge."""
    both = controller()
    first, second = frame(0), frame(0.1)
    assert both.way(first, 0) == LOCAL
    assert both.way(second, 100 * MS) == REMOTE
    both.came(Detections(second.header, ()), 250 * MS)
    both.came(Detections(first.header, ()), 300 * MS)
    return both


def test_both_ways_are_tried_then_the_faster_one_is_taken():
    both = tried()
    assert both.way(frame(0.3), 300 * MS) == REMOTE


def test_a_frame_is_left_out_while_its_way_is_busy():
    both = tried()
    both.way(frame(0.3), 300 * MS)
    assert both.way(frame(0.4), 400 * MS) is None


def test_a_frame_that_takes_long_speaks_against_its_way():
    both = tried()
    both.way(frame(0.3), 300 * MS)
    assert both.way(frame(0.601), 601 * MS) == LOCAL  # 301 ms so far, against 300 ms


def test_the_slower_way_is_tried_again_after_a_second():
    both = tried()
    for stamp_ms in (300, 600, 900):
        image = frame(stamp_ms / 1000)
        assert both.way(image, stamp_ms * MS) == REMOTE
        both.came(Detections(image.header, ()), (stamp_ms + 150) * MS)
    assert both.way(frame(1.05), 1050 * MS) == LOCAL


def test_a_map_that_nobody_asked_for_is_no_answer():
    at_edge, image = controller("edge"), frame(0)
    at_edge.way(image, 0)
    at_edge.came(Detections(image.header, (), "map"), 100 * MS)
    assert at_edge.way(frame(0.1), 100 * MS) is None
    at_edge.came(Detections(image.header, ()), 150 * MS)
    assert at_edge.way(frame(0.2), 200 * MS) == REMOTE


@pytest.mark.parametrize(
    ("objects", "way"),
    [
        ([told(20, "car2")], None),
        ([told(20, "car2"), told(30)], REMOTE),  # one is seen by nobody
        ([told(20, "car2"), told(-30)], None),  # which is out of view
        ([], REMOTE),  # nothing is known: it may look
    ],
)
def test_a_frame_is_left_out_if_others_see_all_of_it(objects: list[Detection], way: str | None):
    car = controller("edge", others=1)
    car.came(Detections(frame(0).header, tuple(objects), "map"), 0)
    assert car.way(frame(0.1), 100 * MS) == way


def test_what_is_found_on_board_goes_up_as_a_look():
    car, image = Reporter("car1/reporter", controller("car"), (IMAGES,), (OBJECTS,)), frame(0)
    assert car.on_message(IMAGES, image, 0) == [Publish(IMAGES + LOCAL, image)]
    assert car.on_message(IMAGES, frame(0.1), 100 * MS) == [Expired(frame(0.1).header)]
    answer = Detections(image.header, (seen(20),))
    (up,) = car.on_message(OBJECTS + LOCAL, answer, 300 * MS)
    assert up.topic == IMAGES + REMOTE
    assert up.message.look == Look(image.header, image.pose, image.horizontal_fov_rad, (seen(20),))
    assert up.message.objects == () and up.message.size_bytes < 300
    new_map = Detections(image.header, (seen(20), seen(-10)))
    assert car.on_message(OBJECTS + REMOTE, new_map, 350 * MS) == [Publish(OBJECTS, new_map)]


def server(every_ms: int = 100, p_min: float = 0.1) -> MapServer:
    tracks = TrackMap(ExistenceFilter(p_min))
    return MapServer("edge1/map", tracks, every_ms * MS, (IMAGES,), (OBJECTS,))


def look(edge: MapServer, image: Image, *objects: Detection, now_ms: int) -> list[Detections]:
    """The maps that a frame detected at the edge brings."""
    assert edge.on_message(IMAGES, image, now_ms * MS) == [Publish(IMAGES + LOCAL, image)]
    effects = edge.on_message(OBJECTS + LOCAL, Detections(image.header, objects), now_ms * MS)
    assert all(one.topic == OBJECTS for one in effects)
    return [one.message for one in effects]


def places(new_map: Detections) -> list[tuple[float, float]]:
    return sorted((round(one.location[0]), round(one.location[1])) for one in new_map.objects)


def test_the_map_combines_what_two_cars_see_and_goes_to_both():
    edge, first, second = server(), frame(0), frame(0.05, at=(10.0, 0.0), car="car2")
    (own,) = look(edge, first, seen(20), now_ms=80)
    assert own.header == first.header and own.source == "detector" and places(own) == [(20, 0)]
    of_first, own = look(edge, second, seen(20.4), seen(40), now_ms=200)
    assert own.header == second.header and own.source == "detector"
    assert len(own.objects) == 2, "two sightings of one car, and another"
    assert of_first.header == first.header and of_first.source == "map", (
        "the last frame of that car"
    )
    assert places(of_first) == places(own) and of_first.valid_ns == 200 * MS


def test_objects_found_on_board_are_combined_too():
    edge, image = server(), frame(0)
    found = Look(image.header, image.pose, image.horizontal_fov_rad, (seen(20),))
    (answer,) = edge.on_message(IMAGES, Detections(image.header, ()).with_look(found, None), 0)
    assert places(answer.message) == [(20, 0)] and answer.message.look is None


def test_a_car_is_told_of_others_at_most_every_so_often():
    edge = server(every_ms=100)
    look(edge, frame(0), now_ms=0)
    assert len(look(edge, frame(0, car="car2"), now_ms=50)) == 1
    assert len(look(edge, frame(0.05, car="car2"), now_ms=99)) == 1
    assert len(look(edge, frame(0.06, car="car2"), now_ms=100)) == 2
    assert len(look(edge, frame(2.1, car="car2"), now_ms=2100)) == 1, "car1 is gone"


def test_a_car_is_not_told_of_itself_and_of_what_is_far():
    edge = server()
    look(edge, frame(0), now_ms=0)
    maps = look(
        edge, frame(0, at=(-40.0, 0.0), car="car2"), seen(1.0), seen(10), seen(70), now_ms=150
    )
    (of_first,) = (one for one in maps if one.source == "map")
    assert places(of_first) == [(10, 0)]


def test_a_car_is_not_told_of_what_is_hardly_there():
    edge = server(p_min=0.99)
    (first,) = look(edge, frame(0), seen(20), now_ms=0)
    assert first.objects == ()
    for stamp_ms in (100, 200, 300):  # seen again and again
        (last,) = look(edge, frame(stamp_ms / 1000), seen(20), now_ms=stamp_ms)
    assert places(last) == [(20, 0)]


def test_the_map_names_the_other_cars_that_saw_an_object_lately():
    edge = server()
    look(edge, frame(0), seen(20), now_ms=0)
    maps = look(edge, frame(0.5, car="car2"), seen(20), now_ms=500)
    assert {one.header.origin: one.objects[0].others for one in maps} == {
        "car1": ("car2",),
        "car2": ("car1",),
    }
    maps = look(edge, frame(1, car="car2"), seen(20), now_ms=1000)
    assert {one.header.origin: one.objects[0].others for one in maps} == {
        "car1": ("car2",),
        "car2": (),  # a second ago is no longer lately
    }


@pytest.mark.slow
@pytest.mark.nightly
def test_choosing_is_faster_than_offloading_and_sees_more():
    run = gs.run(
        "livemap.yaml",
        {"perception.duration": "5 s"},
        methods=["at_edge", "livemap:LiveMap", "un_selecting"],
    )
    found = run.metrics[run.metrics["component"] == ""].set_index(["metric", "method"])["value"]
    latency, handled = found["first_answer_mean"], found["fresh_answered_share"]
    assert latency["LiveMap"] < latency["at_edge"], latency
    assert handled["at_edge"] < handled["un_selecting"] < handled["LiveMap"], handled
    assert found["streaming_f1"]["LiveMap"] > found["streaming_f1"]["at_edge"]


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("where: moon", "methods[0].where: "),
        ("probe: 0 s", "methods[0].probe: must be"),
        ("every: -1 ms", "every: must not be negative"),
        ("others: -1", "methods[0].others: must be"),
    ],
)
def test_a_setting_that_makes_no_sense_is_one_line(setting: str, message: str):
    entry = f'{{method: "livemap:LiveMap", {setting}}}'
    with pytest.raises(UserError) as error:
        run_in_memory(load_scenario("livemap.yaml", [f"methods=[{entry}]"]))
    assert message in str(error.value) and "\n" not in str(error.value)
