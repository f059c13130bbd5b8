"""Runs a scenario: prepares what it needs, simulates each method, and writes the result folder."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from genie_sim.errors import UserError, unknown
from genie_sim.experiment import files
from genie_sim.experiment.profiles import DeviceProfile, load_profile
from genie_sim.experiment.records import FrameTable, LookupTable, ResourceTable
from genie_sim.experiment.scenario import Live, Route, Scenario
from genie_sim.perception.trace import Trace, read_trace
from genie_sim.sim.log import Log
from genie_sim.sim.world import World

Progress = Callable[[float, float, str], None]
NS = 1_000_000_000


@dataclass(frozen=True)
class Prepared:
    """A scenario with everything it names: devices by name, and the trace of each car by the car's name."""

    scenario: Scenario
    devices: Mapping[str, DeviceProfile]
    traces: Mapping[str, Trace]


@dataclass(frozen=True)
class Tables:
    """What a run wrote down."""

    frames: FrameTable
    lookups: LookupTable
    resources: ResourceTable


def prepare(scenario: Scenario, progress: Progress | None = None) -> Prepared:
    """Reads the device profiles and traces, and moves all traces into one world. Raises ``UserError``."""
    names = [car.device for car in scenario.cars] + [edge.device for edge in scenario.edges]
    devices = {name: load_profile(name) for name in names}
    if isinstance(scenario.perception, Live):
        main = _perceived(scenario.perception, progress)
    else:
        main = read_trace(files.find(files.TRACE, scenario.perception.trace))
    origin = scenario.origin if scenario.origin is not None else main.origin
    read: dict[str | None, Trace] = {None: main.rebased(origin)}
    traces = {}
    for index, car in enumerate(scenario.cars):
        name = car.route.trace
        if name not in read:
            read[name] = read_trace(files.find(files.TRACE, str(name))).rebased(origin)
        _check_route(f"{scenario.name}: cars[{index}].route.window", scenario, car.route, read[name])
        traces[car.name] = read[name]
    return Prepared(scenario, devices, traces)


def simulate(prepared: Prepared, progress: Progress | None = None) -> Tables:
    """Every method of the scenario, one after the other, on the same random streams."""
    tables = Tables(FrameTable(), LookupTable(), ResourceTable())
    methods = prepared.scenario.methods
    for number, method in enumerate(methods):
        log = Log(method, tables.frames, tables.lookups, tables.resources)
        world = World(prepared.scenario, prepared.devices, prepared.traces, method, log)

        def tell(now_ns: int, end_ns: int, done: int = number, method: str = method) -> None:
            if progress is not None:
                progress((done * end_ns + now_ns) / NS, len(methods) * end_ns / NS, method)

        world.run(tell)
    return tables


def _perceived(live: Live, progress: Progress | None) -> Trace:
    """The trace of frames that go through the detector now."""
    from genie_sim.perception.perceive import perceive

    root = os.path.expandvars(live.kitti)
    if root.startswith("$"):
        raise UserError(
            f"perception.kitti: {live.kitti}: the environment variable is not set; set it to KITTI's folder"
        )

    def tell(done: int, total: int) -> None:
        if progress is not None:
            progress(done, total, "perceive")

    return perceive(root, live.drive, live.cameras, live.detector, min_score=live.min_score, progress=tell)


def _check_route(where: str, scenario: Scenario, route: Route, trace: Trace) -> None:
    for index, camera in enumerate(scenario.cameras):
        if camera.recording not in trace.frames:
            field = f"{scenario.name}: cameras[{index}].recording"
            raise UserError(f"{field}: {unknown('recording', camera.recording, trace.frames)}")
    last_ns = max(frames[-1].stamp_ns for frames in trace.frames.values())
    if route.window_ns is not None and route.window_ns[0] > last_ns:
        begin_s, last_s = route.window_ns[0] / NS, last_ns / NS
        raise UserError(f"{where}: begins at {begin_s:g} s, after the last frame of {trace.name} at {last_s:g} s")
