"""Several results in hand as one, for a figure: each of its methods is one method of one result."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from itertools import zip_longest
from typing import Any

from genie_sim.analysis.compare import names_of, settings_of
from genie_sim.analysis.seed_runs import SeedRuns
from genie_sim.record.columns import concat
from genie_sim.record.results import Run

DRAWN_TABLES = ("frames", "lookups")


def side_by_side(
    results: Sequence[Run | SeedRuns], labels: Sequence[str] = ()
) -> tuple[Run | SeedRuns, str]:
    """The results as one run, or as runs of several seeds, and which they are, for the footer. They
    need not have seen the same frames.

    A method is called by its result and itself, or by its result alone where every result has one
    method. Runs that differ in nothing but the seed are one result. Raises ``UserError`` for
    results that cannot be told apart.

    Parameters
    ----------
    results : sequence of Run or SeedRuns
        At least one.
    labels : sequence of str
        What they are called, in their order; by default by their own labels, their scenarios, or
        what differs.
    """
    settings = settings_of([run for result in results for run in result.runs])
    by_seed = [list(runs.values()) for runs in settings]
    names = names_of([runs[0] for runs in by_seed], labels)
    if len(by_seed) == 1:
        runs = [replace(run, label=names[0] if labels else run.label) for run in by_seed[0]]
        one = runs[0] if len(runs) == 1 else SeedRuns(runs, None, runs[0].label)
        return one, one.footer
    footer = "; ".join(
        f"{name}: {runs[0].footer}" for name, runs in zip(names, by_seed, strict=True)
    )
    merged = [
        _merged({name: run for name, run in zip(names, of_each, strict=True) if run}, number)
        for number, of_each in enumerate(zip_longest(*by_seed))
    ]
    return (merged[0] if len(merged) == 1 else SeedRuns(merged)), footer


def _merged(runs: Mapping[str, Run], number: int) -> Run:
    """One run of each result, by its name, as one run."""
    one_each = all(len(run.methods) == 1 for run in runs.values())
    methods, measured = [], []
    parts: dict[str, list[Any]] = {table: [] for table in DRAWN_TABLES}
    for name, run in runs.items():
        for method in run.methods:
            label, title = name, name  # with a colour of its own
            if not one_each:
                label, title = f"{name}: {method.name}", f"{name}: {method.title}"
            methods.append(asdict(replace(method, name=label, title=title)))
            measured += [
                replace(metric, method=label)
                for metric in run.measured
                if metric.method == method.name
            ]
            for table, rows in parts.items():
                of_method = run.tables[table].where(method=method.name)
                rows.append(of_method.assign(method=label))
    facts = {"scenario": {"name": " and ".join(runs), "seed": number}, "methods": methods}
    tables = {name: concat(rows) for name, rows in parts.items()}
    return Run("", facts, "", tables, measured)
