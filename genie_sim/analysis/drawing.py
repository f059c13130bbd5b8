"""What all figures share: their style and legend."""

from collections.abc import Iterable, Sequence
from functools import partial
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.style import context
from matplotlib.ticker import FixedLocator, NullLocator, StrMethodFormatter

from genie_sim.analysis import style
from genie_sim.analysis.style import CHARACTER_IN, LINE_IN

# Within it, and in a function that it decorates, matplotlib draws in this style, whatever the user's is.
in_style = partial(context, ["default", style.RC])


def finish(
    figure: Figure, title: str, footer: str, axes: Iterable[Axes] = (), note: str = ""
) -> None:
    """The common legend of the panels, below them, for which the figure grows, and above them a ``note`` of what they
    do not show. The title, and which run it is, stand in the file alone: on paper there is a caption."""
    if note:
        figure.suptitle(note, x=0.01, ha="left")
    figure.set_label(f"{title}\n{footer}")
    width_in, height_in = figure.get_size_inches()
    below, named = 0.0, handles(axes)
    if named:
        columns = _columns(list(named), width_in)
        figure.legend(list(named.values()), list(named), loc="lower center", ncols=columns)
        legend_in = (-(-len(named) // columns) + 0.4) * LINE_IN
        figure.set_figheight(height_in + legend_in)
        below = legend_in / (height_in + legend_in)
    figure.set_layout_engine("constrained", rect=(0.0, below, 1.0, 1.0 - below))


def _columns(labels: Sequence[str], width_in: float) -> int:
    """As many columns of a legend as fit the figure."""
    room = int((width_in - 0.1) / (max(map(len, labels)) * CHARACTER_IN + 0.4))
    rows = -(-len(labels) // max(min(len(labels), room), 1))
    return -(-len(labels) // rows)


def handles(axes: Iterable[Axes]) -> dict[str, Any]:
    """What stands in the legends of these panels, each label once."""
    return {
        label: handle
        for axis in axes
        for handle, label in zip(*axis.get_legend_handles_labels(), strict=True)
    }


def logarithmic_ms(axis: Axes, low: float, high: float) -> None:
    """A logarithmic axis of milliseconds, with ticks at 1, 2 and 5 times each power of ten, written out."""
    ticks = [digit * 10.0**power for power in range(-1, 7) for digit in (1, 2, 5)]
    axis.set_xscale("log")
    axis.set_xlim(low, high)
    axis.xaxis.set_major_locator(FixedLocator([tick for tick in ticks if low <= tick <= high]))
    axis.xaxis.set_minor_locator(NullLocator())
    axis.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
