"""Prints how much of each folder of the package the tests ran, and fails where a gated folder is below its share.

    python .ci/coverage_gate.py coverage.json

The file is what ``coverage json`` writes (statements and branches). Folders that are gated and not there (yet) are
skipped.
"""

from __future__ import annotations

import json
import sys
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

PACKAGE = "genie_sim"
GATED = ("core", "sim", "methods", "faults")
LEAST_PERCENT = 95.0


@dataclass
class Counted:
    """Statements and branches, together: how many there are, and how many of them the tests ran."""

    there: int = 0
    ran: int = 0

    @property
    def percent(self) -> float:
        return 100 * self.ran / self.there if self.there else 100.0

    def add(self, summary: Mapping[str, Any]) -> None:
        self.there += summary["num_statements"] + summary.get("num_branches", 0)
        self.ran += summary["covered_lines"] + summary.get("covered_branches", 0)


def by_folder(report: Mapping[str, Any]) -> dict[str, Counted]:
    """The package's own files under "", each folder with everything below it."""
    folders: defaultdict[str, Counted] = defaultdict(Counted)
    for name, file in report["files"].items():
        inside = Path(name.replace("\\", "/")).parts
        inside = inside[inside.index(PACKAGE) + 1 :]
        folders[inside[0] if len(inside) > 1 else ""].add(file["summary"])
    return dict(folders)


def table(folders: Mapping[str, Counted]) -> str:
    lines = [f"{'folder':24}{'lines and branches':>20}{'ran':>9}  at least"]
    for folder, counted in sorted(folders.items()):
        least = f"{LEAST_PERCENT:g} %" if folder in GATED else ""
        name = f"{PACKAGE}/{folder}".rstrip("/")
        lines.append(f"{name:24}{counted.there:>20,}{counted.percent:>7.1f} %  {least}".rstrip())
    return "\n".join(lines)


def main(path: str) -> int:
    """0 where every gated folder reaches its share, 1 with a line for each that does not."""
    folders = by_folder(json.loads(Path(path).read_text(encoding="utf-8")))
    print(table(folders))
    short = [name for name in GATED if name in folders and folders[name].percent < LEAST_PERCENT]
    for name in short:
        found = f"{folders[name].percent:.1f} %"
        print(
            f"coverage: {PACKAGE}/{name}: {found} is less than {LEAST_PERCENT:g} %", file=sys.stderr
        )
    return 1 if short else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
