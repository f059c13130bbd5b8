"""A finished run as plain data: its tables, its metrics and what decided it, also as read from a
result folder.
"""

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from genie_sim.base.errors import UserError, as_user_error, no_attribute, short_repr
from genie_sim.base.paths import expanded, read_text
from genie_sim.base.text import MAX_LABEL, one_line
from genie_sim.base.units import duration_ns, duration_text
from genie_sim.record import provenance
from genie_sim.record.columns import Columns
from genie_sim.record.records import SCHEMAS
from genie_sim.record.tables import check_rows, read

if TYPE_CHECKING:
    import pandas as pd

NOT_ONE_RUN = {  # the file that tells, and what such a folder holds
    "verdicts.json": "a whole evaluation (read its verdicts.md)",
    "sweep.json": "a sweep (read its table.csv)",
}


CheckWords = Callable[[object, str], Mapping[str, Mapping[str, Any]]]
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


class MetricValue(NamedTuple):
    """One number of a run.

    ``placement`` is ``car`` or ``edge`` for Genies and resources there, else ``all``. ``component``
    is the name of a resource, for an improvement that of the baseline, else empty. ``value`` is
    None where it is not defined; ``n`` counts what it was computed over: frames, requests, updates,
    samples or runs; None is not known. Shares have unit 1. ``low`` and ``high`` are the 95 %
    interval, of one run that over blocks of one second; ``range_low`` and ``range_high`` the lowest
    and the highest running ratio of any Genie, or the value with all powers at one end of their
    ranges.
    """

    metric: str
    method: str
    placement: str
    component: str
    value: float | None
    unit: str
    low: float | None = None
    high: float | None = None
    n: int | None = None
    range_low: float | None = None
    range_high: float | None = None

    def check(self) -> None:
        """Raises ``ValueError``, which begins with the field, for what no metric has."""
        for name in ("metric", "method", "placement", "component", "unit"):
            if not isinstance(getattr(self, name), str):
                raise ValueError(f"{name}: must be text, not {short_repr(getattr(self, name))}")
        if self.n is not None and (type(self.n) is not int or self.n < 0):
            raise ValueError(f"n: must be a count, not {short_repr(self.n)}")
        for name in NUMBERS:
            number = getattr(self, name)
            if number is not None and not _is_finite(number):
                text = "must be a finite number, or null where it is not defined"
                raise ValueError(f"{name}: {text}, not {short_repr(number)}")
        for low, high in (("low", "high"), ("range_low", "range_high")):
            ends = getattr(self, low), getattr(self, high)
            if None not in ends and ends[0] > ends[1]:
                raise ValueError(f"{low}: {ends[0]} is more than {high}, {ends[1]}")
        around = (self.low, self.value, self.high)
        if None not in around and sorted(around) != [*around]:  # type: ignore[type-var]
            text = f"{self.value} is not within its interval, {self.low} to {self.high}"
            raise ValueError(f"value: {text}")

    def of_seed(self, seed: int | None) -> tuple[Any, ...]:
        """The values of ``TIDY_FIELDS``, of this seed."""
        return (*self[:PLACE], seed, *self[PLACE:])


METRIC_FIELDS = MetricValue._fields
PLACE = METRIC_FIELDS.index("value")  # so many fields say what the number is of
# The columns of every table of numbers; where a number is a mean over seeds, it has no seed.
TIDY_FIELDS = (*METRIC_FIELDS[:PLACE], "seed", *METRIC_FIELDS[PLACE:])
NUMBERS = ("value", "low", "high", "range_low", "range_high")
MAX_NUMBER = sys.float_info.max


def _is_finite(number: object) -> bool:
    """Whether it is a number, within those that floats reach."""
    return type(number) in (int, float) and abs(number) <= MAX_NUMBER  # type: ignore[arg-type]


@dataclass(frozen=True, eq=False)
class Run:
    """One finished run.

    ``facts`` is everything that decided the outcome, ``yaml`` the scenario with every setting
    written out; ``folder`` is ``None`` for a run that was not written down. ``measured`` are its
    numbers, those of ``metrics.json``. ``label`` is what the user calls it, or empty. ``words`` are
    what is said of metrics of the user's own. ``tables`` holds the tables by name, as numpy
    columns. Each is an attribute as well, a pandas table that is made when it is first asked for:
    ``run.frames``. ``record.records`` describes the columns.

    Of a cell of a sweep or an evaluation only the numbers of whole methods are at hand: it has no
    tables and no yaml, and of the facts its name and seed, ``methods`` and ``genie_sim``
    (``analysis.tidy.cells_of``).
    """

    run_id: str
    facts: Mapping[str, Any]
    yaml: str
    tables: Mapping[str, Columns]
    measured: Sequence[MetricValue]
    folder: Path | None = None
    label: str = ""
    words: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    def __getattr__(self, name: str) -> "pd.DataFrame":
        if name not in SCHEMAS or name not in self.tables:
            raise no_attribute(self, name)
        frame = self.__dict__[name] = self.tables[name].to_frame()
        return frame

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self.tables]

    def __repr__(self) -> str:
        where = self.folder if self.folder is not None else "not written to a folder"
        count = f"{len(self.tables['frames']):,} frames" if self.tables else "no tables"
        return f"<Run {self.name}-{self.run_id}: {count}, {where}>"

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
        return ", ".join(filter(None, [self.label, which, self.warm_up]))

    @property
    def warm_up(self) -> str:
        """Says what is not counted; empty if all is."""
        return f"without the first {duration_text(self.warm_up_ns)}" if self.warm_up_ns else ""


def load(folder: str | Path, check_words: CheckWords) -> Run:
    """The run in a result folder. ``check_words`` takes what ``run.json`` says of metrics, and
    where that stands, and returns what it says of those of the user's own. Commands call
    ``seed_runs.load_run``.

    Raises ``UserError`` for anything else, for a folder that is not whole, and for files that were
    changed since the run wrote them.
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
    provenance.check_unchanged(folder, about, FILES)
    tables = {name: read(folder / f"{name}.parquet", schema) for name, schema in SCHEMAS.items()}
    for name, schema in SCHEMAS.items():
        check_rows(folder / f"{name}.parquet", schema, tables[name], about["rows"].get(name))
    measured = _read_metrics(folder / "metrics.json", about)
    yaml = read_text(folder / "scenario.resolved.yaml")
    return Run(
        run_id=about["run_id"],
        facts=about["facts"],
        yaml=yaml,
        tables=tables,
        measured=measured,
        folder=folder,
        label=checked_label(about.get("label", ""), f"{folder / 'run.json'}: label"),
        words=check_words(about["metrics"], f"{folder / 'run.json'}: metrics"),
    )


def _read_metrics(path: Path, about: Mapping[str, Any]) -> list[MetricValue]:
    """The numbers of the run that ``about``, its ``run.json``, tells of. Raises ``UserError`` that
    names row and field.
    """
    rows = provenance.read_json(path)
    if not isinstance(rows, list):
        raise UserError(f"{path}: must be a list, not {short_repr(rows)}")
    known = {
        "metric": about["metrics"],
        "method": [method["name"] for method in about["facts"]["methods"]],
    }
    places: dict[tuple[object, ...], int] = {}
    measured = []
    for place, row in enumerate(rows):
        with as_user_error(f"{path}: row {place}", ValueError):
            if not isinstance(row, dict) or row.keys() != set(METRIC_FIELDS):
                raise ValueError(f"must be a mapping of {', '.join(METRIC_FIELDS)}")
            metric = MetricValue(**row)
            metric.check()
            for name, names in known.items():
                if getattr(metric, name) not in names:
                    text = f"run.json tells of none called {short_repr(getattr(metric, name))}"
                    raise ValueError(f"{name}: {text}")
            earlier = places.setdefault(metric[:PLACE], place)
            if earlier != place:
                raise ValueError(f"metric: the same as in row {earlier}")
        measured.append(metric)
    return measured


def checked_label(label: object, where: str = "label") -> str:
    """A label, which may be empty; ``where`` it stands begins errors. Raises ``UserError``."""
    if not isinstance(label, str) or not label.isprintable() or len(label) > MAX_LABEL:
        raise UserError(
            f"{where}: must be one line of at most {MAX_LABEL} characters, not {short_repr(label)}"
        )
    return label.strip()
