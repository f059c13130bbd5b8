"""Maps of tracks against sequences worked by hand; existence against the textbook's recursion."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from genie_sim.core.messages import (
    Detection,
    Header,
)
from genie_sim.tracks.coverage import Coverage
from genie_sim.tracks.existence import ExistenceFilter
from genie_sim.tracks.laws import ASSUMED, DetectorLaws
from tests.core.worlds import OBJECTS
from tests.make import MS, S, seen
from tests.tracks.looks import after, look, there, tracks

FROM_NODE = f"{OBJECTS}-local"

# Sequences


def test_a_parked_car_that_was_passed_stays_and_goes_when_it_has_left():
    """Seen for 2 s; then the camera looks away for a minute; then it looks at the empty place."""
    map_ = after(tracks(), *(look(0.1 * i, seen()) for i in range(21)))
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
        *(look(0.1 * i, seen(10.0 + i, label="truck" if i % 3 else "car")) for i in range(21)),
    )
    ((_, east_m, north_m),) = there(map_, 2.05)
    assert east_m == pytest.approx(30.5, abs=0.15) and north_m == 0.0
    (held,) = map_
    assert held.velocity_mps[0] == pytest.approx(10.0, abs=0.3), "metres per second, away"
    assert there(map_, 3.05) == [] and len(map_) == 0, "nobody saw it for a second"


def test_an_occluded_car_is_not_missed():
    """A bus drives in front of it: what it hides is no evidence. Beside it, it would be."""

    def rest(*detections):
        map_ = after(tracks(), *(look(0.1 * i, seen(25.0)) for i in range(12)))
        return there(after(map_, *(look(1.2 + 0.1 * i, *detections) for i in range(4))), 1.5)

    assert ("car", 25.0, 0.0) in rest(seen(12.0, 0.3, label="bus"))
    assert ("car", 25.0, 0.0) not in rest(seen(12.0, 6.0, label="bus"))


def test_a_detector_that_misses_twice_does_not_lose_the_object():
    """Not served after two misses by textbook independence, but still tracked: the next sighting
    brings it back.
    """
    map_ = after(tracks(), *(look(0.1 * i, seen()) for i in range(12)))
    (held,) = map_
    assert held.existence > 0.99
    after(map_, look(1.2))
    assert there(map_, 1.2) == [("car", 20.0, 0.0)]
    after(map_, look(1.3))
    assert len(map_) == 1
    after(map_, look(1.4, seen()))
    assert there(map_, 1.4) == [("car", 20.0, 0.0)] and list(map_) == [held]


def test_a_late_look_is_associated_by_predicting_back_and_moves_nothing():
    map_ = after(tracks(), *(look(0.1 * i, seen(10.0 + i)) for i in range(11)))
    (held,) = map_
    place, sightings = held.place(S), held.sightings
    map_.learn(look(0.55, seen(15.5)), S)
    assert list(map_) == [held] and held.sightings == sightings + 1, (
        "it is the same car, half a second ago"
    )
    assert held.place(S) == place and held.seen_in.stamp_ns == S
    existence = held.existence
    map_.learn(look(0.65), S)
    assert held.existence == existence, "a late look that does not show it says nothing about now"


def test_the_same_look_by_two_ways_counts_once():
    one = look(0, seen(score=0.5))
    map_ = after(tracks(), one)
    (held,) = map_
    before = held.existence
    again = map_.learn(one, 40 * MS)
    assert (again.requests, again.updates) == (1, 0)
    assert (held.existence, held.sightings) == (before, 1)
    map_.learn(one._replace(header=one.header._replace(frame_id="03")), 40 * MS)
    assert held.existence > before and held.sightings == 2, "another camera's look is another look"


def test_two_who_walk_side_by_side_stay_two():
    walkers = [
        look(0.1 * i, *(seen(15.0 + 0.1 * i, n, label="person") for n in (0.0, 1.5)))
        for i in range(10)
    ]
    assert len(after(tracks(), *walkers)) == 2


def test_two_detections_never_show_one_track():
    """The second is nearer to the first's track than to its own, which is taken."""

    def walker(north_m: float) -> Detection:
        return seen(10.0, north_m, label="person")

    map_ = after(tracks(), look(0, walker(0.0), walker(2.4)), look(0.1, walker(0.2), walker(1.1)))
    assert [one.sightings for one in map_] == [2, 2]


# ExistenceFilter


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
    policy = ExistenceFilter(laws=laws)
    map_ = after(tracks(policy), look(0, seen(range_m, score=0.6)))
    (held,) = map_
    p = 0.6
    for i, score in enumerate(scores, start=1):
        survival = 0.9998 if held.parked else 0.97
        header = Header(i * 100 * MS, "02", "car1")
        if score is None:
            policy.doubt(held, range_m, header)
        else:
            held.sightings += 1
            policy.confirm(held, score, header)
        p = textbook(p, 0.1, survival, 0.9, None if score is None else 0.9 * score / 0.2)
        assert held.existence == pytest.approx(p, rel=1e-9)
        assert 0.0 <= held.existence <= 1.0


@pytest.mark.parametrize(
    ("range_m", "found"), [(10.0, 0.9), (20.0, 0.9), (30.0, 0.6), (40.0, 0.3), (60.0, 0.2)]
)
def test_the_assumed_chance_to_find_falls_with_the_range(range_m, found):
    assert ASSUMED.detection(True, range_m) == pytest.approx(found)


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
    assert (Coverage(look(0)).range_m(*at) is not None) is seen_there


@pytest.mark.parametrize(
    ("east_m", "hidden"), [(19.0, False), (21.5, False), (22.5, True), (35.0, True)]
)
def test_a_detection_hides_what_is_two_metres_behind_it(east_m, hidden):
    view = Coverage(look(0, seen(20.0)))
    assert (view.range_m(east_m, 0.2) is None) is hidden
    assert view.range_m(35.0, 3.0) is not None, "beside its shadow"


@pytest.mark.parametrize(("p_min", "score", "hits"), [(0.8, 0.7, 0), (0.5, 0.7, 1)])
def test_a_sighting_hits_what_may_leave(p_min: float, score: float, hits: int):
    """After one look the object exists with about the probability that its score is."""
    map_ = after(tracks(ExistenceFilter(p_min)), look(0.0, seen(score=score)))
    again = map_.learn(look(0.1, seen(score=score)), round(0.1 * S), names_changes=False)
    assert (again.requests, again.updates, again.hits) == (1, 1, hits)


# Bounds, determinism


sightings = st.tuples(
    st.floats(0.0, 3.0),
    st.floats(-30.0, 60.0),
    st.floats(-30.0, 30.0),
    st.floats(0.3, 1.0),
    st.sampled_from(["car", "truck", "person", "bench", "dog"]),
)


@given(st.lists(st.lists(sightings, max_size=5), max_size=12), st.sampled_from([0, S // 10]))
def test_whatever_is_seen_bounds_hold_and_the_same_again_is_the_same(rounds, tau_ns):
    """In any order of time: probabilities in 0..1, the grids hold what the count says, and nothing
    depends on luck.
    """

    def outcome() -> list[tuple[float, ...]]:
        map_ = tracks(ExistenceFilter(tau_ns=tau_ns))
        for i, many in enumerate(rounds):
            t_s = many[0][0] if many else 0.0
            found = [
                seen(east, north, label=label, score=score) for _, east, north, score, label in many
            ]
            map_.learn(look(t_s, *found, camera=str(i)), round(t_s * S))
            assert all(0.0 <= one.existence <= 1.0 and one.variance[0] >= 0.0 for one in map_)
            assert len(list(map_)) == len(map_)
        return [(one.number, one.east_m, one.existence) for one in map_]

    assert outcome() == outcome()
