"""The metrics of a run, among them those of the paper's Section V, as arithmetic on its tables.

``low`` and ``high`` of a metric are a 95 % interval. That of one run is from batch means over
blocks of one second of camera time, each car (for boosts per sighting each Genie) a stratum. It
covers the variability *inside* this run, with frames of one second correlated as they like; it says
nothing of other seeds or drives. Of shares it is Wilson's, with as many rows as that variability
stands for. Over several seeds it is ``tidy.across_seeds``.
"""

import logging
import math
import warnings
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from genie_sim.analysis import correctness, frame_metrics
from genie_sim.analysis.metric import Given, MethodTables, Metric, Sample, of_method
from genie_sim.analysis.registry import METRICS, MODULES, OWN, WORDS, check_words
from genie_sim.analysis.statistics import Estimate
from genie_sim.base import plugins
from genie_sim.base.errors import UserError, as_user_error, short_repr, text_of, unknown
from genie_sim.base.plugins import is_own, own_faults_told
from genie_sim.base.text import significant
from genie_sim.record.columns import Columns
from genie_sim.record.records import ANSWERS, FRAMES, HELD, LOOKUPS
from genie_sim.record.results import MethodInfo, MetricValue
from genie_sim.record.tables import Table

if TYPE_CHECKING:
    import pandas as pd

    Recorded = Columns | pd.DataFrame

log = logging.getLogger(__name__)
KINDS = tuple(dict.fromkeys(metric.kind for metric in METRICS.values()))
# The kinds of formulas that are given rows of a table, and which.
ROWS = {
    "frames": FRAMES,
    "frames of a phase": FRAMES,
    "lookups": LOOKUPS,
    "answers": ANSWERS,
    "hits": ANSWERS,
    "held": HELD,
    "held in a phase": HELD,
    "laps": HELD,
}
OF_NO_ROWS = (LookupError, ValueError, ArithmeticError)  # what a right formula may raise there


def own_metrics(names: Iterable[str]) -> dict[str, Metric]:
    """Metrics of the user's own, each ``package.module:name`` of a ``metric.Metric``. Formulas are
    tried on a table without rows, so that a wrong column is told before anything is simulated.
    Raises ``UserError``.
    """
    own: dict[str, Metric] = {}
    for name in names:
        metric = plugins.resolve("metric", name, {})
        if not isinstance(metric, Metric):
            base = f"{Metric.__module__}.{Metric.__name__}"
            raise UserError(f"metric {name!r}: is no {base}, but {short_repr(metric)}")
        if metric.kind not in KINDS:
            raise UserError(f"metric {name!r}: kind: {unknown('kind', metric.kind, KINDS)}")
        check_words(f"metric {name!r}", vars(metric))
        titles = {known.title: other for other, known in {**METRICS, **own}.items()}
        if metric.title in titles:
            text = f"title: {metric.title!r} is that of {titles[metric.title]}, too"
            raise UserError(f"metric {name!r}: {text}")
        if metric.kind in ROWS:
            try:
                with warnings.catch_warnings(action="ignore"):
                    _estimate(name, metric, Table(ROWS[metric.kind]).columns(), intervals=False)
            except UserError as error:
                if not isinstance(error.__cause__, OF_NO_ROWS):
                    raise
        own[name] = replace(metric, section=metric.section or OWN)
    return own


def with_formulas(names: Collection[str]) -> dict[str, Metric]:
    """Metrics by their names; those of the user's own with their code, where that may run."""
    known = {name: METRICS[name] for name in names if name in METRICS}
    for name in filter(is_own, names):
        with suppress(UserError):
            known |= own_metrics([name])
    return known


def words_of_code(names: Iterable[str]) -> dict[str, dict[str, Any]]:
    """What metrics of the user's own say of themselves, where their code may run."""
    own = with_formulas([*filter(is_own, names)])
    return {name: {key: getattr(metric, key) for key in WORDS} for name, metric in own.items()}


def compute(
    methods: Sequence[MethodInfo],
    tables: "Mapping[str, Recorded]",
    *,
    intervals: bool = True,
    own: Sequence[str] = (),
) -> list[MetricValue]:
    """All metrics of one run, in a fixed order.

    Numbers have ten digits: those that follow may differ between processors, which add up in
    different orders.

    Parameters
    ----------
    methods : sequence of MethodInfo
        Those that ran.
    tables : mapping of str to Columns or pandas.DataFrame
        What was recorded; the columns are those of ``record.records``.
    intervals : bool
        Whether numbers get intervals, too. Many runs, whose spread counts, need none.
    own : sequence of str
        Metrics of the user's own, ``package.module:name``. One that fails on these rows is left
        out, with a warning.
    """
    failed: set[str] = set()
    by_kind: dict[str, dict[str, Metric]] = {}
    for name, metric in {**METRICS, **own_metrics(own)}.items():
        by_kind.setdefault(metric.kind, {})[name] = metric
    columns = {name: Columns.of(table) for name, table in tables.items()}
    if "held" in columns:
        columns["held"] = correctness.of_all_cars(columns["held"], [each.name for each in methods])
    by_method = {method.name: of_method(columns, method.name) for method in methods}
    baselines = {method.name: by_method[method.name] for method in methods if method.baseline}
    measured = []
    for method in methods:
        against = {} if method.baseline else baselines
        for given in (
            *views(by_method[method.name]),
            *frame_metrics.pairs(by_method[method.name], against),
        ):
            for name, metric in by_kind.get(given.kind, {}).items():
                if name in failed:
                    continue
                try:
                    value = _value(name, metric, method.name, given, intervals=intervals)
                except UserError as error:
                    if not is_own(name):
                        raise
                    log.warning("%s; this metric of your own is left out", error)
                    failed.add(name)
                    continue
                if value is not None:
                    measured.append(value)
    return [value for value in measured if value.metric not in failed]


def _value(
    name: str, metric: Metric, method: str, given: Given, *, intervals: bool
) -> MetricValue | None:
    """A metric's number of some rows of a method. Raises ``UserError`` for whatever goes wrong in
    one of the user's own.
    """
    number = _number(name, metric, given.rows, intervals)
    if number is None:
        return None
    value = rounded(
        MetricValue(
            name,
            method,
            given.placement,
            given.component,
            unit=metric.unit_in_files,
            **number._asdict(),
        )
    )
    if is_own(name):
        with as_user_error(f"metric {name!r}", ValueError):
            value.check()
    return value


def views(tables: MethodTables) -> Iterator[Given]:
    """What formulas are given, of the tables of one method."""
    for module in MODULES:
        yield from module.views(tables)


def samples(metrics: Mapping[str, Metric], tables: MethodTables) -> dict[str, Sample]:
    """Of each metric that is made of rows those of a method as a whole."""
    of_whole: dict[str, Sample] = {}
    for given in views(tables):
        if (given.placement, given.component) == ("all", ""):
            for name, metric in metrics.items():
                sample = metric.formula(given.rows) if metric.kind == given.kind else None
                if isinstance(sample, Sample):
                    of_whole[name] = sample
    return of_whole


def _number(name: str, metric: Metric, rows: Any, intervals: bool) -> Estimate | None:
    """A metric's number. Raises ``UserError`` for whatever goes wrong in one of the user's own."""
    if not is_own(name):
        return metric.of(rows, intervals)
    number = _estimate(name, metric, rows, intervals)
    if number is None:
        return None
    return Estimate(*(_finite(name, field, end) for field, end in number._asdict().items()))


def _estimate(name: str, metric: Metric, rows: Any, intervals: bool) -> Estimate | None:
    """What a metric of the user's own makes of rows. Raises ``UserError``."""
    try:
        with own_faults_told():
            number = metric.of(rows, intervals)
    except UserError:
        raise
    except (Exception, SystemExit, GeneratorExit) as error:
        text = f"metric {name!r}: {type(error).__name__}: {short_repr(text_of(error))}"
        raise UserError(text) from error
    if not isinstance(number, Estimate | None):
        text = f"its formula must return a Sample, Estimate or None, not {short_repr(number)}"
        raise UserError(f"metric {name!r}: {text}")
    return number


def _finite(name: str, field: str, number: Any) -> Any:
    """A number of a metric of the user's own, which may be of numpy. Raises ``UserError``."""
    if number is None:
        return None
    with suppress(TypeError, ValueError, OverflowError):
        if math.isfinite(number):
            return int(number) if field == "n" else float(number)
    text = f"{field} must be a finite number, or None where it is not defined"
    raise UserError(f"metric {name!r}: {text}, not {short_repr(number)}")


def rounded(metric: MetricValue) -> MetricValue:
    """A metric with its numbers as they are written down."""
    return metric._replace(
        value=_ten(metric.value),
        low=_ten(metric.low),
        high=_ten(metric.high),
        range_low=_ten(metric.range_low),
        range_high=_ten(metric.range_high),
    )


def _ten(value: float | None) -> float | None:
    return significant(value, digits=10) if isinstance(value, float) else value
