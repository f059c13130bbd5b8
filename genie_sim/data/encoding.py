"""Pictures as they are after being sent, and what stays nearly the same when a picture changes."""

import cv2
import numpy as np

from genie_sim.core.messages import Encoding

# How OpenCV is asked for each, with libjpeg-turbo and libpng as they come with it.
FORMATS: dict[Encoding, tuple[str, list[int]]] = {
    "png": (".png", []),
    "jpeg90": (".jpg", [cv2.IMWRITE_JPEG_QUALITY, 90]),
    "jpeg80": (".jpg", [cv2.IMWRITE_JPEG_QUALITY, 80]),
}


def sent(image_bgr: np.ndarray, encoding: Encoding) -> tuple[np.ndarray, int]:
    """The picture after it was encoded and decoded again, and its size in between [bytes]."""
    suffix, settings = FORMATS[encoding]
    _, data = cv2.imencode(suffix, image_bgr, settings)
    return np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR)), len(data)


def difference_hash(image_bgr: np.ndarray) -> int:
    """64-bit dHash of a picture (height, width, 3), blue, green, red: of its grey picture shrunk to
    9x8 by area, one bit for each pixel brighter than its left one.
    """
    small = cv2.resize(
        cv2.cvtColor(image_bgr, cv2.COLOR_BGR2GRAY), (9, 8), interpolation=cv2.INTER_AREA
    )
    return int.from_bytes(np.packbits(small[:, 1:] > small[:, :-1]).tobytes(), "big")


def hue_saturation(image_bgr: np.ndarray) -> np.ndarray:
    """Histogram (16, 8) of hue and saturation of every fourth pixel of every fourth row."""
    few = cv2.cvtColor(np.ascontiguousarray(image_bgr[::4, ::4]), cv2.COLOR_BGR2HSV)
    return cv2.calcHist(
        [few], channels=[0, 1], mask=None, histSize=[16, 8], ranges=[0, 180, 0, 256]
    )
