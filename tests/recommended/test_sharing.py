"""A Genie beside an edge's detector: what it counts, broadcasts, and shares with cars."""

from __future__ import annotations

from dataclasses import replace

from genie_sim.core.messages import Detections, Effect, Forgotten, Look, Publish
from genie_sim.recommended.shared_tracks import SHARED, SharingRules
from genie_sim.recommended.sharing_genie import SharingGenie
from genie_sim.tracks.existence import ExistenceFilter
from genie_sim.tracks.track_map import TrackMap
from tests.core.worlds import IMAGES, OBJECTS
from tests.make import S, answer, frame, seen

REMOTE = OBJECTS + "-remote"
PARKED = seen(30.0, 2.0)


def sharing_genie() -> SharingGenie:
    return SharingGenie(
        "edge1/genie",
        (IMAGES,),
        (OBJECTS,),
        object_map=TrackMap(ExistenceFilter(p_min=0.5)),
        rules=SharingRules(),
        make_answer=Detections,
    )


def published(effects: list[Effect]) -> dict[str, Detections]:
    """The messages of these effects, by topic."""
    return {
        effect.topic: effect.message
        for effect in effects
        if isinstance(effect, Publish) and isinstance(effect.message, Detections)
    }


def answered(genie: SharingGenie, stamp_s: float, car: str, *objects) -> dict[str, Detections]:
    """A car's frame comes up, and the detector answers it 50 ms later."""
    image = frame(stamp_s, car=car)
    assert genie.on_message(IMAGES, image, image.header.stamp_ns) == []
    now_ns = image.header.stamp_ns + S // 20
    return published(genie.on_message(OBJECTS, answer(image, *objects), now_ns))


def test_a_look_is_broadcast_and_the_car_gets_nothing_of_its_own():
    messages = answered(sharing_genie(), 0.0, "car1", PARKED)
    assert messages.keys() == {REMOTE, OBJECTS}
    look = messages[REMOTE].look
    assert look is not None and look.detections == (PARKED,)
    words = messages[OBJECTS]
    assert words.source == SHARED and words.objects == ()


def test_another_car_gets_what_the_first_one_saw():
    genie = sharing_genie()
    answered(genie, 0.0, "car1", PARKED)
    words = answered(genie, 0.5, "car2")[OBJECTS]
    (track,) = words.objects
    assert track.location is not None and abs(track.location[0] - 30.0) < 0.5
    assert words.header.origin == "car2" and words.valid_ns == words.header.stamp_ns + S // 20


def test_a_neighbours_look_counts_as_one_of_its_car():
    genie = sharing_genie()
    image = frame(0.0, car="car9")
    look = Look(image.header, image.pose, image.horizontal_fov_rad, (PARKED,))
    message = replace(Detections(image.header, ()), look=look)
    effects = genie.on_message(REMOTE, message, S // 20)
    assert published(effects) == {}, "what neighbours broadcast is not broadcast again"
    assert len(answered(genie, 0.5, "car2")[OBJECTS].objects) == 1
    assert answered(genie, 0.6, "car9")[OBJECTS].objects == ()


def test_what_answers_and_words_take_on_the_way():
    """The detector's plain answer with three objects, and two that are shared. As a look with what
    is shared they would take 26 + 89 + 3 x 36 + 2 x 400 bytes together.
    """
    genie = sharing_genie()
    answered(genie, 0.0, "car1", PARKED, seen(40.0, -8.0))
    image = frame(0.5, car="car2")
    genie.on_message(IMAGES, image, S // 2)
    plain = answer(image, *(seen(20.0, y) for y in (-6.0, 0.0, 6.0)))
    words = published(genie.on_message(OBJECTS, plain, S))[OBJECTS]
    assert plain.size_bytes == 26 + 3 * 400
    assert len(words.objects) == 2 and words.size_bytes == 26 + 2 * 400
    look = Look(image.header, image.pose, image.horizontal_fov_rad, plain.objects)
    assert replace(words, look=look).size_bytes == 1023


def test_its_own_words_are_no_look():
    genie = sharing_genie()
    words = Detections(frame(0.0).header, (PARKED,), SHARED, "edge1/genie")
    assert genie.on_message(OBJECTS, words, S) == [] and len(genie.object_map) == 0


def test_a_fault_takes_the_map():
    genie = sharing_genie()
    assert genie.on_memory_lost() == []
    answered(genie, 0.0, "car1", PARKED)
    (lost,) = genie.on_memory_lost()
    assert isinstance(lost, Forgotten) and len(lost.objects) == 1
