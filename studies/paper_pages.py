"""Judges the committed numbers of the evaluation anew, and writes what follows from them.

    python -m studies.paper_pages

That is the rest of ``results/paper``, the verdicts in the package, the tables in documents, and
their pictures. Nothing is simulated; ``genie-sim reproduce --out results/paper`` does that.
"""

from __future__ import annotations

from pathlib import Path

from genie_sim.analysis import renderers
from genie_sim.analysis.figures import save
from genie_sim.paper import claims, curves, numbers, page, printed
from genie_sim.paper.checks import judge
from genie_sim.paper.evidence import Evidence
from genie_sim.paper.reproduce import Reproduction, show, write
from genie_sim.record import provenance
from tools.page_tables import filled

REPOSITORY = Path(__file__).resolve().parents[1]
PAPER = REPOSITORY / "results" / "paper"
FULL_RUN = REPOSITORY / "genie_sim" / "paper" / "full_run.json"
DOCUMENTS = {  # their generated parts
    "README.md": ("in short",),
    "docs/paper.md": ("table", "accuracy"),
}


def parts() -> dict[str, str]:
    """What documents show of the committed evaluation, by the name of the part."""
    rows = printed.read_rows(PAPER)
    accuracy = page.accuracy(Evidence(numbers.read(PAPER)))
    return {
        "table": printed.in_markdown(rows),
        "in short": printed.in_short(rows),
        "accuracy": renderers.markdown(accuracy).rstrip(),
    }


def with_parts(text: str, document: str) -> str:
    """A document with its generated parts made anew."""
    made = parts()
    return filled(text, {name: made[name] for name in DOCUMENTS[document]})


def main() -> None:
    """Judges the committed numbers anew, and writes what follows from them: the rest of
    ``results/paper``, the verdicts in the package, the documents, their pictures.
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
    for document in DOCUMENTS:
        path = REPOSITORY / document
        path.write_text(with_parts(path.read_text(encoding="utf-8"), document), encoding="utf-8")


if __name__ == "__main__":
    main()
