"""AutoCast: what an object is worth, the schedule by hand, and more value for the same bytes."""

from __future__ import annotations

import random
from collections.abc import Callable

import autocast
import pytest
from autocast import TOPIC, AutoCast, Cast, Offer, points_bytes, relevance, schedule, value

import genie_sim as gs
from genie_sim.base.errors import UserError
from genie_sim.core.messages import CameraPose, Detection, Header
from tests.conformance.methods import MethodConformance
from tests.examples.broadcasting import made, thing, watch
from tests.make import MS, frame, seen


@pytest.mark.parametrize("method", ["autocast:AutoCast"])
class TestConformance(MethodConformance):
    pass


def cast(
    *sees: Detection,
    east_m: float = 0.0,
    speed: tuple[float, float] = (0.0, 0.0),
    by: str = "car9",
    ms: int = 0,
) -> Cast:
    """The beacon of a car, without objects."""
    pose = CameraPose(east_m, 0.0, 1.6, 0.0)
    numbered = {(by, number): item for number, item in enumerate(sees)}
    return Cast(Header(ms * MS, TOPIC, by), 121, {}, pose, speed, numbered)


@pytest.mark.parametrize(
    ("place", "speed", "of_car", "expected"),
    [
        ((0.0, 0.0), (0.0, 0.0), (0.0, 0.0), 1.0),
        ((25.0, 0.0), (0.0, 0.0), (0.0, 0.0), 0.5),
        ((50.0, 0.0), (0.0, 0.0), (0.0, 0.0), 0.0),
        ((80.0, 0.0), (0.0, 0.0), (0.0, 0.0), 0.0),
        ((25.0, 0.0), (0.0, 0.0), (10.0, 0.0), 1.0),  # the car is there in 2.5 s
        ((55.0, 0.0), (0.0, 0.0), (10.0, 0.0), 0.5),  # in 3 s it is 25 m away
        ((25.0, 0.0), (10.0, 0.0), (0.0, 0.0), 0.5),  # it goes away: now is nearest
        ((0.0, 25.0), (0.0, 0.0), (10.0, 0.0), 0.5),
    ],
)
def test_relevance_is_how_near_the_two_will_be(place, speed, of_car, expected: float):
    item = thing("car", place, 0, speed=speed)
    assert relevance(item, cast(speed=of_car)) == pytest.approx(expected)


def test_an_object_is_worth_nothing_to_those_who_see_it():
    item = thing("car", (25.0, 0.0), 0)
    blind, sighted = cast(), cast(thing("truck", (26.0, 0.0), 0), by="car8")
    assert value(item, [blind]) == pytest.approx(0.5)
    assert value(item, [blind, sighted]) == pytest.approx(0.5)
    assert value(item, [blind, cast(thing("person", (26.0, 0.0), 0))]) == pytest.approx(1.0)
    assert value(item, [sighted]) == value(item, []) == 0


def test_the_schedule_takes_the_most_value_for_its_bytes():
    small, dear, large, worthless = (
        Offer(("car1", number), worth, size_bytes)
        for number, (worth, size_bytes) in enumerate(((0.2, 100), (1.0, 600), (0.9, 900), (0, 1)))
    )
    assert schedule([worthless, large, dear, small], 1_600) == [small, dear, large]
    assert schedule([large, dear, small], 1_000) == [small, dear], "the large one does not fit"
    assert schedule([large, dear, small], 950) == [small, dear]
    assert schedule([large, dear, small], 650) == [small]
    assert schedule([large, dear, small], 0) == []


def test_near_and_large_objects_take_more_bytes():
    """At 20 m a car of 2 m x 1.5 m is 32 x 11 points, each 6 bytes."""
    assert points_bytes(seen(0.0), 20.0) == 32 * 11 * 6
    assert points_bytes(seen(0.0), 40.0) < points_bytes(seen(0.0), 20.0) / 3
    assert points_bytes(seen(0.0, label="person"), 20.0) < points_bytes(seen(0.0), 20.0)


def test_a_car_sends_what_another_does_not_see_within_its_budget():
    """The other sees one of two parked cars. It then sees both, and later is not heard any more."""
    car = made(AutoCast(budget_bytes=4_000), "car1")
    first, second = thing("car", (20.0, 0.0), 0), thing("car", (30.0, 5.0), 0)

    def sent(begin_ms: int, *of_other: Detection) -> set[float]:
        if of_other:
            car.on_message(TOPIC, cast(*of_other, ms=begin_ms), begin_ms * MS, "car9")
        frames = [frame(ms / 1000) for ms in range(begin_ms, begin_ms + 500, 100)]
        objects = seen(20.0), seen(30.0, 5.0)
        casts, _ = watch(car, frames, objects, TOPIC)
        assert len(casts) == 5, "a beacon every interval"
        last = casts[-1]
        assert last.size_bytes >= 121 + 12 * len(last.sees)
        return {round(item.location[0]) for item in last.objects.values()}

    assert sent(0) == set(), "nobody is there"
    assert sent(500, first) == {30}
    assert sent(1_000, first, second) == set()
    assert sent(1_500, thing("person", (9.0, 0.0), 0)) == {20, 30}
    assert sent(2_500) == set(), "it was heard too long ago"


def test_a_budget_keeps_objects_back():
    car = made(AutoCast(budget_bytes=1_100), "car1")
    car.on_message(TOPIC, cast(), 0, "car9")
    frames = [frame(ms / 1000, (0.0, 0.0)) for ms in range(0, 800, 100)]
    casts, _ = watch(car, frames, (seen(20.0), seen(30.0, 5.0)), TOPIC)
    (item,) = casts[-1].objects.values()
    assert round(item.location[0]) == 30, "the near one has 2112 bytes"
    size_bytes = points_bytes(item, 30.4)
    assert casts[-1].size_bytes == 121 + 12 * 2 + size_bytes


def test_a_random_order_does_not_ask_who_needs_an_object():
    """Nobody is there, and there is room for one of two."""
    car = made(AutoCast(budget_bytes=1_100, order="random"), "car1")
    frames = [frame(ms / 1000) for ms in range(0, 3_000, 100)]
    casts, _ = watch(car, frames, (seen(30.0), seen(30.0, 5.0)), TOPIC)
    sent = [tuple(one.objects) for one in casts if len(one.sees) == 2]
    assert all(len(keys) == 1 for keys in sent) and len(set(sent)) == 2


def test_what_another_has_just_sent_is_left_out():
    """Both see what a third does not."""
    car, parked = made(AutoCast(), "car1"), (seen(30.0),)
    car.on_message(TOPIC, cast(), 0, "car9")
    watch(car, [frame(ms / 1000) for ms in range(0, 800, 100)], parked, TOPIC)
    other = cast(thing("car", (30.0, 0.0), 750, "car8"), by="car8", ms=790)
    told = Cast(other.header, 121, other.sees, other.pose, other.velocity_mps, other.sees)
    car.on_message(TOPIC, told, 790 * MS, "car8")
    (now,), _ = watch(car, [frame(0.8)], parked, TOPIC)
    (later,), _ = watch(car, [frame(0.98)], parked, TOPIC)
    assert (len(now.objects), len(later.objects)) == (0, 1)


def test_a_car_tells_how_fast_it_is():
    frames = [frame(ms / 1000, at=(ms / 100, 0.0)) for ms in (0, 100, 200)]
    casts, _ = watch(made(AutoCast(), "car1"), frames, (), TOPIC)
    assert [one.velocity_mps for one in casts] == [(0.0, 0.0), (10.0, 0.0), (10.0, 0.0)]


@pytest.mark.slow
@pytest.mark.nightly
def test_the_order_of_value_sends_more_value_in_fewer_bytes(monkeypatch: pytest.MonkeyPatch):
    """As published, against their "agnostic" schedule: of what the cars of a town could send."""
    offered: list[list[Offer]] = []

    def noted(offers: list[Offer], budget_bytes: int) -> list[Offer]:
        offered.append(offers)
        return schedule(offers, budget_bytes)

    monkeypatch.setattr(autocast, "schedule", noted)
    methods = ["autocast:AutoCast"]
    gs.run("autocast.yaml", {"perception.duration": "2 s", "methods": methods, "metrics": []})
    number = random.Random(1)

    def sent(order: Callable[[Offer], float]) -> tuple[float, int]:
        """The value and the bytes of what is sent in an order, in all intervals."""
        worth, size_bytes = 0.0, 0
        for offers in offered:
            ordered = [offer._replace(value=order(offer)) for offer in offers]
            keys = {offer.key for offer in schedule(ordered, 3_000)}
            worth += sum(offer.value for offer in offers if offer.key in keys)
            size_bytes += sum(offer.size_bytes for offer in offers if offer.key in keys)
        return worth, size_bytes

    worth, size_bytes = sent(lambda offer: offer.value)
    random_worth, random_bytes = sent(lambda offer: number.random() * offer.size_bytes)
    assert worth > random_worth > 0
    assert 0 < size_bytes < random_bytes


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ({"order": "best"}, r"methods\[0\].order: unknown order 'best'"),
        ({"budget": "-1 B"}, r"methods\[0\].budget: must not be negative"),
        ({"every": "0 s"}, r"methods\[0\].every: must be"),
        ({"budgt": "1 kB"}, r"unknown parameter of autocast:AutoCast 'budgt' \(did you mean"),
    ],
)
def test_a_wrong_setting_of_autocast_is_one_line(setting: dict[str, str], message: str):
    with pytest.raises(UserError, match=message) as error:
        gs.run("autocast.yaml", {"methods": [{"method": "autocast:AutoCast", **setting}]})
    assert "\n" not in str(error.value)
