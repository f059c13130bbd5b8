"""Puts the commit that a wheel or an sdist is built from into it, so that results can name it, and
compiles the simulator where ``GENIE_SIM_COMPILE=1`` asks for it.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

IN_SDIST, IN_WHEEL = "commit.txt", "genie_sim/data/commit.txt"
COMPILED = "genie_sim/_compiled"  # see genie_sim/engine.py
GIT = ["git", "describe", "--always", "--abbrev=12", "--dirty", "--exclude=*"]


def commit_of(root: Path) -> str:
    """The commit of a checkout, marked where files differ from it; of an unpacked sdist the one
    that it was built from; empty for neither.
    """
    if (root / ".git").exists():
        try:
            told = subprocess.run(
                GIT, cwd=root, capture_output=True, text=True, timeout=10, check=True
            )
        except (OSError, subprocess.SubprocessError):
            return ""
        return told.stdout.strip()
    path = root / IN_SDIST
    return path.read_text(encoding="utf-8").strip() if path.is_file() else ""


def compile_is_wanted() -> bool:
    """Whether this build compiles. A plain ``pip install .`` does not: it takes a C compiler and a
    minute.
    """
    return os.environ.get("GENIE_SIM_COMPILE", "") not in {"", "0"}


def compile_engine(root: Path, folder: Path) -> str:
    """Compiles into a folder. Returns why that failed, in one line; empty if it did not."""
    script = [sys.executable, str(root / "compile_engine.py"), str(folder)]
    done = subprocess.run(script, capture_output=True, text=True)
    if done.returncode == 0:
        return ""
    lines = done.stderr.strip().splitlines() or [f"exit status {done.returncode}"]
    return lines[-1]


class BuildHook(BuildHookInterface):  # type: ignore[type-arg]
    """Called by hatchling for each thing that it builds."""

    def dependencies(self) -> list[str]:
        """What else a build needs."""
        return ["cython>=3.3", "setuptools>=70"] if compile_is_wanted() else []

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Adds the file of the commit, and the compiled modules or why there are none."""
        root = Path(self.root)
        self.scratch = tempfile.TemporaryDirectory()
        if compile_is_wanted() and self.target_name == "wheel":
            self._compile(root, version == "editable", build_data)
        commit = commit_of(root)
        if commit and version != "editable":  # an editable installation asks git itself
            path = Path(self.scratch.name) / IN_SDIST
            path.write_text(f"{commit}\n", encoding="utf-8")
            target = IN_WHEEL if self.target_name == "wheel" else IN_SDIST
            build_data["force_include"][str(path)] = target

    def _compile(self, root: Path, editable: bool, build_data: dict[str, Any]) -> None:
        """A wheel with compiled modules is one for this Python and this system."""
        folder = root / COMPILED if editable else Path(self.scratch.name) / "compiled"
        reason = compile_engine(root, folder)
        if reason:
            self.app.display_warning(f"genie-sim runs as plain Python: {reason}")
            folder.mkdir(exist_ok=True)
            (folder / "manifest.json").write_text(json.dumps({"failed": reason}), encoding="utf-8")
        if not editable:
            build_data["force_include"][str(folder)] = COMPILED
            build_data["pure_python"], build_data["infer_tag"] = bool(reason), not reason

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Removes the scratch files."""
        self.scratch.cleanup()
