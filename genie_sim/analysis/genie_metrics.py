"""Metrics of Genies: reuse, confidence boosts, and how much their caches and maps hold."""

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from genie_sim.analysis.metric import (
    HEADLINE,
    HIGHER,
    SHORT,
    WINDOW_REQUESTS,
    WINDOWS,
    Metric,
    Sample,
    Seen,
    Tables,
    average,
    quotient,
)
from genie_sim.analysis.statistics import Measured
from genie_sim.record.columns import Columns, Text

if TYPE_CHECKING:
    Ints = np.ndarray[Any, Any]

PLACEMENTS = ("car", "edge")  # of Genies
GENIES = "Genies"


def views(tables: Tables) -> Iterator[Seen]:
    """The look-ups of a method's Genies on cars, and on edges."""
    for placement in PLACEMENTS if "lookups" in tables else ():
        rows = tables["lookups"].where(placement=placement)
        if len(rows):
            yield Seen("lookups", rows, placement)


def images(lookups: Columns) -> Columns:
    """Look-ups in message caches."""
    return lookups.where(kind="image")


def of_clients(lookups: Columns) -> Columns:
    """Look-ups in message caches that a Genie's own clients asked for."""
    return lookups.where(kind="image", requester="client")


def objects(lookups: Columns) -> Columns:
    """Look-ups in object maps."""
    return lookups.rows(lookups["kind"] != "image")


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


def _reuse(lookups: Columns) -> Measured:
    ratios, windows = list(reuse(lookups).values()), windowed_reuse(lookups)["ratio"]
    low, high = (float(windows.min()), float(windows.max())) if len(windows) else (None, None)
    value = float(np.mean(ratios)) if ratios else None
    return Measured(value, low, high, int(lookups["requests"].sum()))


def _pooled(lookups: Columns) -> Measured:
    asked = of_clients(lookups)
    return quotient(int(asked["hits"].sum()), int(asked["requests"].sum()))


def _boost(lookups: Columns) -> Sample:
    events = objects(lookups)
    events = events.rows(events["updates"] > 0)
    of_genies = events.assign(car=events["genie"], stamp_ns=events["t_ns"])
    return Sample(of_genies, events["boost_sum"], events["updates"])


def _coalesced(lookups: Columns) -> Measured:
    asked = of_clients(lookups)
    return quotient(int((asked["outcome"] == "coalesced").sum()), len(asked))


def _of_lookups(
    title: str, unit: str, meaning: str, formula: Callable[[Columns], Any], **words: Any
) -> Metric:
    return Metric(
        title, unit, section=GENIES, meaning=meaning, formula=formula, rows="lookups", **words
    )


METRICS = {
    "image_reuse": _of_lookups(
        "image reuse",
        "%",
        "Hits / requests of the message caches, asked by their own clients, mean over Genies.",
        lambda lookups: _reuse(of_clients(lookups)),
        better=HIGHER,
        tier=HEADLINE,
        mark=WINDOWS,
    ),
    "image_reuse_pooled": _of_lookups(
        "image reuse, pooled",
        "%",
        "Hits / requests of all message caches together, so that each request weighs the same.",
        _pooled,
        better=HIGHER,
    ),
    "image_reuse_with_neighbours": _of_lookups(
        "image reuse with neighbours",
        "%",
        "Image reuse in which the requests of other edges count, too.",
        lambda lookups: _reuse(images(lookups)),
        better=HIGHER,
        mark=WINDOWS,
    ),
    "coalesced_share": _of_lookups(
        "coalesced requests",
        "%",
        "Share of the clients' requests that wait for the answer to an equal pending one.",
        _coalesced,
    ),
    "object_reuse": _of_lookups(
        "object reuse",
        "%",
        "Object look-ups answered by an object with C >= C_T, mean over Genies.",
        lambda lookups: _reuse(objects(lookups)),
        better=HIGHER,
        tier=HEADLINE,
        mark=WINDOWS,
    ),
    "confidence_boost": _of_lookups(
        "confidence boost",
        "",
        "Mean of C(new) - C(old) over the object maps' updates.",
        _boost,
        better=HIGHER,
        tier=SHORT,
    ),
    "stored_images": _of_lookups(
        "stored images per Genie",
        "entries",
        "Entries of a message cache at the end, mean over Genies.",
        lambda lookups: average(last_of_genies(images(lookups))),
    ),
    "stored_objects": _of_lookups(
        "stored objects per Genie",
        "entries",
        "Objects in a map at the end, mean over Genies.",
        lambda lookups: average(last_of_genies(objects(lookups))),
    ),
}
