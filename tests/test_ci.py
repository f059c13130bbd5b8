"""The scripts of continuous integration: what they let pass and what they stop."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from genie_sim import __version__
from tests.conftest import REPOSITORY

SCRIPTS = REPOSITORY / ".ci"


def gate(folder: Path, **counts: tuple[int, int]) -> subprocess.CompletedProcess[str]:
    """What the gate says of folders with so many statements, how many of which ran; of half as many branches too."""
    summaries = {
        name: {
            "num_statements": there,
            "covered_lines": ran,
            "num_branches": there // 2,
            "covered_branches": ran // 2,
        }
        for name, (there, ran) in counts.items()
    }
    files = {
        f"genie_sim/{name}/some/file.py": {"summary": summary}
        for name, summary in summaries.items()
    }
    (folder / "coverage.json").write_text(json.dumps({"files": files}), encoding="utf-8")
    command = [sys.executable, str(SCRIPTS / "coverage_gate.py"), "coverage.json"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=60)


def test_enough_coverage_passes_and_every_folder_is_in_the_table(tmp_path: Path):
    said = gate(tmp_path, core=(100, 96), sim=(200, 190), paper=(100, 10))
    assert said.returncode == 0 and said.stderr == ""
    core, paper, sim = said.stdout.splitlines()[1:]
    assert core.split() == ["genie_sim/core", "150", "96.0", "%", "95", "%"]
    assert paper.split() == ["genie_sim/paper", "150", "10.0", "%"], "not gated"
    assert sim.split()[2] == "95.0"


def test_too_little_coverage_of_a_gated_folder_is_one_line_and_fails(tmp_path: Path):
    said = gate(tmp_path, core=(100, 100), methods=(100, 90))
    assert said.returncode == 1
    assert said.stderr == "coverage: genie_sim/methods: 90.0 % is less than 95 %\n"


@pytest.mark.unix
@pytest.mark.parametrize("tag", ["v0.0.1", __version__, ""])
def test_a_tag_that_is_not_the_version_is_no_release(tag: str):
    checked = subprocess.run(
        [SCRIPTS / "release-check", tag], capture_output=True, text=True, timeout=60
    )
    assert checked.returncode == 1
    assert len(checked.stderr.splitlines()) == 1
