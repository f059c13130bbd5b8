"""A straight street with parked cars, driven at constant speed: a trace without any real data.

With it comes what turns it into a run: scenarios, devices whose service times are fixed, and the
tables of a method.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from genie_sim.base.settings import from_plain
from genie_sim.core.messages import CameraPose, Detection
from genie_sim.data.sources import RecordedDrives
from genie_sim.data.trace import Trace, TraceFrame
from genie_sim.record.log import Log
from genie_sim.record.records import Tables, new_tables
from genie_sim.runs import build as construction
from genie_sim.runs.prepare import prepare
from genie_sim.scenario.profiles import DeviceProfile
from genie_sim.scenario.reading import read_scenario
from genie_sim.scenario.scenario import Scenario
from genie_sim.sim.world import World

FOV_RAD = math.radians(81.4)


def street(
    seconds: float = 6.0,
    speed_mps: float = 5.0,
    rate_hz: int = 10,
    recordings: tuple[str, ...] = ("02", "03"),
) -> Trace:
    """Drives east along y = 0; a car is parked every 8 m at y = 4 m, seen with a score that falls
    with distance.
    """
    frames = {}
    for number, recording in enumerate(recordings):
        frames[recording] = tuple(
            _frame(recording, i, i / rate_hz * speed_mps, 0.5 * number, rate_hz)
            for i in range(round(seconds * rate_hz))
        )
    return Trace("street", (49.0, 8.4, 110.0), frames, {"made_by": "tests"})


def _frame(recording: str, index: int, east_m: float, north_m: float, rate_hz: int) -> TraceFrame:
    found = []
    for parked in range(-5, 60):
        location = (parked * 8.0, 4.0, 0.8)
        ahead_m, left_m = location[0] - east_m, location[1] - north_m
        if 4.0 < ahead_m < 40.0 and abs(math.atan2(left_m, ahead_m)) < FOV_RAD / 2:
            score = max(0.3, 0.9 - ahead_m / 80)
            found.append(Detection("car", score, (0.0, 0.0, 10.0, 10.0), location, score, "scan"))
    pose = CameraPose(east_m, north_m, 1.6, 0.0)
    digest = f"{recording}-{index}"
    return TraceFrame(
        recording,
        index,
        index * 1_000_000_000 // rate_hz,
        1242,
        375,
        1_397_297,
        digest,
        index,
        pose,
        FOV_RAD,
        tuple(found),
    )


def scenario(cars: int | Sequence[Mapping[str, Any]] = 1, **settings: Any) -> Scenario:
    """Cars as in YAML, or so many TX2 cars with an edge each; edges are AGX Xaviers unless
    ``settings`` say so.
    """
    if isinstance(cars, int):
        cars = [
            {"name": f"car{i}", "device": "jetson_tx2", "edge": f"edge{i}"}
            for i in range(1, cars + 1)
        ]
    names = sorted({car["edge"] for car in cars if car.get("edge") is not None})
    edges = [{"name": name, "device": "agx_xavier"} for name in names]
    return read_scenario(
        {"name": "street", "edges": edges, "cars": [dict(car) for car in cars], **settings}
    )


def fixed_device(
    name: str,
    *,
    detector: str,
    genie: str = "9 ms",
    hop: str = "0.3 ms",
    per_megabyte: str = "2 ms",
    cores: int = 4,
) -> DeviceProfile:
    """A computer on which everything always takes the same time (written as in YAML)."""

    def given(value: Any) -> dict[str, Any]:
        return {"value": value, "tag": "A", "source": "test"}

    always = {"loc": 1.0, "sigma": 0.0, "tag": "A", "source": "test"}
    return from_plain(
        DeviceProfile,
        {
            "name": name,
            "title": name,
            "cores": given(cores),
            "hop": {"small": given(hop), "per_megabyte": given(per_megabyte)},
            "genie": {"median": given(genie), "spread": always},
            "spreads": {"isolated": always, "default": always, "loaded": always},
            "models": {
                "autoware_vision_detector": {"median": detector, "tag": "A", "source": "test"}
            },
        },
    )


def build(
    setting: Scenario,
    method: str,
    trace: Trace | None = None,
    devices: Mapping[str, DeviceProfile] | None = None,
    tables: Tables | None = None,
    sent: Trace | None = None,
) -> tuple[World, Tables]:
    """The world of one method, by the name of its entry, ready to run, and the tables that it will
    fill.

    ``sent`` is the trace as its pictures are after being encoded as the scenario says.
    """
    recordings = RecordedDrives(trace if trace is not None else street())
    if sent is not None:
        recordings._encoded[None, setting.image_encoding] = sent
    prepared = prepare(setting, None, devices, recordings)
    entry = next(entry for entry in setting.methods if entry.name == method)
    tables = tables if tables is not None else new_tables()
    return World(construction.setup(prepared, entry), entry.new(), Log(method, tables)), tables


def drive(
    setting: Scenario,
    trace: Trace | None = None,
    devices: Mapping[str, DeviceProfile] | None = None,
    sent: Trace | None = None,
) -> dict[str, pd.DataFrame]:
    """Runs every method of the scenario. The tables by name: frames, lookups, resources."""
    tables = new_tables()
    for method in setting.methods:
        build(setting, method.name, trace, devices, tables, sent)[0].run()
    return {name: tables[name].to_frame() for name in ("frames", "lookups", "resources")}
