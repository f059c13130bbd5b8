"""What all figures share: their style, title, legend and footer."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.style import context

from genie_sim.analysis import style
from genie_sim.analysis.style import COLUMN_IN, LINE_IN


@contextmanager
def in_style() -> Iterator[None]:
    """Within it, and in a function that it decorates, matplotlib draws in this style, whatever the user's is."""
    with context(["default", style.RC]):
        yield


def finish(figure: Figure, title: str, footer: str, axes: Iterable[Axes] = ()) -> None:
    """What is shown, above; below the panels their common legend, and which run it is."""
    width_in, height_in = figure.get_size_inches()
    figure.suptitle(textwrap.fill(title, int(width_in * 14)), x=0.01, ha="left")
    lines = textwrap.wrap(footer, int(width_in * 15))
    figure.text(0.01, 0.01, "\n".join(lines), ha="left", va="bottom", color="0.35")
    below = len(lines) * LINE_IN / height_in
    named = handles(axes)
    if named:
        columns = 2 if width_in <= COLUMN_IN else len(named)
        figure.legend(list(named.values()), list(named), loc="lower center", bbox_to_anchor=(0.5, below), ncols=columns)
        below += (-(-len(named) // columns) + 0.6) * LINE_IN / height_in
    figure.set_layout_engine("constrained", rect=(0.0, below, 1.0, 1.0 - below))


def handles(axes: Iterable[Axes]) -> dict[str, Any]:
    """What stands in the legends of these panels, each label once."""
    return {label: handle for axis in axes for handle, label in zip(*axis.get_legend_handles_labels(), strict=True)}
