"""Which cache to build, and at what price: the study behind docs/which-cache.md.

    GENIE_SIM_KITTI=... python -m studies.which_cache [SEARCH ...]

Runs the searches of this folder, all or those that are named, and keeps what they report in
``results/which_cache``: ``designs.csv`` and ``differences.csv``. What is there already is not
simulated again. ``streets`` needs ``python -m studies.where_it_pays traces`` first, ``pairs`` needs
``python -m studies.real_pairs traces`` first and is left out unless it is named.

Declared before any of it was run:

- *Budget*: 16 points for each method and condition, one tuning seed, the same objectives.
- *Cameras*: real streams alone, two a car on drive 2011_09_26/0005, one on tracking sequences.
- *Chosen on*: drive 0005 under seed 1; ten tracking sequences; a town under seed 1.
- *Reported on*: the four tracking sequences that nothing was chosen on; towns of seeds 201 to 205.
  Drive 0005 is the only one with pictures: its conditions are reported under seeds 2 to 4, which
  says nothing about other streets.
- *Compared*: of each method the design with the best streaming F1 on the tuning set.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pandas as pd

HERE = Path("studies/which_cache")
OUT = Path("results/studies/which_cache")
KEPT = Path("results/which_cache")
NEEDS_V2V4REAL = "pairs"


def main(searches: list[str]) -> None:
    """Runs these searches, or all that need no data but KITTI's, and keeps their tables."""
    every = sorted(path.stem for path in HERE.glob("*.yaml"))
    for name in searches or [name for name in every if name != NEEDS_V2V4REAL]:
        command = ["search", str(HERE / f"{name}.yaml"), "--out", str(OUT)]
        subprocess.run([sys.executable, "-m", "genie_sim", *command], check=True)
    KEPT.mkdir(parents=True, exist_ok=True)
    for table in ("designs", "differences"):
        found = {path.parent.name: pd.read_csv(path) for path in OUT.glob(f"*/{table}.csv")}
        kept = pd.concat({name: found[name] for name in every if name in found}, names=["search"])
        kept.droplevel(1).round(4).to_csv(KEPT / f"{table}.csv")


if __name__ == "__main__":
    main(sys.argv[1:])
