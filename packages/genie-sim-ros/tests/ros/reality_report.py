"""``python -m tests.ros.reality_report``: writes docs/reality.md and its figures from runs made
now.

It needs Debian's ROS 1 in its Python (docs/ros.md says how), and root for the link between
namespaces.
"""

from __future__ import annotations

import os
import platform
import sys
import tempfile
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib import style
from matplotlib.figure import Figure

from genie_sim.analysis.style import PAGE_IN, RC
from tests.ros import reality, reality_link
from tests.ros.conftest import ADD_ON, HERE, Master

RUNS = 7
OUTCOMES = ("hit", "miss", "coalesced")
GREY, BLUE = "0.6", "#1f4e79"
IMAGES = ADD_ON / "docs/images"


@dataclass(frozen=True)
class Series:
    """Everything that was measured and simulated."""

    parts: reality.Parts
    simulated: reality.Drive
    real: list[reality.Drive]
    busy: list[float]
    margin_ms: float


@dataclass(frozen=True)
class Transfer:
    """When the last of ``count`` messages is over the link, in each of several transfers and
    simulated.
    """

    rate_mbps: int
    size_bytes: int
    count: int
    all_real_ms: list[float]
    simulated_ms: float

    @property
    def real_ms(self) -> float:
        return float(np.median(self.all_real_ms))

    @property
    def off(self) -> float:
        return self.simulated_ms / self.real_ms - 1


def measured_series() -> Series:
    """Simulates and drives once; takes minutes."""
    frames = reality.frames()
    sleeps = reality.sleeps_ns(len(frames))
    with tempfile.TemporaryDirectory() as folder:
        master = Master(Path(sys.executable), Path(folder) / "ros")
        try:
            parts = reality.measure(master)
            simulated = reality.simulate(parts, sleeps, Path(folder))
            busy, real = [reality.busy_elsewhere()], []
            for number in range(RUNS):
                real.append(reality.drive(master, reality.plan_of(frames, sleeps)))
                busy.append(reality.busy_elsewhere())
                run = f"real run {number + 1} of {RUNS}"
                print(f"{run}: others kept the processors {busy[-1]:.0%} busy", flush=True)
        finally:
            master.close()
    return Series(
        parts=parts,
        simulated=simulated,
        real=real,
        busy=busy,
        margin_ms=reality.margin_ms(simulated, frames),
    )


def measured_transfers() -> list[Transfer]:
    """Transfers over links of several rates."""
    transfers = []
    for rate_mbps in (20, 50, 100):
        for size_bytes, count in ((100_000, 1), (465_800, 1), (1_397_297, 1), (465_800, 3)):
            arguments = (rate_mbps * 10**6, size_bytes, count)
            transfer = Transfer(
                rate_mbps=rate_mbps,
                size_bytes=size_bytes,
                count=count,
                all_real_ms=[
                    reality_link.measured_ms(*arguments)[-1] for _ in range(reality_link.REPEATED)
                ],
                simulated_ms=reality_link.simulated_ms(*arguments)[-1],
            )
            transfers.append(transfer)
    return transfers


def draw_drive(series: Series) -> Figure:
    """Response times, frame by frame and as shares of the frames."""
    simulated_ms = series.simulated.response_ms
    frames = np.arange(len(simulated_ms))
    shares = (frames + 1) / len(frames)
    with style.context(RC):
        figure = Figure((PAGE_IN, 3.0), layout="constrained")
        by_frame, by_share = figure.subplots(1, 2, width_ratios=(3, 2))
        for number, run in enumerate(series.real):
            label = f"real ROS, {len(series.real)} runs" if number == 0 else None
            by_frame.plot(frames, run.response_ms, "x", color=GREY, markersize=4, label=label)
            by_share.step(np.sort(run.response_ms), shares, color=GREY, label=label)
        by_frame.plot(frames, simulated_ms, "o", color=BLUE, markersize=2.5, label="simulated")
        by_share.step(np.sort(simulated_ms), shares, color=BLUE, label="simulated")
        by_frame.set(xlabel="frame of the drive", ylabel="response time [ms]", yscale="log")
        by_share.set(xlabel="response time [ms]", ylabel="share of the frames", ylim=(0, 1))
        handles, labels = by_frame.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=2)
        return figure


def draw_link(transfers: list[Transfer]) -> Figure:
    """Simulated transfers over real ones."""
    with style.context(RC):
        figure = Figure((PAGE_IN / 2, 2.8), layout="constrained")
        axes = figure.subplots()
        longest = max(transfer.real_ms for transfer in transfers) * 1.2
        axes.plot((1, longest), (1, longest), color=GREY, linewidth=1, label="equal")
        rates = sorted({transfer.rate_mbps for transfer in transfers})
        for marker, rate_mbps in zip("os^", rates, strict=True):
            chosen = [transfer for transfer in transfers if transfer.rate_mbps == rate_mbps]
            axes.plot(
                [transfer.real_ms for transfer in chosen],
                [transfer.simulated_ms for transfer in chosen],
                marker,
                color=BLUE,
                fillstyle="none",
                label=f"{rate_mbps} Mbit/s",
            )
        axes.set(
            xlabel="real transfer [ms]",
            ylabel="simulated transfer [ms]",
            xscale="log",
            yscale="log",
        )
        axes.legend()
        return figure


def comparison(series: Series) -> list[str]:
    """One line per group of frames and quantile."""
    columns = (
        "frames",
        "n",
        "quantile",
        "simulated [ms]",
        "real, all runs [ms]",
        "run by run [ms]",
        "off",
    )
    lines = [f"| {' | '.join(columns)} |", "|---|---:|---|---:|---:|---:|---:|"]
    for outcome in (None, *OUTCOMES):
        simulated_ms = series.simulated.of(outcome)
        real_ms = [run.of(outcome) for run in series.real]
        for name, percent in (("median", 50), ("95th percentile", 95)):
            simulated = np.percentile(simulated_ms, percent)
            real = np.percentile(np.concatenate(real_ms), percent)
            by_run = [np.percentile(run_ms, percent) for run_ms in real_ms]
            off = simulated / real - 1
            cells = (
                outcome or "**all**",
                str(len(simulated_ms)),
                name,
                f"{simulated:.2f}",
                f"{real:.2f}",
                f"{min(by_run):.2f} to {max(by_run):.2f}",
                f"{off:+.1%}",
            )
            lines.append(f"| {' | '.join(cells)} |")
    return lines


def page(series: Series, links: list[Transfer] | str) -> str:
    """The page, in Markdown. ``links`` is the reason where no link could be measured.

    The paragraph on other series in ``reality_page.md`` is written by hand, for each new series.
    """
    parts, counts = series.parts, Counter(series.simulated.outcomes)
    values = {
        "seconds": reality.WINDOW_NS[1] // reality.NS,
        "frames": len(series.simulated.outcomes),
        "margin_ms": series.margin_ms,
        "machine": f"{platform.machine()}, {os.cpu_count()} processors, {platform.system()}",
        "python": platform.python_version(),
        "least_busy": min(series.busy),
        "most_busy": max(series.busy),
        "busy_limit": reality.BUSY_LIMIT,
        "hop_small_ms": parts.hop_small_ns / 1e6,
        "hop_per_megabyte_ms": parts.hop_per_megabyte_ns / 1e6,
        "genie_ms": parts.genie_ns / 1e6,
        "detector_overhead_ms": parts.detector_overhead_ns / 1e6,
        "outcomes": ", ".join(f"{counts[name]} {name}" for name in OUTCOMES),
        "runs": len(series.real),
        "same_outcomes": sum(run.outcomes == series.simulated.outcomes for run in series.real),
        "same_map": sum(run.map_lookups == series.simulated.map_lookups for run in series.real),
        "lost": sum(int(np.isnan(run.response_ms).sum()) for run in series.real),
        "comparison": "\n".join(comparison(series)),
        "link": f"Not compared: {links}.\n" if isinstance(links, str) else link_section(links),
    }
    return (HERE / "reality_page.md").read_text(encoding="utf-8").rstrip("\n").format(**values)


def link_section(transfers: list[Transfer]) -> str:
    """What the page says of the link."""
    values = {
        "overhead_bytes": reality_link.TBF_OVERHEAD_BYTES,
        "repeated": reality_link.REPEATED,
        "rates": ", ".join(str(one) for one in sorted({one.rate_mbps for one in transfers})),
        "largest": max(abs(one.off) for one in transfers),
    }
    return (HERE / "reality_page_link.md").read_text(encoding="utf-8").format(**values)


def main() -> None:
    series = measured_series()
    reason = reality_link.why_not()
    links = measured_transfers() if reason is None else reason
    IMAGES.mkdir(exist_ok=True)
    draw_drive(series).savefig(IMAGES / "reality_drive.png", dpi=200)
    if not isinstance(links, str):
        draw_link(links).savefig(IMAGES / "reality_link.png", dpi=200)
    (ADD_ON / "docs/reality.md").write_text(page(series, links), encoding="utf-8")


if __name__ == "__main__":
    main()
