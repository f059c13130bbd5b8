"""A computer as a device: measured latencies become a device profile, with the law of its service
times fitted.

The law is that of ``profiles.ServiceTime``, X = median (loc + (1 - loc) exp(sigma Z)). Its median
is the measured one; loc and sigma are those whose quantiles come closest to the measured ones, in
the logarithm, so that the tail counts.
"""

import math
import os
import platform
import re
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import yaml

from genie_sim.base import units
from genie_sim.base.errors import UserError, short_repr, unknown
from genie_sim.base.import_report import ImportReport
from genie_sim.base.paths import atomic_write
from genie_sim.base.progress import Progress
from genie_sim.base.tables import UNITS, FileColumn, FileTable, is_number, title_of, with_point
from genie_sim.scenario import benchmark_logs
from genie_sim.scenario.profiles import DeviceProfile, load_profile
from genie_sim.version import VERSION

MIN_LATENCIES = 20  # latencies; fewer say nothing about a tail
WARM_UP = 10
# Of latencies that others measured: what is so much slower than the median, at the beginning and in
# at most this share, is a warm-up.
WARM_UP_FACTOR, MOST_WARM_UP = 3.0, 0.2
USUAL_MS = (1.0, 10_000.0)  # the median of a detector whose unit nobody tells
LATENCY = re.compile(r"latency|latencies", re.ASCII)
LARGE_GAP, FAR_MEAN = 0.2, 1.5  # of a law that is not like what was measured
ASSUMED_CORES = 4
PICTURE = (375, 1242, 3)  # KITTI's
SHARES = np.arange(0.01, 1.0, 0.01)

Times = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Measurement:
    """Latencies [ns] of one model, in the order in which they were measured, and where they come
    from. ``here``: on this machine; ``tag``: as in device profiles.
    """

    model: str
    latencies_ns: Times
    source: str
    here: bool = True
    tag: str = "M"


class Fit(NamedTuple):
    """The fitted law, and the largest gap between its distribution function and the measured one
    (Kolmogorov-Smirnov).

    ``p95`` and ``p99`` are the law's quantiles divided by the measured ones.
    """

    median_ns: int
    loc: float
    sigma: float
    gap: float
    p95: float
    p99: float
    runs: int

    def __str__(self) -> str:
        return (
            f"median {units.duration_text(self.median_ns)}, loc {self.loc:g}, sigma {self.sigma:g} "
            f"from {self.runs} runs; largest gap between the distributions {self.gap:.3f}; "
            f"the law's p95 and p99 are {self.p95:.2f} and {self.p99:.2f} times the measured"
        )


def measure(
    detector_name: str,
    weights: str | Path | None,
    runs: int,
    model: str | None,
    progress: Progress,
) -> Measurement:
    """Times ``detect`` (letter box, network, suppression) on pictures of noise of KITTI's size, one
    after the other.

    Parameters
    ----------
    detector_name : a detector, or ``package.module:Class``
    weights : its file or folder; ``None``: the folder GENIE_SIM_WEIGHTS
    runs : how many are timed, after ``WARM_UP`` others
    model : the name in the profile; ``None``: the detector's
    progress : is told the runs done and all runs
    """
    from genie_sim.data.detector import DetectorSettings

    detector = DetectorSettings(detector_name, weights).opened()
    picture = np.random.default_rng(1).integers(0, 255, PICTURE, dtype=np.uint8)
    latencies = []
    for run in range(WARM_UP + runs):
        begin_ns = time.perf_counter_ns()
        detector.detect(picture)
        if run >= WARM_UP:
            latencies.append(time.perf_counter_ns() - begin_ns)
            progress(len(latencies), runs, "")
    size = "x".join(map(str, detector.size))
    source = (
        f"genie-sim {VERSION} profile: {runs} runs of {detector.name} at {size} "
        f"(weights {detector.sha256[:12]}), one thread, on {platform.machine()} with "
        f"{os.cpu_count()} processors, {platform.system()}"
    )
    return Measurement(model or detector.name, np.array(latencies, dtype=np.float64), source)


def from_table(
    path: Path,
    model: str,
    report: ImportReport,
    column: str | None = None,
    unit: str | None = None,
) -> Measurement:
    """Latencies that somebody else measured, in a column of a table (CSV or Parquet), or in a file
    of ``trtexec --exportTimes`` (``.json``).

    Raises UserError where it is not clear which column that is or what its unit is, and, naming the
    line, for anything that is no time. Slow runs at the beginning are left out as a warm-up, unless
    ``report`` accepts them.

    Parameters
    ----------
    path : the file
    model : what it was that took so long
    report : is told what was read
    column : its title; ``None``: the only one that holds latencies
    unit : of its values, such as ``ms``; ``None``: as its title says, else milliseconds
    """
    if path.suffix == ".json":
        title, latencies = benchmark_logs.trtexec_times(path, column, report)
        own = "ms"
    else:
        table = FileTable(path)
        index = _column_of(table, column)
        title = table.titles[index] if table.titles else ""
        kind = title_of(title).unit
        own = kind if UNITS.get(kind, ("",))[0] == "time" else ""
        latencies = _latencies(table, index)
        if len(table.titles) > 1:
            report.choose("column", title, table.titles, "--column")
    if unit is not None and own and UNITS[own] != UNITS[unit]:
        raise UserError(f"{path}: --unit {unit}: the title {title!r} says {own}")
    factor_ns = UNITS[unit or own or "ms"][1]
    if len(latencies) < MIN_LATENCIES:
        raise UserError(f"{path}: {len(latencies)} latencies, expected at least {MIN_LATENCIES}")
    _check_latencies(path, title, latencies)
    median_ms = float(np.median(latencies)) * factor_ns / units.NS_PER_MS
    if not (unit or own) and not USUAL_MS[0] <= median_ms <= USUAL_MS[1]:
        raise UserError(
            f"{path}: has no unit, and {median_ms:g} ms would be an odd median for a detector: "
            "say with --unit whether these are s, ms, us or ns"
        )
    report.read(f"latencies{f' of column {title!r}' if title else ''}", len(latencies))
    report.span("latency", (min(latencies), max(latencies)), unit or own or "ms (assumed)")
    return Measurement(
        model,
        _without_warm_up(np.array(latencies) * factor_ns, report),
        f"{len(latencies)} latencies from {path.name}",
        here=False,
        tag="S",
    )


def _latencies(table: FileTable, index: int) -> list[float]:
    """The numbers of a column. Raises UserError for one that is no time."""
    number, latencies = FileColumn("latency", highest=1e15), []
    for where, (cell,) in table.cells([index]):
        try:
            latencies.append(number.value(with_point(cell)))
        except ValueError:
            latencies.append(0.0)
        if latencies[-1] <= 0:
            column = f" of column {short_repr(table.titles[index])}" if table.titles else ""
            raise UserError(f"{where}: no latency in {short_repr(cell)}{column}")
    return latencies


def _column_of(table: FileTable, name: str | None) -> int:
    """Which column holds the latencies. Raises UserError where that is not clear."""
    titles = list(table.titles)
    _, first = next(table.cells(list(range(table.columns))), ("", []))
    if name is not None:
        if titles.count(name) != 1:
            raise UserError(f"{table.path}: --column: {unknown('column', name, titles)}")
        return titles.index(name)
    numeric = [index for index, cell in enumerate(first) if is_number(cell)]
    if not titles:
        if len(numeric) > 1:
            raise UserError(
                f"{table.path}: has {len(numeric)} columns of numbers and no header: "
                "name the latencies in one, such as latency_ms"
            )
        return (numeric or [0])[0]
    parts = [title_of(title) for title in titles]
    in_time = [index for index in numeric if UNITS.get(parts[index].unit, ("",))[0] == "time"]
    called = [index for index in numeric if LATENCY.search(parts[index].stem)]
    for among in (called, in_time, numeric):
        if len(among) == 1:
            return among[0]
        if among:
            some = ", ".join(short_repr(titles[index]) for index in among)
            raise UserError(f"{table.path}: which column holds latencies, {some}? Say --column")
    return 0


# Latencies that somebody sorted grow, too, but in steps of all sizes: their spread is their mean.
EVEN_STEPS, GROWN = 0.5, 10.0


def _check_latencies(path: Path, title: str, latencies: Sequence[float]) -> None:
    """Raises UserError for numbers of rows, and for times at which something was measured."""
    steps = np.diff(latencies)
    numbers = (steps == 1).all()
    even = (steps > 0).all() and steps.std() < EVEN_STEPS * steps.mean()
    if numbers or (even and latencies[-1] > GROWN * latencies[0]):
        what = "numbers of runs" if numbers else "times at which they began"
        raise UserError(
            f"{path}: column {title!r} counts from {latencies[0]:g} to {latencies[-1]:g}: these "
            f"are {what}, not latencies"
        )


def _without_warm_up(latencies_ns: Times, report: ImportReport) -> Times:
    """The latencies without the slow ones at the beginning."""
    slow = latencies_ns > WARM_UP_FACTOR * np.median(latencies_ns)
    first = int(np.argmin(slow))  # that is not slow
    if not first or first > len(latencies_ns) * MOST_WARM_UP:
        return latencies_ns
    slowest_ms = float(latencies_ns[:first].max()) / units.NS_PER_MS
    text = f"the first {first} runs take up to {slowest_ms:.4g} ms: a warm-up"
    if report.accept:
        report.warn(f"{text}, kept by --accept")
        return latencies_ns
    report.warn(f"{text}, left out; --accept keeps them")
    report.leave_out("latencies of the warm-up", first)
    return latencies_ns[first:]


def check_fit(measured: Measurement, fitted: Fit, report: ImportReport) -> None:
    """Warns of a law that is not like what was measured."""
    loc, sigma = fitted.loc, fitted.sigma
    mean_ns = fitted.median_ns * (loc + (1 - loc) * float(np.exp(min(sigma**2 / 2, 50.0))))
    real_ns = float(np.mean(measured.latencies_ns))
    if fitted.gap > LARGE_GAP or not 1 / FAR_MEAN < mean_ns / real_ns < FAR_MEAN:
        report.warn(
            f"the law does not fit: its mean is {mean_ns / units.NS_PER_MS:.4g} ms, that of the "
            f"latencies {real_ns / units.NS_PER_MS:.4g} ms, and the largest gap between the "
            f"distributions {fitted.gap:.2f}. Are there several kinds of runs?"
        )


def of_trtexec(path: Path, model: str, summary: benchmark_logs.Summary) -> tuple[Measurement, Fit]:
    """The log-normal law through the median and a percentile of trtexec's summary."""
    within = f"{100 * summary.share:g} % within {summary.percentile_ms:g} ms"
    source = (
        f"summary of trtexec in {path.name}: median {summary.median_ms:g} ms, {within}; "
        "log-normal, which is assumed"
    )
    return _given(model, round(summary.median_ms * units.NS_PER_MS), summary.sigma, source)


def of_summary(model: str, mean_ns: int, sd_ns: int) -> tuple[Measurement, Fit]:
    """The log-normal law of a mean and a standard deviation, where nothing else is known."""
    sigma = math.sqrt(math.log1p((sd_ns / mean_ns) ** 2))
    median_ns = round(mean_ns * math.exp(-(sigma**2) / 2))
    source = (
        f"given: mean {units.duration_text(mean_ns)}, standard deviation "
        f"{units.duration_text(sd_ns)}; log-normal, which is assumed"
    )
    return _given(model, median_ns, sigma, source)


def _given(model: str, median_ns: int, sigma: float, source: str) -> tuple[Measurement, Fit]:
    none = np.array([], dtype=np.float64)
    fitted = Fit(median_ns, loc=0.0, sigma=round(sigma, 4), gap=0.0, p95=1.0, p99=1.0, runs=0)
    return Measurement(model, none, source, here=False, tag="D"), fitted


def fit(latencies_ns: Times) -> Fit:
    """The law closest to the measured times."""
    from scipy.optimize import minimize
    from scipy.stats import kstest, lognorm, norm

    median_ns = float(np.median(latencies_ns))
    relative = np.asarray(latencies_ns) / median_ns
    measured = np.quantile(relative, SHARES)
    z = norm.ppf(SHARES)

    def misfit(parameters: Sequence[float]) -> float:
        loc, sigma = parameters
        return float(np.square(np.log((loc + (1.0 - loc) * np.exp(sigma * z)) / measured)).sum())

    starts = [(loc, sigma) for loc in (0.2, 0.6, 0.9, 0.98) for sigma in (0.2, 0.6, 1.2)]
    bounds = [(0.0, 0.999), (0.001, 5.0)]
    best = min(
        (minimize(misfit, start, bounds=bounds) for start in starts),
        key=lambda result: float(result.fun),
    )
    loc, sigma = (round(float(value), 4) for value in best.x)
    law = lognorm(sigma, loc, 1.0 - loc)
    p95, p99 = (
        round(float(law.ppf(share) / np.quantile(relative, share)), 3) for share in (0.95, 0.99)
    )
    gap = round(float(kstest(relative, law.cdf).statistic), 4)
    return Fit(
        median_ns=round(median_ns),
        loc=loc,
        sigma=sigma,
        gap=gap,
        p95=p95,
        p99=p99,
        runs=len(relative),
    )


def write(
    path: Path,
    measured: Measurement,
    fitted: Fit,
    cores: int | None = None,
    board: benchmark_logs.Board | None = None,
) -> DeviceProfile:
    """A whole device profile: what was measured, and assumptions, marked so, where nothing was.
    Reads it back.

    Parameters
    ----------
    path : the file
    measured, fitted : the model's latencies and their law
    cores : of the device; ``None``: those of ``board``, or of this machine if it was measured
        here, else assumed
    board : what tegrastats told of the device
    """
    spread: dict[str, Any] = {"loc": fitted.loc, "sigma": fitted.sigma}
    source = f"{measured.source}; {fitted}" if fitted.runs else measured.source
    model: dict[str, Any] = {
        "median": units.duration_text(fitted.median_ns),
        "tag": measured.tag,
        "source": measured.source,
    }
    if cores is not None:
        count = {"value": cores, "tag": "S", "source": "given"}
    elif board is not None:
        source_of = f"tegrastats, {board.lines} lines"
        count = {"value": board.cores, "tag": "S", "source": source_of}
    elif measured.here:
        count = {
            "value": os.cpu_count() or 1,
            "tag": "M",
            "source": "processors of the machine that wrote this file",
        }
    else:
        count = {"value": ASSUMED_CORES, "tag": "A", "source": "assumed: nobody gave them"}
    assumed = "not measured apart: as measured in one condition"
    profile = {
        "name": path.stem,
        "title": f"Measurement: {platform.node() or platform.machine()}"
        if measured.here
        else path.stem,
        "cores": count,
        "hop": {
            "small": {"value": "0.3 ms", "tag": "A", "source": "a small message on a Jetson"},
            "per_megabyte": {
                "value": "2.28 ms",
                "tag": "A",
                "source": "as on the Jetsons: TZC, arXiv 1810.00556",
            },
        },
        "genie": {
            "median": {
                "value": "8.355 ms",
                "tag": "A",
                "source": "the paper's mean of 8.8 ms, the same on every host",
            },
            "spread": {"loc": 0.6, "sigma": 0.5, "tag": "A", "source": "as on the paper's devices"},
        },
        "spreads": {
            "isolated": {**spread, "tag": "A", "source": assumed},
            "default": {**spread, "tag": measured.tag, "source": source},
            "loaded": {**spread, "tag": "A", "source": assumed},
        },
        "models": {measured.model: model},
    }
    if board is not None and board.power is not None:
        source_of = f"least squares over {board.lines} lines of tegrastats; range: two errors"
        profile["power"] = {
            name: {
                "value": f"{watts:.3f} W",
                "low": f"{max(watts - 2 * error, 0.0):.3f} W",
                "high": f"{watts + 2 * error:.3f} W",
                "tag": "D",
                "source": source_of,
            }
            for name, (watts, error) in board.power.items()
        }
    heading = (
        "# Tags: P the paper, S a public source, M measured, D derived, A assumed. "
        "Written by genie-sim profile.\n"
    )
    text = heading + yaml.safe_dump(profile, sort_keys=False, allow_unicode=True, width=110)
    with atomic_write(path) as partial:
        path.parent.mkdir(parents=True, exist_ok=True)
        partial.write_text(text, encoding="utf-8")
        return load_profile(partial)
