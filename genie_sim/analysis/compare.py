"""Compares finished runs: the methods of one, or the same methods under other settings.

Differences are paired. With at least two seeds in common, by seed: the 95 % t interval of the differences. With one, by
blocks of one second of each car inside its run (``statistics.Blocks``): that says nothing of other seeds or drives.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from genie_sim.analysis.correctness import HELD, Parts
from genie_sim.analysis.metrics import DEADLINE_MS, response_ms
from genie_sim.analysis.statistics import Blocks, around, over_seeds, wilson
from genie_sim.errors import UserError, short_repr, unknown
from genie_sim.recording.columns import Columns, Floats, Text, joined
from genie_sim.recording.results import MethodInfo, Metric, Run

SEEDS, BLOCKS = "seeds", "blocks of 1 s"
SHORT_NAME = 32  # characters


class Sums(NamedTuple):
    """A metric as a ratio of sums over rows: of which car, when, above and below."""

    car: Text
    stamp_ns: Any
    above: Floats
    below: Floats

    @property
    def value(self) -> float | None:
        below = float(self.below.sum())
        return float(self.above.sum()) / below if below else None


def _times(rows: Columns, answer: str) -> tuple[Floats, Any]:
    """The mean time of an answer, as sums."""
    times = response_ms(rows, answer)
    return np.nan_to_num(times), ~np.isnan(times)


def _agree(rows: Columns) -> tuple[Floats, Floats]:
    """F1 against the detector's own answers, as sums."""
    served, detected, matched = map(rows.floats, ("served", "detected", "matched"))
    return 2 * matched, served + detected


class Compared(NamedTuple):
    """A metric that is compared: its unit, its ratio, and over which rows of which table."""

    unit: str
    parts: Parts
    table: str = "frames"
    rows: Mapping[str, str] = {}


COMPARED: Mapping[str, Compared] = {
    "first_answer_mean": Compared("ms", lambda rows: _times(rows, "first")),
    "fresh_answer_mean": Compared("ms", lambda rows: _times(rows, "fresh")),
    "answered_share": Compared(
        "1", lambda rows: (~np.isnan(rows.floats("first_answer_ns")), np.ones(len(rows)))
    ),
    "under_deadline_share": Compared(
        "1", lambda rows: (response_ms(rows, "first") < DEADLINE_MS, np.ones(len(rows)))
    ),
    **{
        f"{which}_proxy_f1": Compared("1", _agree, "answers", {"which": which})
        for which in ("first", "fresh")
    },
    **{
        name: Compared(*HELD[name], "held", {"what": "consumer"})
        for name in ("streaming_f1", "object_recall", "ghost_share", "gospa")
    },
}


def _sums(metric: str, run: Run, method: MethodInfo) -> Sums:
    """A metric's sums in one run under one method."""
    _, parts, table, of = COMPARED[metric]
    rows = run.tables[table].where(method=method.name, **of)
    above, below = (np.asarray(part, dtype=float) for part in parts(rows))
    return Sums(rows["car"], rows["stamp_ns"], above, below)


@dataclass(frozen=True)
class Arm:
    """One method under one setting: its runs by seed."""

    label: str
    method: MethodInfo
    runs: Mapping[int, Run]


class Difference(NamedTuple):
    """A metric of an arm and, where there is another to compare with, its value minus that one's. ``by`` says what the
    interval is over, ``n`` over how many."""

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


@dataclass(frozen=True)
class Comparison:
    """What was compared: ``rows`` metric by metric, and ``settings``: the path of each that differs, with its value
    under every setting, in the order of ``names``."""

    arms: Sequence[Arm]
    rows: Sequence[Difference]
    names: Sequence[str]
    settings: Mapping[str, Sequence[str]]

    @property
    def by(self) -> str:
        """What the intervals are over, in words."""
        found = sorted({row.by for row in self.rows if row.by})
        return (
            f"95 % intervals of paired differences, by {' and '.join(found)}"
            if found
            else "nothing to compare with"
        )


def compare(runs: Sequence[Run], methods: Sequence[str] = ()) -> Comparison:
    """Compares runs that saw the same frames. Runs that differ in nothing but the seed are one setting.

    ``methods``: which, in this order (default: all). The first setting is what the others are compared with, under the
    same method; of one setting alone, the first method. Raises UserError for runs that cannot be compared.
    """
    groups = _groups(runs)
    names = _names(groups)
    arms: list[Arm] = []
    against: dict[str, Arm] = {}
    for place, group in enumerate(groups):
        chosen = _chosen(next(iter(group.values())), methods)
        for method in chosen:
            label = method.name if len(groups) == 1 else f"{names[place]}: {method.name}"
            arm = Arm(label, method, group)
            same = [
                one
                for one in arms
                if one.runs is groups[0] and (place == 0 or one.method.name == method.name)
            ]
            if same and (place or len(groups) == 1):
                _check(same[0], arm)
                against[label] = same[0]
            arms.append(arm)
    if not against:
        raise UserError(
            "compare: nothing to compare: give two results, or one with several methods"
        )
    rows = [
        row
        for name in COMPARED
        for arm in arms
        if (row := _difference(name, arm, against.get(arm.label)))
    ]
    return Comparison(
        arms, rows, names, _settings([next(iter(group.values())) for group in groups])
    )


def _chosen(run: Run, names: Sequence[str]) -> list[MethodInfo]:
    known = {method.name: method for method in run.methods}
    for name in names:
        if name not in known:
            raise UserError(f"compare: {run.name}-{run.run_id}: {unknown('method', name, known)}")
    return [known[name] for name in names] or list(known.values())


def _groups(runs: Sequence[Run]) -> list[dict[int, Run]]:
    """Runs by seed, of each setting."""
    groups: dict[str, dict[int, Run]] = {}
    for run in runs:
        seed = run.facts["scenario"]["seed"]
        setting = {name: value for name, value in run.facts["scenario"].items() if name != "seed"}
        setting = {
            "scenario": setting,
            **{name: run.facts[name] for name in ("genie_sim", "devices", "plugins")},
        }
        group = groups.setdefault(json.dumps(setting, sort_keys=True), {})
        if seed in group:
            raise UserError(f"compare: {run.name}-{run.run_id}: the same run is given twice")
        group[seed] = run
    return list(groups.values())


def _names(groups: Sequence[Mapping[int, Run]]) -> list[str]:
    """What the settings are called: by their scenarios, else by the settings that differ, if these are short, else by
    the runs' ids."""
    first = [next(iter(group.values())) for group in groups]
    names = [run.name for run in first]
    if len(set(names)) == len(names):
        return names
    differ = {
        path: values for path, values in _settings(first).items() if path.startswith("scenario.")
    }
    named = [
        [f"{path.rpartition('.')[2]} {value}" for value in values]
        for path, values in differ.items()
    ]
    told = [", ".join(one).replace("'", "") for one in zip(*named, strict=True)]
    if (
        told
        and len(set(names)) == 1
        and len(set(told)) == len(told)
        and max(map(len, told)) <= SHORT_NAME
    ):
        return told
    return [f"{run.name}-{run.run_id[:6]}" for run in first]


def _paired(arm: Arm, other: Arm) -> list[int]:
    """The seeds that both have."""
    return [seed for seed in arm.runs if seed in other.runs]


def _check(other: Arm, arm: Arm) -> None:
    """Raises UserError unless both saw the same frames."""
    if not _paired(arm, other):
        seeds = (", ".join(map(str, sorted(one.runs))) for one in (other, arm))
        raise UserError(
            f"compare: {other.label} and {arm.label} have no seed in common: {' and '.join(seeds)}"
        )
    for mine, theirs in [(arm.runs[seed], other.runs[seed]) for seed in _paired(arm, other)]:
        what = f"compare: {other.label} ({theirs.run_id}) and {arm.label} ({mine.run_id}) cannot be compared"
        drives = [one.facts["traces"] for one in (theirs, mine)]
        if drives[0] != drives[1]:
            names = sorted(
                name
                for name in {**drives[0], **drives[1]}
                if drives[0].get(name) != drives[1].get(name)
            )
            raise UserError(f"{what}: other drives ({', '.join(names[:3])})")
        frames = [
            set(
                zip(
                    rows["car"].tolist(),
                    rows["stream"].tolist(),
                    rows["stamp_ns"].tolist(),
                    strict=True,
                )
            )
            for run, method in ((theirs, other.method), (mine, arm.method))
            for rows in [run.tables["frames"].where(method=method.name)]
        ]
        if frames[0] != frames[1]:
            raise UserError(
                f"{what}: other frames ({len(frames[0]):,} and {len(frames[1]):,}): other cars or cameras"
            )


def _difference(metric: str, arm: Arm, other: Arm | None) -> Difference | None:
    values = {seed: _sums(metric, run, arm.method).value for seed, run in arm.runs.items()}
    known = [value for value in values.values() if value is not None]
    if not known:
        return None
    alone = Difference(metric, arm.label, float(np.mean(known)), COMPARED[metric].unit)
    if other is None:
        return alone
    theirs = {seed: _sums(metric, run, other.method).value for seed, run in other.runs.items()}
    gaps = [
        mine - reference
        for seed in _paired(arm, other)
        if (mine := values[seed]) is not None and (reference := theirs[seed]) is not None
    ]
    by, n, half = SEEDS, len(gaps), None
    if n > 1:
        gap, half = over_seeds(gaps)
    else:
        seed = _paired(arm, other)[0]
        ours, its = (
            _sums(metric, arm.runs[seed], arm.method),
            _sums(metric, other.runs[seed], other.method),
        )
        if ours.value is None or its.value is None:
            return alone._replace(against=other.label)
        by, gap = BLOCKS, ours.value - its.value
        half, n = _over_blocks(ours, its)
    low, high = around(gap, half)
    return alone._replace(against=other.label, difference=gap, low=low, high=high, by=by, n=n)


def _over_blocks(mine: Sums, theirs: Sums) -> tuple[float | None, int]:
    """Half the interval of the difference of two ratios, and the number of blocks."""
    blocks = Blocks(
        joined([mine.car, theirs.car]), np.concatenate([mine.stamp_ns, theirs.stamp_ns])
    )
    none = [np.zeros(len(theirs.above)), np.zeros(len(mine.above))]
    ours = blocks.influence(*(np.concatenate([part, none[0]]) for part in (mine.above, mine.below)))
    other = blocks.influence(
        *(np.concatenate([none[1], part]) for part in (theirs.above, theirs.below))
    )
    return blocks.half_width(ours - other), len(ours)


def _settings(runs: Sequence[Run]) -> dict[str, list[str]]:
    """What differs between settings: each path, and its value in each, ``-`` where it is not there."""
    flat = [
        dict(_flat({key: run.facts[key] for key in ("scenario", "devices", "genie_sim")}))
        for run in runs
    ]
    paths = dict.fromkeys(path for one in flat for path in one)
    found = {
        path: [short_repr(one[path]) if path in one else "-" for one in flat] for path in paths
    }
    skipped = ("scenario.seed", "scenario.name", "scenario.description")
    return {
        path: values
        for path, values in found.items()
        if len(set(values)) > 1 and path not in skipped
    }


def _flat(value: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    if isinstance(value, Mapping) and value:
        for key in value:
            yield from _flat(value[key], f"{path}.{key}" if path else str(key))
    elif isinstance(value, list | tuple) and value:
        for place, one in enumerate(value):
            yield from _flat(one, f"{path}[{place}]")
    else:
        yield path, value


def as_metrics(comparison: Comparison) -> tuple[list[Metric], list[MethodInfo]]:
    """The arms as if each were a method, for figures: means over seeds, or the run's own numbers with intervals."""
    found: list[Metric] = []
    for arm in comparison.arms:
        for name in COMPARED:
            of_runs = [
                one
                for run in arm.runs.values()
                for one in run.measured
                if (one.metric, one.method, one.placement, one.component)
                == (name, arm.method.name, "all", "")
                and one.value is not None
            ]
            if len(of_runs) == 1:
                found.append(replace(of_runs[0], method=arm.label))
            elif of_runs:
                mean, half = over_seeds([one.value for one in of_runs if one.value is not None])
                low, high = wilson(mean, half) if COMPARED[name].unit == "1" else around(mean, half)
                found.append(replace(of_runs[0], method=arm.label, value=mean, low=low, high=high))
    return found, [MethodInfo(arm.label, arm.label, arm.method.baseline) for arm in comparison.arms]
