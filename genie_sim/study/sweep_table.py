"""The result of a sweep in Python: a pandas table that draws the sweep's figures."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import pandas as pd

from genie_sim.analysis.style import PAGE_IN
from genie_sim.base.errors import UserError, unknown
from genie_sim.study import printed
from genie_sim.study.design import Design
from genie_sim.study.tables import differences

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class SweepPlots:
    """The figures of a sweep. Each method gives matplotlib's ``Figure``, which is imported only
    then; lines are means with 95 % intervals over seeds.

    Parameters
    ----------
    design : Design
        The sweep.
    runs : DataFrame
        ``tables.of_runs``.
    points : DataFrame
        ``tables.of_points``.
    titles : mapping of str to str
        What figures call each method.
    footer : str
        What was run.
    """

    design: Design
    runs: pd.DataFrame
    points: pd.DataFrame
    titles: Mapping[str, str]
    footer: str

    @classmethod
    def read(cls, folder: Path, allow_changed: bool = False) -> "SweepPlots":
        """Those of a finished sweep's folder. Raises ``UserError``."""
        return cls(*printed.drawn_from(folder, allow_changed))

    def figures(self, width_in: float = PAGE_IN) -> "dict[str, Figure]":
        """Every figure, by the name of its file."""
        from genie_sim.study import figures

        return dict(
            figures.of_sweep(self.design, self.runs, self.titles, self.footer, width_in=width_in)
        )

    def metric(self, name: str, width_in: float = PAGE_IN) -> "Figure":
        """One metric along the first axis, or as a heat map over the first two. Raises
        ``UserError`` for one that the sweep has no value of.
        """
        from genie_sim.study import figures

        return figures.of_metric(
            name,
            self.design,
            self.runs,
            titles=self.titles,
            footer=self.footer,
            width_in=width_in,
        )

    def along(self, axis: str) -> "Figure":
        """The main metrics along an axis, with a column of panels for each value of another one.
        Raises ``UserError`` for an axis that the sweep does not have.
        """
        return self._first_of(axis)

    def heat(self, first: str, second: str) -> "Figure":
        """A heat map over the first two axes. Raises ``UserError`` for other ones."""
        return self._first_of(f"{first}-{second}")

    def _first_of(self, name: str) -> "Figure":
        """The figure of that name; where the sweep has more axes, at their first values."""
        drawn = self.figures()
        if name not in drawn and f"{name}-1" in drawn:
            return drawn[f"{name}-1"]
        if name not in drawn:
            raise UserError(unknown("figure", name, drawn))
        return drawn[name]


class SweepTable(pd.DataFrame):
    """The table that ``gs.sweep`` returns. Its ``plot`` draws the figures of the sweep; what is
    made from the table is a plain table of pandas.
    """

    _metadata: ClassVar = ["_plots"]  # attributes that are no columns, as pandas wants it
    _plots: SweepPlots

    @classmethod
    def read(
        cls, folder: Path, allow_changed: bool = False, *, every_run: bool = False
    ) -> "SweepTable":
        """The table of a finished sweep's folder: its points, or ``every_run``. Raises
        ``UserError``.
        """
        plots = SweepPlots.read(folder, allow_changed)
        result = cls(plots.runs if every_run else plots.points)
        result._plots = plots
        return result

    def differences(self, along: str, to: Any) -> pd.DataFrame:
        """Paired differences, seed by seed: ``genie_sim.differences`` of the sweep's runs."""
        return differences(self._plots.runs, list(self._plots.design.columns.values()), along, to)

    @property
    def _constructor(self) -> Any:
        return pd.DataFrame

    @property
    def plot(self) -> SweepPlots:  # type: ignore[override]
        """The figures: ``table.plot.along("gate")``."""
        return self._plots
