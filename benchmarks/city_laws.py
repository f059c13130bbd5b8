"""Makes the laws of the town's detector again: fits them on the real trace, judged by KITTI's labels.

    GENIE_SIM_KITTI=... python benchmarks/city_laws.py [--out genie_sim/perception/city/laws.json]

Only fitted numbers are written, with their provenance; KITTI's labels stay where they are.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from genie_sim.experiment import files
from genie_sim.perception.city.fit import fit
from genie_sim.perception.perceive import kitti_folder
from genie_sim.perception.trace import read_trace
from genie_sim.perception.truth import read_truth

LAWS = Path(__file__).resolve().parent.parent / "genie_sim" / "perception" / "city" / "laws.json"
TRACE, LABELS, GHOST_LABELS = "kitti_0005", "2011_09_26/0005", "tracking/0000"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--out", type=Path, default=LAWS)
    arguments = parser.parse_args()
    trace = read_trace(files.find(files.TRACE, TRACE))
    root = kitti_folder(None)
    laws = fit(trace, read_truth(root, LABELS, trace), read_truth(root, GHOST_LABELS, trace))
    kept = ("data", "drive", "drive_sha256", "detector", "weights_sha256")
    laws["provenance"] = {
        "made_by": "benchmarks/city_laws.py",
        "trace": TRACE,
        "trace_digest": trace.digest,
        "labels": {"objects": LABELS, "ghosts": GHOST_LABELS},
        **{name: trace.provenance[name] for name in kept},
        "licence": "CC BY-NC-SA 3.0, as a work derived from KITTI",
    }
    arguments.out.write_text(json.dumps(laws, indent=1, sort_keys=True) + "\n", encoding="utf-8")
    for kind in ("groups", "ghosts"):
        for name, group in laws[kind].items():
            print(kind, name, {key: group[key] for key in group if key.endswith(("_correlation", "places", "_frame"))})


if __name__ == "__main__":
    main()
