"""Metrics of published frames: response times, what became of them, improvements, and what each
part of a frame's way takes of the response times.
"""

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
# what each part of a mean took, by answer
PART = {"first": "first_answer_part", "fresh": "fresh_answer_part"}
SPAN = "from the camera's stamp of a frame to its"


class PairedFrames(NamedTuple):
    """The same frames under a method and under its baseline."""

    ours: Columns
    theirs: Columns


class PartOfTime(NamedTuple):
    """What a part took of all frames that got an answer [ns], and how many these are."""

    answer: str
    sum_ns: float
    n: int


def views(tables: MethodTables) -> Iterator[Given]:
    """The frames of a method, and each part of the time of its answers, as component."""
    if "frames" not in tables:
        return
    frames = tables["frames"]
    yield Given("frames", frames)
    for answer in ANSWER_TITLES if "steps" in tables else ():
        n = int((~np.isnan(frames.floats(f"{answer}_answer_ns"))).sum())
        steps = tables["steps"]
        steps = steps.rows(steps["which"].isin((answer, "both")))
        parts = steps["part"]
        sums_ns = np.bincount(parts.codes, steps["end_ns"] - steps["begin_ns"], len(parts.names))
        of_parts = dict(zip(parts.names, sums_ns.tolist(), strict=True))
        answered = frames.rows(is_answered(frames, answer))
        to_first_node_ns = float((answered.floats("received_ns") - answered["stamp_ns"]).sum())
        of_parts["hop"] = of_parts.get("hop", 0.0) + to_first_node_ns
        for part, sum_ns in of_parts.items():
            if n and sum_ns:
                yield Given("parts", PartOfTime(answer, sum_ns, n), component=part)


def pairs(tables: MethodTables, baselines: Mapping[str, MethodTables]) -> Iterator[Given]:
    """The frames of a method beside those of each baseline, as component."""
    for name, theirs in baselines.items():
        if "frames" in tables and "frames" in theirs:
            yield Given("pairs", PairedFrames(tables["frames"], theirs["frames"]), component=name)


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


def _in_time(answer: str, tier: int) -> Metric:
    title = f"{ANSWER_TITLES[answer]} within {DEADLINE_MS:g} ms"
    return _share(
        title,
        HIGHER,
        f"with a {title}",
        lambda frames: response_ms(frames, answer) < DEADLINE_MS,
        section=TIMES,
        tier=tier,
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


def _part(part: PartOfTime, answer: str) -> Estimate | None:
    """Over all frames that got the answer; the parts add up to the mean response time."""
    return Estimate(part.sum_ns / part.n / NS_PER_MS, n=part.n) if part.answer == answer else None


def _answers(answer: str, tiers: Mapping[str, int], in_time: int) -> dict[str, Metric]:
    """The times until an answer, and the share of frames that have it in time."""
    title = ANSWER_TITLES[answer]
    of_statistics = times(
        title, f"{SPAN} {title}.", partial(response_ms, answer=answer), tiers, section=TIMES
    )
    of_answer = {f"{answer}_answer_{name}": metric for name, metric in of_statistics}
    share_in_time = "under_deadline_share" if answer == "first" else "fresh_under_deadline_share"
    return of_answer | {share_in_time: _in_time(answer, in_time)}


METRICS = {
    **_answers("first", {"mean": HEADLINE, "p50": REST, "p95": MAIN, "p99": REST}, SHORT),
    **_answers("fresh", {"mean": SHORT}, REST),
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
        meaning="1 - mean first answer of the method / that of the baseline.",
        formula=_improvement,
        kind="pairs",
        is_signed=True,
    ),
    **{
        name: Metric(
            f"part of the {ANSWER_TITLES[answer]}",
            "ms",
            LOWER,
            meaning=f"Mean time that a part takes {SPAN} {ANSWER_TITLES[answer]}.",
            formula=partial(_part, answer=answer),
            kind="parts",
        )
        for answer, name in PART.items()
    },
}
