"""What became of paced looks, how old the newest look of a view is, and what edges told."""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from genie_sim.analysis.correctness import CORRECTNESS
from genie_sim.analysis.frame_metrics import FRAMES
from genie_sim.analysis.metric import (
    HIGHER,
    LOWER,
    REST,
    Metric,
    Seen,
    Tables,
    average,
    quotient,
    times,
)
from genie_sim.analysis.statistics import Measured
from genie_sim.base.units import NS_PER_MS
from genie_sim.record.columns import Columns, Floats
from genie_sim.record.records import CONSUMER


class Looks(NamedTuple):
    """The looks of a method that paces them, and how many frames were published."""

    events: Columns
    published: int

    def number(self, way: str, outcome: str) -> int:
        """How many frames were looked at this way, and ended so."""
        return len(self.events.where(way=way, outcome=outcome))


def views(tables: Tables) -> Iterator[Seen]:
    """The looks of a method that paces them, and the frames that were answered from its map."""
    if "looks" in tables:
        looks = tables["looks"]
        yield Seen("looks", Looks(looks, len(tables.get("frames", ()))))
        yield Seen("map", looks.where(way="map"))
        if "held" in tables:
            yield Seen("held where looks are paced", tables["held"].where(what=CONSUMER))


def _of_sums(title: str, better: str, meaning: str, above: str, below: str) -> Metric:
    """A share of what consumers hold."""
    return Metric(
        title,
        "%",
        better,
        CORRECTNESS,
        meaning=meaning,
        formula=lambda held: quotient(int(held[above].sum()), int(held[below].sum())),
        rows="held where looks are paced",
    )


def _gap(looks: Looks) -> Measured:
    gaps_ms = looks.events.where(way="edge").floats("gap_ns") / NS_PER_MS
    return average(gaps_ms[~np.isnan(gaps_ms)])


def _round_trip(looks: Looks) -> Measured:
    events = looks.events.where(way="edge")
    events = events.rows(events["outcome"].isin(("sent", "answered", "stale")))
    # Of a frame that was answered, both events stand side by side, the earlier one first.
    order = (events["t_ns"], events["stamp_ns"], events["stream"].codes, events["car"].codes)
    events = events.rows(np.lexsort(order))
    answered = np.flatnonzero(events["outcome"] != "sent")
    times_ns = events["t_ns"]
    return average((times_ns[answered] - times_ns[answered - 1]) / NS_PER_MS)


def _view_age_ms(frames: Columns) -> Floats:
    age_ms: Floats = (frames["stamp_ns"] - frames.floats("looked_ns")) / NS_PER_MS
    return age_ms


def _of_looks(
    title: str, unit: str, meaning: str, formula: Callable[[Looks], Measured], **words: Any
) -> Metric:
    return Metric(
        title, unit, section=FRAMES, meaning=meaning, formula=formula, rows="looks", **words
    )


METRICS = {
    "looks_own_share": _of_looks(
        "looks by the car's detector",
        "%",
        "Share of the published frames that the car's own detector looked at, where looks are "
        "paced.",
        lambda looks: quotient(looks.number("own", "answered"), looks.published),
    ),
    "looks_sent_share": _of_looks(
        "looks sent up",
        "%",
        "Share of the published frames that went up to be looked at by the edge.",
        lambda looks: quotient(looks.number("edge", "sent"), looks.published),
    ),
    "look_gap_mean": _of_looks(
        "gap between looks, mean",
        "ms",
        "Mean time between the frames of a view that went up one after the other.",
        _gap,
    ),
    "looks_answered_share": _of_looks(
        "looks answered",
        "%",
        "Share of the frames sent up that were answered in time.",
        lambda looks: quotient(looks.number("edge", "answered"), looks.number("edge", "sent")),
        better=HIGHER,
    ),
    "look_round_trip_mean": _of_looks(
        "round trip of a look, mean",
        "ms",
        "Mean time from when a frame went up until its answer came, of those that got one before "
        "they were given up.",
        _round_trip,
        better=LOWER,
    ),
    **{
        f"view_age_{statistic}": metric
        for statistic, metric in times(
            "age of view",
            "from the newest frame of a frame's view that a detector had looked at when this one "
            "came to this one, where looks are paced.",
            _view_age_ms,
            {"mean": REST},
            section=FRAMES,
            rows="map",
        )
    },
    "shared_share": _of_sums(
        "objects that another car saw",
        "",
        "Share of the held objects that another car saw last, where looks are paced.",
        "shared",
        "held",
    ),
    "shared_right_share": _of_sums(
        "right among objects that another car saw",
        HIGHER,
        "Share of the held objects that another car saw last which are in view at that instant.",
        "shared_right",
        "shared",
    ),
}
