"""Pictures under what a car's consumer holds: their files, and their addresses for the page."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from genie_sim.record.columns import Columns
from genie_sim.report.packing import UNKNOWN

MAX_PICTURES = 300  # that a page holds copies of: about 6 MB


@dataclass(frozen=True)
class Pictures:
    """The files of pictures by car, stream and number of the frame; what makes an address for the
    page of each; whose they are; and whether the addresses hold copies.
    """

    paths: Mapping[tuple[str, str, int], Path]
    address: Callable[[Path], str]
    attribution: str
    copied: bool


def pictures_of(poses: Columns, pictures: Pictures, notes: list[str]) -> dict[str, Any]:
    """The addresses of the pictures of these frames, each once, and by frame which it is, -1 where
    there is none.
    """
    cameras = zip(*(poses[name].tolist() for name in ("car", "stream", "frame")), strict=True)
    paths = [pictures.paths.get(camera) for camera in cameras]
    shown = list(dict.fromkeys(path for path in paths if path is not None))
    if pictures.copied and len(shown) > MAX_PICTURES:
        notes.append(f"The page holds {MAX_PICTURES} of {len(shown):,} pictures, the first ones.")
        del shown[MAX_PICTURES:]
    numbers = {path: number for number, path in enumerate(shown)}
    return {
        "addresses": [pictures.address(path) for path in shown],
        "of_frame": [UNKNOWN if path is None else numbers.get(path, UNKNOWN) for path in paths],
        "attribution": pictures.attribution,
    }
