"""Where a car was at each frame, from what stands around it: labelled objects whose places in the
car's own frame are known.

The world is the car's frame at the first frame, x east and y north. A first pass goes frame by
frame and takes the pose under which most objects are where they were seen before. Rounds of
refinement fit each frame to the objects that stand still, and smooth the poses.
"""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from genie_sim.extend import Array

FRAME_S = 0.1  # between two frames
INLIER_M = 0.4  # an object this near to where it was seen before has not moved
MIN_INLIERS = 3  # of a pose that is believed
APART_M = 2.0  # two objects nearer than this say little about a direction
# How far the car may be from where its speed takes it: a frame at 54 km/h.
JUMP_M = 1.5
SPEED_FRAMES = 5  # its speed is the mean over so many
STANDS_M, STANDS_FRAMES = 1.0, 15  # what stands moves less, over at least so many frames
ROUNDS = 3
FIT_STEPS, ROBUST_M, FAR_M = 10, 0.2, 30.0  # of the fit to what stands
# Of the smoother: how wrong one frame's pose is, and how a car accelerates and turns. The places'
# are those that the scatter was first measured with; the heading's are assumed.
PLACE_SIGMA_M, ACCELERATION_MPS2 = 0.10, 2.0
HEADING_SIGMA_RAD, TURN_RADPS2 = math.radians(0.2), math.radians(20.0)
MAX_SPEED, MAX_SCATTER_M, MIN_STANDING = 20.0, 0.35, 5

Objects = Mapping[int, tuple[float, float]]  # x and y [m] in the car's frame, by number


class EgoMotion(NamedTuple):
    """Poses (n, 3): east, north [m] and heading [rad]; how many frames no pose could be found for,
    so that they are bridged by the speed before; how many objects stand; and by how much those
    scatter around their mean places (rms over frames, median over objects), in m.
    """

    poses: Array
    bridged: int
    standing: int
    scatter_m: float

    def doubts(self) -> list[str]:
        """What is not good enough to go by; empty for a motion that is accepted."""
        doubts = []
        if not self.scatter_m <= MAX_SCATTER_M:
            doubts.append(
                f"standing objects scatter by {self.scatter_m:.2f} m (at most {MAX_SCATTER_M:g})"
            )
        if self.bridged:
            doubts.append(f"{self.bridged} frames could not be placed (none may be)")
        if self.standing < MIN_STANDING:
            doubts.append(f"{self.standing} objects stand (at least {MIN_STANDING})")
        return doubts


def in_world(pose: Array, points: Array) -> Array:
    """Points (..., 2) of a car's frame in the world, for its pose (3,)."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    x, y = points[..., 0], points[..., 1]
    placed: Array = np.stack([pose[0] + cos * x - sin * y, pose[1] + sin * x + cos * y], axis=-1)
    return placed


def recovered(frames: Sequence[Objects]) -> EgoMotion:
    """The motion of a car from the objects of each of its frames, which follow each other without
    a gap.
    """
    first, bridged = _first_pass(frames)
    refined = _refined(frames, first)
    # What cannot be refined is judged as it was before.
    poses = refined if np.isfinite(refined).all() else first
    standing = _standing(frames, poses)
    scatters_m = [
        math.sqrt(float(((places - places.mean(axis=0)) ** 2).sum(axis=1).mean()))
        for places in standing.values()
    ]
    scatter_m = float(np.median(scatters_m)) if scatters_m else math.inf
    return EgoMotion(poses, bridged, len(standing), scatter_m)


def _first_pass(frames: Sequence[Objects]) -> tuple[Array, int]:
    """Poses frame by frame, and how many are bridged."""
    poses = np.zeros((len(frames), 3))
    places: dict[int, list[Array]] = {}
    bridged = 0
    for number, objects in enumerate(frames):
        if number:
            expected = poses[number - 1] + _speed(poses[:number])
            numbers = [item for item in objects if item in places]
            pose = None
            if len(numbers) >= 2:
                seen = np.array([objects[item] for item in numbers])
                earlier = np.array([np.median(places[item], axis=0) for item in numbers])
                pose = _consensus(seen, earlier, expected[:2])
            bridged += pose is None
            poses[number] = expected if pose is None else pose
        for item, point in objects.items():
            places.setdefault(item, []).append(in_world(poses[number], np.array(point)))
    return poses, bridged


def _speed(poses: Array) -> Array:
    """By how much a pose changes in one frame, over the last ones."""
    frames = min(SPEED_FRAMES, len(poses) - 1)
    if not frames:
        return np.zeros(3)
    change: Array = (poses[-1] - poses[-1 - frames]) / frames
    return change


def _consensus(seen: Array, earlier: Array, expected: Array) -> Array | None:
    """The pose near the one expected under which most objects are where they were earlier.

    Every pair of objects gives a pose. ``None`` where too few objects agree with any.

    Parameters
    ----------
    seen : (n, 2), in the car's frame
    earlier : the same objects in the world, (n, 2)
    expected : where the car should be, (2,)
    """
    i, j = np.triu_indices(len(seen), 1)
    from_i, from_i_earlier = seen[j] - seen[i], earlier[j] - earlier[i]
    length_m, length_earlier_m = np.hypot(*from_i.T), np.hypot(*from_i_earlier.T)
    fits = (np.abs(length_m - length_earlier_m) < 2 * INLIER_M) & (length_m > APART_M)
    heading = np.arctan2(from_i_earlier[:, 1], from_i_earlier[:, 0])
    heading -= np.arctan2(from_i[:, 1], from_i[:, 0])
    cos, sin = np.cos(heading), np.sin(heading)
    middle, there = (seen[i] + seen[j]) / 2, (earlier[i] + earlier[j]) / 2
    east_m = there[:, 0] - cos * middle[:, 0] + sin * middle[:, 1]
    north_m = there[:, 1] - sin * middle[:, 0] - cos * middle[:, 1]
    fits &= np.hypot(east_m - expected[0], north_m - expected[1]) <= JUMP_M
    if not fits.any():
        return None
    cos, sin, east_m, north_m = (column[fits, np.newaxis] for column in (cos, sin, east_m, north_m))
    away_east_m = east_m + cos * seen[:, 0] - sin * seen[:, 1] - earlier[:, 0]
    away_north_m = north_m + sin * seen[:, 0] + cos * seen[:, 1] - earlier[:, 1]
    distance2_m2 = away_east_m**2 + away_north_m**2
    inliers = distance2_m2 < INLIER_M**2
    cost = np.minimum(distance2_m2, INLIER_M**2).sum(axis=1)
    best = inliers[int(np.lexsort((cost, -inliers.sum(axis=1)))[0])]
    if best.sum() < min(MIN_INLIERS, len(seen)):
        return None
    return _fit(seen[best], earlier[best], np.ones(int(best.sum())))


def _fit(seen: Array, places: Array, weights: Array) -> Array:
    """The pose (3,) that takes points (n, 2) of the car's frame nearest to places of the world, by
    weighted least squares.
    """
    share = weights / weights.sum()
    seen_middle, middle = share @ seen, share @ places
    p, q = seen - seen_middle, places - middle
    cross = float((share * (p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0])).sum())
    dot = float((share * (p * q).sum(axis=1)).sum())
    heading = math.atan2(cross, dot)
    turned = in_world(np.array([0.0, 0.0, heading]), seen_middle)
    return np.array([*(middle - turned), heading])


def _standing(frames: Sequence[Objects], poses: Array) -> dict[int, Array]:
    """The places (n, 2) of each object that stands: where it is in the first fifth of its frames
    and in the last one is nearly the same.
    """
    places: dict[int, list[Array]] = {}
    for objects, pose in zip(frames, poses, strict=True):
        for item, point in objects.items():
            places.setdefault(item, []).append(in_world(pose, np.array(point)))
    standing = {}
    for item, several in places.items():
        if len(several) < STANDS_FRAMES:
            continue
        fifth = len(several) // 5
        first, last = np.median(several[:fifth], axis=0), np.median(several[-fifth:], axis=0)
        if np.hypot(*(last - first)) < STANDS_M:
            standing[item] = np.array(several)
    return standing


def _refined(frames: Sequence[Objects], poses: Array) -> Array:
    """The poses after some rounds; not numbers where nothing stands."""
    for _ in range(ROUNDS):
        places = {
            item: np.median(several, axis=0) for item, several in _standing(frames, poses).items()
        }
        fitted = poses.copy()
        for number, objects in enumerate(frames):
            items = [item for item in objects if item in places]
            if len(items) >= 2:
                seen = np.array([objects[item] for item in items])
                there = np.array([places[item] for item in items])
                fitted[number] = _robust_fit(seen, there, poses[number])
        sigmas = PLACE_SIGMA_M, PLACE_SIGMA_M, HEADING_SIGMA_RAD
        changes = ACCELERATION_MPS2, ACCELERATION_MPS2, TURN_RADPS2
        fitted[:, 2] = np.unwrap(fitted[:, 2])
        columns = [
            _smoothed(column, sigma, change)
            for column, sigma, change in zip(fitted.T, sigmas, changes, strict=True)
        ]
        poses = np.column_stack(columns)
    return poses


def _robust_fit(seen: Array, places: Array, pose: Array) -> Array:
    """``_fit`` in which objects far away, and those that are elsewhere, weigh little."""
    by_range = 1 / (1 + (np.hypot(*seen.T) / FAR_M) ** 2)
    for _ in range(FIT_STEPS):
        away_m = np.hypot(*(in_world(pose, seen) - places).T)
        pose = _fit(seen, places, by_range / (1 + (away_m / ROBUST_M) ** 2))
    return pose


def _smoothed(values: Array, sigma: float, change: float) -> Array:
    """Measurements (n,) with a standard deviation, as a Kalman filter and a Rauch-Tung-Striebel
    smoother see what moves at a speed that changes by about ``change`` in a second.
    """
    step = np.array([[1.0, FRAME_S], [0.0, 1.0]])
    pushed = np.array([FRAME_S**2 / 2, FRAME_S]) * change
    noise = np.outer(pushed, pushed)
    state, spread = np.array([values[0], 0.0]), np.diag([sigma**2, MAX_SPEED**2])
    predicted, filtered = [], []
    for number, value in enumerate(values):
        if number:
            state, spread = step @ state, step @ spread @ step.T + noise
        predicted.append((state, spread))
        gain = spread[:, 0] / (spread[0, 0] + sigma**2)
        state = state + gain * (value - state[0])
        spread = spread - np.outer(gain, spread[0])
        filtered.append((state, spread))
    smooth = [state]
    for number in range(len(values) - 2, -1, -1):
        before, its_spread = filtered[number]
        expected, expected_spread = predicted[number + 1]
        gain = its_spread @ step.T @ np.linalg.inv(expected_spread)
        smooth.append(before + gain @ (smooth[-1] - expected))
    return np.array([state[0] for state in reversed(smooth)])
