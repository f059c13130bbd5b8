"""Where the checkout is, copies of what is in it, results that were changed, and the type of what
runs its command line.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from genie_sim.record import provenance

REPOSITORY = Path(__file__).resolve().parent.parent


def copied(source: Path, target: Path, *left_out: str) -> Path:
    """Copies a folder of the checkout, which may be read-only; the copy can be written to."""
    ignored = shutil.ignore_patterns(*left_out)
    shutil.copytree(source, target, ignore=ignored, copy_function=shutil.copyfile)
    for path in (target, *target.rglob("*")):
        if path.is_dir():
            path.chmod(0o755)
    return target


def sign(folder: Path) -> None:
    """Makes a result folder say of its files what they are now, as one who hides a change does."""
    for path in folder.rglob("*.json"):
        about = provenance.read_json(path)
        if not isinstance(about, dict) or not isinstance(about.get("digests"), dict):
            continue
        about["digests"] |= provenance.digests(path.parent, about["digests"])
        if "run_id" in about and "facts" in about:
            about["run_id"] = provenance.run_id(about["facts"])
        provenance.write_json(path, about, sort_keys=False)


def forget(folder: Path) -> None:
    """Forgets modules that were imported from a folder."""
    for name, module in list(sys.modules.items()):
        file = getattr(module, "__file__", None)
        if file and Path(file).is_relative_to(folder):
            del sys.modules[name]


CommandLine = Callable[..., subprocess.CompletedProcess[str]]
