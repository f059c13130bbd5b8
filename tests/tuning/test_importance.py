"""How much a parameter explains: known shares."""

from __future__ import annotations

import numpy as np
import pytest

from genie_sim.tuning.importance import explained, with_interval

LABELS = np.repeat([0.0, 1.0, 2.0], 40)


def test_what_follows_the_groups_is_explained_and_noise_is_not():
    rng = np.random.default_rng(3)
    assert explained(LABELS, 5.0 * LABELS) == pytest.approx(1.0)
    noise = [explained(rng.permutation(LABELS), LABELS) for _ in range(300)]
    assert np.mean(noise) == pytest.approx(0.0, abs=0.01), "0 on average, not above"
    half = LABELS * np.sqrt(1.5) + rng.standard_normal(120)  # the groups' variance is 1, too
    assert explained(LABELS, half) == pytest.approx(0.5, abs=0.1)


def test_epsilon_squared_by_hand():
    """Groups (1, 3) and (5, 7): 20 in all, 4 within, so 1 - (4 / 2) * 3 / 20."""
    assert explained(np.array([0, 0, 1, 1]), np.array([1.0, 3.0, 5.0, 7.0])) == pytest.approx(0.7)


@pytest.mark.parametrize(
    ("labels", "numbers"),
    [([0, 0, 1, 1], [5.0, 5.0, 5.0, 5.0]), ([0, 1, 2], [1.0, 2.0, 3.0]), ([0, 1], [0.0, 0.0])],
)
def test_nothing_varies_or_every_point_is_a_group_of_its_own(labels, numbers):
    assert explained(np.array(labels), np.array(numbers)) == 0.0


def test_small_differences_of_large_numbers_count():
    numbers = 1e6 + 1e-3 * LABELS
    assert explained(LABELS, numbers) == pytest.approx(1.0, abs=1e-3)


def test_the_interval_holds_the_share_and_is_within_0_and_1():
    rng = np.random.default_rng(5)
    numbers = LABELS + rng.standard_normal(120)
    value, low, high = with_interval(LABELS, numbers, np.random.default_rng(1))
    assert 0 < low < value < high < 1 and high - low < 0.3
    assert (value, low, high) == with_interval(LABELS, numbers, np.random.default_rng(1))
    value, low, high = with_interval(LABELS, rng.standard_normal(120), np.random.default_rng(1))
    assert 0.0 <= low <= value <= high < 0.2
