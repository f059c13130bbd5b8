"""Tables of pages that a benchmark measures."""

import re
from collections.abc import Sequence
from pathlib import Path

from genie_sim.base.errors import UserError

DOCS = Path(__file__).resolve().parent.parent / "docs"


def filled(text: str, name: str, block: str, where: str) -> str:
    """The page with what stands between ``<!-- measured: NAME -->`` and ``<!-- end -->``
    replaced.
    """
    place = re.compile(rf"(<!-- measured: {re.escape(name)} -->\n).*?(<!-- end -->)", re.DOTALL)
    if not place.search(text):
        raise UserError(
            f"{where}: no place for {name!r}: '<!-- measured: {name} -->' and '<!-- end -->' are"
            " missing"
        )
    return place.sub(lambda found: f"{found[1]}{block}\n{found[2]}", text)


def table(header: Sequence[str], rows: Sequence[Sequence[str]], left: int = 1) -> str:
    """A Markdown table; the first ``left`` columns are text, the others numbers."""
    rule = ["---"] * left + ["---:"] * (len(header) - left)
    return "\n".join(f"| {' | '.join(row)} |" for row in [header, rule, *rows])
