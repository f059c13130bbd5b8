"""A car's Genie that paces its looks: one message, exactly these effects."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from genie_sim.core.messages import (
    Detections,
    Effect,
    Forgotten,
    Header,
    Image,
    ObjectLookups,
    Publish,
)
from genie_sim.recommended.paced_genie import PacedGenie
from genie_sim.recommended.pacing import Pacer
from genie_sim.recommended.shared_tracks import SHARED, SharedTracks, SharingRules
from genie_sim.sim.monitor import LookEvent
from genie_sim.tracks.existence import ExistenceFilter
from genie_sim.tracks.track import Motion
from genie_sim.tracks.track_map import TrackMap
from tests.core.worlds import IMAGES, OBJECTS
from tests.make import S, answer, frame, seen

MS = S // 1000
CAR_AHEAD = seen(20.0, 0.5)


def paced_genie(
    every_ms: int = 0,
    is_shared: bool = False,
    edge: bool = True,
    **pace: int,
) -> PacedGenie:
    object_map = TrackMap(ExistenceFilter(p_min=0.5))
    settings = {"in_flight": 2, "stale_ns": 500 * MS, **pace}
    return PacedGenie(
        "car1/genie",
        (IMAGES,),
        (OBJECTS,),
        pacer=Pacer(every_ns=every_ms * MS, **settings) if edge else None,
        object_map=object_map,
        shared_tracks=SharedTracks(SharingRules(), object_map) if is_shared else None,
        make_answer=Detections,
    )


def topics(effects: list[Effect]) -> list[str]:
    return [effect.topic for effect in effects if isinstance(effect, Publish)]


def events(effects: list[Effect]) -> list[tuple[str, str]]:
    """What became of looks, without that frames were answered out of the map."""
    looks = [effect for effect in effects if isinstance(effect, LookEvent)]
    return [(look.way, look.outcome) for look in looks if look.way != "map"]


def served(effects: list[Effect]) -> Detections:
    """The answer for clients."""
    (found,) = [
        effect.message
        for effect in effects
        if isinstance(effect, Publish) and effect.topic == OBJECTS
    ]
    assert isinstance(found, Detections)
    return found


def on_frame(genie: PacedGenie, image: Image, now_ns: int | None = None) -> list[Effect]:
    return genie.on_message(IMAGES, image, image.header.stamp_ns if now_ns is None else now_ns)


def test_a_frame_is_answered_at_once_and_looked_at_by_both_detectors():
    genie = paced_genie()
    effects = on_frame(genie, frame(0.0))
    assert topics(effects) == [OBJECTS, IMAGES + "-remote", IMAGES + "-local"]
    assert events(effects) == [("edge", "sent")]
    empty = served(effects)
    assert empty.source == "map" and empty.objects == () and empty.valid_ns == 0


@pytest.mark.parametrize("suffix", ["-local", "-remote"])
def test_a_look_shows_in_the_answer_to_its_frame_and_to_the_next(suffix: str):
    genie = paced_genie()
    image = frame(0.0)
    on_frame(genie, image)
    effects = genie.on_message(OBJECTS + suffix, answer(image, CAR_AHEAD), 100 * MS)
    (lookups,) = [effect for effect in effects if isinstance(effect, ObjectLookups)]
    assert lookups.requests == 1
    assert [found.label for found in served(effects).objects] == ["car"]
    following = on_frame(genie, frame(0.2))
    assert [found.label for found in served(following).objects] == ["car"]
    assert served(following).source == "map"


def test_answers_of_both_detectors_to_one_frame_are_one_look():
    genie = paced_genie()
    image = frame(0.0)
    on_frame(genie, image)
    genie.on_message(OBJECTS + "-remote", answer(image, CAR_AHEAD), 50 * MS)
    (track,) = genie.object_map
    before = track.existence
    genie.on_message(OBJECTS + "-local", answer(image, CAR_AHEAD), 300 * MS)
    assert track.sightings == 1 and track.existence == before


def test_an_answer_of_the_own_detector_does_not_free_the_way_up():
    genie = paced_genie(in_flight=1)
    image = frame(0.0)
    on_frame(genie, image)
    genie.on_message(OBJECTS + "-local", answer(image), 50 * MS)
    assert topics(on_frame(genie, frame(0.1))) == [OBJECTS, IMAGES + "-local"]
    genie.on_message(OBJECTS + "-remote", answer(image), 150 * MS)
    assert IMAGES + "-remote" in topics(on_frame(genie, frame(0.2)))


def test_on_a_dead_link_every_frame_goes_to_the_own_detector():
    genie = paced_genie(in_flight=1)
    goes_up = []
    for tenth in range(40):
        effects = on_frame(genie, frame(tenth / 10))
        assert IMAGES + "-local" in topics(effects)
        goes_up.append(IMAGES + "-remote" in topics(effects))
    assert [tenth for tenth, up in enumerate(goes_up) if up] == [0, 10, 30], "1 s, then 2 s"


def test_a_deadline_gives_up_what_is_lost():
    genie = paced_genie()
    on_frame(genie, frame(0.0))
    assert genie.next_deadline_ns() == 1 * S
    assert events(genie.on_deadline(1 * S)) == [("edge", "timed_out")]
    assert genie.next_deadline_ns() is None


def test_an_overtaken_frame_is_reported_and_a_stale_answer_is_no_look():
    genie = paced_genie()
    first, second = frame(0.0), frame(0.1)
    on_frame(genie, first)
    on_frame(genie, second)
    late = genie.on_message(OBJECTS + "-remote", answer(second, CAR_AHEAD), 601 * MS)
    assert events(late) == [("edge", "overtaken"), ("edge", "stale")]
    assert topics(late) == [] and len(genie.object_map) == 0


def test_every_frame_goes_to_the_own_detector_and_some_go_up():
    genie = paced_genie(every_ms=200)
    effects = [on_frame(genie, frame(tenth / 10)) for tenth in range(3)]
    assert [IMAGES + "-remote" in topics(of_one) for of_one in effects] == [True, False, True]
    assert all(IMAGES + "-local" in topics(of_one) for of_one in effects)


def newest_look_ms(effects: list[Effect]) -> float | None:
    (answered,) = [
        effect for effect in effects if isinstance(effect, LookEvent) and effect.way == "map"
    ]
    return None if answered.looked_ns is None else answered.looked_ns / MS


def test_a_frame_knows_the_newest_look_that_has_come_of_its_view():
    """Neither an older look that comes later nor a stale one makes it newer."""
    genie = paced_genie()
    images = [frame(tenth / 10) for tenth in range(3)]
    assert [newest_look_ms(on_frame(genie, image)) for image in images] == [None] * 3
    genie.on_message(OBJECTS + "-local", answer(images[1]), 250 * MS)
    assert newest_look_ms(on_frame(genie, frame(0.3))) == 100
    genie.on_message(OBJECTS + "-remote", answer(images[0]), 350 * MS)
    assert newest_look_ms(on_frame(genie, frame(0.4))) == 100
    genie.on_message(OBJECTS + "-remote", answer(images[2]), 701 * MS)
    assert newest_look_ms(on_frame(genie, frame(0.71))) == 100


def test_a_car_without_an_edge_sends_nothing_up():
    genie = paced_genie(edge=False)
    effects = on_frame(genie, frame(0.0))
    assert topics(effects) == [OBJECTS, IMAGES + "-local"] and events(effects) == []
    assert genie.next_deadline_ns() is None and genie.on_deadline(9 * S) == []


def test_a_car_that_stands_sees_what_leaves():
    """The same picture for ten seconds; the object is gone after one, and the map notices."""
    genie = paced_genie()
    shown = []
    for tenth in range(100):
        image = frame(tenth / 10)
        shown.append(len(served(on_frame(genie, image)).objects))
        objects = [CAR_AHEAD] if tenth < 10 else []
        now_ns = image.header.stamp_ns + 50 * MS
        genie.on_message(OBJECTS + "-remote", answer(image, *objects), now_ns)
    assert shown[9] == 1 and shown[-1] == 0


def test_a_fault_takes_the_map():
    genie = paced_genie()
    image = frame(0.0)
    on_frame(genie, image)
    genie.on_message(OBJECTS + "-remote", answer(image, CAR_AHEAD), 50 * MS)
    (lost,) = genie.on_memory_lost()
    assert isinstance(lost, Forgotten) and len(lost.objects) == 1


def shared_car(at: tuple[float, float], seen_s: float = 0.0) -> Any:
    motion = Motion((0.0, 0.0), 0.5, 0.9, Header(round(seen_s * S), "02", "car2"))
    return replace(seen(*at, score=0.8), motion=motion)


def test_what_the_edge_tells_is_served_beside_the_own_tracks():
    genie = paced_genie(is_shared=True)
    on_frame(genie, frame(0.0))
    header = Header(0, "02", "car1")
    words = Detections(header, (shared_car((30.5, 5.0)),), SHARED, "edge1/genie", None, 50 * MS)
    assert genie.on_message(OBJECTS + "-remote", words, 60 * MS) == []
    (object_served,) = served(on_frame(genie, frame(0.1))).objects
    assert object_served.location == (30.5, 5.0, 0.0)
    assert len(genie.object_map) == 0, "shared tracks are not the map's"


def test_an_own_track_that_is_not_served_keeps_out_nothing_shared():
    """1.5 m beside: a track of the car's own that is served does, one below p_min does not."""
    for score, places in ((0.95, 1), (0.2, 1)):
        genie = paced_genie(is_shared=True)
        image = frame(0.0)
        on_frame(genie, image)
        own = seen(30.5, 5.0, score=score)
        genie.on_message(OBJECTS + "-local", answer(image, own), 40 * MS)
        assert len(genie.object_map) == 1
        words = Detections(
            Header(0, "02", "car1"), (shared_car((32.0, 5.0)),), SHARED, "e", None, 0
        )
        genie.on_message(OBJECTS + "-remote", words, 60 * MS)
        objects = served(on_frame(genie, frame(0.1))).objects
        assert len(objects) == places
        assert (objects[0].location[0] > 31) == (score == 0.2)


def test_without_sharing_words_are_ignored():
    genie = paced_genie(is_shared=False)
    words = Detections(Header(0, "02", "car1"), (shared_car((30.5, 5.0)),), SHARED, "e", None, 0)
    assert genie.on_message(OBJECTS + "-remote", words, 60 * MS) == []
    assert served(on_frame(genie, frame(0.1))).objects == ()
