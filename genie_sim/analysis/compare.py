"""Compares finished runs: the methods of one, or the same methods under other settings.

Of sweeps and evaluations each setting is compared by itself. Differences are paired. With several
seeds in common, by seed, from ``statistics.MIN_SEEDS`` on with the 95 % t interval of the
differences. With one, by blocks of one second of each car inside its run (``statistics.Blocks``):
that says nothing of other seeds or drives. Settings and seeds that not all results have are left
out, so that the numbers of a row agree.

A run ``a`` beside a run ``b`` of two methods, each of seed 1, is four arms: ``a: remote`` and
``a: genie``, then ``b: remote``, which is compared with the first, and ``b: genie``, with the
second. A run alone, of ``local``, ``remote`` and ``genie``, is three: ``genie`` is compared with
that of the two baselines which is the best, metric by metric.
"""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Protocol, TypeVar

import numpy as np

from genie_sim.analysis.metric import HIGHER, LOWER, MAIN, Metric, Sample, half_of_pair, of_method
from genie_sim.analysis.metrics import samples, with_formulas
from genie_sim.analysis.registry import Words, definition, shown
from genie_sim.analysis.seed_runs import means_of, seeds_text
from genie_sim.analysis.statistics import around, mean_and_spread
from genie_sim.analysis.tidy import is_negligible
from genie_sim.base.errors import UserError, short_repr, unknown
from genie_sim.base.plugins import code_digest, is_own
from genie_sim.record import provenance
from genie_sim.record.results import MethodInfo, MetricValue, Run, checked_label

Value = TypeVar("Value")
Seeds = Mapping[int, Run]  # the runs of one setting, by seed
Cells = Mapping[str, Seeds]  # the settings of one result, by name: {"rate 0.1": {1: run, 2: run}}
Number = tuple[float, int | None]  # a value, and over how many rows it is, where known
SEEDS, BLOCKS = "seeds", "blocks (1 s of one car each) of one seed"
MAX_NAME = 32  # characters
OUTCOME = ("genie_sim", "devices", "plugins")  # what decides a run's outcome besides the scenario
MISSING = object()  # what stands for a setting that a result does not have
NO_SETTINGS = ("scenario.seed", "scenario.name", "scenario.description")


class Setting(NamedTuple):
    """The runs, by seed, of one result, which is called by this name, at one of its cells: a point
    of a sweep, or, for runs that are no sweep's, the empty text.
    """

    result: str
    cell: str
    runs: Seeds


@dataclass(frozen=True, eq=False)
class Arm:
    """One method under one setting: its runs by seed, and the arms with the best of which it is
    compared, metric by metric.

    ``setting`` is empty where there is one only.
    """

    method: MethodInfo
    runs: Seeds
    setting: str = ""
    against: "Sequence[Arm]" = ()

    @property
    def label(self) -> str:
        """What tables and the library call it: its setting and its method's name."""
        return f"{self.setting}: {self.method.name}" if self.setting else self.method.name

    @property
    def title(self) -> str:
        """What people read for it: its setting and its method's title."""
        return f"{self.setting}: {self.method.title}" if self.setting else self.method.title

    @property
    def seed(self) -> int | None:
        """Its one seed; ``None`` where its numbers are means over several."""
        return next(iter(self.runs)) if len(self.runs) == 1 else None

    @property
    def words(self) -> Words:
        """What its results say of metrics of the user's own."""
        return _any(self.runs).words


class Difference(NamedTuple):
    """A metric of an arm, what it is ``about``, and, where the arm is compared with another, that
    arm, its value and the difference of both. ``by`` says what is paired, ``n`` how many of them,
    and ``of_seeds`` is the difference under each seed.
    """

    metric: str
    arm: Arm
    value: float
    about: Metric
    against: Arm | None = None
    against_value: float | None = None
    difference: float | None = None
    low: float | None = None
    high: float | None = None
    by: str = ""
    n: int = 0
    of_seeds: Sequence[float] = ()

    @property
    def reference(self) -> str:
        """What people read for the arm with which it is compared: in its own setting the method."""
        if self.against is None:
            return ""
        is_beside = self.against.setting == self.arm.setting
        return self.against.method.title if is_beside else self.against.title

    @property
    def verdict(self) -> str:
        """``better``, ``worse``, ``different`` where neither is, ``negligible`` below 1 % of the
        value, ``equal``, ``unclear`` where the interval holds zero and more than that, or empty
        without an interval. Without one, seeds are equal or negligibly different where each is.
        """
        if self.difference is None:
            return ""
        if self.low is None or self.high is None:
            each = self.of_seeds or (self.difference,)
            if not any(each):
                return "equal"
            return "negligible" if self._are_negligible(each) else ""
        if self.low == self.high == 0:
            return "equal"
        holds_zero = self.low <= 0 <= self.high
        if self._are_negligible((self.low, self.high) if holds_zero else (self.difference,)):
            return "negligible"
        if holds_zero:
            return "unclear"
        if not self.about.better:
            return "different"
        return "better" if (self.high < 0) == (self.about.better == LOWER) else "worse"

    def _are_negligible(self, differences: Sequence[float]) -> bool:
        return all(is_negligible(value, self.against_value) for value in differences)


@dataclass(frozen=True)
class ComparedRuns:
    """What was compared: ``rows`` metric by metric, and ``settings``: the path of each that
    differs, with its value under every setting, in the order of ``names``.
    ``left_out`` says which seeds are compared, where not all settings have the same, and
    ``metrics`` which metrics are.
    """

    arms: Sequence[Arm]
    rows: Sequence[Difference]
    names: Sequence[str]
    settings: Mapping[str, Sequence[str]]
    left_out: str = ""
    metrics: Sequence[str] = ()

    @property
    def words(self) -> Words:
        """What the results say of metrics of the user's own."""
        return {name: told for arm in self.arms for name, told in arm.words.items()}

    @property
    def units(self) -> str:
        """What the intervals are over; empty where there is none."""
        return " and ".join(sorted({row.by for row in self.rows if row.low is not None}))

    @property
    def by(self) -> str:
        """The same in words."""
        if self.units:
            return f"95 % intervals of paired differences, by {self.units}"
        are_paired = any(row.difference is not None for row in self.rows)
        return "paired differences without intervals" if are_paired else "nothing to compare with"


class Comparable(Protocol):
    """What can be compared: a run, several seeds, a sweep, an evaluation."""

    @property
    def cells(self) -> Cells:
        """By its name each setting, as runs by seed; one that is all there is has no name."""


def compare(
    results: Sequence[Comparable],
    methods: Sequence[str] = (),
    labels: Sequence[str] = (),
    metrics: Sequence[str] = (),
) -> ComparedRuns:
    """Compares results, seed by seed. Runs that differ in nothing but the seed are one.

    ``methods``: which, in this order (default: all). ``labels``: what the results are called, in
    the order in which they come. ``metrics``: which, by default those of tables. The first result
    is what the others are compared with, under the same method. Of one alone, each method is
    compared, metric by metric, with the best of the baselines (``Method.baseline``) of its setting;
    with the first, if the methods are named or all are baselines or none is. Raises UserError for
    results that cannot be compared.
    """
    comparison = compared(results, methods, labels, metrics)
    if not any(row.against for row in comparison.rows):
        if metrics and not comparison.rows and len(comparison.arms) > 1:
            raise UserError(f"compare: of methods as a whole, {no_value(*metrics)}")
        raise UserError(
            "compare: nothing to compare: give two results, or one with several methods"
        )
    return comparison


def no_value(*metrics: str) -> str:
    """Says that none of these metrics has a value, and why if that can be known."""
    text = f"no method has a value of {', '.join(metrics)}"
    if any(metric.startswith("energy") for metric in metrics):
        text += ": a device without 'power' has no energy"
    return text


def compared(
    results: Sequence[Comparable],
    methods: Sequence[str] = (),
    labels: Sequence[str] = (),
    metrics: Sequence[str] = (),
) -> ComparedRuns:
    """As ``compare``, also where there is only one method of one setting."""
    runs = [run for result in results for run in result.cells.get("", {}).values()]
    folder = next((run.folder for run in runs if run.folder is not None), None)
    with provenance.of_this_version(folder):
        sides: list[Cells] = [{"": by_seed} for by_seed in settings_of(runs)]
        sides += [result.cells for result in results if "" not in result.cells]
        firsts = [_any(_any(side)) for side in sides]
        by_name = dict(zip(names_of(firsts, labels), sides, strict=True))
        common, left_out = _common(by_name)
        arms = _arms(common, methods)
        unlike = _told_differently(arms)
        for metric in metrics:
            if metric in unlike:
                raise UserError(f"compare: {metric}: {unlike[metric]}, so it is not one metric")
        for metric, why in unlike.items():
            left_out += f" Without {metric}: {why}."
        of_runs = [run.measured for arm in arms for run in arm.runs.values()]
        measured = [number.metric for of_run in of_runs for number in of_run]
        metrics = metrics or shown(MAIN, (name for name in measured if name not in unlike))
        rows = list(_rows(metrics, arms))
        return ComparedRuns(arms, rows, [*by_name], _settings(firsts), left_out, metrics)


def _common(results: Mapping[str, Cells]) -> tuple[list[Setting], str]:
    """The settings that all results have, cell by cell, with the seeds that all have there, and a
    sentence that says so where others are left out. Raises ``UserError`` where there are none.
    """

    def of_each(texts: Iterable[str]) -> str:
        return "; ".join(f"{name} has {text}" for name, text in zip(results, texts, strict=True))

    cells = [cell for cell in _any(results) if all(cell in of for of in results.values())]
    if not cells:
        names = (short_repr(", ".join(of) or "one setting") for of in results.values())
        raise UserError(f"compare: no setting in common: {of_each(names)}")
    left_out: dict[str, None] = {}
    settings: list[Setting] = []
    for cell in cells:
        runs = [of[cell] for of in results.values()]
        seeds = [seed for seed in runs[0] if all(seed in by_seed for by_seed in runs)]
        told = of_each(seeds_text([*by_seed]) for by_seed in runs)
        if not seeds:
            raise UserError(f"compare: no seed in common: {told}")
        if any(len(by_seed) > len(seeds) for by_seed in runs):
            left_out[f"Only the common {seeds_text(seeds)}: {told}."] = None
        for name, by_seed in zip(results, runs, strict=True):
            settings.append(Setting(name, cell, {seed: by_seed[seed] for seed in seeds}))
    if any(len(of) > len(cells) for of in results.values()):
        left_out[f"Only settings that all results have: {len(cells)}."] = None
    return settings, " ".join(left_out)


def _arms(settings: Sequence[Setting], methods: Sequence[str]) -> list[Arm]:
    """The arms of all settings. In a cell each is compared with that of its method in the first
    result, of one result with the best of the ``_references``; these with nothing.
    """
    arms: list[Arm] = []
    firsts: dict[str, Sequence[Arm]] = {}
    several = any(setting.result != settings[0].result for setting in settings)
    for result, cell, runs in settings:
        place = ", ".join(filter(None, [result if several else "", cell]))
        of_cell = [Arm(method, runs, place) for method in _chosen(_any(runs), methods)]
        if result == settings[0].result:
            firsts[cell] = of_cell if several else _references(of_cell, are_named=bool(methods))
        for arm in of_cell:
            name = arm.method.name
            against = [of for of in firsts[cell] if not several or of.method.name == name]
            arms.append(arm if arm in firsts[cell] else replace(arm, against=against))
    return arms


def _references(arms: Sequence[Arm], *, are_named: bool) -> Sequence[Arm]:
    """Of one setting the arms with the best of which the others are compared: the baselines; the
    first arm, if the user names the methods, or all are baselines, or none is.
    """
    baselines = [arm for arm in arms if arm.method.baseline]
    return baselines if 0 < len(baselines) < len(arms) and not are_named else arms[:1]


def _rows(metrics: Sequence[str], arms: Sequence[Arm]) -> Iterator[Difference]:
    """Metric by metric a row of each arm that has a value, over the seeds in which that with which
    it is compared has one, too.
    """
    numbers = {arm: _numbers(arm) for arm in arms}
    samples_of = {arm: _samples(arm) for arm in arms}
    for metric in metrics:
        of_metric = {arm: numbers[arm].get(metric, {}) for arm in arms}
        for arm, ours in of_metric.items():
            about = definition(metric, arm.words)
            against = _best(about, ours, {other: of_metric[other] for other in arm.against})
            theirs = of_metric[against] if against is not None else {}
            common = [seed for seed in ours if seed in theirs]
            seeds = common or [*ours]
            if not seeds:
                continue
            mean = float(np.mean([ours[seed][0] for seed in seeds]))
            row = Difference(metric, arm, mean, about, against=against)
            if against is not None and common:
                mean = float(np.mean([theirs[seed][0] for seed in seeds]))
                row = row._replace(against_value=mean, difference=row.value - mean)
                if len(arm.runs) == 1:
                    row = _over_blocks(row, samples_of[arm], samples_of[against])
                elif len(seeds) > 1:
                    row = _over_seeds(row, [(ours[seed], theirs[seed]) for seed in seeds])
            yield row


def _best(
    about: Metric, ours: Mapping[int, Number], others: Mapping[Arm, Mapping[int, Number]]
) -> Arm | None:
    """Of the other arms that with the best mean over our seeds; the first where neither is better
    or none has a value.
    """
    means = {
        arm: np.mean([value for seed, (value, _) in theirs.items() if seed in ours])
        for arm, theirs in others.items()
        if ours.keys() & theirs
    }
    sign = {LOWER: 1, HIGHER: -1}.get(about.better, 0)
    return min(means or others, key=lambda arm: sign * means.get(arm, 0), default=None)


def _told_differently(arms: Sequence[Arm]) -> dict[str, str]:
    """The metrics of the user's own of which results say different things, with what they say."""
    said: dict[str, dict[str, None]] = {}
    for arm in arms:
        for name, words in arm.words.items():
            text = ", ".join(f"{key} {short_repr(value)}" for key, value in words.items())
            said.setdefault(name, {})[text] = None
    return {
        name: f"results say of it both {' and '.join(map(short_repr, texts))}"
        for name, texts in said.items()
        if len(texts) > 1
    }


def _any(values: Mapping[Any, Value]) -> Value:
    """The first of them."""
    return next(iter(values.values()))


def _chosen(run: Run, names: Sequence[str]) -> list[MethodInfo]:
    methods = {method.name: method for method in run.methods}
    for name in names:
        if name not in methods:
            raise UserError(f"compare: {run.name}-{run.run_id}: {unknown('method', name, methods)}")
    return [methods[name] for name in names] or list(methods.values())


def settings_of(runs: Sequence[Run]) -> list[dict[int, Run]]:
    """Of each setting its runs by seed."""
    settings: dict[str, dict[int, Run]] = {}
    for run in runs:
        by_seed = settings.setdefault(json.dumps(_decisive(run), sort_keys=True), {})
        if run.seed in by_seed:
            why = _alike(run, by_seed[run.seed])
            raise UserError(f"compare: {run.name}-{run.run_id}: {why}")
        by_seed[run.seed] = run
    return list(settings.values())


def _decisive(run: Run) -> dict[str, Any]:
    """What decides a run's outcome besides the seed, without digests that the seed may decide."""
    scenario = {name: value for name, value in run.facts["scenario"].items() if name != "seed"}
    is_recorded = scenario["perception"]["source"] == "recorded"
    traces = {
        name: digest
        for name, digest in run.facts["traces"].items()
        if is_recorded or name.startswith("link ")
    }
    others = {name: run.facts[name] for name in OUTCOME}
    return {"scenario": scenario, "traces": traces, "laws": run.facts.get("laws"), **others}


def _alike(run: Run, other: Run) -> str:
    """Why a run is not compared with another of its setting and seed."""
    if run.run_id == other.run_id:
        return "the same run is given twice"
    differing = ", ".join(dict(_differing([run.facts, other.facts])))
    return f"differs from {other.run_id}, of the same setting and seed, in {differing}"


def names_of(runs: Sequence[Run], labels: Sequence[str]) -> list[str]:
    """What settings are called, of each of which this is a run: as the user says, with ``labels``
    or with that of each run, else by themselves. Raises UserError for labels that do not tell them
    apart.
    """
    if labels and len(labels) != len(runs):
        raise UserError(f"compare: {len(labels)} labels for {len(runs)} settings")
    given = [checked_label(label) for label in labels] or [run.label for run in runs]
    unlabelled = [run for run, label in zip(runs, given, strict=True) if not label]
    by_content = iter(_names_by_content(unlabelled))
    names = [label or next(by_content) for label in given]
    if len(set(names)) < len(names):
        raise UserError(f"compare: two settings have the same label: {', '.join(names)}")
    return names


def _names_by_content(runs: Sequence[Run]) -> list[str]:
    """What they are called by themselves: by their scenarios, else by the settings that differ, if
    these are short, else by the runs' ids.
    """
    names = [run.name for run in runs]
    if len(set(names)) == len(names):
        return names
    labels: list[list[str]] = [[] for _ in runs]
    for path, values in _settings(runs).items():
        if path.startswith("scenario."):
            field = path.rpartition(".")[2]
            for label, value in zip(labels, values, strict=True):
                label.append(f"{field} {value}".replace("'", ""))
    texts = [", ".join(label) for label in labels]
    told_apart = len(set(texts)) == len(texts) and len(set(names)) == 1
    if told_apart and max(map(len, texts)) <= MAX_NAME:
        return texts
    return [f"{run.name}-{run.run_id[:6]}" for run in runs]


def _over_seeds(row: Difference, pairs: Sequence[tuple[Number, Number]]) -> Difference:
    """The row with its interval over seeds, of each of which there are the numbers of both."""
    of_seeds = [own - other for (own, _), (other, _) in pairs]
    fewest = min((n for pair in pairs for _, n in pair if n is not None), default=None)
    low, high = row.about.over_seeds(
        *mean_and_spread(of_seeds), len(pairs), rows=fewest, is_cut=False
    )
    return row._replace(low=low, high=high, by=SEEDS, n=len(pairs), of_seeds=of_seeds)


def _over_blocks(
    row: Difference, ours: Mapping[str, Sample], theirs: Mapping[str, Sample]
) -> Difference:
    """The row with its interval inside one run, where the metric is a ratio of sums over rows."""
    samples = [of_side[row.metric] for of_side in (ours, theirs) if row.metric in of_side]
    if row.difference is None or len(samples) < 2 or any(sample.percent for sample in samples):
        return row
    half, n = half_of_pair(samples)
    low, high = around(row.difference, half)
    return row._replace(low=low, high=high, by=BLOCKS, n=n)


def _samples(arm: Arm) -> dict[str, Sample]:
    """Of each metric that is made of rows those of an arm with one run."""
    run = _any(arm.runs)
    if len(arm.runs) > 1 or not run.tables:
        return {}
    names = {metric.metric for metric in run.measured if _has_its_formula(run, metric.metric)}
    return samples(with_formulas(names), of_method(run.tables, arm.method.name))


def _has_its_formula(run: Run, metric: str) -> bool:
    """Whether a metric's formula is that of the run: one of the user's own may have changed since,
    and its interval would be that of another number.
    """
    if not is_own(metric):
        return True
    with suppress(UserError):
        digest: str | None = run.facts["plugins"].get(f"metric {metric}")
        return code_digest("metric", metric) == digest
    return False


def _numbers(arm: Arm) -> dict[str, dict[int, Number]]:
    """Of each metric the numbers of the arm's method as a whole, by seed, where it is defined."""
    numbers: dict[str, dict[int, Number]] = {}
    for seed, run in arm.runs.items():
        for number in run.measured:
            place = number.method, number.placement, number.component
            if place == (arm.method.name, "all", "") and number.value is not None:
                numbers.setdefault(number.metric, {})[seed] = number.value, number.n
    return numbers


def _settings(runs: Sequence[Run]) -> dict[str, list[str]]:
    """What differs between settings, as ``_differing``: what the user set, else what was read. The
    runs of a sweep's cell have no tables, and do not say what was read.
    """
    names = "scenario", "devices", "genie_sim"
    differing = dict(_differing([{name: run.facts[name] for name in names} for run in runs]))
    if differing or not all(run.tables for run in runs):
        return differing
    return dict(_differing(list(map(_decisive, runs))))


def _differing(values: Sequence[Any], path: str = "") -> Iterator[tuple[str, list[str]]]:
    """Each path, such as ``cars[0].device``, at which these differ, and the text of each there. A
    part that not all have, such as a device, is one path.
    """
    if path in NO_SETTINGS:
        return
    if all(isinstance(value, Mapping) for value in values):
        for key in dict.fromkeys(key for value in values for key in value):
            inner = [value.get(key, MISSING) for value in values]
            yield from _differing(inner, f"{path}.{key}" if path else str(key))
    elif all(isinstance(value, list | tuple) for value in values):
        for place in range(max(map(len, values))):
            inner = [value[place] if place < len(value) else MISSING for value in values]
            yield from _differing(inner, f"{path}[{place}]")
    elif any(value != values[0] for value in values):
        yield path, list(map(_text, values))


def _text(value: Any) -> str:
    """A setting, ``-`` where there is none; a part with several by its title, if it has one."""
    if value is MISSING:
        return "-"
    if isinstance(value, Mapping) and "title" in value:
        return short_repr(value["title"])
    return short_repr(value)


def as_metrics(
    comparison: ComparedRuns, names: Sequence[str] = ()
) -> tuple[list[MetricValue], list[MethodInfo]]:
    """The arms as if each were a method, for figures: means over seeds, or the run's own numbers
    with intervals. By default the numbers of arms as a whole; of ``names`` all that there are.
    """
    metrics = []
    for arm in comparison.arms:
        runs = list(arm.runs.values())
        by_name: dict[str, list[MetricValue]] = {}
        for metric in runs[0].measured if len(runs) == 1 else means_of(runs):
            is_whole = (metric.placement, metric.component) == ("all", "")
            if metric.method == arm.method.name and (names or is_whole):
                by_name.setdefault(metric.metric, []).append(metric._replace(method=arm.label))
        of_arm = (
            metric for name in names or comparison.metrics for metric in by_name.get(name, ())
        )
        metrics += [metric for metric in of_arm if metric.value is not None]
    methods = [MethodInfo(arm.label, arm.title, arm.method.baseline) for arm in comparison.arms]
    return metrics, methods
