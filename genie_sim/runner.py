"""Runs a scenario: prepares what it needs, simulates each method, and writes the result folder."""

from __future__ import annotations

import gc
import os
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import genie_sim
from genie_sim.core.genies import own_code
from genie_sim.errors import UserError, shown, unknown
from genie_sim.perception.trace import Trace, read_trace
from genie_sim.recording import provenance
from genie_sim.recording.log import Log
from genie_sim.recording.records import TRUTH, Tables
from genie_sim.recording.results import MethodInfo, Metric, Run
from genie_sim.recording.tables import Table
from genie_sim.recording.truth import Truth
from genie_sim.scenario import files
from genie_sim.scenario.fields import validate
from genie_sim.scenario.fleet import InTown
from genie_sim.scenario.profiles import DeviceProfile, load_profile
from genie_sim.scenario.scenario import Live, Route, Scenario, load_scenario, read_scenario
from genie_sim.sim.world import World
from genie_sim.units import NS_PER_S

if TYPE_CHECKING:
    from genie_sim.town import Drive, Town

Progress = Callable[[float, float, str], None]


@dataclass(frozen=True)
class Prepared:
    """A scenario with everything it names: devices by name, and the trace of each car by the car's name.

    In a ``town`` a car's trace is its ``Drive``, which stands in for one. ``spelled_out`` is the scenario with every
    car and edge of its fleet.
    """

    scenario: Scenario
    devices: Mapping[str, DeviceProfile]
    traces: Mapping[str, Trace]
    spelled_out: Scenario | None = None
    town: Town | None = None


@dataclass(frozen=True)
class Result:
    """A finished run: its folder, its id, its metrics and its summary for a terminal."""

    folder: Path
    run_id: str
    metrics: Sequence[Metric]


def run(
    path_or_name: str | Path,
    overrides: Sequence[str] = (),
    seed: int | None = None,
    out: Path = Path("results"),
    progress: Progress | None = None,
    with_report: bool = True,
) -> Result:
    """Simulates a scenario and writes ``out/<scenario>-<run id>``. Raises ``UserError`` before it simulates."""
    return run_to_folder(load_scenario(path_or_name, overrides, seed), out, progress, with_report)


def run_to_folder(scenario: Scenario, out: Path, progress: Progress | None = None, with_report: bool = True) -> Result:
    """The same for a scenario at hand."""
    provenance.check_writable(out)
    prepared = prepare(scenario, progress)
    run_id = provenance.run_id(facts(prepared))
    folder = out / f"{scenario.name}-{run_id}"
    with provenance.result_folder(folder) as partial:
        metrics = _fill(partial, prepared, run_id, progress, with_report)
    return Result(folder, run_id, metrics)


def run_in_memory(scenario: Scenario, progress: Progress | None = None) -> Run:
    """Simulates a scenario and writes nothing. Raises ``UserError`` before it simulates."""
    prepared = prepare(scenario, progress)
    return _finished(prepared, provenance.run_id(facts(prepared)), simulate(prepared, progress))


def rerun(folder: Path, progress: Progress | None = None) -> dict[str, bool]:
    """Runs a result folder's scenario again, with the device profiles it was made with; tells of each file, by its
    name, whether the bytes are the same. ``run.json`` holds the wall time and is not compared."""
    made = provenance.read_run_json(folder)
    where = str(folder / "run.json")
    scenario = read_scenario(made["facts"]["scenario"], where=where)
    devices = {
        name: validate(DeviceProfile, device, lambda _: where) for name, device in made["facts"]["devices"].items()
    }
    prepared = prepare(scenario, progress, devices)
    again = facts(prepared)
    for key in again:
        before = made["facts"].get(key)
        if again[key] != before:
            raise UserError(f"{folder}: {_difference(key, before, again[key])}")
    with tempfile.TemporaryDirectory() as temporary:
        with_report = (folder / "report.html").is_file()
        _fill(Path(temporary), prepared, made["run_id"], progress, with_report)
        names = sorted(str(path.relative_to(temporary)) for path in Path(temporary).rglob("*") if path.is_file())
        return {
            name: (folder / name).is_file() and (folder / name).read_bytes() == (Path(temporary) / name).read_bytes()
            for name in names
            if name != "run.json"
        }


def _difference(name: str, before: object, now: object) -> str:
    """Where two facts differ, as short as can be: ``devices.jetson_tx2.cores.value: 6 when it was made, 8 now``."""
    if isinstance(before, Mapping) and isinstance(now, Mapping):
        for key in (*now, *before):
            if before.get(key) != now.get(key):
                return _difference(f"{name}.{key}", before.get(key), now.get(key))
    return f"{name}: {shown(before)} when it was made, {shown(now)} now"


def facts(prepared: Prepared) -> dict[str, Any]:
    """Everything that decides the outcome of a run."""
    return {
        "format": provenance.RESULT_FORMAT,
        "genie_sim": genie_sim.__version__,
        "scenario": prepared.scenario.model_dump(mode="json", by_alias=True),
        "devices": {name: device.model_dump(mode="json", by_alias=True) for name, device in prepared.devices.items()},
        "traces": {name: trace.digest for name, trace in _sources(prepared).items()},
        "own_code": own_code(prepared.scenario.genie),
        "methods": [asdict(method) for method in methods_of(prepared.scenario)],
    }


def methods_of(scenario: Scenario) -> list[MethodInfo]:
    """The methods that a scenario runs, in its order."""
    titles = {"local": "local (L)", "remote": "remote (R)", "genie": "Genie (DG)"}
    return [MethodInfo(name, titles[name], baseline=name != "genie") for name in scenario.methods]


def _sources(prepared: Prepared) -> Mapping[str, Trace | Town]:
    """What the frames come from: the trace of each car, or the town that all of them drive in."""
    return prepared.traces if prepared.town is None else {"town": prepared.town}


def _finished(prepared: Prepared, run_id: str, tables: Tables) -> Run:
    """The run that wrote these tables."""
    from genie_sim.analysis import metrics

    frames, lookups, resources, poses, objects, *more = (table.to_frame() for table in tables)
    truth = more[0] if more else None
    measured = metrics.compute(methods_of(prepared.scenario), frames, lookups, resources, truth)
    yaml = prepared.scenario.to_yaml()
    return Run(run_id, facts(prepared), yaml, frames, lookups, resources, poses, objects, measured, truth=truth)


def _fill(
    folder: Path, prepared: Prepared, run_id: str, progress: Progress | None, with_report: bool
) -> Sequence[Metric]:
    """Simulates and writes the files of a result folder."""
    from genie_sim import report
    from genie_sim.analysis import figures, summary

    began_s = time.perf_counter()
    tables = simulate(prepared, progress, spill=folder)
    for table in tables:
        table.write(folder / f"{table.name}.parquet")
    made = _finished(prepared, run_id, tables)
    provenance.write_json(folder / "metrics.json", [asdict(metric) for metric in made.measured])
    described = summary.markdown(made.measured, prepared.scenario.name, run_id, prepared.scenario.seed)
    (folder / "summary.md").write_text(described, encoding="utf-8")
    (folder / "figures").mkdir()
    for name, figure in figures.of_run(made).items():
        figures.save(figure, folder / "figures", name)
    if with_report:
        report.write(folder / report.NAME, made)
    (folder / "scenario.resolved.yaml").write_text(made.yaml, encoding="utf-8")
    provenance.write_json(
        folder / "run.json",
        {
            "format": provenance.RESULT_FORMAT,
            "run_id": run_id,
            "facts": made.facts,
            "digests": provenance.digests(folder),
            "rows": {table.name: len(table) for table in tables},
            "traces": {trace.name: dict(trace.provenance) for trace in _sources(prepared).values()},
            "wall_time_s": round(time.perf_counter() - began_s, 3),
            **provenance.environment(),
        },
    )
    return made.measured


def prepare(
    scenario: Scenario, progress: Progress | None = None, devices: Mapping[str, DeviceProfile] | None = None
) -> Prepared:
    """Reads the traces, and the device profiles if none are given, and moves all traces into one world. Raises
    ``UserError``."""
    if isinstance(scenario.perception, InTown):
        return _in_town(scenario, scenario.perception, devices)
    devices = devices or devices_of(scenario)
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
        _check_route(f"{scenario.name}: cars[{index}].route", scenario, car.route, read[name])
        traces[car.name] = read[name]
    return Prepared(scenario, devices, traces)


def _in_town(scenario: Scenario, city: InTown, devices: Mapping[str, DeviceProfile] | None) -> Prepared:
    """Builds the town, and every car's way through it."""
    from genie_sim.town import Town, cells

    routes = {f"cars[{index}].route": car.route for index, car in enumerate(scenario.cars)}
    for place, route in (routes or {"perception.duration": Route()}).items():
        scenario.check_time(f"{scenario.name}: {place}", route, city.duration_ns)
    town = Town(city.town, scenario.seed)
    if scenario.fleet is not None:
        spelled_out, drives = cells.spelled_out(scenario, scenario.fleet, city, town)
    else:
        spelled_out = None
        drives = {car.name: cells.drive(scenario, city, town, car) for car in scenario.cars}
    traces = cast("dict[str, Trace]", drives)
    for index, car in enumerate(scenario.cars if spelled_out is None else spelled_out.cars[:1]):
        _check_route(f"{scenario.name}: cars[{index}].route", scenario, car.route, traces[car.name])
    return Prepared(scenario, devices or devices_of(spelled_out or scenario), traces, spelled_out, town)


def devices_of(scenario: Scenario) -> dict[str, DeviceProfile]:
    """The profiles that its cars and edges name. Raises ``UserError``."""
    names = [car.device for car in scenario.cars] + [edge.device for edge in scenario.edges]
    return {name: load_profile(name) for name in dict.fromkeys(names)}


def simulate(prepared: Prepared, progress: Progress | None = None, spill: Path | None = None) -> Tables:
    """Every method of the scenario, one after the other, on the same random streams.

    With ``spill``, a folder, the rows of long tables wait there and not in memory; ``write`` completes their files.
    """
    scenario = prepared.scenario if prepared.spelled_out is None else prepared.spelled_out
    methods, tables = scenario.methods, Tables.spilling(spill)
    if prepared.town is not None and "truth" in scenario.record:
        tables = replace(tables, truth=Table(TRUTH))
    drives = "genie" if "genie" in methods else methods[0]  # without Genie, cars without cameras stay at home
    for number, method in enumerate(methods):
        log = Log(method, tables, set(scenario.record) - ({"poses"} if method != drives else set()))
        began_s = time.perf_counter()
        truth = _truth(prepared, method, tables.truth)

        def tell(
            now_ns: int, end_ns: int, done: int = number, method: str = method, log: Log = log, began_s: float = began_s
        ) -> None:
            if progress is not None:
                rate = log.published_frames / max(time.perf_counter() - began_s, 1e-9)
                what = f"{method}, {rate:,.0f} frames/s"
                progress((done * end_ns + now_ns) / NS_PER_S, len(methods) * end_ns / NS_PER_S, what)

        with _without_collections():
            World(scenario, prepared.devices, prepared.traces, method, log, truth).run(tell)
    return tables


def _truth(prepared: Prepared, method: str, table: Table | None) -> Truth | None:
    """What judges the answers of one method, where the truth is known and wanted."""
    city = prepared.scenario.perception
    if table is None or prepared.town is None or not isinstance(city, InTown):
        return None
    begin_ns = {car: cast("Drive", trace).start_ns for car, trace in prepared.traces.items()}
    return Truth(method, prepared.town, begin_ns, city.tolerance_m, city.range_m, table)


@contextmanager
def _without_collections() -> Iterator[None]:
    """A simulation makes very many small objects, and no cycles that only Python's collector would free; what classes
    of somebody's own leave in cycles stays until the run is over. With ten thousand cars in memory, looking through
    all that lives would take longer than the simulation."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


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
    recordings = [trace.frames[camera.recording] for camera in scenario.cameras]
    scenario.check_time(where, route, max(frames[-1].stamp_ns - frames[0].stamp_ns for frames in recordings))
    if route.window_ns is None:
        return
    begin_ns, end_ns = route.window_ns
    where = f"{where}.window"
    stamps_ns = [frame.stamp_ns for frames in recordings for frame in frames]
    if begin_ns > max(stamps_ns):
        begin_s, last_s = begin_ns / NS_PER_S, max(stamps_ns) / NS_PER_S
        raise UserError(f"{where}: begins at {begin_s:g} s, after the last frame of {trace.name} at {last_s:g} s")
    if not any(begin_ns <= stamp_ns < end_ns for stamp_ns in stamps_ns):
        after_s = min(stamp_ns for stamp_ns in stamps_ns if stamp_ns >= end_ns) / NS_PER_S
        raise UserError(f"{where}: no camera takes a frame in it; the next one of {trace.name} is at {after_s:g} s")
