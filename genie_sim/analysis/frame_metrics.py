"""Metrics of published frames: response times, what became of them, and improvements."""

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from genie_sim.analysis.metric import (
    DEADLINE_MS,
    HEADLINE,
    HIGHER,
    LOWER,
    MAIN,
    RECENT_MS,
    REST,
    SHORT,
    Given,
    MethodTables,
    Metric,
    Sample,
    half_of_pair,
    mean_of,
    share_of,
    times,
)
from genie_sim.analysis.statistics import Estimate, around
from genie_sim.base.units import NS_PER_MS
from genie_sim.record.columns import Columns, Floats

TIMES, FRAMES_SECTION, IMPROVEMENTS = "Response times", "Published frames", "Improvements"
ANSWER_TITLES = {"first": "first answer", "fresh": "fresh result"}  # as titles and meanings say
SPAN = "from the camera's stamp of a frame to its"


class PairedFrames(NamedTuple):
    """The frames of the same cars under a method and under its baseline."""

    ours: Columns
    theirs: Columns


def views(tables: MethodTables) -> Iterator[Given]:
    """The frames of a method."""
    if "frames" in tables:
        yield Given("frames", tables["frames"])


def pairs(tables: MethodTables, baselines: Mapping[str, MethodTables]) -> Iterator[Given]:
    """The frames of a method beside those of each baseline, as component, of the cars that drive
    under both.
    """
    for name, theirs in baselines.items():
        if "frames" in tables and "frames" in theirs:
            both = tables["frames"], theirs["frames"]
            cars = set(both[0]["car"].unique()).intersection(both[1]["car"].unique())
            ours, others = (frames.rows(frames["car"].isin(cars)) for frames in both)
            yield Given("pairs", PairedFrames(ours, others), component=name)


def response_ms(frames: Columns, answer: str) -> Floats:
    """From the camera's stamp to the ``first`` or the ``fresh`` answer, in milliseconds; NaN where
    there is none. The stamp is in the headers of picture and answer, so a consumer can tell it.
    """
    return (frames.floats(f"{answer}_answer_ns") - frames.floats("stamp_ns")) / NS_PER_MS


def look_age_ms(frames: Columns) -> Floats:
    """From the newest frame in which a detector saw any of a first answer to its own frame."""
    age_ns = frames.floats("stamp_ns") - frames.floats("first_looked_ns")
    return np.maximum(age_ns, 0.0) / NS_PER_MS


def is_answered(frames: Columns, answer: str = "first") -> Any:
    """Which frames have this answer."""
    return ~np.isnan(frames.floats(f"{answer}_answer_ns"))


def _is_dropped(frames: Columns) -> Any:
    return ~is_answered(frames) & frames["drop"].has_text


def _is_recent(frames: Columns) -> Any:
    age_ns = frames.floats("stamp_ns") - frames.floats("looked_ns")
    return age_ns / NS_PER_MS <= RECENT_MS


def _share(
    title: str, better: str, which: str, flags: Callable[[Columns], Any], **words: Any
) -> Metric:
    """A share of the published frames."""
    return Metric(
        title,
        "%",
        better,
        meaning=f"Share of all published frames {which}.",
        formula=lambda frames: share_of(frames, flags(frames)),
        **words,
    )


def _improvement(pair: PairedFrames) -> Estimate:
    samples: list[Sample] = [mean_of(frames, response_ms(frames, "first")) for frames in pair]
    counts = [int(sample.below.sum()) for sample in samples]
    if not all(counts):
        return Estimate(None)
    ours, theirs = (
        float(sample.above.sum()) / n for sample, n in zip(samples, counts, strict=True)
    )
    if not theirs:
        return Estimate(None)
    half, _ = half_of_pair(samples, (1 / theirs, -ours / theirs**2))
    value = 1 - ours / theirs
    return Estimate(value, *around(value, half), min(counts))


def _times(answer: str, tiers: Mapping[str, int]) -> dict[str, Metric]:
    """The times until an answer."""
    title = ANSWER_TITLES[answer]
    of_statistics = times(
        title, f"{SPAN} {title}.", partial(response_ms, answer=answer), tiers, section=TIMES
    )
    return {f"{answer}_answer_{name}": metric for name, metric in of_statistics}


METRICS = {
    **_times("first", {"mean": HEADLINE, "p50": REST, "p95": MAIN, "p99": REST}),
    "under_deadline_share": _share(
        f"first answer within {DEADLINE_MS:g} ms",
        HIGHER,
        f"with a first answer within {DEADLINE_MS:g} ms",
        lambda frames: response_ms(frames, "first") < DEADLINE_MS,
        section=TIMES,
        tier=SHORT,
    ),
    **_times("fresh", {"mean": SHORT}),
    "fresh_answered_share": _share(
        "frames with a fresh result",
        HIGHER,
        "for which a detector looked at this very frame",
        partial(is_answered, answer="fresh"),
        section=FRAMES_SECTION,
        tier=SHORT,
    ),
    **{
        f"look_age_{statistic}": metric
        for statistic, metric in times(
            "age of look",
            "from the newest frame in which a detector saw any of a first answer to its own frame.",
            look_age_ms,
            {"mean": MAIN},
            section=TIMES,
        )
    },
    "answered_share": _share(
        "frames answered", HIGHER, "with any answer", is_answered, section=FRAMES_SECTION
    ),
    "recent_share": _share(
        "frames with a recent result",
        HIGHER,
        "with an answer from a look at most 100 ms older",
        _is_recent,
        section=FRAMES_SECTION,
        tier=MAIN,
    ),
    "dropped_share": _share(
        "frames dropped",
        LOWER,
        "that a queue or a link dropped",
        _is_dropped,
        section=FRAMES_SECTION,
        tier=MAIN,
    ),
    "improvement_first_answer": Metric(
        "improvement of the mean first answer",
        "%",
        HIGHER,
        IMPROVEMENTS,
        meaning="1 - mean first answer of the method / that of the baseline, of the cars that "
        "drive under both.",
        formula=_improvement,
        kind="pairs",
        is_signed=True,
    ),
}
