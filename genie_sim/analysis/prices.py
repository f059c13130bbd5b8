"""What a method costs: bytes, computing time and energy, as arithmetic on the tables ``hosts`` and
``power``.

The energy of a host is ``P_idle T + P_accelerator t_accelerator + P_core t_cores``, that of a car's
network interface ``P_port T + P_transfer t_transfer + P_tail t_tail`` and what each megabit takes.
T is the time until the last answer: afterwards a run only waits. So energy is linear in the powers,
and whether one method takes less than another over all their ranges is decided exactly.
"""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from genie_sim.recording.columns import Columns
from genie_sim.recording.records import CONSUMER
from genie_sim.recording.results import Metric
from genie_sim.units import NS_PER_S

BITS_PER_MEGABIT = 10**6
IDLE = ("idle", "port")  # what is always taken
Key = tuple[str, str, str]  # kind, name and part of a power
End = Literal["value", "low", "high"]
ENDS: tuple[End, ...] = ("value", "low", "high")


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
        return sum(amount * self.powers[key][end] for key, amount in self.amounts.items())

    def without_idle(self, end: End = "value") -> float | None:
        """The energy beyond what hosts and ports always take."""
        active = {key: amount for key, amount in self.amounts.items() if key[2] not in IDLE}
        return Ledger(active, self.powers, self.unknown).joules(end)


def duration_ns(frames: Columns) -> int | None:
    """From the start of a run to the last answer; ``None`` without any."""
    columns = ("first_answer_ns", "fresh_answer_ns", "result_answer_ns")
    instants = np.concatenate([frames.floats(name) for name in columns])
    instants = instants[~np.isnan(instants)]
    return int(instants.max()) if len(instants) else None


def ledger(hosts: Columns, power: Columns | None, span_ns: int) -> Ledger:
    """The energy of these hosts, all of one method.

    Parameters
    ----------
    hosts : Columns
        Rows of the table ``hosts``.
    power : Columns or None
        Rows of the table ``power`` of the same method; ``None``: none is known.
    span_ns : int
        The time until the last answer [ns].
    """
    powers: dict[Key, dict[End, float]] = {}
    if power is not None:
        keys = zip(*(power[name].tolist() for name in ("kind", "name", "part")), strict=True)
        columns = {end: power.floats(end).tolist() for end in ENDS}
        powers = {key: {end: columns[end][row] for end in ENDS} for row, key in enumerate(keys)}
    amounts: defaultdict[Key, float] = defaultdict(float)
    unknown: dict[str, None] = {}
    seconds = span_ns / NS_PER_S
    for device, of_device in hosts.groups("device"):
        times = {
            "idle": seconds * len(of_device),
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
            "port": seconds * len(of_interface),
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


def ledgers(tables: Mapping[str, Columns], method: str) -> dict[str, Ledger]:
    """The energy of a method's hosts by placement; empty where no frame was answered."""
    span_ns = duration_ns(tables["frames"].where(method=method))
    hosts = tables["hosts"].where(method=method)
    if span_ns is None or not len(hosts):
        return {}
    power = tables.get("power")
    of_method = None if power is None else power.where(method=method)
    return {
        placement: ledger(rows, of_method, span_ns) for placement, rows in _placed(hosts).items()
    }


def _placed(hosts: Columns) -> dict[str, Columns]:
    placed = {name: hosts.where(placement=name) for name in ("car", "edge")}
    return {"all": hosts} | {name: rows for name, rows in placed.items() if len(rows)}


def of_hosts(tables: Mapping[str, Columns], methods: Sequence[str]) -> Iterator[Metric]:
    """Bytes, computing time and energy of each method. ``low`` and ``high`` of energy are with all
    powers at that end of their ranges.
    """
    for method in methods:
        hosts = tables["hosts"].where(method=method)
        frames = tables["frames"].where(method=method)
        if not len(hosts) or not len(frames):
            continue
        yield from _bytes(hosts, frames, method)
        for placement, rows in _placed(hosts).items():
            where = method, placement, ""
            for name in ("accelerator", "cpu"):
                seconds = float(rows[f"{name}_ns"].sum()) / NS_PER_S
                yield Metric(f"{name}_time", *where, value=seconds, unit="s", n=len(rows))
            batches = int(rows["batches"].sum())
            if batches and placement == "edge":
                size = float(rows["pictures"].sum()) / batches
                yield Metric("batch_size", *where, value=size, unit="pictures", n=batches)
        yield from _energy(tables, frames, method)


def _bytes(hosts: Columns, frames: Columns, method: str) -> Iterator[Metric]:
    where, n, span_ns = (method, "all", ""), len(frames), duration_ns(frames)
    for name in ("bytes_up", "bytes_down"):
        carried = int(hosts[name].sum())
        yield Metric(f"{name}_per_frame", *where, value=carried / n, unit="B", n=n)
        rate = carried * NS_PER_S / span_ns if span_ns else None
        yield Metric(f"{name}_rate", *where, value=rate, unit="B/s", n=n)


def _energy(tables: Mapping[str, Columns], frames: Columns, method: str) -> Iterator[Metric]:
    counts = {
        "energy_per_frame": len(frames),
        "energy_per_fresh": int((~np.isnan(frames.floats("fresh_answer_ns"))).sum()),
    }
    if "held" in tables:
        held = tables["held"].where(method=method, what=CONSUMER)
        counts["energy_per_right"] = int(held["right"].sum())
    for placement, of_placement in ledgers(tables, method).items():
        where = method, placement, ""
        joules = [of_placement.joules(end) for end in ENDS]
        active = [of_placement.without_idle(end) for end in ENDS]
        for name, n in counts.items():
            yield _per(name, where, joules, n)
        yield _per("energy_active_per_frame", where, active, len(frames))


def _per(name: str, where: tuple[str, str, str], joules: Sequence[float | None], n: int) -> Metric:
    value, low, high = (None if of is None or not n else of / n for of in joules)
    return Metric(name, *where, value=value, unit="J", low=low, high=high, n=n)


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
        of_all = ledgers(tables, method).get("all")
        if of_all is None:
            return Ledger({}, {}, ("hosts that answered nothing",))
        n = len(tables["frames"].where(method=method)) * len(runs)
        for key, amount in of_all.amounts.items():
            amounts[key] += amount / n
        powers.update(of_all.powers)
        unknown.update(dict.fromkeys(of_all.unknown))
    return Ledger(amounts, powers, tuple(unknown))
