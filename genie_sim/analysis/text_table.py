"""A table as text for a paper, a page or a spreadsheet: LaTeX, Markdown or CSV."""

import csv
import io
from collections.abc import Iterable, Sequence
from typing import Any

from genie_sim.errors import UserError, unknown
from genie_sim.recording.tables import harmless

FORMATS = {"markdown": ".md", "csv": ".csv", "latex": ".tex"}
LATEX = str.maketrans(
    {
        "_": r"\_",
        "%": r"\%",
        "&": r"\&",
        "#": r"\#",
        "$": r"\$",
        "{": r"\{",
        "}": r"\}",
        "~": r"\textasciitilde{}",
    }
)


def checked(format: str) -> str:
    """The format, if it is known. Raises ``UserError``."""
    if format not in FORMATS:
        raise UserError(f"--format: {unknown('format', format, FORMATS)}")
    return format


def markdown(headings: Sequence[str], rows: Iterable[Sequence[str]], align: str = "") -> str:
    """A Markdown table, as it is put between paragraphs; ``align`` as for ``rounded``, all left if it is not given."""
    rules = "".join("---:|" if side == "r" else "---|" for side in align or "l" * len(headings))
    lines = [
        f"| {' | '.join(headings).lstrip()} |",
        f"|{rules}",
        *(f"| {' | '.join(row)} |" for row in rows),
    ]
    return "\n".join(lines)


def rounded(format: str, headings: Sequence[str], rows: Iterable[Sequence[str]], align: str) -> str:
    """Cells as they are to be read, in ``markdown`` or ``latex``; ``align`` has an ``l`` or ``r`` for each column."""
    if format == "markdown":
        safe, *others = ([one.replace("|", r"\|") for one in row] for row in (headings, *rows))
        return markdown(safe, others, align) + "\n"
    lines = [" & ".join(one.translate(LATEX) for one in row) + r" \\" for row in (headings, *rows)]
    body = [
        rf"\begin{{tabular}}{{{align}}}",
        r"\hline",
        lines[0],
        r"\hline",
        *lines[1:],
        r"\hline",
        r"\end{tabular}",
    ]
    return "\n".join(body) + "\n"


def exact(names: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """All numbers as CSV, to ten digits; no cell is a formula to a spreadsheet."""
    to = io.StringIO()
    writer = csv.writer(to, lineterminator="\n")
    writer.writerow(names)
    writer.writerows(
        [float(f"{one:.10g}") if isinstance(one, float) else harmless(one) for one in row]
        for row in rows
    )
    return to.getvalue()
