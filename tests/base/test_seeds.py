"""Random streams are named: nothing but the seed and the name decides their numbers."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from genie_sim.base.seeds import Draws, stream


def numbers(*names: str | int, seed: int = 1) -> list[int]:
    return stream(seed, *names).integers(0, 2**62, size=8).tolist()


def test_the_same_name_gives_the_same_numbers() -> None:
    assert numbers("car1", "uplink") == numbers("car1", "uplink")


def test_streams_differ_by_seed_and_by_name() -> None:
    drawn = [
        numbers("car1", "uplink"),
        numbers("car1", "uplink", seed=2),
        numbers("car1", "uplink", seed=2**40),
        numbers("car1", "downlink"),
        numbers("car2", "uplink"),
        numbers("uplink", "car1"),
        numbers("car1uplink"),
        numbers("car", "1uplink"),
        numbers(),
    ]
    assert len({tuple(draw) for draw in drawn}) == len(drawn)


def test_neighbouring_streams_are_uncorrelated() -> None:
    """|r| of 10,000 pairs stays below 5 standard errors (5 / sqrt(10000)) for 20 pairs of
    neighbours.
    """
    draws = [stream(1, "car", index).standard_normal(10_000) for index in range(21)]
    correlations = [float(np.corrcoef(a, b)[0, 1]) for a, b in pairwise(draws)]
    assert max(map(abs, correlations)) < 0.05


def test_the_numbers_stay_the_same_across_versions() -> None:
    """Published results hang on them: a change here changes every result."""
    assert stream(1, "car1", "uplink").integers(0, 1000, size=4).tolist() == [627, 448, 588, 708]


def test_a_negative_seed_is_refused() -> None:
    with pytest.raises(ValueError, match="seed -1 is negative"):
        stream(-1, "car1")


def test_the_number_of_a_key_depends_on_nothing_else() -> None:
    draws = Draws(1, "car1", "accelerator")
    first = draws.uniform("7 camera_02")
    draws.uniform("8 camera_02")
    assert draws.uniform("7 camera_02") == first
    assert Draws(1, "car1", "accelerator").uniform("7 camera_02") == first
    others = [
        draws.uniform("7 camera_03"),
        Draws(2, "car1", "accelerator").uniform("7 camera_02"),
        Draws(1, "car1", "cpu").uniform("7 camera_02"),
        Draws(1, "car1accelerator").uniform("7 camera_02"),
        Draws(10**40, "car1").uniform("7 camera_02"),
    ]
    assert len({first, *others}) == 6
    with pytest.raises(ValueError, match="seed -1 is negative"):
        Draws(-1, "car1")


def test_numbers_of_keys_have_their_distributions() -> None:
    from scipy.stats import kstest

    draws = Draws(3, "quantiles")
    uniform = [draws.uniform(str(key)) for key in range(40_000)]
    normal = [draws.normal(str(key)) for key in range(40_000)]
    assert kstest(uniform, "uniform").pvalue > 0.01 and kstest(normal, "norm").pvalue > 0.01
    assert min(uniform) > 0 and max(uniform) < 1
    assert abs(np.corrcoef(normal[1:], normal[:-1])[0, 1]) < 4 / np.sqrt(40_000)


def test_numbers_of_keys_stay_the_same_across_versions() -> None:
    """Published results hang on them, too."""
    assert Draws(1, "car1", "accelerator").uniform("7 camera_02") == 0.605250861573872
