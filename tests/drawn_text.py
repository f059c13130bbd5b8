"""What is wrong with the text of a figure: too small, off the canvas, or on other text."""

from __future__ import annotations

import itertools
from unittest import mock

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

MIN_POINTS = 6


def faults(figure: Figure) -> list[str]:
    """One sentence for each fault of the text that is drawn."""
    drawn: dict[Text, None] = {}
    draw = Text.draw

    def noted(text: Text, renderer: object) -> None:
        if text.get_visible() and text.get_text().strip():
            drawn[text] = None
        draw(text, renderer)

    canvas = FigureCanvasAgg(figure)
    with mock.patch.object(Text, "draw", noted):
        canvas.draw()
    found, inside = [], figure.bbox.padded(1)
    boxes = {text: text.get_window_extent(canvas.get_renderer()) for text in drawn}
    for text, box in boxes.items():
        if text.get_fontsize() < MIN_POINTS:
            found.append(f"{text.get_text()!r} has {text.get_fontsize()} points")
        if not (inside.contains(box.x0, box.y0) and inside.contains(box.x1, box.y1)):
            found.append(f"{text.get_text()!r} leaves the canvas")
    for (one, box), (other, beside) in itertools.combinations(boxes.items(), 2):
        if box.padded(-1).overlaps(beside.padded(-1)):
            found.append(f"{one.get_text()!r} lies on {other.get_text()!r}")
    return found
