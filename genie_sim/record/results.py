"""A finished run as plain data: its tables, its metrics and what decided it, also as read from a
result folder.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from genie_sim.base.errors import UserError, no_attribute, short_repr
from genie_sim.base.paths import expanded, read_text
from genie_sim.base.text import MAX_LABEL, one_line
from genie_sim.base.units import duration_ns, duration_text
from genie_sim.record import provenance
from genie_sim.record.columns import Columns
from genie_sim.record.records import SCHEMAS
from genie_sim.record.tables import read

if TYPE_CHECKING:
    import pandas as pd

NOT_ONE_RUN = {  # the file that tells, and what such a folder holds
    "verdicts.json": "a whole evaluation (read its verdicts.md)",
    "sweep.json": "a sweep (read its table.csv)",
}


# The files that a run's results are read from, besides run.json.
FILES = ("metrics.json", "scenario.resolved.yaml", *(f"{name}.parquet" for name in SCHEMAS))


@dataclass(frozen=True, slots=True)
class MethodInfo:
    """A method that ran: its name in the scenario, its title in figures, on one line, and whether
    others are compared with it.
    """

    name: str
    title: str
    baseline: bool

    def __post_init__(self) -> None:
        object.__setattr__(self, "title", one_line(self.title))


@dataclass(frozen=True, slots=True)
class MetricValue:
    """One number of a run.

    ``placement`` is ``car`` or ``edge`` for Genies and resources there, else ``all``. ``component``
    is the name of a resource, for an improvement that of the baseline, else empty. ``value`` is
    None where it is not defined; ``n`` counts what it was computed over: frames, requests, updates,
    samples or runs. Shares have unit 1. ``low`` and ``high`` are the 95 % interval, of one run that
    over blocks of one second; ``range_low`` and ``range_high`` the lowest and the highest running
    ratio of any Genie, or the value with all powers at one end of their ranges.
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
    range_low: float | None = None
    range_high: float | None = None

    @property
    def row(self) -> tuple[Any, ...]:
        """The values of its fields, in their order."""
        return _row_of(self)

    def of_seed(self, seed: int | None) -> tuple[Any, ...]:
        """The values of ``TIDY_FIELDS``, of this seed."""
        return (*self.row[:PLACE], seed, *self.row[PLACE:])


METRIC_FIELDS = tuple(field.name for field in fields(MetricValue))
PLACE = METRIC_FIELDS.index("value")  # so many fields say what the number is of
# The columns of every table of numbers; where a number is a mean over seeds, it has no seed.
TIDY_FIELDS = (*METRIC_FIELDS[:PLACE], "seed", *METRIC_FIELDS[PLACE:])
_row_of = attrgetter(*METRIC_FIELDS)


@dataclass(frozen=True, eq=False)
class Run:
    """One finished run.

    ``facts`` is everything that decided the outcome, ``yaml`` the scenario with every setting
    written out; ``folder`` is ``None`` for a run that was not written down, and ``changed`` names
    files in it that were changed since. ``label`` is what the user calls it, or empty. ``words``
    are what the folder says of each metric.
    ``tables`` holds the tables by name, as numpy columns. Each is an attribute as well, a pandas
    table that is made when it is first asked for: ``run.frames``. ``record.records`` describes
    the columns.
    """

    run_id: str
    facts: Mapping[str, Any]
    yaml: str
    tables: Mapping[str, Columns]
    measured: Sequence[MetricValue]
    folder: Path | None = None
    changed: Sequence[str] = ()
    label: str = ""
    words: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    def __getattr__(self, name: str) -> "pd.DataFrame":
        if name not in SCHEMAS:
            raise no_attribute(self, name)
        frame = self.__dict__[name] = self.tables[name].to_frame()
        return frame

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *SCHEMAS]

    def __repr__(self) -> str:
        where = self.folder if self.folder is not None else "not written to a folder"
        return f"<Run {self.name}-{self.run_id}: {len(self.tables['frames']):,} frames, {where}>"

    @property
    def name(self) -> str:
        """The scenario's name."""
        return str(self.facts["scenario"]["name"])

    @property
    def title(self) -> str:
        """What people read for it: its label, else the scenario's name."""
        return self.label or self.name

    @property
    def runs(self) -> "Sequence[Run]":
        """The run itself: functions that take runs of several seeds take it as well."""
        return (self,)

    @property
    def cells(self) -> "Mapping[str, Mapping[int, Run]]":
        """Its one setting, which has no name, as runs by seed."""
        return {"": {self.seed: self}}

    @property
    def seed(self) -> int:
        """The root of all random streams."""
        return int(self.facts["scenario"]["seed"])

    @property
    def warm_up_ns(self) -> int:
        """From when on it counts [ns]."""
        return duration_ns(self.facts["scenario"].get("warm_up", "0 s"))

    @property
    def methods(self) -> Sequence[MethodInfo]:
        """The methods that ran, in the order of the scenario."""
        return [MethodInfo(**method) for method in self.facts["methods"]]

    @property
    def footer(self) -> str:
        """Which run it is, below a figure."""
        which = f"{self.name}, run {self.run_id}, seed {self.seed}"
        return ", ".join(filter(None, [self.label, which, self.warm_up, self.warning]))

    @property
    def warm_up(self) -> str:
        """Says what is not counted; empty if all is."""
        return f"without the first {duration_text(self.warm_up_ns)}" if self.warm_up_ns else ""

    @property
    def warning(self) -> str:
        """Says which files were changed since the run wrote them; empty if none was."""
        return provenance.warning(self.changed)


def load(folder: str | Path, *, allow_changed: bool = False) -> Run:
    """The run in a result folder.

    Raises ``UserError`` for anything else, for a folder that is not whole, and, unless they are
    allowed, for files that were changed since the run wrote them.
    """
    folder = expanded(folder)
    for name, what in NOT_ONE_RUN.items():
        if (folder / name).is_file():
            for run in sorted(folder.glob("runs/seed-*")):
                raise UserError(
                    f"{folder}: holds several seeds, not one run; take one, such as {run}"
                )
            raise UserError(f"{folder}: holds {what}, not one run")
    about = provenance.read_run_json(folder)
    changed = changed_files(folder, about)
    provenance.refuse_changed(folder, changed, allow_changed)
    tables = {name: read(folder / f"{name}.parquet", schema) for name, schema in SCHEMAS.items()}
    with provenance.of_this_version(folder):
        measured = [
            MetricValue(**metric) for metric in provenance.read_json(folder / "metrics.json")
        ]
    yaml = read_text(folder / "scenario.resolved.yaml")
    return Run(
        run_id=about["run_id"],
        facts=about["facts"],
        yaml=yaml,
        tables=tables,
        measured=measured,
        folder=folder,
        changed=changed,
        label=checked_label(about.get("label", ""), f"{folder / 'run.json'}: label"),
        words=about.get("metrics", {}),
    )


def checked_label(label: object, where: str = "label") -> str:
    """A label, which may be empty; ``where`` it stands begins errors. Raises ``UserError``."""
    if not isinstance(label, str) or not label.isprintable() or len(label) > MAX_LABEL:
        raise UserError(
            f"{where}: must be one line of at most {MAX_LABEL} characters, not {short_repr(label)}"
        )
    return label.strip()


def changed_files(
    folder: Path, about: Mapping[str, Any], names: Iterable[str] = FILES
) -> tuple[str, ...]:
    """Of the files of a run's result folder those that are not what the run wrote; ``about`` is its
    ``run.json``. Raises ``UserError`` for one that is not there.
    """
    facts = () if provenance.is_of_its_id(about) else ("run.json",)
    return (*facts, *provenance.changed_files(folder, about.get("digests"), names))
