"""What the tests of pages and of notebooks share."""

from __future__ import annotations

import os
import shlex
import sys
from pathlib import Path

import pytest

from tests.checkout import REPOSITORY


@pytest.fixture
def as_a_reader(tmp_path: Path) -> dict[str, str]:
    """The environment of somebody who installed genie-sim and sits in a folder of their own."""
    path = tmp_path / "bin"
    path.mkdir()
    for name, arguments in (("python", ""), ("genie-sim", " -m genie_sim")):
        (path / name).write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)}{arguments} "$@"\n')
        (path / name).chmod(0o755)
    return {
        **os.environ,
        "PATH": f"{path}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": str(REPOSITORY),
    }
