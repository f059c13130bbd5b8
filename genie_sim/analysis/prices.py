"""What a method costs: bytes, computing time and energy, as arithmetic on the tables ``hosts`` and
``power``.

The energy of a host is ``P_idle T + P_accelerator t_accelerator + P_core t_cores``, that of a car's
network interface ``P_port T + P_transfer t_transfer + P_tail t_tail`` and what each megabit takes.
T is the time in which a host is there: a car from its start to its last frame or the last answer to
one, an edge until that of all cars; afterwards a run only waits. So energy is linear in the powers,
and whether one method takes less than another over all their ranges is decided exactly.
"""

import math
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal, NamedTuple

import numpy as np

from genie_sim.analysis.metric import (
    LOWER,
    MAIN,
    REST,
    Metric,
    Sample,
    Seen,
    Tables,
    quotient,
)
from genie_sim.analysis.statistics import Measured
from genie_sim.base.units import NS_PER_S
from genie_sim.record.columns import Columns
from genie_sim.record.records import CONSUMER

BITS_PER_MEGABIT = 10**6
Key = tuple[str, str, str]  # kind, name and part of a power
End = Literal["value", "low", "high"]
ENDS: tuple[End, ...] = ("value", "low", "high")
PRICES = "Prices"
READ = ("frames", "hosts", "power", "held")  # the tables


@dataclass(frozen=True)
class Ledger:
    """The energy of the hosts of one method and placement: how long each power is taken [s], or
    how many megabits are carried, and the powers. ``unknown`` names those without known power.
    """

    amounts: Mapping[Key, float]
    powers: Mapping[Key, Mapping[End, float]]
    unknown: Sequence[str] = ()

    def joules(self, end: End = "value") -> float | None:
        """The energy with all powers at one end of their ranges; ``None`` if any is unknown."""
        if self.unknown:
            return None
        return math.fsum(amount * self.powers[key][end] for key, amount in self.amounts.items())


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


def ledger(hosts: Columns, power: Columns | None) -> Ledger:
    """The energy of these hosts, all of one method.

    Parameters
    ----------
    hosts : Columns
        What ``with_time`` made of rows of the table ``hosts``.
    power : Columns or None
        Rows of the table ``power`` of the same method; ``None``: none is known.
    """
    powers: dict[Key, dict[End, float]] = {}
    if power is not None:
        keys = zip(*(power[name].tolist() for name in ("kind", "name", "part")), strict=True)
        columns = {end: power.floats(end).tolist() for end in ENDS}
        powers = {key: {end: columns[end][row] for end in ENDS} for row, key in enumerate(keys)}
    amounts: defaultdict[Key, float] = defaultdict(float)
    unknown: dict[str, None] = {}
    for device, of_device in hosts.groups("device"):
        times = {
            "idle": float(of_device["there_s"].sum()),
            "accelerator": float(of_device["accelerator_ns"].sum()) / NS_PER_S,
            "core": float(of_device["cpu_ns"].sum()) / NS_PER_S,
        }
        for part, amount in times.items():
            key = ("device", device, part)
            amounts[key] += amount
            if key not in powers:
                unknown[device] = None
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
    carried = hosts["bytes_up"] + hosts["bytes_down"]
    if ((carried > 0) & ~hosts["interface"].has_text).any():
        unknown["the cars' network interfaces"] = None
    return Ledger(amounts, powers, tuple(unknown))


def ledgers(tables: Tables) -> dict[str, Ledger]:
    """The energy of a method's hosts by placement; empty where it took no frame."""
    return {
        seen.placement: ledger(seen.rows.hosts, seen.rows.power)
        for seen in views(tables)
        if seen.kind == "hosts"
    }


class Hosts(NamedTuple):
    """The hosts of a method in one placement, each with the time in which it is there, the powers
    of all, and how many there are of what energy is divided by.
    """

    hosts: Columns
    power: Columns | None
    counts: Mapping[str, int]

    def sum(self, column: str, unit: float = 1) -> float:
        """Over these hosts."""
        return float(self.hosts[column].sum()) / unit


def views(tables: Tables) -> Iterator[Seen]:
    """All hosts of a method, and those on cars and on edges."""
    if "hosts" not in tables or "frames" not in tables:
        return
    frames = tables["frames"]
    hosts = with_time(tables["hosts"], frames)
    counts = {"frame": len(frames)}
    if "held" in tables:
        counts["right"] = int(tables["held"].where(what=CONSUMER)["right"].sum())
    for placement in ("all", "car", "edge"):
        rows = hosts if placement == "all" else hosts.where(placement=placement)
        if len(rows):
            yield Seen("hosts", Hosts(rows, tables.get("power"), counts), placement)


def _batches(hosts: Hosts) -> Measured | None:
    on_edges = (hosts.hosts["placement"] == "edge").all()
    batches = hosts.sum("batches")
    return quotient(hosts.sum("pictures"), batches) if on_edges and batches else None


def _energy(hosts: Hosts, per: str) -> Measured | None:
    if per not in hosts.counts:
        return None
    energy, n = ledger(hosts.hosts, hosts.power), hosts.counts[per]
    joules = (energy.joules(end) for end in ENDS)
    value, low, high = (None if of_end is None or not n else of_end / n for of_end in joules)
    return Measured(value, n=n, range_low=low, range_high=high)


def _of_hosts(
    title: str, unit: str, meaning: str, formula: Callable[[Hosts], Any], **words: Any
) -> Metric:
    words = {"better": LOWER, "rows": "hosts"} | words
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
        lambda hosts: Measured(hosts.sum("accelerator_ns", NS_PER_S), n=len(hosts.hosts)),
        tier=MAIN,
    ),
    "cpu_time": _of_hosts(
        "CPU time",
        "s",
        "Time that CPU cores worked, summed over them.",
        lambda hosts: Measured(hosts.sum("cpu_ns", NS_PER_S), n=len(hosts.hosts)),
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
        partial(_energy, per="frame"),
        tier=MAIN,
    ),
    "energy_per_right": _of_hosts(
        "energy per right object",
        "J",
        "Energy per right object that a consumer holds at a frame of its first camera."
        + OVER_POWERS,
        partial(_energy, per="right"),
    ),
}


def takes_less(ours: Ledger, theirs: Ledger) -> bool | None:
    """Whether we take less than they do whatever the powers are within their ranges; ``None`` if
    that depends on them. Both have the same powers.

    The difference is linear in each power, so its extremes are at the ends of the ranges.
    """
    if ours.unknown or theirs.unknown:
        return None
    least = most = 0.0
    for key in {**ours.amounts, **theirs.amounts}:
        amount = ours.amounts.get(key, 0.0) - theirs.amounts.get(key, 0.0)
        power = (ours.powers if key in ours.powers else theirs.powers)[key]
        least += amount * power["low" if amount > 0 else "high"]
        most += amount * power["high" if amount > 0 else "low"]
    if most < 0:
        return True
    return False if least > 0 else None


def unknown_powers(runs: Sequence[Mapping[str, Columns]], methods: Sequence[str]) -> list[str]:
    """The devices and interfaces of some runs without known power."""
    names = [name for method in methods for name in per_frame(runs, method).unknown]
    return list(dict.fromkeys(names))


def order(runs: Sequence[Mapping[str, Columns]], methods: Sequence[str]) -> dict[str, list[str]]:
    """For each method those that take more energy per frame in every run, whatever the powers are
    within their ranges; the method that takes least on average comes first.
    """
    means = {method: per_frame(runs, method).joules() for method in methods}
    known = [method for method in methods if means[method] is not None]
    known.sort(key=lambda method: means[method] or 0.0)
    of_runs = [{method: per_frame([tables], method) for method in known} for tables in runs]
    return {
        method: [
            other
            for other in known
            if all(takes_less(of_run[method], of_run[other]) for of_run in of_runs)
        ]
        for method in known
    }


def per_frame(runs: Sequence[Mapping[str, Columns]], method: str) -> Ledger:
    """The energy of all hosts of a method per published frame, mean over runs of one setting."""
    amounts: defaultdict[Key, float] = defaultdict(float)
    powers: dict[Key, Mapping[End, float]] = {}
    unknown: dict[str, None] = {}
    for tables in runs:
        of_method = {
            name: table.where(method=method) for name, table in tables.items() if name in READ
        }
        of_all = ledgers({name: table for name, table in of_method.items() if len(table)}).get(
            "all"
        )
        if of_all is None:
            return Ledger({}, {}, ("hosts that took no frame",))
        n = len(of_method["frames"]) * len(runs)
        for key, amount in of_all.amounts.items():
            amounts[key] += amount / n
        powers.update(of_all.powers)
        unknown.update(dict.fromkeys(of_all.unknown))
    return Ledger(amounts, powers, tuple(unknown))
