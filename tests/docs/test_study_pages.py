"""The page of results shows the committed numbers."""

from __future__ import annotations

import pytest

from studies import pages
from tests.checkout import REPOSITORY
from tools.page_tables import filled


@pytest.mark.slow
def test_the_page_shows_the_numbers_of_its_studies(monkeypatch: pytest.MonkeyPatch):
    """If not, ``python -m studies.pages`` writes the tables."""
    monkeypatch.chdir(REPOSITORY)
    text = pages.PAGE.read_text(encoding="utf-8")
    assert filled(text, {name: made() for name, made in pages.TABLES.items()}) == text
    methods = [panel.get_title() for panel in pages.streets_picture().axes]
    assert methods[0] == "(a) local" and len(methods) == 6


def test_a_part_is_written_between_its_marks():
    page = "a\n<!-- t:begin -->\nold\n<!-- t:end -->\nb\n"
    assert filled(page, {"t": "| x |"}) == "a\n<!-- t:begin -->\n| x |\n<!-- t:end -->\nb\n"
    with pytest.raises(KeyError, match="t:begin"):
        filled("<!-- other:begin -->\n<!-- other:end -->\n", {"t": "| x |"})
