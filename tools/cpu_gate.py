"""Runs the fast tests three times; fails where the median CPU of a test is above 2 s.

    python -m tools.cpu_gate [--runs 3] [OPTIONS OF PYTEST]

Such a test is made faster, or marked ``slow``.
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

MAX_MEDIAN_S = 2.0


def too_slow(runs: Sequence[Mapping[str, float]]) -> list[tuple[float, str]]:
    """Median CPU [s] and name of each test above ``MAX_MEDIAN_S``, the slowest first."""
    names = set().union(*runs)
    medians = [
        (statistics.median(run[name] for run in runs if name in run), name) for name in names
    ]
    return sorted((found for found in medians if found[0] > MAX_MEDIAN_S), reverse=True)


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tools.cpu_gate", description=__doc__)
    parser.add_argument("--runs", type=int, default=3)
    asked, options = parser.parse_known_args()
    runs = []
    with tempfile.TemporaryDirectory() as folder:
        for number in range(asked.runs):
            file = Path(folder) / f"{number}.json"
            pytest = [sys.executable, "-m", "pytest", f"--cpu-file={file}", *options]
            if subprocess.run(pytest).returncode != 0:
                return 1
            runs.append(json.loads(file.read_text(encoding="utf-8")))
    found = too_slow(runs)
    for median_s, name in found:
        print(f"cpu: {median_s:.1f} s: {name}", file=sys.stderr)
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main())
