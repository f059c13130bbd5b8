"""What the tests of pages and of notebooks share."""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Iterator
from pathlib import Path
from unittest import mock

import pytest

from genie_sim.extend import DETECTORS
from tests.checkout import REPOSITORY, forget


@pytest.fixture
def as_a_reader(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The folder in which somebody sits who has installed genie-sim."""
    path, work = tmp_path / "bin", tmp_path / "work"
    path.mkdir()
    work.mkdir()
    for name, arguments in (("python", ""), ("genie-sim", " -m genie_sim")):
        (path / name).write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)}{arguments} "$@"\n')
        (path / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{path}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setenv("PYTHONPATH", str(REPOSITORY))
    monkeypatch.chdir(work)
    monkeypatch.syspath_prepend("")
    with mock.patch.dict(DETECTORS):  # a page may add its own
        yield work
    forget(work)
