"""Judges the committed numbers of the evaluation anew, and writes what follows from them.

    python -m studies.paper_pages

That is the rest of ``results/paper``, the verdicts in the package, the README's table, and the
documents' pictures. Nothing is simulated; ``genie-sim reproduce --out results/paper`` does that.
"""

from __future__ import annotations

from pathlib import Path

from genie_sim.analysis.figures import save
from genie_sim.paper import claims, curves, numbers, printed
from genie_sim.paper.checks import judge
from genie_sim.paper.evidence import Evidence
from genie_sim.paper.reproduce import Reproduction, show, write
from genie_sim.record import provenance
from tools.page_tables import filled

REPOSITORY = Path(__file__).resolve().parents[1]
PAPER = REPOSITORY / "results" / "paper"
FULL_RUN = REPOSITORY / "genie_sim" / "paper" / "full_run.json"
README = REPOSITORY / "README.md"


def readme() -> str:
    """The README with its rows of the committed evaluation."""
    page = README.read_text(encoding="utf-8")
    return filled(page, {"in short": printed.in_short(printed.read_rows(PAPER))})


def main() -> None:
    """Judges the committed numbers anew, and writes what follows from them: the rest of
    ``results/paper``, the verdicts in the package, the README, the pictures of the documents.
    """
    table = numbers.read(PAPER)
    rows = judge(Evidence(table))
    provenance.write_json(FULL_RUN, {row["id"]: row["verdict"] for row in rows})
    claims.full_run.cache_clear()
    rows = judge(Evidence(table))
    about = provenance.read_json(PAPER / "run.json")
    made = Reproduction(rows, table, curves.read(PAPER / curves.FILE), about)
    write(PAPER, made)
    show(PAPER, made)
    for name, figure in made.figures().items():
        save(figure, REPOSITORY / "docs" / "images", f"paper_{name}", ["png"])
    README.write_text(readme(), encoding="utf-8")


if __name__ == "__main__":
    main()
