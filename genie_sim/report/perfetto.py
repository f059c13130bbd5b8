"""A finished run as a trace for https://ui.perfetto.dev: Chrome's trace events, in JSON.

A process is a host under one method; its threads are lanes of what serves there: accelerator, cpu,
uplink, downlink, edges. A slice is the service of one frame, out of the table ``steps``, so on the
way of an answer; slices that overlap lie in lanes of their own (``cpu 2``). A counter is how many
messages wait, out of ``resources``.

Times are whole microseconds since the beginning of the simulation, rounded down from nanoseconds,
so that nothing changes places; the nanoseconds are arguments of each slice.
"""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from genie_sim.base.errors import UserError
from genie_sim.base.paths import OutputKind, atomic_write
from genie_sim.base.text import natural_key
from genie_sim.record import provenance

if TYPE_CHECKING:
    from genie_sim.record.results import Run

NS_PER_US = 1000
LANES = {  # the thread of each part of an answer's way that is service
    "inference": "accelerator",
    "genie": "cpu",
    "encoding": "cpu",
    "uplink": "uplink",
    "downlink": "downlink",
    "edges": "edges",
}
Event = dict[str, Any]
TRACE = OutputKind("trace for Perfetto", rb'\{"displayTimeUnit": "ns"')


def export(run: "Run", out: Path) -> int:
    """Writes the trace of a run; returns how many slices and counter values it holds. Raises
    ``UserError`` for a run without steps.
    """
    if not len(run.tables["steps"]):
        raise UserError(
            f"{run.folder or run.name}: holds no steps, so there is nothing to show; 'record' them"
        )
    with provenance.of_this_version(run.folder):
        trace = _Trace()
        events = [*_slices(run, trace), *_counters(run, trace)]
    events.sort(key=lambda event: event.pop("ns"))
    with atomic_write(out, TRACE) as beside, beside.open("w", encoding="utf-8") as file:
        file.write('{"displayTimeUnit": "ns", "traceEvents": [\n')
        file.write(",\n".join(map(json.dumps, [*trace.names(), *events])))
        file.write("\n]}\n")
    return len(events)


class _Trace:
    """Numbers of processes and threads, given as they come, and what they are called."""

    def __init__(self) -> None:
        self._processes: dict[tuple[str, str], int] = {}
        self._lanes: dict[tuple[int, str], list[int]] = {}  # when each lane is free again [ns]
        self._threads: dict[tuple[int, str], int] = {}

    def process(self, method: str, host: str) -> int:
        """The number of a host under a method."""
        return self._processes.setdefault((method, host), len(self._processes) + 1)

    def lane(self, process: int, name: str, begin_ns: int, end_ns: int) -> int:
        """The number of the first lane of that name that is free. Asked in order of time."""
        free_at = self._lanes.setdefault((process, name), [])
        number = next((n for n, at in enumerate(free_at) if at <= begin_ns), len(free_at))
        if number == len(free_at):
            free_at.append(end_ns)
        free_at[number] = end_ns
        title = name if number == 0 else f"{name} {number + 1}"
        return self._threads.setdefault((process, title), len(self._threads) + 1)

    def names(self) -> Iterator[Event]:
        """What tells the names of processes and threads, and their order: method by method, cars
        before edges; lanes as in ``LANES``.
        """
        order = sorted(self._processes, key=lambda key: (key[0], natural_key(key[1])))
        for place, key in enumerate(order):
            about = {"ph": "M", "pid": self._processes[key]}
            yield about | {"name": "process_name", "args": {"name": f"{key[0]}: {key[1]}"}}
            yield about | {"name": "process_sort_index", "args": {"sort_index": place}}
        kinds = list(dict.fromkeys(LANES.values()))
        for (process, title), thread in self._threads.items():
            kind, _, number = title.partition(" ")
            place = 100 * kinds.index(kind) + int(number or 1)
            about = {"ph": "M", "pid": process, "tid": thread}
            yield about | {"name": "thread_name", "args": {"name": title}}
            yield about | {"name": "thread_sort_index", "args": {"sort_index": place}}


def _slices(run: "Run", trace: _Trace) -> Iterator[Event]:
    """The service of frames, each once, whichever answers it was for."""
    steps: Any = run.steps[run.steps["part"].isin(LANES)]
    frames: Any = run.frames
    numbers = {
        (row.car, row.stream, row.stamp_ns): row.frame for row in frames.itertuples(index=False)
    }
    services: dict[tuple[Any, ...], list[str]] = {}
    for row in steps.sort_values(["begin_ns", "end_ns"], kind="stable").itertuples(index=False):
        which = services.setdefault(tuple(row._replace(which="")), [])
        which.append(row.which)
    for service, which in services.items():
        method, car, stream, stamp_ns, _, part, place, begin_ns, end_ns = service
        lane = LANES[part]
        host = car if part in ("uplink", "downlink") else host_of(place)
        process = trace.process(method, host)
        begin_us, end_us = int(begin_ns) // NS_PER_US, int(end_ns) // NS_PER_US
        yield {
            "ns": int(begin_ns),
            "ph": "X",
            "name": f"{car}/{stream} {numbers.get((car, stream, stamp_ns), '?')}",
            "cat": part,
            "pid": process,
            "tid": trace.lane(process, lane, int(begin_ns), int(end_ns)),
            "ts": begin_us,
            "dur": end_us - begin_us,
            "args": {
                "car": car,
                "stream": stream,
                "stamp_ns": int(stamp_ns),
                "part": part,
                "place": place,
                "answers": ", ".join(dict.fromkeys(which)),
                "begin_ns": int(begin_ns),
                "end_ns": int(end_ns),
            },
        }


def _counters(run: "Run", trace: _Trace) -> Iterator[Event]:
    """How many messages wait, whenever that has changed; of what nobody ever waits for, nothing."""
    of_each: Any = run.resources.groupby(["method", "resource"], sort=False, observed=True)
    for (method, resource), rows in of_each:
        if rows["queue"].max() == 0:
            continue
        changed = rows[rows["queue"].diff().fillna(1) != 0]
        for t_ns, waiting in zip(changed["t_ns"], changed["queue"], strict=True):
            yield {
                "ns": int(t_ns),
                "ph": "C",
                "name": f"waiting for {resource}",
                "pid": trace.process(method, host_of(resource)),
                "ts": int(t_ns) // NS_PER_US,
                "args": {"messages": int(waiting)},
            }


def host_of(resource: str) -> str:
    """``edge1.accelerator``, ``edge1->car1`` and ``edge1/genie:/image_raw`` to ``edge1``."""
    return re.split(r"[./]|->", resource)[0]
