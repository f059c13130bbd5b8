"""How figures and pages look: sizes, text, and one palette for methods and placements.

A method's look is a number: its colour, dashes and marker. It goes by the method's name, so
that a method looks the same in every figure and on every page; methods of the user's own go by
their order. Cars and edges are never in a method's colour: they are grey, and differ in hatch or
dashes. Colours are told apart with any colour vision (the first eight after Okabe and Ito), and in
greyscale by dashes and markers.
"""

from collections.abc import Sequence
from itertools import chain, count
from typing import Any

from genie_sim.base.text import percent_text

# default width of a figure in a column and over a page
COLUMN_IN, PAGE_IN = 3.5, 7.16
TEX_POINT_IN = 1 / 72.27
# \columnwidth and \textwidth of IEEEtran, and what fits those of ACM's sigconf
WIDTHS = {
    "column": 252 * TEX_POINT_IN,
    "page": 516 * TEX_POINT_IN,
    "acm-column": 3.33,
    "acm-page": 7.0,
}
TEXT_POINTS, SMALL_POINTS = 8.0, 6.5
# height of a line of TEXT_POINTS, and about the width of a character
LINE_IN, CHARACTER_IN = 0.17, 0.058
TEXTS = (
    "font.size",
    "axes.titlesize",
    "axes.labelsize",
    "legend.fontsize",
    "xtick.labelsize",
    "ytick.labelsize",
    "figure.titlesize",
    "figure.labelsize",
)
SMALL: dict[str, Any] = dict.fromkeys(TEXTS, SMALL_POINTS)  # over RC
RC: dict[str, Any] = dict.fromkeys(TEXTS, TEXT_POINTS) | {
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
    "figure.autolayout": False,  # figures lay themselves out: drawing.py
    "figure.constrained_layout.use": False,
    "savefig.dpi": 200,
    "svg.fonttype": "none",  # text stays text
    "text.parse_math": False,  # also a user's, with dollar signs
    "pdf.fonttype": 42,  # fonts are inside, as TrueType
    "svg.hashsalt": "genie-sim",
}
TITLE_CHARACTERS = 24  # in a line beside or below an axis
RUN, SEEDS = "run", "seeds"  # pages
# The figures of a run or several seeds by the names of their files, and the pages that show them,
# in this order.
RUN_FIGURES: dict[str, tuple[str, ...]] = {
    "differences": (SEEDS,),
    "latency_accuracy": (SEEDS,),
    "latency_cdf": (RUN, SEEDS),
    "image_reuse": (RUN, SEEDS),
    "object_reuse": (RUN, SEEDS),
    "confidence_boost": (RUN, SEEDS),
    "resources": (RUN, SEEDS),
}
COLOURS = (
    "#E69F00",
    "#C44E00",
    "#0B3C6F",
    "#009E73",
    "#CC79A7",
    "#56B4E9",
    "#777777",
    "#000000",
    "#7B3FA0",
    "#8C5A2B",
    "#7FA600",
    "#E0245E",
)
# Of the methods that come with the program, and of their variants in its scenarios, which have the
# colour of the method that they vary.
METHOD_STYLES = {
    "local": 0,
    "remote": 1,
    "genie": 2,
    "genie_recommended": 3,
    "recommended": 3,
    "central": 6,
    "oracle": 7,
    "sim_lru": 8,
    "rnd_lru": 9,
    "potluck": 10,
    "foggycache": 11,
    "local_tracker": 12,
    "remote_tracker": 13,
    "remote_fours": 13,
    "genie_alone": 14,
    "recommended_fours": 15,
    "cachier": 16,
    "deadline": 17,
    "paced_remote": 18,
    "paced_tracker": 19,
}
FIRST_OWN_STYLES = (4, 5)  # then those after all of METHOD_STYLES
DOTTED, DASH_DOT, SOLID, DASHED = (0, (1, 1)), (0, (5, 1.2, 1, 1.2)), "-", (0, (4, 1.2))
DASHES = (DOTTED, DASH_DOT, SOLID, DASHED)
LINES = len(COLOURS) * len(DASHES)  # of methods that differ in colour or dashes
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
# What a response time goes into: its name, and a light tone of no method's (after Paul Tol).
PARTS = {
    "queueing": ("queueing", "#DDDDDD"),
    "pending": ("equal frame pending", "#FFFFFF"),
    "genie": ("Genie or cache", "#77AADD"),
    "hop": ("IPC", "#FFAABB"),
    "encoding": ("encoding", "#BBCC33"),
    "uplink": ("uplink", "#EEDD88"),
    "inference": ("inference", "#44BB99"),
    "edges": ("network of edges", "#99DDFF"),
    "downlink": ("downlink", "#EE8866"),
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


def method_styles(names: Sequence[str]) -> list[int]:
    """The style of each method, by its name; no two are the same.

    A name may begin with that of a scenario, as in ``wifi: genie``. A method that comes again,
    under another scenario, keeps its colour as long as there are dashes left for it.
    """
    styles: list[int] = []
    for name in names:
        style = METHOD_STYLES.get(name.rpartition(": ")[2])
        same_colour = () if style is None else range(style, LINES, len(COLOURS))
        of_own = chain(FIRST_OWN_STYLES, count(max(METHOD_STYLES.values()) + 1))
        styles.append(next(style for style in chain(same_colour, of_own) if style not in styles))
    return styles


def method_line(style: int) -> dict[str, Any]:
    """Colour, dashes and width of a method's line; no two of the first ``LINES`` are the same."""
    dashes = DASHES[(style + style // len(COLOURS)) % len(DASHES)]
    return {"color": method_colour(style), "linestyle": dashes, "linewidth": 1.7}


def method_colour(style: int) -> str:
    return COLOURS[style % len(COLOURS)]


def method_marker(style: int) -> str:
    """The marker of a method's points; with its colour, no two of the first 96 are the same."""
    return MARKERS[(style + style // len(COLOURS)) % len(MARKERS)]


def percent_tick(share: float, _place: object) -> str:
    return percent_text(share, digits=4)
