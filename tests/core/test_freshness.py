"""Freshness policies against sequences worked by hand, and existence against the textbook's
recursion.
"""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from genie_sim.base.settings import SettingError, from_plain
from genie_sim.core.freshness.existence import Existence, MeasuredExistence
from genie_sim.core.freshness.laws import ASSUMED, DetectorLaws
from genie_sim.core.freshness.track import Tracks
from genie_sim.core.freshness.ttl import ClassTtl, Corroborated
from genie_sim.core.maps import Viewer
from genie_sim.core.messages import (
    LOOK_BYTES,
    LOOK_DETECTION_BYTES,
    CameraPose,
    Detection,
    Detections,
    Header,
)
from genie_sim.core.recommended.track_map import TrackMap
from genie_sim.core.rules import GenieRules, ObjectMapRules
from genie_sim.core.view import View
from tests.core.looks import FOV, MS, after, car, look, there, tracks
from tests.core.worlds import IMAGES, OBJECTS, S, answer, frame, genie, object_map, seen

FROM_NODE = f"{OBJECTS}-local"

# Sequences


def test_a_parked_car_that_was_passed_stays_and_goes_when_it_has_left():
    """Seen for 2 s; then the camera looks away for a minute; then it looks at the empty place."""
    map_ = after(tracks(), *(look(0.1 * i, car()) for i in range(21)))
    after(map_, *(look(2.1 + i, heading_deg=180.0) for i in range(60)))
    assert there(map_, 63) == [("car", 20.0, 0.0)], "nobody looked there, and parked cars stay"
    after(map_, look(64))
    assert there(map_, 64) != [], "what was seen so often is not gone because it was missed once"
    after(map_, *(look(64.1 + 0.1 * i) for i in range(3)))
    assert there(map_, 64.4) == []
    after(map_, *(look(64.4 + 0.1 * i) for i in range(3)))
    assert len(map_) == 0


def test_a_moving_van_is_served_where_it_is_and_leaves_no_trail():
    """10 m/s away from a camera that sees it every 100 ms: 2 s later one object, and 50 ms on, half
    a metre further.
    """
    map_ = after(
        tracks(),
        *(look(0.1 * i, car(10.0 + i, label="truck" if i % 3 else "car")) for i in range(21)),
    )
    ((_, east_m, north_m),) = there(map_, 2.05)
    assert east_m == pytest.approx(30.5, abs=0.15) and north_m == 0.0
    (held,) = map_
    assert held.velocity_mps[0] == pytest.approx(10.0, abs=0.3), "metres per second, away"
    assert there(map_, 3.05) == [] and len(map_) == 0, "nobody saw it for a second"


def test_the_papers_map_keeps_a_trail_of_the_same_van():
    objects = object_map()
    for i in range(10):
        objects.sight(car(10.0 + 1.1 * i))
    assert len(objects) == 10


def test_an_occluded_car_is_not_missed():
    """A bus drives in front of it: what it hides is no evidence. Beside it, it would be."""

    def rest(*detections):
        map_ = after(tracks(), *(look(0.1 * i, car(25.0)) for i in range(12)))
        return there(after(map_, *(look(1.2 + 0.1 * i, *detections) for i in range(4))), 1.5)

    assert ("car", 25.0, 0.0) in rest(seen("bus", 0.9, at=(12.0, 0.3)))
    assert ("car", 25.0, 0.0) not in rest(seen("bus", 0.9, at=(12.0, 6.0)))


def test_a_detector_that_misses_twice_does_not_lose_the_object():
    """Not served after two misses by textbook independence, but still tracked: the next sighting
    brings it back.
    """
    map_ = after(tracks(), *(look(0.1 * i, car()) for i in range(12)))
    (held,) = map_
    assert held.existence > 0.99
    after(map_, look(1.2))
    assert there(map_, 1.2) == [("car", 20.0, 0.0)]
    after(map_, look(1.3))
    assert len(map_) == 1
    after(map_, look(1.4, car()))
    assert there(map_, 1.4) == [("car", 20.0, 0.0)] and list(map_) == [held]


def test_a_late_look_is_associated_by_predicting_back_and_moves_nothing():
    map_ = after(tracks(), *(look(0.1 * i, car(10.0 + i)) for i in range(11)))
    (held,) = map_
    place, sightings = held.place(S), held.sightings
    map_.count(look(0.55, car(15.5)), S)
    assert list(map_) == [held] and held.sightings == sightings + 1, (
        "it is the same car, half a second ago"
    )
    assert held.place(S) == place and held.seen.stamp_ns == S
    existence = held.existence
    map_.count(look(0.65), S)
    assert held.existence == existence, "a late look that does not show it says nothing about now"


def test_the_same_look_by_two_ways_counts_once():
    one = look(0, car(score=0.5))
    map_ = after(tracks(), one)
    (held,) = map_
    before = held.existence
    again, boosted, _ = map_.count(one, 40 * MS)
    assert again == [held] and boosted == {}
    assert (held.existence, held.sightings) == (before, 1)
    map_.count(one._replace(header=one.header._replace(frame_id="03")), 40 * MS)
    assert held.existence > before and held.sightings == 2, "another camera's look is another look"


def test_two_who_walk_side_by_side_stay_two():
    walkers = [
        look(0.1 * i, *(seen("person", 0.9, at=(15.0 + 0.1 * i, n)) for n in (0.0, 1.5)))
        for i in range(10)
    ]
    assert len(after(tracks(), *walkers)) == 2


def test_two_detections_never_show_one_track():
    """The second is nearer to the first's track than to its own, which is taken."""

    def walker(north_m: float) -> Detection:
        return seen("person", 0.9, at=(10.0, north_m))

    map_ = after(tracks(), look(0, walker(0.0), walker(2.4)), look(0.1, walker(0.2), walker(1.1)))
    assert [one.sightings for one in map_] == [2, 2]


# Existence


def textbook(p: float, dt_s: float, survival: float, found: float, ratio: float | None) -> float:
    """Musicki, Evans and Stankovic 1994, one target, one gate, written from the paper: predict with
    the survival, then p' = (1 - d) p / (1 - d p), with d = found if nothing was detected, else d =
    1 - ratio.
    """
    p *= survival**dt_s
    d = found if ratio is None else 1.0 - ratio
    return (1.0 - d) * p / (1.0 - d * p)


@given(
    st.lists(st.one_of(st.none(), st.floats(0.3, 1.0)), min_size=1, max_size=12),
    st.floats(4.0, 39.0),
)
def test_existence_follows_the_textbooks_recursion(scores, range_m):
    laws = DetectorLaws((0.9,) * 7, (0.8,) * 7, ASSUMED.ratios, ASSUMED.firsts)
    policy = Existence(measured=False)
    policy.laws = laws
    map_ = after(tracks(policy), look(0, car(range_m, score=0.6)))
    (held,) = map_
    p = 0.6
    for i, score in enumerate(scores, start=1):
        survival = 0.9998 if held.parked else 0.97
        header = Header(i * 100 * MS, "02", "car1")
        if score is None:
            policy.unseen(held, range_m, header)
        else:
            held.sightings += 1
            policy.seen(held, score, header)
        p = textbook(p, 0.1, survival, 0.9, None if score is None else 0.9 * score / 0.2)
        assert held.existence == pytest.approx(p, rel=1e-9)
        assert 0.0 <= held.existence <= 1.0


def test_autoware_s_rule_halves_in_half_a_second_and_ignores_misses():
    policy = Existence("autoware")
    (held,) = after(tracks(policy), look(0, car(score=0.8)))
    assert policy.existence(held, S // 2) == pytest.approx(0.4)
    policy.unseen(held, 20.0, Header(S, "02", "car1"))
    assert held.existence == 0.8
    held.sightings = 2
    policy.seen(held, 0.5, Header(S // 2, "02", "car1"))
    assert held.existence == pytest.approx(0.4 * 0.45 / (0.4 * 0.45 + 0.6 * 0.2))


@pytest.mark.parametrize(
    ("range_m", "found"), [(10.0, 0.9), (20.0, 0.9), (30.0, 0.6), (40.0, 0.3), (60.0, 0.2)]
)
def test_the_assumed_chance_to_find_falls_with_the_range(range_m, found):
    assert ASSUMED.found(True, range_m) == pytest.approx(found)


# What a look sees


@pytest.mark.parametrize(
    ("at", "seen_there"),
    [
        ((20, 0), True),
        ((3, 0), False),
        ((41, 0), False),
        ((-20, 0), False),
        ((20, 18), True),
        ((20, 20), False),
    ],
)
def test_a_look_tells_of_its_field_of_view_alone(at, seen_there):
    assert (View(look(0)).range_m(*at) is not None) is seen_there


@pytest.mark.parametrize(
    ("east_m", "hidden"), [(19.0, False), (21.5, False), (22.5, True), (35.0, True)]
)
def test_a_detection_hides_what_is_two_metres_behind_it(east_m, hidden):
    view = View(look(0, car(20.0)))
    assert (view.range_m(east_m, 0.2) is None) is hidden
    assert view.range_m(35.0, 3.0) is not None, "beside its shadow"


# Other policies


def test_class_ttl_keeps_what_stands_and_forgets_what_moves():
    objects = object_map(freshness=ClassTtl())
    for label, north_m in (("person", 0.0), ("car", 5.0), ("bench", 10.0)):
        objects.sight(seen(label, 0.9, at=(10.0, north_m)), 0)
    objects.sight(car(30.0), 0)
    objects.sight(car(30.0), 1 * S)  # at one place for a second: parked
    for t_ns, gone in (
        (S // 2 - 1, []),
        (S // 2, ["person"]),
        (S, ["car"]),
        (300 * S, []),
        (301 * S, ["car"]),
    ):
        assert [one.label for one in objects.forget(t_ns)] == gone
    assert [one.label for one in objects] == ["bench"]


def test_what_one_car_saw_is_its_own_until_another_has_seen_it():
    objects = object_map(freshness=Corroborated(n=2, within_ns=10 * S))

    def shown(to: str, t_s: float) -> list[str]:
        viewer = Viewer(Header(round(t_s * S), "02", to), CameraPose(0.0, 0.0, 1.6, 0.0), FOV)
        return [one.label for one in objects.visible(viewer, 50.0, round(t_s * S))[0]]

    def says(who: str, t_s: float, *found: Detection) -> None:
        told_ = answer(Header(round(t_s * S), "02", who), *found)
        objects.enhanced_cache_new_data(told_, None, round(t_s * S), own=True, names_changes=False)

    says("car1", 0.0, car())
    assert shown("car2", 0.1) == ["car"], "nobody else is there to ask"
    says("car2", 1.0)
    says("car2", 1.0, seen("person", 0.9, at=(10.0, 5.0)))
    assert shown("car1", 1.1) == ["car"] and shown("car3", 1.1) == []
    says("car2", 2.0, car())
    assert shown("car3", 2.1) == ["car"]
    says("car1", 5.0, seen("bench", 0.9, at=(-30.0, 0.0)))
    assert shown("car3", 11.0) == [], "car1's word is more than ten seconds old"


def test_origins_count_no_echo():
    """The car's own detector, then the edge's about the same picture, then a cache's, then one
    second later.
    """

    def confidence(source: str) -> list[float]:
        objects, found = object_map(confidence_source=source), []
        for stamp_s, kind in (
            (0.0, "detector"),
            (0.0, "detector"),
            (0.5, "cache"),
            (1.0, "detector"),
        ):
            said = answer(Header(round(stamp_s * S), "02", "car1"), car(score=0.5)).served(
                kind, "x"
            )
            objects.enhanced_cache_new_data(said, None, 0, own=False, names_changes=False)
            found.append(round(next(iter(objects)).confidence, 3))
        return found

    assert confidence("sightings") == [0.5, 0.525, 0.549, 0.571]
    assert confidence("origins") == [0.5, 0.5, 0.5, 0.525]


# In a Genie


def test_looks_travel_their_bytes_count_and_hits_are_no_looks():
    policy = MeasuredExistence(measured=False)
    asked = genie(TrackMap(ObjectMapRules(), policy, shares="look"))
    request = frame(0)
    asked.on_message(IMAGES, request, 0)
    effects = asked.on_message(
        FROM_NODE, answer(request, seen("car", 0.9, at=(20.0, 0.0))), 50 * MS
    )
    sent = [one.message for one in effects if getattr(one, "topic", "") == f"{OBJECTS}-remote"]
    (look_,) = {one.look for one in sent}
    assert (
        look_.header == request.header and look_.pose == request.pose and len(look_.detections) == 1
    )
    without = sent[0].with_look(None, None)
    assert sent[0].size_bytes == without.size_bytes + LOOK_BYTES + LOOK_DETECTION_BYTES
    hit = asked.on_message(IMAGES, frame(0.2), 200 * MS)
    (replayed,) = [one.message for one in hit if getattr(one, "topic", "") == OBJECTS]
    assert replayed.look is None and replayed.valid_ns == 200 * MS and replayed.source == "cache"
    (held,) = asked.object_map
    assert held.sightings == 1


@pytest.mark.parametrize(
    ("policy", "score", "hits"),
    [
        (MeasuredExistence(measured=False), 0.7, 0),
        (MeasuredExistence(p_min=0.5, measured=False), 0.7, 1),
        (Tracks(), 0.7, 1),
        (Tracks(), 0.5, 0),
    ],
)
def test_a_sighting_hits_what_may_leave_by_existence_or_by_confidence(
    policy, score: float, hits: int
):
    """After one look the object exists with about the probability that its score is, and has this
    as its C.
    """
    map_ = after(tracks(policy, threshold=0.6), look(0.0, car(score=score)))
    again = look(0.1, car(score=score))
    told = Detections(again.header, again.detections).with_look(again, None)
    assert (
        map_.enhanced_cache_new_data(
            told, None, round(0.1 * S), own=False, names_changes=False
        ).lookups.hits
        == hits
    )


def test_a_track_is_taken_over_only_where_nobody_has_just_looked():
    both = car(20.0, 0.0), car(20.0, 30.0)
    edge = after(tracks(), *(look(0.1 * i, *both, car="car2", heading_deg=30.0) for i in range(9)))
    objects, valid_ns = edge.visible(
        Viewer(Header(S, "02", "car1"), CameraPose(0, 0, 0, 0.5), math.pi), 50.0, S
    )
    sent = Detections(Header(S, "02", "car1"), tuple(objects), "cache").with_look(None, valid_ns)
    assert len(objects) == 2
    mine = after(tracks(), look(0.9))
    mine.enhanced_cache_new_data(sent, None, S, own=False, names_changes=False)
    assert there(mine, 1.0) == [("car", 20.0, 30.0)], "the other place was in view, and empty"
    (held,) = mine
    existence = held.existence
    mine.enhanced_cache_new_data(sent, None, S, own=False, names_changes=False)
    assert held.existence == existence and len(mine) == 1, "an echo adds nothing"


def test_of_two_maps_tracks_the_one_that_was_seen_later_counts():
    def sent(last: int, east_m: float) -> Detections:
        map_ = after(tracks(), *(look(0.1 * i, car(east_m), car="car2") for i in range(last)))
        viewer = Viewer(Header(S, "02", "car1"), CameraPose(0.0, 0.0, 1.6, 0.0), FOV)
        objects, valid_ns = map_.visible(viewer, 50.0, S)
        return Detections(viewer.header, tuple(objects), "map").with_look(None, valid_ns)

    for first, second in ((9, 8), (8, 9)):
        mine = tracks()
        for last in (first, second):
            mine.enhanced_cache_new_data(
                sent(last, 20.0 if last == 9 else 20.5), None, S, own=False, names_changes=False
            )
        assert there(mine, 1.0) == [("car", 20.0, 0.0)]


def test_a_genie_that_never_forgets_sends_no_looks():
    asked = genie()
    asked.on_message(IMAGES, frame(0), 0)
    effects = asked.on_message(FROM_NODE, answer(frame(0), car()), 1)
    assert all(one.message.look is None for one in effects if hasattr(one, "message"))


# Bounds, determinism, bad input


sightings = st.tuples(
    st.floats(0.0, 3.0),
    st.floats(-30.0, 60.0),
    st.floats(-30.0, 30.0),
    st.floats(0.3, 1.0),
    st.sampled_from(["car", "truck", "person", "bench", "dog"]),
)


@given(
    st.lists(st.lists(sightings, max_size=5), max_size=12),
    st.sampled_from(["ipda", "autoware", "track"]),
)
def test_whatever_is_seen_bounds_hold_and_the_same_again_is_the_same(rounds, name):
    """In any order of time: probabilities in 0..1, the grids hold what the count says, and nothing
    depends on luck.
    """

    def outcome() -> list[tuple[float, ...]]:
        map_ = tracks(Tracks() if name == "track" else Existence(name, measured=False))
        for i, many in enumerate(rounds):
            t_s = many[0][0] if many else 0.0
            found = [seen(label, score, at=(east, north)) for _, east, north, score, label in many]
            map_.count(look(t_s, *found, camera=str(i)), round(t_s * S))
            assert all(0.0 <= one.existence <= 1.0 and one.variance[0] >= 0.0 for one in map_)
            assert len(list(map_)) == len(map_)
        return [(one.number, one.east_m, one.existence) for one in map_]

    assert outcome() == outcome()


@pytest.mark.parametrize(
    ("freshness", "says"),
    [
        ("newer", "unknown freshness policy 'newer'"),
        (
            {"name": "recommended", "p_min": 1.5},
            "freshness.p_min: must be a number from 0 to 1, not 1.5",
        ),
        (
            {"name": "existence", "p_min": -0.1},
            "freshness.p_min: must be a number from 0 to 1, not -0.1",
        ),
        ({"name": "existence", "preset": "kalman"}, "freshness.preset"),
        ({"name": "ttl", "ttl": "0 s"}, "freshness.ttl: must be more than zero"),
        ({"name": "corroborate", "n": 0}, "freshness.n: must be at least 1"),
        ({"name": "ttl", "tll": "1 s"}, "tll"),
    ],
)
def test_what_cannot_be_meant_is_told_in_one_line(freshness, says):
    with pytest.raises(SettingError) as error:
        from_plain(GenieRules, {"object_map": {"freshness": freshness}})
    assert says in str(error.value) and "\n" not in str(error.value)
