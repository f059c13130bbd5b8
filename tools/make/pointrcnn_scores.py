"""How PointRCNN's logits become scores: logistic regression on the labels of the tracking
sequences.

    GENIE_SIM_KITTI=... python -m tools.make.pointrcnn_scores

Prints the constants of ``tools.make.published.POINTRCNN_SCORES`` (fitted on all
sequences), and how well such a fit holds on sequences that it has not seen: fitted on every other
sequence, judged on the rest.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import minimize
from scipy.special import expit

from genie_sim.data.kitti import tracking_sequence
from genie_sim.data.kitti.drive_truth import read_labels
from genie_sim.data.kitti.perceive import kitti_folder
from tools.make import published
from tools.make.evaluation import evaluate

GROUPS = {"car": "vehicles", "person": "persons"}


def judged(sequence: str) -> dict[str, np.ndarray]:
    """Logit, and 1 for right or 0 for wrong, of each detection that counts."""
    root = kitti_folder(None)
    trace = published.tracking_trace(root / "tracking", sequence, "pointrcnn", min_score=0.0)
    evaluation = evaluate(trace, read_labels(root, f"tracking/{sequence}", trace), 0.0)
    found = {}
    for label, (a, b) in published.POINTRCNN_SCORES.items():
        rows = []
        for one in evaluation.groups[GROUPS[label]].detections:
            # scores are kept with four decimals
            score = min(max(one.detection.score, 0.00005), 0.99995)
            rows.append(((math.log(score / (1 - score)) - b) / a, float(one.label is not None)))
        found[label] = np.array(rows)
    return found


def fit(pairs: np.ndarray) -> tuple[float, float]:
    """Maximum likelihood of right or wrong, given 1 / (1 + exp(-(a logit + b)))."""

    def loss(parameters: np.ndarray) -> float:
        p = np.clip(expit(parameters[0] * pairs[:, 0] + parameters[1]), 1e-9, 1 - 1e-9)
        return -float(np.mean(pairs[:, 1] * np.log(p) + (1 - pairs[:, 1]) * np.log(1 - p)))

    a, b = minimize(loss, np.array([1.0, 0.0]), method="Nelder-Mead").x
    return float(a), float(b)


def calibration_error(pairs: np.ndarray, a: float, b: float) -> float:
    """Mean gap between score and share of right ones, over bins of 0.1."""
    scores = expit(a * pairs[:, 0] + b)
    bins = np.minimum((scores * 10).astype(int), 9)
    return sum(
        abs(scores[bins == i].mean() - pairs[bins == i, 1].mean()) * (bins == i).mean()
        for i in np.unique(bins)
    )


def main() -> None:
    sequences = tracking_sequence.sequences(kitti_folder(None) / "tracking" / "training")
    every = [judged(sequence) for sequence in sequences]
    for label in GROUPS:
        halves = [np.concatenate([one[label] for one in every[start::2]]) for start in (0, 1)]
        a, b = fit(np.concatenate(halves))
        print(f"{label}: a = {a:.2f}, b = {b:.2f} on all {len(sequences)} sequences")
        for fitted, held_out in (halves, halves[::-1]):
            sigmoid, held = (
                calibration_error(held_out, 1.0, 0.0),
                calibration_error(held_out, *fit(fitted)),
            )
            print(
                f"  {len(held_out)} held out: calibration error {held:.3f}; "
                f"plain sigmoid {sigmoid:.3f}"
            )


if __name__ == "__main__":
    main()
