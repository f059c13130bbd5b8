"""Object detectors by name: a picture in, labelled boxes out."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar, Protocol

import numpy as np

from genie_sim import plugins
from genie_sim.errors import UserError
from genie_sim.paths import expanded
from genie_sim.perception.networks import NanodetM, Yolov8, YoloxNano, YoloxS, YoloxTiny
from genie_sim.perception.onnx_detector import CPU, MIN_SCORE, Found, OnnxDetector

__all__ = ["DETECTORS", "Found", "ImageDetector", "find_weights", "make_detector"]


class ImageDetector(Protocol):
    """What ``perceive`` needs of a detector. One that runs a network is best derived from ``OnnxDetector``."""

    name: ClassVar[str]
    file_name: ClassVar[str]
    size: tuple[int, int]
    sha256: str

    def __init__(self, weights: Path, size: tuple[int, int] | None = None, min_score: float = MIN_SCORE) -> None: ...

    def detect(self, image_bgr: np.ndarray) -> list[Found]:
        """Road users and furniture in a picture (height, width, 3), best score first."""
        ...


_KINDS: tuple[type[ImageDetector], ...] = (YoloxNano, YoloxTiny, YoloxS, NanodetM, Yolov8)
DETECTORS = {kind.name: kind for kind in _KINDS}


def make_detector(
    name: str,
    weights: str | Path | None = None,
    size: tuple[int, int] | None = None,
    min_score: float = MIN_SCORE,
    providers: Sequence[str] = (CPU,),
    threads: int = 1,
    batch: int = 1,
) -> ImageDetector:
    """The detector of that name, or of a class of your own, ``package.module:Class``.

    ``weights`` is its file or a folder, by default the folder GENIE_SIM_WEIGHTS; ``providers`` are ONNX Runtime's
    execution providers, best first; ``threads`` are the network's, ``batch`` is how many pictures it gets at a time.
    Detectors that are no ``OnnxDetector`` have neither. Raises UserError.
    """
    kind = plugins.resolve("detector", name, DETECTORS, ("detect", "file_name"))
    path = find_weights(kind.file_name, weights)
    network = isinstance(kind, type) and issubclass(kind, OnnxDetector)
    more = (providers, threads, batch) if network else ()
    made: ImageDetector = plugins.call("detector", name, kind, path, size, min_score, *more)
    return made


def find_weights(file_name: str, weights: str | Path | None = None) -> Path:
    """Path of a weights file, from an explicit file or folder or from the environment's GENIE_SIM_WEIGHTS."""
    place = weights or os.environ.get("GENIE_SIM_WEIGHTS")
    if not place:
        raise UserError(f"weights: where is {file_name}? Name the file, or set GENIE_SIM_WEIGHTS to its folder")
    path = expanded(place)
    path = path / file_name if path.is_dir() else path
    if not path.is_file():
        raise UserError(f"{path}: no such weights file")
    return path
