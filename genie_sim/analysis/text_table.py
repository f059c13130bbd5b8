"""A table as text for a paper, a page or a spreadsheet: LaTeX, Markdown or CSV."""

import csv
import io
from collections.abc import Iterable, Sequence
from typing import Any

from genie_sim.errors import UserError, unknown
from genie_sim.recording.tables import harmless

FORMATS = {"markdown": ".md", "csv": ".csv", "latex": ".tex"}
LATEX = str.maketrans(
    {"_": r"\_", "%": r"\%", "&": r"\&", "#": r"\#", "$": r"\$", "{": r"\{", "}": r"\}", "~": r"\textasciitilde{}"}
)


def checked(format: str) -> str:
    """The format, if it is known. Raises ``UserError``."""
    if format not in FORMATS:
        raise UserError(f"--format: {unknown('format', format, FORMATS)}")
    return format


def rounded(format: str, headings: Sequence[str], rows: Iterable[Sequence[str]], align: str) -> str:
    """Cells as they are to be read, in ``markdown`` or ``latex``; ``align`` has an ``l`` or ``r`` for each column."""
    if format == "markdown":
        rules = "|".join("---:" if side == "r" else "---" for side in align)
        lines = ["| " + " | ".join(one.replace("|", r"\|") for one in row) + " |" for row in (headings, *rows)]
        return "\n".join([lines[0], f"|{rules}|", *lines[1:]]) + "\n"
    lines = [" & ".join(one.translate(LATEX) for one in row) + r" \\" for row in (headings, *rows)]
    body = [rf"\begin{{tabular}}{{{align}}}", r"\hline", lines[0], r"\hline", *lines[1:], r"\hline", r"\end{tabular}"]
    return "\n".join(body) + "\n"


def exact(names: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """All numbers as CSV, to ten digits; no cell is a formula to a spreadsheet."""
    to = io.StringIO()
    writer = csv.writer(to, lineterminator="\n")
    writer.writerow(names)
    writer.writerows([float(f"{one:.10g}") if isinstance(one, float) else harmless(one) for one in row] for row in rows)
    return to.getvalue()
