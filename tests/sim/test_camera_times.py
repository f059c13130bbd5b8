"""When cameras take frames: windows, laps, pauses, phases."""

from __future__ import annotations

from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import pytest

from genie_sim.base.errors import UserError
from genie_sim.sim.frame_rate import thinned
from tests.conformance import small

MS = 1_000_000


def stamps(rate: str | None = None, **route: Any) -> tuple[list[int], int]:
    """The stamps [ms] of a car's first camera, and of the last frame of both."""
    cameras = [camera | {"rate": rate} for camera in small.CAMERAS]
    cars = [small.car(1, route=route)]
    world, tables = small.world(
        small.scenario(["local"], cars=cars, cameras=cameras, start_jitter="0 s")
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


@pytest.mark.parametrize(
    ("rate", "expected"),
    [
        ("10 Hz", [0, 100, 200, 300, 400, 500, 600, 700]),
        ("5 Hz", [0, 200, 400, 600]),
        ("2.5 Hz", [0, 400]),
        ("4 Hz", [0, 200, 500, 700]),  # nearest to 0, 250, 500, 750
    ],
)
def test_a_camera_takes_fewer_pictures_than_were_recorded(rate: str, expected: list[int]):
    assert stamps(rate, window=["0 s", "0.8 s"])[0] == expected
    twice, _ = stamps(rate, window=["0 s", "0.8 s"], laps=2, pause="0 s")
    assert twice == [*expected, *(stamp + 800 for stamp in expected)]


def test_the_mean_rate_is_kept_over_jitter_and_gaps_are_not_made_up_for():
    stamps_ms = [100 * k + (-1) ** k * 20 for k in range(400) if not 100 <= k < 150]
    frames = [SimpleNamespace(stamp_ns=stamp * MS) for stamp in stamps_ms]
    taken_ms = [frame.stamp_ns // MS for frame in thinned(frames, 3.0)]
    for begin_ms, end_ms in ((0, 9_900), (15_000, 39_900)):
        count = sum(begin_ms <= stamp < end_ms for stamp in taken_ms)
        assert count == pytest.approx((end_ms - begin_ms) / 1000 * 3.0, abs=1)
    assert min(b - a for a, b in pairwise(taken_ms)) > 200
    assert thinned(frames[:2], 3.0) == frames[:1]


def test_more_pictures_than_were_recorded_are_refused():
    message = r"scenario: cameras\[0\].rate: 12 Hz is more than was recorded: 10 Hz on "
    with pytest.raises(UserError, match=message):
        stamps("12 Hz")
    with pytest.raises(UserError, match=r"cameras\[0\].rate: must be more than zero"):
        stamps("0 Hz")
