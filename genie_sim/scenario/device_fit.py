"""This machine as a device: measured latencies become a device profile, with the law of its service
times fitted.

The law is that of ``profiles.ServiceTime``, X = median (loc + (1 - loc) exp(sigma Z)). Its median
is the measured one; loc and sigma are those whose quantiles come closest to the measured ones, in
the logarithm, so that the tail counts.
"""

import csv
import os
import platform
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import yaml

from genie_sim.base import units
from genie_sim.base.errors import UserError, as_user_error
from genie_sim.base.paths import atomic_write, read_text
from genie_sim.base.progress import Progress
from genie_sim.scenario.profiles import DeviceProfile, load_profile
from genie_sim.version import VERSION

MIN_LATENCIES = 20  # latencies; fewer say nothing about a tail
WARM_UP = 10
PICTURE = (375, 1242, 3)  # KITTI's
SHARES = np.arange(0.01, 1.0, 0.01)

Times = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Measurement:
    """Latencies [ns] of one model, in the order in which they were measured, and where they come
    from.
    """

    model: str
    latencies_ns: Times
    source: str


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
    from genie_sim.data.detector import make_detector

    detector = make_detector(detector_name, weights)
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


def from_csv(path: Path, model: str) -> Measurement:
    """Latencies [ms] in the first column that holds numbers; a first line of names may be there.

    Raises UserError, naming the line, for anything that is no time.
    """
    with as_user_error(f"{path}: not a CSV file", csv.Error):
        rows = list(csv.reader(read_text(path).splitlines()))
    filled = [
        (number, [*map(_number, row)])
        for number, row in enumerate(rows, start=1)
        if "".join(row).strip()
    ]
    if filled and all(value is None for value in filled[0][1]):
        del filled[0]  # names
    column = (
        next((i for i, value in enumerate(filled[0][1]) if value is not None), 0) if filled else 0
    )
    latencies_ms = []
    for number, values in filled:
        if column >= len(values) or not (value := values[column]) or not 0 < value < 1e9:
            raise UserError(
                f"{path}: line {number}: no latency in milliseconds in "
                f"{','.join(rows[number - 1])[:60]!r}"
            )
        latencies_ms.append(value)
    if len(latencies_ms) < MIN_LATENCIES:
        raise UserError(f"{path}: {len(latencies_ms)} latencies, expected at least {MIN_LATENCIES}")
    return Measurement(
        model,
        np.array(latencies_ms) * units.NS_PER_MS,
        f"{len(latencies_ms)} latencies from {path.name}",
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


def write(path: Path, measured: Measurement, fitted: Fit) -> DeviceProfile:
    """A whole device profile: what was measured, and assumptions, marked so, where nothing was.
    Reads it back.
    """
    spread: dict[str, Any] = {"loc": fitted.loc, "sigma": fitted.sigma}
    source = f"{measured.source}; {fitted}"
    model: dict[str, Any] = {
        "median": units.duration_text(fitted.median_ns),
        "tag": "M",
        "source": measured.source,
    }
    assumed = "not measured apart: as measured in one condition"
    profile = {
        "name": path.stem,
        "title": f"Measurement: {platform.node() or platform.machine()}"
        if "profile:" in measured.source
        else path.stem,
        "cores": {
            "value": os.cpu_count() or 1,
            "tag": "M",
            "source": "processors of the machine that wrote this file",
        },
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
            "default": {**spread, "tag": "M", "source": source},
            "loaded": {**spread, "tag": "A", "source": assumed},
        },
        "models": {measured.model: model},
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


def _number(cell: str) -> float | None:
    try:
        value = float(cell)
    except ValueError:
        return None
    return value if np.isfinite(value) else None
