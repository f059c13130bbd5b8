"""Random streams are named: nothing but the seed and the name decides their numbers."""

from __future__ import annotations

import os
import subprocess
import sys
from itertools import pairwise

import numpy as np
import pytest

from genie_sim.base.seeds import stream


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


@pytest.mark.process
def test_the_hash_seed_of_python_does_not_matter() -> None:
    draw = "print(stream(1, 'car1', 'uplink').integers(0, 2**62, 8).tolist())"
    script = f"from genie_sim.base.seeds import stream; {draw}"
    for hash_seed in ("0", "12345"):
        environment = {
            **os.environ,
            "PYTHONHASHSEED": hash_seed,
            "PYTHONPATH": os.pathsep.join(sys.path),
        }
        done = subprocess.run(
            [sys.executable, "-c", script],
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        )
        assert done.stdout.strip() == str(numbers("car1", "uplink"))


def test_the_numbers_stay_the_same_across_versions() -> None:
    """Published results hang on them: a change here changes every result."""
    assert stream(1, "car1", "uplink").integers(0, 1000, size=4).tolist() == [627, 448, 588, 708]


def test_a_negative_seed_is_refused() -> None:
    with pytest.raises(ValueError, match="seed -1 is negative"):
        stream(-1, "car1")
