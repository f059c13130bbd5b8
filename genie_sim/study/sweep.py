"""A finished sweep: its tables for pandas, figures, a table for a paper, and a page."""

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from genie_sim.analysis import renderers
from genie_sim.analysis.metric import SHORT
from genie_sim.analysis.registry import (
    METRICS,
    Words,
    checked,
    checked_words,
    definition,
    shown,
)
from genie_sim.analysis.result_table import Cell, ResultTable, Row
from genie_sim.analysis.seed_runs import SWEEP_FILE, read_about
from genie_sim.analysis.style import PAGE_IN
from genie_sim.analysis.tidy import cells_of, level_text
from genie_sim.base import parquet
from genie_sim.base.errors import Suggesting, UserError, unknown
from genie_sim.base.progress import Progress
from genie_sim.base.text import one_line
from genie_sim.record import provenance
from genie_sim.record.results import (
    METRIC_FIELDS,
    NUMBERS,
    PLACE,
    MethodInfo,
    Run,
    checked_label,
)
from genie_sim.report.result import Result, named
from genie_sim.study.design import Design, read_design
from genie_sim.study.tables import BEFORE_AXES, differences

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from genie_sim.study.figures import SweepFigures

READ = ("runs.parquet", "table.parquet")  # what is read, besides sweep.json
MAX_ROWS = 50  # of a table in LaTeX


def footer_of(design: Design, label: str = "") -> str:
    """Which sweep it is, below a figure."""
    numbers = design.seeds
    few = len(numbers) <= 5
    seeds = f"seeds {', '.join(map(str, numbers))}" if few else f"{len(numbers)} seeds"
    subject = f"sweep {design.name} of {design.scenario}"
    points = f"{design.runs // len(numbers)} points"
    return ", ".join(filter(None, [label, subject, points, seeds]))


def unique_titles(titles: Mapping[str, str]) -> dict[str, str]:
    """The title of each method on one line; its name, where two have the same title."""
    titles = {name: one_line(title) for name, title in titles.items()}
    of_all = list(titles.values())
    return {name: title if of_all.count(title) == 1 else name for name, title in titles.items()}


@dataclass(frozen=True, eq=False, repr=False)
class Sweep(Suggesting, Result):
    """A finished sweep.

    Parameters
    ----------
    design : Design
        What was varied.
    about : mapping
        What ``sweep.json`` says.
    every_run : DataFrame
        ``tables.of_runs``: a row per point, seed and number.
    means : DataFrame
        ``tables.of_points``: a row per point and number, with means over seeds and their 95 % t
        intervals.
    folder : Path or None
        Where it is; ``None`` for one in memory.
    label : str
        What the user calls it; empty: by its name.
    """

    design: Design
    about: Mapping[str, Any]
    every_run: "pd.DataFrame"
    means: "pd.DataFrame"
    folder: Path | None
    label: str = ""

    @classmethod
    def read(cls, folder: Path) -> "Sweep":
        """See ``Result``."""
        with provenance.of_this_version(folder):
            about, path = read_about(folder), folder / SWEEP_FILE
            runs, points = (_table(provenance.contained(folder, name)) for name in READ)
            own = checked_words(about.get("metrics", {}), f"{path}: metrics")
            about = {**about, "metrics": own}
            provenance.check_unchanged(folder, about, READ)
            design = read_design(about["sweep"], str(path))
            label = checked_label(about.get("label", ""), f"{path}: label")
            return cls(design, about, runs, points, folder, label)

    def __repr__(self) -> str:
        where = self.folder if self.folder is not None else "not written to a folder"
        return f"<Sweep {self.footer}: {where}>"

    @property
    def metrics(self) -> "pd.DataFrame":
        """A row per point and number: the axes' values, and the fields of ``MetricValue``."""
        return self.means

    @property
    def title(self) -> str:
        """What people read for it: its label, else its name."""
        return self.label or self.design.name

    @property
    def footer(self) -> str:
        """Which sweep it is, below a figure."""
        return footer_of(self.design, self.label)

    @property
    def titles(self) -> dict[str, str]:
        """What people read for each method, in the order in which they ran."""
        titles = self.about.get("titles", {})
        names = dict.fromkeys(self.means["method"].dropna())
        return unique_titles({name: str(titles.get(name, name)) for name in names})

    @property
    def words(self) -> Words:
        """What is said of metrics of the user's own."""
        words: Words = self.about.get("metrics", {})
        return words

    @property
    def axes(self) -> list[str]:
        """The columns of the axes."""
        columns = list(map(str, self.means.columns))
        return columns[1 : columns.index("metric")]

    def chosen(self, methods: Sequence[str] = (), label: str = "") -> "Sweep":
        """See ``Result``."""
        for name in methods:
            if name not in self.titles:
                raise UserError(f"methods: {self.title}: {unknown('method', name, self.titles)}")
        order = {name: place for place, name in enumerate(dict.fromkeys(methods or self.titles))}
        runs, points = (
            table[table["method"].isin(order)].sort_values(
                by,
                key=lambda column: column.map(order) if column.name == "method" else column,
                kind="stable",
            )
            for table, by in (
                (self.every_run, [*BEFORE_AXES, "method"]),
                (self.means, [BEFORE_AXES[0], "method"]),
            )
        )
        return replace(self, every_run=runs, means=points, label=label or self.label)

    @cached_property
    def cells(self) -> Mapping[str, Mapping[int, Run]]:
        """Each point by the values of its axes; see ``cells_of``."""
        baselines = self.about.get("baselines", ())
        with provenance.of_this_version(self.folder):
            return cells_of(
                self.every_run,
                self.axes,
                [MethodInfo(name, title, name in baselines) for name, title in self.titles.items()],
                name=self.design.name,
                genie_sim=self.about["genie_sim"],
                origin=self.about["run_ids"],
                label=self.label,
                words=self.words,
            )

    def differences(self, along: str, to: Any) -> "pd.DataFrame":
        """Paired differences, seed by seed, with 95 % t intervals: of every value of the column
        ``along``, an axis or ``method``, from the value ``to``. Raises ``UserError``.
        """
        return differences(self.every_run, self.axes, along, to)

    def figures(self, width_in: float | None = None) -> "dict[str, Figure]":
        """See ``Result``."""
        with provenance.of_this_version(self.folder):
            return dict(self._figures(width_in).drawn())

    def figure(self, name: str, width_in: float | None = None) -> "Figure":
        """One figure, or one metric along the first axis."""
        if name in {*METRICS, *self.every_run["metric"]} - {*self.design.axes}:
            with provenance.of_this_version(self.folder):
                return self._figures(width_in).of(name)
        figure: Figure = named(name, self.figures(width_in))
        return figure

    def _figures(self, width_in: float | None) -> "SweepFigures":
        from genie_sim.study.figures import SweepFigures

        width_in = width_in or PAGE_IN
        return SweepFigures(
            self.design, self.every_run, self.titles, self.footer, width_in, self.words
        )

    def text(self, format: str = "markdown", metrics: Sequence[str] = ()) -> str:
        """The points: in ``csv`` every metric with all digits, in ``latex`` the main metrics with
        their intervals, in ``markdown`` the same without; or these ``metrics``.
        """
        with provenance.of_this_version(self.folder):
            renderers.checked(format)
            points = self.means
            if checked(metrics, points["metric"]):
                points = points[points["metric"].isin(metrics)]
            if format == "csv":
                return renderers.csv_of_table(points)
            table = self._table(metrics)
            if format == "markdown":
                return renderers.markdown(replace(table, title=""), intervals=False)
            seeds = len(self.design.seeds)
            brackets = (
                ", in brackets their 95 % t intervals," if points["low"].notna().any() else ""
            )
            several = f"Means{brackets} over {seeds} seeds."
            notes = [several if seeds > 1 else "One seed."]
            if len(table.rows) > MAX_ROWS:
                notes.append(
                    f"The first {MAX_ROWS} of {len(table.rows)} rows; all are in table.csv."
                )
            title = f"Sweep {self.title} of {self.design.scenario}"
            title += "" if metrics else ": main results"
            if self.axes:
                title += f" along {' and '.join(self.axes)}"
            shown_rows = table.rows[:MAX_ROWS]
            return renderers.latex(
                replace(table, title=title, rows=shown_rows, notes=[*notes, *table.notes]),
                self.title,
            )

    def _table(self, metrics: Sequence[str] = ()) -> ResultTable:
        """A row for each point and method, with the main metrics of methods as a whole, or with
        these in each placement. Raises ``UserError`` for a metric of components alone.
        """
        points = self.means
        method_rows = points[points["component"] == ""]
        places = dict.fromkeys(zip(method_rows["metric"], method_rows["placement"], strict=True))
        columns = [
            (name, "all") for name in shown(SHORT, method_rows["metric"]) if (name, "all") in places
        ]
        if metrics:
            columns = [place for name in metrics for place in places if place[0] == name]
        for name in metrics:
            if name not in (of for of, _ in columns):
                is_of_parts = (points["metric"] == name).any()
                why = "is not of a method as a whole; format csv has it"
                why = why if is_of_parts else "this sweep has no value of it"
                raise UserError(f"metrics: {name}: {why}")
        rows = []
        for (_, method), of_row in method_rows.groupby(["point", "method"], sort=False):
            by_place = of_row.set_index(["metric", "placement"])
            levels = [level_text(of_row.iloc[0][axis]) for axis in self.axes]
            first, *others = [*levels, self.titles.get(str(method), str(method))]
            cells = [
                definition(key[0], self.words).cell(
                    *(by_place[end][key] for end in ("value", "low", "high"))
                )
                if key in by_place.index
                else Cell()
                for key in columns
            ]
            rows.append(Row(first, [*map(Cell, others), *cells]))
        about = [(definition(name, self.words), placement) for name, placement in columns]
        labels = [metric.labelled(metric.titled(placement)) for metric, placement in about]
        corner, *keys = [*self.axes, "method"]
        idle = [axis for axis in self.axes if self._changes_nothing(axis)]
        notes = [f"No number changes with {', '.join(idle)}."] if idle else []
        return ResultTable([*keys, *labels], rows, self.title, notes, corner, len(keys))

    def _changes_nothing(self, axis: str) -> bool:
        """Whether every number is the same under each of the axis's values, all else equal."""
        others = [name for name in self.axes if name != axis]
        numbers = self.means.groupby([*others, *METRIC_FIELDS[:PLACE]], dropna=False)["value"]
        levels = self.means[axis].nunique()
        are_compared = levels > 1 and (numbers.size() == levels).all()
        return bool(are_compared and (numbers.nunique(dropna=False) == 1).all())

    def page(self) -> str:
        """The text of a page about the sweep: its main metrics, and its figures."""
        from genie_sim.report import pages

        with provenance.of_this_version(self.folder):
            arms = list(self.titles.values())
            return pages.of_table(self._table(), arms, self.footer, self.figures())

    def rerun(self, progress: Progress | None = None) -> Iterator[str]:
        """A line for each run whose metrics differ, and one for all."""
        from genie_sim.base.parallel import workers_here
        from genie_sim.study.plan import plan
        from genie_sim.study.work import Parts

        if self.folder is None:
            raise UserError("rerun: the result has no folder")
        with provenance.of_this_version(self.folder):
            methods = self.about["methods"]
        planned = plan(self.design, str(self.folder / SWEEP_FILE), methods=methods)
        parts = Parts(self.folder)
        if unknown_runs := planned.runs.keys() - parts.done(planned.runs):
            place = planned.runs[min(unknown_runs)].place
            why = "another version or another file than when it was made"
            raise UserError(f"{self.folder}: {place}: not there: {why}")
        runs = [replace(run, keep=False) for run in planned.runs.values()]
        with tempfile.TemporaryDirectory() as scratch:
            scratch_parts = Parts(Path(scratch))
            scratch_parts.run(runs, workers_here(), progress)
            different = [
                f"{number}. {run.place}: DIFFERENT"
                for number, run in enumerate(runs, 1)
                if scratch_parts.metrics(run.run_id) != parts.metrics(run.run_id)
            ]
        yield from different
        if different:
            many = f"{len(different)} of {len(runs)}"
            raise UserError(f"{self.folder}: {many} runs do not reproduce")
        yield f"{self.folder}: reproduced, the metrics of {len(runs):,} runs"

    def _repr_html_(self) -> str:
        return renderers.html(replace(self._table(), notes=[self.footer]))


def _table(path: Path) -> "pd.DataFrame":
    """A table of a sweep. Raises ``UserError``."""
    if not path.exists():
        raise UserError(f"{path}: missing; the sweep is not finished, run it again for the rest")
    table, _ = parquet.read(path, "table of a sweep", partial(_columns_of, path))
    read: pd.DataFrame = table.to_pandas()
    return read


def _columns_of(path: Path, schema: Any, _about: object) -> list[str]:
    """All columns of a table of a sweep. Raises ``UserError`` where some are missing, or of other
    types than a sweep writes.
    """
    import pyarrow.types as of

    scalars = (of.is_integer, of.is_floating, of.is_boolean, of.is_large_string, of.is_null)
    kinds: dict[str, tuple[Any, ...]] = {"n": (of.is_integer, of.is_floating)}
    kinds |= dict.fromkeys(METRIC_FIELDS[:PLACE], (of.is_large_string,))
    kinds |= dict.fromkeys(NUMBERS, (of.is_floating,))
    for name in (BEFORE_AXES[0], *METRIC_FIELDS):
        if name not in schema.names:
            raise UserError(f"{path}: is no table of a sweep: it has no column {name}")
    for name, type in zip(schema.names, schema.types, strict=True):
        if not any(is_of_kind(type) for is_of_kind in kinds.get(name, scalars)):
            raise UserError(f"{path}: column {name}: a sweep writes none of {type}")
    names: list[str] = schema.names
    return names
