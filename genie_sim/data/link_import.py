"""Measurements of links in the formats of others, as the columns of a recording."""

import math
from collections.abc import Callable, Iterable, Sequence
from datetime import datetime
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import numpy as np

from genie_sim.base.errors import UserError, as_user_error, short_repr
from genie_sim.base.import_report import ImportReport
from genie_sim.base.paths import read_text
from genie_sim.base.tables import TIME, FileColumn, FileTable, plain_number
from genie_sim.base.units import MAX_TIME_S, NS_PER_MS, NS_PER_S

Direction = Literal["up", "down"]
Columns = dict[str, list[int]]
PACKET_BITS = 1500 * 8  # what Mahimahi sends at each line of a trace
BIN_MS = 100  # of such a trace, over which its packets become a rate
MAX_BINS = 1_000_000  # a day and a bit

MAX_MBPS, MAX_MS = 1e9, 1e9  # what no link has; products with units stay whole
CSV = {  # and the columns of a recording that they become, multiplied
    FileColumn("up_mbps", lowest=0.0, highest=MAX_MBPS): ("up_bps", 1e6),
    FileColumn("down_mbps", lowest=0.0, highest=MAX_MBPS): ("down_bps", 1e6),
    FileColumn("rtt_ms", lowest=0.0, highest=MAX_MS): ("rtt_ns", NS_PER_MS),
}
CICV5G = (
    FileColumn("pub_time_ms", lowest=0.0, highest=MAX_TIME_S * 1e3),
    FileColumn("delay_ms", lowest=0.0, highest=MAX_MS),
)


def _read(
    table: FileTable, columns: Sequence[FileColumn]
) -> tuple[list[str], list[tuple[Any, ...]]]:
    """Where each row stands, and the values of each column. Raises ``UserError``."""
    rows = list(table.rows(columns))
    values = list(zip(*(row.values for row in rows), strict=True)) or [()] * len(columns)
    return [row.where for row in rows], values


def _scaled(values: Iterable[float], factor: float) -> list[int]:
    return [round(value * factor) for value in values]


def _times_ns(where: Sequence[str], texts: Sequence[str], format: str) -> list[int]:
    """Dates, in nanoseconds since the first. Raises ``UserError``."""
    dates = []
    for place, text in zip(where, texts, strict=True):
        try:
            dates.append(datetime.strptime(text, format))
        except ValueError:
            example = datetime(2022, 8, 11, 13, 42, 6).strftime(format)
            problem = f"must be a time such as {example!r}, not {short_repr(text)}"
            raise UserError(f"{place}: Time: {problem}") from None
    return [round((date - dates[0]).total_seconds()) * NS_PER_S for date in dates]


def from_csv(path: Path, direction: Direction, report: ImportReport) -> Columns:
    """``time_s`` and any of ``up_mbps``, ``down_mbps`` and ``rtt_ms``."""
    table = FileTable(path)
    given = [column for column in CSV if table.place(column) is not None]
    if not given:
        titles = ", ".join(map(short_repr, table.titles))
        text = f"needs a column of up_mbps, down_mbps, rtt_ms; the file has {titles}"
        raise UserError(f"{path}: {text}; rates are in bits, not bytes")
    where, (times_s, *values) = _read(table, [TIME, *given])
    for place, (before_s, time_s) in zip(where[1:], pairwise(times_s), strict=True):
        if time_s <= before_s:
            raise UserError(
                f"{place}: time_s: must be more than {before_s:.15g}, not {time_s:.15g}"
            )
    columns: Columns = {"t_ns": _scaled(times_s, NS_PER_S)}
    for column, numbers in zip(given, values, strict=True):
        name, factor = CSV[column]
        columns[name] = _scaled(numbers, factor)
    for title in table.unused([TIME, *given]):
        report.leave_out(f"column {title!r}")
    return columns


def from_cicv5g(path: Path, direction: Direction, report: ImportReport) -> Columns:
    """Round trips of CICV5G (zxr805/CICV5G, CC BY 4.0). Of several messages sent in the same
    millisecond the first is taken.
    """
    # some files have two columns more than titles
    _, (sent_ms, delays_ms) = _read(FileTable(path, uneven=True), CICV5G)
    first = [row for row, t_ms in enumerate(sent_ms) if row == 0 or t_ms != sent_ms[row - 1]]
    why = "sent in the millisecond of another, as where a spreadsheet rounds (1.66E+12)"
    report.check_dropped("messages", len(first), len(sent_ms), why)
    return {
        "t_ns": _scaled((sent_ms[row] - sent_ms[0] for row in first), NS_PER_MS),
        "rtt_ns": _scaled((delays_ms[row] for row in first), NS_PER_MS),
    }


def from_mtu(path: Path, direction: Direction, report: ImportReport) -> Columns:
    """Saturated uplinks of MTU-Insectt/Measurements5G. A row's rate is the mean since the row
    before, so it belongs to the time before it.
    """
    rate = FileColumn("rate_mbps", lowest=0.0, highest=MAX_MBPS)
    where, (times, rates) = _read(FileTable(path), [FileColumn("Time", "text"), rate])
    t_ns = _times_ns(where, times, "%a %b %d %H:%M:%S UTC %Y")
    return {"t_ns": t_ns[:-1], f"{direction}_bps": _scaled(rates, 1e6)[1:]}


def from_mahimahi(path: Path, direction: Direction, report: ImportReport) -> Columns:
    """A packet-delivery trace of Mahimahi: a line for each packet of 1,500 bytes, the millisecond
    at which it can leave. It begins again after its last time. Packets of about 100 ms at a time
    are a rate: the time is cut into equal parts.
    """
    lines = filter(None, map(str.strip, read_text(path).split("\n")))
    with as_user_error(f"{path}: not a line for each packet", ValueError):
        times_ms = np.array([plain_number(line) for line in lines])
    if not len(times_ms):
        raise UserError(f"{path}: has no packets")
    before_ms = np.concatenate([[0.0], times_ms[:-1]])
    possible = (
        (times_ms == np.trunc(times_ms)) & (before_ms <= times_ms) & (times_ms <= MAX_BINS * BIN_MS)
    )
    if not possible.all():
        packet = int(possible.argmin())
        raise UserError(
            f"{path}: packet {packet + 1}: {times_ms[packet]:.15g} ms must be a whole number from "
            f"{before_ms[packet]:.15g}, the time before, to {MAX_BINS * BIN_MS:,}"
        )
    end_ms = float(times_ms[-1])
    if end_ms == 0:
        raise UserError(f"{path}: the last packet leaves at 0 ms, must be later")
    count = math.ceil(end_ms / BIN_MS)
    bins = np.maximum(np.ceil(times_ms * count / end_ms) - 1, 0).astype(int)
    return {
        "t_ns": [round(number * end_ms / count * NS_PER_MS) for number in range(count)],
        f"{direction}_bps": [
            round(packets * PACKET_BITS * 1000 * count / end_ms)
            for packets in np.bincount(bins, minlength=count).tolist()
        ],
    }


Importer = Callable[[Path, Direction, ImportReport], Columns]
IMPORTERS: dict[str, Importer] = {
    "csv": from_csv,
    "cicv5g": from_cicv5g,
    "mtu": from_mtu,
    "mahimahi": from_mahimahi,
}
