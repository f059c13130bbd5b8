"""A run in hand: its tables, metrics and figures, straight from the simulation or read from a result folder."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from genie_sim.analysis.metrics import Metric
from genie_sim.errors import UserError
from genie_sim.paths import expanded
from genie_sim.recording import provenance, records
from genie_sim.scenario.scenario import Scenario, read_scenario

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


NOT_ONE_RUN = {  # the file that tells, and what such a folder holds
    "verdicts.json": "a whole evaluation (read its verdicts.md)",
    "sweep.json": "a sweep (read its table.csv)",
}


@dataclass(frozen=True, eq=False)
class Run:
    """One finished run.

    The columns of ``frames``, ``lookups``, ``resources``, ``poses``, ``objects`` and ``truth`` (``None`` where it is
    not known) are described, with their units, in ``genie_sim.recording.records``. ``facts`` is everything that
    decided the outcome, ``yaml`` the scenario with every setting written out; ``folder`` is ``None`` for a run that was
    not written down.
    """

    run_id: str
    facts: Mapping[str, Any]
    yaml: str
    frames: pd.DataFrame
    lookups: pd.DataFrame
    resources: pd.DataFrame
    poses: pd.DataFrame
    objects: pd.DataFrame
    measured: Sequence[Metric]
    folder: Path | None = None
    truth: pd.DataFrame | None = None

    def __repr__(self) -> str:
        where = self.folder if self.folder is not None else "not written to a folder"
        return f"<Run {self.name}-{self.run_id}: {len(self.frames):,} frames, {where}>"

    @property
    def name(self) -> str:
        """The scenario's name."""
        return str(self.facts["scenario"]["name"])

    @cached_property
    def scenario(self) -> Scenario:
        """The scenario as it was run."""
        return read_scenario(self.facts["scenario"], where=self.name)

    @cached_property
    def metrics(self) -> pd.DataFrame:
        """One row per metric: name, role, value, unit, low, high, n. What low and high mean: ``analysis.metrics``."""
        import pandas as pd

        return pd.DataFrame([asdict(metric) for metric in self.measured])

    @property
    def figures(self) -> Figures:
        """The paper's figures, of this run."""
        return Figures(self)

    def report(self, path: str | Path | None = None) -> Path:
        """Writes one HTML page to look at the run in a browser; default: ``report.html`` in the run's folder."""
        from genie_sim import report

        if path is None:
            if self.folder is None:
                raise UserError("report: a run without a folder needs a path, such as run.report('report.html')")
            path = self.folder / report.NAME
        path = expanded(path)
        report.write(path, self)
        return path


@dataclass(frozen=True)
class Figures:
    """``run.figures.latency_cdf()`` and so on; each gives a matplotlib ``Figure``."""

    _run: Run

    def latency_cdf(self, of: str = "published") -> Figure:
        """Distribution of response times, as shares of the ``published`` or of the ``answered`` frames."""
        from genie_sim.analysis import figures

        return figures.latency_cdf({self._run.name: self._run.frames}, self._footer, of)

    def image_reuse(self) -> Figure:
        """Hits / requests of the message caches, on cars and on edges."""
        from genie_sim.analysis import figures

        return figures.image_reuse({self._run.name: self._run.lookups}, self._footer)

    def object_reuse(self) -> Figure:
        """Object look-ups answered by an object with C >= C_T, on cars and on edges."""
        from genie_sim.analysis import figures

        return figures.object_reuse({self._run.name: self._run.lookups}, self._footer)

    def confidence_boost(self) -> Figure:
        """Running mean of C_new - C_old over the updates of the object maps."""
        from genie_sim.analysis import figures

        return figures.confidence_boost({self._run.name: self._run.lookups}, self._footer)

    def resource_use(self) -> Figure:
        """Use of devices and links, and queues, over simulated time."""
        from genie_sim.analysis import figures

        return figures.resource_use(self._run.resources, self._footer)

    @property
    def _footer(self) -> str:
        return f"{self._run.name}, run {self._run.run_id}, seed {self._run.facts['scenario']['seed']}"


def load(folder: str | Path) -> Run:
    """The run in a result folder. Raises ``UserError`` for anything else, or for one that is not whole."""
    folder = expanded(folder)
    for name, what in NOT_ONE_RUN.items():
        if (folder / name).is_file():
            raise UserError(f"{folder}: holds {what}, not one run")
    made = provenance.read_run_json(folder)
    tables = {
        table.name: records.read(folder / f"{table.name}.parquet", table)
        for table in (
            records.FrameTable,
            records.LookupTable,
            records.ResourceTable,
            records.PoseTable,
            records.ObjectTable,
        )
    }
    known = folder / f"{records.TruthTable.name}.parquet"
    truth = records.read(known, records.TruthTable) if known.is_file() else None
    with provenance.of_this_version(folder):
        measured = [Metric(**metric) for metric in provenance.read_json(folder / "metrics.json")]
    yaml = _text(folder / "scenario.resolved.yaml")
    return Run(made["run_id"], made["facts"], yaml, **tables, measured=measured, folder=folder, truth=truth)


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        raise UserError(f"{path}: cannot be read: {error}") from error
