"""A short notation of facts for tables of tests: ``image_reuse:car``,
``first_answer_mean:genie:car1``.
"""

from __future__ import annotations

from collections.abc import Mapping

from genie_sim.analysis.genie_metrics import PLACEMENTS
from genie_sim.paper.facts import Fact, Facts


def fact(text: str) -> Fact:
    """A metric, then its placement or method (none: Genie's), then its component."""
    metric, place, component, *_ = f"{text}::".split(":")
    if place in PLACEMENTS:
        return Fact(metric, placement=place, component=component)
    return Fact(metric, place or "genie", component=component)


def facts(values: Mapping[str, float]) -> Facts:
    """Facts by their notation; ``image_reuse__car`` stands for ``image_reuse:car``."""
    return {fact(name.replace("__", ":")): value for name, value in values.items()}
