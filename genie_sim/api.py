"""genie-sim as a library.

>>> import genie_sim as gs
>>> run = gs.run("3car_hetero", {"cars[0].device": "orin_nano"}, seed=7)
>>> run.frames, run.lookups, run.metrics        # pandas tables
>>> run.figures.latency_cdf()                   # a matplotlib figure
>>> run.report("report.html")                   # one page for a browser
>>> gs.load("results/3car_hetero-2a7842fdfa41") # a run of the command line

What is wrong with the input raises ``gs.UserError``, with one line that names field, value and choices.
"""

import json
import re
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from genie_sim import report, runner
from genie_sim.analysis import compare as comparing
from genie_sim.errors import UserError
from genie_sim.paths import expanded
from genie_sim.perception.sources import Progress
from genie_sim.recording import results
from genie_sim.report import comparison
from genie_sim.scenario import scenario
from genie_sim.scenario.scenario import Scenario

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

__all__ = [
    "Figures",
    "Run",
    "Scenario",
    "UserError",
    "compare",
    "differences",
    "load",
    "load_scenario",
    "run",
    "sweep",
]

Settings = Mapping[str, Any] | Sequence[str]


@dataclass(frozen=True, eq=False, repr=False)
class Run(results.Run):
    """A finished run in hand: its tables (see ``recording.results.Run``), metrics, figures and page."""

    @cached_property
    def scenario(self) -> Scenario:
        """The scenario as it was run."""
        return scenario.read_scenario(self.facts["scenario"], where=self.name)

    @cached_property
    def metrics(self) -> "pd.DataFrame":
        """One row per metric: metric, method, placement, component, value, unit, low, high, n; see ``Metric``."""
        import pandas as pd

        return pd.DataFrame([asdict(metric) for metric in self.measured])

    @property
    def figures(self) -> "Figures":
        """The paper's figures, of this run."""
        return Figures(self)

    def report(self, path: str | Path | None = None) -> Path:
        """Writes one HTML page to look at the run in a browser; default: ``report.html`` in the run's folder."""
        if path is None:
            if self.folder is None:
                raise UserError(
                    "report: a run without a folder needs a path, such as run.report('report.html')"
                )
            path = self.folder / report.NAME
        path = expanded(path)
        report.write(path, self)
        return path


@dataclass(frozen=True)
class Figures:
    """``run.figures.latency_cdf()`` and so on; each gives a matplotlib ``Figure``, which is imported only then."""

    _run: Run

    def latency_cdf(self, of: str = "published") -> "Figure":
        """Distribution of response times, as shares of the ``published`` or of the ``answered`` frames."""
        return self._draw("latency_cdf", {self._run.name: self._run.tables["frames"]}, of=of)

    def latency_accuracy(self) -> "Figure":
        """Mean time to first answer against streaming F1, or against the proxy where the truth is not known."""
        from genie_sim.analysis.latency_accuracy import latency_accuracy

        return latency_accuracy(
            {self._run.name: self._run.measured}, self._run.methods, self._run.footer
        )

    def image_reuse(self) -> "Figure":
        """Hits / requests of the message caches, on cars and on edges."""
        return self._draw("image_reuse", {self._run.name: self._run.tables["lookups"]})

    def object_reuse(self) -> "Figure":
        """Object look-ups answered by an object with C >= C_T, on cars and on edges."""
        return self._draw("object_reuse", {self._run.name: self._run.tables["lookups"]})

    def confidence_boost(self) -> "Figure":
        """Running mean of C_new - C_old over the updates of the object maps."""
        return self._draw("confidence_boost", {self._run.name: self._run.tables["lookups"]})

    def resource_use(self) -> "Figure":
        """Use of devices and links, and queues, over simulated time."""
        return self._draw("resource_use", self._run.tables["resources"])

    def _draw(self, name: str, table: Any, **more: str) -> "Figure":
        """Imports matplotlib, which takes a while, only now."""
        from genie_sim.analysis import figures

        figure: Figure = getattr(figures, name)(table, self._run.methods, self._run.footer, **more)
        return figure


def run(
    scenario: str | Path | Mapping[str, Any] | Scenario,
    settings: Settings = (),
    *,
    seed: int | None = None,
    out: str | Path | None = None,
    progress: Progress | None = None,
) -> Run:
    """Simulates a scenario: a file or a shipped name, the same as a mapping, or one from ``load_scenario``.

    ``settings`` change single fields, as ``--set`` does: ``{"genie.eviction": "lru", "cars[0].link": "wifi"}``.
    ``seed`` is the root of all random streams (default: the scenario's). The run stays in memory, unless ``out`` names
    a folder that gets its result folder. ``progress`` is called with the seconds simulated, those to simulate, and the
    method. Raises ``UserError`` before anything is simulated.
    """
    setting = load_scenario(scenario, settings, seed=seed)
    if out is None:
        return _in_hand(runner.run_in_memory(setting, progress))
    return _in_hand(runner.run_to_folder(setting, expanded(out), progress))


def load(folder: str | Path) -> Run:
    """The run in a result folder. Raises ``UserError`` for anything else, or for one that is not whole."""
    return _in_hand(results.load(folder))


def compare(*results_: results.Run | str | Path, methods: Sequence[str] = ()) -> "Comparison":
    """Compares runs, or result folders, that saw the same frames, or the methods of one: paired differences with
    intervals, by seed where there are several of a setting, else by blocks of one second.

    ``methods``: which, the first of them to compare with. Raises ``UserError`` for what cannot be compared.
    """
    runs = [one if isinstance(one, results.Run) else results.load(one) for one in results_]
    return Comparison(comparing.compare(runs, methods))


@dataclass(frozen=True)
class Comparison:
    """Runs compared: ``table`` and ``settings`` as pandas tables, ``text()``, figures and a page."""

    _made: comparing.Comparison

    @cached_property
    def table(self) -> "pd.DataFrame":
        """One row per metric and method; see ``analysis.compare.Difference``."""
        import pandas as pd

        return pd.DataFrame(self._made.rows, columns=comparing.Difference._fields)

    @cached_property
    def settings(self) -> "pd.DataFrame":
        """What differs: a row per setting, a column per result."""
        import pandas as pd

        return pd.DataFrame.from_dict(
            dict(self._made.settings), orient="index", columns=list(self._made.names)
        )

    @property
    def figures(self) -> "Mapping[str, Figure]":
        """Overlaid distributions of response times, and latency against accuracy."""
        return comparison.figures(self._made)

    def text(self, format: str = "markdown") -> str:
        """The table as ``markdown``, ``csv`` or ``latex``."""
        return comparison.text(self._made, format)

    def report(self, folder: str | Path) -> Path:
        """Writes a page, figures and tables into a folder."""
        return comparison.write(self._made, expanded(folder))


def sweep(
    scenario: str | Path,
    axes: Mapping[str, Any],
    settings: Mapping[str, Any] | None = None,
    *,
    seeds: int | Sequence[int] = 5,
    samples: int | None = None,
    every_run: bool = False,
    jobs: int | None = None,
    out: str | Path | None = None,
    progress: Progress | None = None,
) -> "pd.DataFrame":
    """Simulates a scenario along axes, every point with all ``seeds`` (5: the seeds 1 to 5), in ``jobs`` processes
    (default: one a core).

    ``axes``: by name, as in a sweep's file, or by the path of a setting with a list of its values:
    ``{"genie.object_map.gate": ["1 m", "2 m"], "link": {"set": "cars[0].link", "list": ["wifi", "lte"]}}``.
    Returns one row per point, metric, method, placement and component: the axes' values, the mean over seeds
    (``value``), its 95 % t interval (``low``, ``high``) and the number of ``runs``; with ``every_run`` one row per run
    instead, which ``differences`` takes. ``out``: a folder that gets the sweep's folder, and what is there is not run
    again. Raises ``UserError``.
    """
    import pandas as pd

    from genie_sim import parallel
    from genie_sim.sweeps.design import read_design
    from genie_sim.sweeps.sweep import Sweep
    from genie_sim.sweeps.tasks import Local

    named = dict(_axis(path, axis) for path, axis in axes.items())
    given = {
        "name": "sweep",
        "scenario": str(scenario),
        "axes": named,
        "set": dict(settings or {}),
        "samples": samples,
    }
    design = read_design(
        {**given, "seeds": seeds if isinstance(seeds, int) else list(seeds)}, "sweep"
    )
    with tempfile.TemporaryDirectory() as scratch:
        work = Sweep.of(design, "sweep", expanded(out or scratch), progress)
        work.run(Local(jobs or parallel.workers_here()), progress=progress)
        made = work.finish(pictures=out is not None)
        return pd.read_parquet(
            made.folder / ("runs.parquet" if every_run else "table.parquet"), use_threads=False
        )


def _axis(path: str, axis: Any) -> tuple[str, Any]:
    """A list stands for an axis along the setting that its name says, called by the last word of the path."""
    if isinstance(axis, str) or not isinstance(axis, Sequence):
        return path, axis
    return re.findall(r"\w+", path)[-1], {"set": path, "list": list(axis)}


def differences(runs: "pd.DataFrame", along: str, to: Any) -> "pd.DataFrame":
    """Paired differences in a sweep's runs (``sweep(..., every_run=True)`` or ``runs.parquet``): of every value of the
    column ``along``, an axis or ``method``, from the value ``to``, seed by seed, with 95 % t intervals.

    Raises ``UserError``.
    """
    from genie_sim.sweeps import tables

    columns = list(runs.columns[3 : runs.columns.get_loc("metric")])
    return tables.differences(runs, columns, along, to)


def load_scenario(
    source: str | Path | Mapping[str, Any] | Scenario,
    settings: Settings = (),
    *,
    seed: int | None = None,
) -> Scenario:
    """A scenario, checked: a file or a shipped name, a mapping as in YAML, or another scenario, with ``settings``.

    Raises ``UserError``.
    """
    overrides = _overrides(settings)
    try:
        if isinstance(source, str | Path):
            return scenario.load_scenario(source, overrides, seed)
        if isinstance(source, Scenario):
            source = source.model_dump(mode="json", by_alias=True)
        return scenario.read_scenario({"name": "scenario", **source}, overrides, seed)
    except UserError as error:
        raise UserError(
            str(error).removeprefix("--set ")
        ) from error  # that is how the command line says it


def _in_hand(run: results.Run) -> Run:
    return Run(run.run_id, run.facts, run.yaml, run.tables, run.measured, run.folder)


def _overrides(settings: Settings) -> Sequence[str]:
    """``path=value`` texts; a value becomes JSON, which is YAML too."""
    if isinstance(settings, str):
        raise UserError(
            f"settings: must be a mapping or a list such as ['seed=3'], not the text {settings!r}"
        )
    if not isinstance(settings, Mapping):
        return settings
    return [f"{path}={json.dumps(value)}" for path, value in settings.items()]
