"""Where frames are: a bag's transforms, by name and time."""

import bisect
import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from genie_sim.core.geometry import Array, inverse, rigid

ALWAYS_NS = (
    500_000_000  # a pose this much before the first or after the last one known is taken for it
)


def rotation(turn: Any) -> Array | None:
    """The 3x3 rotation of a message's quaternion, ``None`` for one that is none; all zeros say that nobody knows."""
    from scipy.spatial.transform import Rotation

    quaternion = (turn.x, turn.y, turn.z, turn.w)
    return (
        np.asarray(Rotation.from_quat(quaternion).as_matrix())
        if 0.1 < math.hypot(*quaternion) < 10
        else None
    )


class Track:
    """A moving frame in another: poses at instants, in between on the straight way."""

    def __init__(self, poses: Iterable[tuple[int, Array]]) -> None:
        by_stamp = dict(poses)
        self.stamps_ns = sorted(by_stamp)
        self._poses = [by_stamp[stamp_ns] for stamp_ns in self.stamps_ns]

    def at(self, stamp_ns: int) -> Array | None:
        """The pose at an instant; ``None`` outside of what is known."""
        after = bisect.bisect_left(self.stamps_ns, stamp_ns)
        if after < len(self.stamps_ns) and self.stamps_ns[after] == stamp_ns:
            return self._poses[after]
        if after in (0, len(self.stamps_ns)):
            end = min(after, len(self.stamps_ns) - 1)
            near = bool(self.stamps_ns) and abs(self.stamps_ns[end] - stamp_ns) <= ALWAYS_NS
            return self._poses[end] if near else None
        before = after - 1
        between = self.stamps_ns[after] - self.stamps_ns[before]
        return _between(
            self._poses[before], self._poses[after], (stamp_ns - self.stamps_ns[before]) / between
        )


class Frames:
    """The tree of ``/tf`` and ``/tf_static``."""

    def __init__(self) -> None:
        self._static: dict[str, tuple[str, Array]] = {}
        self._moving: dict[str, tuple[str, list[tuple[int, Array]]]] = {}
        self._tracks: dict[str, Track] = {}

    def heard(
        self, parent: str, child: str, stamp_ns: int, parent_SE3_child: Array, static: bool
    ) -> None:
        """A transform of the bag."""
        parent, child = parent.strip("/"), child.strip("/")
        if static:
            self._static[child] = parent, parent_SE3_child
        else:
            self._moving.setdefault(child, (parent, []))[1].append((stamp_ns, parent_SE3_child))

    def known(self) -> list[str]:
        """Every frame that has a name."""
        tree = {
            **{child: of[0] for child, of in self._static.items()},
            **{c: of[0] for c, of in self._moving.items()},
        }
        return sorted({*tree, *tree.values()})

    def find(self, target: str, source: str, stamp_ns: int) -> Array | None:
        """``target_SE3_source`` at an instant; ``None`` where nothing joins the two."""
        up, down = (
            self._to_root(target.strip("/"), stamp_ns),
            self._to_root(source.strip("/"), stamp_ns),
        )
        shared = next((name for name in down if name in up), None)
        return None if shared is None else inverse(up[shared]) @ down[shared]

    def _to_root(self, name: str, stamp_ns: int) -> dict[str, Array]:
        """The frame's pose in each of its ancestors, itself first."""
        found, here = {name: np.eye(4)}, np.eye(4)
        while True:
            if name in self._static:
                name, step = self._static[name]
            elif name in self._moving:
                if name not in self._tracks:
                    self._tracks[name] = Track(self._moving[name][1])
                moved = self._tracks[name].at(stamp_ns)
                if moved is None:
                    return found
                name, step = self._moving[name][0], moved
            else:
                return found
            if name in found:
                return found  # a loop
            here = step @ here
            found[name] = here


def _between(first: Array, second: Array, share: float) -> Array:
    from scipy.spatial.transform import Rotation, Slerp

    turn = Slerp([0.0, 1.0], Rotation.from_matrix(np.array([first[:3, :3], second[:3, :3]])))(share)
    return rigid(turn.as_matrix(), (1 - share) * first[:3, 3] + share * second[:3, 3])
