"""How often the recommended Genie should look at a view of real cameras: `every`.

    GENIE_SIM_KITTI=... python -m studies.pace

Declared before any of it was run:

- *Cameras*: real streams alone. Drive 2011_09_26/0005 has recordings 02 and 03, 25 ms apart; the
  tracking sequences have published detections in 02 alone, one camera a car.
- *Candidates*: 50, 75, 100, 125 and 150 ms; everything else is the preset.
- *Development data*: drive 0005 over Ethernet (raw), 5G (JPEG 80) and LTE (JPEG 80); the tracking
  sequences 0003, 0005, 0006, 0007, 0009, 0014 to 0017 and 0019 over Ethernet (raw) and 5G (86 kB
  pictures). Three cars each, as in ``3car_recommended``; seeds 1 and 2.
- *Rule*: the highest mean of streaming F1, where the conditions and seeds of a drive are averaged
  first, then the drives. 75 ms, the default so far, stays if it is within .002 of the highest.

Means are in ``results/pace/f1.csv``, a row for each drive.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd

import genie_sim as gs
from studies.where_it_pays import sequences

OUT = Path("results/studies/pace")
MEANS = Path("results/pace/f1.csv")
EVERY_MS = (50, 75, 100, 125, 150)
USUAL_MS, NEAR = 75, 0.002
SEQUENCES = ("0003", "0005", "0006", "0007", "0009", "0014", "0015", "0016", "0017", "0019")
SEEDS = (1, 2)


def on(link: str) -> dict[str, Any]:
    """The cars' link to their edges."""
    return {"cars[*].link": link}


DRIVE: dict[str, dict[str, Any]] = {
    "drive 0005, Ethernet, raw": {},
    "drive 0005, 5G, JPEG 80": {**on("nr5g"), "image_encoding": "jpeg80"},
    "drive 0005, LTE, JPEG 80": {**on("lte"), "image_encoding": "jpeg80"},
}


def methods() -> list[dict[str, Any]]:
    """The recommended Genie at each pace."""
    return [{"name": f"{ms}", "method": "recommended", "every": f"{ms} ms"} for ms in EVERY_MS]


def means() -> pd.DataFrame:
    """Streaming F1 of each drive (rows) at each pace (columns)."""
    runs = gs.sweep(
        "3car_recommended",
        {"condition": {"list": DRIVE | sequences(SEQUENCES)}},
        {"methods": methods(), "record": ["held"]},
        seeds=SEEDS,
        out=OUT,
    ).every_run
    f1 = runs[(runs["metric"] == "streaming_f1") & (runs["component"] == "")]
    drives = f1["condition"].str.partition(",")[0].rename("drive")
    return f1.pivot_table("value", drives, "method", aggfunc="mean")[[str(ms) for ms in EVERY_MS]]


def chosen(f1: pd.DataFrame) -> int:
    """The pace [ms] that the rule says."""
    over_drives = f1.mean()
    best = str(over_drives.idxmax())
    stays = over_drives[str(USUAL_MS)] >= over_drives[best] - NEAR
    return USUAL_MS if stays else int(best)


def main() -> None:
    """Simulates all paces, keeps their means and says which the rule chooses."""
    f1 = means()
    MEANS.parent.mkdir(parents=True, exist_ok=True)
    f1.round(4).to_csv(MEANS)
    print(f1.round(3).to_string(), f1.mean().round(4).to_string(), sep="\n\n")
    print(f"looks.every: {chosen(f1)} ms")


if __name__ == "__main__":
    main()
