"""Measurements of links in the formats of others, as the columns of a recording."""

import csv
import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import datetime
from itertools import pairwise
from typing import Any, Literal

from genie_sim.base.errors import UserError, short_repr
from genie_sim.base.units import NS_PER_MS, NS_PER_S

Direction = Literal["up", "down"]
Columns = dict[str, list[Any]]
PACKET_BITS = 1500 * 8  # what Mahimahi sends at each line of a trace
BIN_MS = 100  # of such a trace, over which its packets become a rate


class TextTable:
    """A table of texts with a header, of a file that errors name.

    Parameters
    ----------
    where : str
        The file.
    text : str
        Its content.
    spaces : bool
        Whether spaces and tabs separate the columns, not commas.
    """

    def __init__(self, where: str, text: str, spaces: bool = False) -> None:
        self.where = where
        lines = text.splitlines()
        cells = map(str.split, lines) if spaces else csv.reader(lines)
        table = [[cell.strip() for cell in row] for row in cells if row]
        header, *self._rows = table or [[]]
        self.names = header

    def __len__(self) -> int:
        return len(self._rows)

    def texts(self, name: str) -> list[str]:
        """A column. Raises ``UserError`` if it is missing, or too short somewhere."""
        if name not in self.names:
            names = ", ".join(self.names) or "none"
            raise UserError(f"{self.where}: column {name}: missing; it has {short_repr(names)}")
        at = self.names.index(name)
        for number, row in enumerate(self._rows, 2):
            if len(row) <= at:
                raise UserError(f"{self.where}: line {number}: column {name}: missing")
        return [row[at] for row in self._rows]

    def numbers(self, name: str) -> list[float]:
        """A column of numbers. Raises ``UserError``."""
        values = []
        for number, text in enumerate(self.texts(name), 2):
            values.append(_number(f"{self.where}: line {number}: column {name}", text))
        return values

    def rising(self, name: str) -> list[float]:
        """A column of numbers, each larger than the one before. Raises ``UserError``."""
        values = self.numbers(name)
        for number, (before, value) in enumerate(itertools.pairwise(values), 3):
            if value <= before:
                problem = f"must be more than {before:g} of the line before, not {value:g}"
                raise UserError(f"{self.where}: line {number}: column {name}: {problem}")
        return values

    def not_negative(self, name: str) -> list[float]:
        """A column of numbers from 0 on. Raises ``UserError``."""
        values = self.numbers(name)
        for number, value in enumerate(values, 2):
            if value < 0:
                problem = f"must be at least 0, not {value:g}"
                raise UserError(f"{self.where}: line {number}: column {name}: {problem}")
        return values

    def times(self, name: str, format: str) -> list[int]:
        """A column of dates, in nanoseconds since the first. Raises ``UserError``."""
        dates = []
        for number, text in enumerate(self.texts(name), 2):
            try:
                dates.append(datetime.strptime(text, format))
            except ValueError:
                example = datetime(2022, 8, 11, 13, 42, 6).strftime(format)
                problem = f"must be a time such as {example!r}, not {short_repr(text)}"
                raise UserError(f"{self.where}: line {number}: column {name}: {problem}") from None
        return [round((date - dates[0]).total_seconds()) * NS_PER_S for date in dates]


def _number(where: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise UserError(f"{where}: must be a number, not {short_repr(text)}")
    return value


def _scaled(values: Iterable[float], factor: float) -> list[int]:
    return [round(value * factor) for value in values]


def from_csv(where: str, text: str, direction: Direction) -> Columns:
    """``time_s`` and any of ``up_mbps``, ``down_mbps``, ``rtt_ms``, ``east_m`` and ``north_m``."""
    rows = TextTable(where, text)
    columns: Columns = {"t_ns": _scaled(rows.rising("time_s"), NS_PER_S)}
    for name, column, factor in (
        ("up_mbps", "up_bps", 1e6),
        ("down_mbps", "down_bps", 1e6),
        ("rtt_ms", "rtt_ns", NS_PER_MS),
    ):
        if name in rows.names:
            columns[column] = _scaled(rows.not_negative(name), factor)
    if len(columns) == 1:
        raise UserError(f"{where}: needs a column of up_mbps, down_mbps, rtt_ms")
    for name in ("east_m", "north_m"):
        if name in rows.names:
            columns[name] = rows.numbers(name)
    return columns


def from_cicv5g(where: str, text: str, direction: Direction) -> Columns:
    """Round trips and poses of CICV5G (zxr805/CICV5G, CC BY 4.0), east and north of the first
    row's. Of several messages sent in the same millisecond the first is taken.
    """
    rows = TextTable(where, text, spaces=True)
    sent_ms = rows.numbers("pub_time(ms)")
    first = [row for row, t_ms in enumerate(sent_ms) if row == 0 or t_ms != sent_ms[row - 1]]
    delays_ms = rows.numbers("delay(ms)")
    columns: Columns = {
        "t_ns": _scaled((sent_ms[row] - sent_ms[0] for row in first), NS_PER_MS),
        "rtt_ns": _scaled((delays_ms[row] for row in first), NS_PER_MS),
    }
    for name, column in (("utmX(m)", "east_m"), ("utmY(m)", "north_m")):
        values = rows.numbers(name)
        columns[column] = [round(values[row] - values[0], 3) for row in first]
    return columns


def from_mtu(where: str, text: str, direction: Direction) -> Columns:
    """Saturated uplinks of MTU-Insectt/Measurements5G. A row's rate is the mean since the row
    before, so it belongs to the time before it.
    """
    rows = TextTable(where, text)
    t_ns = rows.times("Time", "%a %b %d %H:%M:%S UTC %Y")
    rates_bps = _scaled(rows.numbers("RATE(MBit/s)"), 1e6)
    return {"t_ns": t_ns[:-1], f"{direction}_bps": rates_bps[1:]}


def from_irish(where: str, text: str, direction: Direction) -> Columns:
    """Downloads of uccmisl/5Gdataset: seconds in which the phone was downloading (state ``D``);
    others say nothing of what the link could carry, and nor does the uplink, which had
    acknowledgements only.
    """
    if direction == "up":
        raise UserError(f"{where}: --direction: these drives are downloads: only 'down' is known")
    rows = TextTable(where, text)
    times_ns = rows.times("Timestamp", "%Y.%m.%d_%H.%M.%S")
    rates_bps, states = _scaled(rows.numbers("DL_bitrate"), 1e3), rows.texts("State")
    seconds = zip(times_ns, rates_bps, states, strict=True)
    by_second = {t_ns: rate_bps for t_ns, rate_bps, state in seconds if state == "D"}
    return {"t_ns": list(by_second), "down_bps": list(by_second.values())}


def from_mahimahi(where: str, text: str, direction: Direction) -> Columns:
    """A packet-delivery trace of Mahimahi: a line for each packet of 1,500 bytes, the millisecond
    at which it can leave. Packets of 100 ms at a time are a rate.
    """
    lines = [line for line in text.splitlines() if line.strip()]
    times_ms = [_number(f"{where}: line {at}", line) for at, line in enumerate(lines, 1)]
    for at, (before, after) in enumerate(pairwise(times_ms), 2):
        if after < before:
            raise UserError(f"{where}: line {at}: {after:g} ms is before {before:g} ms")
    count = math.ceil(times_ms[-1] / BIN_MS) if times_ms else 0
    packets = [0] * count
    for t_ms in times_ms:
        packets[max(0, math.ceil(t_ms / BIN_MS) - 1)] += 1
    rate_bps = PACKET_BITS * 1000 // BIN_MS
    return {
        "t_ns": [number * BIN_MS * NS_PER_MS for number in range(count)],
        f"{direction}_bps": [packet * rate_bps for packet in packets],
    }


Importer = Callable[[str, str, Direction], Mapping[str, Sequence[Any]]]
IMPORTERS: dict[str, Importer] = {
    "csv": from_csv,
    "cicv5g": from_cicv5g,
    "mtu": from_mtu,
    "irish": from_irish,
    "mahimahi": from_mahimahi,
}
