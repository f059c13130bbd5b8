"""When are two images "the same"? A similarity gives every request a key and finds a known key that is equal to it.

To add one, write a class with the two methods of ``Similarity`` and name it in ``SIMILARITIES`` (or in a scenario as
``package.module:Class``).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable
from typing import Protocol

import numpy as np

from genie_sim.messages import Image


class Similarity(Protocol):
    """Gives requests their keys, and remembers the keys that a cache holds."""

    def key(self, image: Image) -> Hashable:
        """The key of a request."""

    def index(self) -> KeyIndex:
        """A fresh, empty set of keys that knows which of them equals a given one."""


class KeyIndex(Protocol):
    """A set of keys with a tolerant look-up."""

    def add(self, key: Hashable) -> None: ...

    def discard(self, key: Hashable) -> None: ...

    def find(self, key: Hashable) -> Hashable | None:
        """The held key that equals ``key`` under this similarity, else ``None``."""


class _EqualKeys:
    """Keys that are the same only if they are equal."""

    def __init__(self) -> None:
        self._keys: set[Hashable] = set()

    def add(self, key: Hashable) -> None:
        self._keys.add(key)

    def discard(self, key: Hashable) -> None:
        self._keys.discard(key)

    def find(self, key: Hashable) -> Hashable | None:
        return key if key in self._keys else None


class Exact:
    """Two images are the same if their bytes are (SHA-256)."""

    def key(self, image: Image) -> Hashable:
        return image.digest

    def index(self) -> KeyIndex:
        return _EqualKeys()


class PoseGrid:
    """Two images are the same if the same camera took them at the same spot, looking the same way.

    A spot is a square cell of the ground plane of side ``cell_m`` (metres), a way of looking one of the equal sectors
    nearest to ``heading_rad`` (radians) wide. "The next time it arrives at the same spot" (Section III-C).
    """

    def __init__(self, cell_m: float = 1.0, heading_rad: float = math.radians(15.0)) -> None:
        if cell_m <= 0 or heading_rad <= 0:
            raise ValueError("pose_grid: cell and heading must be positive")
        self._cell_m = cell_m
        self._sectors = max(1, round(2 * math.pi / heading_rad))

    def key(self, image: Image) -> Hashable:
        pose = image.pose
        sector = math.floor(pose.heading_rad / (2 * math.pi) * self._sectors + 0.5) % self._sectors
        cell_m = self._cell_m
        return (image.header.frame_id, math.floor(pose.east_m / cell_m), math.floor(pose.north_m / cell_m), sector)

    def index(self) -> KeyIndex:
        return _EqualKeys()


class DHash:
    """Two images are the same if their 64-bit difference hashes differ in at most ``radius`` bits.

    Any camera's image may match: two streams that replay one recording, as the grey cameras' stand-ins do, always will.
    """

    def __init__(self, radius: int = 8) -> None:
        if not 0 <= radius <= 64:
            raise ValueError("dhash: radius must lie between 0 and 64")
        self._radius = radius

    def key(self, image: Image) -> Hashable:
        return image.dhash

    def index(self) -> KeyIndex:
        return _HammingIndex(self._radius)


class _HammingIndex:
    """64-bit keys; finds the nearest within a Hamming radius, the older key of two equally near ones."""

    def __init__(self, radius: int) -> None:
        self._radius = radius
        self._slots: dict[Hashable, int] = {}
        self._keys = np.zeros(64, dtype=np.uint64)
        self._used = 0

    def add(self, key: Hashable) -> None:
        assert isinstance(key, int)
        if key in self._slots:
            return
        if self._used == len(self._keys):
            self._compact()
        self._keys[self._used] = key
        self._slots[key] = self._used
        self._used += 1

    def discard(self, key: Hashable) -> None:
        self._slots.pop(key, None)

    def find(self, key: Hashable) -> Hashable | None:
        assert isinstance(key, int)
        if key in self._slots:
            return key
        difference = self._keys[: self._used] ^ np.uint64(key)
        bits = np.unpackbits(difference.view(np.uint8).reshape(-1, 8), axis=1).sum(axis=1)
        for slot in np.argsort(bits, kind="stable"):
            if bits[slot] > self._radius:
                return None
            near = int(self._keys[slot])
            if self._slots.get(near) == slot:
                return near
        return None

    def _compact(self) -> None:
        """Drops the discarded keys and doubles the room."""
        live = list(self._slots)
        self._keys = np.zeros(2 * max(len(live), 32), dtype=np.uint64)
        self._keys[: len(live)] = np.array(live, dtype=np.uint64)
        self._slots = {key: slot for slot, key in enumerate(live)}
        self._used = len(live)


SIMILARITIES: dict[str, Callable[..., Similarity]] = {"exact": Exact, "pose_grid": PoseGrid, "dhash": DHash}
