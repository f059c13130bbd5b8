"""Share features or objects, and with whom: the study behind docs/what-to-share.md.

    python -m studies.what_to_share messages|methods

``messages``: three cars tell a roadside unit, and each other where they can, something of every
frame. ``methods``: methods that share in different ways answer the same frames. The tables go to
``results/what_to_share/STEP.csv``. The methods of ``examples/`` are used as they stand there.

Declared before any of it was run:

- *Messages*: 59.5 kB, the leanest features of CooperScene (arXiv 2606.31219); 10.9 kB, the objects
  of RAO (2023); 1.2 kB, a CPM of 30 objects (121 bytes and 35 an object, as the literature on ETSI
  TS 103 324 counts). One for each frame, ten a second.
- *Ways*: a link of 1.6 Mbit/s from each car to the roadside unit, what CooperScene measured of
  commercial C-V2X, with the queue of one message that it leaves out; and one channel that all four
  share (``sidelink``: 6 Mbit/s). Without a queue a message takes bytes x 8 / rate.
- *Told of each*: the share of messages that arrive, their mean delay from the frame on, and the
  channel busy ratio. Towns of seeds 1 to 5, 20 s; 95 % t intervals over them.
- *Methods*: local, remote and paced remote execution, each with a tracker; the recommended Genie;
  and the examples ``cpm``, ``autocast``, ``livemap`` and ``track_or_detect`` with their default
  settings. Those with a tracker and the Genie have the settings that ``where_it_pays`` chose on
  other towns. Nothing is chosen here.
- *Where*: towns of seeds 301 to 305, twelve cars, 5G; recorded traffic (``sumo_grid``), seeds 1 to
  5, 5G. Both with a ``sidelink`` of 300 m. ``replicated`` needs cars with two uplinks and
  ``vcache`` pictures with features, which neither has: their pages compare them elsewhere. Pairs of
  real cars need V2V4Real, which is not part of the project.
- *Told of each*: streaming F1 and its difference to the method without Genie that is best in the
  mean (local, remote or paced remote), time to the first answer, bytes up per frame, mean channel
  busy ratio; 95 % t intervals over towns, or seeds of the traffic.
"""

from __future__ import annotations

import os
import sys
from collections import defaultdict
from pathlib import Path
from typing import Any

import pandas as pd

import genie_sim as gs
from genie_sim.analysis.statistics import over_seeds
from genie_sim.core.messages import Effect, Header, Image, Message, Publish
from genie_sim.sim.method import (
    IMAGES,
    LOCAL,
    OBJECTS,
    HostConfig,
    HostContext,
    Interceptor,
    Method,
    Uplink,
)

ROOT = Path(__file__).resolve().parent.parent
KEPT = ROOT / "results" / "what_to_share"
SIZES = {"features, 59.5 kB": 59_500, "objects, 10.9 kB": 10_900, "CPM, 1.2 kB": 1_171}
C_V2X = {"like": "ideal", "rate_up": "1.6 Mbit/s", "rate_down": "1.6 Mbit/s"}
CROSSING = {
    "name": "crossing",
    "perception": {"source": "town", "duration": "20 s", "town": {"blocks": [1, 1]}},
    "cameras": [{"name": "camera_02", "recording": "02", "size": "90 kB"}],
    "edges": [{"name": "roadside", "device": "agx_xavier", "at": ["0 m", "0 m"]}],
    "cars": [
        {"name": f"car{number}", "device": "jetson_tx2", "edge": "roadside", "link": C_V2X}
        for number in (1, 2, 3)
    ],
    "broadcast": "sidelink",
    "record": ["resources"],
}
TOLD = "/told"
GENIE = "genie_recommended"
TRACKERS = ("local_tracker", "remote_tracker", "paced_tracker")
TRACKER = {"name": "tracker", "p_min": 0.8, "tau": "0 ms"}
METHODS: list[dict[str, Any]] = [
    {"name": "local_tracker", "method": "local", "consumer": TRACKER},
    {
        "name": "remote_tracker",
        "method": "remote",
        "consumer": TRACKER | {"p_min": 0.9, "tau": "100 ms"},
    },
    {"name": "paced_tracker", "method": "paced_remote", "consumer": TRACKER},
    {"name": GENIE, "method": "genie", "genie": "recommended"},
    {"name": "cpm", "method": "cpm:CPM"},
    {"name": "autocast", "method": "autocast:AutoCast"},
    {"name": "livemap", "method": "livemap:LiveMap"},
    {"name": "track_or_detect", "method": "track_or_detect:TrackOrDetect"},
]
PLACES: dict[str, tuple[str, dict[str, Any], range]] = {
    "town": ("town_recommended", {}, range(301, 306)),
    "traffic": (
        "town_recommended",
        {
            "perception": {
                "source": "traffic",
                "fcd": "sumo_grid",
                "begin": "60 s",
                "duration": "8 s",
                "equipped": 0.2,
            },
            "fleet.cars": None,
        },
        range(1, 6),
    ),
}

arrived: dict[tuple[str, str], list[float]] = defaultdict(list)  # delays [ms], by sender and host


class Tell(Method):
    """Every frame of a car becomes one message to all others, on the air or up to the edge."""

    title = "tell"

    def __init__(self, size_bytes: int, way: str = "broadcast") -> None:
        self._size_bytes = size_bytes
        self._way = way

    def on_car(self, host: HostContext) -> HostConfig:
        topics = (TOLD,) if self._way == "broadcast" else ()
        uplink = Uplink(TOLD, OBJECTS) if self._way == "link" else None
        node = Teller(host.name, self._size_bytes)
        return HostConfig(interceptor=lambda *_: node, broadcast=topics, uplink=uplink)

    def on_edge(self, host: HostContext) -> HostConfig:
        topics = (TOLD,) if self._way == "broadcast" else ()
        return HostConfig(interceptor=lambda *_: Teller(host.name, 0), broadcast=topics)


class Teller(Interceptor):
    """Tells of its own frames, and notes when others' messages arrive."""

    def __init__(self, host: str, size_bytes: int) -> None:
        self.name = f"{host}/teller"
        self._host, self._size_bytes = host, size_bytes

    def subscriptions(self) -> tuple[str, ...]:
        return IMAGES, TOLD

    def publications(self) -> tuple[str, ...]:
        return OBJECTS, TOLD, IMAGES + LOCAL

    def on_message(
        self, topic: str, message: Message, now_ns: int, sender: str | None = None
    ) -> list[Effect]:
        header: Header = message.header
        if header.origin != self._host:
            arrived[header.origin, self._host].append((now_ns - header.stamp_ns) / 1e6)
            return []
        assert isinstance(message, Image)
        told = Image(header, self._size_bytes, "", 0, message.pose, message.horizontal_fov_rad)
        return [Publish(TOLD, told)]


def messages() -> None:
    """What becomes of messages of each size on each way."""
    rows = []
    for way in ("link", "broadcast"):
        for title, size_bytes in SIZES.items():
            runs = [told(way, size_bytes, seed) for seed in range(1, 6)]
            row: dict[str, Any] = {"way": way, "message": title, "bytes": size_bytes}
            row["without_queue_ms"] = size_bytes * 8 / 1.6e6 * 1e3 if way == "link" else None
            for name in runs[0]:
                row |= _interval(name, [run[name] for run in runs])
            rows.append(row)
    _keep("messages", pd.DataFrame(rows).set_index(["way", "message"]))


def told(way: str, size_bytes: int, seed: int) -> dict[str, float]:
    """One run: the share of messages that arrived, their mean delay [ms], and how busy the channel
    was.
    """
    arrived.clear()
    method = {"name": "tell", "method": f"{__name__}:Tell", "size": f"{size_bytes} B", "way": way}
    run = gs.run(CROSSING | {"methods": [method], "seed": seed})
    frames = run.frames.groupby("car").size()
    pairs = len(frames) if way == "link" else len(frames) * len(frames)
    delays = [delay for of_pair in arrived.values() for delay in of_pair]
    return {
        "arrived": len(delays) / (frames.mean() * pairs),
        "delay_ms": sum(delays) / max(len(delays), 1),
        "channel_busy": _channel_busy(run.metrics) if way == "broadcast" else float("nan"),
    }


def methods() -> None:
    """How well each method answers, by place."""
    os.chdir(ROOT / "examples")  # where its classes are found
    rows = []
    for place, (scenario, changed, seeds) in PLACES.items():
        by_seed = [_answers(scenario, changed, seed) for seed in seeds]
        means = {name: _mean(by_seed, name, "streaming_f1") for name in TRACKERS}
        best = max(means, key=lambda name: means[name])
        for method in METHODS:
            name = method["name"]
            row: dict[str, Any] = {"place": place, "method": name, "best": best}
            gains = [run[name]["streaming_f1"] - run[best]["streaming_f1"] for run in by_seed]
            row |= _interval("gain", gains)
            for metric in by_seed[0][name]:
                row |= _interval(metric, [run[name][metric] for run in by_seed])
            rows.append(row)
    _keep("methods", pd.DataFrame(rows).set_index(["place", "method"]))


def _answers(scenario: str, changed: dict[str, Any], seed: int) -> dict[str, dict[str, float]]:
    """The metrics of every method in one run, by method."""
    fixed = {"methods": METHODS, "broadcast": "sidelink", "record": ["held", "resources"]}
    run = gs.run(scenario, {**changed, **fixed, "seed": seed})
    metrics, found = run.metrics, {}
    whole = metrics[(metrics["placement"] == "all") & (metrics["component"] == "")]
    for method in METHODS:
        name = method["name"]
        rows = whole[whole["method"] == name].set_index("metric")["value"]
        found[name] = {
            "streaming_f1": float(rows["streaming_f1"]),
            "first_answer_ms": float(rows.get("first_answer_mean", float("nan"))),
            "bytes_up": float(rows.get("bytes_up_per_frame", float("nan"))),
            "channel_busy": _channel_busy(metrics[metrics["method"] == name]),
        }
    return found


def _channel_busy(metrics: pd.DataFrame) -> float:
    """The mean over hosts; 0 where nobody broadcasts."""
    rows = metrics[(metrics["metric"] == "utilization")]
    rows = rows[rows["component"].str.endswith(".channel")]
    return float(rows["value"].mean()) if len(rows) else 0.0


def _mean(by_seed: list[dict[str, dict[str, float]]], method: str, metric: str) -> float:
    return sum(run[method][metric] for run in by_seed) / len(by_seed)


def _interval(name: str, values: list[float]) -> dict[str, float]:
    """A mean with its interval."""
    mean, half = over_seeds(values)
    return {name: mean, f"{name}_low": mean - half, f"{name}_high": mean + half}


def _keep(step: str, table: pd.DataFrame) -> None:
    KEPT.mkdir(parents=True, exist_ok=True)
    table.round(4).to_csv(KEPT / f"{step}.csv")
    print(table.round(3).to_string())


STEPS = {step.__name__: step for step in (messages, methods)}

if __name__ == "__main__":
    STEPS[sys.argv[1]]()
