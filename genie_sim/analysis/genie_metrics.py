"""Metrics of Genies: reuse, confidence boosts, and how much their caches and maps hold."""

import math
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from genie_sim.analysis.metric import (
    HEADLINE,
    HIGHER,
    MAIN,
    SHORT,
    Given,
    MethodTables,
    Metric,
    Sample,
    average,
    quotient,
)
from genie_sim.analysis.statistics import Estimate
from genie_sim.record.columns import Columns, Text

if TYPE_CHECKING:
    Ints = np.ndarray[Any, Any]

GENIE_PLACEMENTS = ("car", "edge")  # of Genies
GENIES = "Genies"


def views(tables: MethodTables) -> Iterator[Given]:
    """The look-ups of a method's Genies on cars, and on edges."""
    for placement in GENIE_PLACEMENTS if "lookups" in tables else ():
        rows = tables["lookups"].where(placement=placement)
        if len(rows):
            yield Given("lookups", rows, placement)


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


def running_reuse(lookups: Columns) -> Columns:
    """hits / requests of each Genie so far, after each of its messages: columns ``genie``,
    ``t_ns`` and ``ratio``.
    """
    events, (requests, hits), first = _counted(lookups.rows(lookups["requests"] > 0))
    return Columns(
        {
            "genie": events["genie"],
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
    """All confidence that a placement's maps added so far, over the objects that they have stored,
    both after a warm-up since its end, from the first object on: columns ``t_ns``, ``events`` (how
    many look-ups) and ``boost``.
    """
    stored = np.cumsum(_added_entries(lookups))
    known = stored > 0
    boost = np.cumsum(lookups["boost_sum"])[known] / stored[known]
    events = np.flatnonzero(known) + 1
    return Columns({"t_ns": lookups["t_ns"][known], "events": events, "boost": boost})


def _added_entries(lookups: Columns) -> "Ints":
    """How many entries each look-up adds to the map of its Genie. After a warm-up the first row of
    a Genie finds entries that no row added: all but those that it can have added itself, the
    objects of a sighting that were not stored.
    """
    genies: Text = lookups["genie"]
    order = np.argsort(genies.codes, kind="stable")
    codes, entries = genies.codes[order], lookups["entries"][order].astype(np.int64)
    new = np.where(lookups["kind"] == "sighting", lookups["requests"] - lookups["updates"], 0)
    found = np.maximum(entries - new[order], 0)
    before = np.where(np.diff(codes, prepend=-1) == 0, np.roll(entries, 1), found)
    added: Ints = np.empty_like(entries)
    added[order] = np.maximum(entries - before, 0)  # what is forgotten was stored all the same
    return added


def last_of_genies(events: Columns) -> list[int]:
    """How many entries each Genie's cache or map had at the end."""
    return [int(of_genie["entries"][-1]) for _, of_genie in events.groups("genie")]


def _reuse(lookups: Columns) -> Estimate:
    """With the lowest and the highest ratio that any Genie has had so far at any time."""
    ratios, running = list(reuse(lookups).values()), running_reuse(lookups)["ratio"]
    if not ratios:
        return Estimate(None, n=0)
    value, n = float(np.mean(ratios)), int(lookups["requests"].sum())
    return Estimate(value, n=n, range_low=float(running.min()), range_high=float(running.max()))


def _pooled(lookups: Columns) -> Estimate:
    asked = of_clients(lookups)
    return quotient(int(asked["hits"].sum()), int(asked["requests"].sum()))


def _boost(lookups: Columns) -> Estimate:
    maps = objects(lookups)
    stored = int(_added_entries(maps).sum())
    return quotient(math.fsum(maps["boost_sum"]), stored)


def _boost_per_sighting(lookups: Columns) -> Sample:
    events = objects(lookups)
    events = events.rows(events["updates"] > 0)
    of_genies = events.assign(car=events["genie"], stamp_ns=events["t_ns"])
    return Sample(of_genies, events["boost_sum"], events["updates"])


def _of_lookups(
    title: str, unit: str, meaning: str, formula: Callable[[Columns], Any], **words: Any
) -> Metric:
    return Metric(
        title, unit, section=GENIES, meaning=meaning, formula=formula, kind="lookups", **words
    )


METRICS = {
    "image_reuse": _of_lookups(
        "image reuse",
        "%",
        "Hits / requests of a Genie's message cache, of its clients and of other Genies; mean over "
        "Genies.",
        lambda lookups: _reuse(images(lookups)),
        better=HIGHER,
        tier=HEADLINE,
    ),
    "image_reuse_own": _of_lookups(
        "image reuse of own clients",
        "%",
        "Image reuse in which the requests of other Genies do not count.",
        lambda lookups: _reuse(of_clients(lookups)),
        better=HIGHER,
        tier=MAIN,
    ),
    "image_reuse_pooled": _of_lookups(
        "image reuse of own clients, pooled",
        "%",
        "Hits / requests of the own clients of all message caches, so that each request weighs the "
        "same.",
        _pooled,
        better=HIGHER,
    ),
    "object_reuse": _of_lookups(
        "object reuse",
        "%",
        "Hits / requests of an object map: look-ups answered by an object with C >= C_T; mean over "
        "Genies.",
        lambda lookups: _reuse(objects(lookups)),
        better=HIGHER,
        tier=HEADLINE,
    ),
    "confidence_boost": _of_lookups(
        "confidence boost",
        "",
        "Confidence added by all Genies of a placement, over the objects that they have stored, "
        "forgotten ones included; after a warm-up, since its end.",
        _boost,
        better=HIGHER,
        tier=SHORT,
    ),
    "boost_per_sighting": _of_lookups(
        "boost per sighting",
        "",
        "Mean of C(new) - C(old) over the object maps' updates.",
        _boost_per_sighting,
        better=HIGHER,
        tier=MAIN,
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
