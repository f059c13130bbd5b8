"""``genie_sim.extend`` is all that code of one's own imports, and has no name that nobody needs."""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from genie_sim import extend
from tests.checkout import REPOSITORY
from tests.run_page import blocks

EXAMPLES = sorted((REPOSITORY / "examples").glob("*.py"))
PAGES = [
    *sorted((REPOSITORY / "docs" / "extend").glob("*.md")),
    *sorted((REPOSITORY / "docs" / "examples").glob("*.md")),
]
READERS = [
    REPOSITORY / "packages" / "genie-sim-ros" / "genie_sim_ros" / "bags.py",
    REPOSITORY / "tools" / "make" / "published.py",
]
ALLOWED = {"genie_sim", "genie_sim.extend"}
NAMES = {name: value for name, value in vars(extend).items() if not name.startswith("_")}


def programs(path: Path) -> Iterator[str]:
    """The Python of a file, or of the blocks of a page."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".py":
        yield text
    else:
        yield from (block.text for block in blocks(text) if block.language == "python")


def imports(program: str) -> Iterator[str]:
    """The modules that a program imports."""
    for node in ast.walk(ast.parse(program)):
        if isinstance(node, ast.Import):
            yield from (name.name for name in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.module is not None and node.level == 0
            yield node.module


@pytest.mark.parametrize("path", [*EXAMPLES, *PAGES], ids=lambda path: path.name)
def test_code_of_ones_own_imports_the_facade_alone(path: Path):
    ours = {
        name
        for program in programs(path)
        for name in imports(program)
        if name.partition(".")[0] == "genie_sim"
    }
    assert ours <= ALLOWED


def test_every_name_is_needed_by_an_example_or_told_on_a_page():
    of_readers = (path for path in READERS if path.is_file())
    pages = (*EXAMPLES, *PAGES, *of_readers)
    written = "".join(path.read_text(encoding="utf-8") for path in pages)
    words = set(re.findall(r"\w+", written))
    assert not set(NAMES) - words


def test_every_name_says_what_it_is():
    for name, value in NAMES.items():
        if inspect.isclass(value) or inspect.isfunction(value):
            assert (inspect.getdoc(value) or "").strip(), name


def test_every_example_has_a_page():
    pages = [path.read_text(encoding="utf-8") for path in (REPOSITORY / "docs").rglob("*.md")]
    for path in EXAMPLES:
        assert any(f"examples/{path.name}" in page for page in pages), path.name


def test_what_a_metric_may_return_is_in_the_facade():
    page = (REPOSITORY / "docs" / "extend" / "metric.md").read_text(encoding="utf-8")
    returned = set(re.findall(r"^\| `(\w+)\(", page, re.MULTILINE))
    assert len(returned) == 4 and returned <= set(NAMES)
