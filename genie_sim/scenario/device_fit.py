"""A computer as a device: measured latencies become a device profile, with the law of its service
times fitted.

The law is that of ``sim.device.ServiceTime``, X = median (loc + (1 - loc) exp(sigma Z)). Its
median is the measured one; loc and sigma are those whose quantiles come closest to the measured
ones, in the logarithm, so that the tail counts.
"""

import os
import platform
import re
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, get_args

import numpy as np
import numpy.typing as npt

from genie_sim.base import units
from genie_sim.base.contracts import require
from genie_sim.base.errors import UserError, short_repr, unknown
from genie_sim.base.import_report import ImportReport
from genie_sim.base.marks import Name
from genie_sim.base.paths import OutputKind, atomic_write
from genie_sim.base.progress import Progress
from genie_sim.base.settings import read
from genie_sim.base.tables import UNITS, FileColumn, FileTable, title_of, with_point
from genie_sim.scenario.profiles import DeviceProfile
from genie_sim.scenario.yaml_input import inline, parse
from genie_sim.version import VERSION

PROFILE = OutputKind("device profile")  # people edit it
MIN_LATENCIES = 20  # latencies; fewer say nothing about a tail
WARM_UP = 10
USUAL_MS = (0.3, 10_000.0)  # one detection, in the median
LARGEST_S = 3600  # no detection takes longer; a stamp since 1970 does
LARGE_GAP, FAR_MEAN = 0.2, 1.5  # of a law that is not like what was measured
ASSUMED_CORES = 4
PICTURE = (375, 1242, 3)  # KITTI's
SHARES = np.arange(0.01, 1.0, 0.01)

LATENCIES = re.compile(r"latency|latencies|duration|elapsed|inference", re.IGNORECASE)
RATES = re.compile(  # a title that says one of them and no latency
    r"fps|hz|[qir]ps|rate|throughput|freq|(/|per[\W_]*)[mun]?s(ec|econds?)?(?![a-z])|s\^?-1",
    re.IGNORECASE,
)
GROWN = 2.0  # from the first to the last: latencies in their order hardly do

TEMPLATE = """\
# Written by genie-sim profile.
# Tags: P the paper, S a public source, M measured, D derived, A assumed.
name: {name}
title: {title}
cores: {{value: {cores}, tag: {cores_tag}, source: {cores_source}}}
hop:
  small: {{value: 0.3 ms, tag: A, source: a small message on a Jetson}}
  per_megabyte: {{value: 2.28 ms, tag: A, source: "as on the Jetsons: TZC, arXiv 1810.00556"}}
genie:
  median: {{value: 8.355 ms, tag: A, source: "the paper's mean of 8.8 ms, the same on every host"}}
  spread: {{loc: 0.6, sigma: 0.5, tag: A, source: as on the paper's devices}}
spreads:
  isolated: {{{law}, tag: A, source: "not measured apart: as measured in one condition"}}
  default: {{{law}, tag: {tag}, source: {fitted}}}
  loaded: {{{law}, tag: A, source: "not measured apart: as measured in one condition"}}
models:
  {model}: {{median: {median}, tag: {tag}, source: {source}}}
"""
Times = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Measurement:
    """Latencies [ns] of one model, in the order in which they were measured, and where they come
    from. ``here``: on this machine.
    """

    model: str
    latencies_ns: Times
    source: str
    here: bool = True


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
    from genie_sim.data.detectors.detector import DetectorSettings

    detector = DetectorSettings(detector_name, weights).opened()
    rule: Any = get_args(Name)[1]
    is_name = isinstance(detector.name, str) and re.fullmatch(rule.pattern, detector.name)
    expected = rule.rule.removeprefix("must be ")
    require(bool(model or is_name), f"detector {detector_name!r}: name", detector.name, expected)
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
    """Latencies that somebody else measured, in a column of a table (CSV or Parquet).

    Raises UserError where titles and options do not say which column that is and what its unit is,
    and, naming the line, for anything that is no latency.

    Parameters
    ----------
    path : the file
    model : what it was that took so long
    report : is told what was read
    column : its title, which says a unit; ``None``: the only one that says latency or duration
    unit : of its values, such as ``ms``; ``None``: as its title says
    """
    table = FileTable(path)
    index = _column_of(table, column)
    title = table.titles[index] if table.titles else ""
    named, own = f"{path}: column {short_repr(title)}", _unit_of(title)
    is_latency = LATENCIES.search(title) is not None
    if RATES.search(title) and not is_latency:
        raise UserError(f"{named} holds rates, no latencies: invert them ({_choices(table)})")
    if title and not is_latency and not (own and column):
        text = f"{named} does not say latency and a unit of time, as latency_ms does"
        raise UserError(f"{text} ({_choices(table)})")
    if unit is not None and own and UNITS[own] != UNITS[unit]:
        raise UserError(f"{named} says {own}, --unit {unit}")
    unit = unit or own
    if not unit:
        raise UserError(f"{named} has no unit: say --unit, or call it latency_ms")
    factor_ns = UNITS[unit][1]
    latencies = _latencies(table, index, LARGEST_S * units.NS_PER_S / factor_ns)
    if len(latencies) < MIN_LATENCIES:
        raise UserError(f"{path}: {len(latencies)} latencies, expected at least {MIN_LATENCIES}")
    steps = np.diff(latencies)
    if (steps == 1).all() or (
        not is_latency and (steps >= 0).all() and latencies[-1] > GROWN * latencies[0]
    ):
        raise UserError(
            f"{named} counts from {latencies[0]:g} to {latencies[-1]:g}: these are numbers or "
            "stamps of runs, not latencies (call it latency_ms if they are)"
        )
    if len(table.titles) > 1:
        report.choose("column", title, table.titles, "--column")
    report.read(f"latencies{f' of column {title!r}' if title else ''}", len(latencies))
    report.span("latency", (min(latencies), max(latencies)), unit)
    to_ms = factor_ns / units.NS_PER_MS
    middle_ms = sorted(latencies)[len(latencies) // 2] * to_ms
    report.warn_unusual("latency: a median of", middle_ms, "ms", USUAL_MS, "of a detection")
    report.warn_sentinels("latency", [latency * to_ms for latency in latencies], "ms")
    source = f"{len(latencies)} latencies from {path.name}"
    return Measurement(model, np.array(latencies) * factor_ns, source, here=False)


def _latencies(table: FileTable, index: int, largest: float) -> list[float]:
    """The numbers of a column. Raises UserError for one that is no latency."""
    number, latencies = FileColumn("latency"), []
    column = f" of column {short_repr(table.titles[index])}" if table.titles else ""
    for where, (cell,) in table.cells([index]):
        try:
            latencies.append(number.value(with_point(cell)))
        except ValueError:
            latencies.append(0.0)
        if latencies[-1] <= 0:
            raise UserError(f"{where}: no latency in {short_repr(cell)}{column}")
        if latencies[-1] > largest:
            text = f"{short_repr(cell)}{column} is above an hour: no latency, perhaps a stamp"
            raise UserError(f"{where}: {text}; say --column ({_choices(table)})")
    return latencies


def _column_of(table: FileTable, name: str | None) -> int:
    """Which column holds the latencies. Raises UserError where titles and options do not say so."""
    titles = list(table.titles)
    if name is not None:
        if titles.count(name) != 1:
            raise UserError(f"{table.path}: --column: {unknown('column', name, titles)}")
        return titles.index(name)
    if table.columns <= 1:
        return 0
    among = [index for index, title in enumerate(titles) if LATENCIES.search(title)]
    if len(among) == 1:
        return among[0]
    some = ", ".join(short_repr(titles[index]) for index in among)
    text = f"has {table.columns} columns and no header: name the latencies latency_ms"
    if some:
        text = f"which column holds latencies, {some}? Say --column"
    elif titles:
        text = "no title says that it holds latencies, as latency_ms does: say --column "
        text += f"({_choices(table)})"
    raise UserError(f"{table.path}: {text}")


def _choices(table: FileTable) -> str:
    """The columns that there are."""
    titles = ", ".join(map(short_repr, table.titles[:12]))
    return f"the file has {titles}" if titles else "the file has one column without a title"


def _unit_of(title: str) -> str:
    """The unit of time that a title says, up to seconds: ``latency_min`` is a minimum."""
    unit = title_of(title).unit
    kind, factor_ns = UNITS.get(unit, ("", 0.0))
    return unit if kind == units.DURATION.name and factor_ns <= units.NS_PER_S else ""


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
) -> DeviceProfile:
    """A whole device profile: what was measured, and assumptions, marked so, where nothing was.

    Parameters
    ----------
    path : the file
    measured, fitted : the model's latencies and their law
    cores : of the device; ``None``: those of this machine if it was measured here, else assumed
    """
    text, profile = _profile(path, measured, fitted, cores)
    with atomic_write(path, PROFILE) as partial:
        path.parent.mkdir(parents=True, exist_ok=True)
        partial.write_text(text, encoding="utf-8")
    return profile


def check(path: Path, model: str, cores: int | None = None) -> None:
    """Raises ``UserError`` for what ``write`` would refuse: before anything is measured."""
    PROFILE.check(path)
    law = Fit(median_ns=1, loc=0.5, sigma=1.0, gap=0.0, p95=1.0, p99=1.0, runs=1)
    _profile(path, Measurement(model, np.ones(1), "not measured yet"), law, cores)


def _profile(
    path: Path, measured: Measurement, fitted: Fit, cores: int | None
) -> tuple[str, DeviceProfile]:
    """The text of a profile, and what is read back from it. Raises ``UserError``."""
    tag, cores_source = ("M", "processors of this machine") if measured.here else ("S", "assumed")
    count = (os.cpu_count() or 1) if measured.here else ASSUMED_CORES
    title = f"Measurement: {platform.node() or platform.machine()}" if measured.here else path.stem
    text = TEMPLATE.format(
        name=inline(path.stem),
        title=inline(title),
        cores=count if cores is None else cores,
        cores_tag="S" if cores is not None else "M" if measured.here else "A",
        cores_source=cores_source if cores is None else "given",
        law=f"loc: {fitted.loc}, sigma: {fitted.sigma}",
        tag=tag,
        fitted=inline(f"{measured.source}; {fitted}"),
        model=inline(measured.model),
        median=units.duration_text(fitted.median_ns),
        source=inline(measured.source),
    )
    return text, read(DeviceProfile, parse(text, str(path)), lambda _: str(path))
