"""Does sharing between two real cars help? The study of docs/real-pairs.md, on V2V4Real.

    GENIE_SIM_V2V4REAL=... python -m studies.real_pairs traces|sharing|claims|bound

``traces`` makes what the others read, and must not be passed on. ``sharing`` is a sweep; its tables
and its page are in ``results/studies/real_pairs/sweep``, and what is there already is not simulated
again. ``claims`` tests four claims of the paper that replays of one drive cannot test. ``bound``
computes what a car could know if it had both cars' detections at once. docs/real-pairs.md has the
results.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

import genie_sim as gs
from genie_sim.analysis.statistics import over_seeds
from genie_sim.core.matching import near, pairs
from genie_sim.data import v2v4real
from genie_sim.data.trace import write_trace
from genie_sim.data.truth_table import path_beside, write_truth
from genie_sim.data.v2v4real import CarRecording
from genie_sim.paper.facts import Fact, facts_of, placed
from genie_sim.runs.folder import run_in_memory
from genie_sim.scenario.reading import read_scenario
from genie_sim.scenario.yaml_input import dump

OUT = Path("results/studies/real_pairs")
TUNING = ("train/0009", "train/0012", "train/0015", "train/0019")
HELD_OUT = ("train/0010", "train/0011", "train/0013", "val/0004", "val/0008")
SEQUENCES = tuple(sorted((*TUNING, *HELD_OUT)))
HARDWARE = {"paper": ("jetson_tx2", "agx_xavier"), "modern": ("orin_nano", "rtx_a4500")}
SCORES = (0.2, 0.3, 0.4)
SEEDS = (1, 2)
CARS = tuple(v2v4real.CARS)
METHODS: list[Any] = [
    "local",
    "remote",
    {"name": "local_tracker", "method": "local", "consumer": "tracker"},
    {"name": "remote_tracker", "method": "remote", "consumer": "tracker"},
    "genie",
    {"name": "genie_recommended", "method": "genie", "genie": "recommended"},
]
SHARING: dict[str, dict[str, Any]] = {
    "with": {},
    "without": {f"edges[{edge}].neighbours": [] for edge in range(2)},
}
SHOWN = (
    "streaming_f1",
    "object_recall",
    "ghost_share",
    "first_answer_p50",
    "bytes_up_per_frame",
    "bytes_down_per_frame",
    "energy_per_frame",
)
RANGE_M, REACH_M, OWN_M = 40.0, 2.0, 2.0


def paths_of(sequence: str, score: float) -> list[Path]:
    """Where the traces of both cars of a sequence are."""
    folder = OUT / "traces" / f"{sequence.replace('/', '_')}_{score:g}"
    return [folder / f"{car}.parquet" for car in CARS]


def base(sequence: str, cars: int = 2) -> dict[str, Any]:
    """A scenario of the first cars of a pair on the paper's hardware, the edges neighbours."""
    car_device, edge_device = HARDWARE["paper"]
    paths = [str(path) for path in paths_of(sequence, SCORES[0])]
    return {
        "name": "real_pair",
        "perception": {"trace": paths[0]},
        "start_jitter": "0 s",
        "cameras": [{"name": "lidar", "recording": v2v4real.SENSOR}],
        "edges": [{"name": f"edge{number}", "device": edge_device} for number in (1, 2)[:cars]],
        "cars": [
            {
                "name": car,
                "device": car_device,
                "edge": f"edge{number}",
                "route": {"trace": path},
            }
            for number, car, path in list(zip((1, 2), CARS, paths, strict=True))[:cars]
        ],
    }


def traces() -> None:
    """The traces and the truth of every sequence and lowest score, and the scenario."""
    for sequence, score in product(SEQUENCES, SCORES):
        pair = v2v4real.recordings(v2v4real.folder(None), sequence, min_score=score)
        for path, recording in zip(paths_of(sequence, score), pair.values(), strict=True):
            write_truth(path_beside(path), recording.truth)
            write_trace(path, recording.trace)
    (OUT / "pair.yaml").write_text(dump(base(SEQUENCES[0])), encoding="utf-8")


def sharing() -> None:
    """Every method with and without sharing, on every sequence, score and hardware."""
    recordings = {}
    for sequence, score in product(SEQUENCES, SCORES):
        paths = [str(path) for path in paths_of(sequence, score)]
        routes = {f"cars[{car}].route.trace": path for car, path in enumerate(paths)}
        recordings[f"{sequence} {score:g}"] = {"perception.trace": paths[0], **routes}
    hardware = {
        name: {
            f"{hosts}[{number}].device": device
            for hosts, device in zip(("cars", "edges"), devices, strict=True)
            for number in range(2)
        }
        for name, devices in HARDWARE.items()
    }
    axes = {
        "recording": {"list": recordings},
        "hardware": {"list": hardware},
        "sharing": {"list": SHARING},
    }
    settings = {"methods": METHODS, "record": ["held"]}
    table = gs.sweep(OUT / "pair.yaml", axes, settings, seeds=SEEDS, out=OUT)
    report(wide(table))


def wide(table: pd.DataFrame) -> pd.DataFrame:
    """A row for each sequence, score, hardware, sharing and method; a column for each metric."""
    rows = table[
        table["metric"].isin(SHOWN) & (table["component"] == "") & (table["placement"] == "all")
    ]
    keys = ["recording", "hardware", "sharing", "method"]
    metrics = rows.pivot_table("value", keys, "metric", sort=False).reset_index()
    recording = metrics.pop("recording").str.rsplit(" ", n=1)
    metrics["sequence"], metrics["score"] = recording.str[0], recording.str[1].astype(float)
    return pd.DataFrame(metrics)


def chosen(metrics: pd.DataFrame) -> pd.DataFrame:
    """The rows at the score with the best mean of streaming F1 on the tuning set, for each hardware
    and method; with sharing what was chosen without.
    """
    tuning = metrics[metrics["sequence"].isin(TUNING) & (metrics["sharing"] == "without")]
    means = tuning.groupby(["hardware", "method", "score"])["streaming_f1"].mean()
    best = means.groupby(["hardware", "method"]).idxmax().map(lambda key: key[2])
    keys = pd.MultiIndex.from_frame(metrics[["hardware", "method"]])
    is_best = metrics["score"].to_numpy() == best.reindex(keys).to_numpy()
    return metrics.loc[is_best]


def report(metrics: pd.DataFrame) -> None:
    """Means over the held-out sequences, and what sharing adds, with intervals over them."""
    rows = chosen(metrics)
    rows = rows[rows["sequence"].isin(HELD_OUT)]
    by = ["hardware", "method", "sharing"]
    columns = ["score", *(name for name in SHOWN if name in rows)]
    print(rows.groupby(by, sort=False)[columns].mean().round(3).to_string())
    for (hardware, method), group in rows.groupby(["hardware", "method"], sort=False):
        f1 = group.pivot_table("streaming_f1", "sequence", "sharing")
        print(f"{hardware}, {method}: sharing adds {interval(f1['with'] - f1['without'])}")


def interval(values: pd.Series) -> str:
    """The mean over sequences, and its 95 % t interval."""
    mean, half = over_seeds(values.tolist())
    return f"{mean:+.3f} ({mean - half:+.3f} to {mean + half:+.3f})"


def claims() -> None:
    """What four claims compare, over the sequences: each must be above 0."""
    rows = []
    for sequence in SEQUENCES:
        found = []
        for seed in SEEDS:
            facts = {}
            for cars in (1, 2):
                scenario = base(sequence, cars) | {"record": ["lookups", "resources"]}
                run = run_in_memory(read_scenario(scenario, seed=seed))
                frames, lookups, resources = (
                    run.tables[name] for name in ("frames", "lookups", "resources")
                )
                facts[cars] = facts_of(frames, lookups, resources)
            found.append(effects(facts))
        rows.append(pd.DataFrame(found).mean())
    for claim, effect in pd.DataFrame(rows).items():
        holds = f"holds in {(effect > 0).sum()} of {effect.count()} sequences"
        print(f"{claim}: {interval(effect.dropna())}, {holds}")


def effects(facts: Mapping[int, Mapping[Fact, float]]) -> dict[str, float]:
    """By claim, what must be above zero. C20 is three conditions, of which the least counts: the
    highest reuse in a window on cars is twice the mean, above that of one car, and early.
    """
    one, two = facts[1], facts[2]
    reuse = [
        np.nanmean([of[placed("object_reuse", where)] for where in ("car", "edge")])
        for of in (one, two)
    ]
    high = placed("image_reuse_high", "car")
    early = 1 / 3 - two[placed("image_peak_at", "car")]
    boost = placed("confidence_boost", "edge")
    twice = two[high] - 2 * two[placed("image_reuse", "car")]
    return {
        "C14": float(reuse[0] - reuse[1]),
        "C18": two[placed("image_reuse", "edge")] - two[placed("image_reuse", "car")],
        "C20": min(twice, two[high] - one[high], early),
        "C23": two[boost] - one[boost],
    }


def bound() -> None:
    """F1 of each car's own detections and of both cars' together, without delay."""
    gains: dict[float, list[float]] = {score: [] for score in SCORES}
    for sequence in SEQUENCES:
        pair = v2v4real.recordings(v2v4real.folder(None), sequence)
        for score in SCORES:
            own, both = (
                f1(sum(np.array(counted(pair, car, score, together)) for car in CARS))
                for together in (False, True)
            )
            gains[score].append(both - own)
    for score, gain in gains.items():
        print(f"score {score:g}: both cars' detections add {interval(pd.Series(gain))} to F1")


def f1(counts: Any) -> float:
    """Of the counts of objects known and there, known, and there."""
    right, known, real = counts.tolist()
    return float(2 * right / (known + real))


def places(pair: Mapping[str, CarRecording], car: str, score: float) -> list[list[Any]]:
    """What a car detects at each frame, by ``core.matching``."""
    return [
        [("car", *d.location[:2]) for d in frame.detections if d.location and d.score >= score]
        for frame in pair[car].trace.frames[v2v4real.SENSOR]
    ]


def counted(
    pair: Mapping[str, CarRecording], car: str, score: float, together: bool
) -> tuple[int, int, int]:
    """Of all frames of a car, alone or ``together`` with the other: objects known and there, known,
    and there.
    """
    (other,) = set(CARS) - {car}
    truth: dict[int, list[Any]] = {}
    for row in pair[car].truth.rows:
        truth.setdefault(row.frame, []).append(("car", row.east_m, row.north_m))
    counts = np.zeros(3, dtype=int)
    frames = pair[car].trace.frames[v2v4real.SENSOR]
    own, others = places(pair, car, score), places(pair, other, score)
    for frame, mine, theirs in zip(frames, own, others, strict=True):
        here = frame.pose[:2]
        known = list(mine)
        if together:
            matched = {j for _, _, j in pairs(near(mine, theirs, REACH_M), REACH_M)}
            known += [
                place
                for j, place in enumerate(theirs)
                if j not in matched and math.dist(place[1:], here) >= OWN_M
            ]
        known = [place for place in known if math.dist(place[1:], here) <= RANGE_M]
        there = truth.get(frame.index, [])
        real = [place for place in there if math.dist(place[1:], here) <= RANGE_M]
        counts += (len(pairs(near(known, real, REACH_M), REACH_M)), len(known), len(real))
    return tuple(counts.tolist())


STEPS = {step.__name__: step for step in (traces, sharing, claims, bound)}

if __name__ == "__main__":
    STEPS[sys.argv[1]]()
