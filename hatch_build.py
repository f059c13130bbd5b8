"""Puts the commit that a wheel or an sdist is built from into it, so that results can name it."""

import subprocess
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

IN_SDIST, IN_WHEEL = "commit.txt", "genie_sim/shipped/commit.txt"
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


class BuildHook(BuildHookInterface):  # type: ignore[type-arg]
    """Called by hatchling for each thing that it builds."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Adds the file of the commit."""
        root = Path(self.root)
        self.scratch = tempfile.TemporaryDirectory()
        commit = commit_of(root)
        if commit and version != "editable":  # an editable installation asks git itself
            path = Path(self.scratch.name) / IN_SDIST
            path.write_text(f"{commit}\n", encoding="utf-8")
            target = IN_WHEEL if self.target_name == "wheel" else IN_SDIST
            build_data["force_include"][str(path)] = target

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Removes the scratch files."""
        self.scratch.cleanup()
