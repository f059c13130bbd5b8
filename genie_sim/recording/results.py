"""A finished run as plain data: its tables, its metrics and what decided it, also as read from a result folder."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from genie_sim.errors import UserError
from genie_sim.paths import expanded, read_text
from genie_sim.recording import provenance
from genie_sim.recording.columns import Columns
from genie_sim.recording.records import SCHEMAS
from genie_sim.recording.tables import read

if TYPE_CHECKING:
    import pandas as pd

NOT_ONE_RUN = {  # the file that tells, and what such a folder holds
    "verdicts.json": "a whole evaluation (read its verdicts.md)",
    "sweep.json": "a sweep (read its table.csv)",
}


@dataclass(frozen=True, slots=True)
class MethodInfo:
    """A method that ran: its name in the scenario, its title in figures, and whether others are compared with it."""

    name: str
    title: str
    baseline: bool


@dataclass(frozen=True, slots=True)
class Metric:
    """One number of a run.

    ``placement`` is ``car`` or ``edge`` for Genies and resources there, else ``all``. ``component`` is the name of a
    resource, for an improvement that of the baseline, else empty. ``value`` is None where it is not defined; ``n``
    counts what it was computed over: frames, requests, updates, samples or runs. Shares have unit 1. What ``low`` and
    ``high`` mean: ``analysis.metrics``.
    """

    metric: str
    method: str
    placement: str
    component: str
    value: float | None
    unit: str
    low: float | None = None
    high: float | None = None
    n: int = 0


def _as_pandas(name: str) -> "cached_property[pd.DataFrame]":
    return cached_property(lambda run: run.tables[name].to_frame())


@dataclass(frozen=True, eq=False)
class Run:
    """One finished run.

    ``facts`` is everything that decided the outcome, ``yaml`` the scenario with every setting written out; ``folder``
    is ``None`` for a run that was not written down. ``tables`` holds the tables by name, as numpy columns; ``frames``
    and so on are the same as pandas tables, made when they are first asked for. The columns are described, with their
    units, in ``genie_sim.recording.records``.
    """

    run_id: str
    facts: Mapping[str, Any]
    yaml: str
    tables: Mapping[str, Columns]
    measured: Sequence[Metric]
    folder: Path | None = None

    frames = _as_pandas("frames")
    lookups = _as_pandas("lookups")
    resources = _as_pandas("resources")
    poses = _as_pandas("poses")
    objects = _as_pandas("objects")
    answers = _as_pandas("answers")
    held = _as_pandas("held")
    held_objects = _as_pandas("held_objects")
    steps = _as_pandas("steps")

    def __repr__(self) -> str:
        where = self.folder if self.folder is not None else "not written to a folder"
        return f"<Run {self.name}-{self.run_id}: {len(self.tables['frames']):,} frames, {where}>"

    @property
    def name(self) -> str:
        """The scenario's name."""
        return str(self.facts["scenario"]["name"])

    @property
    def methods(self) -> Sequence[MethodInfo]:
        """The methods that ran, in the order of the scenario."""
        return [MethodInfo(**one) for one in self.facts["methods"]]

    @property
    def footer(self) -> str:
        """Which run it is, below a figure."""
        return f"{self.name}, run {self.run_id}, seed {self.facts['scenario']['seed']}"


def load(folder: str | Path) -> Run:
    """The run in a result folder. Raises ``UserError`` for anything else, or for one that is not whole."""
    folder = expanded(folder)
    for name, what in NOT_ONE_RUN.items():
        if (folder / name).is_file():
            raise UserError(f"{folder}: holds {what}, not one run")
    made = provenance.read_run_json(folder)
    tables = {schema.name: read(folder / f"{schema.name}.parquet", schema) for schema in SCHEMAS}
    with provenance.of_this_version(folder):
        measured = [Metric(**metric) for metric in provenance.read_json(folder / "metrics.json")]
    yaml = read_text(folder / "scenario.resolved.yaml")
    return Run(made["run_id"], made["facts"], yaml, tables, measured, folder)
