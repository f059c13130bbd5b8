"""A difference hash tells which way brightness goes, from left to right, in 8 rows of 8 steps."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from genie_sim.data import sources
from genie_sim.data.encoding import difference_hash
from tests.make import trace


@pytest.mark.parametrize("grey", [0, 77, 255])
def test_one_colour_has_no_bits(grey):
    assert difference_hash(np.full((375, 1242, 3), grey, np.uint8)) == 0


@pytest.mark.parametrize(("step", "expected"), [(1, 2**64 - 1), (-1, 0)])
def test_brighter_to_the_right_is_a_bit(step, expected):
    row = np.arange(180)[::step]
    assert difference_hash(np.tile(row[None, :, None].astype(np.uint8), (80, 1, 3))) == expected


def test_rows_are_read_from_the_top_and_bits_from_the_left():
    image = np.full((8, 9, 3), 100, np.uint8)
    image[0, 1:] = 200  # the first pixel of the first row is darker than all others
    assert difference_hash(image) == 1 << 63


def test_a_picture_and_the_same_one_half_as_large_differ_in_few_bits():
    image = cv2.GaussianBlur(
        np.random.default_rng(1).integers(0, 256, (376, 1242, 3), dtype=np.uint8), (0, 0), 20
    )
    small = cv2.resize(image, (621, 188), interpolation=cv2.INTER_AREA)
    assert (difference_hash(image) ^ difference_hash(small)).bit_count() <= 4


def test_the_encoded_trace_of_several_cars_is_read_once(monkeypatch):
    read = []

    def encoded_beside(path, trace, encoding):
        read.append(encoding)
        return trace

    monkeypatch.setattr(sources, "encoded_beside", encoded_beside)
    drives = sources.RecordedDrives(trace())
    for car in ("car1", "car2"):
        drives.drive(car, None, 0)
    assert drives.encoded("car1", "jpeg80") is drives.encoded("car2", "jpeg80")
    assert read == ["jpeg80"]
