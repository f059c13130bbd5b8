"""The tasks of noxfile.py and what they need: what they let pass and what they stop."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from genie_sim import __version__
from tests.checkout import REPOSITORY

TASKS = (
    "lint",
    "types",
    "test",
    "coverage",
    "compile_engine",
    "plain",
    "docs",
    "bench",
    "mutate",
    "lower_bounds",
    "lock",
    "release",
)


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
    command = [sys.executable, str(REPOSITORY / "tests" / "coverage_gate.py"), "coverage.json"]
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


@pytest.fixture
def noxfile():
    pytest.importorskip("nox", reason="nox comes with '.[dev]'")
    import noxfile

    return noxfile


@pytest.mark.parametrize("tag", ["v0.0.1", __version__, ""])
def test_a_tag_that_is_not_the_version_is_no_release(noxfile, monkeypatch, tag: str):
    monkeypatch.chdir(REPOSITORY)
    with pytest.raises(SystemExit, match=r"^release: the tag is"):
        noxfile.release_version(tag)


def test_the_tag_of_the_version_is_a_release(noxfile, monkeypatch):
    monkeypatch.chdir(REPOSITORY)
    assert noxfile.release_version(f"v{__version__}") == __version__


def test_every_task_is_listed(noxfile):
    import nox

    assert set(TASKS) <= {
        name for name in dir(noxfile) if isinstance(getattr(noxfile, name), nox._decorators.Func)
    }


def test_workflows_use_actions_by_digest_only():
    """A tag or a branch can be moved to other code; a digest cannot."""
    used = []
    for path in (REPOSITORY / ".github" / "workflows").glob("*.yml"):
        text = path.read_text(encoding="utf-8")
        yaml.safe_load(text)
        used += re.findall(r"uses: (.*)", text)
    assert used
    for action in used:
        assert re.fullmatch(r"[\w-]+/[\w-]+@[0-9a-f]{40}  # v[\d.]+", action), action


def test_hooks_pin_their_tools_and_use_the_formatter_that_is_installed():
    """Another version of the formatter would lay the code out in another way."""
    hooks = yaml.safe_load((REPOSITORY / ".pre-commit-config.yaml").read_text(encoding="utf-8"))
    tools = [
        tool for hook in hooks["repos"][0]["hooks"] for tool in hook["additional_dependencies"]
    ]
    assert tools and all(re.fullmatch(r"[\w-]+==[\d.]+", tool) for tool in tools)
