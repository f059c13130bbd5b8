"""Detectors by name, and the settings of the one that looks at frames.

To ship another network, write a class like those in ``networks`` and add it to ``DETECTORS``; one
of your own is named ``package.module:Class``.
"""

import importlib.metadata
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from genie_sim.base import plugins
from genie_sim.base.errors import UserError, short_repr
from genie_sim.base.paths import expanded
from genie_sim.core.messages import Encoding
from genie_sim.data.detectors import networks
from genie_sim.data.detectors.boxes import MIN_SCORE
from genie_sim.data.detectors.image_detector import ImageDetector, ThreadedDetector
from genie_sim.data.detectors.onnx_session import CPU

PACKAGES = ("numpy", "onnxruntime", "opencv-python-headless", "pymap3d")

DETECTORS: dict[str, type[ImageDetector]] = {
    kind.name: kind
    for kind in (
        networks.YoloxNano,
        networks.YoloxTiny,
        networks.YoloxS,
        networks.NanodetM,
        networks.Yolov8,
        networks.Yolov10,
        networks.RtDetr,
        networks.SizedRtDetr,
    )
}


@dataclass(frozen=True)
class DetectorSettings:
    """Which detector looks at frames, and how.

    Parameters
    ----------
    name : a detector, or ``package.module:Class``
    weights : the network's file or its folder; ``None``: the folder GENIE_SIM_WEIGHTS
    size : width and height of the network's input [pixels]; ``None``: the detector's usual one
    min_score : the lowest score kept, above 0 and below 1
    providers : ONNX Runtime's execution providers, best first
    threads : of the network
    encoding : of the pictures before the detector sees them
    classes : the classes of labels of the network that have other names
    """

    name: str = "yolox_nano"
    weights: str | Path | None = None
    size: tuple[int, int] | None = None
    min_score: float = MIN_SCORE
    providers: Sequence[str] = (CPU,)
    threads: int = 1
    encoding: Encoding = "raw"
    classes: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        # however they were given, to be compared
        object.__setattr__(self, "providers", (*self.providers,))

    def unusual(self, *names: str) -> dict[str, Any]:
        """Those of these settings that are not as usual."""
        usual = DetectorSettings()
        values = {name: getattr(self, name) for name in names}
        return {name: value for name, value in values.items() if value != getattr(usual, name)}

    def opened(self) -> ImageDetector:
        """The detector with these settings. Raises UserError."""
        kind = plugins.resolve("detector", self.name, DETECTORS, ("detect", "file_name"))
        path = find_weights(kind.file_name, self.weights)
        settings = {"size": self.size, "min_score": self.min_score}
        # a detector of one's own may take none of these
        settings |= self.unusual("providers", "threads", "classes")
        detector: ImageDetector = plugins.call("detector", self.name, kind, path, **settings)
        if isinstance(detector, ThreadedDetector):
            threads: object = detector.threads
            if not (isinstance(threads, int) and threads > 0):
                raise UserError(
                    f"detector {self.name!r}: threads {short_repr(threads)} must be a whole number "
                    "above 0"
                )
        return detector


def detector_facts(detector: ImageDetector) -> dict[str, Any]:
    """The detector, its weights, and the versions of the packages that decide what it finds and
    where, for a trace's provenance.
    """
    versions = {name: importlib.metadata.version(name) for name in PACKAGES}
    return {"detector": detector.name, "weights_sha256": detector.sha256, "versions": versions}


def find_weights(file_name: str, weights: str | Path | None = None) -> Path:
    """Path of a weights file, from an explicit file or folder or from the environment's
    GENIE_SIM_WEIGHTS.
    """
    place = weights or os.environ.get("GENIE_SIM_WEIGHTS")
    if not place:
        raise UserError(
            f"weights: where is {file_name}? Name the file, or set GENIE_SIM_WEIGHTS to its folder"
        )
    path = expanded(place)
    path = path / file_name if path.is_dir() else path
    if not path.is_file():
        raise UserError(f"{path}: no such weights file")
    return path
