"""The paper's whole evaluation: replicated runs, verdicts and figures in one folder.

Nothing here decides anything: the scenarios and assumptions.yaml do, before; claims.yaml says what
is tested.
"""

import logging
import tempfile
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from genie_sim.analysis import registry, renderers
from genie_sim.analysis.registry import definition
from genie_sim.analysis.seed_runs import seeds_text
from genie_sim.analysis.tidy import across_seeds, cells_of
from genie_sim.base.errors import Suggesting, UserError
from genie_sim.base.parallel import workers_here
from genie_sim.base.paths import sha256_of
from genie_sim.base.progress import Progress
from genie_sim.paper import claims, curves, numbers, page, printed, runs, sources
from genie_sim.paper.checks import judge
from genie_sim.paper.evidence import BASE, Evidence
from genie_sim.paper.sources import ASSUMPTIONS
from genie_sim.record import folders, provenance
from genie_sim.record.results import Run
from genie_sim.report import template
from genie_sim.report.result import Result
from genie_sim.scenario.yaml_input import read_mapping

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from genie_sim.paper.curves import Curves

log = logging.getLogger(__name__)
QUICK_SEEDS = 2
FIGURES = ("latency_cdf", "image_reuse", "object_reuse", "confidence_boost", "case_study")
FILES = (numbers.FILE, curves.FILE, printed.VERDICTS)  # what is read, besides run.json
# what is derived from the numbers
SHOWN = (printed.DOCUMENT, template.NAME, *(f"figures/{name}.svg" for name in FIGURES))


@dataclass(frozen=True, eq=False, repr=False)
class Reproduction(Suggesting, Result):
    """A finished evaluation.

    Parameters
    ----------
    rows : sequence of mapping
        The table of the paper as plain data, a row a claim (``claims.row``).
    numbers : pandas.DataFrame
        Every number of every run: variant, scenario, seed, metric, method, placement, component and
        value.
    curves : mapping
        The points that figures draw.
    about : mapping
        How it came about: seeds, and the versions of sources and packages.
    folder : Path or None
        Where it is; ``None`` for one in memory.
    """

    rows: Sequence[dict[str, Any]]
    numbers: "pd.DataFrame"
    curves: "Curves"
    about: Mapping[str, Any]
    folder: Path | None = None

    @classmethod
    def read(cls, folder: Path) -> "Reproduction":
        """See ``Result``."""
        with provenance.of_this_version(folder):
            rows = printed.read_rows(folder)
            about = printed.read_about(folder)
            provenance.check_unchanged(folder, about, FILES)
            curve_points = curves.read(folder / curves.FILE)
            return cls(rows, numbers.read(folder), curve_points, about, folder)

    def __repr__(self) -> str:
        where = self.folder if self.folder is not None else "not written to a folder"
        return f"<Reproduction of the paper, {seeds_text(self.about['seeds'])}, {where}>"

    @cached_property
    def metrics(self) -> "pd.DataFrame":
        """One row per variant, scenario and number: the mean over seeds, and its 95 % t interval;
        see ``MetricValue``.
        """
        names = [*numbers.Number._fields, "variant", "scenario"]
        table = self.numbers.astype(dict.fromkeys(names, str))
        units = {name: definition(name).unit_in_files for name in set(table["metric"])}
        runs = table.assign(unit=table["metric"].map(units))
        return across_seeds(runs, ["variant", "scenario"])

    @cached_property
    def cells(self) -> Mapping[str, Mapping[int, Run]]:
        """Each scenario of the paper; see ``cells_of``."""
        return cells_of(
            self.numbers[self.numbers["variant"] == BASE],
            ["scenario"],
            numbers.METHODS,
            name="evaluation",
            genie_sim=self.about["genie_sim"],
            origin=self.about.get("sources"),
        )

    def chosen(self, methods: Sequence[str] = (), label: str = "") -> "Reproduction":
        """Itself: its figures and its table are of claims. Raises ``UserError`` for anything
        else.
        """
        for option, names in (("methods", methods), ("label", label)):
            if names:
                where = self.folder or "an evaluation"
                raise UserError(
                    f"{option}: {where} is an evaluation: its figures and its table are of claims"
                )
        return self

    def text(self, format: str = "markdown", metrics: Sequence[str] = ()) -> str:
        """The table of the paper in ``markdown``; in ``csv`` every number of each scenario, or
        these ``metrics``, as means over seeds.
        """
        if renderers.checked(format) == "csv":
            table = self.metrics
            if registry.checked(metrics, table["metric"]):
                table = table[table["metric"].isin(metrics)]
            return renderers.csv_of_table(table)
        if metrics:
            raise UserError("metrics: the table of an evaluation is of claims; format csv has them")
        if format != "markdown":
            raise UserError("format: an evaluation has markdown and csv")
        return f"{printed.in_markdown(self.rows)}\n"

    def page(self) -> str:
        """See ``Result``."""
        with provenance.of_this_version(self.folder):
            return page.page(self, self.figures())

    def rerun(self, progress: Progress | None = None) -> Iterator[str]:
        """A line for each number that differs, and one for all."""
        if self.folder is None:
            raise UserError("rerun: the result has no folder")
        planned = runs.planned(self.about["seeds"])
        with tempfile.TemporaryDirectory() as scratch:
            fresh_numbers, _ = runs.simulate(planned, Path(scratch), workers_here(), progress)
        different = numbers.table_differences(self.numbers, fresh_numbers)
        yield from different
        if different:
            raise UserError(f"{self.folder}: {len(different)} numbers do not reproduce")
        yield f"{self.folder}: reproduced, {len(fresh_numbers):,} numbers of {len(planned):,} runs"

    @property
    def sentences(self) -> list[str]:
        """What of the paper holds, in three sentences."""
        return claims.sentences(self.rows)

    @property
    def table(self) -> "pd.DataFrame":
        """The table of the paper, a row a claim."""
        import pandas as pd

        return pd.DataFrame(self.rows).set_index("id")

    def figures(self, width_in: float | None = None) -> "Mapping[str, Figure]":
        """The five figures of the paper, by name."""
        from genie_sim.paper import figures

        with provenance.of_this_version(self.folder):
            return figures.of_numbers(self.numbers, self.curves, width_in)

    def _repr_html_(self) -> str:
        return printed.html(self.rows)


def reproduce(
    out: Path | None,
    *,
    quick: bool = False,
    seeds: int | None = None,
    workers: int | None = None,
    progress: Progress | None = None,
) -> Reproduction:
    """Runs the evaluation. The result appears when it is complete. Runs are kept beside it, in the
    folder ``<out>.runs``: one that was interrupted goes on from there.

    Parameters
    ----------
    out : Path or None
        The result folder; without one nothing is kept.
    quick : bool
        Two seeds.
    seeds : int, optional
        How many seeds, instead of those of assumptions.yaml.
    workers : int, optional
        How many processes; default: one a core.
    progress : callable, optional
        Told how many runs are done, of how many, and of what.

    Raises
    ------
    UserError
        If ``out`` cannot be written.
    """
    seed_numbers = declared_seeds()[: QUICK_SEEDS if quick else None]
    if seeds is not None:
        seed_numbers = tuple(range(1, seeds + 1))
    if out is not None:
        folders.check_writable(out.parent)
        folders.check_replaceable(out)
        check_kept(out, seed_numbers)
    planned = runs.planned(seed_numbers)
    with tempfile.TemporaryDirectory() as scratch:
        store = Path(scratch) if out is None else out.with_name(f"{out.name}.runs")
        measured, curve_points = runs.simulate(planned, store, workers or workers_here(), progress)
    about = {
        "format": provenance.RESULT_FORMAT,
        "quick": quick,
        "seeds": list(seed_numbers),
        "sources": sources.digests(),
        # the sources say which code it was; a commit is lost where it is rewritten
        **{name: version for name, version in provenance.environment().items() if name != "commit"},
    }
    evaluation = Reproduction(judge(Evidence(measured)), measured, curve_points, about)
    if out is not None:
        with folders.result_folder(out, SHOWN) as folder:
            write(folder, evaluation)
        show(out, evaluation)
    return replace(evaluation, folder=out)


def check_kept(out: Path, seed_numbers: Collection[int]) -> None:
    """Raises ``UserError`` where a result would be lost: a run's, or that of an evaluation with
    seeds that are not in ``seed_numbers``.
    """
    path = provenance.contained(out, "run.json")
    if not path.is_file():
        return
    before = provenance.read_mapping(path).get("seeds")
    if not isinstance(before, list) or not all(seed in seed_numbers for seed in before):
        subject = "another result"
        if isinstance(before, list):
            subject = f"the evaluation of {len(before)} seeds"
        raise UserError(f"{out}: holds {subject}, which is kept; choose another --out")


def declared_seeds() -> tuple[int, ...]:
    """The seeds of assumptions.yaml."""
    return tuple(read_mapping(ASSUMPTIONS)["evaluation"]["seeds"])


def write(folder: Path, evaluation: Reproduction) -> None:
    """Writes the numbers. Raises ``UserError``."""
    numbers.write(folder, evaluation.numbers)
    curves.write(folder / curves.FILE, evaluation.curves)
    provenance.write_json(folder / printed.VERDICTS, evaluation.rows)
    inputs = {path.name: sha256_of(path) for path in sources.INPUTS}
    digests = provenance.digests(folder, FILES)
    provenance.write_json(
        folder / "run.json", {**evaluation.about, "inputs": inputs, "digests": digests}
    )


def show(folder: Path, evaluation: Reproduction) -> None:
    """Writes what is derived from the numbers in the folder. Raises ``NotDerivedError``."""
    from genie_sim.analysis.figures import save_all

    drawn_figures: Mapping[str, Figure] = {}
    with folders.derived(folder) as attempt:
        with attempt(printed.DOCUMENT):
            accuracy = page.accuracy(Evidence(evaluation.numbers))
            document = printed.document(evaluation.rows, accuracy)
            folders.write_summary(folder / printed.DOCUMENT, document)
        with attempt("figures"):
            drawn_figures = evaluation.figures()
            save_all(drawn_figures, provenance.contained(folder, "figures"), ["svg"])
        with attempt(template.NAME):
            template.write(folder / template.NAME, page.page(evaluation, drawn_figures))
