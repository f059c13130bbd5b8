"""What is written of results for people to look at."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from genie_sim.analysis.seed_runs import SeedRuns
from genie_sim.analysis.style import RUN_FIGURES
from genie_sim.record.folders import Attempt, derived, write_summary
from genie_sim.record.provenance import contained

if TYPE_CHECKING:
    from genie_sim.record.results import Run


@dataclass(frozen=True)
class Output:
    """What is written besides tables and ``summary.md``.

    Parameters
    ----------
    page : bool
        Whether what people look at in a browser is made: ``report.html`` of a run, of several seeds
        and of each of them; of a sweep its figures.
    figures : sequence of str
        The formats of the figures of a run, such as ``svg``; none: no figures.
    """

    page: bool = True
    figures: Sequence[str] = ()

    def write(self, results: "Run | SeedRuns", folder: Path) -> None:
        """Writes the summary, the figures and the page of results into their folder. Raises
        ``NotDerivedError``.
        """
        with derived(folder) as attempt:
            self.make(results, folder, attempt)

    def make(self, results: "Run | SeedRuns", folder: Path, attempt: Attempt) -> None:
        """The same, each by an ``attempt`` of ``derived``."""
        from genie_sim.analysis import summary

        with attempt("summary.md"):
            write_summary(folder / "summary.md", summary.markdown(results))
        if not (self.page or self.figures):
            return
        from genie_sim.analysis import figures  # imports matplotlib
        from genie_sim.report import pages, template

        makers = figures.makers(results)
        if self.figures:
            with attempt("figures"):
                drawn = {name: draw() for name, draw in makers.items()}
                figures.save_all(drawn, contained(folder, "figures"), self.figures)
        if self.page:
            with attempt(template.NAME):
                if isinstance(results, SeedRuns):
                    page = pages.of_seeds(results, makers)
                else:
                    page = pages.of_run(results, makers)
                template.write(folder / template.NAME, page)


DEFAULT_OUTPUT = Output()
SHOWN = (  # the names of all that it may write
    "summary.md",
    "report.html",
    *(f"figures/{name}.{format}" for name in RUN_FIGURES for format in ("svg", "png", "pdf")),
)
