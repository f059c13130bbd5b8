"""What a figure shows, as text: every mark with its place and look.

    check("run", figures)

compares figures with the text in ``tests/outlines``, and ``check_lines`` what is text anyway, such
as tables. Where a figure is meant to look otherwise,
delete its file and run the test: it is written anew, and ``git diff`` tells what has changed.
Positions that only a renderer knows are left out, and so are ticks that matplotlib chooses, so that
its versions agree.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.collections import Collection, LineCollection, QuadMesh
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.text import Annotation, Text
from matplotlib.ticker import FixedFormatter, FixedLocator

OUTLINES = Path(__file__).resolve().parent / "outlines"
MAX_LISTED = 8  # of more numbers, the first ones, the middle, the last and the sum


def check(name: str, figures: Mapping[str, Figure]) -> None:
    """Raises AssertionError where a figure is not as its outline says."""
    check_lines(name, [line for key in figures for line in (f"== {key}", *outline(figures[key]))])


def check_lines(name: str, lines: list[str]) -> None:
    """The same for lines of text."""
    path = OUTLINES / f"{name}.txt"
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        raise AssertionError(f"{path} is new: look at it")
    assert lines == path.read_text(encoding="utf-8").splitlines()


def outline(figure: Figure) -> Iterator[str]:
    """The lines of one figure."""
    engine = figure.get_layout_engine()
    rect = engine.get().get("rect") if engine is not None else None
    yield f"figure {_numbers(figure.get_size_inches())} {figure.get_label()!r} within {_all(rect)}"
    for text in figure.texts:
        yield _text(text)
    for legend in figure.legends:
        labels = [text.get_text() for text in legend.get_texts()]
        frame = " framed" * legend.get_frame_on()
        yield f"legend {labels} columns={legend._ncols} place={legend._loc}{frame}"
    for axis in figure.axes:
        titles = [axis.get_title(loc=side) for side in ("left", "center", "right")]
        yield f"panel {titles} x={axis.get_xlabel()!r} y={axis.get_ylabel()!r}"
        for side in (axis.xaxis, axis.yaxis):
            low, high = side.get_view_interval()
            ticks = ""
            if isinstance(side.get_major_locator(), FixedLocator):
                ticks = f" ticks {_numbers(side.get_major_locator()())}"
            if isinstance(side.get_major_formatter(), FixedFormatter):
                ticks += f" {[label.get_text() for label in side.get_ticklabels()]}"
            yield f"  {side.axis_name} {side.get_scale()} {_numbers((low, high))}{ticks}"
        legend = axis.get_legend()
        if legend is not None:
            yield f"  legend {[text.get_text() for text in legend.get_texts()]}"
        for child in axis.get_children():
            yield from (f"  {line}" for line in _mark(child) if child is not axis.patch)


def _mark(child: Any) -> Iterator[str]:
    """A line for what is drawn in a panel; none for its frame and its ticks."""
    label = str(child.get_label())
    name = "" if label.startswith("_") else f" {label!r}"
    if isinstance(child, Line2D):
        look = [child.get_linestyle(), child.get_linewidth(), child.get_marker()]
        look += [child.get_markersize(), child.get_markevery(), child.get_drawstyle()]
        look += [_colour(child.get_markerfacecolor()), child.get_alpha(), child.get_zorder()]
        yield f"line{name} {_colour(child.get_color())} {look}"
        yield f"  x {_numbers(child.get_xdata())}"
        yield f"  y {_numbers(child.get_ydata())}"
    elif isinstance(child, Rectangle):
        look = [_colour(child.get_facecolor()), _colour(child.get_edgecolor())]
        look += [child.get_hatch(), child.get_linewidth(), child.get_alpha()]
        box = (*child.get_xy(), child.get_width(), child.get_height())
        yield f"bar{name} {_numbers(box)} {look}"
    elif isinstance(child, LineCollection):
        ends = [_numbers(np.ravel(segment)) for segment in child.get_segments()]
        yield f"segments{name} {[_colour(one) for one in child.get_colors()]} {ends}"
    elif isinstance(child, QuadMesh | AxesImage):
        yield f"cells{name} {_numbers(np.ma.filled(child.get_array(), np.nan))}"
    elif isinstance(child, Collection):
        faces = [_colour(one) for one in np.atleast_2d(child.get_facecolor())]
        corners = [path.vertices for path in child.get_paths()]
        yield f"area{name} {faces} {child.get_alpha()} {[_numbers(one) for one in corners]}"
    elif isinstance(child, Text) and child.get_text() and child not in _titles(child):
        yield _text(child)


def _titles(text: Text) -> list[Text]:
    axes = text.axes
    return [] if axes is None else [axes.title, axes._left_title, axes._right_title]


def _text(text: Text) -> str:
    place = text.xyann if isinstance(text, Annotation) else text.get_position()
    at = f" of {_numbers(text.xy)}" if isinstance(text, Annotation) else ""
    look = [text.get_ha(), text.get_va(), text.get_fontsize(), _colour(text.get_color())]
    return f"text {text.get_text()!r} {_numbers(place)}{at} {look}"


def _colour(colour: Any) -> str:
    return str(colour) if isinstance(colour, str) and colour == "none" else to_hex(colour, True)


def _all(values: Any) -> str:
    return "all" if values is None else _numbers(values)


def _numbers(values: Any) -> str:
    """Four digits of each; of many, some of them and their sum."""
    try:
        numbers = np.ravel(np.asarray(values, dtype=float))
    except (TypeError, ValueError):
        return str([str(value) for value in values])
    if len(numbers) > MAX_LISTED:
        middle = numbers[len(numbers) // 2]
        some = [*numbers[:3], middle, *numbers[-2:], np.nansum(numbers)]
        return f"{len(numbers)}: {' '.join(f'{value + 0.0:.4g}' for value in some)}"
    return " ".join(f"{value + 0.0:.4g}" for value in numbers)
