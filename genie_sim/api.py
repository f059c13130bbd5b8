"""genie-sim as a library.

>>> import genie_sim as gs
>>> run = gs.run("3car_hetero", {"cars[0].device": "orin_nano"}, seed=7)
>>> run.frames, run.lookups, run.metrics        # pandas tables
>>> run.figure("latency_cdf")                   # a matplotlib figure
>>> runs = gs.run_seeds("3car_hetero", seeds=5) # means with intervals
>>> run.report("report.html")                   # one page for a browser
>>> gs.load("results/3car_hetero-2a7842fdfa41") # a run of the command line

What is wrong with the input raises ``gs.UserError``, with one line that names field, value and
choices.
"""

import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from genie_sim import kinds
from genie_sim.analysis.seed_runs import SeedRuns
from genie_sim.base import files
from genie_sim.base.errors import UserError as UserError
from genie_sim.base.errors import short_repr
from genie_sim.base.paths import expanded
from genie_sim.base.progress import Progress
from genie_sim.base.python_values import plain, typed
from genie_sim.base.settings import plain_data
from genie_sim.kinds import Run as Run
from genie_sim.kinds import Runs as Runs
from genie_sim.record import results
from genie_sim.report.output import Output
from genie_sim.report.result import Comparison as Comparison
from genie_sim.report.result import Result
from genie_sim.runs import folder as run_folder
from genie_sim.runs.simulate import Observer
from genie_sim.scenario import reading
from genie_sim.scenario.scenario import Scenario as Scenario
from genie_sim.scenario.yaml_input import inline

if TYPE_CHECKING:
    from genie_sim.paper.reproduce import Reproduction
    from genie_sim.study.study import Study
    from genie_sim.study.sweep import Sweep

Settings = Mapping[str, Any] | Sequence[str]


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
    observer : Observer, optional
        Sees the world of each method before and after it runs: it may subscribe to topics and look
        at nodes and their maps. For a run in memory.
    progress : callable, optional
        Called with the seconds simulated, those to simulate, and the method.
    """
    output = _output(report, figures)
    if observer is not None and out is not None:
        raise UserError("observer: is for a run in memory, without out")
    loaded = load_scenario(scenario, settings, seed=seed, methods=_names("methods", methods))
    if out is None:
        return Run.of(run_folder.run_in_memory(loaded, progress, label=label, observer=observer))
    return Run.of(run_folder.run_to_folder(loaded, expanded(out), progress, output, label=label))


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
    from genie_sim.study.design import design_of
    from genie_sim.study.study import Study

    _check_jobs(jobs)
    loaded = load_scenario(scenario, settings, methods=_names("methods", methods))
    design = design_of(loaded, plain(seeds, "seeds"))
    output = _output(report and out is not None, figures and out is not None)
    called: Any = {"label": results.checked_label(label), "reports": output.page}
    with _folder(out) as folder:
        study = Study.of(design, loaded.name, folder, base=loaded, **called)
        runs: Runs = _studied(study, output, jobs=jobs, out=out, progress=progress)
    return runs


@contextmanager
def _folder(out: str | Path | None) -> Iterator[Path]:
    """Where a study goes; without ``out`` it is gone afterwards."""
    with tempfile.TemporaryDirectory() as scratch:
        yield expanded(out or scratch)


def _studied(
    study: "Study",
    output: Output,
    *,
    jobs: int | None,
    out: str | Path | None,
    progress: Progress | None,
    shard: Sequence[int] = (1, 1),
) -> Any:
    """What a study gives; without ``out`` in memory. Raises ``UserError``."""
    scenarios = [run.scenario for run in study.plan.runs.values()]
    study.run(_processes(jobs, scenarios), (shard[0], shard[1]), progress)
    study.finish(output)
    studied = kinds.load(study.folder)
    if out is not None:
        return studied
    if isinstance(studied, Runs):
        return Runs([replace(run, folder=None) for run in studied.runs], None, studied.label)
    return replace(cast(Any, studied), folder=None)


def _output(report: bool, figures: bool) -> Output:
    """What is made of results besides tables."""
    return Output(report, ("svg",) if figures else ())


@typed
def load(folder: str | Path) -> "Run | Runs | Sweep | Reproduction":
    """What a result folder holds: a run, the runs of several seeds, a sweep, or the paper's
    evaluation. Each has ``metrics``, ``figures()``, ``text()``, ``report()``, ``compare()`` and
    ``rerun()``; see ``report.result.Result``.

    Raises ``UserError`` for anything else, for a folder that is not whole, and for files that were
    changed since they were written.
    """
    loaded: Any = kinds.load(expanded(folder))
    return loaded  # type: ignore[no-any-return]


@typed
def compare(
    *results_: Result | results.Run | SeedRuns | str | Path,
    methods: Sequence[str] | str = (),
    labels: Sequence[str] = (),
    metrics: Sequence[str] = (),
) -> Comparison:
    """Compares results, or result folders, or the methods of one: differences with intervals, by
    seed where there are several of a setting, else by blocks of one second. Only seeds that all
    have are compared, and of sweeps and evaluations only the settings that all have.

    ``methods``: which, the first of them to compare with. ``labels``: what the results are called,
    in their order. ``metrics``: which, by default those that matter most. Raises ``UserError`` for
    what cannot be compared.
    """
    if not results_:
        raise UserError("compare: expected at least one run, or its folder")
    in_hand: list[Any] = [
        load(result) if isinstance(result, str | Path) else result for result in results_
    ]
    comparison = Comparison(in_hand, _names("methods", methods), labels, metrics)
    comparison.compared  # noqa: B018 - what cannot be compared is told at once
    return comparison


@typed
def sweep(
    scenario: str | Path,
    axes: Mapping[str, Any] | None = None,
    settings: Settings = (),
    *,
    seeds: int | Sequence[int] | None = None,
    methods: Sequence[str] | str = (),
    label: str = "",
    samples: int | None = None,
    jobs: int | None = None,
    shard: Sequence[int] = (1, 1),
    out: str | Path | None = None,
    progress: Progress | None = None,
) -> "Sweep":
    """Simulates a scenario along axes, every point with all seeds. Raises ``UserError``.

    The sweep's ``metrics`` are a table: one row per point, metric, method, placement and component,
    with the axes' values, the mean over seeds (``value``), its 95 % t interval (``low``, ``high``)
    and the number ``n`` of runs; ``every_run`` has one row a run instead. It draws its figures
    (``sweep.figure("streaming_f1")``) and compares (``sweep.differences("method", to="remote")``).

    Parameters
    ----------
    scenario : str or Path
        A file, or the name of one that is shipped; without ``axes`` that of a sweep.
    axes : mapping, optional
        By name, as in a sweep's file, or by the path of a setting with a list of its values:
        ``{"genie.object_map.gate": ["1 m", "2 m"], "link": {"set": "cars[0].link", "list": ["wifi",
        "lte"]}}``.
    settings : mapping or sequence of str
        Fields that are the same at every point.
    seeds : int or sequence of int, optional
        Which seeds, or how many: 5 are the seeds 1 to 5. By default those of the sweep's file, else
        5.
    methods : sequence of str
        Only these, at every point; by default those of the scenario.
    label : str
        What figures and the page call the sweep.
    samples : int, optional
        How many points are drawn where axes are random.
    jobs : int, optional
        Processes; by default one per core.
    shard : pair of int
        ``(i, n)``: only the i-th of n parts of the runs, for job arrays; ``UnfinishedError`` where
        other parts are missing.
    out : str or Path, optional
        A folder that gets the sweep's folder, as ``genie-sim sweep`` names it. Finished runs in it
        are not run again; a sweep of other values has a folder of its own beside it.
    progress : callable, optional
        Called with how much is done, how much there is, and what is going on.
    """
    from genie_sim.study.design import fixed_settings, load_design, read_design, sweep_of
    from genie_sim.study.study import Study

    _check_jobs(jobs)
    if len(shard) != 2 or not 1 <= shard[0] <= shard[1]:
        raise UserError(f"shard: {short_repr(shard)}: expected i and n, with i from 1 to n")
    names = _names("methods", methods)
    fixed = (
        plain(dict(settings), "settings")
        if isinstance(settings, Mapping)
        else fixed_settings(_overrides(settings))
    )
    more = {"samples": plain(samples, "samples"), "seeds": plain(seeds, "seeds")}
    if axes is None:
        design = load_design(scenario, fixed, more)
        where = str(files.find(files.SWEEP, scenario))
    else:
        given = sweep_of(str(scenario), plain(axes, "axes"), names, {"set": fixed, **more})
        design, where = read_design(given, "axes"), "axes"
    called: Any = {"label": results.checked_label(label), "reports": out is not None}
    with _folder(out) as folder:
        study = Study.of(design, where, folder, progress, methods=names, **called)
        output = Output(page=out is not None)
        swept: Sweep = _studied(study, output, jobs=jobs, out=out, shard=shard, progress=progress)
    return swept


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


@typed
def load_scenario(
    source: str | Path | Mapping[str, Any] | Scenario,
    settings: Settings = (),
    *,
    seed: int | None = None,
    methods: Sequence[str] = (),
) -> Scenario:
    """A scenario, checked: a file or a shipped name, a mapping as in YAML, or another scenario,
    with ``settings``, and with these ``methods`` alone where some are named. Another scenario keeps
    the device profiles that it was read with.

    Raises ``UserError``.
    """
    overrides, seed = _overrides(settings), plain(seed, "seed")
    more: Any = {"methods": methods, "settings_from": ""}
    if isinstance(source, str | Path):
        return reading.load_scenario(source, overrides, seed, **more)
    if not isinstance(source, Scenario):
        data = {"name": "scenario", **plain(source, "scenario")}
        return reading.read_scenario(data, overrides, seed, **more)
    more["profiles"] = source.profiles
    scenario = reading.read_scenario(plain_data(source), overrides, seed, **more)
    is_same = not (overrides or seed is not None or methods)
    return replace(scenario, read_from=source.read_from) if is_same else scenario


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
    return [f"{path}={inline(plain(value, path))}" for path, value in settings.items()]


def _names(where: str, given: Any) -> list[str]:
    """Names, of which one may stand alone; a class stands for its own."""
    names = plain(given, where)
    return [names] if isinstance(names, str) else list(names)


def _check_jobs(jobs: int | None) -> None:
    """Raises ``UserError`` for a number of processes below 1."""
    if jobs is not None and jobs < 1:
        raise UserError(f"jobs: {short_repr(jobs)}: expected a whole number from 1 on")


def _processes(jobs: int | None, scenarios: Sequence[Scenario]) -> int:
    """So many processes, by default one a core. A class from a notebook or an interactive session
    is known in this process alone: where a scenario names one, everything runs here. Raises
    ``UserError`` where several processes are asked for all the same.
    """
    from genie_sim.base import parallel

    script = getattr(sys.modules["__main__"], "__file__", None)
    if (script is None or not Path(script).is_file()) and any(
        name.startswith("__main__:")
        for scenario in scenarios
        for _, name in scenario.own_classes().values()
    ):
        if jobs not in (None, 1):
            raise UserError(
                f"jobs: {jobs} processes do not know a class of this notebook: leave jobs out, or"
                " put the class into a file of its own"
            )
        return 1
    return jobs or parallel.workers_here()
