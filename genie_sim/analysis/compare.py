"""Compares finished runs: the methods of one, or the same methods under other settings.

Differences are paired. With at least two seeds in common, by seed: the 95 % t interval of the
differences. With one, by blocks of one second of each car inside its run (``statistics.Blocks``):
that says nothing of other seeds or drives. Runs that saw other frames, such as those of other cars,
have nothing to pair: the interval is Welch's, over seeds or over blocks.
"""

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from genie_sim.analysis.metric import MAIN, Sample, blocks_of, half_of_pair
from genie_sim.analysis.metrics import of_method, samples
from genie_sim.analysis.registry import definition, shown, with_formulas
from genie_sim.analysis.seed_runs import SeedRuns
from genie_sim.analysis.statistics import (
    around,
    error_of_mean,
    of_difference,
    over_seeds,
    wilson,
)
from genie_sim.base.errors import UserError, short_repr, unknown
from genie_sim.record import provenance
from genie_sim.record.results import MethodInfo, MetricValue, Run, checked_label

SEEDS, BLOCKS = "seeds", "blocks of 1 s"
UNPAIRED = ", unpaired"  # after them
MAX_NAME = 32  # characters
OUTCOME = ("genie_sim", "devices", "plugins")  # what decides a run's outcome besides the scenario
GIVEN = "given"  # the value of a part that is in some settings alone
NO_SETTINGS = ("scenario.seed", "scenario.name", "scenario.description")


@dataclass(frozen=True)
class ComparedMethod:
    """One method under one setting: its runs by seed.

    Tables and the library name it by ``label``, which ends with the method's name; people read
    ``title``, which ends with the method's title.
    """

    label: str
    title: str
    method: MethodInfo
    runs: Mapping[int, Run]


class Difference(NamedTuple):
    """A metric of an arm and, where there is another to compare with, its value minus that one's.
    ``by`` says what the interval is over, ``n`` over how many.

    Of sides that are not paired ``by`` ends with ``UNPAIRED``, and ``n`` is that of the smaller
    one. ``variance_ratio``, over seeds: the variance of the paired differences, divided by the sum
    of both variances. 1: common random numbers gain nothing; 0.25: an interval half as wide.
    """

    metric: str
    arm: str
    value: float | None
    unit: str
    against: str = ""
    difference: float | None = None
    low: float | None = None
    high: float | None = None
    by: str = ""
    n: int = 0
    variance_ratio: float | None = None


@dataclass(frozen=True)
class ComparedRuns:
    """What was compared: ``rows`` metric by metric, and ``settings``: the path of each that
    differs, with its value under every setting, in the order of ``names``.
    ``warning`` says which files of the runs were changed; empty if none was. ``unpaired``: which
    arms are not paired with what they are compared with, and why. ``metrics`` are those that were
    asked for, none for the usual ones.
    """

    arms: Sequence[ComparedMethod]
    rows: Sequence[Difference]
    names: Sequence[str]
    settings: Mapping[str, Sequence[str]]
    warning: str = ""
    unpaired: Mapping[str, str] = field(default_factory=dict)
    metrics: Sequence[str] = ()

    @property
    def by(self) -> str:
        """What the intervals are over, in words."""
        units = sorted({row.by for row in self.rows if row.by})
        if not units:
            return "nothing to compare with"
        paired = "" if self.unpaired else "paired "
        return f"95 % intervals of {paired}differences, by {' and '.join(units)}"

    @property
    def why_unpaired(self) -> str:
        """A sentence that says what is not paired, and why; empty if all is."""
        if not self.unpaired:
            return ""
        reasons = "; ".join(dict.fromkeys(self.unpaired.values()))
        return f"Not paired, with Welch's interval, since both sides saw other frames: {reasons}."


def compare(
    runs: Sequence[Run | SeedRuns],
    methods: Sequence[str] = (),
    labels: Sequence[str] = (),
    metrics: Sequence[str] = (),
) -> ComparedRuns:
    """Compares runs, paired where they saw the same frames. Runs that differ in nothing but the
    seed are one setting.

    ``methods``: which, in this order (default: all). ``labels``: what the settings are called, in
    the order in which they come. ``metrics``: which, by default those of tables. The first setting
    is what the others are compared with, under the same method; of one setting alone, the first
    method. Raises UserError for runs that cannot be compared.
    """
    comparison = compared(runs, methods, labels, metrics)
    if not any(row.against for row in comparison.rows):
        if metrics and not comparison.rows and len(comparison.arms) > 1:
            measured = {
                metric.metric for run in runs for metric in run.measured if metric.value is not None
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
    results: Sequence[Run | SeedRuns],
    methods: Sequence[str] = (),
    labels: Sequence[str] = (),
    metrics: Sequence[str] = (),
) -> ComparedRuns:
    """As ``compare``, also where there is only one method of one setting."""
    runs = [run for result in results for run in result.runs]
    folder = next((run.folder for run in runs if run.folder is not None), None)
    with provenance.of_this_version(folder):
        return _compared(runs, methods, labels, metrics)


def _compared(
    runs: Sequence[Run], methods: Sequence[str], labels: Sequence[str], metrics: Sequence[str]
) -> ComparedRuns:
    settings = settings_of(runs)
    names = names_of(settings, labels)
    arms: list[ComparedMethod] = []
    references: dict[str, ComparedMethod] = {}  # by the label of the arm that is compared with it
    unpaired: dict[str, str] = {}
    for place, (name, by_seed) in enumerate(zip(names, settings, strict=True)):
        for method in _chosen(_any(by_seed), methods):
            label, title = method.name, method.title
            if len(settings) > 1:
                label, title = f"{name}: {label}", f"{name}: {title}"
            arm = ComparedMethod(label, title, method, by_seed)
            reference = _reference(arm, arms, place, len(settings))
            if reference is not None:
                why = _unpaired(reference, arm)
                if why:
                    unpaired[label] = f"{names[0]} and {name}: {why}"
                references[label] = reference
            arms.append(arm)
    rows = []
    for metric in metrics or _shown(arms):
        for arm in arms:
            row = _difference(metric, arm, references.get(arm.label), arm.label not in unpaired)
            if row is not None:
                rows.append(row)
    warning = " ".join(f"{run.name}-{run.run_id}: {run.warning}." for run in runs if run.changed)
    differing = _settings([_any(by_seed) for by_seed in settings])
    return ComparedRuns(arms, rows, names, differing, warning, unpaired, metrics)


def _shown(arms: Sequence[ComparedMethod]) -> list[str]:
    """The metrics that are compared unless the user says which."""
    return shown(
        MAIN,
        (metric.metric for arm in arms for run in arm.runs.values() for metric in run.measured),
    )


def _any(by_seed: Mapping[int, Run]) -> Run:
    """The first run of a setting."""
    return next(iter(by_seed.values()))


def _reference(
    arm: ComparedMethod, arms: Sequence[ComparedMethod], place: int, settings: int
) -> ComparedMethod | None:
    """What an arm of the setting at ``place`` is compared with: an earlier one of ``arms``."""
    if settings == 1:
        return arms[0] if arms else None
    if place == 0:
        return None
    of_first = [other for other in arms if other.runs is arms[0].runs]
    return next((other for other in of_first if other.method.name == arm.method.name), None)


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
        scenario = dict(run.facts["scenario"])
        del scenario["seed"]
        decisive = {"scenario": scenario, **{name: run.facts[name] for name in OUTCOME}}
        by_seed = settings.setdefault(json.dumps(decisive, sort_keys=True), {})
        if run.seed in by_seed:
            raise UserError(f"compare: {run.name}-{run.run_id}: the same run is given twice")
        by_seed[run.seed] = run
    return list(settings.values())


def names_of(settings: Sequence[Mapping[int, Run]], labels: Sequence[str]) -> list[str]:
    """What the settings are called: as the user says, with ``labels`` or with that of each run,
    else by themselves. Raises UserError for labels that do not tell them apart.
    """
    if labels and len(labels) != len(settings):
        raise UserError(f"compare: {len(labels)} labels for {len(settings)} settings")
    own_labels = [_any(by_seed).label for by_seed in settings]
    given = [checked_label(label) for label in labels] or own_labels
    names = [label or name for label, name in zip(given, _names_by_content(settings), strict=True)]
    if len(set(names)) < len(names):
        raise UserError(f"compare: two settings have the same label: {', '.join(names)}")
    return names


def _names_by_content(settings: Sequence[Mapping[int, Run]]) -> list[str]:
    """What the settings are called by themselves: by their scenarios, else by the settings that
    differ, if these are short, else by the runs' ids.
    """
    runs = [_any(by_seed) for by_seed in settings]
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


def _common_seeds(arm: ComparedMethod, other: ComparedMethod) -> list[int]:
    return [seed for seed in arm.runs if seed in other.runs]


def _unpaired(reference: ComparedMethod, arm: ComparedMethod) -> str:
    """Why the frames of the two cannot be paired; empty where both saw the same. Raises UserError
    for arms without a seed in common.
    """
    seeds = _common_seeds(arm, reference)
    if not seeds:
        of_each = [", ".join(map(str, sorted(side.runs))) for side in (reference, arm)]
        raise UserError(
            f"compare: {reference.label} and {arm.label} have no seed in common: "
            f"{' and '.join(of_each)}"
        )
    for seed in seeds:
        run, other = arm.runs[seed], reference.runs[seed]
        drives, others = run.facts["traces"], other.facts["traces"]
        if drives != others:
            cars = sorted({*drives, *others})
            differing = [car for car in cars if drives.get(car) != others.get(car)]
            return f"other drives ({', '.join(differing[:3])})"
        frames, others = _frames(run, arm.method), _frames(other, reference.method)
        if frames != others:
            return (
                f"other frames ({len(others):,} and {len(frames):,}): other cars, cameras or times"
            )
    return ""


def _frames(run: Run, method: MethodInfo) -> set[tuple[str, str, int]]:
    """The frames that a method saw: car, stream and stamp of each."""
    rows = run.tables["frames"].where(method=method.name)
    columns = (rows[name].tolist() for name in ("car", "stream", "stamp_ns"))
    return set(zip(*columns, strict=True))


def _difference(
    metric: str, arm: ComparedMethod, reference: ComparedMethod | None, is_paired: bool
) -> Difference | None:
    """A metric of an arm, with its difference from that of the reference, if there is one; ``None``
    where the arm has no value.
    """
    values = _values(arm, metric)
    if not values:
        return None
    mean = float(np.mean(list(values.values())))
    alone = Difference(metric, arm.label, mean, definition(metric).unit_in_files)
    if reference is None:
        return alone
    others = _values(reference, metric)
    pairs = [(values[seed], others[seed]) for seed in values if seed in others]
    against = alone._replace(against=reference.label)
    if not is_paired and min(len(values), len(others)) > 1:
        gap = mean - float(np.mean(list(others.values())))
        error = of_difference(*(error_of_mean(list(side.values())) for side in (values, others)))
        low, high = around(gap, error.half)
        n = min(len(values), len(others))
        return against._replace(difference=gap, low=low, high=high, by=SEEDS + UNPAIRED, n=n)
    if is_paired and len(pairs) > 1:
        gap, half = over_seeds([own - other for own, other in pairs])
        low, high = around(gap, half)
        ratio = _variance_ratio(pairs)
        return against._replace(
            difference=gap, low=low, high=high, by=SEEDS, n=len(pairs), variance_ratio=ratio
        )
    if not pairs:
        return against
    gap = pairs[0][0] - pairs[0][1]
    seed = _common_seeds(arm, reference)[0]
    sides = [_samples(side.runs[seed], side.method.name) for side in (arm, reference)]
    samples = [of_side[metric] for of_side in sides if metric in of_side]
    if len(samples) < len(sides) or any(sample.percent for sample in samples):
        return against._replace(difference=gap)
    half_of_blocks, n = (half_of_pair if is_paired else _half_apart)(samples)
    low, high = around(gap, half_of_blocks)
    by = BLOCKS if is_paired else BLOCKS + UNPAIRED
    return against._replace(difference=gap, low=low, high=high, by=by, n=n)


@lru_cache(maxsize=16)
def _samples(run: Run, method: str) -> dict[str, Sample]:
    """Of each metric that is made of rows those of one method of a run."""
    names = {metric.metric for metric in run.measured}
    return samples(with_formulas(names), of_method(run.tables, method))


def _values(arm: ComparedMethod, metric: str) -> dict[int, float]:
    """A metric's value by seed, where it is defined."""
    of_arm: dict[int, float] = {}
    for seed, run in arm.runs.items():
        for of_run in run.measured:
            place = (of_run.metric, of_run.method, of_run.placement, of_run.component)
            if place == (metric, arm.method.name, "all", "") and of_run.value is not None:
                of_arm[seed] = of_run.value
    return of_arm


def _variance_ratio(pairs: Sequence[tuple[float, float]]) -> float | None:
    """What pairing leaves of the variance of a difference; ``None`` where nothing varies."""
    own, other = np.array(pairs).T
    unpaired = float(np.var(own) + np.var(other))
    return float(np.var(own - other)) / unpaired if unpaired else None


def _half_apart(samples: Sequence[Sample]) -> tuple[float | None, int]:
    """``half_of_pair`` of sides that nothing pairs; the number is that of the smaller one."""
    errors, sizes = [], []
    for sample in samples:
        blocks = blocks_of(sample.rows)
        moves = blocks.influence(*sample.terms)
        errors.append(blocks.error(moves))
        sizes.append(len(moves))
    one, other = errors
    half = None if one is None or other is None else of_difference(one, other).half
    return half, min(sizes)


def _settings(runs: Sequence[Run]) -> dict[str, list[str]]:
    """What differs between settings: each path, and its value in each, ``-`` where it has none. A
    part that is not in every setting, such as a device, is one entry.
    """
    flat = []
    for run in runs:
        decisive = {name: run.facts[name] for name in ("scenario", "devices", "genie_sim")}
        flat.append({path: short_repr(value) for path, value in _flat(decisive)})
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


def as_metrics(comparison: ComparedRuns) -> tuple[list[MetricValue], list[MethodInfo]]:
    """The arms as if each were a method, for figures: means over seeds, or the run's own numbers
    with intervals.
    """
    metrics = []
    for arm in comparison.arms:
        for name in comparison.metrics or _shown(comparison.arms):
            of_runs = _metrics_of(arm, name)
            if len(of_runs) == 1:
                metrics.append(replace(of_runs[0], method=arm.label))
            elif of_runs:
                values = [metric.value for metric in of_runs if metric.value is not None]
                mean, half = over_seeds(values)
                low, high = (
                    wilson(mean, half) if definition(name).unit == "%" else around(mean, half)
                )
                metrics.append(
                    replace(of_runs[0], method=arm.label, value=mean, low=low, high=high)
                )
    methods = [MethodInfo(arm.label, arm.title, arm.method.baseline) for arm in comparison.arms]
    return metrics, methods


def _metrics_of(arm: ComparedMethod, name: str) -> list[MetricValue]:
    """One of its metrics in each of an arm's runs, where it is defined."""
    place = (name, arm.method.name, "all", "")
    return [
        metric
        for run in arm.runs.values()
        for metric in run.measured
        if (metric.metric, metric.method, metric.placement, metric.component) == place
        and metric.value is not None
    ]
