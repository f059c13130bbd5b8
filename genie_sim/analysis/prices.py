"""What a method costs: bytes, computing time and energy, as arithmetic on the tables ``hosts`` and
``power``.

The energy of a host is ``P_idle T + P_accelerator t_accelerator + P_core t_cores``, that of a car's
network interface ``P_port T + P_transfer t_transfer + P_tail t_tail`` and what each megabit takes.
T is the time in which a host is there: a car from its start to its last frame or the last answer to
one, an edge until that of all cars; afterwards a run only waits. So energy is linear in the powers,
and whether one method takes less than another over all their ranges is decided exactly.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np

from genie_sim.analysis.metric import LOWER, POWERS, Metric, Ratio, Views, Where, quotient
from genie_sim.analysis.statistics import Measured
from genie_sim.base.units import NS_PER_S
from genie_sim.record.columns import Columns
from genie_sim.record.records import CONSUMER
from genie_sim.record.results import MethodInfo

BITS_PER_MEGABIT = 10**6
Key = tuple[str, str, str]  # kind, name and part of a power
End = Literal["value", "low", "high"]
ENDS: tuple[End, ...] = ("value", "low", "high")
PRICES = "Prices"


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


def ledgers(tables: Mapping[str, Columns], method: str) -> dict[str, Ledger]:
    """The energy of a method's hosts by placement; empty where it took no frame."""
    hosts = tables["hosts"].where(method=method)
    frames = tables["frames"].where(method=method)
    if not len(hosts) or not len(frames):
        return {}
    power = tables.get("power")
    of_method = None if power is None else power.where(method=method)
    placed = _placed(with_time(hosts, frames))
    return {placement: ledger(rows, of_method) for placement, rows in placed.items()}


def _placed(hosts: Columns) -> dict[str, Columns]:
    placed = {name: hosts.where(placement=name) for name in ("car", "edge")}
    return {"all": hosts} | {name: rows for name, rows in placed.items() if len(rows)}


class Carried(NamedTuple):
    """The hosts of a method, with the time in which each is there, and the frames."""

    hosts: Columns
    frames: Columns


class Worked(NamedTuple):
    """The hosts of a method in one placement."""

    hosts: Columns
    placement: str


class Consumed(NamedTuple):
    """The energy of a method's hosts in one placement, with all powers at each of ``ENDS`` [J], and
    what it is divided by, by metric.
    """

    energy: Ledger
    counts: Mapping[str, int]


def views(
    tables: Mapping[str, Columns], methods: Mapping[str, MethodInfo], intervals: bool
) -> Views:
    """Bytes, computing time and energy of each method, in all, of cars and of edges."""
    if "hosts" not in tables:
        return
    for method in methods:
        hosts = tables["hosts"].where(method=method)
        frames = tables["frames"].where(method=method)
        if not len(hosts) or not len(frames):
            continue
        yield Where(method), Carried(with_time(hosts, frames), frames)
        for placement, rows in _placed(hosts).items():
            yield Where(method, placement), Worked(rows, placement)
        counts = {
            "frame": len(frames),
            "fresh": int((~np.isnan(frames.floats("fresh_answer_ns"))).sum()),
        }
        if "held" in tables:
            held = tables["held"].where(method=method, what=CONSUMER)
            counts["right"] = int(held["right"].sum())
        for placement, energy in ledgers(tables, method).items():
            yield Where(method, placement), Consumed(energy, counts)


class BytesOfFrames(Ratio):
    """Bytes per published frame, frame by frame."""

    unit = "B"
    table = "frames"

    def __init__(self, column: str) -> None:
        self._column = column

    def terms(self, rows: Columns) -> tuple[Any, Any]:
        return rows[self._column], np.ones(len(rows))


class BytesUpPerFrame(Metric):
    """Bytes that cars sent to their edges per published frame."""

    title = "sent up per frame"
    unit = "B"
    better = LOWER
    section = PRICES
    view = Carried
    column = "bytes_up"
    reads = "hosts: bytes_up"

    @property
    def over_rows(self) -> Ratio | None:
        return BytesOfFrames(self.column)

    def of(self, view: Carried) -> Measured:
        n = len(view.frames)
        return quotient(int(view.hosts[self.column].sum()), n, n)


class BytesDownPerFrame(BytesUpPerFrame):
    """Bytes that edges sent to cars per published frame."""

    title = "sent down per frame"
    column = "bytes_down"
    reads = "hosts: bytes_down"


class BytesUpRate(BytesUpPerFrame):
    """Bytes that all cars sent to their edges per second, each in the time in which it drives."""

    title = "sent up per second"
    unit = "B/s"
    reads = f"hosts: host, placement, begin_ns, bytes_up; frames: car, {', '.join(INSTANTS)}"

    @property
    def over_rows(self) -> None:
        return None

    def of(self, view: Carried) -> Measured:
        drives = view.hosts.rows(view.hosts["there_s"] > 0)
        rates = drives[self.column] / drives["there_s"]
        return Measured(float(rates.sum()) if len(drives) else None, n=len(view.frames))


class AcceleratorTime(Metric):
    """Time that accelerators worked, summed over them."""

    title = "accelerator time"
    unit = "s"
    better = LOWER
    section = PRICES
    view = Worked
    column = "accelerator_ns"
    reads = "hosts: accelerator_ns"

    def of(self, view: Worked) -> Measured:
        return Measured(float(view.hosts[self.column].sum()) / NS_PER_S, n=len(view.hosts))


class CpuTime(AcceleratorTime):
    """Time that CPU cores worked, summed over them."""

    title = "CPU time"
    column = "cpu_ns"
    reads = "hosts: cpu_ns"


class BatchSize(Metric):
    """Mean number of pictures that were detected at once."""

    title = "pictures per batch"
    unit = "pictures"
    section = PRICES
    view = Worked
    reads = "hosts: batches, pictures"

    def of(self, view: Worked) -> Measured | None:
        batches = int(view.hosts["batches"].sum())
        if not batches or view.placement != "edge":
            return None
        return quotient(float(view.hosts["pictures"].sum()), batches, batches)


class Energy(Metric):
    """Energy per what is counted."""

    unit = "J"
    better = LOWER
    section = PRICES
    view = Consumed
    mark = POWERS
    per = "frame"
    reads = (
        f"frames: car, {', '.join(INSTANTS)}; power: kind, name, part, value, low, high; "
        "hosts: host, placement, begin_ns, device, accelerator_ns, cpu_ns, interface, "
        "transfer_ns, tail_ns, bytes_up, bytes_down"
    )

    def of(self, view: Consumed) -> Measured | None:
        n = view.counts.get(self.per)
        if n is None:
            return None
        joules = [view.energy.joules(end) for end in ENDS]
        value, low, high = (None if of is None or not n else of / n for of in joules)
        return Measured(value, low, high, n)


class EnergyPerFrame(Energy):
    """Energy per published frame. In brackets: with every power at the lower and the upper end of
    its range.
    """

    title = "energy per frame"


class EnergyPerFresh(Energy):
    """Energy per frame with a fresh result. In brackets: with every power at the lower and the
    upper end of its range.
    """

    title = "energy per fresh result"
    section = ""
    per = "fresh"


class EnergyPerRight(Energy):
    """Energy per right object that a consumer holds at a frame of its first camera. In brackets:
    with every power at the lower and the upper end of its range.
    """

    title = "energy per right object"
    per = "right"
    reads = f"{Energy.reads}; held: right"


METRICS = {
    "bytes_up_per_frame": BytesUpPerFrame(),
    "bytes_up_rate": BytesUpRate(),
    "bytes_down_per_frame": BytesDownPerFrame(),
    "accelerator_time": AcceleratorTime(),
    "cpu_time": CpuTime(),
    "batch_size": BatchSize(),
    "energy_per_frame": EnergyPerFrame(),
    "energy_per_fresh": EnergyPerFresh(),
    "energy_per_right": EnergyPerRight(),
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
        of_all = ledgers(tables, method).get("all")
        if of_all is None:
            return Ledger({}, {}, ("hosts that took no frame",))
        n = len(tables["frames"].where(method=method)) * len(runs)
        for key, amount in of_all.amounts.items():
            amounts[key] += amount / n
        powers.update(of_all.powers)
        unknown.update(dict.fromkeys(of_all.unknown))
    return Ledger(amounts, powers, tuple(unknown))
