"""The results of a run as tables: that for a terminal and for papers, those of ``summary.md``."""

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

from genie_sim.analysis import correctness, outages, prices, renderers
from genie_sim.analysis.compare import no_value
from genie_sim.analysis.frame_metrics import TIMES
from genie_sim.analysis.genie_metrics import of_clients
from genie_sim.analysis.metric import MAIN, RECENT_MS, SHORT, Metric
from genie_sim.analysis.registry import (
    METRICS,
    cell,
    checked,
    component_title,
    definition,
    shown,
)
from genie_sim.analysis.resource_metrics import MAX_RESOURCES, busiest
from genie_sim.analysis.result_table import Cell, ResultTable, Row
from genie_sim.analysis.seed_runs import SeedRuns, seeds_text
from genie_sim.analysis.statistics import MIN_SEEDS, has_interval
from genie_sim.analysis.style import PLACEMENTS
from genie_sim.base.errors import UserError
from genie_sim.base.text import one_line
from genie_sim.record.records import ZERO_DELAY
from genie_sim.record.results import TIDY_FIELDS, MetricValue, Run

# What is overloaded drops more than this share of its messages. So many are named.
MANY_DROPPED, MAX_NAMED = 0.1, 3
OF_LOOKUPS = ("image_reuse", "object_reuse", "confidence_boost")
ABOUT_ZERO_DELAY = (
    "Zero-delay detector: the detector's own answers without any delay, judged in the same way."
)
# What rows of these metrics mean, besides their titles.
NOTES = (
    (
        [name for name, metric in METRICS.items() if metric.section == TIMES],
        "Times: from the camera's stamp. Shares: of all published frames, unless the name says "
        "otherwise. First answer: any, perhaps from the object map. Fresh result: a detector "
        "looked at this very frame.",
    ),
    (
        ["recent_share", "look_age_mean"],
        f"Recent: a look at most {RECENT_MS:g} ms older. Age of look: from the newest frame in "
        "which a detector saw any of the first answer.",
    ),
    (
        correctness.HELD_METRICS,
        "What the consumer holds at each instant is compared with what is in view then.",
    ),
    (
        correctness.ANSWER_METRICS,
        "Proxy, and cache hits: against the detector's own answer to the same frame, which errs, "
        "too; a hit is wrong whose F1 is below 80 %.",
    ),
    (
        outages.METRICS,
        "The first fault that is no hand-over; a frame belongs to the time of its stamp. Recovery: "
        "from its end to the first half second with 95 % of the share of fresh results before it.",
    ),
    (
        ["image_reuse", "image_reuse_own", "object_reuse"],
        "A range of reuse: the lowest and the highest running ratio of any Genie; of several seeds "
        "the means of both.",
    ),
    (
        ["improvement_first_answer"],
        "Improvement: 1 - mean of the method / mean of the baseline.",
    ),
    (
        ["energy_per_frame"],
        "Energy: of cars while they drive and of edges until the last answer, from the watts of "
        "the device profiles; its range: with every power at the lower and at the upper end of its "
        "own.",
    ),
)
NO_LOOKUPS = "Reuse and confidence boost: there are none, for no Genie's look-ups are recorded."
NO_TRUTH = (
    "The objects that are really there are not known here; 'genie-sim import truth' makes a truth "
    "table of any labelled drive."
)
ABOUT_INTERVALS = (
    "In brackets: the 95 % interval inside this run (blocks of one second; other seeds and drives "
    "may differ by more)."
)
ABOUT_MAIN = ": response times, correctness and cost"
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
    """The numbers of a run by their names and places, in columns of the methods that were
    simulated, and of the zero-delay detector, which is the same for all; without truth there is
    none.
    """

    def __init__(self, run: Run | SeedRuns) -> None:
        self.metrics = run.measured
        self.words = run.words
        self._by_place = {
            (metric.metric, metric.method, metric.placement, metric.component): metric
            for metric in run.measured
        }
        simulated = dict.fromkeys(metric.method for metric in run.measured)
        self._methods = [method for method in run.methods if method.name in simulated]
        self._columns = [_Column(one_line(method.title), method.name) for method in self._methods]
        for name in simulated:
            if ("streaming_f1", name, "all", ZERO_DELAY) in self._by_place:
                self._columns.append(_Column(component_title(ZERO_DELAY), name, ZERO_DELAY))
                break
        used = busiest(run.measured)
        self._busiest, self.less_busy = used[:MAX_RESOURCES], len(used[MAX_RESOURCES:])
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

    def about(self, name: str) -> Metric:
        """What a metric is."""
        return definition(name, self.words)

    def table(self, rows: Iterable[Row], title: str = "") -> ResultTable:
        """Rows below the titles of those columns in which there is a number."""
        titles = [column.title for column in self._columns]
        return ResultTable(titles, list(rows), title).without_empty_columns()

    def rows(self, name: str, whole: bool = False) -> Iterator[Row]:
        """A row for each placement and component of which the metric has a number, and one for its
        range; with ``whole``, of a metric of cars and edges together that alone, and no range.
        """
        about, places = self.about(name), list(self._places.get(name, ()))
        if whole and ("all", "") in places:
            places = [("all", "")]
        if name == "utilization":
            places = [place for place in places if place[1] in self._busiest]
        for placement, component in places:
            numbers = [
                self._by_place.get((name, column.method, placement, column.component_of(component)))
                for column in self._columns
            ]
            title = about.titled(placement, component_title(component, self._methods))
            yield Row(about.labelled(title), [cell(number, self.words) for number in numbers])
            known = [number for number in numbers if number is not None]
            if not whole and any(number.range_low is not None for number in known):
                ranges = [
                    Cell() if each is None else about.cell(None, each.range_low, each.range_high)
                    for each in numbers
                ]
                yield Row(about.labelled(f"{title}, range"), ranges)

    def busiest(self) -> Iterator[Row]:
        """The utilization of the busiest accelerator on cars and on edges, and of the busiest
        link.
        """
        kinds = {f"busiest accelerator {where}": (of, False) for of, where in PLACEMENTS.items()}
        for title, kind in (kinds | {"busiest link": ("all", True)}).items():
            uses: dict[str, list[MetricValue]] = {}
            for metric in self.metrics:
                if metric.metric == "utilization" and _kind(metric) == kind:
                    uses.setdefault(metric.method, []).append(metric)
            highest = {method: max(of_method, key=_use) for method, of_method in uses.items()}
            if highest:
                cells = [
                    Cell() if column.component else cell(highest.get(column.method))
                    for column in self._columns
                ]
                yield Row(METRICS["utilization"].labelled(title), cells)


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
        seeds = seeds_text([of_seed.seed for of_seed in run.runs])
        title = f"{run.title}{'' if metrics else ABOUT_MAIN} ({seeds})"
        about = about_seeds(run) if isinstance(run, SeedRuns) else IN_ONE_RUN
        return renderers.latex(replace(main, title=title, notes=[about, *main.notes]), run.title)
    notes = [about_seeds(run)] if isinstance(run, SeedRuns) else []
    return renderers.markdown(replace(main, notes=notes))


def about_intervals(run: Run | SeedRuns) -> str:
    """What stands in brackets behind its numbers."""
    return about_seeds(run) if isinstance(run, SeedRuns) else ABOUT_INTERVALS


def about_seeds(runs: SeedRuns) -> str:
    """What the numbers of several seeds are."""
    seeds = seeds_text(runs.seeds)
    what = "means, in brackets their 95 % t intervals over seeds"
    if not has_interval(len(runs.seeds)):
        what = f"means; of fewer than {MIN_SEEDS} seeds there is no interval"
    return f"{seeds[0].upper()}{seeds[1:]}: {what}."


def overload(run: Run | SeedRuns) -> str:
    """Says which devices and links are overloaded under which method: more comes to them than they
    can serve, and much of it is dropped; empty if none is.
    """
    uses = {(use.method, use.component): use for use in run.measured if use.metric == "utilization"}
    which = []
    for method in run.methods:
        lost, wanted, overloaded = 0, 0, dict[str, None]()
        for name, (dropped, served) in _messages(run, method.name).items():
            host = name.partition("/")[0]
            servers = [name] if "->" in name else [f"{host}.accelerator", f"{host}.cpu"]
            known = [uses[method.name, each] for each in servers if (method.name, each) in uses]
            server, came = max(known, key=_use, default=None), dropped + served
            if server is None or dropped <= MANY_DROPPED * came:
                continue
            if _use(server) * came > served:
                overloaded[server.component] = None
                lost, wanted = lost + dropped, wanted + came
        if overloaded:
            names, more = [*overloaded][:MAX_NAMED], len(overloaded) - MAX_NAMED
            text = ", ".join(names) + (f" and {more} more" if more > 0 else "")
            which.append(f"{text} under {method.title} ({100 * lost / wanted:.0f} %)")
    return f"Overloaded (share of messages dropped): {'; '.join(which)}." if which else ""


def _messages(run: Run | SeedRuns, method: str) -> dict[str, tuple[int, int]]:
    """How many messages were dropped and how many served, in all seeds, where any had to wait."""
    counts: dict[str, tuple[int, int]] = {}
    for tables in (of_seed.tables for of_seed in run.runs):
        if "resources" in tables:
            for name, samples in tables["resources"].where(method=method).groups("resource"):
                if samples["queue_max"].max():
                    dropped, served = counts.get(name, (0, 0))
                    dropped += int(samples["dropped"].max())
                    counts[name] = dropped, served + int(samples["completed"].max())
    return counts


def no_repeats(run: Run | SeedRuns) -> str:
    """Says under which method no key of the message cache or of the object map came twice, so that
    nothing could be reused; empty where each did, or nobody looked one up.
    """
    which = []
    for method in run.methods:
        requests = equal = sightings = updates = 0
        for tables in (of_seed.tables for of_seed in run.runs):
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
    ids = ", ".join(f"`{of_seed.run_id}`" for of_seed in run.runs)
    which = f"Runs {ids}" if isinstance(run, SeedRuns) else f"Run {ids}, seed {run.seed}"
    parts = [title, f"{', '.join(filter(None, [which, run.runs[0].warm_up]))}."]
    abouts = filter(None, dict.fromkeys([about_intervals(run), *findings(run), about_laws(run)]))
    parts += [renderers.markdown_paragraph(about) for about in abouts]
    parts += [renderers.markdown(table).rstrip() for table in tables(run)]
    return "\n\n".join(parts) + "\n"


def main_table(run: Run | SeedRuns, metrics: Sequence[str] = (), tier: int = MAIN) -> ResultTable:
    """The one table for a paper or a page: response times, correctness, reuse, and the busiest
    devices, of the metrics up to a tier in which any method has a number; or of these ``metrics``.
    Raises ``UserError`` for a metric that is not known, or of which the run has no number.
    """
    numbers = _Numbers(run)
    names = checked(metrics, numbers.own) or shown(tier, numbers.names)
    rows: list[Row] = []
    for name in names:
        if name not in numbers.names:
            raise UserError(f"metrics: {no_value(name)}")
        rows += numbers.busiest() if name == "utilization" else numbers.rows(name, whole=True)
    notes = [] if metrics else findings(run)
    return replace(numbers.table(rows), notes=[*notes, *_meanings(names)])


def printed_table(run: Run | SeedRuns, metrics: Sequence[str] | None = None) -> ResultTable:
    """The same for a terminal, by default of the most important rows and those of the user's own
    metrics: below it stands what was found, and where the rest is told.
    """
    table = main_table(run, metrics or (), SHORT if metrics is None else MAIN)
    notes = [] if metrics else findings(run)
    told = "What each row means: genie-sim list metrics."
    more = len(main_table(run).rows) - len(table.rows)
    if metrics is None and more:
        told += f" {more} more rows: genie-sim run --all, or genie-sim table on the results."
    return replace(table, notes=[*notes, told])


def findings(run: Run | SeedRuns) -> list[str]:
    """What is to be known of this run besides its numbers: what was overloaded or never repeated,
    what its boxes and laws are, and which numbers there are none of.
    """
    measured = {metric.metric for metric in run.measured}
    laws = run.runs[0].facts.get("laws")
    return [
        *filter(None, [overload(run), no_repeats(run), about_boxes(run)]),
        *([] if laws is None or laws["is_known"] else [about_laws(run)]),
        *([] if measured.intersection(correctness.HELD_METRICS) else [NO_TRUTH]),
        *([] if measured.intersection(OF_LOOKUPS) else [NO_LOOKUPS]),
        *([ABOUT_ZERO_DELAY] if any(m.component == ZERO_DELAY for m in run.measured) else []),
    ]


def _meanings(names: Collection[str]) -> list[str]:
    """What the words of these metrics mean."""
    return [text for metrics, text in NOTES if any(name in names for name in metrics)]


def tables(run: Run | SeedRuns) -> Iterator[ResultTable]:
    """All tables that have a row, of methods in the order in which they ran."""
    numbers = _Numbers(run)
    by_section: dict[str, list[str]] = {}
    for name in (*METRICS, *numbers.own):
        by_section.setdefault(numbers.about(name).section, []).append(name)
    for title, names in by_section.items():
        shown_names = [name for name in names if name in numbers.names]
        rows = [row for name in shown_names for row in numbers.rows(name)]
        notes = _meanings(shown_names)
        if "energy_per_frame" in shown_names:
            notes += prices.unknown_powers(run.runs)
        if "utilization" in shown_names and numbers.less_busy:
            where = "metrics.json of each run" if isinstance(run, SeedRuns) else "metrics.json"
            notes.append(f"Less busy ones, in {where}: {numbers.less_busy}.")
        if rows and title:
            yield replace(numbers.table(rows, title), notes=notes)
