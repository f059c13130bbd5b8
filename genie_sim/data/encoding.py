"""Pictures as they are after being sent, and what a trace keeps of them: fingerprints, and what
stays nearly the same when a picture changes.
"""

import hashlib
from collections.abc import Mapping
from typing import NamedTuple, get_args

import cv2
import numpy as np

from genie_sim.base.errors import UserError, unknown
from genie_sim.base.features import packed
from genie_sim.core.messages import Encoding

# How OpenCV is asked for each, with libjpeg-turbo and libpng as they come with it.
FORMATS: dict[Encoding, tuple[str, list[int]]] = {
    "png": (".png", []),
    "jpeg90": (".jpg", [cv2.IMWRITE_JPEG_QUALITY, 90]),
    "jpeg80": (".jpg", [cv2.IMWRITE_JPEG_QUALITY, 80]),
}


class Picture(NamedTuple):
    """What a trace keeps of a picture besides what was found in it: see ``TraceFrame``.

    ``size`` is width and height [pixels], ``size_bytes`` that of the encoded picture; ``None``: of
    the raw pixels.
    """

    size: tuple[int, int]
    digest: str
    dhash: int
    features: Mapping[str, bytes] = {}
    size_bytes: int | None = None


def picture_of(
    pixels: np.ndarray, data: bytes, encoding: Encoding = "raw"
) -> tuple[Picture, np.ndarray]:
    """What a trace keeps of a picture, and the pixels that a detector gets to see.

    Parameters
    ----------
    pixels : blue, green and red from 0 to 255, (height, width, 3)
    data : the bytes that they were read from, whose sha256 is the digest
    encoding : in which the picture is sent; its dhash is that of the original, its features are not
    """
    size, digest, dhash = (
        pixels.shape[1::-1],
        hashlib.sha256(data).hexdigest(),
        difference_hash(pixels),
    )
    size_bytes = None
    if encoding != "raw":
        pixels, size_bytes = sent(pixels, encoding)
    features = {"hsv": packed(hue_saturation(pixels))}
    return Picture((size[0], size[1]), digest, dhash, features, size_bytes), pixels


def sent(image_bgr: np.ndarray, encoding: Encoding) -> tuple[np.ndarray, int]:
    """The picture after it was encoded and decoded again, and its size in between [bytes]. Raises
    UserError for an encoding that is none.
    """
    if encoding not in [*FORMATS]:
        raise UserError(f"encoding: {unknown('encoding', encoding, get_args(Encoding))}")
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
