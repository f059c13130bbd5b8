"""Compares finished runs: the methods of one, or the same methods under other settings.

Of sweeps and evaluations each setting is compared by itself. Differences are paired. With several
seeds in common, by seed, from ``statistics.MIN_SEEDS`` on with the 95 % t interval of the
differences. With one, by blocks of one second of each car inside its run (``statistics.Blocks``):
that says nothing of other seeds or drives. Settings and seeds that not all results have are left
out, so that the numbers of a row agree.
"""

import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Protocol, TypeVar

import numpy as np

from genie_sim.analysis.metric import LOWER, MAIN, Metric, Sample, half_of_pair
from genie_sim.analysis.metrics import of_method, samples
from genie_sim.analysis.registry import Words, definition, shown, with_formulas
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
SEEDS, BLOCKS = "seeds", "blocks of 1 s"
MAX_NAME = 32  # characters
OUTCOME = ("genie_sim", "devices", "plugins")  # what decides a run's outcome besides the scenario
GIVEN = "given"  # the value of a part that is in some settings alone
NO_SETTINGS = ("scenario.seed", "scenario.name", "scenario.description")


@dataclass(frozen=True)
class Arm:
    """One method under one setting: its runs by seed.

    ``setting`` is empty where there is one only. Tables and the library name an arm by ``label``,
    setting and method's name; people read ``title``, setting and method's title.
    """

    label: str
    title: str
    method: MethodInfo
    runs: Seeds
    setting: str = ""

    @property
    def seed(self) -> int | None:
        """Its one seed; ``None`` where its numbers are means over several."""
        return next(iter(self.runs)) if len(self.runs) == 1 else None


class Difference(NamedTuple):
    """A metric of an arm, what it is ``about``, and, where there is another to compare with, that
    one's value and the difference of both. ``by`` says what is paired, ``n`` how many of them, and
    ``of_seeds`` is the difference under each seed.
    """

    metric: str
    arm: str
    value: float | None
    about: Metric
    against: str = ""
    against_value: float | None = None
    difference: float | None = None
    low: float | None = None
    high: float | None = None
    by: str = ""
    n: int = 0
    of_seeds: Sequence[float] = ()

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
    ``left_out`` says which seeds are compared, where not all settings have the same. ``metrics``
    are those that were asked for, none for the usual ones.
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
        return {name: told for arm in self.arms for name, told in _any(arm.runs).words.items()}

    @property
    def by(self) -> str:
        """What the intervals are over, in words."""
        units = paired_by(self.rows)
        if units:
            return f"95 % intervals of paired differences, by {units}"
        are_paired = any(row.difference is not None for row in self.rows)
        return "paired differences without intervals" if are_paired else "nothing to compare with"


def paired_by(rows: Iterable[Difference]) -> str:
    """What the intervals of these rows are over; empty where none has any."""
    return " and ".join(sorted({row.by for row in rows if row.low is not None}))


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
    is what the others are compared with, under the same method; of one alone, the first method of
    each setting. Raises UserError for results that cannot be compared.
    """
    comparison = compared(results, methods, labels, metrics)
    if not any(row.against for row in comparison.rows):
        if metrics and not comparison.rows and len(comparison.arms) > 1:
            measured = {
                metric.metric
                for arm in comparison.arms
                for run in arm.runs.values()
                for metric in run.measured
                if metric.value is not None
            }
            if measured.intersection(metrics):
                names = ", ".join(metrics)
                raise UserError(
                    f"compare: no method as a whole has a value of {names}; see genie-sim table"
                )
            raise UserError(f"compare: {no_value(*metrics)}")
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
        sides: list[Cells] = [{"": by} for by in settings_of(runs)]
        sides += [result.cells for result in results if "" not in result.cells]
        return _compare_sides(sides, methods, labels, metrics)


def _compare_sides(
    sides: Sequence[Cells],
    methods: Sequence[str],
    labels: Sequence[str],
    metrics: Sequence[str],
) -> ComparedRuns:
    """Of each result its settings, by the names that these have in every result."""
    firsts = [_any(_any(side)) for side in sides]
    names = names_of(firsts, labels)
    cells, left_out = _common(sides, names)
    arms, references = _arms(cells, names, methods)
    unlike = _told_differently(arms)
    for metric in metrics:
        if metric in unlike:
            raise UserError(f"compare: {metric}: {unlike[metric]}, so it is not one metric")
    for metric, why in unlike.items():
        left_out += f" Without {metric}: {why}."
    rows = list(_rows(metrics or _shown(arms), arms, references))
    return ComparedRuns(arms, rows, names, _settings(firsts), left_out, metrics)


def _arms(
    cells: Mapping[str, Mapping[str, Seeds]],
    names: Sequence[str],
    methods: Sequence[str],
) -> tuple[list[Arm], dict[str, Arm]]:
    """The arms, and by an arm's label that with which it is compared, if any: a ``cell`` is a
    setting of sweeps, a ``name`` that of a result.
    """
    arms: list[Arm] = []
    references: dict[str, Arm] = {}
    for cell, by_name in cells.items():
        firsts_of_cell: dict[str, Arm] = {}  # what the others are compared with
        for name, by_seed in by_name.items():
            for method in _chosen(_any(by_seed), methods):
                place = ", ".join(filter(None, [name if len(names) > 1 else "", cell]))
                label, title = (
                    f"{place}: {text}" if place else text for text in (method.name, method.title)
                )
                arm = Arm(label, title, method, by_seed, place)
                key = method.name if len(names) > 1 else ""
                if name == names[0]:
                    firsts_of_cell.setdefault(key, arm)
                if firsts_of_cell.get(key, arm) is not arm:
                    references[label] = firsts_of_cell[key]
                arms.append(arm)
    return arms, references


def _rows(
    metrics: Iterable[str], arms: Sequence[Arm], references: Mapping[str, Arm]
) -> Iterator[Difference]:
    """Metric by metric a row of each arm that has a value."""
    samples_of = {arm.label: _samples(arm) for arm in arms}
    for metric in metrics:
        for arm in arms:
            reference = references.get(arm.label)
            row = _difference(metric, arm, reference)
            if row is not None and reference is not None and len(arm.runs) == 1:
                row = _over_blocks(row, samples_of[arm.label], samples_of[reference.label])
            if row is not None:
                yield row


def _common(
    sides: Sequence[Cells], names: Sequence[str]
) -> tuple[dict[str, dict[str, Seeds]], str]:
    """By setting and by result the runs of those seeds that all results have, and a sentence that
    says so where others are left out. Raises ``UserError`` where they have none in common.
    """
    left_out: dict[str, None] = {}
    cells: dict[str, dict[str, Seeds]] = {}
    for cell in sides[0]:
        if not all(cell in side for side in sides):
            continue
        settings = [side[cell] for side in sides]
        common = [seed for seed in settings[0] if all(seed in by for by in settings)]
        of_each = "; ".join(
            f"{name} has {seeds_text([*by])}" for name, by in zip(names, settings, strict=True)
        )
        if not common:
            raise UserError(f"compare: no seed in common: {of_each}")
        if any(len(by) > len(common) for by in settings):
            left_out[f"Only the common {seeds_text(common)}: {of_each}."] = None
        cells[cell] = {
            name: {seed: by[seed] for seed in common}
            for name, by in zip(names, settings, strict=True)
        }
    if not cells:
        of_each = "; ".join(
            f"{name} has {short_repr(', '.join(side) or 'one setting')}"
            for name, side in zip(names, sides, strict=True)
        )
        raise UserError(f"compare: no setting in common: {of_each}")
    if any(len(side) > len(cells) for side in sides):
        left_out[f"Only the {len(cells)} settings that all results have."] = None
    return cells, " ".join(left_out)


def _told_differently(arms: Sequence[Arm]) -> dict[str, str]:
    """The metrics of the user's own of which results say different things, with what they say."""
    said: dict[str, dict[str, None]] = {}
    for arm in arms:
        for name, words in _any(arm.runs).words.items():
            text = ", ".join(f"{key} {short_repr(value)}" for key, value in words.items())
            said.setdefault(name, {})[text] = None
    return {
        name: f"results say of it both {' and '.join(map(short_repr, texts))}"
        for name, texts in said.items()
        if len(texts) > 1
    }


def _shown(arms: Sequence[Arm]) -> list[str]:
    """The metrics that are compared unless the user says which."""
    unlike = _told_differently(arms)
    runs = (run for arm in arms for run in arm.runs.values())
    names = (metric.metric for run in runs for metric in run.measured)
    return shown(MAIN, (name for name in names if name not in unlike))


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
    differing = ", ".join(_differing([run.facts, other.facts]))
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


def _difference(metric: str, arm: Arm, reference: Arm | None) -> Difference | None:
    """A metric of an arm, with its difference from that of the reference, if there is one, over the
    seeds in which both have a value; ``None`` where the arm has none.
    """
    values = _values(arm, metric)
    if not values:
        return None
    about = definition(metric, _any(arm.runs).words)
    others = _values(reference, metric) if reference is not None else {}
    pairs = [(value, others[seed]) for seed, value in values.items() if seed in others]
    if reference is None or not pairs:
        return Difference(
            metric,
            arm.label,
            float(np.mean([value for value, _ in values.values()])),
            about,
            against="" if reference is None else reference.label,
        )
    ours, theirs = ([value for value, _ in side] for side in zip(*pairs, strict=True))
    value, against_value = float(np.mean(ours)), float(np.mean(theirs))
    row = Difference(
        metric,
        arm.label,
        value,
        about,
        against=reference.label,
        against_value=against_value,
        difference=value - against_value,
    )
    if len(pairs) == 1:
        return row
    of_seeds = [own - other for own, other in zip(ours, theirs, strict=True)]
    rows = min(n for pair in pairs for _, n in pair)
    low, high = about.over_seeds(*mean_and_spread(of_seeds), len(pairs), rows=rows, is_cut=False)
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


def _values(arm: Arm, metric: str) -> dict[int, tuple[float, int]]:
    """A metric's value by seed, where it is defined, and over how many rows it is."""
    of_arm: dict[int, tuple[float, int]] = {}
    for seed, run in arm.runs.items():
        for of_run in run.measured:
            place = (of_run.metric, of_run.method, of_run.placement, of_run.component)
            if place == (metric, arm.method.name, "all", "") and of_run.value is not None:
                of_arm[seed] = of_run.value, of_run.n
    return of_arm


def _settings(runs: Sequence[Run]) -> dict[str, list[str]]:
    """What differs between settings, as ``_differing``: what the user set, else what was read. The
    runs of a sweep's cell have no tables, and do not say what was read.
    """
    names = "scenario", "devices", "genie_sim"
    differing = _differing([{name: run.facts[name] for name in names} for run in runs])
    if differing or not all(run.tables for run in runs):
        return differing
    return _differing(list(map(_decisive, runs)))


def _differing(of_runs: Sequence[Mapping[str, Any]]) -> dict[str, list[str]]:
    """What differs: each path, and its value in each, ``-`` where it has none. A part that is not
    in all, such as a device, is one entry.
    """
    flat = [{path: short_repr(value) for path, value in _flat(of_run)} for of_run in of_runs]
    parts = [{part for path in of_run for part in _parts(path)} for of_run in flat]
    in_all = set.intersection(*parts)
    differing = {}
    for path in dict.fromkeys(path for values in flat for path in values):
        whole = next((part for part in _parts(path) if part not in in_all), path)
        values = [
            of_run.get(whole, of_run.get(f"{whole}.title", GIVEN) if whole in known else "-")
            for of_run, known in zip(flat, parts, strict=True)
        ]
        if len(set(values)) > 1 and path not in NO_SETTINGS:
            differing[whole] = values
    return differing


def _parts(path: str) -> list[str]:
    """What a path leads through, itself included: ``cars``, ``cars[0]``, ``cars[0].device``."""
    return [path[: match.start()] for match in re.finditer(r"(?<=.)(?=[.\[])|$", path)]


def _flat(value: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Each value that is no mapping or list, with its path: ``cars[0].device``."""
    if isinstance(value, Mapping) and value:
        for key in value:
            yield from _flat(value[key], f"{path}.{key}" if path else str(key))
    elif isinstance(value, list | tuple) and value:
        for place, element in enumerate(value):
            yield from _flat(element, f"{path}[{place}]")
    else:
        yield path, value


def as_metrics(
    comparison: ComparedRuns, names: Sequence[str] = ()
) -> tuple[list[MetricValue], list[MethodInfo]]:
    """The arms as if each were a method, for figures: means over seeds, or the run's own numbers
    with intervals. By default the numbers of arms as a whole; of ``names`` all that there are.
    """
    chosen = names or comparison.metrics or _shown(comparison.arms)
    metrics = []
    for arm in comparison.arms:
        runs = list(arm.runs.values())
        by_name: dict[str, list[MetricValue]] = {}
        for metric in runs[0].measured if len(runs) == 1 else means_of(runs):
            is_whole = (metric.placement, metric.component) == ("all", "")
            if metric.method == arm.method.name and (names or is_whole):
                by_name.setdefault(metric.metric, []).append(replace(metric, method=arm.label))
        of_arm = (metric for name in chosen for metric in by_name.get(name, ()))
        metrics += [metric for metric in of_arm if metric.value is not None]
    methods = [MethodInfo(arm.label, arm.title, arm.method.baseline) for arm in comparison.arms]
    return metrics, methods
