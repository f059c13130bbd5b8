"""The results of a run as tables: that for a terminal and for papers, those of ``summary.md``."""

import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import NamedTuple

from genie_sim.analysis import prices, text_table
from genie_sim.analysis.outages import PHASES
from genie_sim.analysis.registry import (
    METRICS,
    RECENT_MS,
    WINDOW_REQUESTS,
    ZERO_DELAY,
    component_title,
    value_text,
)
from genie_sim.analysis.seed_runs import SeedRuns, seeds_text, tables_of_runs
from genie_sim.analysis.style import PLACEMENTS
from genie_sim.recording.columns import Columns
from genie_sim.recording.results import METRIC_FIELDS, Metric, Run
from genie_sim.text import one_line

MAX_RESOURCES = 12
MIN_USE = 0.01  # a resource that is used less is idle

# The resources of which the busiest has a row, whichever that is.
BUSIEST: Mapping[str, Callable[[Metric], bool]] = {
    f"busiest accelerator {where}": partial(
        lambda placement, metric: (
            metric.placement == placement and metric.component.endswith(".accelerator")
        ),
        placement,
    )
    for placement, where in PLACEMENTS.items()
} | {"busiest link": lambda metric: "->" in metric.component}

SCREEN = (
    "first_answer_mean",
    "first_answer_p95",
    "under_deadline_share",
    "fresh_answer_mean",
    "fresh_answered_share",
    "recent_share",
    "look_age_mean",
    "dropped_share",
    "streaming_f1",
    "ghost_share",
    "held_age",
    "first_proxy_f1",
    "wrong_hit_share",
)
SCREEN_REUSE = ("image_reuse", "object_reuse")
SCREEN_PRICES = ("bytes_up_per_frame", "accelerator_time", "energy_per_frame")
FAULTS = (
    "fault_answered_share",
    "fault_fresh_share",
    "fault_latency",
    "fault_look_age",
    "fault_recall",
    "fault_ghosts",
)
RECOVERY = "fault_recovery"
RESPONSE_TIMES = (
    "first_answer_mean",
    "first_answer_p50",
    "first_answer_p95",
    "first_answer_p99",
    "under_deadline_share",
    "fresh_answer_mean",
    "fresh_answer_p50",
    "fresh_answer_p95",
    "fresh_answer_p99",
    "fresh_under_deadline_share",
    "look_age_mean",
    "look_age_p50",
    "look_age_p95",
    "look_age_p99",
)
FRAMES = (
    "answered_share",
    "fresh_answered_share",
    "recent_share",
    "empty_answer_share",
    "dropped_share",
    "in_flight_share",
    "fresh_answer_throughput",
    "looks_own_share",
    "looks_sent_share",
    "looks_answered_share",
    "looks_stale_share",
    "looks_overtaken_share",
    "looks_timed_out_share",
    "looks_in_flight_share",
    "look_round_trip_mean",
    "view_age_mean",
    "view_age_p95",
)
PROXIES = (
    "first_proxy_precision",
    "first_proxy_recall",
    "first_proxy_f1",
    "result_proxy_precision",
    "result_proxy_recall",
    "result_proxy_f1",
    "wrong_hit_share",
)
TRUTHS = (
    "streaming_f1",
    "object_precision",
    "object_recall",
    "object_recall_static",
    "object_recall_moving",
    "gospa",
    "ghost_share",
    "ghost_share_moved_away",
    "ghost_share_never_there",
    "ghost_share_duplicate",
    "held_age",
    "place_error",
    "shared_share",
    "shared_right_share",
)
LAPS = ("lap_recall", "lap_f1")
IMPROVEMENTS = ("improvement_first_answer", "improvement_fresh_answer")
GENIES = (
    "image_reuse",
    "image_reuse_pooled",
    "image_reuse_with_neighbours",
    "wrong_hit_share",
    "coalesced_share",
    "object_reuse",
    "object_reuse_pooled",
    "confidence_boost",
    "stored_images",
    "stored_objects",
)

PRICES = (
    "bytes_up_per_frame",
    "bytes_down_per_frame",
    "bytes_up_rate",
    "bytes_down_rate",
)
PRICES_PLACED = (  # of cars and edges apart
    "accelerator_time",
    "cpu_time",
    "batch_size",
    "energy_per_frame",
    "energy_active_per_frame",
    "energy_per_fresh",
    "energy_per_right",
)

ABOUT_TIMES = (
    "Times: from when a frame reaches the queue of its first ROS node. Shares: of all published "
    "frames, unless the name says otherwise."
)
ABOUT_ANSWERS = (
    "First answer: any, perhaps from the object map. Fresh result: a detector looked at this very "
    f"frame. Recent: a look at most {RECENT_MS:g} ms older. Age of look: from the newest frame in "
    "which a detector saw any of the first answer."
)
ABOUT_TRUTH = (
    "Held: what the consumer believes at each instant, against what is in view then. Zero-delay "
    "detector: the detector's own answers without any delay, judged in the same way."
)
ABOUT_PROXIES = (
    "Proxy, and cache hits: against the detector's own answer to the same frame, which errs, too."
)
ABOUT_WRONG_HITS = METRICS["wrong_hit_share"].meaning
NO_TRUTH = (
    "The objects that are really there are not known here; 'genie-sim truth' makes a truth table "
    "of any labelled drive."
)
ABOUT_ENERGY = (
    "Energy: of cars and edges until the last answer, from the watts of the device profiles; in "
    "brackets with every power at the lower and at the upper end of its range."
)
ABOUT_IMPROVEMENTS = "Improvement: 1 - mean of the method / mean of the baseline."
ABOUT_FAULTS = (
    "The first fault that is no hand-over; a frame belongs to the time of its stamp. Recovery: "
    "from its end to the first half second with 95 % of the share of fresh results before it."
)
ABOUT_BUSIEST = "Busiest: the utilization of whichever is used most."
ABOUT_INTERVALS = (
    "In brackets: for latencies, shares, improvements and boosts the 95 % interval inside this run "
    "(blocks of one second; other seeds and drives may differ by more); for reuse the lowest and "
    f"the highest ratio of any {WINDOW_REQUESTS} requests in a row of any Genie."
)


class MetricRow(NamedTuple):
    """A row of a table: its label, and a metric or nothing for each column."""

    label: str
    metrics: Sequence[Metric | None]


class MetricTable(NamedTuple):
    """A table of metrics: its title, the headings of its columns, its rows, and a note below."""

    title: str
    headings: Sequence[str]
    rows: Sequence[MetricRow]
    note: str = ""


class MetricColumn(NamedTuple):
    """The metrics of one column: those of a method, a placement and a component."""

    heading: str
    method: str
    placement: str = "all"
    component: str = ""


class _Numbers:
    """The metrics of a run by their names and places, and the methods that were simulated."""

    def __init__(self, run: Run | SeedRuns) -> None:
        self.metrics = run.measured
        self.runs = tables_of_runs(run)
        self._by_place = {
            (metric.metric, metric.method, metric.placement, metric.component): metric
            for metric in run.measured
        }
        simulated = {metric.method for metric in run.measured}
        self.titles = {
            method.name: one_line(method.title)
            for method in run.methods
            if method.name in simulated
        }
        self.columns = [MetricColumn(title, name) for name, title in self.titles.items()]

    def of(self, metric: str, column: MetricColumn) -> Metric | None:
        return self._by_place.get((metric, column.method, column.placement, column.component))

    def rows(self, metrics: Sequence[str], columns: Sequence[MetricColumn]) -> list[MetricRow]:
        """A row for each metric."""
        return [
            MetricRow(METRICS[metric].label, [self.of(metric, column) for column in columns])
            for metric in metrics
        ]

    def zero_delay(self) -> list[MetricColumn]:
        """The column of the zero-delay detector, the same for all methods; none without truth."""
        for name in self.titles:
            column = MetricColumn(component_title(ZERO_DELAY), name, component=ZERO_DELAY)
            if self.of("streaming_f1", column) is not None:
                return [column]
        return []

    def busiest(self, of_kind: Callable[[Metric], bool], column: MetricColumn) -> Metric | None:
        """The utilization of the busiest resource of a kind under a column's method; ``None``
        where there is no such resource.
        """
        uses = [
            metric
            for metric in self.metrics
            if (metric.metric, metric.method) == ("utilization", column.method) and of_kind(metric)
        ]
        if column.component or not uses:
            return None
        return max(uses, key=lambda metric: metric.value or 0.0)

    def utilization(self) -> dict[str, dict[str, Metric]]:
        """By resource and method, of those that are used at all; the busiest resource first."""
        by_resource: dict[str, dict[str, Metric]] = {}
        for metric in self.metrics:
            if metric.metric == "utilization":
                by_resource.setdefault(metric.component, {})[metric.method] = metric
        highest = {
            resource: max(metric.value or 0.0 for metric in by_method.values())
            for resource, by_method in by_resource.items()
        }
        names = sorted(highest, key=lambda resource: (-highest[resource], resource))
        return {name: by_resource[name] for name in names if highest[name] >= MIN_USE}


def table(run: Run | SeedRuns, format: str) -> str:
    """The same table in ``markdown``; in ``csv`` every metric with all digits. It says which files
    of the run were changed, if any was. For ``latex`` see ``analysis.latex``.
    """
    if format == "csv":
        names = [*METRIC_FIELDS]
        rows = [metric.row for metric in run.measured]
        if run.changed:
            names.append("changed")
            rows = [(*row, " ".join(run.changed)) for row in rows]
        return text_table.exact(names, rows)
    headings, rows_of_text = cells(run)
    align = "l" + "r" * (len(headings) - 1)
    text = text_table.rounded(format, headings, rows_of_text, align)
    about = about_seeds(run) if isinstance(run, SeedRuns) else ""
    return text + text_table.remark(format, " ".join(filter(None, [about, run.warning])))


def cells(run: Run | SeedRuns) -> tuple[list[str], list[list[str]]]:
    """The same table as headings and rows of text, with intervals: inside the run, or over its
    seeds.
    """
    table = _screen(_Numbers(run))
    return ["", *table.headings], _text_rows(table)


def about_seeds(runs: SeedRuns) -> str:
    """What the numbers of several seeds are."""
    seeds = seeds_text(runs.seeds)
    return f"{seeds[0].upper()}{seeds[1:]}: means, in brackets their 95 % t intervals over seeds."


def markdown(run: Run | SeedRuns) -> str:
    """``summary.md``: all tables with intervals, and what the words and intervals mean."""
    if isinstance(run, SeedRuns):
        ids = ", ".join(f"`{of_seed.run_id}`" for of_seed in run.runs)
        parts, about_intervals = [f"# {run.title}", f"Runs {ids}."], about_seeds(run)
    else:
        parts = [f"# {run.title}", f"Run `{run.run_id}`, seed {run.seed}."]
        about_intervals = ABOUT_INTERVALS
    abouts = (ABOUT_TIMES, ABOUT_ANSWERS, about_intervals)
    parts += [textwrap.fill(about, 120) for about in abouts]
    for table in _tables(_Numbers(run)):
        align = "l" + "r" * len(table.headings)
        parts += [
            f"## {table.title}",
            text_table.rounded(
                "markdown", ["", *table.headings], _text_rows(table), align
            ).rstrip(),
        ]
        if table.note:
            parts.append(textwrap.fill(table.note, 120))
    return "\n\n".join(parts) + "\n"


def main_table(run: Run | SeedRuns) -> MetricTable:
    """The one table for a terminal or a paper: response times, correctness, reuse, and the busiest
    devices.
    """
    return _screen(_Numbers(run))


def _screen(numbers: _Numbers) -> MetricTable:
    """The one table, of the rows in which any method has a number."""
    methods = numbers.columns
    columns = [*methods, *numbers.zero_delay()]
    rows = numbers.rows(SCREEN, columns)
    for metric in SCREEN_REUSE:
        for placement, where in PLACEMENTS.items():
            info = METRICS[metric]
            placed = [column._replace(placement=placement) for column in columns]
            label = info._replace(title=f"{info.title} {where}").label
            rows.append(MetricRow(label, [numbers.of(metric, column) for column in placed]))
    rows += numbers.rows(SCREEN_PRICES, columns)
    for title, of_kind in BUSIEST.items():
        info = METRICS["utilization"]
        label = info._replace(title=title).label
        rows.append(MetricRow(label, [numbers.busiest(of_kind, column) for column in columns]))
    rows = [row for row in rows if any(row.metrics)]
    judged = len(columns) > len(methods)
    proxies = any(METRICS[metric].label == row.label for metric in PROXIES for row in rows)
    notes = [ABOUT_TIMES, ABOUT_ANSWERS]
    if any(row.label.startswith("busiest") for row in rows):
        notes.append(ABOUT_BUSIEST)
    if rows:
        notes.append(ABOUT_TRUTH if judged else NO_TRUTH)
    if proxies:
        notes.append(ABOUT_PROXIES)
    return MetricTable("", [column.heading for column in columns], rows, "\n".join(notes))


def _laps(numbers: _Numbers) -> Iterator[MetricRow]:
    """A row for each lap and each metric of laps."""
    laps = dict.fromkeys(metric.component for metric in numbers.metrics if metric.metric == LAPS[0])
    for name in LAPS:
        for lap in laps:
            columns = [column._replace(component=lap) for column in numbers.columns]
            info = METRICS[name]
            label = info._replace(title=f"{info.title}, {lap}").label
            yield MetricRow(label, [numbers.of(name, column) for column in columns])


def _faults(numbers: _Numbers) -> Iterator[MetricRow]:
    """A row for each metric before, during and after the first fault, and one for the recovery."""
    for name in FAULTS:
        info = METRICS[name]
        for phase in PHASES:
            columns = [column._replace(component=phase) for column in numbers.columns]
            metrics = [numbers.of(name, column) for column in columns]
            if any(metrics):
                title = info.title.replace("around a fault", f"{phase} the fault")
                yield MetricRow(info._replace(title=title).label, metrics)
    recovery = [numbers.of(RECOVERY, column) for column in numbers.columns]
    if any(recovery):
        yield MetricRow(METRICS[RECOVERY].label, recovery)


def _tables(numbers: _Numbers) -> Iterator[MetricTable]:
    """All tables, of methods in the order in which they ran."""
    methods, headings = numbers.columns, list(numbers.titles.values())
    if methods:
        yield MetricTable("Response times", headings, numbers.rows(RESPONSE_TIMES, methods))
        yield MetricTable("Published frames", headings, numbers.rows(FRAMES, methods))
    yield from _correctness(numbers)
    if laps := list(_laps(numbers)):
        yield MetricTable("Laps", headings, laps)
    if around := list(_faults(numbers)):
        yield MetricTable("Around the first fault", headings, around, ABOUT_FAULTS)
    for method, title in numbers.titles.items():
        baselines = [
            metric.component
            for metric in numbers.metrics
            if metric.metric == IMPROVEMENTS[0] and metric.method == method
        ]
        columns = [
            MetricColumn(
                f"over {numbers.titles.get(baseline, baseline)}", method, component=baseline
            )
            for baseline in baselines
        ]
        if columns:
            table = _table(f"Improvement by {title}", columns, IMPROVEMENTS, numbers)
            yield table._replace(note=ABOUT_IMPROVEMENTS)
    yield from _genies(numbers)
    yield from _prices(numbers)
    yield from _utilization(numbers)


def _table(
    title: str, columns: Sequence[MetricColumn], metrics: Sequence[str], numbers: _Numbers
) -> MetricTable:
    return MetricTable(
        title, [column.heading for column in columns], numbers.rows(metrics, columns)
    )


def _correctness(numbers: _Numbers) -> Iterator[MetricTable]:
    """Against the detector's own answers and, where it is known, against the truth."""
    proxied = [
        column for column in numbers.columns if numbers.of("first_proxy_f1", column) is not None
    ]
    judged = [
        column for column in numbers.columns if numbers.of("streaming_f1", column) is not None
    ]
    columns = [column for column in numbers.columns if column in proxied or column in judged]
    notes = []
    if proxied:
        notes += [ABOUT_PROXIES, ABOUT_WRONG_HITS]
    notes.append(ABOUT_TRUTH if judged else NO_TRUTH)
    metrics = (*(PROXIES if proxied else ()), *(TRUTHS if judged else ()))
    if columns:
        columns += numbers.zero_delay()
        yield _table("Correctness", columns, metrics, numbers)._replace(note=" ".join(notes))


def _genies(numbers: _Numbers) -> Iterator[MetricTable]:
    """The Genies of each method that has any, on cars and on edges."""
    tables: dict[str, list[MetricColumn]] = {}
    for method in numbers.titles:
        for placement, where in PLACEMENTS.items():
            column = MetricColumn(where, method, placement)
            if numbers.of("image_reuse", column) is not None:
                tables.setdefault(method, []).append(column)
    for method, columns in tables.items():
        title = "Genies" if len(tables) == 1 else f"Genies under {numbers.titles[method]}"
        yield _table(title, columns, GENIES, numbers)


def _prices(numbers: _Numbers) -> Iterator[MetricTable]:
    """Bytes, computing time and energy."""
    columns = numbers.columns
    rows = numbers.rows(PRICES, columns)
    for metric in PRICES_PLACED:
        for placement, where in (("all", ""), *PLACEMENTS.items()):
            info = METRICS[metric]
            placed = [column._replace(placement=placement) for column in columns]
            label = info._replace(title=f"{info.title} {where}".strip()).label
            rows.append(MetricRow(label, [numbers.of(metric, column) for column in placed]))
    rows = [row for row in rows if any(row.metrics)]
    if rows:
        note = energy_note(numbers.runs, numbers.titles)
        yield MetricTable("Prices", list(numbers.titles.values()), rows, note)


def energy_note(runs: Sequence[Mapping[str, Columns]], titles: Mapping[str, str]) -> str:
    """What energy means, whose power nobody knows, and which methods take less than others over
    all ranges of the powers.

    Parameters
    ----------
    runs : sequence of mappings of str to Columns
        The tables of each run.
    titles : mapping of str to str
        The titles of its methods by their names.
    """
    sentences = [ABOUT_ENERGY]
    unknown = prices.unknown_powers(runs, list(titles))
    if unknown:
        sentences.append(f"Not known: the power of {', '.join(unknown)}.")
    orders = prices.order(runs, list(titles))
    certain = [
        f"{titles[method]} than {', '.join(titles[other] for other in others)}"
        for method, others in orders.items()
        if others
    ]
    if certain:
        less = "; ".join(certain)
        sentences.append(f"Less energy per frame, whatever the powers in their ranges: {less}.")
    if len(orders) > 1:
        sentences.append("All other pairs depend on the powers.")
    return " ".join(sentences)


def _utilization(numbers: _Numbers) -> Iterator[MetricTable]:
    """The busiest devices and links while frames were published; a fleet's others are counted."""
    used = numbers.utilization()
    if not used:
        return
    rows = []
    for resource in sorted(list(used)[:MAX_RESOURCES]):
        by_method = used[resource]
        rows.append(MetricRow(resource, [by_method.get(method) for method in numbers.titles]))
    left_out = len(used) - len(rows)
    note = f"{left_out} less busy ones are in metrics.json." if left_out else ""
    yield MetricTable("Utilization [%]", list(numbers.titles.values()), rows, note)


def _text_rows(table: MetricTable) -> list[list[str]]:
    rows = []
    for row in table.rows:
        numbers = [value_text(metric, unit=False, interval=True) for metric in row.metrics]
        rows.append([row.label, *numbers])
    return rows
