"""Which cache to build, and at what price: the study behind docs/which-cache.md.

    GENIE_SIM_KITTI=... python -m studies.which_cache [SEARCH ...]

Runs the searches of this folder, all or those that are named. ``results/which_cache/designs.csv``
keeps every design that they report, ``compared.csv`` the one of each method that is compared. What
is there already is not simulated again. ``streets`` needs ``python -m studies.where_it_pays
traces`` first, ``pairs`` needs ``python -m studies.real_pairs traces`` first and is left out unless
it is named.

Declared before any of it was run:

- *Budget*: 16 points for each method and condition, one tuning seed, the same objectives.
- *Cameras*: real streams alone, two a car on drive 2011_09_26/0005, one on tracking sequences.
- *Chosen on*: drive 0005 under seed 1; the five shortest of ten development sequences; a town
  under seed 1.
- *Reported on*: the four tracking sequences that nothing was chosen on; towns of seeds 201 to 205.
  Drive 0005 is the only one with pictures: its conditions are reported under seeds 2 to 4, which
  says nothing about other streets.
- *Compared*: of each method the design with the best streaming F1 on the tuning set. The best
  other method is the one with the best mean on what is reported, which favours the others.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import pandas as pd

HERE = Path("studies/which_cache")
OUT = Path("results/studies/which_cache")
KEPT = Path("results/which_cache")
NEEDS_V2V4REAL = "pairs"
PRICES = ("bytes_up_per_frame", "accelerator_time/edge")


def main(searches: list[str]) -> None:
    """Runs these searches, or all that need no data but KITTI's, and keeps their tables."""
    every = sorted(path.stem for path in HERE.glob("*.yaml"))
    for name in searches or [name for name in every if name != NEEDS_V2V4REAL]:
        command = ["search", str(HERE / f"{name}.yaml"), "--out", str(OUT)]
        subprocess.run([sys.executable, "-m", "genie_sim", *command], check=True)
    done = [name for name in every if (OUT / name / "designs.csv").is_file()]
    kept = {
        "designs": [pd.read_csv(OUT / name / "designs.csv") for name in done],
        "compared": [compared(OUT / name) for name in done],
    }
    KEPT.mkdir(parents=True, exist_ok=True)
    for table, of_search in kept.items():
        rows = pd.concat(of_search, keys=done, names=["search", None]).droplevel(1)
        rows.round(4).to_csv(KEPT / f"{table}.csv")


def compared(folder: Path) -> pd.DataFrame:
    """Of each method that was tuned, the design with the best first objective on the tuning set;
    with the paired difference of the tuned Genie to it, of the Genie as it ships to itself.
    """
    designs = pd.read_csv(folder / "designs.csv").set_index("design")
    differences: Any = pd.read_csv(folder / "differences.csv")
    differences = differences.set_index(["metric", "design", "from"])
    points = pd.read_csv(folder / "points.csv")
    points = points[points["state"] == "COMPLETE"]
    points["design"] = points["method"] + "-" + points["number"].astype(str)
    points = points[points["design"].isin(designs.index)]
    objective = points.columns[3]
    best = points.loc[points.groupby("method")[objective].idxmax()].set_index("method")
    rows = []
    for method, point in best.iterrows():
        design = designs.loc[point["design"]]
        row = {"method": method, "design": point["design"], "tuning": point[objective]}
        row |= {"f1": design[objective], "low": design[f"{objective} low"]}
        row |= {"high": design[f"{objective} high"]}
        row |= {metric: design[metric] for metric in PRICES}
        if method not in ("genie", "as_it_ships"):
            gain = differences.loc[(objective, best.loc["genie", "design"], point["design"])]
            row |= {"gain": gain["value"], "gain low": gain["low"], "gain high": gain["high"]}
        rows.append(row)
    return pd.DataFrame(rows)


if __name__ == "__main__":
    main(sys.argv[1:])
