"""When are two images "the same"? A similarity gives every request a key and finds a known key that
is equal to it.

To add one, write a class with the two methods of ``Similarity`` and name it in ``SIMILARITIES`` (or
in a scenario as ``package.module:Class``).
"""

import math
from collections.abc import Callable, Hashable
from math import floor
from typing import Any, Protocol

from genie_sim.base.setting_errors import SettingError
from genie_sim.core.messages import Image, Request

TURN_RAD = 2 * math.pi


class Similarity(Protocol):
    """Gives requests their keys, and remembers the keys that a cache holds."""

    def key(self, image: Image) -> Hashable:
        """The key of the request that ``image`` is."""

    def index(self) -> "KeyIndex":
        """A fresh, empty set of keys that knows which of them equals a given one."""


class KeyIndex(Protocol):
    """A set of keys with a tolerant look-up."""

    def add(self, key: Hashable, /) -> None:
        """An answer is stored under ``key`` from now on."""
        ...

    def discard(self, key: Hashable, /) -> None:
        """No answer is stored under ``key`` any more; there may have been none."""
        ...

    def find(self, key: Hashable) -> Hashable | None:
        """The stored key that equals ``key`` under this similarity, else ``None``."""


class _EqualKeys(set[Hashable]):
    """An exact-match index."""

    def find(self, key: Hashable) -> Hashable | None:
        return key if key in self else None


class Exact:
    """Two images are the same if their bytes are (SHA-256)."""

    def key(self, image: Image) -> Hashable:
        return image.digest

    def index(self) -> KeyIndex:
        return _EqualKeys()


class PoseGrid:
    """Two images are the same if the same camera took them at the same spot, looking the same way.

    A spot is a square cell of the ground plane, a way of looking one of equal sectors. "The next
    time it arrives at the same spot" (Section III-C).

    Parameters
    ----------
    cell_m : float
        Side of the square of ground that counts as one spot. Assumed.
    heading_rad : float
        Width of the sector of headings that counts as one direction; the nearest that divides the
        circle into equal sectors. Assumed.
    """

    def __init__(self, cell_m: float = 1.0, heading_rad: float = math.radians(15.0)) -> None:
        for key, value in (("cell", cell_m), ("heading", heading_rad)):
            if value <= 0:
                raise SettingError(key, "must be more than zero")
        self._cell_m = cell_m
        self._sectors = max(1, round(TURN_RAD / heading_rad))

    def key(self, image: Request) -> Hashable:
        if image.pose is None:  # then it equals no other
            return image.header
        (east_m, north_m, _, heading_rad), cell_m = image.pose, self._cell_m
        sector = floor(heading_rad / TURN_RAD * self._sectors + 0.5) % self._sectors
        return (
            image.header.frame_id,
            floor(east_m / cell_m),
            floor(north_m / cell_m),
            sector,
        )

    def index(self) -> KeyIndex:
        return _EqualKeys()


class DHash:
    """Two images are the same if their 64-bit difference hashes differ in at most ``radius`` bits.

    Any camera's image may match: two streams that replay one recording, as the grey cameras'
    stand-ins do, always will.

    Parameters
    ----------
    radius : int
        Bits in which two 64-bit difference hashes may differ.
    """

    def __init__(self, radius: int = 8) -> None:
        if not 0 <= radius <= 64:
            raise SettingError("radius", f"must be from 0 to 64, not {radius}")
        self._radius = radius

    def key(self, image: Image) -> Hashable:
        return image.dhash

    def index(self) -> KeyIndex:
        return _NearHashes(self._radius)


class _NearHashes(dict[Any, None]):
    """64-bit keys; finds the nearest within a Hamming radius, the older key of two equally near
    ones.
    """

    def __init__(self, radius: int) -> None:
        self._radius = radius

    def add(self, key: Any) -> None:
        self.setdefault(key)

    def discard(self, key: Any) -> None:
        self.pop(key, None)

    def find(self, key: Any) -> Hashable | None:
        nearest: int | None = key
        if key not in self:
            nearest = min(self, key=lambda candidate: (candidate ^ key).bit_count(), default=None)
        if nearest is None or (nearest ^ key).bit_count() > self._radius:
            return None
        return nearest


SIMILARITIES: dict[str, Callable[..., Similarity]] = {
    "exact": Exact,
    "pose_grid": PoseGrid,
    "dhash": DHash,
}
