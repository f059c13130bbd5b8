"""What a run of the fast tests says at its end, and what it stops."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.checkout import REPOSITORY
from tests.tiers import FAST, TIERS

CONFTEST = """
import pytest
from tests import tiers

def pytest_addoption(pluginmanager):
    pluginmanager.register(tiers, "tiers")

@pytest.fixture
def kitti_root():
    pytest.skip("needs real KITTI frames")
"""
TESTS = """
import subprocess
import sys
import time
import pytest

@pytest.mark.slow
def test_slow(): pass

@pytest.mark.slow
@pytest.mark.nightly
def test_of_the_night(): pass

def test_of_data(kitti_root): pass

def test_of_more_data(kitti_root): pass

def test_process(): subprocess.run([sys.executable, "-c", ""], check=True)

def test_plain(): pass

def test_busy():
    while time.process_time() < began + 1.2: pass

began = time.process_time()
"""


def outcome(folder: Path, *options: str) -> str:
    """What pytest prints of ``TESTS``, with these options, and its exit status."""
    (folder / "conftest.py").write_text(CONFTEST, encoding="utf-8")
    (folder / "test_it.py").write_text(TESTS, encoding="utf-8")
    marks = "".join(f"\n    {tier}" for tier in (*TIERS, "no_cover"))
    (folder / "pytest.ini").write_text(f"[pytest]\nmarkers ={marks}\n", encoding="utf-8")
    # no worker of the run that this test is part of
    around = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    ran = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", *options],
        cwd=folder,
        env={**around, "PYTHONPATH": str(REPOSITORY)},
        capture_output=True,
        text=True,
        timeout=600,  # however busy the machine is
    )
    return f"{ran.stdout}exit status {ran.returncode}"


@pytest.mark.parametrize("processes", ["0", "2"])
def test_the_fast_tier_tells_what_it_leaves_out_and_what_is_not_fast(tmp_path, processes: str):
    said = outcome(tmp_path, "-n", processes, "-m", FAST, "--cpu-file=cpu.json", "--max-cpu-s=60")
    assert "1 of slow left out: python -m pytest -m slow\n" in said
    assert "2 of data left out: python -m pytest -m data\n" in said
    assert "1 of nightly left out: python -m pytest -m nightly\n" in said
    assert re.search(
        "1 took more than 1 s of CPU and are not marked slow:\n .* s  test_it.py::", said
    )
    assert "mark it @pytest.mark.process" in said
    assert "1 failed, 2 passed" in said and re.search(r"\n\d s of CPU, of at most 60 s\n", said)
    measured = json.loads((tmp_path / "cpu.json").read_text(encoding="utf-8"))
    assert {name.partition("::")[2] for name in measured} == {
        "test_process",
        "test_plain",
        "test_busy",
    }


@pytest.mark.parametrize("processes", ["0", "2"])
def test_a_run_that_takes_too_much_cpu_fails_and_shows_each_file(tmp_path, processes: str):
    options = ("-n", processes, "-m", "not process", "-k", "plain or busy", "--max-cpu-s=1")
    said = outcome(tmp_path, *options)
    assert re.search(r"\n +1\.\d s  test_it\.py\n", said)
    assert re.search(r"\n\d s of CPU, more than 1 s\n", said)
    assert "2 passed" in said and said.endswith("exit status 1")


def test_what_cannot_run_on_this_machine_is_one_line(tmp_path):
    said = outcome(tmp_path, "-n", "0", "-m", "data")
    assert "2 of data skipped: needs real KITTI frames\n" in said
    assert said.count("KITTI") == 1 and "left out" not in said
