"""Keys that are vectors, and the nearest of them. Distances are exact: they are computed in whole
numbers.
"""

from collections.abc import Callable, Hashable

import numpy as np

from genie_sim.base.features import DIMENSION, UNIT, Vector, feature_of, unpacked
from genie_sim.core.messages import CameraPose, Header, Image

NO_RADIUS = -1.0  # as a radius: no other key is near enough
MAX_SQUARE = 1e9  # more than any squared distance


class FeatureKey:
    """Of one picture: its feature, its header, the camera that took it, and from where. No two
    pictures have equal keys.
    """

    __slots__ = ("header", "pose", "square", "stream", "vector")

    def __init__(self, vector: Vector, header: Header, pose: CameraPose) -> None:
        self.vector, self.header, self.pose = vector, header, pose
        self.stream = header.frame_id
        self.square = float(vector @ vector)


def key_of(feature: str) -> Callable[[Image], FeatureKey]:
    """What makes keys out of a feature. Pictures of different cameras of a car are never alike, as
    under Genie.
    """

    def key(image: Image) -> FeatureKey:
        feature_bytes = feature_of(image.content, feature)
        assert feature_bytes is not None, "checked before the run"
        return FeatureKey(unpacked(feature_bytes), image.header, image.pose)

    return key


class Nearest:
    """A set of keys. ``find`` gives the key itself, else the nearest other one within ``radius``,
    if any may be.
    """

    def __init__(self, radius: Callable[[], float] = lambda: NO_RADIUS) -> None:
        self._radius = radius
        self._keys: list[FeatureKey | None] = []  # by slot
        self._slots: dict[Hashable, int] = {}
        self._free: list[int] = []
        self._vectors = np.zeros((64, DIMENSION), np.float32)
        self._squares = np.zeros(64, np.float32)
        self._streams = np.full(64, -1)  # of free slots
        self._born = np.zeros(64, np.int64)
        self._stream_numbers: dict[str, int] = {}
        self._added = 0

    def __len__(self) -> int:
        return len(self._slots)

    def add(self, key: Hashable) -> None:
        assert isinstance(key, FeatureKey)
        if key in self._slots:
            return
        slot = self._free.pop() if self._free else len(self._keys)
        if slot == len(self._keys):
            self._keys.append(None)
        if slot == len(self._squares):
            self._grow()
        self._keys[slot], self._slots[key] = key, slot
        self._vectors[slot], self._squares[slot] = key.vector, key.square
        self._streams[slot] = self._stream_numbers.setdefault(key.stream, len(self._stream_numbers))
        self._born[slot] = self._added = self._added + 1

    def discard(self, key: Hashable) -> None:
        slot = self._slots.pop(key, None)
        if slot is not None:
            self._keys[slot] = None
            self._streams[slot] = -1
            self._free.append(slot)

    def find(self, key: Hashable) -> Hashable | None:
        if key in self._slots:
            return key
        radius = self._radius() if self._slots else NO_RADIUS
        if radius < 0:
            return None
        assert isinstance(key, FeatureKey)
        nearest = self.near(key, 1, radius)
        return nearest[0][1] if nearest else None

    def near(
        self, key: FeatureKey, count: int, radius: float = np.inf
    ) -> list[tuple[float, FeatureKey]]:
        """Up to ``count`` other keys of the same camera with their distances, at most ``radius``:
        nearest first, of equally near ones the older.
        """
        stream = self._stream_numbers.get(key.stream)
        slots = len(self._keys)
        if stream is None or not slots:
            return []
        dots = self._vectors[:slots] @ key.vector
        squares: Vector = self._squares[:slots] - 2 * dots + np.float32(key.square)
        squares[self._streams[:slots] != stream] = np.inf
        own_slot = self._slots.get(key)
        if own_slot is not None:
            squares[own_slot] = np.inf
        return [
            (float(np.sqrt(squares[slot])) / UNIT, neighbour)
            for slot in self._nearest_slots(squares, count, radius)
            if (neighbour := self._keys[slot]) is not None
        ]

    def _nearest_slots(self, squares: Vector, count: int, radius: float) -> list[int]:
        """The slots of the ``count`` nearest keys, by their squared distances; infinity is none."""
        max_square = min((radius * UNIT) ** 2, MAX_SQUARE)
        if count == 1:
            max_square = min(max_square, float(squares.min()))
        elif count < len(squares):
            max_square = min(max_square, float(np.partition(squares, count - 1)[count - 1]))
        near = np.flatnonzero(squares <= max_square)
        if len(near) > 1:
            near = near[np.lexsort((self._born[near], squares[near]))][:count]
        slots: list[int] = near.tolist()
        return slots

    def _grow(self) -> None:
        for name in ("_vectors", "_squares", "_streams", "_born"):
            old = getattr(self, name)
            setattr(self, name, np.concatenate([old, np.full_like(old, -1)]))
