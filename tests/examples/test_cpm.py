"""Collective perception: the standard's rules by hand, what a car makes of what it hears, and more
cars on the channel.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import cpm
import pytest
from cpm import CPM, TOPIC, HeardObjects, Inclusion, Told

import genie_sim as gs
from genie_sim.base.errors import UserError
from genie_sim.core.messages import Detection, Header
from tests.conformance import small
from tests.conformance.methods import MethodConformance
from tests.examples.broadcasting import host, made, thing, watch
from tests.make import MS, frame, seen


@pytest.mark.parametrize("method", ["cpm:CPM"])
class TestConformance(MethodConformance):
    pass


@pytest.mark.parametrize("method", ["cpm:CPM", "autocast:AutoCast"])
def test_on_the_air_every_frame_is_answered_and_no_less_is_served(method: str):
    air, alone = (
        small.simulated(small.scenario([{"method": method, **more}]))
        for more in ({}, {"range": "1 mm"})
    )
    name = method.partition(":")[2]
    small.check_conserved(air["frames"].to_frame(), [name])
    served, served_alone = (found["frames"].to_frame()["objects_served"] for found in (air, alone))
    assert served.sum() >= served_alone.sum() > 0
    channels = air["resources"].to_frame().groupby("resource", observed=True)["completed"].max()
    assert channels["car1/channel"] > 0 and channels["car2/channel"] > 0


@pytest.fixture
def due() -> Callable[..., set[int]]:
    """Which objects, by number, are told at a time."""
    rules = Inclusion(moved_m=4.0, faster_mps=0.5, again_ns=1_000 * MS, persons_ns=500 * MS)

    def at_ms(ms: int, objects: dict[int, Detection]) -> set[int]:
        known = {("car1", number): item for number, item in objects.items()}
        return {number for _, number in rules.due(known, ms * MS)}

    return at_ms


@pytest.mark.parametrize(
    ("ms", "east_m", "speed_mps", "is_due"),
    [
        (100, 0.0, 0.0, False),
        (100, 4.0, 0.0, False),
        (100, 4.1, 0.0, True),
        (100, 0.0, 0.5, False),
        (100, 0.0, 0.6, True),
        (900, 0.0, 0.0, False),
        (1_000, 0.0, 0.0, True),
    ],
)
def test_a_car_is_told_again_when_it_moves_speeds_up_or_is_old(
    due: Callable[..., set[int]], ms: int, east_m: float, speed_mps: float, is_due: bool
):
    assert due(0, {1: thing("car", (0.0, 0.0), 0)}) == {1}, "it is new"
    now = thing("car", (east_m, 0.0), ms, speed=(0.0, speed_mps))
    assert due(ms, {1: now}) == ({1} if is_due else set())


def test_what_counts_is_the_change_since_it_was_told(due: Callable[..., set[int]]):
    """Three metres, and three more."""
    found = [
        due(ms, {1: thing("car", (east_m, 0.0), 0)})
        for ms, east_m in ((0, 0.0), (100, 3.0), (200, 6.0), (300, 9.0))
    ]
    assert found == [{1}, set(), {1}, set()]


def test_one_person_that_is_due_takes_all_persons_along(due: Callable[..., set[int]]):
    first, second = thing("person", (0.0, 0.0), 0), thing("person", (9.0, 0.0), 0)
    car = thing("car", (20.0, 0.0), 0)
    assert due(0, {1: first, 3: car}) == {1, 3}
    assert due(100, {1: thing("person", (5.0, 0.0), 100), 3: car}) == set()
    assert due(400, {1: first, 2: second, 3: car}) == {1, 2}, "the second is new"
    assert due(800, {1: first, 2: second, 3: car}) == set()
    assert due(900, {1: first, 2: second, 3: car}) == {1, 2}


def test_messages_have_the_bytes_of_their_objects_and_come_once_a_second():
    """Two parked cars: told when they are new, and a second later. Until then there is nothing to
    tell.
    """
    frames = [frame(ms / 1000) for ms in range(0, 3_000, 100)]
    told, _ = watch(made(CPM(), "car1"), frames, (seen(20.0), seen(30.0, 5.0)), TOPIC)
    assert all(one.size_bytes == 121 + 35 * len(one.objects) for one in told)
    assert (len(told[0].objects), told[0].size_bytes) == (0, 121)
    of_two = [one.header.stamp_ns // MS for one in told if len(one.objects) == 2]
    assert len(of_two) == 3 and {b - a for a, b in pairwise(of_two)} == {1_000}
    assert len(told) <= 5


@pytest.mark.parametrize(("every_ms", "most"), [(100, 30), (500, 6)])
def test_messages_keep_their_interval(every_ms: int, most: int):
    frames = [frame(ms / 1000) for ms in range(0, 3_000, 100)]
    method = CPM(every_ns=every_ms * MS, longest_ns=every_ms * MS)
    told, _ = watch(made(method, "car1"), frames, (), TOPIC)
    assert len(told) == most


def heard_from(*objects: Detection, by: str = "car9") -> Told:
    numbered = {(by, number): item for number, item in enumerate(objects)}
    return Told(Header(0, TOPIC, by), 121 + 35 * len(objects), numbered)


def test_of_what_several_cars_tell_the_newest_sighting_counts():
    heard = HeardObjects()
    for by, east_m, ms in (("car8", 10.0, 100), ("car9", 11.0, 200), ("car7", 12.0, 150)):
        heard.add(heard_from(thing("car", (east_m, 0.0), ms, by), by=by))
    (known,) = heard.objects(220 * MS).values()
    assert (known.location, known.seen_in.origin) == ((11.0, 0.0, 0.0), "car9")
    heard.add(heard_from(thing("person", (11.0, 0.0), 100), by="car6"))
    assert len(heard.objects(220 * MS)) == 2, "another class"


def test_what_a_car_tells_again_replaces_what_it_told():
    """First it took the object to move fast."""
    heard = HeardObjects()
    heard.add(heard_from(thing("car", (10.0, 0.0), 100, speed=(20.0, 0.0))))
    heard.add(heard_from(thing("car", (10.0, 0.0), 400)))
    assert [item.location[0] for item in heard.objects(500 * MS).values()] == [10.0]


def test_objects_of_one_car_are_different_ones():
    """Two people walk side by side."""
    heard = HeardObjects()
    heard.add(heard_from(thing("person", (10.0, 0.0), 100), thing("person", (10.5, 0.0), 100)))
    assert len(heard.objects(200 * MS)) == 2


def test_what_was_heard_moves_on_and_is_forgotten():
    heard = HeardObjects()
    heard.add(heard_from(thing("car", (10.0, 0.0), 0, speed=(5.0, 0.0))))
    for ms, east_m in ((100, 10.5), (1_000, 15.0), (1_500, 15.0)):
        (known,) = heard.objects(ms * MS).values()
        assert known.location == pytest.approx((east_m, 0.0, 0.0)), "at most a second ahead"
    assert not heard.objects(1_501 * MS)


def test_an_answer_has_what_the_car_saw_and_what_it_heard_but_for_itself():
    car = made(CPM(), "car1")
    behind, itself = thing("car", (-30.0, 0.0), 900), thing("car", (1.0, 0.0), 900)
    car.on_message(TOPIC, heard_from(behind, itself), 950 * MS, "car9")
    frames = [frame(ms / 1000) for ms in range(500, 1_500, 100)]
    _, answers = watch(car, frames, (seen(12.0, label="person"),), TOPIC)
    places = {item.label: item.location[0] for item in answers[-1].objects}
    assert places == pytest.approx({"person": 12.0, "car": -30.0})
    assert answers[-1].valid_ns == 1_450 * MS and answers[-1].is_fresh


@pytest.mark.parametrize(("heard_ms", "east_m"), [(500, 20.0), (1_420, 21.5)])
def test_of_what_the_car_saw_and_heard_of_the_newest_counts(heard_ms: int, east_m: float):
    """It sees a parked car at 20 m until 1.4 s; another says 21.5 m."""
    car = made(CPM(), "car1")
    car.on_message(TOPIC, heard_from(thing("car", (21.5, 0.0), heard_ms)), 600 * MS, "car9")
    frames = [frame(ms / 1000) for ms in range(500, 1_500, 100)]
    _, answers = watch(car, frames, (seen(20.0),), TOPIC)
    (held,) = answers[-1].objects
    assert held.location[0] == pytest.approx(east_m)


def test_what_others_have_told_is_not_told_again_where_this_is_wanted():
    parked, frames = (seen(20.0),), [frame(ms / 1000) for ms in range(0, 1_000, 100)]

    def told(**settings: int) -> int:
        car = made(CPM(**settings), "car1")
        car.on_message(TOPIC, heard_from(thing("car", (20.0, 0.0), 0)), 10 * MS, "car9")
        return sum(len(one.objects) for one in watch(car, frames, parked, TOPIC)[0])

    assert told() == 1
    assert told(unless_heard_ns=1_500 * MS) == 0


def test_what_the_car_has_not_seen_for_long_is_not_told():
    """A parked car, passed by at 1 s: its track stays, and is told no more."""
    car, parked = made(CPM(), "car1"), (seen(20.0),)
    watch(car, [frame(ms / 1000) for ms in range(0, 1_000, 100)], parked, TOPIC)
    frames = [frame(ms / 1000, at=(50.0, 0.0)) for ms in range(1_000, 5_000, 100)]
    told, answers = watch(car, frames, (), TOPIC)
    assert [one.header.stamp_ns // MS for one in told if one.objects] == [1_100, 2_100]
    assert len(answers[-1].objects) == 1


@pytest.mark.slow
@pytest.mark.nightly
def test_with_more_cars_the_channel_is_busier_and_cars_know_more():
    """Thandavarayan et al.: more messages, and the same cars know more of what is around."""
    methods = [{"name": "alone", "method": "local", "consumer": "tracker"}, "cpm:CPM"]
    cars = ["car1", "car2", "car3"]
    busy, recall, hidden = {}, {}, {}
    for count in (3, 12):
        setting = {"fleet.cars": count, "perception.duration": "3 s", "seed": 2}
        run = gs.run("cpm.yaml", {**setting, "methods": methods})
        used = run.metrics[run.metrics["metric"] == "utilization"]
        used = used[used["component"].isin([f"{car}/channel" for car in cars])]
        busy[count] = used["value"].mean()
        held = run.held[(run.held["what"] == "consumer") & run.held["car"].isin(cars)]
        for method, rows in held.groupby("method", observed=True):
            visible = (rows["visible_static"] + rows["visible_moving"]).sum()
            recall[count, method] = rows["right"].sum() / visible
            hidden[count, method] = rows["hidden"].mean()
    assert busy[12] > 2 * busy[3] > 0
    assert recall[12, "CPM"] > recall[3, "CPM"] and recall[12, "CPM"] > recall[12, "alone"]
    assert hidden[12, "CPM"] > hidden[3, "CPM"] and hidden[12, "CPM"] > hidden[12, "alone"]


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ({"every": "50 ms"}, r"methods\[0\].every: must be from 100 ms to 1 s, but is '50 ms'"),
        ({"unless_heard": "2 s"}, r"methods\[0\].unless_heard: must be from 0 s to 1.5 s"),
        ({"moved": "-1 m"}, r"methods\[0\].moved: must not be negative"),
        ({"persns": "1 s"}, r"unknown parameter of cpm:CPM 'persns' \(did you mean 'persons'"),
    ],
)
def test_a_wrong_setting_of_cpm_is_one_line(setting: dict[str, str], message: str):
    with pytest.raises(UserError, match=message) as error:
        gs.run("cpm.yaml", {"methods": [{"method": "cpm:CPM", **setting}]})
    assert "\n" not in str(error.value)


def test_a_car_without_cameras_is_left_out():
    assert CPM().on_car(host("car1")) is not None
    assert CPM().on_car(replace(host("car1"), gets_images=False)) is None
    assert cpm.hidden_held.unit == "objects"
