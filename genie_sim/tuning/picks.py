"""Three designs in words: chosen by the tuning set, told with the numbers of the held-out set."""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from genie_sim.analysis.registry import METRICS
from genie_sim.study.design import Level
from genie_sim.text import number_text
from genie_sim.tuning.design import Objective, SearchDesign
from genie_sim.tuning.evaluation import Candidate
from genie_sim.tuning.space import Space
from genie_sim.tuning.tables import Reported

WITHIN = 0.01  # of the best accuracy: what the cheapest design may lose of it


class Pick(NamedTuple):
    """A design in words: how it was chosen, its file, and what to say of it."""

    words: str
    file: str
    candidate: Candidate
    text: str

    def plain(self) -> dict[str, Any]:
        """As JSON."""
        return {
            "words": self.words,
            "file": f"designs/{self.file}.yaml",
            "design": self.candidate.name,
            "method": self.candidate.method,
            "values": dict(self.candidate.values),
            "text": self.text,
        }


def picks(design: SearchDesign, reported: Sequence[Reported]) -> list[Pick]:
    """The most accurate design, the cheapest within .01 of its accuracy, and the fastest.

    Accuracy is the first objective; speed the first objective that is a time, and cost the first
    other one that is none. They are chosen by their means over the tuning set, so the held-out
    numbers beside them are not the best of many.
    """
    objectives = design.objectives.all
    tuned = [item for item in reported if item.tuning is not None]
    best = min(tuned, key=lambda item: _key(objectives, item, 0))
    chosen = [("most accurate", "most_accurate", best)]
    cost = _cost(objectives)
    if cost is not None:
        limit = _key(objectives, best, 0)[0] + WITHIN
        near = [item for item in tuned if _key(objectives, item, 0)[0] <= limit]
        cheapest = min(near, key=lambda item: _key(objectives, item, cost))
        chosen.append((f"cheapest within {WITHIN:g}", "cheapest", cheapest))
    time = _time(objectives)
    if time is not None:
        fastest = min(tuned, key=lambda item: _key(objectives, item, time))
        chosen.append(("fastest", "fastest", fastest))
    return [
        Pick(words, file, item.candidate, " ".join(_sentences(design, words, item)))
        for words, file, item in chosen
    ]


def _key(objectives: Sequence[Objective], item: Reported, place: int) -> tuple[float, ...]:
    """An objective over the tuning set, less is better; equal designs by the other objectives."""
    assert item.tuning is not None
    signed = [
        objective.sign * float(value)
        for objective, value in zip(objectives, item.tuning, strict=False)
    ]
    return (signed[place], *signed)


def _time(objectives: Sequence[Objective]) -> int | None:
    """The first objective besides accuracy that is a time."""
    times = (
        place
        for place, objective in enumerate(objectives)
        if place and METRICS[objective.target.metric].unit == "ms"
    )
    return next(times, None)


def _cost(objectives: Sequence[Objective]) -> int | None:
    """The first objective besides accuracy that is no time."""
    costs = (
        place
        for place, objective in enumerate(objectives)
        if place and METRICS[objective.target.metric].unit != "ms"
    )
    return next(costs, None)


def _sentences(design: SearchDesign, words: str, item: Reported) -> Iterator[str]:
    yield f"{words[0].upper()}{words[1:]}: {item.candidate.name}."
    parts = []
    for target, measured in zip(design.targets, item.intervals(design), strict=True):
        info = METRICS[target.metric]
        value, low, high = (number_text(info.factor * number) for number in measured)
        parts.append(f"{target.title} {value} ({low} to {high}) {info.unit}".rstrip())
    yield f"{'; '.join(dict.fromkeys(parts))}."
    space = design.methods[item.candidate.method]
    values = [
        f"{name} {value_text(space, name, value)}" for name, value in item.candidate.values.items()
    ]
    yield f"Settings: {', '.join(values)}."


def value_text(space: Space, name: str, value: Level) -> str:
    """The value of a parameter with its unit."""
    text = number_text(value) if isinstance(value, float) else str(value)
    return f"{text} {space.unit(name)}".rstrip()
