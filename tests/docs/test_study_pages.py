"""The tables of the studies' pages show the committed numbers."""

from __future__ import annotations

from pathlib import Path

import pytest

from studies import pages
from tests.checkout import REPOSITORY


@pytest.mark.parametrize("page", pages.TABLES)
def test_a_page_shows_the_numbers_of_its_study(page: str, monkeypatch: pytest.MonkeyPatch):
    """If not, ``python -m studies.pages`` writes the table."""
    monkeypatch.chdir(REPOSITORY)
    text = Path(page).read_text(encoding="utf-8")
    assert pages.with_tables(text, pages.TABLES[page]) == text


def test_a_table_is_written_between_its_marks():
    marked = "a\n<!-- t:begin -->\nold\n<!-- t:end -->\nb\n"
    table = pages.markdown(["", "n"], [["x", "1"]])
    assert pages.with_tables(marked, {"t": lambda: table}) == (
        "a\n<!-- t:begin -->\n|  | n |\n| --- | ---: |\n| x | 1 |\n<!-- t:end -->\nb\n"
    )
