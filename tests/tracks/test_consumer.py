"""What consumers make of answers: which objects they believe to be around them, and where."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from genie_sim.base.settings import from_plain
from genie_sim.core.messages import Detection, Detections
from genie_sim.judge.held import shown_objects
from genie_sim.judge.objects import LabelCodes
from genie_sim.tracks.consumer import ConsumerRules, Newest, Tracker
from genie_sim.tracks.coverage import Viewer
from genie_sim.tracks.track import Motion
from tests.make import MS, S, frame, seen
from tests.tracks.looks import FOV, after, look, tracks


def held(consumer, t_s: float) -> list[tuple[str, float]]:
    now_ns = round(t_s * S)
    labels = LabelCodes()
    items = shown_objects([(now_ns, consumer.shown(now_ns))], labels)
    names = list(labels.codes)
    return [
        (names[code], round(east_m, 1))
        for code, east_m in zip(items.label, items.east_m, strict=True)
    ]


def tell(consumer, t_s: float, *found: Detection, source="detector", camera="02") -> None:
    taken = frame(t_s, camera=camera)
    consumer.on_frame(taken)
    consumer.on_answer(Detections(taken.header, found, source), round(t_s * S) + 30 * MS)


def test_newest_holds_the_newest_answer_of_each_stream_where_it_was():
    consumer = Newest()
    tell(consumer, 0.0, seen(10.0))
    tell(consumer, 0.0, seen(10.5), seen(30.0), camera="03")
    assert held(consumer, 1.0) == [("car", 10.0), ("car", 30.0)], "two within a metre are one"
    tell(consumer, 0.1, seen(11.5))
    consumer.on_answer(Detections(frame(0.05).header, (seen(99.0),)), S)
    assert held(consumer, 1.0) == [("car", 11.5), ("car", 10.5), ("car", 30.0)]


def test_an_object_that_is_held_already_hides_no_other():
    """The second is the first, and the third is near the second alone."""
    consumer = Newest()
    for camera, east_m in (("02", 10.0), ("03", 10.8), ("04", 11.6)):
        tell(consumer, 0.0, seen(east_m), camera=camera)
    assert held(consumer, 0.1) == [("car", 10.0), ("car", 11.6)]


def test_objects_of_one_answer_are_different_ones_however_near():
    """Two people side by side; in the answers of two cameras they would be one."""
    pair = seen(10.0, label="person"), seen(10.0, 0.6, label="person")
    together, apart = Newest(), Newest()
    tell(together, 0.0, *pair)
    assert held(together, 0.1) == [("person", 10.0), ("person", 10.0)]
    tell(apart, 0.0, pair[0])
    tell(apart, 0.0, pair[1], camera="03")
    assert held(apart, 0.1) == [("person", 10.0)]


def test_newest_predicts_objects_with_a_velocity():
    consumer = Newest()
    tell(consumer, 0.0, seen(33.0), camera="03")
    map_ = after(tracks(), *(look(0.1 * i, seen(10.0 + i)) for i in range(11)))
    objects = map_.in_view(Viewer(frame(1.0).header, frame(1.0).pose, FOV), S)
    consumer.on_frame(frame(1.0))
    consumer.on_answer(Detections(frame(1.0).header, tuple(objects), "map").with_look(None, S), S)
    assert held(consumer, 1.0) == [("car", pytest.approx(20.0, abs=0.1))]
    assert held(consumer, 1.3) == [("car", pytest.approx(23.0, abs=0.2))]
    assert held(consumer, 9.0) == [("car", pytest.approx(30.0, abs=0.3))], "for a second at most"


def test_newest_predicts_neither_backwards_nor_what_has_no_velocity():
    moving = replace(seen(20.0), motion=Motion((10.0, 0.0), 0.5, 0.9, frame(1.0).header))
    parked = seen(5.0)
    consumer = Newest()
    consumer.on_frame(frame(1.0))
    answer = Detections(frame(1.0).header, (moving, parked), "map")
    consumer.on_answer(answer.with_look(None, S), S)
    assert held(consumer, 0.5) == [("car", 20.0), ("car", 5.0)], "not before the answer's instant"
    assert held(consumer, 1.5) == [("car", 25.0), ("car", 5.0)]


def test_a_tracker_predicts_between_answers_and_takes_caches_for_nothing():
    consumer = Tracker()
    for i in range(11):
        tell(consumer, 0.1 * i, seen(10.0 + i))
    tell(consumer, 1.05, seen(30.0, 5.0), source="cache")
    assert held(consumer, 1.2) == [("car", pytest.approx(22.0, abs=0.2))]


@pytest.mark.parametrize(("off_axis_deg", "remaining"), [(40.0, False), (50.0, True)])
def test_an_answer_replaces_older_ones_only_within_its_field_of_view(off_axis_deg, remaining):
    """The field of view is 90 degrees wide, 45 to either side."""
    off_axis_rad = math.radians(off_axis_deg)
    place = (20.0 * math.cos(off_axis_rad), 20.0 * math.sin(off_axis_rad))
    consumer = Newest()
    tell(consumer, 0.0, seen(*place), camera="03")
    consumer.on_frame(frame(1.0))
    consumer.on_answer(Detections(frame(1.0).header, (), "map").with_look(None, S), S)
    assert bool(held(consumer, 1.0)) is remaining


def test_of_many_frames_the_newest_are_remembered():
    consumer = Newest()
    tell(consumer, 0.0, seen(20.0), camera="03")
    frames = [frame(0.01 * i) for i in range(1, 301)]
    for taken in frames:
        consumer.on_frame(taken)
    answer = Detections(frames[-1].header, (), "map").with_look(None, 3 * S)
    consumer.on_answer(answer, 3 * S)
    assert held(consumer, 3.0) == [], "nothing is in its field of view"


def test_of_two_answers_for_one_instant_the_later_one_counts():
    """A cached answer to a frame, then the detector's to the same."""
    consumer = Newest()
    tell(consumer, 0.0, seen(10.0), source="cache")
    tell(consumer, 0.0, seen(30.0))
    assert held(consumer, 0.1) == [("car", 30.0)]


def test_a_tracker_takes_objects_out_of_a_map_for_no_look():
    consumer = Tracker()
    found, added = seen(10.0), Detection("car", 0.9, None, (10.0, 9.0, 0.0), 0.9, "map")
    for i in range(5):
        tell(consumer, 0.1 * i, found, added)
    assert held(consumer, 0.4) == [("car", 10.0)]


def test_a_tracker_forgets_what_moves_a_second_after_it_was_seen_last():
    consumer = Tracker()
    for i in range(21):
        tell(consumer, 0.1 * i, seen(10.0 + i))
    assert held(consumer, 2.95) == [("car", pytest.approx(39.5, abs=0.3))]
    assert held(consumer, 3.05) == []


def test_a_tracker_holds_what_exists_with_at_least_p_min():
    """Found once with a score of .5: it exists with that probability."""
    for p_min, places in ((0.45, [("car", 10.0)]), (0.55, [])):
        consumer = ConsumerRules("tracker", p_min=p_min).new()
        tell(consumer, 0.0, seen(10.0, score=0.5))
        assert held(consumer, 0.05) == places


def test_to_a_tracker_looks_at_nearly_one_instant_count_less():
    """Of two looks 25 ms apart, the second counts a quarter with a tau of 100 ms: the odds grow by
    2.25 to the power of a quarter.
    """
    for tau_ns, p_min in ((0, 0.692), (100 * MS, 0.5505)):
        for below, count in ((0.01, 1), (-0.01, 0)):
            consumer = ConsumerRules("tracker", p_min=p_min - below, tau_ns=tau_ns).new()
            tell(consumer, 0.0, seen(10.0, score=0.5))
            tell(consumer, 0.025, seen(10.0, score=0.5), camera="03")
            assert len(held(consumer, 0.03)) == count, (tau_ns, p_min - below)


def test_what_only_a_tracker_has_is_refused_without():
    with pytest.raises(ValueError, match=r"p_min: has no effect with consumer 'newest'"):
        ConsumerRules(p_min=0.5)
    with pytest.raises(ValueError, match=r"tau: has no effect with consumer 'newest'"):
        ConsumerRules(tau_ns=1)


def test_a_consumer_is_written_as_short_as_it_can_be():
    assert ConsumerRules("tracker").shorten() == "tracker"
    written = ConsumerRules("tracker", tau_ns=100 * MS).shorten()
    assert written == {"name": "tracker", "p_min": 0.8, "tau": "100 ms"}
    assert from_plain(ConsumerRules, written) == ConsumerRules("tracker", tau_ns=100 * MS)
