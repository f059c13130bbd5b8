"""Algorithm 2 by hand: what the object map makes of sightings, and what it knows about a place or a
view.
"""

from __future__ import annotations

import itertools
import math
import random
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from genie_sim.core.confidence import CONFIDENCE_RULES
from genie_sim.core.messages import CameraPose, Header
from genie_sim.core.rules import Percentile
from genie_sim.core.view import ViewSector
from tests.core.worlds import object_map
from tests.make import S, answer, seen

coordinates = st.integers(-500, 500).map(lambda centimetres: centimetres / 100)
scores = st.integers(0, 100).map(lambda percent: percent / 100)
sightings = st.lists(
    st.builds(seen, coordinates, coordinates, st.sampled_from(["car", "person"]), scores),
    min_size=15,
    max_size=30,
)


def told(objects, *sightings):
    for one in sightings:
        objects.sight(one)
    return objects


# Sightings: lines 3 to 7


def test_a_first_sighting_is_stored_with_its_score():
    before, stored = object_map().sight(seen(score=0.3))
    assert before is None
    assert (stored.label, stored.location, stored.score, stored.confidence) == (
        "car",
        (20.0, 0.0, 0.0),
        0.3,
        0.3,
    )


def test_an_object_confirmed_by_another_map_keeps_its_confidence():
    _, stored = object_map().sight(replace(seen(score=0.3), confidence=0.7))
    assert (stored.score, stored.confidence) == (0.3, 0.7)


@pytest.mark.parametrize(
    ("rule", "after"),
    [
        ("noisy_or", 0.3 + 0.1 * 0.8 * (1 - 0.3)),
        ("literal", 0.3 + 0.1 * (0.3 - 0.8)),
        ("ema", 0.3 + 0.1 * (0.8 - 0.3)),
        ("positive_part", 0.3 + 0.1 * (0.8 - 0.3)),
    ],
)
def test_a_second_sighting_changes_the_confidence_and_nothing_else(rule, after):
    objects = object_map(rule=rule)
    objects.sight(seen(score=0.3))
    before, stored = objects.sight(seen(20.4, score=0.8))
    assert (before, stored.confidence) == (0.3, pytest.approx(after))
    assert (stored.score, stored.location) == (0.3, (20.0, 0.0, 0.0))
    assert len(objects) == 1


def test_many_faint_sightings_pass_the_threshold():
    """0.3 instead of 0.65 in the paper's example: each car that sees it adds 0.1 * 0.3 of what is
    missing to 1.
    """
    objects, repeats = told(object_map(), seen(label="traffic light", score=0.3)), 0
    while object_at(objects).confidence < objects.threshold:
        objects.sight(seen(label="traffic light", score=0.3))
        repeats += 1
    assert repeats == math.ceil(math.log((1 - 0.60) / (1 - 0.3)) / math.log(1 - 0.1 * 0.3))


def object_at(objects, label="traffic light", at=(20.0, 0.0)):
    return objects.match(label, (*at, 0.0))


@pytest.mark.parametrize("rule", sorted(CONFIDENCE_RULES))
@settings(max_examples=25)
@given(sightings, st.floats(0.0, 1.0))
def test_confidences_stay_in_their_range_and_nothing_is_counted_twice(rule, sightings, rate):
    objects = told(object_map(rule=rule, rate=rate), *sightings)
    assert all(0.0 <= one.confidence <= 1.0 for one in objects)
    assert len(list(objects)) == len(objects)


# Which stored object a sighting shows


def test_classes_are_told_apart():
    objects = told(object_map(), seen(), seen(label="person"))
    assert [one.label for one in objects] == ["car", "person"]
    assert object_at(objects, "bus") is None


def test_the_nearest_object_of_the_class_is_it():
    objects = told(object_map(), seen(0.0), seen(1.2, score=0.8))
    assert object_at(objects, "car", (0.5, 0.0)).score == 0.9
    assert object_at(objects, "car", (0.7, 0.0)).score == 0.8


@pytest.mark.parametrize(
    ("metres", "same"), [(0.0, True), (0.99, True), (1.0, True), (1.01, False)]
)
def test_the_gate_decides_what_is_the_same_place(metres, same):
    objects = told(object_map(gate_m=1.0), seen(0.5, 0.5))
    assert (object_at(objects, "car", (0.5 + metres, 0.5)) is not None) is same


@pytest.mark.parametrize("step", list(itertools.product((-0.2, 0.0, 0.2), repeat=2)))
def test_an_object_is_found_across_the_borders_of_its_cell(step):
    corner = told(object_map(), seen(3.0 - step[0] / 2, -2.0 - step[1] / 2))
    assert object_at(corner, "car", (3.0 + step[0] / 2, -2.0 + step[1] / 2)) is not None


@settings(max_examples=25)
@given(sightings, st.sampled_from([0.3, 1.0, 2.5, 1e12]))
def test_looking_into_cells_finds_what_looking_at_every_object_finds(sightings, gate_m):
    objects = told(object_map(gate_m=gate_m), *sightings)
    for place in ((0.0, 0.0), (0.3, -0.2), (2.0, 2.0)):
        there = [one for one in objects if distance2(one.location, place) <= gate_m**2]
        assert sorted(map(id, objects.at((*place, 0.0)))) == sorted(map(id, there))
        cars = [distance2(one.location, place) for one in there if one.label == "car"]
        found = object_at(objects, "car", place)
        assert (None if found is None else distance2(found.location, place)) == min(
            cars, default=None
        )


def distance2(location, place):
    return (location[0] - place[0]) ** 2 + (location[1] - place[1]) ** 2


def test_with_exact_locations_a_millimetre_makes_another_object():
    objects = told(
        object_map(location_key="exact"),
        seen(),
        seen(20.001),
    )
    assert len(objects) == 2
    assert objects.sight(seen(score=0.5))[0] == 0.9


def test_literally_any_object_at_a_place_blocks_a_second():
    objects = told(object_map(one_per_location=True), seen(score=0.5), seen(label="person"))
    [only] = objects
    assert (only.label, only.confidence) == ("car", pytest.approx(0.5 + 0.1 * 0.9 * 0.5))


# C_T


def test_the_threshold_may_be_a_number():
    assert object_map().threshold == 0.60
    assert object_map(threshold=0).threshold == 0


@pytest.mark.parametrize("percent", [1.0, 40.0, 60.0, 100.0])
def test_c_t_may_be_a_percentile_of_all_that_is_stored(percent):
    """Nearest rank: the lowest confidence that at least this share does not exceed."""
    rng = random.Random(5)
    objects = object_map(threshold=Percentile(percent), forget_after_ns=4 * S)
    assert objects.threshold == 1.0, "nothing is confident before there is anything"
    for second in range(60):
        objects.forget(second * S)
        one = seen(5.0 * rng.randrange(12), score=rng.random()).with_confidence(rng.random())
        objects.sight(one, second * S)
        stored = sorted(one.confidence for one in objects)
        least = next(
            one
            for one in stored
            if sum(other <= one for other in stored) >= percent / 100 * len(stored)
        )
        assert objects.threshold == least
    objects.forget(100 * S)
    assert len(objects) == 0 and objects.threshold == 1.0


# What is at a place: line 11


def test_a_place_holds_every_object_within_the_gate_of_any_class():
    near, nearer, far = (
        seen(*at, label=label)
        for label, at in (("car", (20, 1.0)), ("dog", (20, 0)), ("bus", (20, -1.01)))
    )
    objects = told(object_map(gate_m=1.0), near, nearer, far)
    assert {one.label for one in objects.at((20.0, 0.0, 0.0))} == {"car", "dog"}


# Replays: lines 10 to 13


@pytest.mark.parametrize("one_per_location", [False, True])
def test_a_replay_shows_the_nearest_of_several_objects_and_adds_the_others(one_per_location):
    objects = told(
        object_map(one_per_location=one_per_location),
        seen(21.1, score=0.92),
        seen(score=0.91),
        seen(22.2, label="dog", score=0.93),
    )
    stored = answer(Header(S, "02", "car1"), seen(21.0, score=0.4))
    boosted = objects.confident(objects.enhanced_cache_boost_data(stored, stored.header)[0])
    assert [one.confidence for one in boosted.objects] == [0.92, 0.91]
    assert boosted.objects[0].location == (21.0, 0.0, 0.0)


def test_a_replay_shows_no_confidence_of_another_class():
    stored = answer(Header(S, "02", "car1"), seen(score=0.4))
    shown = []
    for one_per_location in (False, True):
        objects = told(object_map(one_per_location=one_per_location), seen(label="dog"))
        boosted, lookups = objects.enhanced_cache_boost_data(stored, stored.header)
        shown.append([(one.label, one.confidence) for one in boosted.objects])
        assert lookups.hits == 1
    assert shown == [[("car", 0.4), ("dog", 0.9)], [("car", 0.9)]]


# What is in view


def in_view(objects, heading_deg=0.0, fov_deg=90.0, range_m=50.0, at=(0.0, 0.0)):
    pose = CameraPose(at[0], at[1], 1.6, math.radians(heading_deg))
    return {one.label for one in objects.in_view(pose, math.radians(fov_deg), range_m)}


COMPASS = {
    "east": (30, 0),
    "north": (0, 30),
    "west": (-30, 0),
    "south": (0, -30),
    "far east": (70, 0),
}


def surroundings():
    return told(object_map(), *(seen(*at, label=label) for label, at in COMPASS.items()))


@pytest.mark.parametrize(
    ("heading_deg", "visible"),
    [
        (0, {"east"}),
        (90, {"north"}),
        (180, {"west"}),
        (-180, {"west"}),
        (-90, {"south"}),
        (270, {"south"}),
        (720, {"east"}),
    ],
)
def test_a_camera_sees_what_it_looks_at(heading_deg, visible):
    assert in_view(surroundings(), heading_deg) == visible


def test_headings_wrap_around():
    """West of the camera bearings jump from 180 to -180 degrees; both sides are in view."""
    objects = told(object_map(), seen(-30, -5, label="left"), seen(-30, 5, label="right"))
    assert (
        in_view(objects, heading_deg=179) == in_view(objects, heading_deg=-179) == {"left", "right"}
    )


@pytest.mark.parametrize(("fov_deg", "seen_at_30_deg"), [(59, False), (61, True), (360, True)])
def test_the_field_of_view_extends_half_to_either_side(fov_deg, seen_at_30_deg):
    for side in (30, -30):
        at = (20 * math.cos(math.radians(side)), 20 * math.sin(math.radians(side)))
        assert bool(in_view(told(object_map(), seen(*at)), fov_deg=fov_deg)) is seen_at_30_deg


def test_the_view_ends_at_its_range():
    assert in_view(surroundings(), range_m=29.9) == set()
    assert in_view(surroundings(), range_m=70.1) == {"east", "far east"}


@pytest.mark.parametrize("fov_deg", [0, 59, 90, 180, 250, 360])
def test_the_view_of_a_map_is_that_of_each_of_its_objects(fov_deg):
    """Also at the corners of a lattice, which lie on its borders."""
    places = [(east_m, north_m) for east_m in range(-30, 31, 6) for north_m in range(-30, 31, 6)]
    objects = told(object_map(), *(seen(*place) for place in places))
    for heading_deg in range(0, 360, 45):
        pose = CameraPose(0.0, 0.0, 1.6, math.radians(heading_deg))
        view = pose, math.radians(fov_deg), 30.0
        sector = ViewSector(*view)
        expected = {
            stored.number
            for stored in objects
            if sector.distance_m(*stored.location[:2]) is not None
        }
        assert {stored.number for stored in objects.in_view(*view)} == expected


def test_what_is_in_view_is_told_with_the_confidence_that_it_has_by_then():
    objects, pose = object_map(), CameraPose(0.0, 0.0, 0.0, 0.0)
    for confidence in (0.8, 0.8 + 0.1 * 0.8 * (1 - 0.8)):
        objects.sight(seen(score=0.8))
        in_sight = objects.in_view(pose, 1.0, 50.0)
        assert [stored.as_detection().confidence for stored in in_sight] == [confidence]


def test_only_confident_objects_are_in_view():
    objects = told(
        object_map(), seen(label="sure", score=0.6), seen(20, 3, label="unsure", score=0.59)
    )
    assert in_view(objects) == {"sure"}


@pytest.mark.parametrize("view_cell_m", [7.0, 30.0, 1000.0])
def test_the_cells_that_views_are_looked_up_in_do_not_matter(view_cell_m):
    objects = told(
        object_map(view_cell_m=view_cell_m),
        *(seen(*at, label=label) for label, at in COMPASS.items()),
    )
    assert in_view(objects, range_m=70.1) == {"east", "far east"}


@settings(max_examples=25)
@given(
    sightings,
    st.floats(-7.0, 7.0),
    st.tuples(coordinates, coordinates),
    st.sampled_from([0.5, 3.0, 50.0]),
)
def test_views_through_cells_show_what_looking_at_every_object_shows(
    sightings, heading_rad, at, view_cell_m
):
    """By the angle between two directions, from their dot product, instead of from headings."""
    objects = told(object_map(view_cell_m=view_cell_m, gate_m=0.1), *sightings)
    camera, range_m, half_rad = CameraPose(*at, 1.6, heading_rad), 4.0, math.radians(40.0)
    found = {id(one) for one in objects.in_view(camera, 2 * half_rad, range_m)}
    for one in objects:
        east_m, north_m = one.location[0] - at[0], one.location[1] - at[1]
        distance_m = math.hypot(east_m, north_m)
        ahead_m = east_m * math.cos(heading_rad) + north_m * math.sin(heading_rad)
        margin = ahead_m - distance_m * math.cos(half_rad)
        if distance_m > 0 and abs(margin) > 1e-9 and abs(distance_m - range_m) > 1e-9:
            assert (id(one) in found) is (
                one.confidence >= 0.6 and distance_m < range_m and margin > 0
            )


def test_a_gate_as_wide_as_the_world_takes_no_longer():
    objects = told(object_map(gate_m=1e12), seen(score=0.3))
    before, _ = objects.sight(seen(400.0, 300.0, score=0.8))
    assert before == 0.3 and len(objects) == 1


def test_an_object_that_nobody_sees_for_long_enough_is_forgotten():
    objects = object_map(forget_after_ns=10)
    objects.sight(seen(5.0), 0)
    objects.sight(seen(40.0, 1.0, label="bus"), 3)
    objects.sight(seen(5.1), 8)
    assert objects.forget(12) == []
    assert {one.label for one in objects} == {"car", "bus"}
    assert [one.label for one in objects.forget(13)] == ["bus"]
    assert [one.label for one in objects] == ["car"] and len(objects) == 1, (
        "the car was seen again at 8"
    )
    assert object_at(objects, "bus", (40.0, 1.0)) is None and in_view(objects) == {"car"}
    objects.forget(18)
    assert list(objects) == [] and len(objects) == 0
    before, _ = objects.sight(seen(5.0, score=0.4), 20)
    assert before is None, "who comes again is new"


def test_nothing_is_forgotten_unless_it_is_said():
    objects = told(object_map(), seen(5.0))
    objects.forget(10**18)
    assert len(objects) == 1


@pytest.mark.slow
@given(st.lists(st.tuples(sightings, st.integers(0, 30)), max_size=8), st.sampled_from([0.3, 2.5]))
def test_a_map_that_forgets_holds_what_was_seen_lately(rounds, gate_m):
    """Whatever cells it lies in, an object is there for as long as it was sighted within the time,
    and not longer.
    """
    objects, now_ns, last_ns = object_map(gate_m=gate_m, forget_after_ns=20), 0, {}
    for many, later_ns in rounds:
        now_ns += later_ns
        objects.forget(now_ns)
        for one in many:
            _, stored = objects.sight(one, now_ns)
            last_ns[id(stored)] = (stored, now_ns)
        held = {id(one) for one in objects}
        assert held == {key for key, (_, seen_ns) in last_ns.items() if now_ns - seen_ns < 20}
        assert len(objects) == len(held)
        for stored, _ in last_ns.values():
            there = {id(one) for one in objects.at(stored.location)}
            assert there <= held and (id(stored) in there) is (id(stored) in held)


def test_numbers_of_objects_are_never_reused():
    objects = object_map(forget_after_ns=S)
    _, car = objects.sight(seen(0.0))
    objects.sight(seen(0.2))
    _, person = objects.sight(seen(0.0, label="person"))
    assert (car.number, person.number) == (0, 1)
    objects.forget(S)
    _, later_car = objects.sight(seen(0.0), 2 * S)
    assert later_car.number == 2
