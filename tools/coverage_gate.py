"""Prints how much of each room of the package the tests ran; fails where one is below its least.

    python tools/coverage_gate.py coverage.json

The file is what ``coverage json`` writes: statements and branches. The simulator's rooms, which its
own tests must run, have a higher least share than the others, whose commands mostly run in
processes of their own.
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
SIMULATOR = ("core", "sim", "methods", "faults")
MIN_PERCENT = 80.0
MIN_PERCENT_OF_SIMULATOR = 95.0


@dataclass
class Count:
    """Statements and branches together: how many there are, and how many the tests ran."""

    total: int = 0
    run: int = 0

    @property
    def percent(self) -> float:
        return 100 * self.run / self.total if self.total else 100.0

    def add(self, summary: Mapping[str, Any]) -> None:
        """Adds the counts of one file."""
        self.total += summary["num_statements"] + summary.get("num_branches", 0)
        self.run += summary["covered_lines"] + summary.get("covered_branches", 0)


def count_by_room(report: Mapping[str, Any]) -> dict[str, Count]:
    """Each folder with everything below it; the package's own files under ``""``."""
    rooms: defaultdict[str, Count] = defaultdict(Count)
    for name, file in report["files"].items():
        parts = Path(name.replace("\\", "/")).parts
        inside = parts[parts.index(PACKAGE) + 1 :]
        rooms[inside[0] if len(inside) > 1 else ""].add(file["summary"])
    return dict(rooms)


def least_percent(room: str) -> float:
    """What the tests must run of a room."""
    return MIN_PERCENT_OF_SIMULATOR if room in SIMULATOR else MIN_PERCENT


def table(rooms: Mapping[str, Count]) -> str:
    """One line a room."""
    lines = [f"{'room':24}{'lines and branches':>20}{'run':>9}  at least"]
    for room, count in sorted(rooms.items()):
        name = f"{PACKAGE}/{room}".rstrip("/")
        limit = f"{least_percent(room):g} %"
        lines.append(f"{name:24}{count.total:>20,}{count.percent:>7.1f} %  {limit}")
    return "\n".join(lines)


def main(path: str) -> int:
    """0 where every room has its least share, 1 with a line for each that has not."""
    rooms = count_by_room(json.loads(Path(path).read_text(encoding="utf-8")))
    print(table(rooms))
    failed = False
    for room, count in sorted(rooms.items()):
        if count.percent < least_percent(room):
            failed = True
            name = f"{PACKAGE}/{room}".rstrip("/")
            share = f"{count.percent:.1f} % is less than {least_percent(room):g} %"
            print(f"coverage: {name}: {share}", file=sys.stderr)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
