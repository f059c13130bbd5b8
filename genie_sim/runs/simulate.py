"""Simulates every method of a prepared run."""

import gc
import time
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Protocol

from genie_sim.base.progress import Progress
from genie_sim.base.units import NS_PER_S, duration_text
from genie_sim.data.frame_source import Drive
from genie_sim.judge.agreement import Agreement
from genie_sim.judge.consumers import ConsumerJudge
from genie_sim.record.log import Log
from genie_sim.record.records import PowerRow, Tables, new_tables
from genie_sim.record.tables import Table
from genie_sim.runs import build
from genie_sim.runs.own_classes import own_code_named
from genie_sim.runs.prepare import Prepared
from genie_sim.scenario.methods import MethodEntry
from genie_sim.scenario.power import INTERFACES, DevicePower, InterfacePower, parts
from genie_sim.scenario.scenario import Scenario
from genie_sim.sim.monitor import Samples
from genie_sim.sim.settings import Car
from genie_sim.sim.setup import Setup
from genie_sim.sim.world import World

TEXT_S = 0.1  # how long a text of progress holds


class Observer(Protocol):
    """Sees the simulated world of each method of a run, outside simulated time. It may subscribe to
    topics, as a node does, and look at nodes and their maps; it changes nothing.
    """

    def before(self, method: str, world: World) -> None:
        """The world is built; nothing has happened in it yet."""

    def after(self, method: str, world: World) -> None:
        """The world has run to its end."""


def simulate(
    prepared: Prepared,
    progress: Progress | None = None,
    *,
    spill: Path | None = None,
    observer: Observer | None = None,
) -> Tables:
    """The tables of every method of the scenario, in their order.

    Parameters
    ----------
    prepared : Prepared
        The scenario with everything it names.
    progress : callable, optional
        Called with the time now and at the end [s], and what is done.
    spill : Path, optional
        A folder: the rows of long tables wait there and not in memory; ``write`` completes their
        files.
    observer : Observer, optional
        Sees the world of each method.
    """
    methods = prepared.scenario.methods
    tables = new_tables(spill)
    earlier_cars: set[str] = set()
    for number, entry in enumerate(methods):
        report = _of_all(progress, number, len(methods))
        earlier_cars |= simulate_method(
            prepared,
            entry,
            tables,
            earlier_cars=earlier_cars,
            progress=report,
            observer=observer,
        )
    return tables


def _of_all(progress: Progress | None, number: int, methods: int) -> Progress:
    """Returns what takes the seconds of one method, the ``number``-th, and tells those of all."""

    def report(now_s: float, end_s: float, text: str) -> None:
        if progress is not None:
            progress(number * end_s + now_s, methods * end_s, text)

    return report


@contextmanager
def gc_disabled() -> Iterator[None]:
    """Disables Python's garbage collector while a simulation runs, and collects what was left by
    it.

    A simulation makes very many small objects and leaves no reference cycles while time runs, so
    the collector would find nothing; with ten thousand cars in memory its passes would take longer
    than the simulation. What was there before is not searched.
    """
    was_enabled = gc.isenabled()
    gc.disable()
    gc.freeze()
    try:
        yield
    finally:
        gc.collect()
        gc.unfreeze()
        if was_enabled:
            gc.enable()


@gc_disabled()
def simulate_method(
    prepared: Prepared,
    entry: MethodEntry,
    tables: Tables,
    *,
    earlier_cars: Collection[str],
    progress: Progress,
    observer: Observer | None = None,
) -> set[str]:
    """Adds the rows of one method to the tables; returns the cars on which it runs something.

    ``earlier_cars`` are those on which methods before it do: rows that are the same under every
    method are written once. ``progress`` is called with the time now and at the end [s]. An
    ``observer`` sees the world before and after.
    """
    scenario = prepared.scenario
    with own_code_named(scenario):
        setup = build.setup(prepared, entry)
        judge = make_judge(prepared, entry.name, setup, tables, earlier_cars=earlier_cars)
        agreement = None
        if "answers" in scenario.record:
            agreement = Agreement(entry.name, tables["answers"])
        samples: Samples = "all" if scenario.fleet is None else "edges"
        if "resources" not in scenario.record:
            samples = "none"
        for table in tables.values():
            table.leave_out(scenario.warm_up_ns)
        log = Log(
            entry.name,
            tables,
            record=scenario.record,
            samples=samples,
            agreement=agreement,
            judge=judge,
            earlier_cars=earlier_cars,
        )
        world = World(setup, entry.new(), log)
        check_warm_up(scenario, world.last_frame_ns)
        if observer is not None:
            observer.before(entry.name, world)
        world.run(_progress_of(log, progress))
        if observer is not None:
            observer.after(entry.name, world)
    note_power(tables["power"], entry.name, prepared, setup)
    return {car.name for car in setup.cars if car.name in world.network.graphs}


def check_warm_up(scenario: Scenario, last_frame_ns: int) -> None:
    """Raises ``UserError`` if the warm-up is longer than the run."""
    if scenario.warm_up_ns > last_frame_ns:
        text = (
            f"{duration_text(scenario.warm_up_ns)} leaves nothing to count: the last frame is "
            f"taken at {last_frame_ns / NS_PER_S:.1f} s"
        )
        raise scenario.error_at("warm_up", text)


def check_labelled(scenario: Scenario, car: Car, drive: Drive, labelled: Collection[str]) -> None:
    """Raises ``UserError`` if the cameras by which a car is to be judged are not ``labelled``, as
    those are of which its truth tells.
    """
    recordings = dict.fromkeys(camera.recording for camera in scenario.cameras_of(car))
    others = [recording for recording in recordings if recording not in labelled]
    if others and (scenario.judged == "all" or len(others) == len(recordings)):
        text = (
            f"held: {car.name} cannot be judged at the frames of {', '.join(others)}: the truth "
            f"table of {drive.name} is of {', '.join(labelled)} alone; take held out, or the "
            "table away"
        )
        raise scenario.error_at("record", text)


def _progress_of(log: Log, progress: Progress) -> Callable[[int, int], None]:
    """Returns what reports the simulated time of one method, and the frames simulated a second."""
    began_s = time.perf_counter()
    text, text_until_s = "", began_s

    def report(now_ns: int, end_ns: int) -> None:
        nonlocal text, text_until_s
        time_s = time.perf_counter()
        if time_s >= text_until_s:
            rate = log.published_frames / max(time_s - began_s, 1e-9)
            text, text_until_s = f"{log.method}, {rate:,.0f} frames/s", time_s + TEXT_S
        progress(now_ns / NS_PER_S, end_ns / NS_PER_S, text)

    return report


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


def make_judge(
    prepared: Prepared,
    method: str,
    setup: Setup,
    tables: Tables,
    *,
    earlier_cars: Collection[str],
) -> ConsumerJudge | None:
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
    earlier_cars : collection of str
        Cars that an earlier method had, so that their zero-delay detector is judged already.
    """
    record = prepared.scenario.record
    if "held" not in record:
        return None
    truths = {car: prepared.frames.truth_of(drive) for car, drive in prepared.drives.items()}
    truths = {car: truth for car, truth in truths.items() if truth is not None}
    if not truths:
        return None
    for car in prepared.scenario.cars:
        truth = truths.get(car.name)
        if truth is not None and truth.cameras is not None:
            check_labelled(prepared.scenario, car, prepared.drives[car.name], truth.cameras)
    return ConsumerJudge(
        method,
        truths,
        tables["held"],
        earlier_cars=earlier_cars,
        make_consumer=partial(setup.settings.consumer.new, setup.laws),
        held_objects=tables["held_objects"] if "held_objects" in record else None,
        all_streams=prepared.scenario.judged == "all",
    )
