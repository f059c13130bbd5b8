"""Where vehicles of recorded traffic are, and which of them a camera sees."""

from __future__ import annotations

import math

import numpy as np
import pytest

from genie_sim.base.classes import SIZES
from genie_sim.base.plugins import Choice
from genie_sim.scenario.scenario import FRAME_SOURCE
from genie_sim.worlds.scene.view import ViewPoses
from genie_sim.worlds.traffic.fcd import read_fcd
from genie_sim.worlds.traffic.vehicle_types import TYPES, VehicleType, type_named
from genie_sim.worlds.traffic.vehicles import Vehicles
from tests.worlds.traffic.fcd_files import write_fcd


def vehicles_of(folder, steps, types=None, *, own_types=None) -> Vehicles:
    path = write_fcd(folder / "a.xml", steps, types=types)
    return Vehicles(read_fcd(path, None, 1000.0), own_types or {})


def at(vehicles: Vehicles, vehicle: int, t_s: float):
    """East, north, heading [degrees] and speed of a vehicle; ``None`` where it is not there."""
    nowhere, time = np.zeros(1), np.array([t_s])
    _, rows = vehicles.near(nowhere, nowhere, time, 1e9)
    rows = rows[vehicles.vehicle[rows] == vehicle]
    if not len(rows):
        return None
    motions = vehicles.at(rows, time)
    heading_deg = math.degrees(math.atan2(motions.sin[0], motions.cos[0]))
    values = (motions.east_m[0], motions.north_m[0], heading_deg, motions.speed_mps[0])
    return tuple(round(float(value), 6) for value in values)


def test_the_file_tells_the_front_bumper_and_a_compass_bearing(tmp_path):
    """The middle is half a length behind; a bus is longer than a car."""
    steps = [(0.0, {"a": (10, 20, 90), "b": (10, 20, 0), "c": (10, 20, 270)})]
    vehicles = vehicles_of(tmp_path, steps, {"b": "city_bus"})
    assert at(vehicles, 0, 0.0) == (7.5, 20, 0, 0)
    assert at(vehicles, 1, 0.0) == (10, 14, 90, 0)
    assert at(vehicles, 2, 0.0)[:2] == (12.5, 20)
    own = vehicles_of(tmp_path, steps, own_types={"passenger": VehicleType("truck", 8.0, 2.0)})
    assert at(own, 0, 0.0) == (6, 20, 0, 0)


def test_between_steps_it_goes_straight_and_turns_the_shorter_way(tmp_path):
    steps = [(5.0, {"a": (0, 2.5, 0)}), (6.0, {"a": (0, 6.5, 0)})]
    vehicles = vehicles_of(tmp_path, steps)
    assert at(vehicles, 0, 0.25) == (0, 1, 90, 4)
    steps = [(0.0, {"a": (0, 0, 350)}), (1.0, {"a": (0, 4, 20)})]
    vehicles = vehicles_of(tmp_path, steps)
    assert at(vehicles, 0, 0.5)[2] == pytest.approx(90 - 5)
    assert at(vehicles, 0, 1.0)[2] == pytest.approx(90 - 20)


def test_a_vehicle_is_there_from_its_first_step_to_its_last(tmp_path):
    steps = [(t, {"a": (t, 0, 90)} | ({"b": (t, 9, 90)} if t in (1, 2) else {})) for t in range(5)]
    vehicles = vehicles_of(tmp_path, steps)
    assert [at(vehicles, 1, t_s) is not None for t_s in (0.9, 1.0, 1.5, 2.0, 2.1)] == [
        False,
        True,
        True,
        True,
        False,
    ]
    assert at(vehicles, 0, 4.0)[0] == pytest.approx(4 - 2.5)
    assert at(vehicles, 0, 4.1) is None


def test_a_teleport_is_no_movement(tmp_path):
    """A jump faster than 70 m/s, and a gap: in between the vehicle is nowhere."""
    xs = {0: 0, 1: 10, 2: 81, 3: 91, 5: 111}
    steps = [(t, ({"a": (xs[t], 0, 90)} if t in xs else {}) | {"b": (0, 9, 0)}) for t in range(6)]
    vehicles = vehicles_of(tmp_path, steps)
    assert [at(vehicles, 0, t) is not None for t in (0.5, 1.5, 2.5, 4.0, 5.0)] == [
        True,
        False,
        True,
        False,
        True,
    ]
    assert vehicles.jumps.tolist() == [1, 0]
    spans_s = [(0, 10.0), (0, 0.5), (1, 4.5)]
    longest = [vehicles.longest(vehicle, end_s) for vehicle, end_s in spans_s]
    # of the first vehicle's two that are as long the first
    assert [(of.begin_s, of.end_s) for of in longest] == [(0.0, 1.0), (0.0, 0.5), (0.0, 4.5)]
    course = longest[0].at(np.array([-0.1, 0.5, 1.0, 1.1]))
    assert course.east_m.tolist() == [-2.5, 2.5, 7.5, 7.5], "it goes on to its end, and no further"
    assert course.speed_mps.tolist() == [10.0] * 4
    slower = [(t, {"a": (x, 0, 90)}) for t, x in enumerate((0, 69))]
    assert vehicles_of(tmp_path, slower).jumps.tolist() == [0]


def test_who_may_be_near_includes_everybody_who_is(tmp_path):
    """Against all that are there, at many places and times; some are not there all the time."""
    random = np.random.default_rng(5)
    begins_m = random.uniform(-200, 200, (40, 2)).round(2)
    steps = [
        (
            0.1 * step,
            {
                f"v{number}": (east_m + 1.3 * step, north_m, 90)
                for number, (east_m, north_m) in enumerate(begins_m)
                if number % 7 <= step % 31
            },
        )
        for step in range(61)
    ]
    vehicles = vehicles_of(tmp_path, steps)
    x_m, y_m = random.uniform(-200, 200, (2, 50))
    t_s = random.uniform(0, 6, 50)
    query, row = vehicles.near(x_m, y_m, t_s, 1e9)
    there = vehicles.at(row, t_s[query])
    is_near = np.hypot(there.east_m - x_m[query], there.north_m - y_m[query]) <= 50
    expected = set(zip(query[is_near], row[is_near], strict=True))
    query, row = vehicles.near(x_m, y_m, t_s, 50.0)
    nearby = set(zip(query, row, strict=True))
    assert expected <= nearby and 50 < len(nearby) < 2 * len(expected)
    assert (np.diff(query) >= 0).all()


@pytest.mark.parametrize(
    ("name", "label"),
    [
        ("DEFAULT_VEHTYPE", "car"),
        ("veh_passenger", "car"),
        ("truck_truck", "truck"),
        ("bus_bus", "bus"),
        ("DEFAULT_BIKETYPE", "bicycle"),
        ("motorcycle_motorcycle", "motorcycle"),
        ("city Tram", "train"),
        ("Bus2", "bus"),
        ("motorbike", "motorcycle"),
        ("business_car", "car"),
        ("taxis", "car"),
        ("trucks", "truck"),
        ("city_buses", "bus"),
        ("Lorries", "truck"),
        ("container_truck", "truck"),
        ("cable_car", None),
        ("DEFAULT_SCOOTERTYPE", None),
        ("strain", None),
        ("", None),
    ],
)
def test_types_are_recognised_by_words(name, label):
    kind = type_named(name)
    assert (kind and kind.label) == label


def test_every_type_has_a_class_and_is_longer_than_wide():
    for vehicle in TYPES.values():
        assert vehicle.label in SIZES and vehicle.length_m > vehicle.width_m > 0, vehicle


def seen(folder, others, types=None, *, view_m=60.0, heading=0.0, t_s=0.0):
    """Which of the vehicles a camera at (0, 0) sees that looks east; places are of the middle."""
    half_m = {"b": 6.0, "t": 3.55, "k": 0.8}
    kinds = {"b": "bus", "t": "truck", "k": "bike"}
    steps = [
        (
            0.0,
            {
                name: (x_m + half_m.get(name[0], 2.5), y_m, 90)
                for name, (x_m, y_m) in others.items()
            },
        )
    ]
    types = {name: kinds[name[0]] for name in others if name[0] in kinds}
    path = write_fcd(folder / "a.xml", steps, types=types)
    return seen_in(path, view_m=view_m, heading=heading, t_s=t_s)


def seen_in(path, *, view_m=60.0, heading=0.0, t_s=0.0):
    """Which of the vehicles in a file a camera at (0, 0) sees."""
    source = FRAME_SOURCE.make(
        Choice("traffic", {"fcd": str(path), "view_m": view_m, "range_m": view_m})
    )
    traffic = source.open(1, None).scene
    poses = ViewPoses._make(
        np.array([column])
        for column in (0.0, 0.0, math.cos(heading), math.sin(heading), t_s, np.uint64(1))
    )
    visible = traffic.visibility.visible(poses)
    return {traffic.vehicles.ids[row] for row in visible.row}


def test_a_vehicle_ahead_is_in_view_and_one_aside_or_behind_is_not(tmp_path):
    others = {"ahead": (20, 0), "left": (20, 15), "aside": (10, 15), "behind": (-20, 0)}
    assert seen(tmp_path, others) == {"ahead", "left"}
    assert seen(tmp_path, others, heading=math.pi) == {"behind"}


def test_nothing_is_seen_too_near_too_far_or_too_small(tmp_path):
    others = {"near": (3, 0), "ahead": (20, 10), "far": (41, 10), "farther": (45, -2)}
    assert seen(tmp_path, others, view_m=42) == {"ahead"}
    assert seen(tmp_path, {"b": (55, 0)}) == {"b"}, "a bus is 25 pixels high at 61 m"
    assert seen(tmp_path, {"c": (55, 0)}) == set(), "a car is not"


def test_a_lorry_hides_what_is_behind_it(tmp_path):
    assert seen(tmp_path, {"t": (15, 0), "car": (30, 0)}) == {"t"}
    assert seen(tmp_path, {"t": (15, 0), "car": (30, 4)}) == {"t", "car"}, "beside its shadow"
    assert seen(tmp_path, {"car": (15, 0), "t": (30, 0)}) == {"car", "t"}, "seen over a car"
    assert seen(tmp_path, {"car": (10, 0), "other": (30, 0)}) == {"car"}
    assert seen(tmp_path, {"k": (15, 0), "car": (30, 1.5)}) == {"k", "car"}


def test_a_lorry_hides_more_of_the_street_when_it_stands_across(tmp_path):
    """It is 7.1 m long and 2.4 m wide; the car is 30 m ahead and 4 m to the left."""

    def seen_behind(angle_deg: float, x_m: float, y_m: float) -> bool:
        turn = math.radians(90 - angle_deg)
        bumper = x_m + 3.55 * math.cos(turn), y_m + 3.55 * math.sin(turn)
        places = {"t": (*bumper, angle_deg), "car": (32.5, 4.0, 90)}
        path = write_fcd(tmp_path / "a.xml", [(0.0, places)], types={"t": "truck"})
        return "car" in seen_in(path)

    assert seen_behind(90, 15, 0)
    assert not seen_behind(0, 15, 0)
    # On the left and askew, one of its ends reaches into the line of sight, or neither does.
    assert not seen_behind(135, 17, 5.5)
    assert seen_behind(45, 17, 5.5)


def test_the_camera_s_own_vehicle_hides_nothing(tmp_path):
    assert seen(tmp_path, {"own": (0.3, 0), "car": (20, 0)}) == {"car"}


def test_a_vehicle_that_is_in_view_in_part_hides_too(tmp_path):
    """A long one, whose middle is beside the field of view."""
    assert seen(tmp_path, {"car": (14.5, 7)}) == {"car"}
    assert seen(tmp_path, {"b": (3, 3.4), "car": (14.5, 7)}) == set()
