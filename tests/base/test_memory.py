"""The most memory that a process had."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tests.checkout import REPOSITORY


def memory_told_by(program: str) -> list[int]:
    """The numbers that a Python program prints; it knows ``max_memory_bytes``."""
    program = f"from genie_sim.base.parallel import max_memory_bytes\n{program}"
    told = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=REPOSITORY
    )
    return [int(number) for number in told.stdout.split()]


@pytest.mark.process
@pytest.mark.skipif(sys.platform == "win32", reason="Windows does not tell")
def test_the_memory_of_a_process_is_the_most_that_it_had():
    before, after = memory_told_by(
        "before = max_memory_bytes()\n"
        "room = b'x' * 300_000_000\n"
        "del room\n"
        "print(before, max_memory_bytes())\n"
    )
    assert 10**7 < before <= after and 300_000_000 < after < before + 600_000_000


@pytest.mark.process
@pytest.mark.skipif(sys.platform == "win32", reason="Windows does not tell")
def test_a_process_does_not_show_the_memory_of_the_one_that_started_it():
    ours, its = memory_told_by(
        "import os, subprocess, sys\n"
        "tell = 'from genie_sim.base.parallel import max_memory_bytes; print(max_memory_bytes())'\n"
        "room = b'x' * 300_000_000\n"
        "print(max_memory_bytes(), flush=True)\n"
        "subprocess.run([sys.executable, '-c', tell], check=True)\n"
    )
    assert ours > 300_000_000 > 2 * its
