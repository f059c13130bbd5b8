"""What tests are made of: messages, traces, a street and its scenarios, and runs that nobody had to
simulate.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np
import pandas as pd

from genie_sim.analysis.metrics import compute
from genie_sim.base.settings import from_plain
from genie_sim.core.messages import CameraPose, Detection, Detections, Header, Image
from genie_sim.data.sources import RecordedDrives, Recording
from genie_sim.data.trace import Trace, TraceFrame
from genie_sim.record.columns import Columns
from genie_sim.record.log import Log
from genie_sim.record.open_frame import OpenFrame
from genie_sim.record.records import FRAMES, LOOKUPS, RESOURCES, Tables, new_tables
from genie_sim.record.results import MethodInfo, MetricValue, Run
from genie_sim.record.tables import Schema, Table
from genie_sim.runs import build as construction
from genie_sim.runs.prepare import prepare
from genie_sim.scenario.profiles import DeviceProfile
from genie_sim.scenario.reading import read_scenario
from genie_sim.scenario.scenario import Scenario
from genie_sim.sim.world import World

MS, S = 1_000_000, 1_000_000_000
FOV_RAD = math.radians(81.4)
KARLSRUHE = (49.0112, 8.4228, 112.8)

# Where frames are taken, all looking east; each its own cell of the pose grid, out of sight of the
# others.
CROSSING, BRIDGE, STATION = (0.5, 0.5), (500.5, 0.5), (1000.5, 0.5)

METHODS = (
    MethodInfo("local", "local (L)", baseline=True),
    MethodInfo("remote", "remote (R)", baseline=True),
    MethodInfo("genie", "Genie (DG)", baseline=False),
)
STREAMS = ("camera_00", "camera_01", "camera_02", "camera_03")
# Median service times [ms] of a TX2 (local) and an AGX Xavier (remote); how many streams a detector
# keeps up with.
DETECTOR_MS = {"local": 310.0, "remote": 65.0}
KEPT = {"local": 0.08, "remote": 0.37}


def frame(
    stamp_s: float,
    at: tuple[float, float] = CROSSING,
    car: str = "car1",
    camera: str = "02",
    heading_deg: float = 0.0,
) -> Image:
    """What ``car``'s camera shows at a place; the same picture from every car."""
    pose = CameraPose(at[0], at[1], 1.6, math.radians(heading_deg))
    picture = f"{at} {heading_deg}"
    return Image(
        Header(round(stamp_s * S), camera, car),
        1_000,
        picture,
        hash(at) & 0xFFFF,
        pose,
        math.radians(90.0),
    )


def seen(
    east_m: float | None = 20.0, north_m: float = 0.0, label: str = "car", score: float = 0.9
) -> Detection:
    """A detector's finding at a place of the ground plane, or one that could not be placed."""
    location = None if east_m is None else (east_m, north_m, 0.0)
    placement = "scan" if location else "none"
    return Detection(label, score, (10.0, 10.0, 50.0, 40.0), location, score, placement)


def answer(request: Image | Header, *objects: Detection, by: str = "detector") -> Detections:
    """What the encapsulated node says about a request."""
    header = request.header if isinstance(request, Image) else request
    return Detections(header, objects, "detector", by)


def trace_frame(camera="02", index=0, **changes):
    parked = Detection("car", 0.81, (10.0, 20.0, 60.0, 50.0), (5.0, 17.5, -0.5), 0.81, "scan")
    sign = Detection("stop sign", 0.35, (1.0, 2.0, 3.0, 4.0), None, 0.35, "none")
    values = {
        "camera": camera,
        "index": index,
        "stamp_ns": 103_380_000 * index,
        "width": 1242,
        "height": 375,
        "size_bytes": 1_397_297,
        "digest": f"{index:064x}",
        "dhash": 2**63 + index,
        "pose": CameraPose(index * 1.0, 2.0, 0.7, 1.5),
        "horizontal_fov_rad": 1.42,
        "detections": (parked, sign) if index % 2 == 0 else (),
    }
    return TraceFrame(**(values | changes))


def trace(**cameras):
    frames = cameras or {
        "02": tuple(trace_frame("02", i) for i in range(4)),
        "03": tuple(trace_frame("03", i) for i in range(3)),
    }
    return Trace(
        "kitti_0005",
        KARLSRUHE,
        frames,
        {"detector": "yolox_nano", "versions": {"onnxruntime": "1.20"}},
    )


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
            _street_frame(recording, i, i / rate_hz * speed_mps, 0.5 * number, rate_hz)
            for i in range(round(seconds * rate_hz))
        )
    return Trace("street", (49.0, 8.4, 110.0), frames, {"made_by": "tests"})


def _street_frame(
    recording: str, index: int, east_m: float, north_m: float, rate_hz: int
) -> TraceFrame:
    found = []
    for parked in range(-5, 60):
        location = (parked * 8.0, 4.0, 0.8)
        ahead_m, left_m = location[0] - east_m, location[1] - north_m
        if 4.0 < ahead_m < 40.0 and abs(math.atan2(left_m, ahead_m)) < FOV_RAD / 2:
            score = max(0.3, 0.9 - ahead_m / 80)
            found.append(Detection("car", score, (0.0, 0.0, 10.0, 10.0), location, score, "scan"))
    pose = CameraPose(east_m, north_m, 1.6, 0.0)
    return trace_frame(
        recording,
        index,
        stamp_ns=index * S // rate_hz,
        digest=f"{recording}-{index}",
        dhash=index,
        pose=pose,
        horizontal_fov_rad=FOV_RAD,
        detections=tuple(found),
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
        encoded = {setting.image_encoding: sent}
        recordings._recordings[None] = Recording(recordings.main, None, None, encoded)
    prepared = prepare(replace(setting, profiles=devices or setting.profiles), frames=recordings)
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


def row(schema: Schema, **cells: Any) -> tuple[Any, ...]:
    """A row of a table by its columns; the others are empty, or zero."""
    usual = {
        column.name: None if column.nullable else "" if column.kind == "text" else 0
        for column in schema.columns
    }
    assert cells.keys() <= usual.keys(), cells
    return tuple((usual | cells).values())


def table(schema: Schema, *rows: tuple[Any, ...]) -> Table:
    """A table of these rows."""
    made = Table(schema)
    for cells in rows:
        made.append(cells)
    return made


def frames(cars: int = 3, seconds: int = 10, seed: int = 1, speed: float = 1.0) -> Table:
    """Detectors drop what they cannot keep up with; Genie answers at once and fresh when the
    detection is there.

    ``speed`` divides the remote detector's time.
    """
    rng = np.random.default_rng(seed)
    table = Table(FRAMES)
    for method in ("local", "remote", "genie"):
        for car in range(1, cars + 1):
            for s, stream in enumerate(STREAMS):
                for frame in range(10 * seconds):
                    stamp_ns = (100 * frame + 25 * s) * MS
                    row = OpenFrame(method, Header(stamp_ns, stream, f"car{car}"), frame)
                    received_ns = stamp_ns + 3 * MS
                    row.received_ns = received_ns
                    if method == "genie":
                        _answer_by_genie(row, received_ns, rng, speed)
                    elif rng.random() < KEPT[method] * (speed if method == "remote" else 1):
                        fast = speed if method == "remote" else 1.0
                        took_ms = (
                            DETECTOR_MS[method]
                            / fast
                            * (0.85 + 0.15 * np.exp(0.6 * rng.standard_normal()))
                        )
                        _set(row, received_ns + int(took_ms * MS), "own_detector", rng.poisson(3))
                    else:
                        row.drop = f"{method}/detector:/image_raw"
                    table.append(row.values())
    return table


def _set(row: OpenFrame, t_ns: int, source: str, objects: int) -> None:
    for column in ("first_answer_ns", "fresh_answer_ns"):
        setattr(row, column, t_ns)
    for column in ("objects_served", "objects_fresh"):
        setattr(row, column, int(objects))
    row.source = source


def _answer_by_genie(
    row: OpenFrame, received_ns: int, rng: np.random.Generator, speed: float
) -> None:
    genie_ms = 8.8 * (0.6 + 0.4 * np.exp(0.5 * rng.standard_normal()))
    first_ns = received_ns + int(genie_ms * MS)
    hit = bool(rng.random() < 0.2)
    row.image_hit = hit
    row.coalesced = False
    if hit:
        _set(row, first_ns, "own_cache", rng.poisson(3))
        return
    row.first_answer_ns = first_ns
    row.source = "map"
    row.objects_served = int(rng.poisson(1))
    if rng.random() < 0.4 * speed:
        row.fresh_answer_ns = first_ns + int((20 + 65 / speed * rng.gamma(4, 0.3)) * MS)
        row.objects_fresh = int(rng.poisson(3))


def lookups(cars: int = 3, messages: int = 400, seed: int = 1, lift: float = 1.0) -> Table:
    """Genies on cars and edges; hits become more frequent as the caches fill. ``lift`` multiplies
    them.
    """
    rng = np.random.default_rng(seed)
    table = Table(LOOKUPS)
    for i in range(messages):
        t_ns = i * 25 * MS
        for car in range(1, cars + 1):
            for place, base in (("car", 0.06), ("edge", 0.1)):
                name, level = f"{place}{car}/genie", lift * (0.4 + 0.6 * i / messages)
                hit = bool(rng.random() < base * level)
                outcome, stream = "hit" if hit else "miss", STREAMS[i % 4]
                frame = f"car{car}", stream, t_ns
                what = "genie", t_ns, name, place
                table.append((*what, "image", "client", *frame, outcome, 1, int(hit), 0, 0.0, i))
                asked = 1 + int(rng.poisson(3))
                hits = int(rng.binomial(asked, min(4 * base * level, 1)))
                boost = 0.04 * hits * level * rng.random()
                table.append((*what, "sighting", None, *frame, None, asked, hits, hits, boost, i))
    return table


def resources(cars: int = 3, samples: int = 100) -> Table:
    """Saturated accelerators on the cars, edges half busy with Genie, links one third."""
    table = Table(RESOURCES)
    for method in ("local", "remote", "genie"):
        for i in range(1, samples + 1):
            t_ns = i * 100 * MS
            for car in range(1, cars + 1):
                serving = (
                    (f"car{car}.accelerator", "accelerator", 1 - 0.02 * car, i // 3, None),
                    (f"edge{car}.accelerator", "accelerator", 0.2 * car, i, None),
                    (f"car{car}->edge{car}", "link", 0.1 * car, i, i * 1_397_297),
                )
                for name, kind, busy, completed, carried in serving:
                    used = (1, int(busy * t_ns), 0, completed, 0, carried, 0, 0)
                    table.append((method, t_ns, name, kind, *used))
                name = f"car{car}/detector:/image_raw"
                waiting_ns = sum((k + car) % 3 * 100 * MS for k in range(1, i + 1))
                used = (None, 0, (i + car) % 3, i, 2 * i, None, waiting_ns, 2)
                table.append((method, t_ns, name, "queue", *used))
    return table


def tables(
    cars: int = 2, seconds: int = 3, seed: int = 1, lift: float = 1.0, speed: float = 1.0
) -> dict[str, pd.DataFrame]:
    """The three of a run, by name."""
    of_run = (
        frames(cars, seconds, seed, speed),
        lookups(cars, 40 * seconds, seed, lift),
        resources(cars, 10 * seconds),
    )
    return {table.name: table.to_frame() for table in of_run}


def run_of(
    measured: Sequence[MetricValue] | None = None,
    methods: Sequence[MethodInfo] = METHODS,
    tables: Mapping[str, pd.DataFrame | Columns] | None = None,
    label: str = "",
    **scenario: Any,
) -> Run:
    """A finished run with these tables, otherwise frames alone; with what they measure unless it is
    ``measured``. ``scenario`` is what else the record says of that.
    """
    tables = tables if tables is not None else {"frames": frames(2, 3).columns()}
    columns = {name: Columns.of(table) for name, table in tables.items()}
    usual = {"name": "street_3car_hetero", "seed": 1, "cars": [{}, {}], "edges": [{}]}
    usual["perception"] = {"source": "recorded"}
    facts = {"scenario": usual | scenario, "methods": [asdict(method) for method in methods]}
    measured = measured if measured is not None else compute(methods, columns)
    return Run("0123456789ab", facts, "", columns, measured, label=label)
