"""A made-up street in the files of V2V4Real: an ego on an arc, another car behind it, 12 cars that
stand and 3 that move.
"""

import math
from pathlib import Path

import numpy as np
from import_v2v4real import CARS, DETECTIONS, LABELS

SEED = 7
NOISE_M = 0.1
FRAMES = 60
SPEED_MPS, TURN_RADPS = 8.0, 0.1
PARTNER, PARTNER_BEHIND_S = 40, 1.5
EGO_LABEL = 77  # the ego is labelled itself at times
# (east, north) [m] of what stands, by number; 3 is left of the ego's first pose, 4 right of it
STANDING = {
    3: (15.0, 9.0),
    4: (18.0, -7.0),
    5: (30.0, 12.0),
    6: (34.0, -5.0),
    7: (45.0, 15.0),
    8: (52.0, -2.0),
    9: (-10.0, 8.0),
    10: (-14.0, -6.0),
    11: (60.0, 20.0),
    12: (5.0, -9.0),
    13: (25.0, -12.0),
    14: (40.0, 25.0),
}
# east, north [m] at the first frame, and speeds [m/s]
MOVING = {20: (40.0, 4.0, -9.0, 0.5), 21: (-20.0, -5.0, 11.0, 0.5), 22: (20.0, 20.0, 0.0, -4.0)}


def ego_pose(t_s: float) -> tuple[float, float, float]:
    """East, north [m] and heading [rad] of the ego: (0, 0, 0) at time 0."""
    radius_m, turn = SPEED_MPS / TURN_RADPS, TURN_RADPS * t_s
    return radius_m * math.sin(turn), radius_m * (1 - math.cos(turn)), turn


def partner_pose(t_s: float) -> tuple[float, float, float]:
    return ego_pose(t_s - PARTNER_BEHIND_S)


def places(t_s: float) -> dict[int, tuple[float, float, float]]:
    """East, north and heading of every labelled car but the ego."""
    there = {number: (east, north, 0.5) for number, (east, north) in STANDING.items()}
    for number, (east, north, v_east, v_north) in MOVING.items():
        heading = math.atan2(v_north, v_east)
        there[number] = (east + v_east * t_s, north + v_north * t_s, heading)
    there[PARTNER] = partner_pose(t_s)
    return there


def write(root: Path, sequence: str = "train/0012", frames: int = FRAMES, cut: int = 0) -> None:
    """Writes labels and detections; the partner is not labelled in the first ``cut`` frames."""
    split, number = sequence.split("/")
    random = np.random.default_rng(SEED)
    labels: list[str] = []
    detections: dict[str, list[str]] = {car: [] for car in CARS}
    for frame in range(frames):
        t_s = frame / 10
        ego = ego_pose(t_s)
        for item, (east, north, heading) in places(t_s).items():
            x_m, z_m = _in_ego(ego, east, north)
            # the partner's box is the wrong way round, as a box may be
            turn = heading - ego[2] + (math.pi if item == PARTNER else 0.0)
            box = _box(random, x_m, z_m, turn)
            if item != PARTNER or frame >= cut:
                labels.append(f"{frame} {item} Car 0 0 0 0 0 0 0 {' '.join(box)}")
            for car in CARS:
                if car == "ego" or item != PARTNER:
                    _detect(random, detections[car], frame, place=(x_m, z_m, turn))
        if frame % 2:
            box = _box(random, 0.0, 0.0, 0.0)
            labels.append(f"{frame} {EGO_LABEL} Car 0 0 0 0 0 0 0 {' '.join(box)}")
        _detect(random, detections["cav1"], frame, place=(0.0, 0.0, 0.0))
        _detect(random, detections["ego"], frame, place=(0.0, 0.0, 0.0))  # its own roof
    _save(root / LABELS.format(split=split, number=number), labels)
    for car, folder in CARS.items():
        path = root / DETECTIONS.format(split=split, car=folder, number=number)
        _save(path, detections[car])


def _in_ego(ego: tuple[float, float, float], east: float, north: float) -> tuple[float, float]:
    """Ahead and to the left [m]."""
    cos, sin = math.cos(ego[2]), math.sin(ego[2])
    return (
        (east - ego[0]) * cos + (north - ego[1]) * sin,
        (north - ego[1]) * cos - (east - ego[0]) * sin,
    )


def _box(random: np.random.Generator, x_m: float, z_m: float, turn: float) -> list[str]:
    x, z = np.array([x_m, z_m]) + NOISE_M / math.sqrt(2) * random.standard_normal(2)
    return [f"{value:.6f}" for value in (1.6, 1.9, 4.5, x, -0.9, z, turn)]


def _detect(
    random: np.random.Generator,
    rows: list[str],
    frame: int,
    *,
    place: tuple[float, float, float],
) -> None:
    score = f"{random.uniform(0.2, 0.9):.6f}"
    rows.append(",".join([str(frame), "2", "0", "0", "0", "0", score, *_box(random, *place), "0"]))


def _save(path: Path, rows: list[str]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(rows) + "\n")
