"""One method of a run in several processes, each of which simulates a part of the hosts.

Each part writes tables of its own; put together they are those of one process, to the byte.
"""

import pickle
import secrets
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing.connection import Client, Connection, Listener
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import numpy as np

from genie_sim.method_processes import MethodJob, Progress, Reporter, watched
from genie_sim.parallel import in_processes
from genie_sim.paths import atomic_write
from genie_sim.recording.columns import Array, Columns, concat
from genie_sim.recording.later_places import GHOSTS, VISIBLE, with_moved_away
from genie_sim.recording.records import SCHEMAS, Tables, new_tables
from genie_sim.recording.tables import Column, Schema, Table, Value, read
from genie_sim.sim.share import EDGES, Exchange, OrderUnknown

# Rows in the order of events, of which only their parts know when they were scheduled.
BY_EVENT = ("lookups", "looks")
SCHEDULED = Column("scheduled_ns", "int64", "ns", "when the event of the row was scheduled")
POLL_S = 0.02


class PartLost(Exception):
    """Another process of the run has ended, so this one cannot go on."""


@dataclass(frozen=True)
class PartJob(MethodJob):
    """The ``number``-th of so many ``parts``. Their processes meet in the ``meeting`` folder, and
    know each other by the ``key``.
    """

    parts: int
    meeting: Path
    key: bytes


class Connections:
    """Connects a process to those of other parts, by their numbers. See ``sim.share.Exchange``."""

    def __init__(self, connections: Mapping[int, Connection]) -> None:
        self._connections = connections
        # Two that send each other more than a connection holds would wait for each other for ever.
        self._senders = {number: _Sender(of) for number, of in connections.items()}

    def give(self, parcels: Mapping[int, Any]) -> None:
        for number, sender in self._senders.items():
            sender.put(pickle.dumps(parcels[number], protocol=5))

    def take(self) -> Mapping[int, Any]:
        try:
            return {
                number: pickle.loads(of.recv_bytes()) for number, of in self._connections.items()
            }
        except (EOFError, OSError) as error:
            raise PartLost from error

    def close(self) -> None:
        """Waits until everything is sent."""
        for sender in self._senders.values():
            sender.close()


class _Sender:
    """Sends over a connection from a thread of its own."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._waiting: SimpleQueue[bytes | None] = SimpleQueue()
        self.put = self._waiting.put
        self._thread = threading.Thread(target=self._send, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Ends when all is sent."""
        self.put(None)
        self._thread.join()

    def _send(self) -> None:
        with suppress(OSError):  # whoever takes from that process notices that it is lost
            while (parcel := self._waiting.get()) is not None:
                self._connection.send_bytes(parcel)


# Adds the rows of a part to empty tables, which it begins.
SimulatePart = Callable[[PartJob, "PartTables", Exchange, Progress], None]


class PartTables:
    """The tables of a part, in a folder."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.tables: Tables = {}

    def begin(self, scheduled_ns: Callable[[], int]) -> Tables:
        """New tables; ``scheduled_ns`` tells when the present event was scheduled [ns]."""
        self.tables = new_tables(self._folder)
        for name in BY_EVENT:
            spill = self._folder / f"{name}.rows"
            self.tables[name] = _EventTable(SCHEMAS[name], spill, scheduled_ns)
        for schema in (GHOSTS, VISIBLE):
            self.tables[schema.name] = Table(schema, self._folder / f"{schema.name}.rows")
        return self.tables


class _EventTable(Table):
    """A table that notes when the event of each row was scheduled."""

    def __init__(self, schema: Schema, spill: Path, scheduled_ns: Callable[[], int]) -> None:
        super().__init__(_with_events(schema), spill)
        self._scheduled_ns = scheduled_ns

    def append(self, values: Sequence[Value]) -> None:
        super().append((*values, self._scheduled_ns()))


def _with_events(schema: Schema) -> Schema:
    return replace(schema, columns=(*schema.columns, SCHEDULED))


def in_parts(
    simulate: SimulatePart,
    parts: int,
    *,
    cars: Sequence[str],
    hosts: Sequence[str],
    streams: Sequence[str],
    progress: Progress | None = None,
    spill: Path | None = None,
) -> Tables | None:
    """The tables of a method that so many processes simulate together; ``None`` where only one
    process knows the order of two events.

    Raises what ``simulate`` raises, and ``UserError`` where a process was killed.

    Parameters
    ----------
    simulate : callable
        Simulates one part; it is pickled.
    parts : int
        How many there are.
    cars, hosts, streams : sequence of str
        All cars, all hosts and the cameras of every car, in the order in which one process builds
        them.
    progress : callable, optional
        Called by another thread.
    spill : Path, optional
        A folder in which the rows of long tables wait.
    """
    with tempfile.TemporaryDirectory(dir=spill) as scratch:
        meeting, key = Path(scratch), secrets.token_bytes()
        jobs = [
            PartJob(number, meeting / str(number), parts=parts, meeting=meeting, key=key)
            for number in range(parts)
        ]
        for job in jobs:
            job.folder.mkdir()
        with watched(jobs, progress):
            told = in_processes(partial(_write_part, simulate), jobs, parts, ordered=False)
            errors = [error for error in told if error is not None]
        errors.sort(key=lambda error: isinstance(error, PartLost))  # what follows from another
        if any(isinstance(error, OrderUnknown) for error in errors):
            return None
        if errors:
            raise errors[0]
        tables = new_tables(spill)
        try:
            _put_together(tables, jobs, cars=cars, hosts=hosts, streams=streams)
        except OrderUnknown:
            return None
    return tables


def _write_part(simulate: SimulatePart, job: PartJob) -> Exception | None:
    """Simulates a part and writes its tables; returns what went wrong, so that the other parts hear
    of it before it is told.
    """
    tables = PartTables(job.folder)
    try:
        with _connected(job) as exchange:
            simulate(job, tables, exchange, Reporter(job))
        for name, table in tables.tables.items():
            table.write(job.folder / f"{name}.parquet")
    except Exception as error:
        return error
    return None


@contextmanager
def _connected(job: PartJob) -> Iterator[Exchange]:
    """What connects a part to others while it runs. Raises ``PartLost``."""
    address = job.meeting / "address"
    with ExitStack() as stack:
        connections: dict[int, Connection] = {}
        if job.number == EDGES:
            listener = stack.enter_context(Listener(backlog=job.parts, authkey=job.key))
            with atomic_write(address) as beside:
                beside.write_bytes(pickle.dumps(listener.address))
            while len(connections) < job.parts - 1:
                connection = stack.enter_context(listener.accept())
                connections[connection.recv()] = connection
        else:
            while not address.exists():
                time.sleep(POLL_S)
            where = pickle.loads(address.read_bytes())
            connections[EDGES] = stack.enter_context(Client(where, authkey=job.key))
            connections[EDGES].send(job.number)
        exchange = Connections(dict(sorted(connections.items())))
        yield exchange
        exchange.close()  # not after an error: perhaps nobody takes any more


def _put_together(
    tables: Tables,
    jobs: Sequence[MethodJob],
    *,
    cars: Sequence[str],
    hosts: Sequence[str],
    streams: Sequence[str],
) -> None:
    """Adds the rows of all parts. Raises ``OrderUnknown``."""
    for name, table in tables.items():
        schema = _with_events(SCHEMAS[name]) if name in BY_EVENT else SCHEMAS[name]
        parts = [read(job.folder / f"{name}.parquet", schema) for job in jobs]
        rows = concat(parts)
        part = np.repeat(np.arange(len(parts)), [len(of_part) for of_part in parts])
        if name in BY_EVENT:
            rows = rows.rows(_by_event(rows, part))
        elif name == "poses":
            camera = rows["car"].codes_in(cars) * len(streams) + rows["stream"].codes_in(streams)
            rows = rows.rows(_by_camera(rows["stamp_ns"], camera))
        elif name == "held":
            order = _by_camera(rows["stamp_ns"], rows["car"].codes_in(cars))
            ghosts, visible = (
                [read(job.folder / f"{schema.name}.parquet", schema) for job in jobs]
                for schema in (GHOSTS, VISIBLE)
            )
            rows = with_moved_away(parts, ghosts, visible, order)
        elif name == "hosts":
            rows = rows.rows(np.argsort(rows["host"].codes_in(hosts)))
        elif name != "frames":  # which is sorted when it is written
            rows = parts[EDGES]
        table.extend(rows)


def _by_event(rows: Columns, part: Array) -> Array:
    """The order of rows by their events. Raises ``OrderUnknown`` where two, of two parts, happened
    at one instant and were scheduled at one instant.
    """
    instants = np.stack([rows["t_ns"], rows[SCHEDULED.name]])
    order = np.lexsort(instants[::-1])
    is_tie = (np.diff(instants[:, order]) == 0).all(axis=0) & (np.diff(part[order]) != 0)
    if is_tie.any():
        raise OrderUnknown
    return order


def _by_camera(stamp_ns: Array, camera: Array) -> Array:
    """The order of rows by the frames that they are about. Raises ``OrderUnknown`` unless all
    cameras take frames at one interval.

    Of frames of one instant, first ones come before others: they were scheduled when the run began,
    others when the camera took the frame before. Of two others that whose camera began later comes
    first, because all its frames have followed that order; else the camera that was built first.
    """
    if not len(stamp_ns):
        return np.arange(0)
    first_ns = np.full(camera.max() + 1, np.iinfo(np.int64).max)
    np.minimum.at(first_ns, camera, stamp_ns)
    by_time = np.lexsort((stamp_ns, camera))
    steps_ns = np.diff(stamp_ns[by_time])[np.diff(camera[by_time]) == 0]
    if len(np.unique(steps_ns[steps_ns > 0])) > 1:
        raise OrderUnknown
    began_ns = first_ns[camera]
    return np.lexsort((camera, -began_ns, stamp_ns != began_ns, stamp_ns))
