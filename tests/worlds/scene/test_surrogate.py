"""Surrogate features of a town: their length, and what they depend on."""

from __future__ import annotations

import numpy as np
import pytest

from genie_sim.base.features import DIMENSION, UNIT, unpacked
from genie_sim.core.messages import CameraPose
from genie_sim.worlds.scene.surrogate import FEATURES, Surrogate

PLACES = [CameraPose(37.0 * i, 91.0 * (i % 7), 1.6, 0.1 * i) for i in range(300)]


@pytest.mark.parametrize("name", FEATURES)
def test_features_have_length_1_on_average_and_do_not_leave_their_bytes(name: str):
    """Over seeds, too: each draws its own directions."""
    squares = []
    for seed in range(8):
        surrogate = Surrogate(seed, name)
        vectors = [unpacked(surrogate.at(pose, key)) for key, pose in enumerate(PLACES)]
        assert all(len(vector) == DIMENSION for vector in vectors)
        squares.append(np.mean([vector @ vector for vector in vectors]) / UNIT**2)
    assert np.mean(squares) == pytest.approx(1.0, abs=0.03)


@pytest.mark.parametrize("name", FEATURES)
def test_a_place_looks_alike_but_for_each_frame_s_own_part(name: str):
    surrogate, pose = Surrogate(3, name), PLACES[5]
    assert surrogate.at(pose, 7) == surrogate.at(pose, 7)
    first = unpacked(surrogate.at(pose, 0))
    again = [unpacked(surrogate.at(pose, 97 * key)) for key in range(1, 200)]
    apart = [np.linalg.norm(vector - first) / UNIT for vector in again]
    assert np.median(apart) == pytest.approx(FEATURES[name].noise, rel=0.25)
    far = unpacked(surrogate.at(PLACES[200], 0))
    assert np.linalg.norm(far - first) / UNIT > 2 * np.median(apart)
