"""Where the checkout is, copies of what is in it, and the type of what runs its command line."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parent.parent


def copied(source: Path, target: Path, *left_out: str) -> Path:
    """Copies a folder of the checkout, which may be read-only; the copy can be written to."""
    ignored = shutil.ignore_patterns(*left_out)
    shutil.copytree(source, target, ignore=ignored, copy_function=shutil.copyfile)
    for path in (target, *target.rglob("*")):
        if path.is_dir():
            path.chmod(0o755)
    return target


CommandLine = Callable[..., subprocess.CompletedProcess[str]]
