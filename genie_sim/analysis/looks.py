"""What became of paced looks, how old the newest look of a view is, and what edges told."""

from collections.abc import Mapping
from functools import cached_property

import numpy as np

from genie_sim.analysis.correctness import CORRECTNESS
from genie_sim.analysis.frame_metrics import FRAMES, STATISTICS, statistic_of
from genie_sim.analysis.metric import (
    HIGHER,
    LOWER,
    Metric,
    Views,
    Where,
    average,
    quotient,
)
from genie_sim.analysis.statistics import Blocks, Measured
from genie_sim.base.units import NS_PER_MS
from genie_sim.record.columns import Columns, Floats
from genie_sim.record.records import CONSUMER
from genie_sim.record.results import MethodInfo

ENDS = ("answered", "stale", "overtaken", "timed_out")  # of a frame that went up


class Looks:
    """The looks of a method that paces them, how many frames were published, and what its
    consumers hold, if that is known.
    """

    def __init__(
        self, events: Columns, published: int, held: Columns | None, intervals: bool
    ) -> None:
        self.events, self.published, self.held = events, published, held
        self.way_up = events.where(way="edge")
        self._intervals = intervals

    def sent_up(self, outcome: str) -> int:
        """How many frames went up and ended so."""
        return len(self.way_up.where(outcome=outcome))

    @cached_property
    def answered(self) -> Columns:
        """The frames that were answered from the map."""
        return self.events.where(way="map")

    @cached_property
    def blocks(self) -> Blocks:
        """These frames by car and second."""
        return Blocks(self.answered["car"], self.answered["stamp_ns"], self._intervals)


def views(
    tables: Mapping[str, Columns], methods: Mapping[str, MethodInfo], intervals: bool
) -> Views:
    """Each method that paces its looks."""
    if "looks" not in tables:
        return
    for method in methods:
        events = tables["looks"].where(method=method)
        if len(events):
            published = len(tables["frames"].where(method=method))
            held = None
            if "held" in tables:
                held = tables["held"].where(method=method, what=CONSUMER)
            yield Where(method), Looks(events, published, held, intervals)


class CarLooks(Metric):
    """Share of the published frames that the car's own detector looked at, where looks are
    paced.
    """

    title = "looks by the car's detector"
    section = FRAMES
    view = Looks
    reads = "looks: way, outcome"

    def of(self, view: Looks) -> Measured:
        own = len(view.events.where(way="own", outcome="answered"))
        return quotient(own, view.published, view.published)


class LooksSent(Metric):
    """Share of the published frames that went up to be looked at by the edge."""

    title = "looks sent up"
    section = FRAMES
    view = Looks
    reads = "looks: way, outcome"

    def of(self, view: Looks) -> Measured:
        return quotient(view.sent_up("sent"), view.published, view.published)


class LookGap(Metric):
    """Mean time between the frames of a view that went up one after the other."""

    title = "gap between looks, mean"
    unit = "ms"
    section = FRAMES
    view = Looks
    reads = "looks: way, gap_ns"

    def of(self, view: Looks) -> Measured:
        gaps_ms = view.way_up.floats("gap_ns") / NS_PER_MS
        return average(gaps_ms[~np.isnan(gaps_ms)])


class LooksAnswered(Metric):
    """Share of the frames sent up that were answered in time."""

    title = "looks answered"
    better = HIGHER
    section = FRAMES
    view = Looks
    reads = "looks: way, outcome"
    end = "answered"

    def of(self, view: Looks) -> Measured:
        sent = view.sent_up("sent")
        return quotient(view.sent_up(self.end), sent, sent)


class LooksStale(LooksAnswered):
    """Share of the frames sent up whose answer came too late to count."""

    title = "looks answered too late"
    better = LOWER
    end = "stale"


class LooksOvertaken(LooksAnswered):
    """Share of the frames sent up that were lost: a later one was answered first."""

    title = "looks lost, overtaken"
    better = LOWER
    end = "overtaken"


class LooksTimedOut(LooksAnswered):
    """Share of the frames sent up that were given up: no answer came in time."""

    title = "looks lost, timed out"
    better = LOWER
    end = "timed_out"


class LooksInFlight(LooksAnswered):
    """Share of the frames sent up that were neither answered nor given up when the run ended."""

    title = "looks in flight"
    better = ""

    def of(self, view: Looks) -> Measured:
        sent = view.sent_up("sent")
        return quotient(sent - sum(map(view.sent_up, ENDS)), sent, sent)


class LookRoundTrip(Metric):
    """Mean time from when a frame went up until its answer came, of those that got one before they
    were given up.
    """

    title = "round trip of a look, mean"
    unit = "ms"
    better = LOWER
    section = FRAMES
    view = Looks
    reads = "looks: way, outcome, t_ns, stamp_ns, stream, car"

    def of(self, view: Looks) -> Measured:
        return average(_round_trips_ms(view.way_up))


def _round_trips_ms(events: Columns) -> Floats:
    """From when a frame went up until its answer came, of those answered in time or stale."""
    ended = events["outcome"].isin(("answered", "stale"))
    chosen = events.rows(ended | (events["outcome"] == "sent"))
    # Of a frame that was answered, both events stand side by side, the earlier one first.
    order = np.lexsort(
        (chosen["t_ns"], chosen["stamp_ns"], chosen["stream"].codes, chosen["car"].codes)
    )
    chosen = chosen.rows(order)
    answered = np.flatnonzero(chosen["outcome"] != "sent")
    times_ns = chosen["t_ns"]
    return np.asarray((times_ns[answered] - times_ns[answered - 1]) / NS_PER_MS)


class ViewAge(Metric):
    """How old the newest look of a view is."""

    unit = "ms"
    better = LOWER
    view = Looks
    reads = "looks: way, car, stamp_ns, looked_ns"

    def __init__(self, statistic: str, section: str = FRAMES) -> None:
        self._statistic = statistic
        name, words = STATISTICS[statistic]
        self.title = f"age of view, {name}"
        self.meaning = (
            f"{words} from the newest frame of a frame's view that a detector had looked at when "
            "this one came to this one, where looks are paced."
        )
        self.section = section

    def of(self, view: Looks) -> Measured:
        age_ns = view.answered["stamp_ns"] - view.answered.floats("looked_ns")
        return statistic_of(self._statistic, view.blocks, age_ns / NS_PER_MS)


class Shared(Metric):
    """Share of the held objects that another car saw last, where looks are paced."""

    title = "objects that another car saw"
    section = CORRECTNESS
    view = Looks
    reads = "held: held, shared"

    def of(self, view: Looks) -> Measured | None:
        if view.held is None:
            return None
        total = int(view.held["held"].sum())
        return quotient(int(view.held["shared"].sum()), total, total)


class SharedRight(Metric):
    """Share of the held objects that another car saw last which are in view at that instant."""

    title = "right among objects that another car saw"
    better = HIGHER
    section = CORRECTNESS
    view = Looks
    reads = "held: shared, shared_right"

    def of(self, view: Looks) -> Measured | None:
        if view.held is None:
            return None
        shared = int(view.held["shared"].sum())
        return quotient(int(view.held["shared_right"].sum()), shared, shared)


METRICS = {
    "looks_own_share": CarLooks(),
    "looks_sent_share": LooksSent(),
    "look_gap_mean": LookGap(),
    "looks_answered_share": LooksAnswered(),
    "looks_stale_share": LooksStale(),
    "looks_overtaken_share": LooksOvertaken(),
    "looks_timed_out_share": LooksTimedOut(),
    "looks_in_flight_share": LooksInFlight(),
    "look_round_trip_mean": LookRoundTrip(),
    "view_age_mean": ViewAge("mean"),
    "view_age_p50": ViewAge("p50", section=""),
    "view_age_p95": ViewAge("p95"),
    "view_age_p99": ViewAge("p99", section=""),
    "shared_share": Shared(),
    "shared_right_share": SharedRight(),
}
