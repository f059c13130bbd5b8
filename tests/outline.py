"""What a figure says, as text: its titles, units, labels, and from where to where its marks go.

    check("run", figures)

compares figures with the text in ``tests/outlines``, and ``check_lines`` what is text anyway, such
as tables. Where a figure is meant to say something else, delete its file and run the test: it is
written anew, and ``git diff`` tells what has changed. How a figure looks is left out.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import Collection, LineCollection, QuadMesh
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.text import Text

OUTLINES = Path(__file__).resolve().parent / "outlines"


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
    yield str(figure.get_label()).replace("\n", " / ")
    if figure.texts:
        yield f"texts {[text.get_text() for text in figure.texts]}"
    for legend in figure.legends:
        yield f"legend {[text.get_text() for text in legend.get_texts()]}"
    for axes in figure.axes:
        titles = [axes.get_title(loc=side) for side in ("left", "center", "right")]
        yield f"panel {' '.join(title for title in titles if title)!r}"
        yield f"  x {axes.get_xlabel()!r} {axes.get_xscale()} {_extent(axes.get_xlim())}"
        yield f"  y {axes.get_ylabel()!r} {axes.get_yscale()} {_extent(axes.get_ylim())}"
        legend = axes.get_legend()
        if legend is not None:
            yield f"  legend {[text.get_text() for text in legend.get_texts()]}"
        yield from _marks(axes)


def _marks(axes: Axes) -> Iterator[str]:
    """A line for each kind of mark and each label, with the extent of all its marks."""
    texts: list[str] = []
    points: defaultdict[str, list[np.ndarray]] = defaultdict(list)
    for child in axes.get_children():
        label = str(child.get_label())
        name = "" if label.startswith("_") else f" {label!r}"
        if child is axes.patch:
            continue
        if isinstance(child, Line2D):
            points[f"line{name}"].append(np.asarray(child.get_xydata(), dtype=float))
        elif isinstance(child, Rectangle):
            points[f"bar{name}"].append(child.get_bbox().get_points())
        elif isinstance(child, QuadMesh | AxesImage):
            values = np.ma.filled(np.ma.asarray(child.get_array(), dtype=float), np.nan)
            points[f"cells{name}"].append(np.ravel(values)[:, None])
        elif isinstance(child, LineCollection):
            points[f"segments{name}"] += [np.asarray(one) for one in child.get_segments()]
        elif isinstance(child, Collection):
            points[f"area{name}"] += [path.vertices for path in child.get_paths()]
        elif isinstance(child, Text) and child.get_text() and child not in _titles(axes):
            texts.append(child.get_text())
    for kind, parts in points.items():
        drawn = [part for part in parts if len(part)]
        ends = np.concatenate(drawn).T if drawn else []
        yield f"  {kind}: {len(parts)}, {' by '.join(map(_extent, ends)) or 'nothing'}"
    if texts:
        yield f"  texts {texts}"


def _titles(axes: Axes) -> tuple[Text, ...]:
    return axes.title, axes._left_title, axes._right_title


def _extent(values: Any) -> str:
    """The least and the largest of some numbers, in four digits."""
    numbers = np.asarray(values, dtype=float)
    numbers = numbers[np.isfinite(numbers)]
    if not len(numbers):
        return "nothing"
    return f"{numbers.min() + 0.0:.4g} to {numbers.max() + 0.0:.4g}"
