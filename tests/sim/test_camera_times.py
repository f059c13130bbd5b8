"""When cameras take frames: windows, laps, pauses, phases."""

from __future__ import annotations

from typing import Any

import pytest

from tests.conformance import small

MS = 1_000_000


def stamps(**route: Any) -> tuple[list[int], int]:
    """The stamps [ms] of a car's first camera, and of the last frame of both."""
    world, tables = small.world(
        small.scenario(["local"], cars=[small.car(1, route=route)], start_jitter="0 s")
    )
    last_ns = world.last_frame_ns
    world.run()
    frames = tables["frames"].to_frame()
    mine = frames[frames["stream"] == "camera_0"]
    assert frames["stamp_ns"].max() == last_ns, "what a camera says of its last frame is so"
    return [stamp // MS for stamp in sorted(mine["stamp_ns"])], last_ns // MS


def test_laps_follow_each_other_with_a_pause():
    once, _ = stamps(window=["0 s", "0.3 s"])
    twice, last_ms = stamps(window=["0 s", "0.3 s"], laps=2, pause="0.5 s")
    assert once == [0, 100, 200]
    assert twice == [*once, *(stamp + 800 for stamp in once)]
    assert last_ms == 1030, "the second camera is 30 ms later"


@pytest.mark.parametrize("start", ["0 s", "0.25 s"])
def test_a_window_begins_with_the_start(start: str):
    later, _ = stamps(window=["0.5 s", "0.8 s"], start=start)
    begin = round(float(start.removesuffix(" s")) * 1000)
    assert later == [begin, begin + 100, begin + 200]
