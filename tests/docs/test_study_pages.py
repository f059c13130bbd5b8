"""The page of results shows the committed numbers."""

from __future__ import annotations

import pytest

from studies import pages
from tests.checkout import REPOSITORY


def test_the_page_shows_the_numbers_of_its_studies(monkeypatch: pytest.MonkeyPatch):
    """If not, ``python -m studies.pages`` writes the tables."""
    monkeypatch.chdir(REPOSITORY)
    text = pages.PAGE.read_text(encoding="utf-8")
    assert pages.with_tables(text) == text


def test_a_table_is_written_between_its_marks(monkeypatch: pytest.MonkeyPatch):
    table = pages.markdown(["", "n"], [["x", "1"]])
    monkeypatch.setattr(pages, "TABLES", {"t": lambda: table})
    assert pages.with_tables("a\n<!-- t:begin -->\nold\n<!-- t:end -->\nb\n") == (
        "a\n<!-- t:begin -->\n|  | n |\n| --- | ---: |\n| x | 1 |\n<!-- t:end -->\nb\n"
    )
