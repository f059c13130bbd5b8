"""Generated parts of pages, each between ``<!-- NAME:begin -->`` and ``<!-- NAME:end -->``."""

from __future__ import annotations

from collections.abc import Mapping


def filled(page: str, parts: Mapping[str, str]) -> str:
    """The text of a page with these parts in their places. Raises KeyError for a part that the page
    has no place for.
    """
    for name, part in parts.items():
        begin, end = f"<!-- {name}:begin -->", f"<!-- {name}:end -->"
        before, begins, rest = page.partition(begin)
        _, ends, after = rest.partition(end)
        if not (begins and ends):
            raise KeyError(f"the page has no {begin} with {end} below it")
        page = f"{before}{begin}\n{part}\n{end}{after}"
    return page
