"""Collective perception: the standard's rules by hand, what a car makes of what it hears, and busier
channels with more cars.
"""

from __future__ import annotations

from dataclasses import replace

import cpm
import pytest
from cpm import CPM, TOPIC, HeardObjects, Inclusion, Told

import genie_sim as gs
from genie_sim.base.errors import UserError
from genie_sim.core.messages import Header
from tests.conformance.methods import MethodConformance
from tests.examples.broadcasting import MS, image, made, seen, thing, watch


@pytest.mark.parametrize("method", ["cpm:CPM"])
class TestConformance(MethodConformance):
    pass


@pytest.fixture
def rules() -> Inclusion:
    return Inclusion(moved_m=4.0, faster_mps=0.5, again_ns=1_000 * MS, persons_ns=500 * MS)


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
    rules: Inclusion, ms: int, east_m: float, speed_mps: float, is_due: bool
):
    assert rules.due({1: thing("car", (0.0, 0.0), 0)}, 0) == {1}, "it is new"
    now = thing("car", (east_m, 0.0), ms, speed=(0.0, speed_mps))
    assert rules.due({1: now}, ms * MS) == ({1} if is_due else set())


def test_what_counts_is_the_change_since_it_was_told(rules: Inclusion):
    """Three metres, and three more."""
    found = [
        rules.due({1: thing("car", (east_m, 0.0), 0)}, ms * MS)
        for ms, east_m in ((0, 0.0), (100, 3.0), (200, 6.0), (300, 9.0))
    ]
    assert found == [{1}, set(), {1}, set()]


def test_one_person_that_is_due_takes_all_persons_along(rules: Inclusion):
    first, second = thing("person", (0.0, 0.0), 0), thing("person", (9.0, 0.0), 0)
    car = thing("car", (20.0, 0.0), 0)
    assert rules.due({1: first, 3: car}, 0) == {1, 3}
    assert rules.due({1: thing("person", (5.0, 0.0), 100), 3: car}, 100 * MS) == set()
    assert rules.due({1: first, 2: second, 3: car}, 400 * MS) == {1, 2}, "the second is new"
    assert rules.due({1: first, 2: second, 3: car}, 800 * MS) == set()
    assert rules.due({1: first, 2: second, 3: car}, 900 * MS) == {1, 2}


def test_messages_have_the_bytes_of_their_objects_and_come_once_a_second():
    """Two parked cars: told when they are new, and a second later. Until then there is nothing to
    tell.
    """
    frames = [image("car1", ms) for ms in range(0, 3_000, 100)]
    told, _ = watch(made(CPM(), "car1"), frames, (seen("car", 20.0), seen("car", 30.0, 5.0)), TOPIC)
    assert all(one.size_bytes == 121 + 35 * len(one.objects) for one in told)
    assert (len(told[0].objects), told[0].size_bytes) == (0, 121)
    of_two = [one.header.stamp_ns // MS for one in told if len(one.objects) == 2]
    assert len(of_two) == 3 and {b - a for a, b in zip(of_two, of_two[1:], strict=False)} == {1_000}
    assert len(told) <= 5


@pytest.mark.parametrize(("every_ms", "most"), [(100, 30), (500, 6)])
def test_messages_keep_their_interval(every_ms: int, most: int):
    frames = [image("car1", ms) for ms in range(0, 3_000, 100)]
    method = CPM(every_ns=every_ms * MS, longest_ns=every_ms * MS)
    told, _ = watch(made(method, "car1"), frames, (), TOPIC)
    assert len(told) == most


def heard_from(*objects, origin: str = "car9", ms: int = 0) -> Told:
    return Told(Header(ms * MS, TOPIC, origin), 121 + 35 * len(objects), tuple(objects))


def test_of_what_several_cars_tell_the_newest_sighting_counts():
    heard = HeardObjects()
    heard.add(heard_from(thing("car", (10.0, 0.0), 100, "car8")), 110 * MS)
    heard.add(heard_from(thing("car", (11.0, 0.0), 200, "car9")), 210 * MS)
    heard.add(heard_from(thing("car", (12.0, 0.0), 150, "car7")), 220 * MS)
    (known,) = heard.objects(220 * MS).values()
    assert (known.location, known.seen_in.origin) == ((11.0, 0.0, 0.0), "car9")
    heard.add(heard_from(thing("person", (11.0, 0.0), 100)), 220 * MS)
    assert len(heard.objects(220 * MS)) == 2, "another class"


def test_objects_of_one_message_are_different_ones():
    """Two people walk side by side, and are heard of twice."""
    heard = HeardObjects()
    for ms in (100, 200):
        both = thing("person", (10.0, 0.0), ms), thing("person", (10.5, 0.0), ms)
        heard.add(heard_from(*both), ms * MS)
    assert len(heard.objects(200 * MS)) == 2


def test_what_was_heard_moves_on_and_is_forgotten():
    heard = HeardObjects()
    heard.add(heard_from(thing("car", (10.0, 0.0), 0, speed=(5.0, 0.0))), 100 * MS)
    for ms, east_m in ((100, 10.5), (1_000, 15.0), (1_600, 15.0)):
        (known,) = heard.objects(ms * MS).values()
        assert known.location == pytest.approx((east_m, 0.0, 0.0)), "at most a second ahead"
    assert not heard.objects(1_601 * MS)


def test_an_answer_has_what_the_car_saw_and_what_it_heard_but_for_itself():
    car = made(CPM(), "car1")
    behind, itself = thing("car", (-30.0, 0.0), 900), thing("car", (1.0, 0.0), 900)
    car.on_message(TOPIC, heard_from(behind, itself), 950 * MS, "car9")
    frames = [image("car1", ms) for ms in range(500, 1_500, 100)]
    _, answers = watch(car, frames, (seen("person", 12.0),), TOPIC)
    places = {item.label: item.location[0] for item in answers[-1].objects}
    assert places == pytest.approx({"person": 12.0, "car": -30.0})
    assert answers[-1].valid_ns == 1_450 * MS and answers[-1].is_fresh


def test_what_others_have_told_is_not_told_again_where_this_is_wanted():
    parked, frames = (seen("car", 20.0),), [image("car1", ms) for ms in range(0, 1_000, 100)]

    def told(**settings: int) -> int:
        car = made(CPM(**settings), "car1")
        car.on_message(TOPIC, heard_from(thing("car", (20.0, 0.0), 0)), 10 * MS, "car9")
        return sum(len(one.objects) for one in watch(car, frames, parked, TOPIC)[0])

    assert told() == 1
    assert told(unless_heard_ns=1_500 * MS) == 0


def test_with_more_cars_the_channel_is_busier_and_cars_know_more():
    """Thandavarayan et al.: more messages, and more of what is around is known."""
    methods = [{"name": "alone", "method": "local", "consumer": "tracker"}, "cpm:CPM"]
    found = {}
    for cars in (3, 12):
        setting = {"fleet.cars": cars, "perception.duration": "3 s", "methods": methods}
        metrics = gs.run("cpm.yaml", setting).metrics
        channels = metrics[metrics["component"].str.endswith(".channel")]
        whole = metrics[metrics["component"] == ""].set_index(["metric", "method"])["value"]
        busy = channels[channels["metric"] == "utilization"]["value"].mean()
        found[cars] = busy, whole["cpm:HiddenHeld", "CPM"]
        assert whole["object_recall", "CPM"] > whole["object_recall", "alone"] or cars < 12
    (few_busy, few_hidden), (busy, hidden) = found[3], found[12]
    assert busy > 2 * few_busy > 0
    assert hidden > few_hidden


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


def test_cars_without_a_medium_keep_it_to_themselves():
    from tests.examples.broadcasting import host

    assert CPM().on_car(host("car1")).broadcast == (TOPIC,)
    assert CPM().on_car(host("car1", can_broadcast=False)).broadcast == ()
    assert CPM().on_car(replace(host("car1"), gets_images=False)) is None
    assert cpm.HiddenHeld.unit == "objects"
