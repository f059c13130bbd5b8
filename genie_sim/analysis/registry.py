"""Every metric by its name. Whatever shows a metric to people, on the terminal, in tables, figures
and pages, takes its words from here; files and the library use the names.

A class of the user's own (``metric.Metric``) is named ``package.module:Class``.
"""

import difflib
import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import chain

from genie_sim.analysis import (
    correctness,
    frame_metrics,
    genie_metrics,
    looks,
    outages,
    part_metrics,
    prices,
    resource_metrics,
)
from genie_sim.analysis.metric import ZERO_DELAY, Metric, Views
from genie_sim.analysis.result_table import Cell
from genie_sim.base import plugins
from genie_sim.base.errors import UserError, short_repr, unknown
from genie_sim.base.plugins import Choice
from genie_sim.record.columns import Columns
from genie_sim.record.records import SCHEMAS
from genie_sim.record.results import MethodInfo, MetricValue

COMPONENT_TITLES = {ZERO_DELAY: "zero-delay detector"}
LOGARITHMIC_FROM = 20.0  # a list of numbers that spans so much, largest to smallest

# Each has its metrics, and the views that they are given. In this order numbers are written.
MODULES = (
    frame_metrics,
    genie_metrics,
    looks,
    resource_metrics,
    prices,
    correctness,
    outages,
    part_metrics,
)
METRICS: Mapping[str, Metric] = {
    name: metric for module in MODULES for name, metric in module.METRICS.items()
}


def views(
    tables: Mapping[str, Columns], methods: Sequence[MethodInfo], intervals: bool = True
) -> Views:
    """What formulas are given, of all tables that there are; ``frames`` may be empty."""
    by_name = {method.name: method for method in methods}
    return chain.from_iterable(module.views(tables, by_name, intervals) for module in MODULES)


class Unregistered(Metric):
    """A metric whose class is not here."""

    unit = ""

    def __init__(self, name: str) -> None:
        self.title = name


def own_metrics(names: Iterable[str]) -> dict[str, Metric]:
    """Metrics of the user's own, each ``package.module:Class``. Raises ``UserError``."""
    found = {}
    for name in names:
        metric = plugins.make("metric", Choice(name), {}, ("of", "title", "view"))
        if not isinstance(metric, Metric):
            base = f"{Metric.__module__}.{Metric.__name__}"
            raise UserError(f"metric {name!r}: is no subclass of {base}")
        for table, columns in metric.columns_read().items():
            if table not in SCHEMAS:
                raise UserError(f"metric {name!r}: reads: {unknown('table', table, SCHEMAS)}")
            known = [column.name for column in SCHEMAS[table].columns]
            for column in columns:
                if column not in known:
                    text = unknown("column", column, known)
                    raise UserError(f"metric {name!r}: reads: {table}: {text}")
        found[name] = metric
    return found


def definition(name: str) -> Metric:
    """A metric by its name; one of the user's own whose class cannot be had goes by its name."""
    if name in METRICS:
        return METRICS[name]
    try:
        return own_metrics([name])[name]
    except UserError:
        return Unregistered(name)


def checked(
    names: Sequence[str], own: Iterable[str] = (), where: str = "--metrics"
) -> Sequence[str]:
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
    metrics'``: the nearest by name or title. One that was removed is answered with what to write
    instead.
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


def title_of(metric: str) -> str:
    """A metric's title; the name of one that is not registered."""
    return definition(metric).title


def component_title(component: str, methods: Sequence[MethodInfo] = ()) -> str:
    """The title of a metric's component: a method, a resource, or the zero-delay detector."""
    titles = COMPONENT_TITLES | {method.name: method.title for method in methods}
    return titles.get(component, component)


def cell(metric: MetricValue | None) -> Cell:
    """A number of a run in the unit that is shown, with its interval."""
    if metric is None:
        return Cell()
    if metric.value is None:
        return Cell(math.nan)
    return definition(metric.metric).cell(metric.value, metric.low, metric.high)


def spans_much(numbers: Sequence[float]) -> bool:
    """Whether a list of numbers is better drawn on a logarithmic axis."""
    return bool(numbers) and min(numbers) > 0 and max(numbers) / min(numbers) >= LOGARITHMIC_FROM


def is_drawn_logarithmically(metric: str, numbers: Sequence[float]) -> bool:
    """Whether an axis of a metric is logarithmic with these values on it; one of shares never
    is.
    """
    return definition(metric).unit != "%" and spans_much(numbers)
