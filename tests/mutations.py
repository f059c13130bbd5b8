"""Puts errors into the claims layer, one at a time: does a test notice? `python -m tests.mutations [WORD ...]`

Copies the package and its tests to a temporary folder, makes one substitution of `mutations.yaml` there, runs the fast
tests of the claims and prints a table. A substitution that no longer fits its file is an error; so is one that nothing
notices. `WORD`: only mutations whose file or description has one of them.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import NamedTuple

import yaml

REPOSITORY = Path(__file__).resolve().parent.parent
NEEDED = ("genie_sim", "tests", "device_profiles", "scenarios", "schemas", "pyproject.toml")
TESTS = {  # which of the fast tests have to notice, by the file
    "paper/checks.py": ("test_checks",),
    "paper/claims.yaml": ("test_checks",),
    "paper/claims.py": ("test_claims",),
    "paper/evidence.py": ("test_claims", "test_checks"),
    "paper/facts.py": ("test_facts",),
    "paper/watch.py": ("test_watch",),
    "paper/arms.py": ("test_arms",),
    "paper/runs.py": ("test_arms", "test_runs"),
    "paper/verdict_table.py": ("test_claims", "test_arms"),
    "analysis/metrics.py": ("test_facts",),
    "analysis/statistics.py": ("test_claims",),
    "core/node.py": ("core/test_algorithm1",),
    "core/object_map.py": ("core/test_algorithm2",),
}


class Mutation(NamedTuple):
    """``old`` becomes ``new`` in a file of the package, where it occurs exactly once."""

    what: str
    file: str
    old: str
    new: str


def mutations() -> list[Mutation]:
    """Those of ``mutations.yaml``, in order."""
    lines = yaml.safe_load(Path(__file__).with_suffix(".yaml").read_text(encoding="utf-8"))
    return [Mutation(**line) for line in lines]


def survived(mutation: Mutation | None) -> bool:
    """Whether the tests of a mutated copy all pass; those of an untouched one have to."""
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder).resolve()
        for name in NEEDED:
            source = REPOSITORY / name
            if source.is_dir():
                shutil.copytree(source, root / name, ignore=shutil.ignore_patterns("__pycache__"))
            else:
                shutil.copy(source, root / name)
        environment = {**os.environ, "PYTHONPATH": str(root), "PYTHONDONTWRITEBYTECODE": "1"}
        python = partial(subprocess.run, cwd=root, env=environment, capture_output=True, text=True)
        if mutation is None:
            where = python(
                [sys.executable, "-c", "import genie_sim; print(genie_sim.__file__)"]
            ).stdout
            assert where.startswith(str(root)), f"not the copy is tested, but {where}"
        else:
            path = root / "genie_sim" / mutation.file
            path.write_text(
                path.read_text(encoding="utf-8").replace(mutation.old, mutation.new),
                encoding="utf-8",
            )
        names = (
            TESTS[mutation.file]
            if mutation
            else sorted({name for tests in TESTS.values() for name in tests})
        )
        tests = [f"tests/{name}.py" for name in names]
        ran = python([sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *tests])
        assert ran.returncode == 0 or (mutation and ran.returncode in (1, 2)), (
            ran.stdout + ran.stderr
        )
        return ran.returncode == 0


def misfits() -> list[str]:
    """Mutations whose text does not occur exactly once."""
    package = REPOSITORY / "genie_sim"
    counts = [
        (one, (package / one.file).read_text(encoding="utf-8").count(one.old))
        for one in mutations()
    ]
    return [
        f"{one.file}: {one.what}: occurs {count} times: {one.old}"
        for one, count in counts
        if count != 1
    ]


def main() -> int:
    """0 where every mutation was caught."""
    if misfits():
        print("\n".join(misfits()))
        return 2
    words = sys.argv[1:] or [""]
    chosen = [
        one for one in mutations() if any(word in one.what or word in one.file for word in words)
    ]
    survived(None)
    left = 0
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for one, alive in zip(chosen, pool.map(survived, chosen), strict=True):
            left += alive
            print(f"{'SURVIVED' if alive else 'caught':9} {one.file:24} {one.what}", flush=True)
    print(f"{len(chosen)} mutations, {left} survived")
    return int(left > 0)


if __name__ == "__main__":
    sys.exit(main())
