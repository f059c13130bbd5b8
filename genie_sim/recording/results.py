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

    @cached_property
    def frames(self) -> "pd.DataFrame":
        """One row per method, car, stream and frame."""
        return self.tables["frames"].to_frame()

    @cached_property
    def lookups(self) -> "pd.DataFrame":
        """One row per message for which a Genie asked its message cache or its object map."""
        return self.tables["lookups"].to_frame()

    @cached_property
    def resources(self) -> "pd.DataFrame":
        """One row per resource and sample."""
        return self.tables["resources"].to_frame()

    @cached_property
    def poses(self) -> "pd.DataFrame":
        """One row per car, stream and frame: where the camera stood."""
        return self.tables["poses"].to_frame()

    @cached_property
    def objects(self) -> "pd.DataFrame":
        """One row per change of an object map."""
        return self.tables["objects"].to_frame()

    @cached_property
    def answers(self) -> "pd.DataFrame":
        """One row per first and per fresh answer: how right it was, by the detector's own answer."""
        return self.tables["answers"].to_frame()

    @cached_property
    def held(self) -> "pd.DataFrame":
        """One row per car and instant: what its consumer held, against what was there."""
        return self.tables["held"].to_frame()

    @cached_property
    def held_objects(self) -> "pd.DataFrame":
        """One row per object that a consumer held or missed, and per time for which it did."""
        return self.tables["held_objects"].to_frame()

    @cached_property
    def steps(self) -> "pd.DataFrame":
        """One row per step on the way of an answer."""
        return self.tables["steps"].to_frame()

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
