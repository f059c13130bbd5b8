"""Tracks, and those that others share."""

from __future__ import annotations

from dataclasses import replace

from genie_sim.core.messages import CameraPose, Detection, Header
from genie_sim.tracks.track import Motion, Track, kind_of
from tests.core.worlds import S, seen

HERE = CameraPose(0.0, 0.0, 1.6, 0.0)


def shared(
    at: tuple[float, float],
    label: str = "car",
    seen_s: float = 10.0,
    velocity_mps: tuple[float, float] = (0.0, 0.0),
) -> Detection:
    header = Header(round(seen_s * S), "02", "car2")
    return replace(seen(label, 0.8, at=at), motion=Motion(velocity_mps, 0.5, 0.9, header))


def track(at: tuple[float, float], **spoke_s: float) -> Track:
    header = Header(round(max(spoke_s.values()) * S), "02", max(spoke_s, key=spoke_s.__getitem__))
    made = Track(0, kind_of("car"), "car", 0.9, *at, 0.0, header.stamp_ns, header, (1.0, 0.0, 1.0))
    made.seen_by_ns.update({car: round(stamp_s * S) for car, stamp_s in spoke_s.items()})
    return made
