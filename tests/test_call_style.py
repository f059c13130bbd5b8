"""How calls read: a reader should not have to count arguments to know what each one is."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

from tests.checkout import REPOSITORY

MANY = 5  # positional arguments in one call
MAX_CALLS = 30  # in the whole package


def calls_with_many_positionals(path: Path) -> Iterator[str]:
    """Each call in a file with at least ``MANY`` positional arguments, as ``line: call``."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call) and len(node.args) >= MANY:
            yield f"{node.lineno}: {ast.unparse(node)[:80]}"


def test_few_calls_have_many_positional_arguments():
    paths = sorted((REPOSITORY / "genie_sim").rglob("*.py"))
    calls = [f"{path}:{call}" for path in paths for call in calls_with_many_positionals(path)]
    assert len(calls) <= MAX_CALLS, "\n".join([f"{len(calls)} calls:", *calls])


def test_a_call_with_many_positional_arguments_is_found(tmp_path):
    """Without this, a mistake in the search would look like good style."""
    source = tmp_path / "source.py"
    source.write_text(
        "call(1, 2, 3, 4, 5)\ncall(1, 2, 3, 4, five=5)\nout.call(1, 2, *more, 4, 5)\n"
    )
    assert list(calls_with_many_positionals(source)) == [
        "1: call(1, 2, 3, 4, 5)",
        "3: out.call(1, 2, *more, 4, 5)",
    ]
