"""The pixels of a ``sensor_msgs/Image``."""

from __future__ import annotations

from typing import Any

import numpy as np

from genie_sim.errors import UserError, unknown

CHANNELS = {"mono8": 1, "8UC1": 1, "bgr8": 3, "8UC3": 3, "rgb8": 3, "bgra8": 4, "8UC4": 4, "rgba8": 4}


def picture(message: Any) -> np.ndarray:
    """An image message as (height, width, 3) bytes: blue, green, red.

    Raises UserError for an encoding that has no plain colours, ValueError for data too short for the image.
    """
    encoding, width, height, step = message.encoding, message.width, message.height, message.step
    if encoding not in CHANNELS:
        raise UserError(unknown("image encoding", encoding, CHANNELS))
    channels = CHANNELS[encoding]
    if len(message.data) < height * step or step < width * channels or not (height and width):
        raise ValueError(f"an image of {width}x{height} with {len(message.data)} bytes")
    rows = np.frombuffer(bytes(message.data), np.uint8, height * step).reshape(height, step)
    pixels = rows[:, : width * channels].reshape(height, width, channels)
    if channels == 1:
        return np.repeat(pixels, 3, axis=2)
    return np.ascontiguousarray(pixels[:, :, 2::-1] if encoding.startswith("rgb") else pixels[:, :, :3])
