"""What Genies believe of others: each defence by hand, and how it is asked."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from genie_sim.core.defences import (
    Corroborate,
    Defence,
    FreeSpace,
    Guard,
    Guarded,
    OwnEvidence,
    OwnLooks,
    Reputation,
)
from genie_sim.core.freshness.existence import MeasuredExistence
from genie_sim.core.messages import SHARED, Detections, Effect, Motion, Publish
from genie_sim.core.recommended.told import ToldTracks, tracks_to_tell
from genie_sim.core.recommended.track_map import TrackMap
from genie_sim.core.rules import ObjectMapRules, ToldRules
from genie_sim.core.sharing import SharingGenie
from tests.core.looks import after, car, look, tracks
from tests.core.told import HERE, told, track
from tests.core.worlds import IMAGES, OBJECTS, S, answer, frame

NOTHING = OwnEvidence(misses=0, finds=0, tracked=False)
REMOTE = OBJECTS + "-remote"


def from_(*origins: str, signed: bool = False) -> Any:
    item = told((20.0, 0.0))
    assert item.motion is not None
    return replace(item, motion=item.motion._replace(origins=origins, signed=signed))


def test_corroboration_counts_cars_and_what_the_own_map_has():
    defence = Corroborate(n=2)
    assert not defence.believes(from_("car2"), NOTHING, 0)
    assert defence.believes(from_("car2", "car3"), NOTHING, 0)
    assert not defence.believes(from_("car2", "car2"), NOTHING, 0), "one car is one car"
    assert defence.believes(from_("car2"), NOTHING._replace(tracked=True), 0)
    assert not Corroborate(n=3).believes(from_("car2", "car3"), NOTHING, 0)
    assert defence.admits(car(), NOTHING, 0)


def test_free_space_needs_looks_that_missed_it_and_none_that_found_it():
    defence = FreeSpace(misses=2)
    for ask, item in ((defence.believes, from_("car2")), (defence.admits, car())):
        assert ask(item, NOTHING._replace(misses=1), 0)
        assert not ask(item, NOTHING._replace(misses=2), 0)
        assert ask(item, NOTHING._replace(misses=2, finds=1), 0)


def test_own_looks_find_and_miss_within_a_second():
    looks = OwnLooks()
    looks.add(look(1.0, car(20.0)))
    looks.add(look(1.5))

    def evidence(east_m: float, north_m: float = 0.0, now_s: float = 1.6) -> tuple[int, int]:
        asked = {"now_ns": round(now_s * S), "tracked": False}
        found = looks.evidence("truck", east_m, north_m, **asked)
        return found.misses, found.finds

    assert evidence(20.0) == (1, 1)
    assert evidence(10.0) == (2, 0), "neither look has it, both should"
    assert evidence(30.0) == (0, 0), "too far to be sure of finding it"
    assert evidence(-10.0) == (0, 0), "behind the camera"
    assert evidence(20.0, now_s=2.2) == (1, 0), "the first look is too old"
    looks.add(look(2.6))
    assert evidence(10.0, now_s=2.6) == (1, 0)


def test_trust_is_that_of_the_beta_system():
    """alpha and beta by hand: car2's track is found once and missed twice, with forgetting 0.5."""
    defence = Reputation(min_trust=0.3, forgetting=0.5)
    assert defence.trust("car2") == 0.5
    seen_by_two = track((20.0, 0.0), car2=10.0)
    defence.seen(seen_by_two, look(10.2, car="car3").header)
    assert defence.trust("car2") == pytest.approx(2 / 3)
    defence.unseen(seen_by_two, 20.0, look(10.3, car="car3").header)
    defence.unseen(seen_by_two, 20.0, look(10.4, car="car3").header)
    alpha, beta = 0.25, 1.5
    assert defence.trust("car2") == pytest.approx((alpha + 1) / (alpha + beta + 2))
    assert defence.trust("car3") == 0.5


def test_a_car_is_not_judged_by_itself_nor_by_old_or_far_looks():
    defence, seen_by_two = Reputation(), track((20.0, 0.0), car2=10.0)
    defence.unseen(seen_by_two, 20.0, look(10.1, car="car2").header)
    defence.unseen(seen_by_two, 20.0, look(10.6, car="car3").header)
    defence.unseen(seen_by_two, 26.0, look(10.1, car="car3").header)
    assert defence.trust("car2") == 0.5


@pytest.mark.parametrize("kind", [Reputation, Guarded])
def test_who_has_lost_trust_is_not_heard(kind: type[Reputation]):
    defence, by_two = kind(min_trust=0.3), track((20.0, 0.0), car2=10.0)
    assert defence.tells(by_two, "car1", 10 * S) and defence.counts(look(10.0, car="car2"))
    for _ in range(3):
        defence.unseen(by_two, 20.0, look(10.1, car="car3").header)
    assert not defence.tells(by_two, "car1", 10 * S) and not defence.counts(look(10.0, car="car2"))
    assert defence.tells(track((20.0, 0.0), car2=10.0, car3=9.0), "car1", 10 * S)
    assert not defence.tells(track((20.0, 0.0), car2=10.0, car1=9.0), "car1", 10 * S)


def test_guarded_asks_for_other_cars_and_for_free_space():
    defence = Guarded()
    both = from_("car2", "car3")
    assert defence.believes(both, NOTHING, 0) and not defence.believes(from_("car2"), NOTHING, 0)
    assert not defence.believes(both, NOTHING._replace(misses=2), 0)
    assert not defence.admits(car(), NOTHING._replace(misses=2), 0)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Corroborate(n=0), "n: must be at least 1, but is 0"),
        (lambda: FreeSpace(misses=0), "misses: must be at least 1, but is 0"),
        (lambda: Reputation(min_trust=1.2), "min_trust: must be a number from 0 to 1, not 1.2"),
        (lambda: Guarded(forgetting=-1), "forgetting: must be a number from 0 to 1, not -1"),
    ],
)
def test_settings_out_of_range_are_refused(make: Any, message: str):
    with pytest.raises(ValueError, match=message):
        make()


class Noting(Defence):
    """Counts no look of car4, and notes what others find and miss."""

    def __init__(self) -> None:
        self.noted: list[tuple[str, str]] = []

    def counts(self, look: Any) -> bool:
        return look.header.origin != "car4"

    def seen(self, track: Any, header: Any) -> None:
        self.noted.append(("seen", header.origin))

    def unseen(self, track: Any, range_m: float, header: Any) -> None:
        self.noted.append(("unseen", header.origin))


def test_a_map_asks_its_defence_which_looks_count():
    defence = Noting()
    policy = MeasuredExistence(measured=False)
    map_ = TrackMap(ObjectMapRules(), policy, defence=defence)
    after(map_, look(0.0, car(), car="car1"), look(0.1, car(), car="car2"), look(0.2, car="car3"))
    assert defence.noted == [("seen", "car2"), ("unseen", "car3")]
    after(map_, look(0.3, car(), car(10.0, 5.0), car="car4"))
    assert len(map_) == 1 and defence.noted[2:] == []
    assert len(after(tracks(), look(0.3, car(), car(10.0, 5.0), car="car4"))) == 2


def test_the_origins_of_a_told_track_travel_with_it_and_cost_bytes():
    def words(**settings: Any) -> Detections:
        of = track((20.0, 0.0), car2=9.5, car3=9.0, car1=9.8, car4=7.9)
        rules = {"car": "car1", "pose": HERE, "now_ns": 10 * S, "rules": ToldRules()}
        items = tuple(tracks_to_tell([of], lambda *_: 0.9, **rules, **settings))
        return Detections(items[0].motion.seen, items, SHARED)

    plain, with_origins = words(), words(defence=Defence())
    signed = words(defence=Defence(), signed=True)
    assert plain.objects[0].motion.origins == ()
    assert with_origins.objects[0].motion.origins == ("car2", "car3"), "lately, and not car1 itself"
    assert with_origins.size_bytes == plain.size_bytes + 2 * 8
    assert signed.objects[0].motion.signed
    assert signed.size_bytes == plain.size_bytes + 2 * (8 + 64 + 36)


def test_a_car_that_wants_signatures_believes_nothing_without():
    for signed, served in ((False, 0), (True, 1)):
        guard = Guard(Defence(), lambda *_: False, signed=True)
        told_tracks = ToldTracks(ToldRules(), lambda *_: False, guard)
        told_tracks.replace([from_("car2", signed=signed)], 10 * S)
        assert len(told_tracks.served((), HERE, 10 * S)) == served


def test_what_the_own_detector_does_not_see_is_not_taken_from_the_edge():
    guard = Guard(FreeSpace(misses=2), lambda *_: False, signed=False)
    near, far = car(15.0), car(35.0)
    assert guard.admitted((near, far), S) == (near, far)
    guard.looked(look(0.7))
    guard.looked(look(0.9))
    assert guard.admitted((near, far), S) == (far,)


def published(effects: list[Effect], topic: str) -> list[Any]:
    return [
        effect.message
        for effect in effects
        if isinstance(effect, Publish) and effect.topic == topic
    ]


def signing_edge() -> SharingGenie:
    return SharingGenie(
        "edge1/genie",
        (IMAGES,),
        (OBJECTS,),
        object_map=TrackMap(ObjectMapRules(), MeasuredExistence(p_min=0.5), shares="look"),
        told=ToldRules(),
        make_answer=Detections,
        signed=True,
    )


def test_an_edge_that_needs_signatures_takes_signed_looks_alone():
    genie, image = signing_edge(), frame(0.1)
    genie.on_message(IMAGES, image, S // 10)
    effects = genie.on_message(OBJECTS, answer(image, car(30.0, 2.0)), S // 5)
    assert len(genie.object_map) == 0 and published(effects, REMOTE) == []
    (words,) = published(effects, OBJECTS)
    assert words.source == SHARED and words.objects == ()

    signed = look(0.1, car(30.0, 2.0))._replace(signed=True)
    later = frame(0.3).with_looks((signed,))
    assert later.size_bytes == frame(0.3).size_bytes + 89 + 36 + 8 + 64
    (passed_on,) = published(genie.on_message(IMAGES, later, 3 * S // 10), REMOTE)
    assert passed_on.look == signed and len(genie.object_map) == 1

    other = Detections(signed.header, (), look=look(0.4, car(10.0, 9.0), car="car3"))
    genie.on_message(REMOTE, other, S // 2)
    assert len(genie.object_map) == 1, "a neighbour's look without a signature"
    genie.on_message(REMOTE, replace(other, look=other.look._replace(signed=True)), S // 2)
    assert len(genie.object_map) == 2


def test_a_motion_without_origins_takes_no_bytes_more():
    assert Motion((0.0, 0.0), 0.5, 0.9, look(0.0).header).proof_bytes == 0
