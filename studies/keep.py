"""Keeps the metrics that a page of the documentation shows of a sweep: ``results/NAME/points.csv``.

    genie-sim sweep NAME --out results/studies
    python -m studies.keep NAME

The file has the means of every point with their intervals.
"""

from __future__ import annotations

import sys
from pathlib import Path

import pandas as pd

SWEEPS = Path("results/studies")
KEPT = Path("results")
METRICS = {
    "batching": (
        "streaming_f1",
        "object_recall",
        "fresh_answered_share",
        "first_answer_p95",
        "energy_per_frame",
    ),
    "failing_edge": (
        "fault_fresh_share",
        "fault_recall",
        "fault_ghosts",
        "fault_recovery",
    ),
    "two_streets": ("streaming_f1",),
    "shared_uplink": (
        "streaming_f1",
        "object_recall",
        "fresh_answered_share",
        "energy_per_frame",
    ),
}


def keep(name: str) -> None:
    """Writes ``results/NAME/points.csv`` from the tables of the sweep ``NAME``."""
    points = pd.read_csv(SWEEPS / name / "table.csv")
    points = points[points["metric"].isin(METRICS[name])].dropna(axis="columns", how="all")
    (KEPT / name).mkdir(parents=True, exist_ok=True)
    kept = points.drop(columns="point").round(4)
    kept.to_csv(KEPT / name / "points.csv", index=False)


if __name__ == "__main__":
    keep(sys.argv[1])
