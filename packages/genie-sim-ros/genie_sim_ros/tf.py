"""Where frames are: a bag's transforms, by name and time."""

import bisect
import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from genie_sim.base.geometry import Array, inverse, rigid

# before the first pose and after the last one, for so long, these are used
EXTRAPOLATION_NS = 500_000_000


def rotation(turn: Any) -> Array | None:
    """The 3x3 rotation of a message's quaternion, ``None`` for one far from unit length; all zeros
    mean "unknown".
    """
    from scipy.spatial.transform import Rotation

    quaternion = (turn.x, turn.y, turn.z, turn.w)
    if not 0.1 < math.hypot(*quaternion) < 10:
        return None
    return np.asarray(Rotation.from_quat(quaternion).as_matrix())


class Trajectory:
    """A moving frame in another: poses at instants, interpolated in between."""

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
            is_near = (
                bool(self.stamps_ns) and abs(self.stamps_ns[end] - stamp_ns) <= EXTRAPOLATION_NS
            )
            return self._poses[end] if is_near else None
        before = after - 1
        elapsed_ns = stamp_ns - self.stamps_ns[before]
        interval_ns = self.stamps_ns[after] - self.stamps_ns[before]
        return _between(self._poses[before], self._poses[after], elapsed_ns / interval_ns)


class TransformTree:
    """The tree of ``/tf`` and ``/tf_static``."""

    def __init__(self) -> None:
        self._static: dict[str, tuple[str, Array]] = {}
        self._moving: dict[str, tuple[str, list[tuple[int, Array]]]] = {}
        self._tracks: dict[str, Trajectory] = {}

    def add_static(self, parent: str, child: str, parent_SE3_child: Array) -> None:
        """A transform that always holds."""
        self._static[child.strip("/")] = parent.strip("/"), parent_SE3_child

    def add_moving(self, parent: str, child: str, stamp_ns: int, parent_SE3_child: Array) -> None:
        """A transform at an instant."""
        _, poses = self._moving.setdefault(child.strip("/"), (parent.strip("/"), []))
        poses.append((stamp_ns, parent_SE3_child))

    def names(self) -> list[str]:
        """Every frame that has a name."""
        names = {*self._static, *self._moving}
        names.update(parent for parent, _ in self._static.values())
        names.update(parent for parent, _ in self._moving.values())
        return sorted(names)

    def find(self, target: str, source: str, stamp_ns: int) -> Array | None:
        """``target_SE3_source`` at an instant; ``None`` where nothing joins the two."""
        ancestor_SE3_target = self._to_root(target.strip("/"), stamp_ns)
        ancestor_SE3_source = self._to_root(source.strip("/"), stamp_ns)
        for ancestor, pose in ancestor_SE3_source.items():
            if ancestor in ancestor_SE3_target:
                return inverse(ancestor_SE3_target[ancestor]) @ pose
        return None

    def _to_root(self, name: str, stamp_ns: int) -> dict[str, Array]:
        """The frame's pose in each of its ancestors, itself first."""
        poses, pose = {name: np.eye(4)}, np.eye(4)
        while True:
            if name in self._static:
                name, parent_SE3_child = self._static[name]
            elif name in self._moving:
                if name not in self._tracks:
                    self._tracks[name] = Trajectory(self._moving[name][1])
                moved = self._tracks[name].at(stamp_ns)
                if moved is None:
                    return poses
                name, parent_SE3_child = self._moving[name][0], moved
            else:
                return poses
            if name in poses:
                return poses  # a loop
            pose = parent_SE3_child @ pose
            poses[name] = pose


def _between(first: Array, second: Array, share: float) -> Array:
    from scipy.spatial.transform import Rotation, Slerp

    turn = Slerp([0.0, 1.0], Rotation.from_matrix(np.array([first[:3, :3], second[:3, :3]])))(share)
    return rigid(turn.as_matrix(), (1 - share) * first[:3, 3] + share * second[:3, 3])
