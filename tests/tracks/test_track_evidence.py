"""Evidence of looks at near instants, and how wide answers out of the map look."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest

from genie_sim.core.messages import Header, Look
from genie_sim.tracks.coverage import Viewer
from genie_sim.tracks.existence import ExistenceFilter
from genie_sim.tracks.laws import ASSUMED
from genie_sim.tracks.track import VEHICLE
from genie_sim.tracks.track_map import TrackMap
from tests.make import S, frame, seen

MS = S // 1000


def track(existence: float) -> SimpleNamespace:
    """A parked vehicle that was checked at 0 and whose existence does not decay."""
    return SimpleNamespace(
        existence=existence,
        checked_ns=0,
        log_survival=0.0,
        sightings=2,
        kind=VEHICLE,
        moving=False,
        parked=True,
    )


def policy(tau_ms: int) -> ExistenceFilter:
    """Of a detector that finds nine of ten, and whose every score is worth a ratio of 4."""
    laws = ASSUMED._replace(vehicles=(0.9,) * 7, ratios=(4.0,) * 11)
    return ExistenceFilter(tau_ns=tau_ms * MS, laws=laws)


@pytest.fixture(autouse=True)
def parked_for_ever(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("genie_sim.tracks.existence.LOG_PARKED", 0.0)


@pytest.mark.parametrize(("tau_ms", "probability"), [(0, 256 / 257), (100, 0.8)])
def test_four_looks_in_a_tenth_of_a_second_say_what_one_says(tau_ms: int, probability: float):
    existing = track(0.5)
    rule = policy(tau_ms)
    for number in range(1, 5):
        rule.confirm(existing, 0.9, Header(25 * MS * number, "02", "car1"))
    assert existing.existence == pytest.approx(probability)


def test_a_look_that_misses_counts_by_its_distance_in_time():
    existing = track(0.5)
    policy(100).doubt(existing, 10.0, Header(25 * MS, "02", "car1"))
    odds = 0.1**0.25
    assert odds == pytest.approx(0.562, abs=1e-3)
    assert existing.existence == pytest.approx(odds / (1 + odds))


def test_a_look_after_tau_counts_whole():
    existing, other = track(0.5), track(0.5)
    policy(100).doubt(existing, 10.0, Header(150 * MS, "02", "car1"))
    policy(0).doubt(other, 10.0, Header(150 * MS, "02", "car1"))
    assert existing.existence == other.existence == pytest.approx(0.1 / 1.1)


@pytest.mark.parametrize(
    ("bearing_deg", "margin_deg", "shown"), [(44, 0, 1), (50, 0, 0), (50, 10, 1), (60, 10, 0)]
)
def test_answers_out_of_the_map_look_wider_by_the_margin(bearing_deg, margin_deg, shown):
    object_map = TrackMap(ExistenceFilter(p_min=0.1), view_margin_rad=math.radians(margin_deg))
    image = frame(0.0)  # 90 degrees wide
    angle = math.radians(bearing_deg)
    at = (0.5 + 20 * math.cos(angle), 0.5 + 20 * math.sin(angle))
    wide = Look(image.header, image.pose, math.radians(170), (seen(*at),))
    object_map.learn(wide, 0)
    viewer = Viewer(image.header, image.pose, image.horizontal_fov_rad)
    assert len(object_map.in_view(viewer, 0)) == shown
    assert object_map.is_in_view(viewer, seen(*at)) == bool(shown)
