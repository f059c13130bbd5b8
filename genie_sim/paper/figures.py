"""The five figures of the paper's Section V, over all seeds of the evaluation in the paper's
arrangement; and of a run of one of its scenarios the panels of that scenario.

A mark called "paper" is a number that the paper prints, drawn in the figure that it says it of.
"""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from genie_sim.analysis import drawing, style
from genie_sim.analysis.metric import DEADLINE_MS
from genie_sim.analysis.seed_runs import SeedRuns
from genie_sim.analysis.style import PAGE_IN
from genie_sim.base.text import percent_text
from genie_sim.paper import curves, numbers, sources
from genie_sim.paper.checks import ALL, CASE, HE, HO
from genie_sim.paper.claims import load_claims
from genie_sim.paper.curves import Curves, Key
from genie_sim.paper.evidence import BASE, Evidence
from genie_sim.paper.numbers import METHODS, placed
from genie_sim.record.results import Run

log = logging.getLogger(__name__)
CLUSTERS: Mapping[str, Sequence[str]] = {"homogeneous": HO, "heterogeneous": HE}
PLACES = {"car": "local Genies", "edge": "remote Genies"}
CAR_LINES: tuple[dict[str, Any], ...] = (  # of 1, 2, 3 cars: the more, the darker
    {"color": "#66A9D8", "marker": "o"},
    {"color": "#2F6FA8", "marker": "s"},
    {"color": "#0A1F3C", "marker": "^"},
)
PLACE_LINES: dict[str, dict[str, Any]] = {
    "edge": {"linestyle": "-", "linewidth": 1.2},
    "car": {"linestyle": (0, (3, 1.2)), "linewidth": 1.0},
}
EVENTS = "recorded events"
WHISKER: dict[str, Any] = {"color": "black", "linewidth": 0.8, "capsize": 2}
PREFIX = "paper_"  # of the figures of a run
# what the paper prints, by the claim that says so
PRINTED = {claim.id: claim.expect for claim in load_claims()}


def of_numbers(
    table: pd.DataFrame, drawn: Curves, width_in: float | None = None
) -> dict[str, Figure]:
    """The five figures of an evaluation's numbers and curves, by file name, by default as wide as a
    page.
    """
    evidence = Evidence(table)
    seeds = len(evidence.seeds)
    footer = f"genie-sim reproduce, {seeds} seed{'s' * (seeds > 1)}"
    return EvaluationFigures(drawn, evidence, (*ALL, CASE), footer, width_in or PAGE_IN).figures()


def of_run(run: Run | SeedRuns, width_in: float | None = None) -> dict[str, Figure]:
    """The panels of a run, or of several seeds, of one of the paper's scenarios, by file name;
    nothing for any other run.
    """
    name = run.runs[0].name
    if name not in sources.SET_UPS:
        return {}
    changed = sources.changed_setting(run.runs[0].facts["scenario"])
    if changed:
        log.warning("%s: %s is not the paper's: no figure has its marks", name, changed)
        return {}
    rows = [
        (BASE, name, of_seed.seed, *number, value)
        for of_seed in run.runs
        for number, value in numbers.of_run(of_seed).items()
    ]
    columns = [column.name for column in numbers.SCHEMA.columns]
    evaluation = EvaluationFigures(
        curves.pooled([curves.of_run(name, of_seed.tables) for of_seed in run.runs]),
        Evidence(pd.DataFrame(rows, columns=["variant", "scenario", "seed", *columns[3:]])),
        (name,),
        run.footer,
        width_in or PAGE_IN / 2,
    )
    return {f"{PREFIX}{figure}": drawn for figure, drawn in evaluation.figures().items()}


@dataclass(frozen=True)
class EvaluationFigures:
    """What figures draw.

    Parameters
    ----------
    curves : mapping
        The points of curves, by what they are of.
    evidence : Evidence
        The numbers, for bars.
    scenarios : sequence of str
        Those of the paper that there are.
    footer : str
        Names the runs.
    width_in : float
        Of each figure.
    """

    curves: Curves
    evidence: Evidence
    scenarios: Sequence[str]
    footer: str
    width_in: float

    def figures(self) -> dict[str, Figure]:
        """Each figure that there is something for."""
        figures = {}
        with drawing.in_style():
            if self.scenarios != (CASE,):
                figures["latency_cdf"] = self._latency()
                figures["image_reuse"] = self._reuse("image reuse")
                figures["object_reuse"] = self._reuse("object reuse")
                figures["confidence_boost"] = self._boosts()
            if CASE in self.scenarios:
                figures["case_study"] = self._case_study()
        return figures

    @property
    def clusters(self) -> dict[str, list[str]]:
        """The scenarios of each cluster that has one."""
        chosen = {
            cluster: [name for name in names if name in self.scenarios]
            for cluster, names in CLUSTERS.items()
        }
        return {cluster: names for cluster, names in chosen.items() if names}

    def _panels(
        self, rows: int, columns: int, height_in: float, **options: Any
    ) -> tuple[Figure, Any]:
        """A figure with panels of about this height in a column; a page's are a quarter taller."""
        taller = 1 if drawing.is_narrow(self.width_in) else 1.25
        figure = drawing.NotebookFigure(figsize=(self.width_in, rows * height_in * taller))
        return figure, figure.subplots(rows, columns, squeeze=False, **options)

    def _finish(self, figure: Figure, title: str, note: str) -> Figure:
        drawing.finish(figure, title, self.footer, figure.axes, note=note)
        return figure

    def _latency(self) -> Figure:
        """Response times of L, R and DG, a row of panels a cluster (paper: Fig. "cdf-time")."""
        clusters = self.clusters
        columns = max(map(len, clusters.values()))
        figure, grid = self._panels(len(clusters), columns, 1.18, sharex=True, sharey=True)
        styles = style.method_styles([method.name for method in METHODS])
        times = [self.curves[key].y for key in self.curves if key.what == "time"]
        low, high = 0.8 * min(y.min() for y in times), 1.25 * max(y.max() for y in times)
        for row, (cluster, scenarios) in zip(grid, clusters.items(), strict=True):
            for axis, scenario in zip(row, scenarios, strict=True):
                for number, method in zip(styles, METHODS, strict=True):
                    points = self.curves.get(Key(scenario, "time", method.name))
                    if points is None:
                        continue
                    look = style.method_line(number) | {
                        "marker": style.method_marker(number),
                        "markevery": [len(points.y) * part // 100 for part in (20, 50, 80)],
                        "markersize": 3.5,
                    }
                    ends = [points.y[0], *points.y, high]
                    shares = [0.0, *points.x, 1.0]
                    axis.plot(ends, shares, drawstyle="steps-post", label=method.title, **look)
                deadline = f"paper: {DEADLINE_MS:g} ms deadline"
                _mark(axis.axvline(DEADLINE_MS, label=deadline), "--")
                axis.set_title(_cars(scenario))
                axis.set_ylim(0, 1.02)
                narrow = drawing.is_narrow(self.width_in) and columns > 1
                drawing.logarithmic_x(axis, low, high, (1,) if narrow else (1, 2, 5))
                axis.set_xlabel("response time [ms]")
                axis.set_ylabel(f"{cluster}\nCDF")
                axis.label_outer()
        note = "answered frames: time from the camera's stamp to the first answer (logarithmic)"
        return self._finish(figure, "Response times of answered frames", note)

    def _reuse(self, what: str) -> Figure:
        """Image or object reuse of local and of remote Genies, a panel a cluster (paper: Figs.
        "reuse-img", "reuse-obj"). Bars are means over Genies and seeds; error bars are the lowest
        and the highest running ratio of any Genie, means over seeds.
        """
        metric = what.replace(" ", "_")
        clusters, means = self.clusters, []
        figure, grid = self._panels(1, len(clusters), 1.5, sharey=True)
        for axis, (cluster, scenarios) in zip(grid[0], clusters.items(), strict=True):
            for side, (placement, place) in enumerate(PLACES.items()):
                look: dict[str, Any] = {**style.PLACEMENT_BARS[placement], "label": place}
                for x, scenario in enumerate(scenarios):
                    ends = [
                        float(np.nanmean(self.evidence.of(scenario, placed(name, placement))))
                        for name in (metric, f"{metric}_lowest", f"{metric}_highest")
                    ]
                    _bar(axis, x + 0.4 * (side - 0.5), ends, look)
                    means.append(ends[0])
                    look["label"] = None
            axis.set_title(cluster)
            axis.set_xticks(range(len(scenarios)), [_cars(name) for name in scenarios])
            axis.set_xlim(-0.6, len(scenarios) - 0.4)
            axis.grid(axis="x", visible=False)
        if len(means) > 2:
            mean = float(np.mean(means))
            self._lines(grid[0], f"mean of the bars {percent_text(mean, 2)}", mean, "-")
        if what == "object reuse":
            average, most = PRINTED["C11"], PRINTED["C12"]
            self._lines(
                grid[0], f"paper: mean of all scenarios {percent_text(average)}", average, "--"
            )
            self._lines(grid[0], f"paper: highest of all scenarios {percent_text(most)}", most, ":")
        top = max(grid[0, 0].get_ylim()[1], 0.1)
        grid[0, 0].set_ylim(0, min(1.12 * top, 1.12))
        grid[0, 0].set_ylabel(what)
        grid[0, 0].yaxis.set_major_formatter(FuncFormatter(style.percent_tick))
        requesters = "clients and other Genies" if what == "image reuse" else "the object map"
        whiskers = "lowest and highest running ratio of any Genie"
        note = f"hits / requests of {requesters}; whiskers: {whiskers}"
        return self._finish(figure, f"{what.capitalize()} of local and remote Genies", note)

    def _lines(self, axes: Any, label: str, y: float, dashes: str) -> None:
        for axis in axes:
            _mark(axis.axhline(y, label=label), dashes)

    def _boosts(self) -> Figure:
        """The confidence boost over the events of the object maps, remote and local, a panel a
        cluster (paper: Fig. "boost"): means over seeds, as far as all of them go.
        """
        clusters = self.clusters
        figure, grid = self._panels(1, len(clusters), 1.6, sharex=True, sharey=True)
        for axis, (cluster, scenarios) in zip(grid[0], clusters.items(), strict=True):
            for scenario in scenarios:
                for placement, place in PLACES.items():
                    points = self.curves.get(Key(scenario, "boost", placement))
                    if points is not None:
                        number = int(scenario[0]) - 1
                        look = CAR_LINES[number] | PLACE_LINES[placement]
                        look |= {"markersize": 3, "markevery": (0.08 + 0.06 * number, 0.25)}
                        axis.plot(*points, label=f"{_cars(scenario)}, {place}", **look)
            axis.set_title(cluster)
            axis.set_xlabel(EVENTS)
            axis.set_ylabel("confidence boost")
            axis.label_outer()
        grid[0, 0].set_xlim(0, None)
        grid[0, 0].set_ylim(0, 1.05 * grid[0, 0].get_ylim()[1])
        note = "confidence added so far / objects then stored"
        return self._finish(figure, "Confidence boost of local and remote Genies", note)

    def _case_study(self) -> Figure:
        """Vision-assisted driving (paper: Fig. "bs"): response times of both cars, and reuse over
        events, hits / requests so far: means over seeds.
        """
        without: dict[str, Any] = {"color": "0.1", "linewidth": 1.4}
        cameras: dict[str, Any] = {"color": "0.55", "linewidth": 1.4, "linestyle": style.DASHED}
        figure, grid = self._panels(1, 2, 1.6)
        times, reuse = grid[0]
        for car, what, look in (
            ("car2", "car 2, no cameras", without),
            ("car1", "car 1, cameras", cameras),
        ):
            points = self.curves.get(Key(CASE, "time", car))
            if points is not None:
                ends, shares = [points.y[0], *points.y], [0.0, *points.x]
                times.plot(ends, shares, drawstyle="steps-post", label=what, **look)
        most_ms = PRINTED["C29"]
        _mark(times.axvline(most_ms, label=f"paper: under {most_ms:g} ms"), "--")
        times.set_xlim(0, None)
        times.set_xlabel("response time [ms]")
        times.set_ylabel("share of answered frames")
        for car, what, look in (
            ("car2", "object reuse, car 2", without | {"linestyle": style.DASH_DOT}),
            ("car1", "image reuse, car 1", cameras | {"linestyle": style.DOTTED}),
        ):
            points = self.curves.get(Key(CASE, "reuse", car))
            if points is not None:
                reuse.plot(*points, label=what, **look)
        reuse.set_xlim(0, None)
        reuse.set_xlabel(EVENTS)
        reuse.set_ylabel("hits / requests so far")
        reuse.yaxis.set_major_formatter(FuncFormatter(style.percent_tick))
        for axis in (times, reuse):
            axis.set_ylim(0, 1.02)
        times.set_title("response times")
        reuse.set_title("reuse")
        note = "time from the stamp of a frame, or of a question without one, to the first answer"
        return self._finish(figure, "Vision-assisted driving: car 2 has no cameras", note)


def _cars(scenario: str) -> str:
    """``2 cars`` for ``2car_homo``."""
    return f"{scenario[0]} car{'s' * (scenario[0] != '1')}"


def _mark(line: Any, dashes: str) -> None:
    line.set(color="black", linewidth=0.9, linestyle=dashes)


def _bar(axis: Axes, x: float, ends: Sequence[float], look: Mapping[str, Any]) -> None:
    """One bar with its error bar, and its number [%] above both."""
    mean, low, high = ends
    if np.isnan(mean):
        return
    axis.bar(x, mean, 0.36, edgecolor="black", linewidth=0.6, **look)
    axis.errorbar(x, mean, yerr=[[max(mean - low, 0)], [max(high - mean, 0)]], **WHISKER)
    box = {"facecolor": "white", "edgecolor": "none", "pad": 0.6}
    above: dict[str, Any] = {"textcoords": "offset points", "ha": "center", "va": "bottom"}
    axis.annotate(f"{100 * mean:.2g}", (x, max(mean, high)), (0, 2), bbox=box, **above)
