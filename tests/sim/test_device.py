"""Laws of service times, hops and batches."""

from __future__ import annotations

import math

import pytest

from genie_sim.sim.device import Device, HopTime, ServiceTime

LAW = ServiceTime(median_ns=1_000_000, loc=0.4, sigma=0.5)


def test_the_shifted_log_normal_law():
    assert LAW.at(0.0) == 1_000_000, "its median"
    assert LAW.at(-40.0) == 400_000, "nothing takes less than its location"
    assert LAW.at(2.0) == round(1e6 * (0.4 + 0.6 * math.e))
    assert LAW.mean_ns == pytest.approx(1e6 * (0.4 + 0.6 * math.exp(0.125)))
    assert ServiceTime(1, 0.0, 1.0).at(-9.0) == 1, "at least a nanosecond"


def test_a_hop_grows_with_the_message_and_a_batch_with_its_pictures():
    hop = HopTime(fixed_ns=50, per_megabyte_ns=300)
    assert [hop.of(size) for size in (0, 500_000, 1_000_000, 2_000_000)] == [50, 200, 350, 650]
    device = Device("d", 1, hop, LAW, LAW, batch_fixed=0.25)
    assert [device.batch_factor(pictures) for pictures in (1, 2, 5)] == [1.0, 1.75, 4.0]
    assert Device("d", 1, hop, LAW, LAW).batch_factor(3) == 3.0
    assert Device("d", 1, hop, LAW, LAW).codec_factor == 1.0
