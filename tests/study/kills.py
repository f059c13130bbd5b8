"""``python -m tests.study.kills --kills 100``: kills runs, sweeps and evaluations at random
instants, and looks what is lost.

Every command is killed (SIGKILL, its processes too), begun again, killed again, and at the end left
alone. Nothing that was complete may be gone or changed at any time, the
last attempt must come to the same bytes as one that nobody disturbed, and nothing may lie about
afterwards. Prints a table in Markdown; status 1 if not so.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from tests.checkout import REPOSITORY

SCENARIO = """
edges: [{name: edge1, device: agx_xavier}]
cars: [{name: car1, device: jetson_tx2, edge: edge1, route: {window: [0 s, 1 s]}}]
"""
SWEEP = """
scenario: mine.yaml
set: {methods: [genie]}
seeds: 4
axes: {rate: {set: genie.object_map.rate, list: [0.1, 0.3, 0.5]}}
"""
SEED = 20_240_902


@dataclass
class Victim:
    """A command that is killed. ``whole`` gives the digests of all that is complete in its folder;
    ``parts``: what of it may grow from one attempt to the next, so that a sweep has an end.
    """

    name: str
    command: list[str]
    whole: Callable[[Path], dict[str, str]]
    share: int
    kills: int = 0
    lost: int = 0
    other: int = 0
    left: int = 0
    took_s: float = 0.0


def digests(folder: Path, *patterns: str) -> dict[str, str]:
    found = [path for pattern in patterns for path in folder.glob(pattern) if path.is_file()]
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(found)
    }


def of_run(folder: Path) -> dict[str, str]:
    """The files of result folders; ``run.json`` holds the wall time, but it must be whole."""
    for path in folder.glob("results/[!.]*/run.json"):
        json.loads(path.read_text())
    found = digests(folder, "results/[!.]*/*", "results/[!.]*/figures/*")
    return {name: digest for name, digest in found.items() if not name.endswith("run.json")}


def of_sweep(folder: Path) -> dict[str, str]:
    """The parts, which are the finished runs, and what is made of them."""
    made = ("table.*", "runs.parquet", "figures/*.svg", "runs/[!.]*/*.parquet")
    return digests(folder, *(f"results/[!.]*/{name}" for name in (*made, "parts/[!.]*")))


def kill_all(process: subprocess.Popen[bytes], rng: random.Random) -> None:
    """The whole group, or the main process alone, whose workers then end by themselves."""
    if rng.random() < 0.5:
        os.killpg(process.pid, signal.SIGKILL)
    else:
        process.kill()
    process.wait()


@contextlib.contextmanager
def started(victim: Victim, folder: Path) -> Iterator[subprocess.Popen[bytes]]:
    process = subprocess.Popen(
        [sys.executable, "-m", "genie_sim", *victim.command],
        cwd=folder,
        stdout=subprocess.DEVNULL,
        stderr=(folder / "stderr").open("w"),
        start_new_session=True,
        env={**os.environ, "PYTHONPATH": str(REPOSITORY)},
    )
    try:
        yield process
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def prepare(folder: Path) -> Path:
    folder.mkdir()
    (folder / "mine.yaml").write_text(SCENARIO)
    (folder / "s.yaml").write_text(SWEEP)
    return folder


def undisturbed(victim: Victim, folder: Path) -> dict[str, str]:
    """What comes of it when nobody disturbs it; and how long it takes."""
    begun = time.monotonic()
    with started(victim, prepare(folder)) as process:
        assert process.wait() == 0, (victim.command, (folder / "stderr").read_text())
    victim.took_s = time.monotonic() - begun
    return {name: digest for name, digest in victim.whole(folder).items() if "/parts/" not in name}


def torment(victim: Victim, folder: Path, kills: int, rng: random.Random) -> None:
    """Kills it so many times. When an attempt gets through, a sweep begins anew; a run replaces its
    own result.
    """
    expected = undisturbed(victim, folder / f"{victim.name} alone")
    here = prepare(folder / victim.name)
    for number in range(kills):
        before = victim.whole(here)
        after_s = rng.uniform(0.0, 1.1 * victim.took_s)
        with started(victim, here) as process:
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(after_s)
            if process.poll() is None:
                kill_all(process, rng)
                victim.kills += 1
        after = victim.whole(here)
        kept = [name for name in before if "/parts/" in name or victim.whole is of_run]
        victim.lost += sum(after.get(name) != before[name] for name in kept)
        if victim.whole is of_sweep and expected.keys() <= after.keys():
            here = prepare(folder / f"{victim.name} {number}")
    with started(victim, here) as process:
        assert process.wait() == 0, (victim.command, (here / "stderr").read_text())
    made = victim.whole(here)
    victim.other += sum(made.get(name) != digest for name, digest in expected.items())
    victim.left += len(
        [path for path in (here / "results").rglob(".*") if path.name != ".gitignore"]
    )


def main(arguments: list[str] | None = None) -> int:
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--kills", type=int, default=100)
    asked.add_argument("--only", nargs="*", default=["run", "seeds", "sweep", "reproduce"])
    asked.add_argument("--seed", type=int, default=SEED)
    given = asked.parse_args(arguments)
    rng = random.Random(given.seed)
    evaluation = ["reproduce", "--quick", "--seeds", "1", "--jobs", "2"]
    victims = [
        Victim("run", ["run", "mine.yaml"], of_run, 50),
        Victim("seeds", ["run", "mine.yaml", "--seeds", "3", "--jobs", "2"], of_sweep, 20),
        Victim("sweep", ["sweep", "s.yaml", "--jobs", "2"], of_sweep, 30),
        Victim("reproduce", evaluation, of_run, 6),
    ]
    victims = [victim for victim in victims if victim.name in given.only]
    shares = sum(victim.share for victim in victims)
    print("| command | kills | lost or changed | other than undisturbed | left behind |")
    print("|---|---:|---:|---:|---:|")
    with tempfile.TemporaryDirectory() as scratch:
        for victim in victims:
            torment(victim, Path(scratch), round(given.kills * victim.share / shares), rng)
            numbers = (victim.kills, victim.lost, victim.other, victim.left)
            print(f"| {victim.name} | " + " | ".join(map(str, numbers)) + " |", flush=True)
    return int(any(victim.lost + victim.other + victim.left for victim in victims))


if __name__ == "__main__":
    sys.exit(main())
