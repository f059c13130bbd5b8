"""How figures and pages look: sizes, text, and one palette for methods, placements and resources.

A method's colour, line and hatch go by its position among the methods that ran, a resource's by its position among
those in a panel. Cars and edges are never in a method's colour: they are grey, and differ in hatch or dashes. Colours
are told apart with any colour vision (after Okabe and Ito), and in greyscale by their dashes and hatches.
"""

import re
from typing import Any

import numpy as np

COLUMN_IN, PAGE_IN = (
    3.5,
    7.16,
)  # width of a column and of a page of IEEE's and ACM's journals and proceedings
WIDTHS = {"column": COLUMN_IN, "page": PAGE_IN}
LINE_IN, CHARACTER_IN = (
    0.17,
    0.058,
)  # height of a line of 8 points, and about the width of a character
RC: dict[str, Any] = {
    "font.size": 8,
    "axes.titlesize": 8,
    "axes.labelsize": 8,
    "legend.fontsize": 8,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "figure.titlesize": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "0.88",
    "grid.linewidth": 0.6,
    "hatch.linewidth": 0.6,
    "legend.frameon": False,
    "legend.handlelength": 2.2,
    "legend.columnspacing": 1.0,
    "savefig.dpi": 200,
    "svg.fonttype": "none",  # text stays text
    "pdf.fonttype": 42,  # fonts are inside, as TrueType
    "svg.hashsalt": "genie-sim",
}
COLOURS = ("#E69F00", "#C44E00", "#0B3C6F", "#009E73", "#CC79A7", "#56B4E9", "#777777", "#000000")
HOSTS = (
    "#332288",
    "#88CCEE",
    "#44AA99",
    "#117733",
    "#999933",
    "#DDCC77",
    "#CC6677",
    "#882255",
)  # no method's (Tol)
DARK_HOSTS = (
    "#9C90F0",
    "#88CCEE",
    "#44AA99",
    "#4FBF74",
    "#BBBB55",
    "#DDCC77",
    "#E08895",
    "#D873A4",
)
DARK_COLOURS = (
    "#F0B13C",
    "#FF8A4C",
    "#79B8FF",
    "#35C498",
    "#F08FC4",
    "#5AC8FA",
    "#A0A0A0",
    "#E8E8E8",
)  # dark pages
DOTTED, DASH_DOT, SOLID, DASHED = (0, (1, 1)), (0, (5, 1.2, 1, 1.2)), "-", (0, (4, 1.2))
DASHES = (DOTTED, DASH_DOT, SOLID, DASHED)
HATCHES = ("////", "....", "", "xxxx", "\\\\\\\\", "++++", "oooo", "----")
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
# What a response time goes into: its name, and a light tone and a hatch of no method's (after Paul Tol).
PARTS: dict[str, tuple[str, dict[str, Any]]] = {
    "queueing": ("queueing", {"facecolor": "#DDDDDD", "hatch": "...."}),
    "pending": ("equal frame pending", {"facecolor": "#FFFFFF", "hatch": "xxxx"}),
    "genie": ("Genie or cache", {"facecolor": "#77AADD", "hatch": "oooo"}),
    "hop": ("hops", {"facecolor": "#FFAABB", "hatch": "||||"}),
    "encoding": ("encoding", {"facecolor": "#BBCC33", "hatch": "++++"}),
    "uplink": ("uplink", {"facecolor": "#EEDD88", "hatch": "////"}),
    "inference": ("inference", {"facecolor": "#44BB99", "hatch": ""}),
    "edges": ("network of edges", {"facecolor": "#99DDFF", "hatch": "----"}),
    "downlink": ("downlink", {"facecolor": "#EE8866", "hatch": "\\\\\\\\"}),
}
PLACEMENTS = {"car": "on cars", "edge": "on edges"}
PLACEMENT_LINES: dict[str, dict[str, Any]] = {  # about the Genies there
    "car": {"color": "0.55", "linestyle": DASHED, "linewidth": 1.6},
    "edge": {"color": "0.15", "linestyle": SOLID, "linewidth": 1.6},
}
PLACEMENT_BARS = {
    "car": {"facecolor": "0.85", "hatch": "////"},
    "edge": {"facecolor": "0.45", "hatch": ""},
}


def method_line(position: int) -> dict[str, Any]:
    """Colour, dashes and width of a method's line; no two of the first 32 are the same."""
    dashes = DASHES[(position + position // len(COLOURS)) % len(DASHES)]
    return {"color": COLOURS[position % len(COLOURS)], "linestyle": dashes, "linewidth": 1.7}


def method_marker(position: int) -> str:
    """The marker of a method's points; with its colour, no two of the first 64 are the same."""
    return MARKERS[(position + position // len(COLOURS)) % len(MARKERS)]


def method_bar(position: int) -> dict[str, Any]:
    """Colour and hatch of a method's bar."""
    hatch = HATCHES[(position + position // len(COLOURS)) % len(HATCHES)]
    return {"facecolor": COLOURS[position % len(COLOURS)], "hatch": hatch}


def thinned(n: int, most: int = 1000) -> np.ndarray[Any, np.dtype[np.int64]]:
    """At most ``most`` places of n, evenly spread, both ends among them: enough to draw a curve through."""
    return np.unique(np.linspace(0, n - 1, min(n, most)).astype(np.int64)) if n else np.arange(0)


def by_number(name: str) -> list[tuple[int, str]]:
    """A key to sort names by: ``car2`` comes before ``car10``."""
    return [(int(part or 0), text) for text, part in re.findall(r"(\D*)(\d*)", name)]


def percent_tick(share: float, _place: object) -> str:
    return f"{100 * share:.4g} %"
