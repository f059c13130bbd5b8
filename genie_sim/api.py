"""genie-sim as a library.

>>> import genie_sim as gs
>>> run = gs.run("3car_hetero", {"cars[0].device": "orin_nano"}, seed=7)
>>> run.frames, run.lookups, run.metrics        # pandas tables
>>> run.plot.latency_cdf()                      # a matplotlib figure
>>> runs = gs.run_seeds("3car_hetero", seeds=5) # means with intervals
>>> run.report("report.html")                   # one page for a browser
>>> gs.load("results/3car_hetero-2a7842fdfa41") # a run of the command line

What is wrong with the input raises ``gs.UserError``, with one line that names field, value and
choices.
"""

import json
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from genie_sim.analysis import registry, seed_runs
from genie_sim.analysis.plots import Plots
from genie_sim.analysis.seed_runs import SeedRuns
from genie_sim.base.errors import Suggesting, UserError, short_repr
from genie_sim.base.paths import expanded
from genie_sim.base.progress import Progress
from genie_sim.base.python_values import plain, typed
from genie_sim.base.settings import plain_data
from genie_sim.record import results
from genie_sim.report.output import Output
from genie_sim.runs import folder as run_folder
from genie_sim.runs.simulate import Observer
from genie_sim.scenario import reading
from genie_sim.scenario.scenario import Scenario

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from genie_sim.analysis.compare import ComparedRuns
    from genie_sim.paper.reproduce import Reproduction
    from genie_sim.study.sweep_table import SweepTable
    from genie_sim.study.work import Workers

__all__ = [
    "Plots",
    "Run",
    "Runs",
    "Scenario",
    "UserError",
    "compare",
    "differences",
    "load",
    "load_scenario",
    "reproduce",
    "run",
    "run_seeds",
    "sweep",
]

Settings = Mapping[str, Any] | Sequence[str]


@dataclass(frozen=True, eq=False, repr=False)
class Run(results.Run):
    """A finished run in hand: its tables (see ``record.results.Run``), metrics, figures and
    page.
    """

    @cached_property
    def scenario(self) -> Scenario:
        """The scenario as it was run."""
        return reading.read_scenario(self.facts["scenario"], where=self.name)

    @cached_property
    def metrics(self) -> "pd.DataFrame":
        """One row per metric: metric, method, placement, component, value, unit, low, high, n; see
        ``MetricValue``.
        """
        return _long(self)

    def table(self) -> "pd.DataFrame":
        """The values of ``metrics`` with a column a method, and a row for each metric, placement
        and component.
        """
        return _wide(self)

    @property
    def plot(self) -> Plots:
        """The figures: ``run.plot.latency_cdf()``."""
        return Plots(self)

    @typed
    def save(self, out: str | Path) -> Path:
        """Writes the run's result folder into the folder ``out``, as ``run(..., out=out)`` does;
        returns its path. Raises ``UserError``.
        """
        return run_folder.save(self, expanded(out))

    @typed
    def report(self, path: str | Path | None = None) -> Path:
        """Writes one HTML page to look at the run in a browser; default: ``report.html`` in the
        run's folder.
        """
        from genie_sim.report import html_page

        path = _report_path(self, path)
        html_page.write(path, self)
        return path

    def _repr_html_(self) -> str:
        return _run_html(self)


@dataclass(frozen=True, eq=False, repr=False)
class Runs(Suggesting, SeedRuns):
    """Runs with several seeds in hand. ``runs`` are the single ones; metrics, tables and figures
    are means over them, with 95 % intervals.
    """

    runs: Sequence[Run]

    @cached_property
    def metrics(self) -> "pd.DataFrame":
        """One row per metric, as of a run: ``value`` is the mean over seeds, ``low`` and ``high``
        the ends of its 95 % t interval, and ``n`` the number of runs that define it.
        """
        return _long(self)

    @cached_property
    def every_run(self) -> "pd.DataFrame":
        """One row per metric and seed."""
        import pandas as pd

        return pd.concat([run.metrics.assign(seed=run.seed) for run in self.runs])

    def table(self) -> "pd.DataFrame":
        """The means with a column a method, and a row for each metric, placement and component."""
        return _wide(self)

    @property
    def plot(self) -> Plots:
        """The figures, with bands and intervals: ``runs.plot.latency_cdf()``."""
        return Plots(self)

    def compare(self, methods: Sequence[str] = ()) -> "Comparison":
        """The paired differences between the methods, seed by seed."""
        return compare(self, methods=methods)

    @typed
    def save(self, out: str | Path) -> Path:
        """Writes the result folder of every run into the folder ``out``; returns it. ``load`` reads
        each. Raises ``UserError``.
        """
        for run in self.runs:
            run.save(out)
        return expanded(out)

    @typed
    def report(self, path: str | Path | None = None) -> Path:
        """Writes one HTML page about all runs; default: ``report.html`` in their folder."""
        from genie_sim.report import comparison, template

        path = _report_path(self, path)
        template.write(path, comparison.seeds_page(self))
        return path

    def _repr_html_(self) -> str:
        return _run_html(self)


def _run_html(run: Run | Runs) -> str:
    from genie_sim.report import notebook

    return notebook.run_html(run)


def _long(run: results.Run | SeedRuns) -> "pd.DataFrame":
    import pandas as pd

    return pd.DataFrame([asdict(metric) for metric in run.measured])


def _wide(run: Run | Runs) -> "pd.DataFrame":
    """The index and the columns keep the order of the metrics and methods."""
    index = ["metric", "placement", "component"]
    wide = run.metrics.pivot(index=index, columns="method", values="value")
    places = run.metrics[index].drop_duplicates().itertuples(index=False, name=None)
    return wide.reindex(index=list(places), columns=[method.name for method in run.methods])


def _report_path(run: Run | Runs, path: str | Path | None) -> Path:
    if path is not None:
        return expanded(path)
    if run.folder is None:
        raise UserError(
            "report: a run without a folder needs a path, such as run.report('report.html')"
        )
    from genie_sim.report import template

    return run.folder / template.NAME


@typed
def run(
    scenario: str | Path | Mapping[str, Any] | Scenario,
    settings: Settings = (),
    *,
    seed: int | None = None,
    methods: Sequence[str] | str = (),
    label: str = "",
    out: str | Path | None = None,
    report: bool = True,
    figures: bool = False,
    jobs: int = 1,
    observer: Observer | None = None,
    progress: Progress | None = None,
) -> Run:
    """Simulates a scenario under each of its methods. Raises ``UserError`` before it simulates.

    Parameters
    ----------
    scenario : str, Path, mapping or Scenario
        A file or a shipped name, the same as a mapping, or one from ``load_scenario``.
    settings : mapping or sequence of str
        Single fields to change, as ``--set`` does: ``{"genie.eviction": "lru", "cars[0].link":
        "wifi"}``.
    seed : int, optional
        The root of all random streams; by default the scenario's.
    methods : sequence of str
        Only these, in this order; by default those of the scenario.
    label : str
        What tables and figures call the result; by default the scenario's name.
    out : str or Path, optional
        A folder that gets the result folder; by default the run stays in memory.
    report, figures : bool
        With ``out``: whether the result folder has ``report.html``, and the figures as SVG.
    jobs : int
        Processes on this machine, which simulate several methods side by side. The results do not
        depend on it.
    observer : Observer, optional
        Sees the world of each method before and after it runs: it may subscribe to topics and look
        at nodes and their maps. For a run in memory, in this process.
    progress : callable, optional
        Called with the seconds simulated, those to simulate, and the method.
    """
    label, output = results.checked_label(label), _output(report, figures)
    _check_jobs(jobs)
    if observer is not None and (jobs > 1 or out is not None):
        raise UserError("observer: is for one run in memory, without jobs and out")
    loaded = load_scenario(scenario, settings, seed=seed, methods=_names("methods", methods))
    if out is None:
        return _one_in_hand(
            run_folder.run_in_memory(loaded, progress, label=label, workers=jobs, observer=observer)
        )
    return _one_in_hand(
        run_folder.run_to_folder(
            loaded,
            expanded(out),
            progress,
            output,
            label=label,
            workers=jobs,
        )
    )


@typed
def run_seeds(
    scenario: str | Path | Mapping[str, Any] | Scenario,
    settings: Settings = (),
    *,
    seeds: int | Sequence[int] = 5,
    methods: Sequence[str] | str = (),
    label: str = "",
    out: str | Path | None = None,
    report: bool = True,
    figures: bool = False,
    jobs: int | None = None,
    progress: Progress | None = None,
) -> Runs:
    """Simulates a scenario with several seeds. Raises ``UserError`` before it simulates.

    Parameters
    ----------
    scenario, settings, methods, label, report, figures
        As of ``run``.
    seeds : int or sequence of int
        Which seeds, or how many: 5 are the seeds 1 to 5.
    out : str or Path, optional
        A folder that gets the folder of all runs; those that are in it are not run again. By
        default the runs stay in memory.
    jobs : int, optional
        Processes on this machine; by default one a core. The results do not depend on it.
    progress : callable, optional
        Called with how many runs are done, how many there are, and how many failed.
    """
    from genie_sim.study.seeds import design_of
    from genie_sim.study.study import Study

    loaded = load_scenario(scenario, settings, methods=_names("methods", methods))
    label, workers = results.checked_label(label), _workers(jobs, plain_data(loaded))
    output = _output(report and out is not None, figures and out is not None)
    with tempfile.TemporaryDirectory() as scratch:
        work = Study.of(
            design_of(loaded, plain(seeds, "seeds")),
            loaded.name,
            expanded(out or scratch),
            base=loaded,
            label=label,
            reports=output.page,
        )
        work.run(workers, progress=progress)
        runs = _in_hand(seed_runs.load(work.finish(output).folder))
    assert isinstance(runs, Runs)
    if out is None:
        return Runs([replace(run, folder=None) for run in runs.runs], None, label)
    return runs


def _output(report: bool, figures: bool) -> Output:
    """What is made of results besides tables."""
    return Output(report, ("svg",) if figures else ())


@typed
def load(folder: str | Path, *, allow_changed: bool = False) -> "Run | Runs | SweepTable":
    """The run in a result folder, the runs of one with several seeds, or the table of a sweep, as
    ``sweep`` returns it.

    Raises ``UserError`` for anything else, for a folder that is not whole, and for files that were
    changed since the run wrote them. With ``allow_changed`` these are read all the same; the run's
    ``changed`` names them, and every table, figure and page made of it says so.
    """
    folder = expanded(folder)
    if (folder / seed_runs.ABOUT).is_file() and not seed_runs.is_seeds_folder(folder):
        from genie_sim.study.sweep_table import SweepTable

        return SweepTable.read(folder, allow_changed)
    return _in_hand(seed_runs.load(folder, allow_changed=allow_changed))


@typed
def compare(
    *results_: results.Run | SeedRuns | str | Path,
    methods: Sequence[str] | str = (),
    labels: Sequence[str] = (),
    metrics: Sequence[str] = (),
    allow_changed: bool = False,
) -> "Comparison":
    """Compares runs, or result folders, or the methods of one: differences with intervals, by seed
    where there are several of a setting, else by blocks of one second. Only seeds that all have are
    compared.

    ``methods``: which, the first of them to compare with. ``labels``: what the settings are called,
    in their order. ``metrics``: which, by default those that matter most. ``allow_changed`` as in
    ``load``. Raises ``UserError`` for what cannot be compared.
    """
    from genie_sim.analysis import compare as comparing

    if not results_:
        raise UserError("compare: expected at least one run, or its folder")
    runs = [
        result
        if isinstance(result, results.Run | SeedRuns)
        else seed_runs.load(result, allow_changed=allow_changed)
        for result in results_
    ]
    own = (metric.metric for run in runs for metric in run.measured)
    registry.checked(metrics, own, "metrics")
    return Comparison(comparing.compare(runs, methods, labels, metrics))


@dataclass(frozen=True)
class Comparison:
    """Runs compared: ``table`` and ``settings`` for pandas, ``text()``, figures and a page."""

    _made: "ComparedRuns"

    @cached_property
    def table(self) -> "pd.DataFrame":
        """One row per metric and method; see ``analysis.compare.Difference``."""
        import pandas as pd

        from genie_sim.analysis.compare import Difference

        return pd.DataFrame(self._made.rows, columns=Difference._fields)

    @cached_property
    def settings(self) -> "pd.DataFrame":
        """What differs: a row per setting, a column per result."""
        import pandas as pd

        return pd.DataFrame.from_dict(
            dict(self._made.settings), orient="index", columns=list(self._made.names)
        )

    @property
    def verdicts(self) -> list[str]:
        """A sentence for each arm that is compared with another: in what it is better or worse, by
        how much, and how sure that is.
        """
        from genie_sim.analysis.verdict import verdicts

        return verdicts(self._made)

    @property
    def figures(self) -> "Mapping[str, Figure]":
        """The differences with their intervals, overlaid distributions of response times, and
        latency against accuracy.
        """
        from genie_sim.report import comparison

        return comparison.figures(self._made)

    def text(self, format: str = "markdown") -> str:
        """The table as ``markdown``, ``csv`` or ``latex``."""
        from genie_sim.analysis import compare_tables

        return compare_tables.text(self._made, format)

    @typed
    def report(self, folder: str | Path) -> Path:
        """Writes a page, figures and tables into a folder."""
        from genie_sim.report import comparison

        return comparison.write(self._made, expanded(folder))

    def _repr_html_(self) -> str:
        from genie_sim.report import notebook

        return notebook.comparison_html(self._made)


@typed
def sweep(
    scenario: str | Path,
    axes: Mapping[str, Any],
    settings: Settings = (),
    *,
    seeds: int | Sequence[int] = 5,
    methods: Sequence[str] | str = (),
    label: str = "",
    samples: int | None = None,
    every_run: bool = False,
    jobs: int | None = None,
    out: str | Path | None = None,
    progress: Progress | None = None,
) -> "SweepTable":
    """Simulates a scenario along axes, every point with all seeds. Raises ``UserError``.

    Returns one row per point, metric, method, placement and component: the axes' values, the mean
    over seeds (``value``), its 95 % t interval (``low``, ``high``) and the number of ``runs``. The
    table draws the figures of the sweep: ``table.plot.along("gate")``, ``table.plot.heat("gate",
    "link")``.

    Parameters
    ----------
    scenario : str or Path
        A file, or the name of one that is shipped.
    axes : mapping
        By name, as in a sweep's file, or by the path of a setting with a list of its values:
        ``{"genie.object_map.gate": ["1 m", "2 m"], "link": {"set": "cars[0].link", "list": ["wifi",
        "lte"]}}``.
    settings : mapping or sequence of str
        Fields that are the same at every point.
    seeds : int or sequence of int
        Which seeds, or how many: 5 are the seeds 1 to 5.
    methods : sequence of str
        Only these, at every point; by default those of the scenario.
    label : str
        What figures and the page call the sweep.
    samples : int, optional
        How many points are drawn where axes are random.
    every_run : bool
        Whether to return one row per run instead, which ``differences`` takes.
    jobs : int, optional
        Processes; by default one per core.
    out : str or Path, optional
        A folder that gets the sweep's folder, as ``genie-sim sweep`` names it. Finished runs in it
        are not run again; a sweep of other values has a folder of its own beside it.
    progress : callable, optional
        Called with how much is done, how much there is, and what is going on.
    """
    from genie_sim.study.design import fixed_settings, read_design, sweep_of
    from genie_sim.study.study import Study
    from genie_sim.study.sweep_table import SweepTable

    names = _names("methods", methods)
    more = {
        "set": (
            plain(dict(settings), "settings")
            if isinstance(settings, Mapping)
            else fixed_settings(_overrides(settings))
        ),
        "samples": plain(samples, "samples"),
        "seeds": plain(seeds, "seeds"),
    }
    given = sweep_of(str(scenario), plain(axes, "axes"), names, more)
    design = read_design(given, "sweep")
    with tempfile.TemporaryDirectory() as scratch:
        work = Study.of(
            design,
            "sweep",
            expanded(out or scratch),
            progress,
            methods=names,
            label=results.checked_label(label),
            reports=out is not None,
        )
        work.run(_workers(jobs, given, names), progress=progress)
        status = work.finish(Output(page=out is not None))
        return SweepTable.read(status.folder, every_run=every_run)


@typed
def reproduce(
    out: str | Path | None = None,
    *,
    quick: bool = False,
    seeds: int | None = None,
    jobs: int | None = None,
    progress: Progress | None = None,
) -> "Reproduction":
    """Runs the paper's evaluation: its ``table``, its five ``figures`` and all ``numbers``.

    Parameters
    ----------
    out : str or Path, optional
        The folder that gets it. Runs are kept beside it, in ``<out>.runs``: an evaluation that was
        interrupted goes on from there. By default nothing is kept.
    quick : bool
        Two seeds instead of ten.
    seeds : int, optional
        So many seeds, from 1 on.
    jobs : int, optional
        Processes; by default one per core.
    progress : callable, optional
        Called with how many runs are done, how many there are, and how many failed.

    Raises
    ------
    UserError
        For a number below 1, or a folder that cannot be written.
    """
    from genie_sim.paper import reproduce as evaluation

    _check_jobs(jobs)
    if seeds is not None and seeds < 1:
        raise UserError(f"seeds: {short_repr(seeds)}: expected a whole number from 1 on")
    folder = None if out is None else expanded(out)
    return evaluation.reproduce(folder, quick=quick, seeds=seeds, workers=jobs, progress=progress)


def differences(runs: "pd.DataFrame", along: str, to: Any) -> "pd.DataFrame":
    """Paired differences in a sweep's runs (``sweep(..., every_run=True)`` or ``runs.parquet``): of
    every value of the column ``along``, an axis or ``method``, from the value ``to``, seed by seed,
    with 95 % t intervals.

    Raises ``UserError``.
    """
    from genie_sim.study import tables

    if not hasattr(runs, "columns"):
        raise UserError(f"runs: {short_repr(runs)}: expected the table of a sweep")
    axes = list(runs.columns[len(tables.BEFORE_AXES) : runs.columns.get_loc("metric")])
    return tables.differences(runs, axes, along, to)


@typed
def load_scenario(
    source: str | Path | Mapping[str, Any] | Scenario,
    settings: Settings = (),
    *,
    seed: int | None = None,
    methods: Sequence[str] = (),
) -> Scenario:
    """A scenario, checked: a file or a shipped name, a mapping as in YAML, or another scenario,
    with ``settings``, and with these ``methods`` alone where some are named.

    Raises ``UserError``.
    """
    overrides, seed = _overrides(settings), plain(seed, "seed")
    if isinstance(source, Scenario) and not (overrides or seed is not None or methods):
        return source
    try:
        if isinstance(source, str | Path):
            return reading.load_scenario(source, overrides, seed, methods=methods)
        data = plain_data(source) if isinstance(source, Scenario) else plain(source, "scenario")
        return reading.read_scenario({"name": "scenario", **data}, overrides, seed, methods=methods)
    except UserError as error:
        # on the command line settings come from --set, in Python they do not
        raise UserError(str(error).removeprefix("--set ")) from error


def _in_hand(run: results.Run | SeedRuns) -> Run | Runs:
    """What was read or simulated, as the class with metrics, figures and a page."""
    if isinstance(run, SeedRuns):
        return Runs([_one_in_hand(of_seed) for of_seed in run.runs], run.folder, run.label)
    return _one_in_hand(run)


def _one_in_hand(run: results.Run) -> Run:
    return Run(**{field.name: getattr(run, field.name) for field in fields(run)})


def _overrides(settings: Settings) -> Sequence[str]:
    """``path=value`` texts; a value becomes JSON, which is YAML too."""
    if isinstance(settings, str):
        raise UserError(
            f"settings: must be a mapping or a list such as ['seed=3'], not the text {settings!r}"
        )
    if not isinstance(settings, Mapping):
        for place, text in enumerate(settings):
            if not isinstance(text, str):
                problem = f"{short_repr(text)}: expected a text such as 'seed=3'"
                raise UserError(f"settings[{place}]: {problem}")
        return settings
    return [f"{path}={json.dumps(plain(value, path))}" for path, value in settings.items()]


def _names(where: str, given: Any) -> list[str]:
    """Names, of which one may stand alone; a class stands for its own."""
    names = plain(given, where)
    return [names] if isinstance(names, str) else list(names)


def _check_jobs(jobs: int | None) -> None:
    """Raises ``UserError`` for a number of processes below 1."""
    if jobs is not None and jobs < 1:
        raise UserError(f"jobs: {short_repr(jobs)}: expected a whole number from 1 on")


def _workers(jobs: int | None, *given: Any) -> "Workers":
    """So many processes, by default one a core. A class from a notebook or an interactive session
    is known in this process alone: where ``given`` names one, everything runs here. Raises
    ``UserError`` where several processes are asked for all the same.
    """
    from genie_sim.base import parallel
    from genie_sim.study.work import Workers

    _check_jobs(jobs)
    names_main = '"__main__:' in json.dumps(given, default=str)
    script = getattr(sys.modules["__main__"], "__file__", None)
    if names_main and (script is None or not Path(script).is_file()):
        if jobs not in (None, 1):
            raise UserError(
                f"jobs: {jobs} processes do not know a class of this notebook: leave jobs out, or"
                " put the class into a file of its own"
            )
        return Workers(1)
    return Workers(jobs or parallel.workers_here())
