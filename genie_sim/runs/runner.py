"""Runs a scenario: prepares what it needs, simulates each method, and writes the result folder."""

import gc
import pickle
import tempfile
import time
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, cast

from genie_sim.base import plugins
from genie_sim.base.errors import UserError, short_repr, unknown
from genie_sim.base.parallel import max_memory_bytes
from genie_sim.base.progress import Progress
from genie_sim.base.settings import plain_data, read
from genie_sim.base.units import NS_PER_S
from genie_sim.core.messages import Encoding
from genie_sim.core.monitor import Samples
from genie_sim.data.sources import Drive, Frames
from genie_sim.judge.agreement import Agreement
from genie_sim.judge.map_accuracy import MapAccuracy
from genie_sim.judge.objects import Objects
from genie_sim.record import provenance
from genie_sim.record.log import Log
from genie_sim.record.records import SCHEMAS, PowerRow, Tables, new_tables
from genie_sim.record.results import (
    FILES,
    METRIC_FIELDS,
    MethodInfo,
    Run,
    changed_files,
    checked_label,
)
from genie_sim.record.tables import Table
from genie_sim.record.tables import write as write_columns
from genie_sim.report.output import USUAL, Output
from genie_sim.runs import build, own_classes
from genie_sim.runs.build import Prepared, check_faults_of, method_facts, plugin_digests
from genie_sim.runs.fleet import expanded
from genie_sim.runs.method_processes import side_by_side
from genie_sim.scenario.methods import MethodEntry
from genie_sim.scenario.power import INTERFACES, DevicePower, InterfacePower, parts
from genie_sim.scenario.profiles import DeviceProfile
from genie_sim.scenario.scenario import FRAME_SOURCE, Scenario, read_scenario
from genie_sim.sim.settings import Car, Route
from genie_sim.sim.setup import Setup
from genie_sim.sim.world import World
from genie_sim.version import VERSION

if TYPE_CHECKING:
    from genie_sim.data.sources import MapFrames

TEXT_S = 0.1  # how long a text of progress holds


def run_to_folder(
    scenario: Scenario,
    out: Path,
    progress: Progress | None = None,
    output: Output = USUAL,
    *,
    label: str = "",
    workers: int = 1,
) -> Run:
    """Simulates a scenario and writes ``out/<scenario>-<run id>``, with what ``output`` says;
    ``label`` is what the user calls the run. With several ``workers``,
    its methods run side by side in so many processes; results do not depend on it.

    Raises ``UserError`` before it simulates.
    """
    provenance.check_writable(out)
    prepared = prepare(scenario, progress)
    run_id = provenance.run_id(facts(prepared))
    folder = out / f"{scenario.name}-{run_id}"
    return write(
        prepared,
        folder,
        run_id,
        progress=progress,
        output=output,
        label=label,
        workers=workers,
    )


def write(
    prepared: Prepared,
    folder: Path,
    run_id: str,
    *,
    progress: Progress | None = None,
    output: Output = USUAL,
    label: str = "",
    workers: int = 1,
) -> Run:
    """Simulates a run and writes its results into ``folder``, which takes the place of earlier
    results of that name. Raises ``UserError``.
    """
    with provenance.result_folder(folder) as partial:
        run = _fill(
            partial,
            prepared,
            run_id,
            progress=progress,
            output=output,
            label=label,
            workers=workers,
        )
    return replace(run, folder=folder)


class Observer(Protocol):
    """Sees the simulated world of each method of a run, outside simulated time. It may subscribe to
    topics, as a node does, and look at nodes and their maps; it changes nothing.
    """

    def before(self, method: str, world: World) -> None:
        """The world is built; nothing has happened in it yet."""

    def after(self, method: str, world: World) -> None:
        """The world has run to its end."""


def run_in_memory(
    scenario: Scenario,
    progress: Progress | None = None,
    *,
    label: str = "",
    workers: int = 1,
    observer: Observer | None = None,
) -> Run:
    """Simulates a scenario and writes nothing. An ``observer`` sees what one worker simulates.
    Raises ``UserError`` before it simulates.
    """
    prepared = prepare(scenario, progress)
    run_id = provenance.run_id(facts(prepared))
    if observer is None:
        tables = simulate_with(prepared, workers, progress)
    else:
        tables = simulate(prepared, progress, observer=observer)
    return replace(finished(prepared, run_id, tables), label=label)


def rerun(
    folder: Path, progress: Progress | None = None, *, allow_changed: bool = False
) -> dict[str, bool]:
    """Runs a result folder's scenario again, with the device profiles it was made with; tells of
    each file, by its name, whether the bytes are the same. ``run.json`` holds the wall time and is
    not compared, nor is any file that no run writes.

    Raises ``UserError``, also for files that were changed since, unless they are allowed: then they
    differ.
    """
    made = provenance.read_run_json(folder)
    where = str(folder / "run.json")
    scenario = read_scenario(made["facts"]["scenario"], where=where)
    devices = {
        name: read(DeviceProfile, device, lambda _: where)
        for name, device in made["facts"]["devices"].items()
    }
    prepared = prepare(scenario, progress, devices)
    again = facts(prepared)
    for key in again:
        before = made["facts"].get(key)
        if again[key] != before:
            raise UserError(f"{folder}: {_difference(key, before, again[key])}")
    present = [name for name in FILES if (folder / name).exists()]
    provenance.refuse_changed(folder, changed_files(folder, made, present), allow_changed)
    with tempfile.TemporaryDirectory() as temporary:
        formats = _formats_in(folder / "figures")
        _fill(
            Path(temporary),
            prepared,
            made["run_id"],
            progress=progress,
            output=Output((folder / "report.html").is_file(), formats),
            label=checked_label(made.get("label", ""), f"{where}: label"),
        )
        names = sorted(
            str(path.relative_to(temporary))
            for path in Path(temporary).rglob("*")
            if path.is_file()
        )
        return {
            name: (folder / name).is_file()
            and provenance.contained(folder, name).read_bytes()
            == (Path(temporary) / name).read_bytes()
            for name in names
            if name != "run.json"
        }


def _formats_in(folder: Path) -> list[str]:
    """In which formats a folder holds the figures of a run."""
    if not folder.is_dir():
        return []
    from genie_sim.analysis.figures import ALWAYS, FORMATS

    return [format for format in sorted(FORMATS) if (folder / f"{ALWAYS}.{format}").is_file()]


def _difference(name: str, before: object, now: object) -> str:
    """Where two facts differ, as short as can be: ``devices.jetson_tx2.cores.value: 6 when it was
    made, 8 now``.
    """
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
        "genie_sim": VERSION,
        "scenario": plain_data(prepared.scenario),
        "devices": {name: plain_data(device) for name, device in prepared.devices.items()},
        "traces": {
            **prepared.frames.digests(),
            **build.link_digests(prepared.scenario),
            **{
                f"{encoding} of {car}": drive.digest
                for (encoding, car), drive in prepared.encoded.items()
            },
        },
        "plugins": plugin_digests(prepared.scenario),
        "methods": method_facts(prepared.scenario),
        **({"features": features} if features else {}),
        **_map_facts(prepared),
    }


def _map_facts(prepared: Prepared) -> dict[str, Any]:
    """The borders of a fleet's map [m]; those of a town follow from its settings."""
    if prepared.scenario.fleet is None:
        return {}
    from genie_sim.worlds.town.source import TownDrives

    frames = prepared.frames
    if isinstance(frames, TownDrives):
        return {}
    return {"map": {"extent_m": [float(border_m) for border_m in cast(Any, frames).extent_m]}}


def finished(prepared: Prepared, run_id: str, tables: Tables) -> Run:
    """The run that wrote these tables."""
    from genie_sim.analysis import metrics

    columns = {name: table.columns() for name, table in tables.items()}
    measured = metrics.compute(methods_of(prepared), columns, custom=prepared.scenario.metrics)
    return Run(
        run_id=run_id,
        facts=facts(prepared),
        yaml=prepared.scenario.to_yaml(),
        tables=columns,
        measured=measured,
    )


def _fill(
    folder: Path,
    prepared: Prepared,
    run_id: str,
    *,
    progress: Progress | None,
    output: Output,
    label: str = "",
    workers: int = 1,
) -> Run:
    """Simulates and writes the files of a result folder.

    Parameters
    ----------
    folder : Path
        An empty folder.
    prepared : Prepared
        The scenario with everything it names.
    run_id : str
        The run's id.
    progress : callable, optional
        Called with the time now and at the end [s], and what is done.
    output : Output
        What is written for people to look at.
    label : str
        What the user calls the run; may be empty.
    workers : int
        How many processes simulate its methods.
    """
    began_s = time.perf_counter()
    tables = simulate_with(prepared, workers, progress, spill=folder)
    for name, table in tables.items():
        table.write(folder / f"{name}.parquet")
    made = replace(finished(prepared, run_id, tables), label=label)
    _write_derived(folder, made, output)
    about = {
        "rows": {name: len(table) for name, table in tables.items()},
        "traces": {name: dict(known) for name, known in prepared.frames.provenance().items()},
        "wall_time_s": round(time.perf_counter() - began_s, 3),
    }
    _write_about(folder, made, about)
    return made


def _write_derived(folder: Path, run: Run, output: Output) -> None:
    """Writes what follows from a run's tables: metrics, and what people look at."""
    metrics = [dict(zip(METRIC_FIELDS, metric.row, strict=True)) for metric in run.measured]
    provenance.write_json(folder / "metrics.json", metrics)
    output.write(run, folder)
    (folder / "scenario.resolved.yaml").write_text(run.yaml, encoding="utf-8")


def _write_about(folder: Path, run: Run, more: Mapping[str, Any]) -> None:
    """Writes ``run.json``, with ``more`` that is known of the run."""
    about = {
        "format": provenance.RESULT_FORMAT,
        "run_id": run.run_id,
        **({"label": run.label} if run.label else {}),
        "facts": run.facts,
        "digests": provenance.digests(folder, FILES),
        **more,
        **provenance.environment(),
    }
    provenance.write_json(folder / "run.json", about)


def save(run: Run, out: Path, output: Output = USUAL) -> Path:
    """Writes a run that is in memory as ``run_to_folder`` writes it; returns its folder. Raises
    ``UserError``.
    """
    provenance.check_writable(out)
    folder = out / f"{run.name}-{run.run_id}"
    with provenance.result_folder(folder) as partial:
        for name, schema in SCHEMAS.items():
            write_columns(partial / f"{name}.parquet", schema, run.tables[name])
        _write_derived(partial, run, output)
        _write_about(partial, run, {"rows": {name: len(run.tables[name]) for name in SCHEMAS}})
    return folder


def prepare(
    scenario: Scenario,
    progress: Progress | None = None,
    devices: Mapping[str, DeviceProfile] | None = None,
) -> Prepared:
    """Opens the frame source and gives every car its drive, all in one world. ``devices`` replace
    the profiles that the scenario read. Raises ``UserError``.
    """
    build.check_own_plugins(scenario)
    if scenario.metrics:
        from genie_sim.analysis.registry import custom_metrics

        custom_metrics(scenario.metrics)
    source = frame_source(scenario)
    if getattr(source, "is_map", False):
        routes = {f"cars[{index}].route": car.route for index, car in enumerate(scenario.cars)}
        for place, route in (routes or {"perception.duration": Route()}).items():
            scenario.check_time(f"{scenario.name}: {place}", route, source.duration_ns)
    frames = source.open(scenario.seed, scenario.origin, progress)
    owner = plugins.own_label("frame source", scenario.perception.name)
    if owner is not None:
        frames = own_classes.checked_frames(frames, owner)
    return on_frames(scenario, frames, devices)


def frame_source(scenario: Scenario) -> Any:
    """What the ``perception`` section names. Raises ``UserError``."""
    return FRAME_SOURCE.make(scenario.perception)


def methods_of(prepared: Prepared) -> list[MethodInfo]:
    """The methods that a scenario runs, in its order."""
    return [MethodInfo(**method) for method in method_facts(prepared.scenario)]


def on_frames(
    scenario: Scenario, frames: Frames, devices: Mapping[str, DeviceProfile] | None = None
) -> Prepared:
    """The same with a frame source that is open already. Raises ``UserError``."""
    full = scenario
    if scenario.fleet is not None:
        full, drives = expanded(scenario, scenario.fleet, cast("MapFrames", frames))
    else:
        drives = {
            car.name: frames.drive(car.name, car.route.trace, scenario.start_ns(car))
            for car in scenario.cars
        }
    if scenario.sequence is not None:
        full = _on_one_clock(full, drives)
    owner = plugins.own_label("frame source", scenario.perception.name)
    if owner is not None:
        for drive in drives.values():
            own_classes.check_drive(drive, owner)
        frames.digests()  # checked now, not after the simulation
        frames.provenance()
    for index, car in enumerate(full.cars[:1] if scenario.fleet else full.cars):
        _check_route(scenario, index, car, drives[car.name])
    check_faults_of(full)
    build.check_features(full, drives)
    encodings = {scenario.under(entry).image_encoding: None for entry in scenario.methods}
    encoded: dict[tuple[str, str], Any] = {}
    for encoding in encodings:
        for car in full.cars:
            if encoding != "raw" and car.edge is not None:
                drive = _encoded(scenario, frames, car.name, encoding)
                encoded[encoding, car.name] = drive
    profiles = scenario.profiles if devices is None else devices
    names = [car.device for car in full.cars] + [edge.device for edge in full.edges]
    return Prepared(
        scenario=scenario,
        expanded=full,
        devices={name: profiles[name] for name in dict.fromkeys(names)},
        frames=frames,
        drives=drives,
        encoded=encoded,
    )


def _on_one_clock(scenario: Scenario, drives: Mapping[str, Drive]) -> Scenario:
    """Every car replays its recording from the beginning of the sequence to the end, so that what
    was recorded at one time is replayed at one time.
    """
    last_ns = max(
        frames[-1].stamp_ns for drive in drives.values() for frames in drive.frames.values()
    )
    cars = tuple(
        car
        if car.route.window_ns is not None
        else replace(car, route=replace(car.route, window_ns=(0, last_ns + 1)))
        for car in scenario.cars
    )
    return replace(scenario, cars=cars)


def _encoded(scenario: Scenario, frames: Any, car: str, encoding: Encoding) -> Any:
    """A car's drive after its pictures were sent. Raises ``UserError`` where the source has no such
    pictures.
    """
    if not hasattr(frames, "encoded"):
        raise UserError(
            f"{scenario.name}: image_encoding: source {scenario.perception.name!r} has no "
            "pictures to encode: leave it 'raw', and give 'cameras' a 'size'"
        )
    return frames.encoded(car, encoding)


def simulate_with(
    prepared: Prepared, workers: int, progress: Progress | None = None, spill: Path | None = None
) -> Tables:
    """``simulate`` in so many processes, each of which prepares the scenario anew: several methods
    side by side.
    """
    full = prepared.expanded
    methods = full.methods
    if min(workers, len(methods)) > 1:
        apart = partial(_simulate_apart, _packed(prepared))
        return side_by_side(apart, len(methods), workers, progress=progress, spill=spill)
    return simulate(prepared, progress, spill)


def _simulate_apart(packed: bytes, number: int, tables: Tables, progress: Progress) -> None:
    """``simulate_method`` of the ``number``-th method, in a process that knows nothing yet."""
    prepared = _prepared(packed)
    *earlier, entry = prepared.expanded.methods[: number + 1]
    driven = set().union(*(_hosts(prepared, other) for other in earlier))
    simulate_method(prepared, entry, tables, driven=driven, progress=progress)


def _packed(prepared: Prepared) -> bytes:
    """What another process prepares the same from."""
    return pickle.dumps((prepared.scenario, prepared.devices))


@lru_cache(maxsize=1)
def _prepared(packed: bytes) -> Prepared:
    """What all methods of a run begin with, once a process."""
    scenario, devices = pickle.loads(packed)
    return prepare(scenario, devices=devices)


def _hosts(prepared: Prepared, entry: MethodEntry) -> set[str]:
    """The hosts on which a method runs something."""
    with gc_disabled():
        log = Log(entry.name, new_tables(), samples="none")
        world = World(build.setup(prepared, entry), build.method(entry), log)
        hosts = set(world.network.graphs)
        world.dismantle()
    return hosts


def simulate(
    prepared: Prepared,
    progress: Progress | None = None,
    spill: Path | None = None,
    observer: Observer | None = None,
) -> Tables:
    """Every method of the scenario, one after the other, on the same random streams.

    With ``spill``, a folder, the rows of long tables wait there and not in memory; ``write``
    completes their files.
    """
    methods, tables = prepared.expanded.methods, new_tables(spill)
    driven: set[str] = set()
    for number, entry in enumerate(methods):
        report = _of_all(progress, number, len(methods))
        driven |= simulate_method(
            prepared, entry, tables, driven=driven, progress=report, observer=observer
        )
    return tables


def _of_all(progress: Progress | None, number: int, methods: int) -> Progress:
    """Returns what takes the seconds of one method, the ``number``-th, and tells those of all."""

    def report(now_s: float, end_s: float, text: str) -> None:
        if progress is not None:
            progress(number * end_s + now_s, methods * end_s, text)

    return report


def simulate_method(
    prepared: Prepared,
    entry: MethodEntry,
    tables: Tables,
    *,
    driven: Collection[str],
    progress: Progress,
    observer: Observer | None = None,
) -> set[str]:
    """Adds the rows of one method to the tables; returns the hosts on which it runs something.

    ``driven`` are the hosts on which methods before it do: rows that are the same under every
    method are written once. ``progress`` is called with the time now and at the end [s]. An
    ``observer`` sees the world before and after.
    """
    scenario = prepared.expanded
    samples: Samples = "all" if scenario.fleet is None else "edges"
    if "resources" not in scenario.record:
        samples = "none"
    setup = build.setup(prepared, entry)
    accuracy = accuracy_of(prepared, entry.name, setup, tables, driven=driven)
    log = Log(
        entry.name,
        tables,
        record=scenario.record,
        samples=samples,
        answers=answers_of(scenario, entry.name, tables, accuracy),
        accuracy=accuracy,
        posed=driven,
    )
    note_power(tables["power"], entry.name, prepared, setup)
    with gc_disabled():
        world = World(setup, build.method(entry), log)
        if observer is not None:
            observer.before(entry.name, world)
        world.run(_progress_of(log, progress))
        if observer is not None:
            observer.after(entry.name, world)
        hosts = set(world.network.graphs)
        world.dismantle()
    return hosts


def note_power(table: Table, method: str, prepared: Prepared, setup: Setup) -> None:
    """Writes what the devices and interfaces of a method take, where it is known."""
    powers: dict[tuple[str, str], DevicePower | InterfacePower] = {}
    for profile in prepared.devices.values():
        power = profile.power_with(setup.settings.model)
        if power is not None:
            powers["device", profile.name] = power
    for interface in setup.interfaces.values():
        powers["interface", interface.name] = INTERFACES[interface.name]
    for (kind, name), of_name in powers.items():
        for part, of_part in parts(of_name):
            row = PowerRow(method=method, kind=kind, name=name, part=part, **of_part._asdict())
            table.append(row)


def _progress_of(log: Log, progress: Progress) -> Callable[[int, int], None]:
    """Returns what reports the simulated time of one method, the frames simulated per second, and
    the memory of its process.
    """
    began_s = time.perf_counter()
    text, text_until_s = "", began_s

    def report(now_ns: int, end_ns: int) -> None:
        nonlocal text, text_until_s
        time_s = time.perf_counter()
        if time_s >= text_until_s:
            rate = log.published_frames / max(time_s - began_s, 1e-9)
            words = [log.method, f"{rate:,.0f} frames/s"]
            memory_bytes = max_memory_bytes()
            if memory_bytes is not None:
                words.append(f"{memory_bytes / 10**6:,.0f} MB")
            text, text_until_s = ", ".join(words), time_s + TEXT_S
        progress(now_ns / NS_PER_S, end_ns / NS_PER_S, text)

    return report


def accuracy_of(
    prepared: Prepared, method: str, setup: Setup, tables: Tables, *, driven: Collection[str]
) -> MapAccuracy | None:
    """Returns what judges the consumers of one method, if the scenario wants it; ``None`` where
    nobody knows what is there on any car's drive.

    Parameters
    ----------
    prepared : Prepared
        The scenario with the drives of its cars.
    method : str
        The name of the method.
    setup : Setup
        The method's settings: the consumer, and the laws of the detector that it goes by.
    tables : dict of str to Table
        Where the rows go.
    driven : collection of str
        Cars that have driven with an earlier method, so that their zero-delay detector is judged.
    """
    record = prepared.expanded.record
    # A frame source of the user's own need not know what is there.
    truth_of = getattr(prepared.frames, "truth_of", None)
    if truth_of is None or "held" not in record:
        return None
    truths = {car: truth_of(drive) for car, drive in prepared.drives.items()}
    truths = {car: truth for car, truth in truths.items() if truth is not None}
    if not truths:
        return None
    return MapAccuracy(
        method,
        truths,
        tables["held"],
        judged_without_delay=driven,
        make_consumer=partial(setup.settings.consumer.new, setup.laws),
        objects=tables["held_objects"] if "held_objects" in record else None,
        all_streams=prepared.expanded.judged == "all",
    )


def answers_of(
    scenario: Scenario, method: str, tables: Tables, accuracy: MapAccuracy | None
) -> Agreement | None:
    """Returns what compares the answers of one method with the detector's, if the scenario wants
    it.
    """
    if "answers" not in scenario.record:
        return None
    objects = Objects() if accuracy is None else accuracy.objects
    return Agreement(method, tables["answers"], objects)


@contextmanager
def gc_disabled() -> Iterator[None]:
    """Disables Python's garbage collector while a simulation runs.

    A simulation makes very many small objects and leaves no reference cycles (``World.dismantle``),
    so the collector would find nothing; with ten thousand cars in memory its passes would take
    longer than the simulation. Cycles that classes of the user's own leave stay until a full
    collection.
    """
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            # This moves everything to the oldest generation. Otherwise enabling the collector would
            # start a pass over all objects made meanwhile.
            gc.freeze()
            gc.unfreeze()
            gc.enable()


def _check_route(scenario: Scenario, index: int, car: Car, drive: Drive) -> None:
    """The car's cameras are recorded on its drive, and its window is a part of it."""
    own = isinstance(car.cameras, tuple)
    where = f"{scenario.name}: cars[{index}].route"
    route = car.route
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
            f"{where}: begins at {begin_s:g} s, after the last frame of {drive.name} "
            f"at {last_s:g} s"
        )
    if not any(begin_ns <= stamp_ns < end_ns for stamp_ns in stamps_ns):
        after_s = min(stamp_ns for stamp_ns in stamps_ns if stamp_ns >= end_ns) / NS_PER_S
        raise UserError(
            f"{where}: no camera takes a frame in it; the next one of {drive.name} "
            f"is at {after_s:g} s"
        )
