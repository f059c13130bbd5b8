"""Makes the laws of the town's detector again: fits them on the real trace, judged by KITTI's
labels.

    GENIE_SIM_KITTI=... python tools/make/town_laws.py [--out genie_sim/worlds/scene/laws.json]
    GENIE_SIM_KITTI=... python tools/make/town_laws.py --compare

The second compares the laws as they are with the real detector and its trace, and writes nothing.
Only fitted numbers are written, with their provenance; KITTI's labels stay where they are.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from genie_sim.base import files
from genie_sim.base.classes import GROUPS
from genie_sim.base.units import NS_PER_S
from genie_sim.data.kitti.drive_truth import read_labels
from genie_sim.data.kitti.perceive import kitti_folder
from genie_sim.data.trace import Trace, read_trace
from genie_sim.worlds.scene.laws import FittedLaws, synthetic_laws
from genie_sim.worlds.town import Town, TownRules
from tools.make.town_fit import validation
from tools.make.town_fit.fit import Look, fit, found_law, looks, place_law

LAWS = Path(__file__).resolve().parents[2] / "genie_sim" / "worlds" / "scene" / "laws.json"
TRACE, LABELS, GHOST_LABELS = "kitti_0005", "2011_09_26/0005", "tracking/0000"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--out", type=Path, default=LAWS)
    parser.add_argument("--compare", action="store_true", help="fit nothing: compare")
    arguments = parser.parse_args()
    trace = read_trace(files.find(files.TRACE, TRACE))
    root = kitti_folder(None)
    if arguments.compare:
        judged = looks(trace, read_labels(root, LABELS, trace))
        print(validation.table(synthetic_laws(), judged))
        print(held_out(judged["vehicles"]))
        print(compared_frames(trace))
        return
    laws = fit(trace, read_labels(root, LABELS, trace), read_labels(root, GHOST_LABELS, trace))
    kept = ("data", "drive", "drive_sha256", "detector", "weights_sha256")
    laws["provenance"] = {
        "made_by": "tools/make/town_laws.py",
        "trace": TRACE,
        "trace_digest": trace.digest,
        "labels": {"objects": LABELS, "ghosts": GHOST_LABELS},
        **{name: trace.provenance[name] for name in kept},
        "licence": "CC BY-NC-SA 3.0, as a work derived from KITTI",
    }
    arguments.out.write_text(json.dumps(laws, indent=1, sort_keys=True) + "\n", encoding="utf-8")
    for kind in ("groups", "ghosts"):
        for name, group in laws[kind].items():
            print(
                kind,
                name,
                {
                    key: group[key]
                    for key in group
                    if key.endswith(("_correlation", "places", "_frame"))
                },
            )


def held_out(rows: list[Look]) -> str:
    """Vehicles by the laws of others: fitted on every second one, held against the rest, and the
    other way round.
    """
    tracks = sorted({look.track for look in rows})
    text = [
        "| vehicles, held out | found, real | found, town | score | along | across |",
        "|---|---|---|---|---|---|",
    ]
    for half in (0, 1):
        known = [look for look in rows if tracks.index(look.track) % 2 == half]
        other = [look for look in rows if tracks.index(look.track) % 2 != half]
        fitted = json.loads(LAWS.read_text(encoding="utf-8"))
        fitted["groups"]["vehicles"] |= {
            "found": found_law("vehicles", known),
            "place": place_law("vehicles", known),
        }
        laws = FittedLaws(fitted)
        made = [
            look
            for seed in range(40)
            for look in validation.resimulate(laws, "vehicles", other, seed)
        ]
        figures = [validation.found_share(other), validation.found_share(made)]
        figures.append(validation.distance(validation.scores(other), validation.scores(made)))
        errors = [
            (validation.errors(other, name), validation.errors(made, name))
            for name in ("along_m", "across_m")
        ]
        figures += [validation.distance(*pair) for pair in errors]
        text.append(
            f"| {len({look.track for look in other})} | "
            + " | ".join(f"{x:.2f}" for x in figures)
            + " |"
        )
    return "\n".join(text) + "\n"


def compared_frames(trace: Trace) -> str:
    """How much the frames show: of the trace, and of 40 cars in each of six towns (seeds 0 to 5) of
    the usual rules.
    """
    towns = [Town(TownRules(), seed) for seed in range(6)]
    drives = [town.drive(f"car{k}", 40 * NS_PER_S) for town in towns for k in range(40)]
    made = [frame for drive in drives for frame in drive.frames["02"][::50]]
    real = [*trace.by_picture.values()]
    text = [
        "| detections | trace, a frame | town, a frame | number | range | score |",
        "|---|---|---|---|---|---|",
    ]
    for what, labels in {**GROUPS, "bicycles": ("bicycle",)}.items():
        found = [
            [[d for d in f.detections if d.label in labels] for f in frames]
            for frames in (real, made)
        ]
        numbers = [list(map(len, one)) for one in found]
        scores = [[d.score for here in one for d in here] for one in found]
        ranges_m = [
            [
                math.dist(frame.pose[:2], d.location[:2])
                for frame, here in zip(frames, one, strict=True)
                for d in here
                if d.location
            ]
            for frames, one in zip((real, made), found, strict=True)
        ]
        means = [f"{sum(one) / len(one):.2f}" for one in numbers]
        distances = [f"{validation.distance(*pair):.2f}" for pair in (numbers, ranges_m, scores)]
        text.append(f"| {what} | {' | '.join(means + distances)} |")
    return "\n".join(text) + "\n"


if __name__ == "__main__":
    main()
