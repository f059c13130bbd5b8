"""The difference hash of a ``sensor_msgs/Image``; equal to the one in a perception trace."""

from __future__ import annotations

import numpy as np

from genie_sim.errors import UserError

CHANNELS = {"mono8": 1, "8UC1": 1, "bgr8": 3, "8UC3": 3, "rgb8": 3, "bgra8": 4, "8UC4": 4, "rgba8": 4}


def difference_hash(height: int, width: int, encoding: str, step: int, data: bytes) -> int:
    """64-bit dHash: of the grey picture shrunk to 9x8, one bit for each pixel brighter than its left neighbour.

    Raises UserError for an encoding that has no plain grey value, ValueError for data too short for the image.
    """
    import cv2

    from genie_sim.perception.fingerprint import hash_of_grey

    if encoding not in CHANNELS:
        raise UserError(f"dhash: no hash for images encoded {encoding!r}; known: {', '.join(sorted(CHANNELS))}")
    channels = CHANNELS[encoding]
    if len(data) < height * step or step < width * channels or not (height and width):
        raise ValueError(f"an image of {width}x{height} with {len(data)} bytes")
    rows = np.frombuffer(data, np.uint8, height * step).reshape(height, step)[:, : width * channels]
    picture = rows.reshape(height, width, channels)
    if channels == 1:
        grey = np.ascontiguousarray(picture[:, :, 0])
    else:
        code = cv2.COLOR_RGB2GRAY if encoding.startswith("rgb") else cv2.COLOR_BGR2GRAY
        grey = cv2.cvtColor(np.ascontiguousarray(picture[:, :, :3]), code)
    return hash_of_grey(grey)
