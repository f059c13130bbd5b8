"""The gates of coverage and of CPU: what they let pass and what they stop."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

from tests.checkout import REPOSITORY
from tools.cpu_gate import too_slow


def test_the_median_of_three_runs_decides_what_is_too_slow():
    runs = [{"a": 2.5, "b": 9.0, "c": 0.1}, {"a": 2.1, "b": 0.2}, {"a": 0.1, "b": 0.2, "c": 0.1}]
    assert too_slow(runs) == [(2.1, "a")]


def gate(folder: Path, **counts: tuple[int, int]) -> subprocess.CompletedProcess[str]:
    """What the gate says of rooms with so many statements, how many of which ran; of half as many
    branches too.
    """
    summaries = {
        name: {
            "num_statements": total,
            "covered_lines": run,
            "num_branches": total // 2,
            "covered_branches": run // 2,
        }
        for name, (total, run) in counts.items()
    }
    files = {
        f"genie_sim/{name}/some/file.py": {"summary": summary}
        for name, summary in summaries.items()
    }
    (folder / "coverage.json").write_text(json.dumps({"files": files}), encoding="utf-8")
    command = [sys.executable, str(REPOSITORY / "tools" / "coverage_gate.py"), "coverage.json"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=60)


def test_enough_coverage_passes_and_every_room_is_in_the_table(tmp_path: Path):
    outcome = gate(tmp_path, core=(100, 96), paper=(100, 80), sim=(200, 190))
    assert outcome.returncode == 0 and outcome.stderr == ""
    core, paper, sim = outcome.stdout.splitlines()[1:]
    assert core.split() == ["genie_sim/core", "150", "96.0", "%", "95", "%"]
    assert paper.split() == ["genie_sim/paper", "150", "80.0", "%", "80", "%"]
    assert sim.split()[2] == "95.0"


def test_too_little_coverage_of_a_room_is_one_line_and_fails(tmp_path: Path):
    outcome = gate(tmp_path, core=(100, 100), methods=(100, 90), paper=(100, 78))
    assert outcome.returncode == 1
    assert outcome.stderr.splitlines() == [
        "coverage: genie_sim/methods: 90.0 % is less than 95 %",
        "coverage: genie_sim/paper: 78.0 % is less than 80 %",
    ]
