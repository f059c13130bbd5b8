"""The map of tracks, and one track: by hand and against a Kalman filter in matrices."""

from __future__ import annotations

import math

import numpy as np
import pytest

from genie_sim.core.messages import CameraPose, Header
from genie_sim.tracks.coverage import Viewer
from genie_sim.tracks.track import NEAR_M, VEHICLE, sigma_of
from tests.make import MS, S, seen
from tests.tracks.looks import FOV, after, look, tracks


def kalman_step(state, covariance, dt_s, measured_m, sigma_m):
    """One axis of a constant velocity with white acceleration, constant over the step."""
    move = np.array([[1.0, dt_s], [0.0, 1.0]])
    push = np.array([[dt_s**2 / 2], [dt_s]]) * VEHICLE.acceleration_mps2
    state, covariance = move @ state, move @ covariance @ move.T + push @ push.T
    gain = covariance[:, 0] / (covariance[0, 0] + sigma_m**2)
    state = state + gain * (measured_m - state[0])
    return state, covariance - np.outer(gain, covariance[0])


def test_a_track_is_a_kalman_filter_for_each_axis():
    places = [(20.0, 0.0), (20.5, 0.2), (21.2, 0.3), (21.6, 0.7), (22.4, 0.7)]
    map_ = tracks()
    first_sigma_m = sigma_of(20.0)
    covariance = np.diag([first_sigma_m**2, (VEHICLE.v_max_mps / 2) ** 2])
    axes = [(np.array([metre, 0.0]), covariance) for metre in places[0]]
    for i, place in enumerate(places):
        map_.learn(look(0.2 * i, seen(*place)), i * 200 * MS)
        if i:
            sigma_m = sigma_of(math.hypot(*place))
            axes = [
                kalman_step(*axis, 0.2, *at)
                for axis, at in zip(axes, ((place[0], sigma_m), (place[1], sigma_m)), strict=True)
            ]
    (track,) = map_
    (east, covariance), (north, _) = axes
    assert (track.east_m, track.north_m) == pytest.approx((east[0], north[0]))
    assert track.velocity_mps == pytest.approx((east[1], north[1]))
    expected = covariance[0, 0], covariance[0, 1], covariance[1, 1]
    assert track.variance == pytest.approx(expected)


@pytest.mark.parametrize(("sigmas", "count"), [(1.5, 1), (1.9, 1), (2.1, 2)])
def test_a_sighting_within_two_sigmas_of_the_predicted_place_is_the_tracks(sigmas, count):
    map_ = after(tracks(), look(0.0, seen(20.0)))
    (track,) = map_
    away_m = NEAR_M + sigmas * track.sigma_m(100 * MS)
    assert away_m < track.kind.gate_m
    after(map_, look(0.1, seen(20.0, away_m)))
    assert len(map_) == count


@pytest.mark.parametrize(("range_m", "visible"), [(0.9, True), (1.1, False), (1.9, False)])
def test_the_view_ends_at_its_range(range_m, visible):
    """Of 30 m."""
    place = seen(30.0 * range_m)
    map_ = after(tracks(view_range_m=30.0), *(look(0.1 * i, place) for i in range(5)))
    viewer = Viewer(Header(S, "02", "car1"), CameraPose(0.0, 0.0, 1.6, 0.0), FOV)
    assert bool(map_.in_view(viewer, S)) is visible


@pytest.mark.parametrize("away_m", [50e3, 1e9, 1e15])
def test_a_detection_far_away_is_a_track_like_any_other_and_costs_no_time(away_m):
    both = seen(20.0), seen(away_m)
    map_ = after(tracks(view_range_m=2 * away_m), look(0.0, *both), look(0.1, *both))
    assert sorted(track.sightings for track in map_) == [2, 2]
    header = Header(S, "02", "car1")
    viewer = Viewer(header, CameraPose(0.0, 0.0, 1.6, 0.0), FOV)
    objects = map_.in_view(viewer, S)
    assert [detection.location[0] for detection in objects] == pytest.approx([20.0, away_m])


@pytest.mark.parametrize(
    ("label", "most_mps"), [("person", 6.0), ("bicycle", 16.0), ("motorcycle", 16.0), ("car", 34.0)]
)
def test_no_track_is_faster_than_twice_its_kinds_highest_speed(label: str, most_mps: float):
    """Also where it seems to have gone 40 m in half a second."""
    (track,) = after(tracks(), look(0.0, seen(10.0, label=label)))
    track.update(seen(10.0, 40.0, label=label), 10.0, Header(S // 2, "02", "car1"))
    assert track.velocity_mps == pytest.approx((0.0, most_mps))


@pytest.mark.parametrize(("seen_at_m", "count"), [(0.0, 2), (0.55, 1)])
def test_tracks_are_one_where_they_come_nearer_than_a_metre(seen_at_m: float, count: int):
    """Two persons 1.2 m apart, within the gate of one sighting: seen where it was, the first leaves
    the second alone; seen nearer to it, it takes the second up.
    """

    def person(north_m: float):
        return seen(10.0, north_m, label="person")

    both = look(0.0, person(0.0), person(1.2))
    assert len(after(tracks(), both, look(0.1, person(seen_at_m)))) == count


@pytest.mark.parametrize(("label", "count"), [("car", 1), ("bus", 1), ("person", 2)])
def test_of_one_group_two_detections_of_one_place_are_one_object(label: str, count: int):
    """A detector that takes a van for a car and for a bus has seen one vehicle."""
    assert len(after(tracks(), look(0.0, seen(20.0), seen(20.4, label=label)))) == count


def test_a_late_look_does_not_contradict_what_the_newest_one_could_not_see():
    """The camera has turned round since; its look before that comes late."""
    away, towards = look(2.0, heading_deg=180.0), look(1.0)
    for looks, contradicted in (((away, towards), False), ((towards,), True)):
        assert after(tracks(), *looks).contradicts("car", 20.0, 0.0, S // 2) is contradicted
