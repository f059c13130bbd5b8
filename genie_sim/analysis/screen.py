"""The results of a run on a terminal: a line that says what was run, and a table that fits."""

import textwrap
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from genie_sim.analysis import renderers
from genie_sim.analysis.seed_runs import SeedRuns, seeds_text
from genie_sim.analysis.summary import about_seeds, printed_table
from genie_sim.base.text import number_text, one_line
from genie_sim.base.units import NS_PER_S
from genie_sim.record.columns import Columns
from genie_sim.record.results import Run


def header(run: Run | SeedRuns) -> str:
    """What was run: ``town: 3 cars, 3 edges, 15.8 s simulated, 462 frames under each of 3 methods,
    seed 1``. Frames are those of one seed; where methods have other
    cars, from the fewest to the most.
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
    of_methods = [frames.where(method=method.name) for method in methods] or [frames]
    simulated = [rows for rows in of_methods if len(rows)] or of_methods[:1]
    fewest, most = min(map(len, simulated)), max(map(len, simulated))
    if most:
        parts.append(f"{number_text(max(map(simulated_s, simulated)))} s simulated")
    under = f"each of {len(methods)} methods" if len(methods) > 1 else "one method"
    some = "" if fewest == most else f"{fewest:,} to "
    parts.append(f"{some}{_count(most, 'frame')} under {under}")
    parts += filter(None, [run.runs[0].warm_up])
    parts.append(seeds_text([of_seed.seed for of_seed in run.runs]))
    name = f"{run.label} ({run.name})" if run.label else run.name
    return f"{one_line(name)}: {', '.join(parts)}"


def simulated_s(frames: Columns) -> float:
    """Until when cars take frames [s]; afterwards a run only waits for answers."""
    return float(np.max(frames["stamp_ns"], initial=0)) / NS_PER_S


def _count(number: int, what: str) -> str:
    return f"{number:,} {what}{'s' * (number != 1)}"


def text(run: Run | SeedRuns, width: int = 80, metrics: Sequence[str] | None = None) -> str:
    """The main table below its header, in at most twelve rows, or the rows of these metrics (none:
    all rows); of several seeds with intervals. Lines have at most ``width`` characters, from 40 on.
    Raises ``UserError`` for a metric that is not known.
    """
    table = printed_table(run, metrics)
    if isinstance(run, SeedRuns):
        table = replace(table, notes=[about_seeds(run), *table.notes])
    lines = textwrap.wrap(header(run), width, subsequent_indent="  ")
    shown = renderers.terminal(table, width, intervals=isinstance(run, SeedRuns))
    return "\n".join([*lines, "", shown])
