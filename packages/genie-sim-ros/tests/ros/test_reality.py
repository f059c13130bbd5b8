"""Simulation against reality: the same Genie, the same drive, once in real ROS and once simulated.

What follows what is compared strictly, times with their tolerance. Times that disagree while others
keep the machine busy (``busy_elsewhere``) say nothing, and the test skips; ``docs/reality.md`` is
the report of a whole series.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from tests.ros import reality, reality_link
from tests.ros.conftest import Master

pytestmark = [pytest.mark.slow]


def within(real: float, simulated: float, tolerance: float) -> bool:
    return abs(simulated - real) <= tolerance * real


@pytest.mark.nightly
@pytest.mark.alone
def test_the_same_drive_has_the_same_outcomes_and_the_same_response_times(
    master: Master, tmp_path: Path
):
    shown = reality.frames()
    sleeps = reality.sleeps_ns(len(shown))
    parts = reality.measure(master)
    busy = [reality.busy_elsewhere(1.0)]
    real = reality.drive(master, reality.plan_of(shown, sleeps))
    busy.append(reality.busy_elsewhere(1.0))
    simulated = reality.simulate(parts, sleeps, tmp_path)

    assert not np.isnan(simulated.response_ms).any(), "the drive is made so that nothing is dropped"
    assert set(simulated.outcomes) == {"hit", "miss", "coalesced"}
    assert real.outcomes == simulated.outcomes
    assert real.map_lookups == simulated.map_lookups, (
        "the object maps were asked, and answered, alike"
    )
    assert not np.isnan(real.response_ms).any()

    times = [
        (np.percentile(one.response_ms, 50), np.percentile(one.response_ms, 95))
        for one in (real, simulated)
    ]
    agree = [
        within(*both, bound)
        for both, bound in zip(zip(*times, strict=True), (0.10, 0.20), strict=True)
    ]
    told = f"median and 95th percentile [ms]: real {times[0]}, simulated {times[1]}"
    if not all(agree) and max(busy) > reality.BUSY_LIMIT:
        pytest.skip(
            f"outcomes agree, times say nothing: others kept the processors {max(busy):.0%} busy; "
            f"{told}"
        )
    assert all(agree), told


def test_another_detector_would_be_noticed(tmp_path: Path):
    """The comparison can fail: with a detector of twice the time, hits turn into coalesced
    requests.
    """
    sleeps = reality.sleeps_ns(len(reality.frames()))
    parts = reality.Parts(300_000, 1_500_000, 300_000, 200_000)
    as_it_is, slower = (
        reality.simulate(parts, times, tmp_path) for times in (sleeps, [2 * one for one in sleeps])
    )
    assert as_it_is.outcomes != slower.outcomes


# below it is not the simulated link that is off: the real one has another rate than it was given
SHAPER_HOLDS = 0.97


@pytest.mark.nightly
@pytest.mark.alone
@pytest.mark.parametrize("rate_bps", [20_000_000, 100_000_000])
@pytest.mark.parametrize(("size_bytes", "count"), [(100_000, 1), (465_800, 3), (1_397_297, 1)])
@pytest.mark.skipif(sys.platform != "linux", reason="network namespaces are Linux's")
def test_a_shaped_link_takes_as_long_as_the_simulated_one(
    rate_bps: int, size_bytes: int, count: int
):
    reason = reality_link.why_not()
    if reason is not None:
        pytest.skip(reason)
    busy = reality.busy_elsewhere(1.0)
    runs = [
        reality_link.measured_ms(rate_bps, size_bytes, count) for _ in range(reality_link.REPEATED)
    ]
    real = np.median(runs, axis=0).tolist()
    simulated = reality_link.simulated_ms(rate_bps, size_bytes, count)
    assert len(real) == len(simulated) == count
    agree = [within(one, other, 0.05) for one, other in zip(real, simulated, strict=True)]
    if not all(agree) and busy > reality.BUSY_LIMIT:
        pytest.skip(
            f"{real} ms, simulated {simulated} ms; others kept the processors {busy:.0%} busy"
        )
    held = 1.0 if all(agree) else reality_link.held_rate(rate_bps)
    if held < SHAPER_HOLDS:
        pytest.skip(
            f"{real} ms, simulated {simulated} ms; "
            f"this host's shaper keeps up {held:.1%} of its rate only"
        )
    assert all(agree), (
        f"{real} ms, simulated {simulated} ms; the shaper keeps up {held:.1%} of its rate"
    )
