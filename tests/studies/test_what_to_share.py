"""What becomes of messages in the study of sharing."""

from __future__ import annotations

import pytest

from studies.what_to_share import told


@pytest.mark.slow
def test_small_messages_all_arrive_and_large_ones_do_not():
    """59.5 kB take 298 ms on a link that gets one every 100 ms: a third of them leaves it."""
    small, large = told("link", 1_171, seed=7), told("link", 59_500, seed=7)
    assert small["arrived"] == 1.0 and 5.9 < small["delay_ms"] < 40
    assert large["arrived"] == pytest.approx(1 / 3, abs=0.02) and large["delay_ms"] > 297.5


def test_on_the_air_every_car_reaches_the_other_two_and_the_roadside_unit():
    small = told("broadcast", 1_171, seed=7)
    assert small["arrived"] == 1.0
    airtime_ns = 40_000 + -(-((1_171 + 38) * 8 + 22) // 48) * 8_000
    assert small["channel_busy"] == pytest.approx(30 * airtime_ns / 1e9, rel=0.02)
