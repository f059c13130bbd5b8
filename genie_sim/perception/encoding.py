"""Pictures as they are after being sent: encoded, and decoded again."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from genie_sim.errors import UserError
from genie_sim.messages import Encoding
from genie_sim.perception.trace import Trace, read_trace

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


def encoded_beside(path: Path | None, trace: Trace, encoding: Encoding) -> Trace:
    """The trace of the same pictures, encoded: the file ``NAME.jpeg80.parquet`` beside ``NAME.parquet``.

    Raises UserError where there is none, or where it is of other pictures.
    """
    if path is None:
        raise UserError(f"image_encoding: {encoding} needs a trace in a file, {trace.name} is none")
    beside = path.with_suffix(f".{encoding}{path.suffix}")
    if not beside.is_file():
        made = f"'genie-sim perceive --encoding {encoding} --out {beside}' makes it"
        raise UserError(f"image_encoding: {encoding}: {path.name} has no {beside.name} beside it; {made}")
    found = read_trace(beside)
    if found.provenance.get("parameters", {}).get("encoding") != encoding:
        raise UserError(f"{beside}: is not of pictures encoded as {encoding}")
    if _pictures(found) != _pictures(trace):
        raise UserError(f"{beside}: is not of the pictures of {path.name}; make it again, or take it away")
    return found.rebased(trace.origin)


def _pictures(trace: Trace) -> list[tuple[str, int, str]]:
    return [(one.camera, one.stamp_ns, one.digest) for camera in sorted(trace.frames) for one in trace.frames[camera]]
