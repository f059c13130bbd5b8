"""The paper's whole evaluation: replicated runs, verdicts and figures in one folder.

Nothing here decides anything: the scenarios and assumptions.yaml do, before; claims.yaml says what
is tested.
"""

import logging
import tempfile
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from genie_sim.base.errors import UserError
from genie_sim.base.parallel import workers_here
from genie_sim.base.paths import sha256_of
from genie_sim.base.progress import Progress
from genie_sim.paper import claims, curves, numbers, page, printed, runs, sources
from genie_sim.paper.checks import judge
from genie_sim.paper.evidence import Evidence
from genie_sim.paper.sources import ASSUMPTIONS
from genie_sim.record import provenance
from genie_sim.report import template
from genie_sim.scenario.yaml_input import read_mapping

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from genie_sim.paper.curves import Curves

log = logging.getLogger(__name__)
QUICK_SEEDS = 2
FIGURES = ("latency_cdf", "image_reuse", "object_reuse", "confidence_boost", "case_study")
# what is derived from the numbers
SHOWN = (printed.DOCUMENT, template.NAME, *(f"figures/{name}.svg" for name in FIGURES))


@dataclass(frozen=True, eq=False)
class Reproduction:
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
    """

    rows: Sequence[Mapping[str, Any]]
    numbers: "pd.DataFrame"
    curves: "Curves"

    @property
    def sentences(self) -> list[str]:
        """What of the paper holds, in three sentences."""
        return claims.sentences(self.rows)

    @property
    def table(self) -> "pd.DataFrame":
        """The table of the paper, a row a claim."""
        import pandas as pd

        return pd.DataFrame(self.rows).set_index("id")

    @cached_property
    def figures(self) -> "Mapping[str, Figure]":
        """The five figures of the paper, by name."""
        from genie_sim.paper import figures

        return figures.of_numbers(self.numbers, self.curves)

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
    used = declared_seeds()[: QUICK_SEEDS if quick else None]
    if seeds is not None:
        used = tuple(range(1, seeds + 1))
    if out is not None:
        provenance.check_writable(out.parent)
        provenance.check_replaceable(out)
        check_kept(out, used)
    edited = sources.edited_set_ups()
    for line in edited:
        log.warning("%s", line)
    planned = runs.planned(used)
    with tempfile.TemporaryDirectory() as scratch:
        store = Path(scratch) if out is None else out.with_name(f"{out.name}.runs")
        measured, drawn = runs.simulate(planned, store, workers or workers_here(), progress)
    made = Reproduction(judge(Evidence(measured)), measured, drawn)
    if out is not None:
        about = {
            "format": printed.FORMAT,
            "quick": quick,
            "seeds": list(used),
            "edited": edited,
            "sources": sources.digests(),
            # the sources say which code it was; a commit is lost where it is rewritten
            **{name: one for name, one in provenance.environment().items() if name != "commit"},
        }
        with provenance.result_folder(out, SHOWN) as folder:
            write(folder, made, about)
        show(out, made, about)
    return made


def check_kept(out: Path, used: Collection[int]) -> None:
    """Raises ``UserError`` where a result would be lost: a run's, or that of an evaluation with
    seeds that are not ``used`` now.
    """
    path = provenance.contained(out, "run.json")
    if not path.is_file():
        return
    about = provenance.read_json(path)
    before = about.get("seeds") if isinstance(about, dict) else None
    if not isinstance(before, list) or not all(seed in used for seed in before):
        what = f"the evaluation of {len(before)} seeds" if before else "another result"
        raise UserError(f"{out}: holds {what}, which is kept; choose another --out")


def declared_seeds() -> tuple[int, ...]:
    """The seeds of assumptions.yaml."""
    return tuple(read_mapping(ASSUMPTIONS)["evaluation"]["seeds"])


def write(folder: Path, made: Reproduction, about: Mapping[str, Any]) -> None:
    """Writes the numbers; ``about``: how they came about. Raises ``UserError``."""
    numbers.write(folder, made.numbers)
    curves.write(folder / curves.FILE, made.curves)
    provenance.write_json(folder / printed.VERDICTS, made.rows)
    inputs = {path.name: sha256_of(path) for path in sources.INPUTS}
    digests = provenance.digests(folder, page.FILES)
    provenance.write_json(folder / "run.json", {**about, "inputs": inputs, "digests": digests})


def show(folder: Path, made: Reproduction, about: Mapping[str, Any]) -> None:
    """Writes what is derived from the numbers in the folder. Raises ``NotDerivedError``."""
    from genie_sim.analysis.figures import save_all

    with provenance.derived(folder) as attempt:
        with attempt(printed.DOCUMENT):
            accuracy = page.accuracy(Evidence(made.numbers))
            document = printed.document(made.rows, accuracy, about["edited"])
            template.write(folder / printed.DOCUMENT, document)
        with attempt("figures"):
            save_all(made.figures, provenance.contained(folder, "figures"), ["svg"])
        with attempt(template.NAME):
            template.write(folder / template.NAME, page.page(folder, drawn=made.figures))
