"""A table as text for a paper, a page or a spreadsheet: LaTeX, Markdown or CSV.

No cell can steer a terminal, end its row, or run a command of LaTeX or a formula of a spreadsheet.
"""

import csv
import io
from collections.abc import Iterable, Sequence
from typing import Any

from genie_sim.base.errors import UserError, unknown
from genie_sim.base.text import one_line, significant
from genie_sim.record.tables import harmless

FORMATS = {"markdown": ".md", "csv": ".csv", "latex": ".tex"}
LATEX = str.maketrans(
    {
        "\\": r"\textbackslash{}",
        "_": r"\_",
        "%": r"\%",
        "&": r"\&",
        "#": r"\#",
        "$": r"\$",
        "{": r"\{",
        "}": r"\}",
        "~": r"\textasciitilde{}",
        "^": r"\textasciicircum{}",
    }
)


def checked(format: str) -> str:
    """The format, if it is known. Raises ``UserError``."""
    if format not in FORMATS:
        raise UserError(f"--format: {unknown('format', format, FORMATS)}")
    return format


def markdown(headings: Sequence[str], rows: Iterable[Sequence[str]], align: str = "") -> str:
    """A Markdown table, as it is put between paragraphs; ``align`` as for ``rounded``, all left if
    it is not given.
    """
    rules = "".join("---:|" if side == "r" else "---|" for side in align or "l" * len(headings))
    lines = [
        f"| {' | '.join(headings).lstrip()} |",
        f"|{rules}",
        *(f"| {' | '.join(row)} |" for row in rows),
    ]
    return "\n".join(lines)


def rounded(format: str, headings: Sequence[str], rows: Iterable[Sequence[str]], align: str) -> str:
    """Cells as they are to be read, in ``markdown`` or ``latex``; ``align`` has an ``l`` or ``r``
    for each column.
    """
    if format == "markdown":
        escaped = [[in_markdown(cell) for cell in row] for row in (headings, *rows)]
        return markdown(escaped[0], escaped[1:], align) + "\n"
    escaped = [[one_line(cell).translate(LATEX) for cell in row] for row in (headings, *rows)]
    lines = [" & ".join(row) + r" \\" for row in escaped]
    table = [
        rf"\begin{{tabular}}{{{align}}}",
        r"\toprule",
        lines[0],
        r"\midrule",
        *lines[1:],
        r"\bottomrule",
        r"\end{tabular}",
    ]
    return "\n".join(table) + "\n"


def in_markdown(cell: str) -> str:
    """A text that stays in its cell of a Markdown table."""
    return one_line(cell).replace("|", r"\|")


def exact(names: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """All numbers as CSV, to ten digits; no cell is a formula to a spreadsheet."""
    to = io.StringIO()
    writer = csv.writer(to, lineterminator="\n")
    writer.writerow(names)
    for row in rows:
        writer.writerow([_exact_cell(cell) for cell in row])
    return to.getvalue()


def _exact_cell(cell: Any) -> Any:
    if isinstance(cell, float):
        return significant(cell, digits=10)
    return harmless(one_line(cell)) if isinstance(cell, str) else cell
