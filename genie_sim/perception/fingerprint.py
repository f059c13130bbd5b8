"""What stays nearly the same when a picture does: its difference hash of 64 bits, and its colours."""

from __future__ import annotations

import cv2
import numpy as np

from genie_sim.core.geometry import Array

COLUMNS, ROWS = 9, 8
LEAST_WEIGHT = 1e-3  # OpenCV's resize leaves out the part of a pixel that is smaller than this (resize.cpp)
MOST_PIXELS = 2**31 // 255  # their sum fits into 32 bits


def difference_hash(image_bgr: np.ndarray) -> int:
    """64-bit dHash of a picture (height, width, 3), blue, green, red."""
    return hash_of_grey(cv2.cvtColor(image_bgr, cv2.COLOR_BGR2GRAY))


def hue_saturation(image_bgr: np.ndarray) -> np.ndarray:
    """Histogram (16, 8) of hue and saturation of every fourth pixel of every fourth row."""
    few = cv2.cvtColor(np.ascontiguousarray(image_bgr[::4, ::4]), cv2.COLOR_BGR2HSV)
    return cv2.calcHist([few], [0, 1], None, [16, 8], [0, 180, 0, 256])


def hash_of_grey(grey: np.ndarray) -> int:
    """64-bit dHash: of a grey picture (height, width) shrunk to 9x8, one bit for each pixel brighter than its left one.

    Shrinking is OpenCV's ``INTER_AREA``. That is slow for so large a step, so most pictures are spared it: where no
    rounding of its sums could change a bit, exact means of the same areas give the same bits.
    """
    bits = _certain_bits(grey)
    if bits is None:
        small = cv2.resize(grey, (COLUMNS, ROWS), interpolation=cv2.INTER_AREA)
        bits = small[:, 1:] > small[:, :-1]
    return int.from_bytes(np.packbits(bits).tobytes(), "big")


def _certain_bits(grey: np.ndarray) -> np.ndarray | None:
    """The bits (8, 8) by exact means; ``None`` where the last digits of a mean would decide."""
    height_px, width_px = grey.shape[0] / ROWS, grey.shape[1] / COLUMNS
    if height_px < 1 or width_px < 1 or grey.size > MOST_PIXELS:
        return None
    sums = cv2.integral(grey).astype(np.float64)
    sums = _between(_between(sums, np.arange(ROWS + 1) * height_px).T, np.arange(COLUMNS + 1) * width_px).T
    means = np.diff(np.diff(sums, axis=0), axis=1) / (height_px * width_px)
    left_out = 2 * LEAST_WEIGHT * (1 / height_px + 1 / width_px)
    rounded = (height_px + width_px) * np.finfo(np.float32).eps
    error = 255 * (left_out + rounded)
    low, high = np.rint(means - error), np.rint(means + error)
    surely, perhaps = low[:, 1:] > high[:, :-1], high[:, 1:] > low[:, :-1]
    return surely if np.array_equal(surely, perhaps) else None


def _between(rows: Array, places: Array) -> Array:
    """Rows (n, k) at places (m,) from 0 to n - 1, in a straight line between two rows."""
    before = np.minimum(places.astype(np.intp), len(rows) - 2)
    first = rows[before]
    between: Array = first + (rows[before + 1] - first) * (places - before)[:, None]
    return between
