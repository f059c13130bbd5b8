"""What a method costs: bytes, computing time and energy, as arithmetic on the tables ``hosts`` and
``power``.

The energy of a host is ``P_idle T + P_accelerator t_accelerator + P_core t_cores``, that of a car's
network interface ``P_port T + P_transfer t_transfer + P_tail t_tail`` and what each megabit takes.
T is the time in which a host is there: a car from its start to its last frame or the last answer to
one, an edge until that of all cars; afterwards a run only waits.
"""

import math
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from genie_sim.analysis.metric import (
    LOWER,
    MAIN,
    REST,
    Given,
    MethodTables,
    Metric,
    Sample,
    of_method,
    quotient,
)
from genie_sim.analysis.statistics import Estimate
from genie_sim.base.units import NS_PER_S
from genie_sim.record.columns import Columns
from genie_sim.record.results import Run

BITS_PER_MEGABIT = 10**6
Key = tuple[str, str, str]  # kind, name and part of a power
ENDS = ("value", "low", "high")
PRICES = "Prices"
READ = ("frames", "hosts", "power")  # the tables
INSTANTS = ("stamp_ns", "first_answer_ns", "fresh_answer_ns", "result_answer_ns")


def with_time(hosts: Columns, frames: Columns) -> Columns:
    """The hosts of one method with a column ``there_s``: for how long each is there [s].

    Parameters
    ----------
    hosts : Columns
        Rows of the table ``hosts``.
    frames : Columns
        All rows of the table ``frames`` of the same method.
    """
    ends_ns = {
        car: max(float(np.nanmax(of_car.floats(name), initial=0)) for name in INSTANTS)
        for car, of_car in frames.groups("car")
    }
    last_ns = max(ends_ns.values(), default=0.0)
    of_hosts = zip(hosts["host"].tolist(), hosts["placement"].tolist(), strict=True)
    until_ns = [
        ends_ns.get(host, 0.0) if placement == "car" else last_ns for host, placement in of_hosts
    ]
    there_ns = np.array(until_ns, dtype=float) - hosts["begin_ns"]
    return hosts.assign(there_s=np.maximum(there_ns, 0.0) / NS_PER_S)


class Energy(NamedTuple):
    """What some hosts took [J], with all powers as they are and at the lower and the upper end of
    their ranges; ``None`` each where one is ``unknown``, of which device or interface it says.
    """

    joules: Sequence[float | None]
    unknown: Sequence[str]


def energy(hosts: Columns, power: Columns | None) -> Energy:
    """The energy of these hosts, all of one method.

    Parameters
    ----------
    hosts : Columns
        What ``with_time`` made of rows of the table ``hosts``.
    power : Columns or None
        Rows of the table ``power`` of the same method; ``None``: none is known.
    """
    amounts: defaultdict[Key, float] = defaultdict(float)  # how long [s], or how many megabits
    for device, of_device in hosts.groups("device"):
        amounts["device", device, "idle"] += float(of_device["there_s"].sum())
        for part, column in (("accelerator", "accelerator_ns"), ("core", "cpu_ns")):
            amounts["device", device, part] += float(of_device[column].sum()) / NS_PER_S
    for interface, of_interface in hosts.groups("interface"):
        of_parts = {
            "port": float(of_interface["there_s"].sum()),
            "transfer": float(of_interface["transfer_ns"].sum()) / NS_PER_S,
            "tail": float(of_interface["tail_ns"].sum()) / NS_PER_S,
            "up": 8 * float(of_interface["bytes_up"].sum()) / BITS_PER_MEGABIT,
            "down": 8 * float(of_interface["bytes_down"].sum()) / BITS_PER_MEGABIT,
        }
        for part, amount in of_parts.items():
            amounts["interface", interface, part] += amount
    powers: dict[Key, tuple[float, ...]] = {}
    if power is not None:
        keys = zip(*(power[name].tolist() for name in ("kind", "name", "part")), strict=True)
        ends = zip(*(power.floats(end).tolist() for end in ENDS), strict=True)
        powers = dict(zip(keys, ends, strict=True))
    unknown = dict.fromkeys(key[1] for key in amounts if key not in powers)
    carried = hosts["bytes_up"] + hosts["bytes_down"]
    if ((carried > 0) & ~hosts["interface"].has_text).any():
        unknown["the cars' network interfaces"] = None
    if unknown:
        return Energy([None] * len(ENDS), list(unknown))
    joules = [
        math.fsum(amount * powers[key][place] for key, amount in amounts.items())
        for place in range(len(ENDS))
    ]
    return Energy(joules, [])


class Hosts(NamedTuple):
    """The hosts of a method in one placement, each with the time in which it is there, the powers
    of all, and how many frames were published.
    """

    hosts: Columns
    power: Columns | None
    frames: int

    def sum(self, column: str, unit: float = 1) -> float:
        """Over these hosts."""
        return float(self.hosts[column].sum()) / unit


def views(tables: MethodTables) -> Iterator[Given]:
    """All hosts of a method, and those on cars and on edges."""
    if "hosts" not in tables or "frames" not in tables:
        return
    frames = tables["frames"]
    hosts = with_time(tables["hosts"], frames)
    for placement in ("all", "car", "edge"):
        rows = hosts if placement == "all" else hosts.where(placement=placement)
        if len(rows):
            yield Given("hosts", Hosts(rows, tables.get("power"), len(frames)), placement)


def _batches(hosts: Hosts) -> Estimate | None:
    on_edges = (hosts.hosts["placement"] == "edge").all()
    batches = hosts.sum("batches")
    return quotient(hosts.sum("pictures"), batches) if on_edges and batches else None


def _energy(hosts: Hosts) -> Estimate:
    n = hosts.frames
    value, low, high = (
        None if of_end is None or not n else of_end / n
        for of_end in energy(hosts.hosts, hosts.power).joules
    )
    return Estimate(value, n=n, range_low=low, range_high=high)


def _of_hosts(
    title: str, unit: str, meaning: str, formula: Callable[[Hosts], Any], **words: Any
) -> Metric:
    words = {"better": LOWER, "kind": "hosts"} | words
    return Metric(title, unit, section=PRICES, meaning=meaning, formula=formula, **words)


def _of_frames(title: str, meaning: str, column: str, tier: int) -> Metric:
    def bytes_of(frames: Columns) -> Sample:
        return Sample(frames, frames[column], np.ones(len(frames)))

    return Metric(title, "B", LOWER, PRICES, meaning=meaning, formula=bytes_of, tier=tier)


OVER_POWERS = " Its range: with every power at the lower and the upper end of its own."
METRICS = {
    "bytes_up_per_frame": _of_frames(
        "sent up per frame",
        "Bytes that cars sent to their edges per published frame.",
        "bytes_up",
        MAIN,
    ),
    "bytes_down_per_frame": _of_frames(
        "sent down per frame",
        "Bytes that edges sent to cars per published frame.",
        "bytes_down",
        REST,
    ),
    "accelerator_time": _of_hosts(
        "accelerator time",
        "s",
        "Time that accelerators worked, summed over them.",
        lambda hosts: Estimate(hosts.sum("accelerator_ns", NS_PER_S), n=len(hosts.hosts)),
        tier=MAIN,
    ),
    "batch_size": _of_hosts(
        "pictures per batch",
        "pictures",
        "Mean number of pictures that were detected at once.",
        _batches,
        better="",
    ),
    "energy_per_frame": _of_hosts(
        "energy per frame",
        "J",
        "Energy per published frame." + OVER_POWERS,
        _energy,
        tier=MAIN,
    ),
}


def unknown_powers(runs: Sequence[Run]) -> list[str]:
    """A sentence that names the devices and interfaces without known power; none where all are
    known.
    """
    unknown: dict[str, None] = {}
    for run in runs:
        tables = {name: run.tables[name] for name in READ if name in run.tables}
        for method in run.methods:
            for given in views(of_method(tables, method.name)):
                hosts: Hosts = given.rows
                unknown.update(dict.fromkeys(energy(hosts.hosts, hosts.power).unknown))
    return [f"Not known: the power of {', '.join(unknown)}."] if unknown else []
