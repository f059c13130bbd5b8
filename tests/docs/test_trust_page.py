"""The tables of the study of trust show the numbers beside it."""

from __future__ import annotations

from benchmarks import trust
from tests.checkout import REPOSITORY


def test_the_page_shows_every_row_of_the_study():
    rows = trust.read()
    page = (REPOSITORY / "docs/trust.md").read_text(encoding="utf-8")
    tables = (trust.price_table, trust.poison_table, trust.suppressed_table)
    shown = [
        [cell.strip() for cell in line.split("|")[1:-1]]
        for line in page.splitlines()
        if line.startswith("| ") and not line.startswith("| defence") and "clean |" not in line
    ]
    assert shown == [row for table in tables for row in table(rows)]


def test_a_cell_is_bold_within_the_target():
    """1.2 times the clean value of the Genie without a defence, to the last bit."""
    where = {"seed": "1", "attacker": "edge", "attack": "spoof", "share": ""}
    rows = [
        {**where, "defence": name, "poisoned": poisoned, "poisoned_clean": clean}
        for name, poisoned, clean in (
            ("none", "0.5", "0.1"),
            ("corroborate", "0.12", "0.0"),
            ("guarded", "0.121", "0.9"),
        )
    ]
    (cells,) = trust.poison_table(rows)
    assert cells == ["spoof, edge_0_0", "0.1000", "0.5000", "**0.1200**", "-", "0.1210", "-"]
