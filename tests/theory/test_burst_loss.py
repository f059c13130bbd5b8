"""Losses in bursts against the model of Gilbert and Elliott. With p the probability that a loss
follows what was not lost and r that it ends, a share p / (p + r) is lost, 1 / r at a time.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from genie_sim.base.errors import UserError
from genie_sim.base.seeds import stream
from genie_sim.links.burst_loss import BurstLoss, LossProcess
from genie_sim.links.wire import Wire
from tests.conformance import small
from tests.sim.processes import transmitter

SEED, SEGMENTS = 11, 200_000


def lost(loss: BurstLoss, count: int, size: int = 1) -> np.ndarray:
    """Of so many messages of ``size`` segments, whether each is hit."""
    losses = LossProcess(loss, stream(SEED, "losses"))
    return np.array([losses.pass_steps(number * size, size) for number in range(count)])


@pytest.mark.parametrize(("mean", "burst"), [(0.01, 20), (0.1, 5), (0.3, 1), (0.02, 100)])
def test_share_and_length_of_bursts(mean: float, burst: float):
    """Both within 3 standard errors. Runs of losses and of none alternate, independent and
    geometric, so the error of the share follows from the number of bursts.
    """
    hits = lost(BurstLoss(mean=mean, burst=burst), SEGMENTS)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], hits, [False]]).astype(int)))
    bursts = edges[1::2] - edges[::2]
    correlation = 1 - 1 / burst - mean / ((1 - mean) * burst)
    error = math.sqrt(mean * (1 - mean) * (1 + correlation) / (1 - correlation) / SEGMENTS)
    assert hits.mean() == pytest.approx(mean, abs=3 * error)
    spread = math.sqrt(burst * (burst - 1))
    assert bursts.mean() == pytest.approx(burst, abs=3 * spread / math.sqrt(len(bursts)) + 1e-9)


@pytest.mark.parametrize("size", [1, 10, 60])
def test_independent_segments(size: int):
    """A burst of 1 / (1 - m) makes segments independent: 1 - (1 - m)^n of messages are hit."""
    mean, count = 0.01, 20_000
    hits = lost(BurstLoss(mean=mean, burst=1 / (1 - mean)), count, size)
    expected = 1 - (1 - mean) ** size
    assert hits.mean() == pytest.approx(
        expected, abs=3 * math.sqrt(expected * (1 - expected) / count)
    )


def test_a_link_loses_a_message_with_any_of_its_segments():
    loss = BurstLoss(mean=0.02, burst=1 / 0.98)
    wire = Wire(None, None, 7, loss=loss, mtu_payload_bytes=1000)
    channel = transmitter(wire, seed=SEED)
    arrived = np.array([channel.delay_ns(10_000, 0) is not None for _ in range(4000)])
    assert arrived.mean() == pytest.approx(0.98**10, abs=3 * 0.0061)


@pytest.mark.parametrize(
    ("loss", "message"),
    [
        ({"mean": 0.99, "burst": 20}, "loss.mean: must be at most 0.952381 with a burst of 20"),
        ({"mean": 0.1, "burst": 0.5}, "loss.burst: must be at least 1, not 0.5"),
        ({"burst": 5}, "loss.mean: missing"),
    ],
)
def test_a_wrong_loss_is_one_line(loss: dict, message: str):
    link = {"like": "nr5g", "loss": loss}
    with pytest.raises(UserError) as error:
        small.scenario(["remote"], cars=[small.car(1, link=link)])
    assert f"cars[0].link.{message}" in str(error.value) and "\n" not in str(error.value)
