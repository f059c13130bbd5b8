"""A detector of shadows under cars, to show what a detector has to have."""

import hashlib

import numpy as np

from genie_sim.extend import DetectedBox


class Shadows:
    """The darkest spot of the road ahead is a car."""

    name = "shadows"
    file_name = "shadows.txt"
    default_size = (640, 192)

    def __init__(self, weights, size=None, min_score=0.3):
        self.size = size or self.default_size
        self.min_score = min_score
        self.sha256 = hashlib.sha256(weights.read_bytes()).hexdigest()
        self.half_width_px = int(weights.read_text())

    def detect(self, image_bgr):
        height, width = image_bgr.shape[:2]
        road = image_bgr[height // 2 : -10, width // 3 : -width // 3].mean(axis=2)
        row, column = np.unravel_index(road.argmin(), road.shape)
        x, y = float(column + width // 3), float(row + height // 2)
        score = 1.0 - float(road.min()) / 255.0
        if score < self.min_score:
            return []
        box = (x - self.half_width_px, y - self.half_width_px, x + self.half_width_px, y + 5.0)
        return [DetectedBox("car", score, box)]
