"""The figures of the evaluation: those of the paper's Section V over all seeds, in its arrangement
and with the metrics as the first reading means them. What the paper prints stands in them as marks.
"""

import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from genie_sim.analysis import drawing, figures, latency_cdf, style
from genie_sim.analysis.registry import METRICS
from genie_sim.analysis.style import PAGE_IN
from genie_sim.base.text import percent_text
from genie_sim.base.units import NS_PER_MS
from genie_sim.paper import figure_data
from genie_sim.paper.checks import ALL, CASE, HE, HO, load_claims
from genie_sim.paper.definitions import CHOICES, Definitions
from genie_sim.paper.facts import METHODS
from genie_sim.paper.figure_data import ANSWERS, REUSED, Key, Points
from genie_sim.record import provenance
from genie_sim.record.columns import Columns, concat

WINDOW_REQUESTS = 50
CLUSTERS = {"homogeneous": HO, "heterogeneous": HE}
CARS = ("1 car", "2 cars", "3 cars")  # of each cluster's scenarios
PLACES = {"edge": "remote Genies", "car": "local Genies"}
CAR_LINES: dict[str, dict[str, Any]] = {  # the more cars, the darker
    "1 car": {"color": "#66A9D8", "marker": "o"},
    "2 cars": {"color": "#2F6FA8", "marker": "s"},
    "3 cars": {"color": "#0A1F3C", "marker": "^"},
}
PLACE_LINES: dict[str, dict[str, Any]] = {
    "edge": {"linestyle": "-", "linewidth": 1.2},
    "car": {"linestyle": (0, (3, 1.2)), "linewidth": 1.0},
}
HELD = ("object_precision", "object_recall_static", "object_recall_moving", "ghost_share")
EVENTS = "recorded events"
WHISKER: dict[str, Any] = {"color": "black", "linewidth": 0.8, "capsize": 2}
MARK: dict[str, Any] = {"color": "black", "linestyle": "", "markersize": 4, "zorder": 5}
HOLLOW = MARK | {"markerfacecolor": "white"}
# what the paper prints, by the claim that says so: C2 is what is left of the time
PRINTED = {claim.id: claim.expect for claim in load_claims()}
# in words, what a reading means by the metrics
TIMES = {"received": "since the node's queue", "stamp": "since the camera's stamp"}
ERROR_BARS = {
    "windows": f"lowest, highest {WINDOW_REQUESTS} requests",
    "running": "lowest, highest running ratio",
}
REQUESTS = {"own_requests": "of clients", "all_requests": "of clients and neighbours"}
BOOSTS = {"per_update": "boost per update", "per_object": "boost per stored object"}

Row = Mapping[str, Any]


def save(evaluation: Path, name: str) -> None:
    """Draws a figure of an evaluation as wide as a page into its folder ``figures``, as the SVG
    that its page shows. Raises OSError if the file cannot be written.
    """
    figures.save_all({name: _makers(evaluation)[name]()}, evaluation / "figures", ["svg"])


def of_evaluation(
    evaluation: Path, width_in: float | None = None, allow_changed: bool = False
) -> dict[str, Figure]:
    """Every figure that there is something for in an evaluation's folder, by file name, as wide as
    a column or a page; by default a page. Raises ``UserError``, also for files that were changed
    since they were written, unless they are allowed.
    """
    names = [figure_data.FILE, "readings.json", "quality.json"]
    known = provenance.read_json(evaluation / "run.json").get("digests")
    changed = provenance.changed_files(evaluation, known, names)
    provenance.refuse_changed(evaluation, changed, allow_changed)
    return {name: make() for name, make in _makers(evaluation, width_in).items()}


@dataclass(frozen=True)
class FirstReading:
    """The runs of an evaluation under its first reading, as figures draw them.

    Parameters
    ----------
    points : mapping
        Of curves and bars, by what they are of.
    reading : str
        The name of the reading.
    definitions : Definitions
        What it means by the metrics.
    footer : str
        Names the runs.
    seeds : int
        How many.
    width_in : float
        Of the figure.
    """

    points: Mapping[Key, Points]
    reading: str
    definitions: Definitions
    footer: str
    seeds: int
    width_in: float

    @property
    def is_narrow(self) -> bool:
        """Whether it stands in a column."""
        return drawing.is_narrow(self.width_in)

    def panels(
        self, rows: int, columns: int, height_in: float, **options: Any
    ) -> tuple[Figure, Any]:
        """A figure with panels of about this height in a column; a page's are a quarter taller."""
        figure = Figure(figsize=(self.width_in, rows * height_in * (1 if self.is_narrow else 1.25)))
        return figure, figure.subplots(rows, columns, squeeze=False, **options)

    def finish(self, figure: Figure, title: str, shows: str) -> Figure:
        """The legend below; above, which reading and how many seeds, and what it ``shows``."""
        seeds = f"{self.seeds} seed{'s' * (self.seeds > 1)}"
        note = f"reading {self.reading}, {seeds}: {shows}"
        drawing.finish(figure, title, self.footer, figure.axes, note=note)
        return figure

    def frames(self, scenario: str) -> Columns:
        """As many frames of each method as make up its distributions of times."""
        parts = []
        for method in METHODS:
            times = {
                f"{answer}_answer_ns": NS_PER_MS * self.points[Key(scenario, answer, method.name)].y
                for answer in ANSWERS
            }
            received_ns = np.zeros(len(times["first_answer_ns"]))
            parts.append(Columns({"received_ns": received_ns, **times}).assign(method=method.name))
        return concat(parts)

    def means_ms(self, scenario: str) -> dict[str, float]:
        """The mean time to the first answer [ms] under each method."""
        keys = {method.name: Key(scenario, "mean", method.name) for method in METHODS}
        return {name: float(self.points[key].y[0]) for name, key in keys.items()}

    def bars(self, scenario: str, of_images: bool) -> dict[str, tuple[float, float, float]]:
        """By placement the mean reuse, and the lowest and highest ratio, all means over seeds."""
        keys = {placement: Key(scenario, REUSED[of_images], placement) for placement in PLACES}
        return {
            placement: tuple(self.points[key].y.tolist())
            for placement, key in keys.items()
            if key in self.points
        }


def _makers(evaluation: Path, width_in: float | None = None) -> dict[str, Callable[[], Figure]]:
    """What draws each figure of an evaluation."""
    worth = provenance.read_json(evaluation / "quality.json")
    return makers_of(shown_of(evaluation, width_in or PAGE_IN), worth)


def shown_of(evaluation: Path, width_in: float = PAGE_IN) -> FirstReading:
    """The runs of an evaluation's first reading, as it means the metrics. Raises ``UserError``."""
    first = provenance.read_json(evaluation / "readings.json")[0]
    meant = {metric: first["metrics"][metric]["definition"] for metric in CHOICES}
    points = figure_data.read(evaluation)
    seeds = int(points[Key(CASE, "mean", "car1")].x[0])
    parts = [f"genie-sim reproduce, {first['name']}", *first["settings"], f"{seeds} seeds"]
    return FirstReading(
        points=points,
        reading=first["name"],
        definitions=Definitions(**meant),
        footer=", ".join(parts),
        seeds=seeds,
        width_in=width_in,
    )


def makers_of(shown: FirstReading, worth: Sequence[Row]) -> dict[str, Callable[[], Figure]]:
    """What draws each figure; ``worth``: the answer quality as ``quality`` makes it."""
    return {
        "latency_cdf": partial(_response_times, shown, "answered"),
        "latency_cdf_of_published": partial(_response_times, shown, "published"),
        "image_reuse": partial(_reuse, shown, of_images=True),
        "object_reuse": partial(_reuse, shown, of_images=False),
        "confidence_boost": partial(_boosts, shown),
        "case_study": partial(_case_study, shown),
        "worth": partial(_worth, shown, worth),
    }


def _response_times(shown: FirstReading, of: str) -> Figure:
    """Response times of L, R and DG, a row of panels a cluster (paper: Fig. "cdf-time"). Of the
    answered frames as in the paper; of the published ones with the fresh results, too.
    """
    frames = {scenario: shown.frames(scenario) for scenario in ALL}
    means = {scenario: shown.means_ms(scenario) for scenario in ALL}
    low, high = latency_cdf.limits_ms(frames.values())
    low = min(low, *(0.8 * _improved_ms(of_scenario) for of_scenario in means.values()))
    best = min(ALL, key=lambda name: means[name]["genie"] / max(means[name].values()))
    with drawing.in_style():
        figure, grid = shown.panels(2, 3, 1.18, sharex=True, sharey=True)
        for row, (cluster, scenarios) in zip(grid, CLUSTERS.items(), strict=True):
            for axis, cars, scenario in zip(row, CARS, scenarios, strict=True):
                for curve in latency_cdf.curves_of([frames[scenario]], METHODS):
                    if curve.answer == latency_cdf.ANSWERED:
                        latency_cdf.draw(axis, curve, end_ms=high, of=of, label=curve.method)
                    elif of == "published":
                        latency_cdf.draw(axis, curve, end_ms=high, of=of, label=None)
                if of == "published":
                    look = latency_cdf.FRESH_LOOK | {"color": "0.4"}
                    axis.plot([], [], label="fresh results", **look)
                latency_cdf.draw_deadline(axis)
                if of == "answered":
                    _mark_times(axis, means[scenario], is_best=scenario == best)
                axis.set_title(cars)
                axis.set_ylim(0, 1.02)
                drawing.logarithmic_x(axis, low, high, (1,) if shown.is_narrow else (1, 2, 5))
                axis.set_xlabel("response time [ms]")
                axis.set_ylabel(f"{cluster},\nshare of frames")
                axis.label_outer()
        shows = f"first answers {TIMES[shown.definitions.time]}, of {of} frames"
        return shown.finish(figure, f"Response time, share of {of} frames", shows)


def _improved_ms(means: Mapping[str, float]) -> float:
    """The mean time of Genie that is the paper's average improvement below L and R."""
    local, remote, _ = (means[method.name] for method in METHODS)
    return (1 - PRINTED["C1"]) * 2 / (1 / local + 1 / remote)


def _mark_times(axis: Axes, means: Mapping[str, float], is_best: bool) -> None:
    """The mean of Genie, and where the paper's improvements put it: the average over L and R, and
    the best one of all in the panel that ``is_best``.
    """
    overhead_ms = PRINTED["C27"]
    line: dict[str, Any] = {"color": "0.35", "linewidth": 0.9, "linestyle": ":"}
    axis.axvline(overhead_ms, label=f"paper: overhead {overhead_ms:g} ms", **line)
    axis.plot(means["genie"], 0.5, marker="D", label="mean of DG here", **MARK)
    label = f"paper: {percent_text(PRINTED['C1'])} below L and R"
    axis.plot(_improved_ms(means), 0.5, marker="D", label=label, **HOLLOW)
    if is_best:
        label = f"paper: at best {percent_text(1 - PRINTED['C2'])} below"
        best_ms = PRINTED["C2"] * max(means.values())
        axis.plot(best_ms, 0.75, marker="v", label=label, **HOLLOW)


def _reuse(shown: FirstReading, of_images: bool) -> Figure:
    """Image or object reuse of local and of remote Genies, a panel a cluster (paper: Figs.
    "reuse-img", "reuse-obj"). Bars are means over Genies and seeds; error bars are the lowest and
    the highest ratio, means over seeds.
    """
    what = "image reuse" if of_images else "object reuse"
    bars = {scenario: shown.bars(scenario, of_images) for scenario in ALL}
    means = {kind: _mean_bar(shown, kind) for kind in (True, False)}
    with drawing.in_style():
        figure, grid = shown.panels(1, 2, 1.5, sharey=True)
        for axis, (cluster, scenarios) in zip(grid[0], CLUSTERS.items(), strict=True):
            for side, (placement, place) in enumerate(reversed(PLACES.items())):
                look: dict[str, Any] = {**style.PLACEMENT_BARS[placement], "label": place}
                for x, scenario in enumerate(scenarios):
                    if placement in bars[scenario]:
                        _bar(axis, x + 0.4 * (side - 0.5), bars[scenario][placement], look)
                        look["label"] = None
            _reuse_marks(axis, what, means[of_images], means[True])
            axis.set_xticks(range(3), CARS)
            axis.set_title(cluster)
            axis.grid(axis="x", visible=False)
            axis.yaxis.set_major_formatter(FuncFormatter(style.percent_tick))
            axis.set_ylabel(what)
            axis.label_outer()
        grid[0, 0].set_ylim(0, min(1.1 * grid[0, 0].get_ylim()[1], 1.08))
        label = ERROR_BARS[shown.definitions.error_bars]
        grid[0, 0].errorbar([], [], yerr=[], label=label, **WHISKER)
        requests = (
            f"requests {REQUESTS[shown.definitions.image_reuse]}" if of_images else "requests"
        )
        shows = f"hits / {requests}"
        return shown.finish(figure, f"{what.capitalize()} of local and remote Genies", shows)


def _reuse_marks(axis: Axes, what: str, mean: float, image_mean: float) -> None:
    """Lines at the mean of all bars here, and at what the paper prints."""
    average, most, times = (PRINTED[claim] for claim in ("C11", "C12", "C13"))
    lines: dict[str, tuple[float, Any]] = {
        f"mean of the bars, {percent_text(mean, 2)}": (mean, "-")
    }
    if what == "image reuse":
        label = f"paper: a fourth of {percent_text(average)}"
        lines[label] = (average / times, "--")
    else:
        lines[f"paper: mean {percent_text(average)}"] = (average, "--")
        lines[f"paper: highest {percent_text(most)}"] = (most, ":")
        label = f"paper: {times:g} × image reuse"
        if times * image_mean <= 1:
            lines[label] = (times * image_mean, style.DASH_DOT)
        else:  # no share is that high: only the legend tells
            axis.plot([], [], " ", label=f"{label} is above 100 %")
    for label, (y, dashes) in lines.items():
        axis.axhline(y, color="black", linewidth=0.9, linestyle=dashes, label=label)


def _mean_bar(shown: FirstReading, of_images: bool) -> float:
    """The mean of the twelve bars."""
    bars = [shown.bars(scenario, of_images) for scenario in ALL]
    return float(np.mean([mean for places in bars for mean, _, _ in places.values()]))


def _bar(axis: Axes, x: float, bar: tuple[float, float, float], look: Mapping[str, Any]) -> None:
    """One bar with its error bar, and its number [%] above both."""
    mean, low, high = bar
    axis.bar(x, mean, 0.36, edgecolor="black", linewidth=0.6, **look)
    ends = [[max(mean - low, 0)], [max(high - mean, 0)]]
    axis.errorbar(x, mean, yerr=ends, **WHISKER)
    box = {"facecolor": "white", "edgecolor": "none", "pad": 0.6}
    above: dict[str, Any] = {"textcoords": "offset points", "ha": "center", "va": "bottom"}
    axis.annotate(f"{100 * mean:.2g}", (x, max(mean, high)), (0, 2), bbox=box, **above)


def _boosts(shown: FirstReading) -> Figure:
    """The confidence boost over the events of the object maps, remote and local, a panel a cluster
    (paper: Fig. "boost"): means over seeds, as far as all of them go.
    """
    with drawing.in_style():
        figure, grid = shown.panels(1, 2, 1.6, sharex=True, sharey=True)
        for axis, (cluster, scenarios) in zip(grid[0], CLUSTERS.items(), strict=True):
            for placement, place in PLACES.items():
                for number, (cars, scenario) in enumerate(zip(CARS, scenarios, strict=True)):
                    curve = shown.points.get(Key(scenario, "boost", placement))
                    if curve is not None:
                        look = CAR_LINES[cars] | PLACE_LINES[placement]
                        look |= {"markersize": 3, "markevery": (0.08 + 0.06 * number, 0.25)}
                        axis.plot(*curve, label=f"{place}, {cars}", **look)
            axis.set_title(cluster)
            axis.set_xlabel(EVENTS)
            axis.set_ylabel("confidence boost")
            axis.label_outer()
        grid[0, 0].set_xlim(0, None)
        grid[0, 0].set_ylim(0, 1.05 * grid[0, 0].get_ylim()[1])
        shows = f"{BOOSTS[shown.definitions.boost]} so far"
        return shown.finish(figure, "Confidence boost of remote and local Genies", shows)


def _case_study(shown: FirstReading) -> Figure:
    """Vision-assisted driving (paper: Fig. "bs"): response times of both cars, and reuse over
    events, hits / requests so far: means over seeds.
    """
    without: dict[str, Any] = {"color": "0.1", "linewidth": 1.4}
    cameras: dict[str, Any] = {"color": "0.55", "linewidth": 1.4, "linestyle": style.DASHED}
    with drawing.in_style():
        figure, grid = shown.panels(1, 2, 1.6)
        times, reuse = grid[0]
        for car, look in (("car2", without), ("car1", cameras)):
            _, values = shown.points[Key(CASE, "first", car)]
            answered = values[~np.isnan(values)]
            share = np.arange(1, len(answered) + 1) / len(answered)
            what = "car 2, no cameras" if car == "car2" else "car 1, cameras"
            times.plot(answered, share, label=what, **look)
        most_ms = PRINTED["C29"]
        label = f"paper: under {most_ms:g} ms"
        times.axvline(most_ms, color="black", linewidth=0.9, linestyle="--", label=label)
        times.set_xlim(0, None)
        times.set_xlabel("response time [ms]")
        times.set_ylabel("share of answered frames")
        for car, what, look in (
            ("car2", "object reuse, car 2", without | {"linestyle": style.DASH_DOT}),
            ("car1", "image reuse, car 1", cameras | {"linestyle": style.DOTTED}),
        ):
            curve = shown.points.get(Key(CASE, "events_reuse", car))
            if curve is not None:
                reuse.plot(*curve, label=what, **look)
        reuse.set_xlim(0, None)
        reuse.set_xlabel(EVENTS)
        reuse.set_ylabel("hits / requests so far")
        reuse.yaxis.set_major_formatter(FuncFormatter(style.percent_tick))
        for axis in (times, reuse):
            axis.set_ylim(0, 1.02)
        times.set_title("response times")
        reuse.set_title("reuse")
        shows = f"first answers {TIMES[shown.definitions.time]}"
        return shown.finish(figure, "Vision-assisted driving: car2 has no cameras", shows)


def _worth(shown: FirstReading, rows: Sequence[Row]) -> Figure:
    """Precision, recall and false objects of what the consumer holds, for L, R and DG; ``rows`` as
    ``quality`` makes them.
    """
    names = {name: textwrap.fill(METRICS[name].title, 12) for name in HELD}
    by_method = {(row["method"], row["name"]): row for row in rows}
    styles = style.method_styles([method.name for method in METHODS])
    with drawing.in_style():
        figure, grid = shown.panels(1, 1, 2.0)
        axis = grid[0, 0]
        for place, (look_number, method) in enumerate(zip(styles, METHODS, strict=True)):
            look = style.method_bar(look_number) | {"label": method.title}
            for x, name in enumerate(names):
                row = by_method.get((method.name, name))
                if row is not None:
                    mean, low, high = (row[key] for key in ("value", "low", "high"))
                    at = x + 0.27 * (place - 1)
                    axis.bar(at, mean, 0.25, edgecolor="black", linewidth=0.6, **look)
                    ends = [[mean - low], [high - mean]]
                    axis.errorbar(at, mean, yerr=ends, **WHISKER)
                    look["label"] = None
        axis.set_xticks(range(len(names)), list(names.values()))
        axis.set_ylim(0, 1.02)
        axis.grid(axis="x", visible=False)
        axis.set_ylabel("share of objects")
        axis.yaxis.set_major_formatter(FuncFormatter(style.percent_tick))
        title = "What the consumer holds at each instant, against KITTI's labels (drive 0005)"
        return shown.finish(figure, title, "means and 95 % intervals")
