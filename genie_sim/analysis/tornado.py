"""One figure: how much the energy per frame depends on each power."""

from collections.abc import Mapping, Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from genie_sim.analysis import prices, style
from genie_sim.analysis.drawing import finish, in_style
from genie_sim.recording.columns import Columns
from genie_sim.recording.results import MethodInfo

MAX_BARS = 5  # of a method
PARTS = {
    "idle": "idle",
    "accelerator": "accelerator",
    "core": "a core",
    "port": "port",
    "transfer": "transfer",
    "up": "per Mbit up",
    "down": "per Mbit down",
    "tail": "tail",
}


@in_style()
def tornado(
    runs: Sequence[Mapping[str, Columns]],
    methods: Sequence[MethodInfo],
    footer: str = "",
    width_in: float | None = None,
) -> Figure:
    """For each method, the energy per frame with one power after the other at the lower and at the
    upper end of its range, the others as they are, mean over ``runs``; the widest bars first.
    """
    of_methods = {
        method.title: prices.swings(of_method)
        for method in methods
        if not (of_method := prices.per_frame(runs, method.name)).unknown
    }
    rows = [max(min(len(swings), MAX_BARS), 1) for swings in of_methods.values()]
    figure = Figure(figsize=(width_in or style.PAGE_IN, 0.45 * len(rows) + 0.2 * sum(rows)))
    axes = list(figure.subplots(len(rows), sharex=True, squeeze=False, height_ratios=rows).flat)
    for axis, (title, swings) in zip(axes, of_methods.items(), strict=True):
        _draw(axis, title, swings[:MAX_BARS])
    axes[-1].set_xlabel("energy per frame [J]")
    finish(figure, "How much the energy per frame depends on each power", footer, axes)
    return figure


def _draw(axis: Axes, title: str, swings: Sequence[prices.Swing]) -> None:
    """Bars to either side of the energy with all powers as they are."""
    for place, swing in enumerate(swings):
        for end, label, colour in (
            (swing.low, "low end of the range", "0.75"),
            (swing.high, "high end of the range", "0.4"),
        ):
            axis.barh(place, end - swing.value, 0.68, swing.value, label=label, color=colour)
    if swings:
        axis.axvline(swings[0].value, color="black", linewidth=0.8)
    names = [f"{swing.key[1]}, {PARTS[swing.key[2]]}" for swing in swings]
    axis.set_yticks(range(len(swings)), names)
    axis.invert_yaxis()
    axis.set_title(title, loc="left")
    axis.grid(axis="y", visible=False)
