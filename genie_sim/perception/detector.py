"""Object detectors by name: a picture in, labelled boxes out."""

from __future__ import annotations

import importlib
import os
from collections.abc import Sequence
from pathlib import Path

from genie_sim.errors import UserError, unknown
from genie_sim.perception.networks import NanodetM, Yolov8, YoloxNano, YoloxS, YoloxTiny
from genie_sim.perception.onnx_detector import CPU, MIN_SCORE, OnnxDetector

DETECTORS: dict[str, type[OnnxDetector]] = {
    kind.name: kind for kind in (YoloxNano, YoloxTiny, YoloxS, NanodetM, Yolov8)
}


def make_detector(
    name: str,
    weights: str | Path | None = None,
    size: tuple[int, int] | None = None,
    min_score: float = MIN_SCORE,
    providers: Sequence[str] = (CPU,),
    threads: int = 1,
) -> OnnxDetector:
    """The detector of that name, or of a class of your own, ``package.module:Class``.

    ``weights`` is its file or a folder, by default the folder GENIE_SIM_WEIGHTS; ``providers`` are ONNX Runtime's
    execution providers, best first. Raises UserError.
    """
    kind = _own_class(name) if ":" in name else DETECTORS.get(name)
    if kind is None:
        raise UserError(unknown("detector", name, DETECTORS))
    return kind(find_weights(kind.file_name, weights), size, min_score, providers, threads)


def find_weights(file_name: str, weights: str | Path | None = None) -> Path:
    """Path of a weights file, from an explicit file or folder or from the environment's GENIE_SIM_WEIGHTS."""
    place = weights or os.environ.get("GENIE_SIM_WEIGHTS")
    if not place:
        raise UserError(f"weights: where is {file_name}? Name the file, or set GENIE_SIM_WEIGHTS to its folder")
    path = Path(place) / file_name if Path(place).is_dir() else Path(place)
    if not path.is_file():
        raise UserError(f"{path}: no such weights file")
    return path


def _own_class(name: str) -> type[OnnxDetector]:
    module, _, kind = name.partition(":")
    try:
        found = getattr(importlib.import_module(module), kind)
    except (ImportError, AttributeError, ValueError) as error:
        raise UserError(f"detector {name!r}: {error}") from error
    if not (isinstance(found, type) and issubclass(found, OnnxDetector)):
        raise UserError(f"detector {name!r}: is no class derived from OnnxDetector")
    return found
