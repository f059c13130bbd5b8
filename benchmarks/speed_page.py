"""The tables and figures of docs/speed.md, made from one run of the speed benchmark."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from genie_sim.engine import ENGINE
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from benchmarks import both_engines, fleet_parts
from genie_sim.analysis import style
from genie_sim.analysis.drawing import in_style
from genie_sim.analysis.style import COLUMN_IN
from genie_sim.errors import UserError

if TYPE_CHECKING:
    from benchmarks.speed import Measured

DOCS = Path(__file__).resolve().parent.parent / "docs"
ANCHOR = "simpy"
PARTS_GOAL = 1.8
GROWTH_GOAL = 1.5  # of the cost of a frame, from the smallest to the largest fleet
BYTES_GOAL = 120  # a logged frame
ENGINE_TEXT = {"simpy": "SimPy, a process a frame (anchor)", "heapq": "bare heapq loop (ceiling)"}


def blocks(measured: Measured) -> dict[str, str]:
    """Every table in Markdown, by the name of its place in the page."""
    return {
        "machine": "\n".join(
            f"- {what}: {text}" for what, text in [*measured.machine.items(), *_about(measured)]
        ),
        "engines": table(both_engines.HEADER, both_engines.rows(measured.engines)),
        "goals": _goals(measured),
        "parts": table(fleet_parts.HEADER, measured.parts.rows()),
        "ratios": _ratios(measured),
        "work": _work(measured),
        "growth": _growth(measured),
        "time": _time(measured),
        "memory": _memory(measured),
        "profile": _profile(measured),
    }


def write(measured: Measured, docs: Path = DOCS) -> None:
    """Fills the page and draws its figures. Raises ``UserError`` where the page has no place for a
    table.
    """
    page = docs / "speed.md"
    text = page.read_text(encoding="utf-8")
    for name, block in blocks(measured).items():
        text = filled(text, name, block, str(page))
    for name, figure in {
        "speed_cars": cars_figure(measured),
        "speed_time": time_figure(measured),
    }.items():
        with in_style():
            figure.savefig(docs / "images" / f"{name}.png", metadata={"Software": None})
    page.write_text(text, encoding="utf-8")


def filled(text: str, name: str, block: str, where: str) -> str:
    """The page with what stands between ``<!-- measured: NAME -->`` and ``<!-- end -->``
    replaced.
    """
    place = re.compile(rf"(<!-- measured: {re.escape(name)} -->\n).*?(<!-- end -->)", re.DOTALL)
    if not place.search(text):
        raise UserError(
            f"{where}: no place for {name!r}: '<!-- measured: {name} -->' and '<!-- end -->' are"
            " missing"
        )
    return place.sub(lambda found: f"{found[1]}{block}\n{found[2]}", text)


def table(header: Sequence[str], rows: Sequence[Sequence[str]], left: int = 1) -> str:
    """A Markdown table; the first ``left`` columns are text, the others numbers."""
    rule = ["---"] * left + ["---:"] * (len(header) - left)
    return "\n".join(f"| {' | '.join(row)} |" for row in [header, rule, *rows])


def _about(measured: Measured) -> list[tuple[str, str]]:
    others = [f"{name} {version}" for name, version in measured.versions.items()]
    left_out = [f"{name} ({reason})" for name, reason in measured.skipped.items()]
    lines = [("made by", f"`{measured.command}`")]
    lines += [("engine of all tables that name none", ENGINE.title)]
    lines += [("other simulators", ", ".join(others))] if others else []
    left_out += [f"{name} ({reason})" for name, reason in measured.engines.missing.items()]
    lines += [("left out", "; ".join(left_out))] if left_out else []
    return lines


def _goals(measured: Measured) -> str:
    rows, engines = [], measured.engines
    if both_engines.COMPILED not in engines.missing:
        for case, goal in engines.goals.items():
            ratio = engines.over_station(both_engines.COMPILED, case)
            what = f"{case}, compiled: frames/s, over SimPy's"
            rows.append((what, f"at least {goal:g}", f"{ratio:.3g}", _met(ratio >= goal)))
    parts = measured.parts
    two = parts.times_as_fast(2)
    what = f"{parts.cars:,} cars in a town, two processes: times as fast as one"
    rows.append((what, f"at least {PARTS_GOAL}", f"{two:.2f}", _met(two >= PARTS_GOAL)))
    for roads, curve in measured.curves.items():
        known = [(point.cars, point.growth) for point in curve if point.growth is not None]
        (first, _), (last, growth) = known[0], known[-1]
        what = f"cost of a frame in the {roads}, {last:,} cars over {first} cars"
        rows.append((what, f"below {GROWTH_GOAL}", f"{growth:.2f}", _met(growth < GROWTH_GOAL)))
    for what in ("frames", "all tables", "whole process"):
        text = f"bytes a logged frame: {'`frames` table alone' if what == 'frames' else what}"
        value = measured.memory[what]
        rows.append((text, f"below {BYTES_GOAL}", f"{value:.0f}", _met(value < BYTES_GOAL)))
    minutes, whole, late = _over_time(measured)
    rows.append(
        (
            f"{minutes} minutes over {minutes} times the first minute",
            "at most 1",
            f"{whole:.2f}",
            _met(whole <= 1),
        )
    )
    rows.append(
        (
            "the last quarter of them over the second",
            "at most 1.1",
            f"{late:.2f}",
            _met(late <= 1.1),
        )
    )
    return table(("what", "goal", "reached", "met"), rows)


def _met(is_met: bool) -> str:
    return "yes" if is_met else "no"


def _ratios(measured: Measured) -> str:
    rows = []
    for race in measured.races:
        for engine in race.rounds:
            ratios = race.ratios(engine, ANCHOR)
            events = race.events_per_frame(engine)
            rows.append(
                (
                    f"{race.cars:,}",
                    ENGINE_TEXT.get(engine, engine),
                    f"{race.rate(engine) / 1000:.1f}",
                    f"{race.ratio(engine, ANCHOR):.3f}",
                    f"{min(ratios):.3f} to {max(ratios):.3f}",
                    "" if events is None else f"{events:.1f}",
                    "" if events is None else f"{1e6 / race.rate(engine) / events:.2f}",
                )
            )
    header = (
        "cars",
        "engine",
        "1,000 frames/s",
        "over SimPy's",
        "in the rounds",
        "events a frame",
        "µs an event",
    )
    return table(header, rows, left=2)


def _work(measured: Measured) -> str:
    names = list(next(iter(measured.work.values())).table_rows)
    rows = []
    for run, work in measured.work.items():
        per_frame = [f"{work.table_rows[name] / work.frames:.2f}" for name in names]
        rows.append((run, f"{work.frames:,}", f"{work.events / work.frames:.1f}", *per_frame))
    return table(
        ("run", "frames", "events a frame", *(f"`{name}` rows a frame" for name in names)), rows
    )


def _growth(measured: Measured) -> str:
    rows = []
    for roads, curve in measured.curves.items():
        for point in curve:
            frames = f"{point.frames:,}" if point.frames else ""
            values = (point.anchor_growth, point.events_per_frame, point.prepare_ms_per_car)
            cost = point.missing if point.growth is None else f"{point.growth:.2f}"
            numbers = ("" if value is None else f"{value:.3g}" for value in values)
            rows.append((roads, f"{point.cars:,}", frames, cost, *numbers))
    over = "cost of a frame, over that of the smallest"
    return table(
        (
            "roads",
            "cars",
            "frames",
            over,
            "SimPy's station",
            "events a frame",
            "preparing, ms a car",
        ),
        rows,
    )


def _over_time(measured: Measured) -> tuple[int, float, float]:
    """Whole minutes driven; what they cost over so many times the first; the last quarter over the
    second.
    """
    hour = measured.hour
    begin_s, minutes = (
        hour.simulated_s[0],
        int((hour.simulated_s[-1] - hour.simulated_s[0] + 1) // 60),
    )
    first_s, quarter_s = min(60, hour.simulated_s[-1]), hour.simulated_s[-1] / 4
    whole = hour.between(begin_s, hour.simulated_s[-1]) / hour.between(begin_s, first_s)
    late = hour.between(3 * quarter_s, 4 * quarter_s) / hour.between(quarter_s, 2 * quarter_s)
    return minutes, whole * first_s / hour.simulated_s[-1], late


def _time(measured: Measured) -> str:
    hour = measured.hour
    minutes = _over_time(measured)[0]
    first_s = hour.between(0, 60)
    marks = [minute for minute in (1, 2, 5, 10, 20, 30, 60) if minute <= minutes]
    rows = [(str(minute), f"{hour.between(0, 60 * minute) / first_s:.2f}") for minute in marks]
    return table(("simulated minutes", "cost, in first minutes"), rows)


def _memory(measured: Measured) -> str:
    rows = []
    for name, value in measured.memory.items():
        rows.append((name if " " in name else f"`{name}` table", f"{value:.0f}"))
    return table(("what", "MB for a million frames (bytes a frame)"), rows)


def _profile(measured: Measured) -> str:
    rows = [
        (f"`{hot.where}`", f"{hot.calls_per_frame:.1f}", f"{hot.share:.1%}")
        for hot in measured.profile
    ]
    return table(("function", "calls a frame", "share of all time"), rows)


@in_style()
def cars_figure(measured: Measured) -> Figure:
    """The cost of a frame over the size of the fleet, and SimPy's own beside it."""
    figure, axis = _figure()
    ticks: set[int] = set()
    for roads, line in (
        ("street", _line(2, "Genie, street", "o")),
        ("town", _line(1, "Genie, town", "^")),
    ):
        known = [point for point in measured.curves.get(roads, ()) if point.growth is not None]
        ticks.update(point.cars for point in known)
        axis.plot([point.cars for point in known], [point.growth for point in known], **line)
    known = [point for point in measured.curves["street"] if point.anchor_growth is not None]
    anchors = [point.anchor_growth for point in known]
    axis.plot([point.cars for point in known], anchors, **_line(0, "SimPy's station", "s"))
    axis.axhline(
        GROWTH_GOAL,
        color="black",
        linewidth=0.9,
        linestyle="--",
        label=f"goal: below {GROWTH_GOAL}",
    )
    axis.set_xscale("log")
    axis.xaxis.set_major_locator(FixedLocator(sorted(ticks)))
    axis.xaxis.set_minor_locator(NullLocator())
    axis.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.0f}"))
    axis.set_ylim(0, None)
    return _labelled(figure, axis, "cars, logarithmic", f"cost of a frame [{min(ticks)} cars = 1]")


@in_style()
def time_figure(measured: Measured) -> Figure:
    """What a run has cost so far over simulated time, in units of its first minute."""
    figure, axis = _figure()
    hour, minutes = measured.hour, _over_time(measured)[0]
    first_s = hour.between(0, 60)
    marks = range(minutes + 1)
    axis.plot(
        marks, [hour.between(0, 60 * minute) / first_s for minute in marks], **_line(2, "Genie", "")
    )
    axis.plot(
        [0, minutes],
        [0, minutes],
        color="black",
        linewidth=0.9,
        linestyle="--",
        label="goal: every minute the same",
    )
    axis.set_xlim(0, minutes)
    axis.set_ylim(0, None)
    return _labelled(figure, axis, "simulated time [min]", "cost so far [first minute = 1]")


def _line(place: int, label: str, marker: str) -> Mapping[str, object]:
    return style.method_line(place) | {"label": label, "marker": marker, "markersize": 4}


def _figure() -> tuple[Figure, Axes]:
    figure = Figure(figsize=(COLUMN_IN, 2.6), layout="constrained")
    return figure, figure.subplots()


def _labelled(figure: Figure, axis: Axes, x_label: str, y_label: str) -> Figure:
    axis.set_xlabel(x_label)
    axis.set_ylabel(y_label)
    figure.legend(loc="outside lower center", ncols=2)
    return figure
