"""What takes long to make and is only looked at: made once, for all workers of pytest-xdist."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest


def made_once(factory: pytest.TempPathFactory, name: str, make: Callable[[Path], Any]) -> Path:
    """The folder that ``make`` has filled, by this worker or by one before it."""
    shared = factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" not in os.environ or sys.platform == "win32":
        folder = shared / name
        if not folder.exists():
            folder.mkdir()
            make(folder)
        return folder
    import fcntl

    folder, done = shared.parent / name, shared.parent / f"{name}.done"
    with (shared.parent / f"{name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not done.exists():
            folder.mkdir()
            make(folder)
            done.touch()
    return folder
