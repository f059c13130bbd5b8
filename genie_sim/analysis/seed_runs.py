"""Runs of one setting under several seeds, in hand as one run is: their numbers are means over the
seeds, with 95 % t intervals.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from genie_sim.analysis.registry import Words, checked_words
from genie_sim.analysis.tidy import across_seeds
from genie_sim.base.errors import UserError, unknown
from genie_sim.record import provenance, results
from genie_sim.record.records import ZERO_DELAY
from genie_sim.record.results import MethodInfo, MetricValue, Run

SWEEP_FILE = "sweep.json"  # what a study says of itself
RUNS = "runs"  # the folder of whole results
STUDY_FIELDS: Mapping[str, tuple[type, str]] = {  # what a study may say of itself
    "run_ids": (list, "a list"),
    "methods": (list, "a list"),
    "titles": (dict, "a mapping"),
    "baselines": (list, "a list"),
    "metrics": (dict, "a mapping"),
    "genie_sim": (str, "text"),
}


@dataclass(frozen=True, eq=False)
class SeedRuns:
    """Finished runs that differ in nothing but the seed.

    ``folder`` is that of the study that ran them, ``None`` for runs that were not written down;
    ``label`` is what the user calls them, or empty.
    """

    runs: Sequence[Run]
    folder: Path | None = None
    label: str = ""

    def __repr__(self) -> str:
        where = self.folder if self.folder is not None else "not written to a folder"
        return f"<{type(self).__name__} {self.name}: {len(self.runs)} seeds, {where}>"

    @cached_property
    def measured(self) -> list[MetricValue]:
        """Each metric's mean over the seeds, the ends of its 95 % t interval, the mean of its
        ranges, and in ``n`` the number of runs that define it.
        """
        return means_of(self.runs)

    @property
    def name(self) -> str:
        """The scenario's name."""
        return self.runs[0].name

    @property
    def title(self) -> str:
        """What people read for them: their label, else the scenario's name."""
        return self.label or self.name

    @property
    def cells(self) -> Mapping[str, Mapping[int, Run]]:
        """Their one setting, which has no name, as runs by seed."""
        return {"": {run.seed: run for run in self.runs}}

    @property
    def seeds(self) -> list[int]:
        """Of each run its seed."""
        return [run.seed for run in self.runs]

    @property
    def methods(self) -> Sequence[MethodInfo]:
        """The methods that ran, in the order of the scenario."""
        return self.runs[0].methods

    @property
    def words(self) -> Words:
        """What is said of metrics of the user's own."""
        return self.runs[0].words

    @property
    def footer(self) -> str:
        """Which runs they are, below a figure."""
        which = f"{self.name}, {seeds_text(self.seeds)}"
        return ", ".join(filter(None, [self.label, which, self.runs[0].warm_up]))


def means_of(runs: Sequence[Run]) -> list[MetricValue]:
    """The numbers of runs that differ in nothing but the seed as one run's."""
    import pandas as pd

    rows = [{**metric._asdict(), "seed": run.seed} for run in runs for metric in run.measured]
    numbers = ("value", "range_low", "range_high")
    means = across_seeds(
        pd.DataFrame(rows).astype(dict.fromkeys(numbers, float)), [], own=runs[0].words
    )
    known = means.astype({"n": int}).astype(object).where(means.notna(), None)
    return [MetricValue(*number) for number in known.itertuples(index=False, name=None)]


def with_methods(run: Run | SeedRuns, names: Sequence[str]) -> Run | SeedRuns:
    """The same run, or runs, with the numbers of these methods alone, in this order, and of the
    zero-delay detector, which is of no method; of no names, all. Its tables stay as they are.
    Raises ``UserError`` for a method that did not run.
    """
    if not names:
        return run
    if isinstance(run, SeedRuns):
        return replace(run, runs=[_with_methods(of_seed, names) for of_seed in run.runs])
    return _with_methods(run, names)


def _with_methods(run: Run, names: Sequence[str]) -> Run:
    by_name = {method["name"]: method for method in run.facts["methods"]}
    for name in names:
        if name not in by_name:
            raise UserError(f"methods: {run.title}: {unknown('method', name, by_name)}")
    left_out = by_name.keys() - set(names)
    return replace(
        run,
        facts={**run.facts, "methods": [by_name[name] for name in dict.fromkeys(names)]},
        measured=[
            metric
            for metric in run.measured
            if metric.method not in left_out or metric.component == ZERO_DELAY
        ],
    )


def seeds_text(seeds: Sequence[int]) -> str:
    """``seed 7``, ``seeds 1, 4``, ``seeds 1 to 5``: seeds as they are read."""
    if len(seeds) == 1:
        return f"seed {seeds[0]}"
    if len(seeds) > 2 and list(seeds) == list(range(seeds[0], seeds[0] + len(seeds))):
        return f"seeds {seeds[0]} to {seeds[-1]}"
    return f"seeds {', '.join(map(str, seeds))}"


def is_seeds_folder(folder: Path) -> bool:
    """Whether a folder is that of a study without axes, as far as that can be read."""
    try:
        return not read_about(folder)["sweep"].get("axes")
    except UserError:
        return False


def load_run(folder: Path) -> Run:
    """The run in a result folder; with what it says of metrics of the user's own. Raises
    ``UserError``.
    """
    return results.load(folder, checked_words)


def load_seeds(folder: Path) -> SeedRuns:
    """The runs of a study without axes. Raises ``UserError``."""
    about, where = read_about(folder), folder / SWEEP_FILE
    label = results.checked_label(about.get("label", ""), f"{where}: label")
    seeds = about["sweep"].get("seeds")
    if not isinstance(seeds, list) or not seeds or not all(type(seed) is int for seed in seeds):
        raise UserError(f"{where}: seeds: missing, or not a list of whole numbers")
    runs = []
    for seed in seeds:
        path = provenance.contained(folder, f"{RUNS}/{folder_name(seed)}")
        if not path.is_dir():
            raise UserError(f"{path}: missing; the study is not finished, run it again")
        runs.append(replace(load_run(path), label=label))
    return SeedRuns(runs, folder, label)


def folder_name(seed: int) -> str:
    """What the result folder of a run is called in a study without axes."""
    return f"seed-{seed}"


def read_about(folder: Path) -> dict[str, Any]:
    """What a study says of itself. Raises ``UserError``, also for another folder."""
    path = provenance.contained(folder, SWEEP_FILE)
    about = provenance.read_json(path)
    if not isinstance(about, dict) or not isinstance(about.get("sweep"), dict):
        raise UserError(f"{path}: cannot be read: not what a sweep says of itself")
    provenance.check_format(path, about)
    for name, (kind, what) in STUDY_FIELDS.items():
        if type(about.setdefault(name, kind())) is not kind:
            raise UserError(f"{path}: {name}: not {what}")
    return about
