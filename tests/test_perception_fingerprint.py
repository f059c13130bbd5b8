"""The quick way to a difference hash gives the same bits as shrinking the picture does."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from genie_sim.perception import fingerprint
from genie_sim.perception.fingerprint import difference_hash
from genie_sim.perception.kitti import open_drive, read_image


def by_shrinking(image_bgr):
    grey = cv2.cvtColor(image_bgr, cv2.COLOR_BGR2GRAY)
    small = cv2.resize(grey, (9, 8), interpolation=cv2.INTER_AREA)
    return int.from_bytes(np.packbits(small[:, 1:] > small[:, :-1]).tobytes(), "big")


@given(st.integers(1, 400), st.integers(1, 400), st.integers(0, 2**32 - 1), st.sampled_from([0.0, 2.0, 20.0]))
def test_the_same_bits_whatever_the_picture(width, height, seed, blur):
    random = np.random.default_rng(seed)
    image = random.integers(0, 256, (height, width, 3), dtype=np.uint8)
    if blur:
        image = cv2.GaussianBlur(image, (0, 0), blur)
    assert difference_hash(image) == by_shrinking(image)


@pytest.mark.parametrize("grey", [0, 77, 255])
def test_one_colour_has_no_bits(grey):
    assert difference_hash(np.full((375, 1242, 3), grey, np.uint8)) == 0


def test_a_mean_between_two_greys_is_left_to_opencv():
    """Half of the second cell is 101: its mean, 100.5, is rounded by the last digits of a sum."""
    image = np.full((80, 180, 3), 100, np.uint8)
    image[:, 30:40] = 101
    assert fingerprint._certain_bits(image[:, :, 0]) is None
    assert difference_hash(image) == by_shrinking(image)


@pytest.mark.real_data
def test_real_pictures_mostly_take_the_quick_way(kitti_root):
    frames = open_drive(kitti_root, "2011_09_26/0005", ["02"]).frames["02"][::10]
    pictures = [read_image(frame.image_path) for frame in frames]
    assert [difference_hash(picture) for picture in pictures] == [by_shrinking(picture) for picture in pictures]
    quick = [fingerprint._certain_bits(cv2.cvtColor(p, cv2.COLOR_BGR2GRAY)) is not None for p in pictures]
    assert sum(quick) > len(quick) / 2
