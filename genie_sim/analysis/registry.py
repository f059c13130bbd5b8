"""Every metric by its name. Whatever shows a metric to people, on the terminal, in tables, figures
and pages, takes its words from here; files and the library use the names.

One of the user's own (``metric.Metric``) is named ``package.module:name``; its words travel in the
results in which it has numbers.
"""

import difflib
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from genie_sim.analysis import (
    correctness,
    frame_metrics,
    genie_metrics,
    outages,
    prices,
    resource_metrics,
)
from genie_sim.analysis.metric import HIGHER, LOWER, Metric
from genie_sim.analysis.result_table import Cell
from genie_sim.base.errors import UserError, short_repr
from genie_sim.base.plugins import is_own
from genie_sim.base.text import one_line
from genie_sim.record.records import ZERO_DELAY
from genie_sim.record.results import MethodInfo, MetricValue

WORDS = {
    "title": str,
    "unit": str,
    "better": str,
    "section": str,
    "meaning": str,
    "tier": int,
    "is_signed": bool,
    "needs": int,
}
COMPONENT_TITLES = {
    ZERO_DELAY: "zero-delay detector",
    "before": "before it",
    "during": "during it",
    "after": "after it",
}
OWN = "Own metrics"  # the section of those that name none
LOGARITHMIC_FROM = 20.0  # a list of numbers that spans so much, largest to smallest

# Each has its metrics, and yields what they are given. In this order numbers are written.
MODULES = (
    frame_metrics,
    genie_metrics,
    correctness,
    prices,
    resource_metrics,
    outages,
)
METRICS: Mapping[str, Metric] = {
    name: metric for module in MODULES for name, metric in module.METRICS.items()
}


Words = Mapping[str, Mapping[str, Any]]  # what results say of each metric, by its name
NO_WORDS: Words = {}


def words(names: Iterable[str], own: Words = NO_WORDS) -> dict[str, dict[str, Any]]:
    """What people read of these metrics, as plain data: how results tell it."""
    return {
        name: {key: getattr(definition(name, own), key) for key in WORDS}
        for name in dict.fromkeys(names)
    }


def checked_words(told: object, where: str) -> dict[str, dict[str, Any]]:
    """Of what results say of metrics the words of the user's own, so that these are shown as others
    are, without their code. Raises ``UserError``; ``where`` it stands begins errors.
    """
    if not isinstance(told, dict):
        raise UserError(f"{where}: must be a mapping, not {short_repr(told)}")
    own: dict[str, dict[str, Any]] = {}
    for name, told_of in told.items():
        if not is_own(name):
            continue
        if not isinstance(told_of, dict):
            raise UserError(f"{where}: {name}: must be a mapping, not {short_repr(told_of)}")
        check_words(f"{where}: {name}", told_of)
        own[name] = {
            key: one_line(value) if isinstance(value, str) else value
            for key, value in told_of.items()
            if key in WORDS
        }
    return own


def check_words(where: str, words_of: Mapping[str, Any]) -> None:
    """Raises ``UserError``, which begins with ``where`` it stands, for what is not said of a metric
    as it should be.
    """
    for key, kind in WORDS.items():
        if type(words_of.get(key)) is not kind:
            value = short_repr(words_of.get(key))
            raise UserError(f"{where}: {key}: must be of type {kind.__name__}, not {value}")
    if not words_of["title"].strip():
        raise UserError(f"{where}: title: is empty")
    if words_of["better"] not in ("", LOWER, HIGHER):
        choices = f"{LOWER}, {HIGHER}, or empty where neither is"
        raise UserError(f"{where}: better: {short_repr(words_of['better'])}; known: {choices}")


def shown(tier: int, measured: Iterable[str]) -> list[str]:
    """Of the metrics that were measured those that are shown up to this tier, in the paper's order,
    then the user's own. A proxy for the truth gives way to the truth.
    """
    names = dict.fromkeys(measured)
    if "streaming_f1" in names:
        names.pop("first_proxy_f1", None)
    usual = [name for name, metric in METRICS.items() if metric.tier <= tier and name in names]
    return [*usual, *filter(is_own, names)]


def definition(name: str, own: Words = NO_WORDS) -> Metric:
    """A metric by its name; one of the user's own in the words of the results in which it is. One
    of which nothing is told goes by its name.
    """
    return METRICS.get(name) or Metric(**{"title": name, "unit": "", **own.get(name, {})})


def checked(names: Sequence[str], own: Iterable[str] = (), where: str = "metrics") -> Sequence[str]:
    """The names, if all are of metrics, or of these of the user's own. Raises ``UserError`` that
    begins with ``where`` they are from.
    """
    known = {*METRICS, *own}
    for name in names:
        if name not in known:
            raise UserError(f"{where}: {unknown_metric(name, known)}")
    return names


def unknown_metric(name: str, known: Iterable[str] = METRICS) -> str:
    """``unknown metric 'false objects' (did you mean 'ghost_share'?); see 'genie-sim list
    metrics'``: the nearest by name or title.
    """
    found = near(name, known)
    hint = f" (did you mean {' or '.join(map(repr, found))}?)" if found else ""
    return f"unknown metric {short_repr(name)}{hint}; see 'genie-sim list metrics'"


def near(name: str, known: Iterable[str] = METRICS) -> list[str]:
    """At most two metrics whose names or titles are like this, the nearest first."""
    by_text = {metric.replace("_", " "): metric for metric in known}
    by_text |= {METRICS[metric].title.lower(): metric for metric in known if metric in METRICS}
    close = difflib.get_close_matches(name.lower().replace("_", " "), by_text, n=3)
    return list(dict.fromkeys(by_text[text] for text in close))[:2]


def component_title(component: str, methods: Sequence[MethodInfo] = ()) -> str:
    """The title of a metric's component: a method, a resource, or the zero-delay detector."""
    titles = COMPONENT_TITLES | {method.name: method.title for method in methods}
    return titles.get(component, component)


def cell(metric: MetricValue | None, own: Words = NO_WORDS) -> Cell:
    """A number of a run in the unit that is shown, with its interval."""
    if metric is None:
        return Cell()
    if metric.value is None:
        return Cell(math.nan)
    return definition(metric.metric, own).cell(metric.value, metric.low, metric.high)


def spans_much(numbers: Sequence[float]) -> bool:
    """Whether a list of numbers is better drawn on a logarithmic axis."""
    return bool(numbers) and min(numbers) > 0 and max(numbers) / min(numbers) >= LOGARITHMIC_FROM


def is_drawn_logarithmically(metric: Metric, numbers: Sequence[float]) -> bool:
    """Whether an axis of a metric is logarithmic with these values on it; one of shares never
    is.
    """
    return metric.unit != "%" and spans_much(numbers)
