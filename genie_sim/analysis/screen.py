"""The results of a run on a terminal: a line that says what was run, and a table that fits."""

import textwrap
from collections.abc import Sequence

import numpy as np

from genie_sim.analysis.registry import value_text
from genie_sim.analysis.seed_runs import SeedRuns, seeds_text
from genie_sim.analysis.summary import MetricTable, about_seeds, main_table
from genie_sim.recording.results import Run
from genie_sim.text import number_text, one_line
from genie_sim.units import NS_PER_S

MIN_LABEL_WIDTH, LEGIBLE_LABEL_WIDTH = 8, 24  # characters
GAP = 2  # characters between columns


def header(run: Run | SeedRuns) -> str:
    """What was run: ``town: 3 cars, 3 edges, 15.8 s, 462 frames under each of 3 methods, seed 1``.
    Frames are those of one seed.
    """
    scenario = run.runs[0].facts["scenario"]
    fleet = scenario.get("fleet")
    frames = run.runs[0].tables["frames"]
    cars = len(scenario["cars"]) if fleet is None else fleet["cars"]
    # Recorded traffic brings its own cars.
    parts = [_count(cars or len(frames["car"].unique()), "car")]
    if fleet is None:
        parts.append(_count(len(scenario["edges"]), "edge"))
    methods = run.methods
    of_method = frames.where(method=methods[0].name) if methods else frames
    if len(of_method):
        seconds = float(np.max(of_method.floats("stamp_ns"))) / NS_PER_S
        parts.append(f"{number_text(seconds)} s")
    under = f"each of {len(methods)} methods" if len(methods) > 1 else "one method"
    parts.append(f"{_count(len(of_method), 'frame')} under {under}")
    parts.append(seeds_text([of_seed.seed for of_seed in run.runs]))
    name = f"{run.label} ({run.name})" if run.label else run.name
    return f"{one_line(name)}: {', '.join(parts)}"


def _count(number: int, what: str) -> str:
    return f"{number:,} {what}{'s' * (number != 1)}"


def text(run: Run | SeedRuns, width: int = 80) -> str:
    """The main table, below its header; of several seeds with intervals.

    Lines have at most ``width`` characters, from 40 on; long labels and headings are wrapped, and
    methods that do not fit beside the others stand below them.
    """
    several = isinstance(run, SeedRuns)
    table = main_table(run)
    cells = [
        [value_text(metric, unit=False, interval=several) for metric in row.metrics]
        for row in table.rows
    ]
    lines = textwrap.wrap(header(run), width, subsequent_indent="  ")
    for columns in _blocks(table, cells, width):
        lines += ["", *_block(table, cells, columns, width)]
    lines.append("")
    notes = [about_seeds(run)] if isinstance(run, SeedRuns) else []
    for note in [*notes, *table.note.splitlines()]:
        lines += textwrap.wrap(note, width)
    return "\n".join(lines) + "\n"


def _blocks(table: MetricTable, cells: Sequence[Sequence[str]], width: int) -> list[list[int]]:
    """The columns that stand side by side, in as few blocks of about equal size as leave room for
    legible labels.
    """
    words = [heading.split() for heading in table.headings]
    widths = _widths(words, cells)
    longest = max((len(row.label) for row in table.rows), default=0)
    label_width = min(longest, max(LEGIBLE_LABEL_WIDTH, width // 4))
    places = list(range(len(widths)))
    for count in range(1, len(places) + 1):
        size = -(-len(places) // count)
        blocks = [places[start : start + size] for start in range(0, len(places), size)]
        needed = max(sum(GAP + widths[place] for place in block) for block in blocks)
        if label_width + needed <= width:
            return blocks
    return [[place] for place in places]


def _block(
    table: MetricTable, cells: Sequence[Sequence[str]], columns: Sequence[int], width: int
) -> list[str]:
    """The lines of some columns, of the rows in which any of them has a number."""
    rows = [
        (row.label, [texts[place] for place in columns])
        for row, texts in zip(table.rows, cells, strict=True)
        if any(row.metrics[place] is not None for place in columns)
    ]
    numbers = [texts for _, texts in rows]
    headings = [[table.headings[place]] for place in columns]
    widths = _widths(headings, numbers)
    label_width = max((len(label) for label, _ in rows), default=0)
    if label_width + sum(GAP + column for column in widths) > width:
        headings = [table.headings[place].split() for place in columns]
        widths = _widths(headings, numbers)
        room = width - sum(GAP + column for column in widths)
        label_width = min(label_width, max(room, MIN_LABEL_WIDTH))
    lines = []
    height = max(map(len, headings), default=0)
    for place in range(height):
        words = [[""] * (height - len(heading)) + heading for heading in headings]
        lines.append(_line("", label_width, [heading[place] for heading in words], widths))
    for label, texts in rows:
        *above, last = textwrap.wrap(label, label_width)
        lines += [*above, _line(last, label_width, texts, widths)]
    return lines


def _widths(headings: Sequence[Sequence[str]], cells: Sequence[Sequence[str]]) -> list[int]:
    """The width of each column in characters; a heading has one word or more a line."""
    widths = []
    for place, heading in enumerate(headings):
        widths.append(max(map(len, [*heading, *(row[place] for row in cells)])))
    return widths


def _line(label: str, label_width: int, cells: Sequence[str], widths: Sequence[int]) -> str:
    gap = " " * GAP
    numbers = "".join(f"{gap}{cell:>{width}}" for cell, width in zip(cells, widths, strict=True))
    return f"{label:<{label_width}}{numbers}".rstrip()
