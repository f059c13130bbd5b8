"""Runs a scenario: prepares what it needs, simulates each method, and writes the result folder."""

import gc
import tempfile
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

import genie_sim
from genie_sim import build, plugins
from genie_sim.build import Prepared, check_faults_of, method_facts, plugin_digests
from genie_sim.core.consumer import CONSUMERS
from genie_sim.errors import UserError, short_repr, unknown
from genie_sim.fleet import expanded
from genie_sim.messages import Encoding
from genie_sim.monitor import Samples
from genie_sim.perception.sources import SOURCES, Drive, Frames, Progress
from genie_sim.recording import provenance
from genie_sim.recording.held import Held
from genie_sim.recording.log import Log
from genie_sim.recording.records import Tables
from genie_sim.recording.results import MethodInfo, Run
from genie_sim.scenario.fields import validate
from genie_sim.scenario.parts import Car, Route
from genie_sim.scenario.profiles import DeviceProfile
from genie_sim.scenario.scenario import Scenario, read_scenario
from genie_sim.sim.setup import Setup
from genie_sim.sim.world import World
from genie_sim.units import NS_PER_S


def run_to_folder(
    scenario: Scenario,
    out: Path,
    progress: Progress | None = None,
    with_report: bool = True,
    figures: Sequence[str] = (),
) -> Run:
    """Simulates a scenario and writes ``out/<scenario>-<run id>``, with ``figures`` in these formats, such as ``svg``.

    Raises ``UserError`` before it simulates.
    """
    provenance.check_writable(out)
    prepared = prepare(scenario, progress)
    run_id = provenance.run_id(facts(prepared))
    folder = out / f"{scenario.name}-{run_id}"
    with provenance.result_folder(folder) as partial:
        made = _fill(partial, prepared, run_id, progress, with_report, figures)
    return replace(made, folder=folder)


def run_in_memory(scenario: Scenario, progress: Progress | None = None) -> Run:
    """Simulates a scenario and writes nothing. Raises ``UserError`` before it simulates."""
    prepared = prepare(scenario, progress)
    return finished(prepared, provenance.run_id(facts(prepared)), simulate(prepared, progress))


def rerun(folder: Path, progress: Progress | None = None) -> dict[str, bool]:
    """Runs a result folder's scenario again, with the device profiles it was made with; tells of each file, by its
    name, whether the bytes are the same. ``run.json`` holds the wall time and is not compared."""
    made = provenance.read_run_json(folder)
    where = str(folder / "run.json")
    scenario = read_scenario(made["facts"]["scenario"], where=where)
    devices = {
        name: validate(DeviceProfile, device, lambda _: where)
        for name, device in made["facts"]["devices"].items()
    }
    prepared = prepare(scenario, progress, devices)
    again = facts(prepared)
    for key in again:
        before = made["facts"].get(key)
        if again[key] != before:
            raise UserError(f"{folder}: {_difference(key, before, again[key])}")
    with tempfile.TemporaryDirectory() as temporary:
        with_report = (folder / "report.html").is_file()
        drawn = sorted({path.suffix[1:] for path in (folder / "figures").glob("*.*")})
        _fill(Path(temporary), prepared, made["run_id"], progress, with_report, drawn)
        names = sorted(
            str(path.relative_to(temporary))
            for path in Path(temporary).rglob("*")
            if path.is_file()
        )
        return {
            name: (folder / name).is_file()
            and (folder / name).read_bytes() == (Path(temporary) / name).read_bytes()
            for name in names
            if name != "run.json"
        }


def _difference(name: str, before: object, now: object) -> str:
    """Where two facts differ, as short as can be: ``devices.jetson_tx2.cores.value: 6 when it was made, 8 now``."""
    if isinstance(before, Mapping) and isinstance(now, Mapping):
        for key in (*now, *before):
            if before.get(key) != now.get(key):
                return _difference(f"{name}.{key}", before.get(key), now.get(key))
    return f"{name}: {short_repr(before)} when it was made, {short_repr(now)} now"


def facts(prepared: Prepared) -> dict[str, Any]:
    """Everything that decides the outcome of a run."""
    needed = any(
        getattr(build.method(entry), "feature", None) for entry in prepared.scenario.methods
    )
    known = prepared.frames.provenance() if needed else {}
    features = {
        name: dict(facts["features"]) for name, facts in known.items() if "features" in facts
    }
    return {
        "format": provenance.RESULT_FORMAT,
        "genie_sim": genie_sim.__version__,
        "scenario": prepared.scenario.model_dump(mode="json", by_alias=True),
        "devices": {
            name: device.model_dump(mode="json", by_alias=True)
            for name, device in prepared.devices.items()
        },
        "traces": {
            **prepared.frames.digests(),
            **{
                f"{encoding} of {car}": drive.digest
                for (encoding, car), drive in prepared.encoded.items()
            },
        },
        "plugins": plugin_digests(prepared.scenario),
        "methods": method_facts(prepared.scenario),
        **({"features": features} if features else {}),
    }


def finished(prepared: Prepared, run_id: str, tables: Tables) -> Run:
    """The run that wrote these tables."""
    from genie_sim.analysis import metrics

    read = {table.name: table.columns() for table in tables}
    measured = metrics.compute(methods_of(prepared), read)
    return Run(run_id, facts(prepared), prepared.scenario.to_yaml(), read, measured)


def _fill(
    folder: Path,
    prepared: Prepared,
    run_id: str,
    progress: Progress | None,
    with_report: bool,
    drawn: Sequence[str],
) -> Run:
    """Simulates and writes the files of a result folder; figures in the formats ``drawn``."""
    from genie_sim import report
    from genie_sim.analysis import summary

    began_s = time.perf_counter()
    tables = simulate(prepared, progress, spill=folder)
    for table in tables:
        table.write(folder / f"{table.name}.parquet")
    made = finished(prepared, run_id, tables)
    provenance.write_json(folder / "metrics.json", [asdict(metric) for metric in made.measured])
    described = summary.markdown(
        made.measured, prepared.scenario.name, run_id, prepared.scenario.seed
    )
    (folder / "summary.md").write_text(described, encoding="utf-8")
    if drawn:
        from genie_sim.analysis import figures

        figures.write(made, folder / "figures", drawn)
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
            "traces": {name: dict(known) for name, known in prepared.frames.provenance().items()},
            "wall_time_s": round(time.perf_counter() - began_s, 3),
            **provenance.environment(),
        },
    )
    return made


def prepare(
    scenario: Scenario,
    progress: Progress | None = None,
    devices: Mapping[str, DeviceProfile] | None = None,
) -> Prepared:
    """Opens the frame source and gives every car its drive, all in one world. ``devices`` replace the profiles that the
    scenario read. Raises ``UserError``."""
    source = frame_source(scenario)
    if hasattr(source, "town"):
        routes = {f"cars[{index}].route": car.route for index, car in enumerate(scenario.cars)}
        for place, route in (routes or {"perception.duration": Route()}).items():
            scenario.check_time(f"{scenario.name}: {place}", route, source.duration_ns)
    return on_frames(scenario, source.open(scenario.seed, scenario.origin, progress), devices)


def frame_source(scenario: Scenario) -> Any:
    """What the ``perception`` section names. Raises ``UserError``."""
    return plugins.make("frame source", scenario.perception, SOURCES, ("open",))


def methods_of(prepared: Prepared) -> list[MethodInfo]:
    """The methods that a scenario runs, in its order."""
    return [MethodInfo(**method) for method in method_facts(prepared.scenario)]


def on_frames(
    scenario: Scenario, frames: Frames, devices: Mapping[str, DeviceProfile] | None = None
) -> Prepared:
    """The same with a frame source that is open already. Raises ``UserError``."""
    full = scenario
    if scenario.fleet is not None:
        full, drives = expanded(scenario, scenario.fleet, scenario.source, frames)
    else:
        drives = {
            car.name: frames.drive(car.name, car.route.trace, scenario.start_ns(car))
            for car in scenario.cars
        }
    for index, car in enumerate(full.cars[:1] if scenario.fleet else full.cars):
        _check_route(scenario, index, car, drives[car.name])
    check_faults_of(full)
    build.check_features(full, drives)
    encoded: dict[tuple[str, str], Any] = {
        (how, car.name): _encoded(scenario, frames, car.name, how)
        for how in dict.fromkeys(scenario.under(entry).image_encoding for entry in scenario.methods)
        for car in full.cars
        if how != "raw" and car.edge is not None
    }
    named = [car.device for car in full.cars] + [edge.device for edge in full.edges]
    known = scenario.profiles if devices is None else devices
    return Prepared(
        scenario,
        full,
        {name: known[name] for name in dict.fromkeys(named)},
        frames,
        drives,
        encoded,
    )


def _encoded(scenario: Scenario, frames: Any, car: str, encoding: Encoding) -> Any:
    """A car's drive after its pictures were sent. Raises ``UserError`` where the source has no such pictures."""
    if not hasattr(frames, "encoded"):
        raise UserError(
            f"{scenario.name}: image_encoding: source {scenario.perception.name!r} has no pictures to encode: leave it "
            "'raw', and give 'cameras' a 'size'"
        )
    return frames.encoded(car, encoding)


def simulate(
    prepared: Prepared, progress: Progress | None = None, spill: Path | None = None
) -> Tables:
    """Every method of the scenario, one after the other, on the same random streams.

    With ``spill``, a folder, the rows of long tables wait there and not in memory; ``write`` completes their files.
    """
    scenario, tables = prepared.expanded, Tables(spill)
    samples: Samples = "all" if scenario.fleet is None else "edges"
    if "resources" not in scenario.record:
        samples = "none"
    driven: set[str] = set()
    for number, entry in enumerate(scenario.methods):
        setup = build.setup(prepared, entry)
        held = held_of(prepared, entry.name, setup, tables, driven)
        log = Log(entry.name, tables, scenario.record, samples, held, driven)
        with gc_disabled():
            world = World(setup, build.method(entry), log)
            world.run(_teller(progress, log, number, len(scenario.methods)))
            driven.update(world.hosts)
            world.dismantle()
    return tables


def _teller(
    progress: Progress | None, log: Log, number: int, methods: int
) -> Callable[[int, int], None]:
    """Tells of the simulated time of one method, and how fast that goes."""
    began_s = time.perf_counter()

    def tell(now_ns: int, end_ns: int) -> None:
        if progress is not None:
            rate = log.published_frames / max(time.perf_counter() - began_s, 1e-9)
            what = f"{log.method}, {rate:,.0f} frames/s"
            progress((number * end_ns + now_ns) / NS_PER_S, methods * end_ns / NS_PER_S, what)

    return tell


def held_of(
    prepared: Prepared, method: str, setup: Setup, tables: Tables, driven: Collection[str]
) -> Held | None:
    """What judges the consumers of one method, if the scenario wants it; ``None`` where nobody knows what is there on
    any car's drive. The floor of the cars in ``driven`` is written already."""
    # A source of one's own need not know what is there.
    truth_of = (
        getattr(prepared.frames, "truth_of", None) if "held" in prepared.expanded.record else None
    )
    known = (
        {} if truth_of is None else {car: truth_of(drive) for car, drive in prepared.drives.items()}
    )
    truths = {car: truth for car, truth in known.items() if truth is not None}
    if not truths:
        return None
    objects = tables.held_objects if "held_objects" in prepared.expanded.record else None
    return Held(
        method, truths, tables.held, driven, partial(CONSUMERS[setup.consumer], setup.laws), objects
    )


@contextmanager
def gc_disabled() -> Iterator[None]:
    """A simulation makes very many small objects, and leaves no cycles that only Python's collector would free; what
    classes of somebody's own leave in cycles stays until it looks through old objects. With ten thousand cars in
    memory, looking through all that lives would take longer than the simulation; so it does not begin with that at the
    end either, as it would if what was made meanwhile were new to it."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.freeze()
            gc.unfreeze()
            gc.enable()


def _check_route(scenario: Scenario, index: int, car: Car, drive: Drive) -> None:
    """The car's cameras are recorded on its drive, and its window is a part of it."""
    own, where, route = (
        isinstance(car.cameras, tuple),
        f"{scenario.name}: cars[{index}].route",
        car.route,
    )
    for number, camera in enumerate(scenario.cameras_of(car)):
        if camera.recording not in drive.frames:
            field = f"cars[{index}].cameras[{number}]" if own else f"cameras[{number}]"
            text = unknown("recording", camera.recording, drive.frames)
            raise UserError(
                f"{scenario.name}: {field}.recording: {text} ({car.name} drives {drive.name})"
            )
    recordings = [drive.frames[camera.recording] for camera in scenario.cameras_of(car)]
    scenario.check_time(
        where, route, max(frames[-1].stamp_ns - frames[0].stamp_ns for frames in recordings)
    )
    if route.window_ns is None:
        return
    begin_ns, end_ns = route.window_ns
    where = f"{where}.window"
    stamps_ns = [frame.stamp_ns for frames in recordings for frame in frames]
    if begin_ns > max(stamps_ns):
        begin_s, last_s = begin_ns / NS_PER_S, max(stamps_ns) / NS_PER_S
        raise UserError(
            f"{where}: begins at {begin_s:g} s, after the last frame of {drive.name} at {last_s:g} s"
        )
    if not any(begin_ns <= stamp_ns < end_ns for stamp_ns in stamps_ns):
        after_s = min(stamp_ns for stamp_ns in stamps_ns if stamp_ns >= end_ns) / NS_PER_S
        raise UserError(
            f"{where}: no camera takes a frame in it; the next one of {drive.name} is at {after_s:g} s"
        )
