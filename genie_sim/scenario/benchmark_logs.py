"""What NVIDIA's tools write of a detector and of a board: times of TensorRT's ``trtexec``, and the
load and power that ``tegrastats`` prints.
"""

import json
import math
import re
from collections.abc import Sequence
from pathlib import Path
from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np

from genie_sim.base.errors import UserError, as_user_error
from genie_sim.base.import_report import ImportReport
from genie_sim.base.paths import read_text, usable

# Which of trtexec's times is the latency of a detection: with the copies to the GPU and back.
TIMES = ("latencyMs", "computeMs")
ALL_TIMES = (*TIMES, "endComputeMs")
SUMMARY = re.compile(
    r"\[I\] (?P<name>Latency|GPU Compute Time): min = [\d.]+ ms, max = [\d.]+ ms, "
    r"mean = (?P<mean>[\d.]+) ms, median = (?P<median>[\d.]+) ms"
    r"(?P<rest>(?:, percentile\([\d.]+%\) = [\d.]+ ms)*)"
)
PERCENTILE = re.compile(r"percentile\(([\d.]+)%\) = ([\d.]+) ms")

CORES = re.compile(r"CPU \[([^\]]*)\]")
GPU = re.compile(r"GR3D_FREQ (\d+)%")
RAIL = re.compile(r"\b([A-Z][A-Z0-9_]*) (\d+)(?:mW)?/\d+(?:mW)?(?![\dMk])")
INPUTS = ("VDD_IN", "POM_5V_IN")  # the rails that all others hang on
MIN_LINES = 20
MIN_SPREAD = 0.05  # of the load of the GPU, of 1, or of the cores; with less nothing can be told


class Summary(NamedTuple):
    """What trtexec's own summary says [ms]: the median, and a percentile with its share."""

    median_ms: float
    share: float
    percentile_ms: float

    @property
    def sigma(self) -> float:
        """Of the log-normal law through both."""
        z = NormalDist().inv_cdf(self.share)
        return math.log(self.percentile_ms / self.median_ms) / z


def trtexec_times(path: Path, column: str | None, report: ImportReport) -> tuple[str, list[float]]:
    """The times [ms] in a file of ``trtexec --exportTimes``, and which of the file's they are.
    Raises UserError.
    """
    with as_user_error(f"{path}: not JSON", ValueError, RecursionError):
        entries = json.loads(read_text(path))
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise UserError(f"{path}: is no list of times, as 'trtexec --exportTimes' writes it")
    known = [name for name in TIMES if entries and name in entries[0]]
    if column is None and not any(name in entry for entry in entries[:1] for name in ALL_TIMES):
        raise UserError(
            f"{path}: has no {', '.join(ALL_TIMES)}: it is no list of times, as 'trtexec "
            "--exportTimes' writes it"
        )
    if column is None and not known:
        column, begin, end = "computeMs", "startComputeMs", "endComputeMs"
        values = [
            _number(path, at, entry, end) - _number(path, at, entry, begin)
            for at, entry in enumerate(entries)
        ]
    else:
        column = column or known[0]
        values = [_number(path, at, entry, column) for at, entry in enumerate(entries)]
    report.choose("times", column, known, "--column")
    return column, values


def _number(path: Path, at: int, entry: dict[str, Any], name: str) -> float:
    value = entry.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < 1e12:
        raise UserError(f"{path}: entry {at + 1}: {name}: must be a number of milliseconds")
    return float(value)


def trtexec_summary(path: Path, report: ImportReport) -> Summary | None:
    """What the summary in a log of trtexec says; ``None`` for another file."""
    with usable(path, "cannot be read"), path.open("rb") as file:
        if b"trtexec" not in file.read(1 << 16):
            return None
    found = {match["name"]: match for match in SUMMARY.finditer(read_text(path))}
    if not found:
        raise UserError(f"{path}: this log of trtexec has no summary of latencies")
    name = next(name for name in ("Latency", "GPU Compute Time") if name in found)
    report.choose("times", name, sorted(found))
    percentiles = [tuple(map(float, pair)) for pair in PERCENTILE.findall(found[name]["rest"])]
    median_ms = float(found[name]["median"])
    above = [(share, value) for share, value in percentiles if 50 < share < 100]
    if not above or median_ms <= 0 or max(above)[1] < median_ms:
        raise UserError(f"{path}: {name}: has no median and percentile above it")
    share, percentile_ms = max(above)
    return Summary(median_ms, share / 100, percentile_ms)


class Board(NamedTuple):
    """What tegrastats tells of a board: its cores, and its power [W] idle, and how much more with
    the GPU and with one core at work, each with its standard error; ``None``: it cannot be told.
    """

    cores: int
    lines: int
    power: dict[str, tuple[float, float]] | None


def tegrastats(path: Path, report: ImportReport) -> Board:
    """What a log of tegrastats tells. Raises UserError for another file."""
    rows: list[tuple[float, float, float]] = []
    cores = on = 0
    lines = read_text(path).splitlines()
    for line in lines:
        gpu, load = GPU.search(line), CORES.search(line)
        rails = {name: int(milliwatts) for name, milliwatts in RAIL.findall(line)}
        if load is None or gpu is None:
            continue
        loads = load[1].split(",")
        cores, on = max(cores, len(loads)), max(on, sum(one.strip() != "off" for one in loads))
        busy = sum(float(found[1]) for one in loads if (found := re.match(r"\s*(\d+)%", one)))
        inputs = [rails[name] for name in INPUTS if name in rails]
        watts = (inputs[0] if inputs else sum(rails.values())) / 1000 if rails else math.nan
        rows.append((float(gpu[1]) / 100, busy / 100, watts))
    report.read("lines of tegrastats", len(rows))
    filled = sum(bool(line.strip()) for line in lines)
    report.dropped("lines", len(rows), filled, "without CPU and GR3D_FREQ")
    if len(rows) < MIN_LINES:
        raise UserError(f"{path}: {len(rows)} lines of tegrastats, expected at least {MIN_LINES}")
    if on < cores:
        report.warn(f"{cores - on} of {cores} cores are off: --cores {on} if they stay so")
    table = np.array(rows)
    for number, (what, unit) in enumerate((("GPU", ""), ("cores at work", ""), ("power", "W"))):
        report.span(what, table[:, number].tolist(), unit)
    return Board(cores, len(rows), _power(table, report))


def _power(table: Any, report: ImportReport) -> dict[str, tuple[float, float]] | None:
    """Least squares of the power over the load of the GPU and the cores at work."""
    if not np.isfinite(table[:, 2]).all():
        report.warn("no power in the log: the profile has none")
        return None
    if min(table[:, 0].std(), table[:, 1].std()) < MIN_SPREAD:
        report.warn("the load hardly changes: the power of the parts cannot be told: log idle, too")
        return None
    factors = np.column_stack([np.ones(len(table)), table[:, :2]])
    watts, squares, *_ = np.linalg.lstsq(factors, table[:, 2], rcond=None)
    variance = float(squares[0]) / max(len(table) - 3, 1) if len(squares) else 0.0
    errors = np.sqrt(np.diag(np.linalg.inv(factors.T @ factors)) * variance)
    if (watts <= 0).any():
        report.warn(f"the power does not grow with the load ({_texts(watts)} W): there is none")
        return None
    parts = zip(("idle", "accelerator", "core"), watts.tolist(), errors.tolist(), strict=True)
    return {name: (value, error) for name, value, error in parts}


def _texts(values: Sequence[float]) -> str:
    return ", ".join(f"{value:.3g}" for value in values)
