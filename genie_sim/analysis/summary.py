"""The results of a run as tables: that for a terminal and for papers, those of ``summary.md``."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

from genie_sim.analysis import correctness, prices, renderers
from genie_sim.analysis.compare import no_value
from genie_sim.analysis.correctness import CORRECTNESS, LAPS
from genie_sim.analysis.frame_metrics import FRAMES_SECTION, IMPROVEMENTS, TIMES
from genie_sim.analysis.genie_metrics import GENIES, of_clients
from genie_sim.analysis.metric import MAIN, RECENT_MS, SHORT, Metric
from genie_sim.analysis.outages import FAULTS_SECTION
from genie_sim.analysis.registry import (
    METRICS,
    OWN,
    cell,
    checked,
    component_title,
    definition,
    shown,
)
from genie_sim.analysis.resource_metrics import MAX_RESOURCES, busiest
from genie_sim.analysis.result_table import Cell, ResultTable, Row
from genie_sim.analysis.seed_runs import SeedRuns, seeds_text, tables_of_runs
from genie_sim.analysis.statistics import MIN_SEEDS, has_interval
from genie_sim.analysis.style import PLACEMENTS
from genie_sim.base.errors import UserError
from genie_sim.base.text import one_line
from genie_sim.record.records import ZERO_DELAY
from genie_sim.record.results import TIDY_FIELDS, MetricValue, Run

# A resource is overloaded from this utilization on, if more than that share of frames is dropped.
OVERLOADED, MANY_DROPPED = 0.95, 0.1
OF_LOOKUPS = ("image_reuse", "object_reuse", "confidence_boost")
SECTIONS = (
    TIMES,
    FRAMES_SECTION,
    CORRECTNESS,
    LAPS,
    FAULTS_SECTION,
    IMPROVEMENTS,
    GENIES,
    prices.PRICES,
    OWN,
)

ABOUT_TIMES = (
    "Times: from the camera's stamp. Shares: of all published frames, unless the name says "
    "otherwise."
)
ABOUT_ANSWERS = (
    "First answer: any, perhaps from the object map. Fresh result: a detector looked at this very "
    "frame."
)
ABOUT_LOOKS = (
    f"Recent: a look at most {RECENT_MS:g} ms older. Age of look: from the newest frame in which a "
    "detector saw any of the first answer."
)
NO_LOOKUPS = "Reuse and confidence boost: there are none, for no Genie's look-ups are recorded."
ABOUT_TRUTH = "What the consumer holds at each instant is compared with what is in view then."
ABOUT_ZERO_DELAY = (
    "Zero-delay detector: the detector's own answers without any delay, judged in the same way."
)
ABOUT_PROXIES = (
    "Proxy, and cache hits: against the detector's own answer to the same frame, which errs, too."
)
NO_TRUTH = (
    "The objects that are really there are not known here; 'genie-sim import truth' makes a truth "
    "table of any labelled drive."
)
ABOUT_ENERGY = (
    "Energy: of cars while they drive and of edges until the last answer, from the watts of the "
    "device profiles; its range: with every power at the lower and at the upper end of its own."
)
ABOUT = {
    IMPROVEMENTS: "Improvement: 1 - mean of the method / mean of the baseline.",
    FAULTS_SECTION: "The first fault that is no hand-over; a frame belongs to the time of its "
    "stamp. Recovery: from its end to the first half second with 95 % of the share of fresh results"
    " before it.",
}
ABOUT_BUSIEST = "Busiest: the utilization of whichever is used most."
ABOUT_INTERVALS = (
    "In brackets: the 95 % interval inside this run (blocks of one second; other seeds and drives "
    "may differ by more). A range of reuse: the lowest and the highest running ratio of any Genie."
)
IN_ONE_RUN = "In brackets: 95 % intervals inside the run, over blocks of one second."


class _Column(NamedTuple):
    """A column of a table: the numbers of a method, or of a component beside the methods."""

    title: str
    method: str
    component: str = ""

    def component_of(self, component: str) -> str:
        """The component of a row whose number stands in this column; none has both that of a row
        and that of the column.
        """
        return ", ".join(filter(None, (component, self.component)))


class _Numbers:
    """The numbers of a run by their names and places, and the methods that were simulated."""

    def __init__(self, run: Run | SeedRuns) -> None:
        self.metrics = run.measured
        self.words = run.words
        self.runs = tables_of_runs(run)
        self._by_place = {
            (metric.metric, metric.method, metric.placement, metric.component): metric
            for metric in run.measured
        }
        simulated = {metric.method for metric in run.measured}
        self.methods = [method for method in run.methods if method.name in simulated]
        self.titles = {method.name: one_line(method.title) for method in self.methods}
        self.columns = [_Column(title, name) for name, title in self.titles.items()]
        self._places: dict[str, dict[tuple[str, str], None]] = {}
        for name, _, *place in self._by_place:
            if place[1] != ZERO_DELAY:
                self._places.setdefault(name, {})[place[0], place[1]] = None

    @property
    def names(self) -> list[str]:
        """The metrics that have a number."""
        return list(self._places)

    @property
    def own(self) -> list[str]:
        """The metrics of the user's own."""
        return [name for name in self._places if name not in METRICS]

    def is_measured(self, metrics: Iterable[str]) -> bool:
        """Whether there is a number of any of these metrics."""
        return any(name in self._places for name in metrics)

    def about(self, name: str) -> Metric:
        """What a metric is."""
        return definition(name, self.words)

    def _range(self, name: str, method: str, placement: str, component: str) -> Cell:
        """The range of a number alone."""
        metric = self._by_place.get((name, method, placement, component))
        if metric is None or metric.range_low is None:
            return Cell()
        return self.about(name).cell(None, metric.range_low, metric.range_high)

    def rows(
        self,
        metrics: Iterable[str],
        columns: Sequence[_Column],
        whole: bool = False,
    ) -> Iterator[Row]:
        """A row for each metric, placement and component that has a number, and one for its range;
        with ``whole``, of a metric of cars and edges together that alone, and no range.
        """
        for name in metrics:
            places = self._places.get(name, {})
            if whole and ("all", "") in places:
                places = {("all", ""): None}
            for placement, component in places:
                cells = [
                    cell(
                        self._by_place.get(
                            (name, column.method, placement, column.component_of(component))
                        ),
                        self.words,
                    )
                    for column in columns
                ]
                if any(found.is_known for found in cells):
                    metric = self.about(name)
                    title = metric.titled(placement, component_title(component, self.methods))
                    yield Row(metric.labelled(title), cells)
                    ranges = [
                        self._range(name, column.method, placement, column.component_of(component))
                        for column in columns
                    ]
                    if not whole and any(cell.is_known for cell in ranges):
                        yield Row(metric.labelled(f"{title}, range"), ranges)

    def section(self, title: str) -> ResultTable:
        """The table of a section, of the columns that have a number."""
        columns = [*self.columns, *(self.zero_delay() if title == CORRECTNESS else ())]
        names = [name for name in (*METRICS, *self.own) if self.about(name).section == title]
        rows = list(self.rows(names, columns))
        table = ResultTable([column.title for column in columns], rows, title)
        return table.without_empty_columns()

    def zero_delay(self) -> list[_Column]:
        """The column of the zero-delay detector, the same for all methods; none without truth."""
        for name in self.titles:
            if ("streaming_f1", name, "all", ZERO_DELAY) in self._by_place:
                return [_Column(component_title(ZERO_DELAY), name, ZERO_DELAY)]
        return []

    def busiest(self, columns: Sequence[_Column]) -> Iterator[Row]:
        """The utilization of the busiest accelerator on cars and on edges, and of the busiest
        link.
        """
        kinds = {f"busiest accelerator {where}": (of, False) for of, where in PLACEMENTS.items()}
        for title, kind in (kinds | {"busiest link": ("all", True)}).items():
            cells = []
            for column in columns:
                uses = [
                    metric
                    for metric in self.metrics
                    if (metric.metric, metric.method) == ("utilization", column.method)
                    and not column.component
                    and _kind(metric) == kind
                ]
                cells.append(cell(max(uses, key=_use, default=None)))
            if any(found.is_known for found in cells):
                yield Row(METRICS["utilization"].labelled(title), cells)

    def utilization(self) -> ResultTable:
        """The busiest devices and links while frames were published; others are counted."""
        by_resource: dict[str, dict[str, MetricValue]] = {}
        for metric in self.metrics:
            if metric.metric == "utilization":
                by_resource.setdefault(metric.component, {})[metric.method] = metric
        used = busiest(self.metrics)
        rows = [
            Row(name, [cell(by_resource[name].get(method)) for method in self.titles])
            for name in sorted(used[:MAX_RESOURCES])
        ]
        left_out = len(used) - len(rows)
        notes = [f"{left_out} less busy ones are in metrics.json."] if left_out else []
        return ResultTable(list(self.titles.values()), rows, "Utilization [%]", notes)


def _use(metric: MetricValue) -> float:
    return metric.value or 0.0


def _kind(metric: MetricValue) -> tuple[str, bool]:
    """Of a resource: whether it is an accelerator on cars, on edges, or a link."""
    is_link = "->" in metric.component
    is_accelerator = metric.component.endswith(".accelerator")
    return metric.placement if is_link or is_accelerator else "", is_link


def table(run: Run | SeedRuns, format: str, metrics: Sequence[str] = ()) -> str:
    """The main table, or the rows of these ``metrics``, in ``markdown`` or ``latex``; in ``csv``
    every metric with all digits.
    """
    main = main_table(run, metrics)
    if format == "csv":
        seed = run.runs[0].seed if len(run.runs) == 1 else None
        rows = [
            metric.of_seed(seed)
            for metric in run.measured
            if not metrics or metric.metric in metrics
        ]
        return renderers.csv_of_rows(TIDY_FIELDS, rows)
    if format == "latex":
        return _latex(run, main)
    notes = [about_seeds(run)] if isinstance(run, SeedRuns) else []
    return renderers.markdown(replace(main, notes=notes))


def _latex(run: Run | SeedRuns, table: ResultTable) -> str:
    """The table with a caption that says what it is of."""
    seeds = seeds_text([of_seed.seed for of_seed in run.runs])
    about = about_seeds(run) if isinstance(run, SeedRuns) else IN_ONE_RUN
    titled = replace(
        table,
        title=f"{run.title}: response times, correctness and cost ({seeds})",
        notes=[about, *table.notes],
    )
    return renderers.latex(titled, run.title)


def about_seeds(runs: SeedRuns) -> str:
    """What the numbers of several seeds are."""
    seeds = seeds_text(runs.seeds)
    what = "means, in brackets their 95 % t intervals over seeds"
    if not has_interval(len(runs.seeds)):
        what = f"means; of fewer than {MIN_SEEDS} seeds there is no interval"
    return f"{seeds[0].upper()}{seeds[1:]}: {what}."


def overload(run: Run | SeedRuns) -> str:
    """Says which resource is overloaded under which method: it works all the time, and frames are
    dropped; empty if none is.
    """
    numbers: dict[tuple[str, str], list[MetricValue]] = {}
    for metric in run.measured:
        if metric.metric in ("utilization", "dropped_share") and metric.value is not None:
            numbers.setdefault((metric.metric, metric.method), []).append(metric)
    which = []
    for method in run.methods:
        busiest = max(numbers.get(("utilization", method.name), ()), key=_use, default=None)
        dropped = max(map(_use, numbers.get(("dropped_share", method.name), ())), default=0.0)
        if busiest is not None and _use(busiest) >= OVERLOADED and dropped > MANY_DROPPED:
            shares = f"busy {100 * _use(busiest):.0f} % of the time, {100 * dropped:.0f} % of the"
            which.append(f"{busiest.component} under {method.title} ({shares} frames dropped)")
    return f"Overloaded: {'; '.join(which)}." if which else ""


def no_repeats(run: Run | SeedRuns) -> str:
    """Says under which method no key of the message cache or of the object map came twice, so that
    nothing could be reused; empty where each did, or nobody looked one up.
    """
    which = []
    for method in run.methods:
        requests = equal = sightings = updates = 0
        for tables in tables_of_runs(run):
            if "lookups" not in tables:
                continue
            lookups = tables["lookups"].where(method=method.name)
            images, seen = of_clients(lookups), lookups.where(kind="sighting")
            requests += len(images)
            equal += len(images) - len(images.where(outcome="miss"))
            sightings += int(seen["requests"].sum())
            updates += int(seen["updates"].sum())
        if requests and not equal:
            which.append(f"none of {requests:,} requests under {method.title} equals another")
        if sightings and not updates:
            text = f"none of {sightings:,} sightings under {method.title} is of a stored object"
            which.append(text)
    return f"No key repeats: {'; '.join(which)}." if which else ""


def about_laws(run: Run | SeedRuns) -> str:
    """What the laws of the detector rest on, which maps and trackers go by; empty where that is not
    known.
    """
    laws = run.runs[0].facts.get("laws")
    if laws is None:
        return ""
    count = len(laws["measured_on"])
    if count:
        drives = "one other drive" if count == 1 else f"{count} other drives"
        return f"Laws of {laws['detector']}: measured on {drives}, shrunk towards assumed ones."
    where = "on this drive alone" if laws["is_known"] else "nowhere"
    return f"Laws of {laws['detector']}: measured {where}, so the assumed ones are used."


def about_boxes(run: Run | SeedRuns) -> str:
    """Whose times and whose boxes a run has, where these are two; empty where they are of one, or
    the boxes of no detector that is known.
    """
    facts = run.runs[0].facts
    if "laws" not in facts:
        return ""
    detector, scenario = facts["laws"]["detector"], facts["scenario"]
    of_methods = (entry.get("model") for entry in scenario["methods"] if isinstance(entry, dict))
    models = [model for model in dict.fromkeys([scenario["model"], *of_methods]) if model]
    if models == [detector]:
        return ""
    return f"Times are of {', '.join(models)}, boxes of {detector}: 'model' changes times alone."


def markdown(run: Run | SeedRuns) -> str:
    """``summary.md``: all tables with intervals, and what the words and intervals mean."""
    title = f"# {renderers.markdown_text(run.title)}"
    if isinstance(run, SeedRuns):
        ids = ", ".join(f"`{of_seed.run_id}`" for of_seed in run.runs)
        parts, about_intervals = (
            [title, f"Runs {ids}."],
            about_seeds(run),
        )
    else:
        parts = [title, f"Run `{run.run_id}`, seed {run.seed}."]
        about_intervals = ABOUT_INTERVALS
    if run.runs[0].warm_up:
        parts[1] = f"{parts[1][:-1]}, {run.runs[0].warm_up}."
    abouts = (
        ABOUT_TIMES,
        f"{ABOUT_ANSWERS} {ABOUT_LOOKS}",
        about_intervals,
        about_boxes(run),
        about_laws(run),
    )
    parts += [renderers.markdown_paragraph(about) for about in abouts if about]
    parts += [renderers.markdown(table).rstrip() for table in tables(run)]
    return "\n\n".join(parts) + "\n"


def main_table(run: Run | SeedRuns, metrics: Sequence[str] = (), tier: int = MAIN) -> ResultTable:
    """The one table for a terminal or a paper: response times, correctness, reuse, and the busiest
    devices, of the metrics up to a tier in which any method has a number; or of these ``metrics``.
    Raises ``UserError`` for a metric that is not known, or of which the run has no number.
    """
    numbers = _Numbers(run)
    names = checked(metrics, numbers.own) or shown(tier, numbers.names)
    for name in metrics:
        if name not in numbers.names:
            raise UserError(f"metrics: {no_value(name)}")
    columns = [*numbers.columns, *numbers.zero_delay()]
    rows: list[Row] = []
    for name in names:
        of_busiest = name == "utilization"
        rows += numbers.busiest(columns) if of_busiest else numbers.rows([name], columns, True)
    table = ResultTable([column.title for column in columns], rows)
    hidden = {*numbers.names}.difference(names)
    told = [name for name, metric in METRICS.items() if metric.tier <= tier and name not in hidden]
    notes = (
        [] if metrics else list(filter(None, [overload(run), no_repeats(run), about_boxes(run)]))
    )
    notes += _main_notes(metrics or told, numbers)
    laws = run.runs[0].facts.get("laws")
    if laws is not None and not laws["is_known"]:
        notes.append(about_laws(run))
    return replace(table.without_empty_columns(), notes=notes)


def short_table(run: Run | SeedRuns) -> ResultTable:
    """Of the main table the rows that a terminal shows, and those of the user's own metrics."""
    table = main_table(run, tier=SHORT)
    more = len(main_table(run).rows) - len(table.rows)
    if more <= 0:
        return table
    told = f"{more} more rows: genie-sim run --all, or genie-sim table on the results."
    return replace(table, notes=[*table.notes, told])


def _main_notes(names: Sequence[str], numbers: _Numbers) -> Iterator[str]:
    """What the words of these metrics mean, and why there is no number of one."""
    if any(METRICS[name].section in (TIMES, FRAMES_SECTION) for name in names if name in METRICS):
        yield f"{ABOUT_TIMES} {ABOUT_ANSWERS}"
    if numbers.is_measured({"recent_share", "look_age_mean"}.intersection(names)):
        yield ABOUT_LOOKS
    if "utilization" in names and numbers.is_measured(["utilization"]):
        yield ABOUT_BUSIEST
    if any(name in correctness.HELD_METRICS for name in names):
        yield _about_truth(numbers)
    if numbers.is_measured(set(correctness.ANSWER_METRICS).intersection(names)):
        yield ABOUT_PROXIES
    if any(name in OF_LOOKUPS for name in names) and not numbers.is_measured(OF_LOOKUPS):
        yield NO_LOOKUPS


def tables(run: Run | SeedRuns) -> Iterator[ResultTable]:
    """All tables that have a row, of methods in the order in which they ran."""
    numbers = _Numbers(run)
    sections = [definition(metric.metric, run.words).section for metric in run.measured]
    for title in filter(None, dict.fromkeys((*SECTIONS, *sections))):
        table = numbers.section(title)
        if table.rows:
            yield replace(table, notes=list(_notes(title, numbers)))
    use = numbers.utilization()
    if use.rows:
        yield use


def _notes(section: str, numbers: _Numbers) -> Iterator[str]:
    """What stands below the table of a section."""
    if section in ABOUT:
        yield ABOUT[section]
    elif section == CORRECTNESS:
        if numbers.is_measured(correctness.ANSWER_METRICS):
            yield from (ABOUT_PROXIES, METRICS["wrong_hit_share"].meaning)
        yield _about_truth(numbers)
    elif section == prices.PRICES:
        yield ABOUT_ENERGY
        if unknown := prices.unknown_powers(numbers.runs, list(numbers.titles)):
            yield f"Not known: the power of {', '.join(unknown)}."


def _about_truth(numbers: _Numbers) -> str:
    """What false objects and the like are compared with, or why there are none."""
    if not numbers.is_measured(correctness.HELD_METRICS):
        return NO_TRUTH
    return f"{ABOUT_TRUTH} {ABOUT_ZERO_DELAY}" if numbers.zero_delay() else ABOUT_TRUTH
