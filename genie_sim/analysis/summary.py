"""What a run found: in one table that fits a terminal, and in all tables of ``summary.md``."""

import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from genie_sim.analysis import text_table
from genie_sim.analysis.correctness import FLOOR
from genie_sim.analysis.metrics import DEADLINE_MS, WINDOW_REQUESTS
from genie_sim.analysis.style import PLACEMENTS
from genie_sim.recording.results import Metric

MOST_RESOURCES, MOST_ON_SCREEN = 12, 3
LEAST_USE = 0.01
UNKNOWN = "-"
LATENCY_TITLE = "Time from received to answer"
LATENCY_NOTE = (
    "First: the first answer to reach the consumer, be it from the object map. Fresh: a detection or a cached answer "
    "of this very frame. Times are those of answered frames, the share under the deadline is of all published ones."
)

SCREEN_ROWS = (
    ("first answer, mean [ms]", "first_answer_mean"),
    ("first answer, p95 [ms]", "first_answer_p95"),
    (f"first within {DEADLINE_MS:g} ms [%]", "under_deadline_share"),
    ("fresh answer, mean [ms]", "fresh_answer_mean"),
    ("with a fresh answer [%]", "fresh_answered_share"),
    ("dropped [%]", "dropped_share"),
    ("F1 of what is held [%]", "streaming_f1"),
    ("- ghosts in it [%]", "ghost_share"),
    ("- its age [s]", "held_age"),
    ("F1 of first answer* [%]", "first_proxy_f1"),
    ("wrong cache hits* [%]", "wrong_hit_share"),
)
SCREEN_REUSE = (("image reuse", "image_reuse"), ("object reuse", "object_reuse"))
SCREEN_NOTE = "Times count from when a frame reached the first node's queue. Shares: of all frames. Fresh: about this very frame."
SCREEN_FLOOR = "Held: by the consumer, against what is there; floor: the detector without delay."
SCREEN_PROXY = "* Against the detector's own answer to the frame."

Found = Mapping[tuple[str, str, str, str], Metric]  # by metric, method, placement, component

LATENCY_ROWS = (  # label, metric of the first answer, metric of the fresh answer
    ("mean [ms]", "first_answer_mean", "fresh_answer_mean"),
    ("median [ms]", "first_answer_p50", "fresh_answer_p50"),
    ("p95 [ms]", "first_answer_p95", "fresh_answer_p95"),
    ("p99 [ms]", "first_answer_p99", "fresh_answer_p99"),
    (f"under {DEADLINE_MS:g} ms [%]", "under_deadline_share", "fresh_under_deadline_share"),
)
FRAME_ROWS = (
    ("answered", "answered_share"),
    ("with a fresh answer", "fresh_answered_share"),
    ("empty answers", "empty_answer_share"),
    ("dropped", "dropped_share"),
    ("in flight", "in_flight_share"),
    ("fresh answers a second", "fresh_answer_throughput"),
)
PROXY_ROWS = (
    ("first: precision*", "first_proxy_precision"),
    ("first: recall*", "first_proxy_recall"),
    ("first: F1*", "first_proxy_f1"),
    ("fresh: precision*", "fresh_proxy_precision"),
    ("fresh: recall*", "fresh_proxy_recall"),
    ("fresh: F1*", "fresh_proxy_f1"),
    ("wrong cache hits*", "wrong_hit_share"),
)
TRUTH_ROWS = (
    ("streaming: precision", "object_precision"),
    ("recall, static", "object_recall_static"),
    ("recall, moving", "object_recall_moving"),
    ("F1", "streaming_f1"),
    ("GOSPA", "gospa"),
    ("ghosts", "ghost_share"),
    ("- moved away", "ghost_share_moved_away"),
    ("- never there", "ghost_share_never_there"),
    ("- duplicates", "ghost_share_duplicate"),
    ("age of what is held", "held_age"),
    ("place error", "place_error"),
)
PROXY_NOTE = (
    "* A proxy: against the detector's own answer to the same frame, which errs too. Wrong cache hits: those with an "
    "F1 below 80 %."
)
TRUTH_NOTE = (
    "Streaming: what the consumer holds at each instant, against what is really in view then. Floor: the detector's "
    "own answer without any delay. Ghosts: held objects that are not there."
)
NO_TRUTH_NOTE = "What is really there is not known here; 'genie-sim truth' makes a truth table of any labelled drive."
IMPROVEMENT_ROWS = (
    ("first answer", "improvement_first_answer"),
    ("fresh answer", "improvement_fresh_answer"),
)
GENIE_ROWS = (
    ("image reuse", "image_reuse"),
    ("image reuse, pooled over Genies", "image_reuse_pooled"),
    ("image reuse with neighbours", "image_reuse_with_neighbours"),
    ("wrong image hits*", "wrong_hit_share"),
    ("coalesced requests", "coalesced_share"),
    ("object reuse", "object_reuse"),
    ("object reuse, pooled over Genies", "object_reuse_pooled"),
    ("confidence boost", "confidence_boost"),
    ("stored images per Genie", "stored_images"),
    ("stored objects per Genie", "stored_objects"),
)
NOTE_ON_WORDS = (
    "Response times count from when the frame reached the first node's queue. Empty: an answer without objects. "
    "Improvement: 1 - mean of the method / mean of the baseline."
)
NOTE_ON_INTERVALS = (
    "In brackets: for latencies, shares, improvements and boosts the 95 % interval inside this run (blocks of one "
    "second; other seeds and drives may differ by more); for reuse the lowest and the highest ratio of any "
    f"{WINDOW_REQUESTS} requests in a row of any Genie."
)


@dataclass(frozen=True, slots=True)
class _Table:
    """A heading, the names of the columns, and rows that begin with their label."""

    title: str
    columns: Sequence[str]
    rows: Sequence[tuple[str, Sequence[Metric | None]]]
    more: str = ""
    units: bool = True  # beside every number; False: the label tells


def text(metrics: Sequence[Metric], width: int = 80) -> str:
    """The table for a terminal, lines of at most ``width`` characters (from 40 on); long labels are wrapped. Of the
    rows that any method has: how early, how fresh and how right answers are, then reuse, then the busiest devices."""
    headings, rows = _screen(metrics)
    notes = [SCREEN_NOTE, SCREEN_FLOOR if FLOOR in headings else NO_TRUTH_NOTE if rows else ""]
    notes.append(SCREEN_PROXY if any("*" in label for label, _ in rows) else "")
    cells = [[_show(cell, unit=False) for cell in row] for _, row in rows]
    widths = [max(map(len, column)) for column in zip(headings, *cells, strict=True)]
    room = max(width - sum(2 + one for one in widths), 8)
    label_width = min(room, max((len(label) for label, _ in rows), default=0))
    lines = [_line("", label_width, headings, widths)]
    for (label, _), row in zip(rows, cells, strict=True):
        *above, last = textwrap.wrap(label, label_width)
        lines += [*above, _line(last, label_width, row, widths)]
    lines += textwrap.wrap(" ".join(filter(None, notes)), width)
    return "\n".join(lines) + "\n"


def cells(
    metrics: Sequence[Metric], titles: Mapping[str, str]
) -> tuple[list[str], list[list[str]]]:
    """The same table as headings and rows of text with the intervals inside the run; methods have their ``titles``."""
    headings, rows = _screen(metrics)
    made = [
        [label, *(_show(cell, unit=False, interval=True) for cell in row)] for label, row in rows
    ]
    return ["", *(titles.get(heading, heading) for heading in headings)], made


def _screen(metrics: Sequence[Metric]) -> tuple[list[str], list[tuple[str, list[Metric | None]]]]:
    """The columns of the one table and its rows: those that any method has."""
    found, methods = _found(metrics)
    columns = [(method, "all", "") for method in methods]
    columns += [
        column
        for method in methods
        if ("streaming_f1", *(column := (method, "all", FLOOR))) in found
    ][:1]
    rows = _rows(SCREEN_ROWS, columns, found)
    for label, metric in SCREEN_REUSE:
        for placement, where in PLACEMENTS.items():
            rows.append(
                (
                    f"{label} {where} [%]",
                    [found.get((metric, method, placement, "")) for method in methods],
                )
            )
    busiest = _busiest(metrics)[:MOST_ON_SCREEN]
    use = _use(metrics)
    rows += [
        (f"{name} busy [%]", [use.get((name, method)) for method in methods]) for name in busiest
    ]
    rows = [(label, [*row, *[None] * (len(columns) - len(row))]) for label, row in rows if any(row)]
    return [component or method for method, _, component in columns], rows


def _found(metrics: Sequence[Metric]) -> tuple[Found, list[str]]:
    """The metrics by where they are, and the methods that ran, in their order."""
    found = {(one.metric, one.method, one.placement, one.component): one for one in metrics}
    return found, list(
        dict.fromkeys(one.method for one in metrics if one.metric == "frames_published")
    )


def markdown(metrics: Sequence[Metric], scenario: str, run_id: str, seed: int) -> str:
    """``summary.md``: the same tables with intervals, and what the words and intervals mean."""
    parts = [f"# {scenario}", f"Run `{run_id}`, seed {seed}.", NOTE_ON_WORDS, NOTE_ON_INTERVALS]
    parts = [textwrap.fill(part, 120) for part in parts]
    for table in _tables(metrics):
        rows = [
            [label, *(_show(one, table.units, interval=True) for one in cells)]
            for label, cells in table.rows
        ]
        shown = text_table.markdown(["", *table.columns], rows, "l" + "r" * len(table.columns))
        parts += filter(None, [f"## {table.title}", shown, table.more])
    return "\n\n".join(parts) + "\n"


def _tables(metrics: Sequence[Metric]) -> Iterator[_Table]:
    """The methods have the order of the metrics, which is that in which they ran."""
    found, methods = _found(metrics)
    if methods:
        yield _latencies(methods, found)
        yield _Table(
            "Published frames",
            methods,
            _rows(FRAME_ROWS, [(method, "all", "") for method in methods], found),
        )
    yield from _correctness(methods, found)
    for method in methods:
        over = [
            one.component
            for one in metrics
            if (one.metric, one.method) == (IMPROVEMENT_ROWS[0][1], method)
        ]
        if over:
            rows = _rows(IMPROVEMENT_ROWS, [(method, "all", baseline) for baseline in over], found)
            yield _Table(
                f"Improvement by {method}, of the mean",
                [f"over {baseline}" for baseline in over],
                rows,
            )
    with_genies = list(dict.fromkeys(one.method for one in metrics if one.metric == "image_reuse"))
    for method in with_genies:
        places = [
            placement for placement in PLACEMENTS if ("image_reuse", method, placement, "") in found
        ]
        rows = _rows(GENIE_ROWS, [(method, placement, "") for placement in places], found)
        title = "Genies" if len(with_genies) == 1 else f"Genies under {method}"
        yield _Table(title, [PLACEMENTS[placement] for placement in places], rows)
    yield from _utilization(methods, metrics)


def _correctness(methods: Sequence[str], found: Found) -> Iterator[_Table]:
    """Against the detector's own answers and, where it is known, against the truth; the floor stands last."""
    compared = [method for method in methods if ("first_proxy_f1", method, "all", "") in found]
    columns = [(method, "all", component) for component in ("", FLOOR) for method in methods]
    judged = [column for column in columns if ("streaming_f1", *column) in found]
    columns = [
        column
        for column in columns
        if column in judged or (column[0] in compared and not column[2])
    ]
    rows = (*(PROXY_ROWS if compared else ()), *(TRUTH_ROWS if judged else ()))
    notes = [*([PROXY_NOTE] if compared else []), TRUTH_NOTE if judged else NO_TRUTH_NOTE]
    if columns:
        headings = [component or method for method, _, component in columns]
        yield _Table("Correctness", headings, _rows(rows, columns, found), " ".join(notes))


def _latencies(methods: Sequence[str], found: Found) -> _Table:
    """First and fresh answer beside each other where they differ for a method."""
    columns = []
    for method in methods:
        first, fresh = (
            [found.get((row[which], method, "all", "")) for row in LATENCY_ROWS] for which in (1, 2)
        )
        if [one and one.value for one in first] == [one and one.value for one in fresh] or not any(
            fresh
        ):
            columns.append((method, first))
        else:
            columns += [(f"{method} first", first), (f"{method} fresh", fresh)]
    rows = [
        (row[0], [cells[place] for _, cells in columns]) for place, row in enumerate(LATENCY_ROWS)
    ]
    return _Table(
        LATENCY_TITLE, [heading for heading, _ in columns], rows, LATENCY_NOTE, units=False
    )


def _rows(
    rows: Sequence[tuple[str, str]], columns: Sequence[tuple[str, str, str]], found: Found
) -> list[tuple[str, list[Metric | None]]]:
    """``columns``: method, placement and component of each."""
    return [(label, [found.get((metric, *column)) for column in columns]) for label, metric in rows]


def _utilization(methods: Sequence[str], metrics: Sequence[Metric]) -> Iterator[_Table]:
    """Of the busiest devices and links while frames were published; a fleet's others are counted."""
    found, names = _use(metrics), _busiest(metrics)
    most = sorted(names[:MOST_RESOURCES])
    if most:
        rows = [(name, [found.get((name, method)) for method in methods]) for name in most]
        left_out = len(names) - len(most)
        more = f"{left_out} less busy ones are in metrics.json." if left_out else ""
        yield _Table("Utilization", methods, rows, more)


def _use(metrics: Sequence[Metric]) -> dict[tuple[str, str], Metric]:
    """How busy each resource was under each method."""
    return {(one.component, one.method): one for one in metrics if one.metric == "utilization"}


def _busiest(metrics: Sequence[Metric]) -> list[str]:
    """The resources that are used at all, the busiest under any method first."""
    busiest: dict[str, float] = {}
    for (resource, _), metric in _use(metrics).items():
        if (metric.value or 0.0) >= LEAST_USE:
            busiest[resource] = max(busiest.get(resource, 0.0), metric.value or 0.0)
    return sorted(busiest, key=lambda resource: (-busiest[resource], resource))


def _line(label: str, label_width: int, cells: Sequence[str], widths: Sequence[int]) -> str:
    numbers = "".join(f"  {cell:>{width}}" for cell, width in zip(cells, widths, strict=True))
    return f"{label:<{label_width}}{numbers}"


def _show(metric: Metric | None, unit: bool = True, interval: bool = False) -> str:
    """Three digits, the unit and the interval; shares in percent."""
    if metric is None or metric.value is None:
        return UNKNOWN
    share = metric.unit == "1" and metric.metric != "confidence_boost"
    value, low, high = (
        None if one is None else _digits(100 * one if share else one)
        for one in (metric.value, metric.low, metric.high)
    )
    word = (
        "%"
        if share
        else ""
        if metric.unit == "1"
        else metric.unit.partition("/Genie")[0].replace("entries", "")
    )
    shown = f"{value} {word}".rstrip() if unit else str(value)
    return shown if not interval or low is None or high is None else f"{shown} ({low} to {high})"


def _digits(value: float) -> str:
    return f"{value:,.0f}" if abs(value) >= 999.5 else f"{value:.3g}"
