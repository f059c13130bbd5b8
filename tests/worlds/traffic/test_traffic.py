"""Recorded traffic as a source of frames: who drives when, what is told of it, and fleets on it."""

from __future__ import annotations

import logging
import math
from pathlib import Path

import pytest

from genie_sim.base.errors import UserError
from genie_sim.runs.prepare import prepare
from genie_sim.scenario.reading import read_scenario
from genie_sim.scenario.scenario import Scenario
from tests.judge.judging import is_there
from tests.worlds.traffic.fcd_files import write_fcd

SECONDS = 4
FLEET = {
    "devices": "jetson_tx2",
    "edge_device": "agx_xavier",
    "link": "nr5g",
    "cell": "60 m",
    "hysteresis": "1 m",
}


def street(step_s: float = 0.5):
    """Four seconds of a street: a drives east at 20 m/s, b follows 30 m behind; c stands ahead on
    the right until 3 s; d comes after 1.5 s and leaves after 3 s; t teleports after 2 s.
    """
    steps = []
    for k in range(int(SECONDS / step_s) + 1):
        t_s = k * step_s
        places = {"a": (20 * t_s, 0.0, 90.0), "b": (20 * t_s - 30, 0.0, 90.0)}
        if t_s <= 3:
            places["c"] = (60.0, -6.0, 90.0)
        if 1.5 <= t_s <= 3:
            places["d"] = (100.0 - 10 * t_s, 4.0, 270.0)
        places["t"] = (30.0 if t_s <= 2 else 900.0, 40.0, 0.0)
        steps.append((100 + t_s, places))
    return steps


@pytest.fixture
def fcd(tmp_path) -> str:
    return str(write_fcd(tmp_path / "street.xml", street(), types={"c": "truck"}))


def scenario(fcd: str, *, fleet=FLEET, **perception) -> Scenario:
    settings = {
        "name": "street",
        "methods": ["remote"],
        "perception": {"source": "traffic", "fcd": fcd, **perception},
        "cameras": [{"name": "camera_02", "recording": "02", "size": "90 kB"}],
        "start_jitter": "0 s",
        "fleet": fleet,
    }
    return read_scenario(settings)


def drives(fcd: str, **perception):
    return prepare(scenario(fcd, **perception)).drives


def test_a_car_starts_and_ends_with_its_vehicle(fcd):
    prepared = prepare(scenario(fcd))
    starts_s = {car.name: car.route.start_ns / 1e9 for car in prepared.scenario.cars}
    assert starts_s == {"veh_a": 0, "veh_b": 0, "veh_c": 0, "veh_t": 0, "veh_d": 1.5}
    counts = {car: len(drive.frames["02"]) for car, drive in prepared.drives.items()}
    assert counts == {"veh_a": 40, "veh_b": 40, "veh_c": 30, "veh_t": 20, "veh_d": 15}
    first, *_, last = prepared.drives["veh_d"].frames["02"]
    assert (first.stamp_ns, last.stamp_ns) == (0, 1_400_000_000)
    # The middle of d, 2.5 m behind its bumper; the camera is 0.27 m to the left.
    assert first.pose[:2] == pytest.approx((87.5, 3.73), abs=1e-3)
    assert abs(first.pose.heading_rad) == pytest.approx(math.pi, abs=1e-6)
    assert last.pose[:2] == pytest.approx((73.5, 3.73), abs=1e-3)


def test_begin_and_duration_choose_a_part(fcd):
    parts = drives(fcd, begin="101.2 s", duration="1.5 s")
    starts_ns = {car: drive.start_ns for car, drive in parts.items()}
    # t is there for 0.8 s before its teleport and for less after it, which is too short.
    assert starts_ns == {"veh_a": 0, "veh_b": 0, "veh_c": 0, "veh_d": 300_000_000}
    assert parts["veh_a"].position(0)[0] == pytest.approx(20 * 1.2 - 2.5)
    assert parts["veh_a"].duration_ns == 1_500_000_000


def test_the_end_of_the_time_is_not_in(tmp_path):
    """As in a town and in a window: 20 frames of 2 s, and no vehicle that comes at its end."""
    places = {"a": (10.0, 0.0, 90.0)}
    late = places | {"b": (50.0, 0.0, 90.0)}
    steps = [(0.0, places), (1.0, places), (2.0, late), (3.0, late), (4.0, late)]
    path = str(write_fcd(tmp_path / "late.xml", steps))
    prepared = prepare(scenario(path, begin="0 s", duration="2 s", interval="100 ms"))
    assert len(prepared.drives["veh_a"].frames["02"]) == 20
    assert prepared.frames.provenance()["traffic"]["vehicles"] == 1


def test_a_share_of_the_vehicles_is_equipped_and_a_larger_one_adds_to_it(tmp_path):
    many = {f"v{k}": (30.0 * k, 0.0, 90.0) for k in range(200)}
    path = str(write_fcd(tmp_path / "many.xml", [(0.0, many), (2.0, many)]))
    few, more = (set(drives(path, equipped=share)) for share in (0.2, 0.5))
    assert few < more and 20 < len(few) < 60 and 75 < len(more) < 125
    assert len(drives(path, equipped=1.0)) == 200


def test_vehicles_are_equipped_by_their_ids(fcd):
    prepared = prepare(scenario(fcd, equipped=["d", "a"]))
    assert [car.name for car in prepared.scenario.cars] == ["veh_d", "veh_a"]
    assert set(prepared.drives) == {"veh_a", "veh_d"}


def test_the_truth_is_that_of_the_instant(fcd):
    """c stands, d moves; persons, of which the file knows nothing, are not judged."""
    prepared = prepare(scenario(fcd, equipped=["a"]))
    drive = prepared.drives["veh_a"]
    truth = prepared.frames.truth_of(drive)
    frame = drive.frames["02"][20]  # at 2 s: a is at 37.5 m, d at 77.5 m + 5 m
    visible = {item.label: item for item in truth.visible(frame)}
    assert {label: item.moving for label, item in visible.items()} == {"truck": False}
    assert visible["truck"].location[:2] == pytest.approx((60 - 3.55, -6.0))
    assert is_there(truth, frame, "car", 82.5, 4.5) and is_there(truth, frame, "bus", 82.5, 3.0)
    assert not is_there(truth, frame, "car", 82.5, 6.5), "two metres beside it"
    assert not is_there(truth, frame, "car", 85.0, 4.0), "where it was earlier"
    assert not is_there(truth, frame, "bicycle", 82.5, 4.0)
    late = drive.frames["02"][39]
    assert not is_there(truth, late, "car", 72.5, 4.0), "d has left"
    assert truth.knows("bus") and not truth.knows("person")


def test_teleports_are_told_and_recorded(fcd, caplog):
    """Those of vehicles: the person who also jumps is none."""
    before, step, after = Path(fcd).read_text().partition('<timestep time="102.00">')
    parts = [
        part.replace("</timestep>", f'<person id="p" x="{x_m}" y="90"/></timestep>')
        for part, x_m in ((before, 0.0), (after, 900.0))
    ]
    Path(fcd).write_text(step.join(parts))
    with caplog.at_level(logging.WARNING):
        prepared = prepare(scenario(fcd))
    assert "1 of 5 vehicles teleport, 1 times in all" in caplog.text
    about = prepared.frames.provenance()["traffic"]
    assert (about["vehicles"], about["teleports"], about["vehicles_that_teleport"]) == (5, 1, 1)
    assert about["types"]["truck"]["label"] == "truck"


def test_persons_are_seen_and_judged_and_carry_no_cameras(fcd, tmp_path):
    """One stands ten metres ahead of a, who drives by."""
    person = '<person id="a" x="40" y="2" angle="0" speed="0" type="DEFAULT_PEDTYPE"/>'
    text = Path(fcd).read_text().replace("</timestep>", person + "</timestep>")
    (tmp_path / "p.xml").write_text(text)
    prepared = prepare(scenario(str(tmp_path / "p.xml")))
    assert list(prepared.drives) == list(prepare(scenario(fcd)).drives)
    drive = prepared.drives["veh_a"]
    frame = drive.frames["02"][10]
    (seen,) = (item for item in frame.truth() if item.label == "person")
    assert (seen.east_m, seen.north_m) == (40.0, 2.0) and not seen.moving
    truth = prepared.frames.truth_of(drive)
    assert truth.knows("person") and is_there(truth, frame, "person", 40.0, 2.0)


def test_types_that_say_nothing_are_told(tmp_path, caplog):
    path = write_fcd(tmp_path / "a.xml", street(), types={"c": "xyz_1", "a": "truck"})
    with caplog.at_level(logging.WARNING):
        prepare(scenario(str(path)))
    assert "types taken for cars: 'xyz_1' (1); perception.types says what they are" in caplog.text
    caplog.clear()
    prepare(scenario(str(path), types={"xyz_1": {"label": "bus"}}))
    assert "taken for cars" not in caplog.text and "unknown type" not in caplog.text
    prepare(scenario(str(path), types={"xyz_1": {"label": "bus"}, "trukk": {"label": "bus"}}))
    assert "unknown type 'trukk' (did you mean 'truck'?)" in caplog.text


def test_a_fleet_has_cells_around_the_traffic_and_hand_overs(fcd):
    """The extent is that of the vehicles' places, and a is handed over as it drives east."""
    prepared = prepare(scenario(fcd, equipped=["a"]))
    west_m, south_m, east_m, north_m = prepared.frames.extent_m
    assert (west_m, south_m) == pytest.approx((-42.5, -16.0))
    assert (east_m, north_m) == pytest.approx((910.0, 47.5))
    faults = prepared.scenario.faults
    assert [fault.target for fault in faults] == ["veh_a"]
    (car,) = prepared.scenario.cars
    assert car.edge != faults[0].fault.parameters["edge"]
    # 16 cells from west to east: a crosses the border of the first two.
    crosses_s = (west_m + (east_m - west_m) / 16 + 2.5) / 20
    assert faults[0].begin_ns / 1e9 == pytest.approx(crosses_s, abs=0.6)


def test_the_same_traffic_gives_the_same_digest_in_any_file(fcd, tmp_path):
    packed = str(write_fcd(tmp_path / "b.xml.gz", street(), types={"c": "truck"}))

    def digests(**perception):
        return prepare(scenario(**perception)).frames.digests()

    ruler = {"tolerance": "3 m", "range": "40 m", "equipped": 0.5, "interval": "200 ms"}
    assert digests(fcd=fcd) == digests(fcd=packed) == digests(fcd=fcd, **ruler)
    for of_scene in ({"view": "50 m"}, {"begin": "101 s"}, {"types": {"truck": {"label": "bus"}}}):
        assert digests(fcd=fcd) != digests(fcd=fcd, **of_scene)
    other = str(write_fcd(tmp_path / "c.xml", street()[:-1], types={"c": "truck"}))
    assert digests(fcd=fcd) != digests(fcd=other)


def test_cars_may_be_listed_and_start_when_their_vehicle_is_there(fcd):
    def prepared(name, start):
        settings = {
            "name": "one",
            "perception": {"source": "traffic", "fcd": fcd},
            "cameras": [{"name": "camera_02", "recording": "02"}],
            "start_jitter": "0 s",
            "cars": [{"name": name, "device": "jetson_tx2", "route": {"start": start}}],
            "methods": ["local"],
        }
        return prepare(read_scenario(settings))

    assert len(prepared("veh_d", "2 s").drives["veh_d"].frames["02"]) == 10
    with pytest.raises(UserError, match=r"veh_d starts at 0 s, but is there from 1.5 s to 3 s"):
        prepared("veh_d", "0 s")
    with pytest.raises(UserError, match=r"unknown vehicle 'veh_x'"):
        prepared("veh_x", "0 s")


@pytest.mark.parametrize(
    ("perception", "message"),
    [
        ({"equipped": ["a", "x"]}, "perception.equipped: unknown vehicle 'x'"),
        ({"equipped": []}, "perception.equipped: must not be empty"),
        ({"equipped": ["a", "a"]}, "perception.equipped: names a vehicle twice"),
        ({"equipped": 1e-9}, "perception.equipped: none of 5 vehicles is equipped"),
        ({"begin": "104 s", "equipped": ["a"]}, "perception.equipped: none of 3 .*'begin'"),
        ({"equipped": "all"}, "perception.equipped: must be a number or a list"),
        (
            {"types": {"bus": {"label": "plane"}}},
            "perception.types.bus.label: unknown label 'plane'",
        ),
        ({"fcd": "no_such"}, "unknown traffic 'no_such'"),
    ],
)
def test_what_is_wrong_is_told_in_one_line(fcd, perception, message):
    with pytest.raises(UserError, match=message) as error:
        prepare(scenario(**{"fcd": fcd, **perception}))
    assert "\n" not in str(error.value)


def test_a_fleet_of_traffic_has_no_number_of_cars(fcd):
    with pytest.raises(
        UserError, match=r"fleet\.cars: traffic has 5 cars of its own: leave it out"
    ):
        prepare(scenario(fcd, fleet=FLEET | {"cars": 3}))


def test_two_vehicles_with_one_name_are_refused(tmp_path):
    twins = {"a:1": (0.0, 0.0, 90.0), "a/1": (50.0, 0.0, 90.0)}
    path = str(write_fcd(tmp_path / "twins.xml", [(0.0, twins), (2.0, twins)]))
    with pytest.raises(UserError, match="vehicles 'a:1' and 'a/1' would both be called veh_a_1"):
        drives(path)
