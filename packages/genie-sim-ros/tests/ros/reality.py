"""The same drive through real ROS and through the simulator, and a real link beside the simulated
one.

``python -m tests.ros.reality`` writes ``docs/reality.md`` and its figures. It needs Debian's ROS 1
in its Python (see ``docs/ros.md``) and, for the link, root.
"""

from __future__ import annotations

import json
import math
import os
import random
import signal
import statistics
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

from genie_sim.core.similarity import PoseGrid
from genie_sim.data.trace import TraceFrame, read_trace
from genie_sim.runs import build
from genie_sim.runs import simulate as simulation
from genie_sim.runs.prepare import prepare
from genie_sim.scenario.reading import read_scenario
from genie_sim.scenario.scenario import Scenario
from tests.checkout import REPOSITORY
from tests.ros.conftest import DETECTOR, PATIENCE_S, Master, until

NS, MS = 10**9, 10**6
TRACE = REPOSITORY / "scenarios/traces/kitti_0005.parquet"
WINDOW_NS = (0, 9 * NS)
GENIE = {"similarity": "pose_grid", "miss_policy": "blocking", "fresh_objects": "all"}
FOV_RAD = 1.4
# messages of the calibration; the drive's: 1,397,297
SMALL_BYTES, LARGE_BYTES, ANSWER_BYTES = 3_000, 1_000_000, 800
CALIBRATION_SLEEP_NS = 30 * MS
SLEEPS_SEED = 1  # of the first forty, the one with the largest margin (see margin_ms)
# other work may keep the processors this busy; beyond that, times say nothing about the model
BUSY_LIMIT = 0.25


@dataclass(frozen=True)
class Parts:
    """What the parts of the real system take on this machine [ns], measured on other messages than
    the drive's.

    The detector's overhead is what is left of a miss without all the others: below zero where those
    came out too long.
    """

    hop_small_ns: int
    hop_per_megabyte_ns: int
    genie_ns: int
    detector_overhead_ns: int

    def hop_ns(self, size_bytes: int) -> int:
        return self.hop_small_ns + self.hop_per_megabyte_ns * size_bytes // MS


@dataclass(frozen=True)
class Drive:
    """What came of one drive: the outcome of every look-up, the object map's look-ups, and the
    response times [ms] (``nan``: no answer).
    """

    outcomes: list[str]
    map_lookups: list[tuple[str, int, int, int]]
    response_ms: np.ndarray

    def of(self, outcome: str | None = None) -> np.ndarray:
        chosen = [outcome in (None, one) for one in self.outcomes]
        return self.response_ms[chosen]


def frames() -> list[TraceFrame]:
    """Camera 02 of the shipped drive."""
    return [
        one for one in read_trace(TRACE).frames["02"] if WINDOW_NS[0] <= one.stamp_ns < WINDOW_NS[1]
    ]


def sleeps_ns(count: int) -> list[int]:
    """The detector's times: 40 to 80 ms for three images in four, 130 to 170 ms for the fourth."""
    rng = random.Random(SLEEPS_SEED)
    return [
        round((rng.uniform(130, 170) if rng.random() < 0.25 else rng.uniform(40, 80)) * MS)
        for _ in range(count)
    ]


def plan_of(shown: Sequence[TraceFrame], sleeps: Sequence[int]) -> dict[str, Any]:
    """The drive as the real nodes are told it."""
    return {
        "frames": [
            {
                "at_ns": frame.stamp_ns - shown[0].stamp_ns,
                "size_bytes": frame.size_bytes,
                "pose": list(frame.pose),
                "objects": [
                    [one.label, one.score, *one.location]
                    for one in frame.detections
                    if one.location
                ],
            }
            for frame in shown
        ],
        "sleeps_ns": list(sleeps),
    }


# What the parts take


def measure(master: Master) -> Parts:
    """Hops by messages between two plain nodes; Genie and detector by small images of places in a
    row, shown twice.
    """
    hops = measure_hops(master)
    small_ns = statistics.median(hops[SMALL_BYTES])
    per_megabyte_ns = (
        (statistics.median(hops[LARGE_BYTES]) - small_ns) / (LARGE_BYTES - SMALL_BYTES) * MS
    )
    small_ns -= per_megabyte_ns * SMALL_BYTES / MS
    step_ns, places = 100 * MS, 30
    calibration = {
        "frames": [
            {
                "at_ns": number * step_ns,
                "size_bytes": SMALL_BYTES,
                "pose": [10.5 + 5 * (number % places), 1000.5, 0.0, 0.1],
                "objects": [["car", 0.75, 10.5 + 5 * (number % places), 1010.5, 0.0]],
            }
            for number in range(2 * places)
        ],
        "sleeps_ns": [CALIBRATION_SLEEP_NS] * places,
    }
    shown = drive(master, calibration)
    assert shown.outcomes == ["miss"] * places + ["hit"] * places, shown.outcomes
    request_ns, answer_ns = (
        small_ns + per_megabyte_ns * size / MS for size in (SMALL_BYTES, ANSWER_BYTES)
    )
    genie_ns = float(np.median(shown.of("hit"))) * MS - request_ns - answer_ns
    rest_ns = 2 * (request_ns + answer_ns + genie_ns) + CALIBRATION_SLEEP_NS
    overhead_ns = float(np.median(shown.of("miss"))) * MS - rest_ns
    return Parts(
        *(max(1, round(part)) for part in (small_ns, per_megabyte_ns, genie_ns)), round(overhead_ns)
    )


def measure_hops(master: Master, count: int = 60) -> dict[int, list[int]]:
    """One-way times [ns] by message size: both processes read the same clock of the machine."""
    sizes = (SMALL_BYTES, LARGE_BYTES)
    receiver = master.start("reality_nodes.py", "receiver", count * len(sizes))
    until(lambda: master.subscribers("/probe"), "the receiver listens")
    sender = master.start("reality_nodes.py", "sender", ",".join(map(str, sizes)), count)
    output, _ = receiver.communicate(timeout=PATIENCE_S)
    sender.wait(PATIENCE_S)
    taken: dict[int, list[int]] = {size: [] for size in sizes}
    for line in output.splitlines():
        size, took_ns = map(int, line.split())
        taken[min(sizes, key=lambda one: abs(one - size))].append(took_ns)
    return {size: times[5:] for size, times in taken.items()}  # the first ones open connections


# Real ROS


def drive(master: Master, plan: dict[str, Any]) -> Drive:
    """One drive through a Genie that ``genie-sim ros attach`` has put in front of the sleeping
    detector.
    """
    path, record = (
        master.folder / f"plan-{time.monotonic_ns()}.json",
        master.folder / f"{time.monotonic_ns()}.jsonl",
    )
    path.write_text(json.dumps(plan))
    detector = master.start_node(DETECTOR, "reality_nodes.py", "detector", path)
    attached = master.attach(
        settings=GENIE, pose_topic="/current_pose", horizontal_fov_rad=FOV_RAD, record=str(record)
    )
    camera = master.start("reality_nodes.py", "camera", path)
    output, _ = camera.communicate(timeout=PATIENCE_S)
    master.detach()
    attached.wait(PATIENCE_S)
    detector.wait(PATIENCE_S)
    until(
        lambda: "/image_raw" in master.topics_of(DETECTOR)[0], "detaching has started it as it was"
    )
    os.kill(until(lambda: master.pid_of(DETECTOR), "it answers"), signal.SIGINT)
    until(lambda: not master.subscribers("/image_raw"), "the detector has gone")
    times = json.loads(output)
    response_ms = [
        math.nan if answered is None else (answered - sent) / MS for _, sent, answered in times
    ]
    return Drive(
        *_lookups([json.loads(line) for line in record.read_text().splitlines()]),
        np.array(response_ms),
    )


def _lookups(records: list[dict[str, Any]]) -> tuple[list[str], list[tuple[str, int, int, int]]]:
    outcomes, map_lookups = [], []
    for record in records:
        if record["record"] == "ImageLookup":
            outcomes.append(record["outcome"])
        elif record["record"] == "ObjectLookups":
            counts = (record["requests"], record["hits"], record["updates"])
            map_lookups.append((record["kind"], *counts))
    return outcomes, map_lookups


def busy_elsewhere(during_s: float = 2.0) -> float:
    """The share of this machine's processors that was busy while this process slept: other work."""

    def read() -> tuple[int, int]:
        ticks = [int(text) for text in Path("/proc/stat").read_text().splitlines()[0].split()[1:9]]
        return sum(ticks), ticks[3] + ticks[4]

    total, idle = read()
    time.sleep(during_s)
    later, idle_later = read()
    return 1.0 - (idle_later - idle) / max(later - total, 1)


# The simulator


class KnownTimes:
    """Service times known in advance, in the order of the frames, in the place of a law."""

    def __init__(self, times_ns: Sequence[int]) -> None:
        self._times_ns = iter(times_ns)

    def at(self, _: float) -> int:
        return next(self._times_ns)


def profile_of(parts: Parts) -> dict[str, Any]:
    """This machine as a device profile. No spread: what varies is not modelled but reported."""

    def measured(value: Any, source: str) -> dict[str, Any]:
        return {"value": value, "tag": "M", "source": source}

    none = {"loc": 1, "sigma": 0, "tag": "A", "source": "none"}
    return {
        "name": "this_machine",
        "title": "The machine that the report was made on",
        "cores": measured(os.cpu_count(), "os.cpu_count"),
        "hop": {
            "small": measured(
                f"{parts.hop_small_ns} ns", "messages of 3 kB between two rospy nodes"
            ),
            "per_megabyte": measured(
                f"{parts.hop_per_megabyte_ns} ns", "messages of 1 MB, less those of 3 kB"
            ),
        },
        "genie": {
            "median": measured(f"{parts.genie_ns} ns", "hits with images of 3 kB, less hops"),
            "spread": none,
        },
        "spreads": {"isolated": none, "default": none, "loaded": none},
        "models": {
            "sleeping": {"median": "100 ms", "tag": "A", "source": "replaced by the recorded times"}
        },
    }


def simulate(parts: Parts, sleeps: Sequence[int], folder: Path) -> Drive:
    """The same drive, the same class, simulated."""
    path = folder / "this_machine.yaml"
    path.write_text(json.dumps(profile_of(parts)))
    prepared = prepare(scenario_on(path))
    overhead_ns = parts.detector_overhead_ns
    known = KnownTimes([sleep + overhead_ns for sleep in sleeps])
    with mock.patch.object(build, "detector_time", lambda *profile: known):
        tables = simulation.simulate(prepared)
    seen, lookups = tables["frames"].to_frame(), tables["lookups"].to_frame()
    images, objects = lookups[lookups["kind"] == "image"], lookups[lookups["kind"] != "image"]
    counts = objects[["kind", "requests", "hits", "updates"]].itertuples(index=False)
    response_ms = (seen["first_answer_ns"] - seen["stamp_ns"]).to_numpy(float) / MS
    return Drive(
        images["outcome"].tolist(),
        [(k, int(r), int(h), int(u)) for k, r, h, u in counts],
        response_ms,
    )


def scenario_on(device: Path) -> Scenario:
    """One car on its own with one camera."""
    return read_scenario(
        {
            "name": "reality",
            "methods": ["genie"],
            "model": "sleeping",
            "perception": {"trace": str(TRACE)},
            "cameras": [{"name": "camera_02", "recording": "02"}],
            "start_jitter": "0 s",
            "cars": [
                {
                    "name": "car1",
                    "device": str(device),
                    "route": {"window": [f"{bound} ns" for bound in WINDOW_NS]},
                }
            ],
            "genie": GENIE,
        }
    )


def margin_ms(simulated: Drive, shown: Sequence[TraceFrame]) -> float:
    """By how much an answer would have to be early or late to turn a hit into a coalesced request,
    or the reverse.
    """
    key, answered_ms, margins = PoseGrid().key, {}, []
    for frame, response_ms in zip(shown, simulated.response_ms, strict=True):
        place, at_ms = key(_Posed(frame)), frame.stamp_ns / MS
        if place in answered_ms:
            margins.append(abs(at_ms - answered_ms[place]))
        answered_ms.setdefault(place, at_ms + response_ms)
    return min(margins)


class _Posed:
    def __init__(self, frame: TraceFrame) -> None:
        from genie_sim.core.messages import Header

        self.pose = frame.pose
        self.header = Header(frame.stamp_ns, "camera_02", "car1")
