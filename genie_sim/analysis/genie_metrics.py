"""Metrics of Genies: reuse, confidence boosts, and how much their caches and maps hold."""

from collections.abc import Callable, Mapping
from itertools import product
from operator import attrgetter
from typing import TYPE_CHECKING, Any

import numpy as np

from genie_sim.analysis.metric import (
    HIGHER,
    WINDOW_REQUESTS,
    WINDOWS,
    Metric,
    Views,
    Where,
    average,
    quotient,
)
from genie_sim.analysis.statistics import Blocks, Measured, around
from genie_sim.record.columns import Columns, Text
from genie_sim.record.results import MethodInfo

if TYPE_CHECKING:
    Ints = np.ndarray[Any, Any]

PLACEMENTS = ("car", "edge")  # of Genies
GENIES = "Genies"


class Lookups:
    """What the Genies that a method runs on cars or on edges were asked."""

    def __init__(self, rows: Columns, intervals: bool) -> None:
        is_image = rows["kind"] == "image"
        self.images, self.objects = rows.rows(is_image), rows.rows(~is_image)
        self.of_clients = self.images.where(requester="client")
        self.intervals = intervals


def views(
    tables: Mapping[str, Columns], methods: Mapping[str, MethodInfo], intervals: bool
) -> Views:
    """The look-ups of each method's Genies on cars, and on edges."""
    if "lookups" not in tables:
        return
    for method, placement in product(methods, PLACEMENTS):
        rows = tables["lookups"].where(method=method, placement=placement)
        if len(rows):
            yield Where(method, placement), Lookups(rows, intervals)


def reuse(lookups: Columns) -> dict[str, float]:
    """hits / requests of each Genie; a coalesced request is not a hit. Genies that were asked
    nothing are left out.
    """
    genies: Text = lookups["genie"]
    requests, hits = (
        np.bincount(genies.codes, lookups[name], len(genies.names)) for name in ("requests", "hits")
    )
    return {
        genies.names[code]: float(hits[code] / requests[code]) for code in np.flatnonzero(requests)
    }


def windowed_reuse(lookups: Columns, window: int = WINDOW_REQUESTS) -> Columns:
    """hits / requests over the last ``window`` requests, per Genie: columns ``genie``, ``t_ns``,
    ``ratio``.

    A window ends with each message and holds as few messages as make up ``window`` requests:
    exactly ``window`` for images, which are asked for one by one. A Genie with fewer requests has
    no window.
    """
    events, (requests, hits), first = _counted(lookups)
    ends = np.flatnonzero(requests[1:] - requests[first] >= window) + 1
    starts = np.searchsorted(requests, requests[ends] - window, side="right") - 1
    ratios = (hits[ends] - hits[starts]) / (requests[ends] - requests[starts])
    return Columns(
        {"genie": events["genie"][ends - 1], "t_ns": events["t_ns"][ends - 1], "ratio": ratios}
    )


def running_reuse(lookups: Columns) -> Columns:
    """hits / requests of each Genie so far, after each of its messages: columns ``t_ns`` and
    ``ratio``.
    """
    events, (requests, hits), first = _counted(lookups.rows(lookups["requests"] > 0))
    return Columns(
        {
            "t_ns": events["t_ns"],
            "ratio": (hits[1:] - hits[first]) / (requests[1:] - requests[first]),
        }
    )


def _counted(
    lookups: Columns,
) -> "tuple[Columns, list[Ints], Ints]":
    """The look-ups Genie by Genie, the requests and the hits before each of them and after the
    last, and of each the place of its Genie's first.
    """
    events = lookups.rows(np.argsort(lookups["genie"].codes, kind="stable"))
    counts = [np.concatenate([[0], np.cumsum(events[name])]) for name in ("requests", "hits")]
    codes = events["genie"].codes
    return events, counts, np.searchsorted(codes, codes)


def running_boost(lookups: Columns) -> Columns:
    """Mean of C_new - C_old over all updates so far: columns ``t_ns``, ``updates`` (how many) and
    ``boost``.
    """
    events = lookups.rows(lookups["updates"] > 0)
    updates = np.cumsum(events["updates"])
    boost = np.cumsum(events["boost_sum"]) / updates
    return Columns({"t_ns": events["t_ns"], "updates": updates, "boost": boost})


def boost_over_events(lookups: Columns, per_object: bool) -> Columns:
    """All confidence added so far, over the updates or over the objects then stored, Genies
    together, from the first of these on: columns ``events`` (how many look-ups) and ``boost``.
    """
    over = np.cumsum(_added_entries(lookups) if per_object else lookups["updates"])
    known = over > 0
    boost = np.cumsum(lookups["boost_sum"])[known] / over[known]
    return Columns({"events": np.flatnonzero(known) + 1, "boost": boost})


def _added_entries(lookups: Columns) -> "Ints":
    """How many entries each look-up adds to the map of its Genie."""
    genies: Text = lookups["genie"]
    order = np.argsort(genies.codes, kind="stable")
    codes, entries = genies.codes[order], lookups["entries"][order].astype(np.int64)
    before = np.where(np.diff(codes, prepend=-1) == 0, np.roll(entries, 1), 0)
    added: Ints = np.empty_like(entries)
    added[order] = entries - before
    return added


def last_of_genies(events: Columns) -> list[int]:
    """How many entries each Genie's cache or map had at the end."""
    return [int(of_genie["entries"][-1]) for _, of_genie in events.groups("genie")]


class Reuse(Metric):
    """Hits / requests, mean over Genies."""

    better = HIGHER
    section = GENIES
    view = Lookups
    mark = WINDOWS
    reads = "lookups: genie, t_ns, kind, requests, hits"

    asked: Callable[[Lookups], Columns]
    """The look-ups that count."""

    def of(self, view: Lookups) -> Measured:
        asked = self.asked(view)
        ratios, windows = list(reuse(asked).values()), windowed_reuse(asked)["ratio"]
        low, high = (float(windows.min()), float(windows.max())) if len(windows) else (None, None)
        value = float(np.mean(ratios)) if ratios else None
        return Measured(value, low, high, int(asked["requests"].sum()))


class ImageReuse(Reuse):
    """Hits / requests of the message caches, asked by their own clients, mean over Genies."""

    title = "image reuse"
    reads = "lookups: genie, t_ns, kind, requests, hits, requester"
    asked = attrgetter("of_clients")


class PooledImageReuse(ImageReuse):
    """Hits / requests of all message caches together, so that each request weighs the same."""

    title = "image reuse, pooled"
    mark = ""

    def of(self, view: Lookups) -> Measured:
        asked = self.asked(view)
        hits, n = int(asked["hits"].sum()), int(asked["requests"].sum())
        return quotient(hits, n, n)


class ImageReuseWithNeighbours(Reuse):
    """Image reuse in which the requests of other edges count, too."""

    title = "image reuse with neighbours"
    asked = attrgetter("images")


class Coalesced(Metric):
    """Share of the clients' requests that wait for the answer to an equal pending one."""

    title = "coalesced requests"
    section = GENIES
    view = Lookups
    reads = "lookups: kind, requester, outcome"

    def of(self, view: Lookups) -> Measured:
        n = len(view.of_clients)
        return quotient(int((view.of_clients["outcome"] == "coalesced").sum()), n, n)


class ObjectReuse(Reuse):
    """Object look-ups answered by an object with C >= C_T, mean over Genies."""

    title = "object reuse"
    asked = attrgetter("objects")


class ConfidenceBoost(Metric):
    """Mean of C(new) - C(old) over the object maps' updates."""

    title = "confidence boost"
    unit = ""
    better = HIGHER
    section = GENIES
    view = Lookups
    reads = "lookups: genie, t_ns, updates, boost_sum"

    def of(self, view: Lookups) -> Measured:
        events = view.objects.rows(view.objects["updates"] > 0)
        n = int(events["updates"].sum())
        if not n:
            return Measured(None)
        value = float(events["boost_sum"].sum() / n)
        blocks = Blocks(events["genie"], events["t_ns"], view.intervals)
        half = blocks.half_width(blocks.influence(events["boost_sum"], events.floats("updates")))
        return Measured(value, *around(value, half), n)


class StoredImages(Metric):
    """Entries of a message cache at the end, mean over Genies."""

    title = "stored images per Genie"
    unit = ""
    unit_in_files = "entries/Genie"
    section = GENIES
    view = Lookups
    reads = "lookups: genie, kind, entries"

    def of(self, view: Lookups) -> Measured:
        return average(last_of_genies(view.images))


class StoredObjects(StoredImages):
    """Objects in a map at the end, mean over Genies."""

    title = "stored objects per Genie"

    def of(self, view: Lookups) -> Measured:
        return average(last_of_genies(view.objects))


METRICS = {
    "image_reuse": ImageReuse(),
    "image_reuse_pooled": PooledImageReuse(),
    "image_reuse_with_neighbours": ImageReuseWithNeighbours(),
    "coalesced_share": Coalesced(),
    "object_reuse": ObjectReuse(),
    "confidence_boost": ConfidenceBoost(),
    "stored_images": StoredImages(),
    "stored_objects": StoredObjects(),
}
