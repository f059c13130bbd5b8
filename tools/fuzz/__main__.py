"""``python -m tools.fuzz --cases 100000``: broken files and settings, and a table of what became of
them.

``--only NAME`` takes one kind, ``--first N`` begins with case N: ``--only bags --first 37 --cases
1`` does one again.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from tools.fuzz import files, harness, settings

TARGETS = (
    *files.TARGETS,
    *settings.TARGETS,
)
ALL = sum(target.share for target in TARGETS)


def main(targets: Sequence[harness.Target] = TARGETS) -> int:
    every = sum(target.share for target in targets)
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--cases", type=int, default=every)
    asked.add_argument("--only", choices=[target.name for target in targets])
    asked.add_argument("--first", type=int, default=0)
    asked.add_argument("--seed", type=int, default=harness.SEED)
    given = asked.parse_args()
    tallies = {}
    for target in targets:
        if given.only not in (None, target.name):
            continue
        count = given.cases if given.only else -(-given.cases * target.share // every)
        with tempfile.TemporaryDirectory() as folder:
            numbers = range(given.first, given.first + count)
            tallies[target.name] = harness.run(target, Path(folder), numbers, given.seed)
        print(
            harness.table({target.name: tallies[target.name]}).splitlines()[2],
            file=sys.stderr,
            flush=True,
        )
        for bug in tallies[target.name].bugs:
            print(bug, file=sys.stderr, flush=True)
    print(harness.table(tallies))
    return int(any(tally.bugs for tally in tallies.values()))


if __name__ == "__main__":
    sys.exit(main())
