"""What edges share with cars of others' looks, and what cars believe: each gate by hand."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest

from genie_sim.core.messages import CameraPose, Detection, Header
from genie_sim.recommended.shared_tracks import SharedTracks, SharingRules, tracks_to_share
from genie_sim.tracks.existence import ExistenceFilter
from genie_sim.tracks.track import Motion, Track, kind_of
from genie_sim.tracks.track_map import TrackMap
from tests.make import S, seen

HERE = CameraPose(0.0, 0.0, 1.6, 0.0)


def shared(
    at: tuple[float, float],
    label: str = "car",
    seen_s: float = 10.0,
    velocity_mps: tuple[float, float] = (0.0, 0.0),
) -> Detection:
    header = Header(round(seen_s * S), "02", "car2")
    return replace(seen(*at, label=label, score=0.8), motion=Motion(velocity_mps, 0.5, 0.9, header))


def track(at: tuple[float, float], **spoke_s: float) -> Track:
    header = Header(round(max(spoke_s.values()) * S), "02", max(spoke_s, key=spoke_s.__getitem__))
    made = Track(0, kind_of("car"), "car", 0.9, *at, 0.0, header.stamp_ns, header, (1.0, 0.0, 1.0))
    made.seen_by_ns.update({car: round(stamp_s * S) for car, stamp_s in spoke_s.items()})
    return made


def believed(
    *objects: Detection, own: tuple[Detection, ...] = (), now_s: float = 10.2, contradicted=False
) -> list[tuple[float, float, float] | None]:
    """The places of the shared objects that a car serves; the list holds for 10 s."""
    own_tracks = TrackMap(ExistenceFilter())
    own_tracks.contradicts = lambda *place: contradicted
    tracks = SharedTracks(SharingRules(), own_tracks)
    tracks.replace(objects, 10 * S)
    return [found.location for found in tracks.believed(own, HERE, round(now_s * S))]


def test_a_shared_object_goes_on_with_its_velocity_for_a_second():
    moving = shared((20.0, 0.0), velocity_mps=(10.0, -5.0))
    assert believed(moving, now_s=10.2) == [(pytest.approx(22.0), pytest.approx(-1.0), 0.0)]
    assert believed(moving, now_s=11.4) == [(pytest.approx(30.0), pytest.approx(-5.0), 0.0)]
    assert believed(moving, now_s=9.9) == [(20.0, 0.0, 0.0)]


def test_what_is_near_the_car_is_the_car():
    assert believed(shared((3.0, 0.0))) == [] == believed(shared((4.0, 0.0)))
    assert believed(shared((0.0, 4.1))) == [(0.0, 4.1, 0.0)]


def test_an_own_object_of_its_kind_comes_first():
    own = (seen(label="truck"),)
    assert believed(shared((21.5, 0.0)), own=own) == []
    assert believed(shared((22.0, 0.0)), own=own) == []
    assert believed(shared((22.1, 0.0)), own=own) == [(22.1, 0.0, 0.0)]
    assert believed(shared((21.5, 0.0), label="person"), own=own) == [(21.5, 0.0, 0.0)]


def test_two_shared_objects_near_each_other_are_one():
    assert believed(shared((20.0, 0.0)), shared((21.9, 0.0)), shared((22.1, 0.0))) == [
        (20.0, 0.0, 0.0),
        (22.1, 0.0, 0.0),
    ]


def test_an_own_look_says_otherwise():
    assert believed(shared((20.0, 0.0)), contradicted=True) == []


def test_what_was_seen_long_ago_is_not_served():
    assert believed(shared((20.0, 0.0), seen_s=8.71)) == [(20.0, 0.0, 0.0)]
    assert believed(shared((20.0, 0.0), seen_s=8.69)) == []


def test_a_list_takes_the_place_of_the_last_unless_it_is_older():
    tracks = SharedTracks(SharingRules(), TrackMap(ExistenceFilter()))
    tracks.replace((shared((20.0, 0.0)),), 10 * S)
    tracks.replace((shared((30.0, 0.0)),), 9 * S)
    assert [found.location for found in tracks.believed((), HERE, 10 * S)] == [(20.0, 0.0, 0.0)]
    tracks.replace((), 11 * S)
    assert tracks.believed((), HERE, 11 * S) == []


def test_objects_without_motion_or_place_are_left_out():
    assert believed(seen()) == []
    assert believed(replace(shared((20.0, 0.0)), location=None)) == []


class OneTrack(TrackMap):
    """A map with one track, which exists with this probability at any time."""

    def __init__(self, track: Track, probability: float) -> None:
        super().__init__(ExistenceFilter())
        self._track, self._probability = track, probability

    def __iter__(self) -> Iterator[Track]:
        return iter([self._track])

    def probability(self, track: Track, now_ns: int) -> float:
        return self._probability


def is_shared(of: Track, existence: float = 0.9, now_s: float = 10.0, **settings: Any) -> bool:
    """Whether an edge shares a track with car1, which stands at the origin."""
    tracks = OneTrack(of, existence)
    rules = SharingRules(**settings)
    words = tracks_to_share(tracks, car="car1", pose=HERE, now_ns=round(now_s * S), rules=rules)
    return bool(list(words))


def test_a_car_gets_what_another_saw_lately():
    assert is_shared(track((20.0, 0.0), car2=9.5))
    assert is_shared(track((20.0, 0.0), car1=9.9, car2=9.5))
    assert not is_shared(track((20.0, 0.0), car1=9.9))
    assert not is_shared(track((20.0, 0.0), car1=9.9, car2=8.9)), "the other saw it too long ago"


def test_a_car_gets_nothing_of_itself_nor_of_what_is_far_or_doubtful():
    assert not is_shared(track((3.9, 0.0), car2=9.5))
    assert is_shared(track((4.1, 0.0), car2=9.5))
    assert is_shared(track((59.9, 0.0), car2=9.5)) and not is_shared(track((60.1, 0.0), car2=9.5))
    assert is_shared(track((20.0, 0.0), car2=9.5), existence=0.5)
    assert not is_shared(track((20.0, 0.0), car2=9.5), existence=0.49)
    assert is_shared(track((20.0, 0.0), car2=9.5), existence=0.4, p_min=0.3)
    doubtful = track((20.0, 0.0), car2=9.5)
    doubtful.existence = 0.5
    assert is_shared(doubtful, existence=0.5), "at the lowest probability it still is"


def test_reach_is_measured_where_a_track_is_now():
    coming = track((93.5, 0.0), car2=9.0)
    coming.velocity_mps = (-34.0, 0.0)
    assert is_shared(coming) and not is_shared(coming, now_s=9.9)
