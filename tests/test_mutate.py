"""The tool that puts errors into the package: what it makes is what it says."""

from __future__ import annotations

import ast

import pytest

from tests import mutate

SOURCE = """
def first(values, limit=3):
    largest = max(values)  # é: more bytes than characters
    return [
        value
        for value in values
        if value < limit and value - 1 > 0
    ][0] if largest else -1
"""


def test_every_error_changes_the_code_and_it_still_parses():
    seen = set()
    for mutation in mutate.candidates("file.py", SOURCE):
        mutated = mutation.apply(SOURCE)
        assert ast.dump(ast.parse(mutated)) != ast.dump(ast.parse(SOURCE)), mutation
        seen.add(mutation.operator)
    assert seen == {"function", "branches", "comparison", "and/or", "arithmetic", "number", "sign"}


@pytest.mark.parametrize(
    ("operator", "mutated"),
    [
        ("function", "min(values)"),
        ("and/or", "value < limit or value - 1 > 0"),
        ("sign", "else (1)"),
    ],
)
def test_an_operator_does_what_its_name_says(operator: str, mutated: str):
    outcomes = [
        mutation.apply(SOURCE)
        for mutation in mutate.candidates("file.py", SOURCE)
        if mutation.operator == operator
    ]
    assert any(mutated in outcome for outcome in outcomes)


def test_what_decides_nothing_is_left_as_it_is():
    source = """
from dataclasses import dataclass, field
@dataclass(frozen=True)
class Pair:
    kept: dict[int, int] = field(init=False, compare=False)
    def reach(self, others: list[float]) -> float:
        return [max(a, b, self.least) + max(a, b) for a, b in zip(self, others, strict=True)]
"""
    changed = [mutation.text for mutation in mutate.candidates("file.py", source)]
    assert sorted(changed) == sorted(
        [
            "(True)",  # of ``init``
            "(max(a, b, self.least) - max(a, b))",
            "(max(b, a, self.least))",
            "(min(a, b, self.least))",
            "(min(a, b))",
            "(zip(others, self, strict=True))",
        ]
    )


def test_a_draw_is_the_same_each_time_and_spread_over_the_files():
    sample = mutate.drawn(seed=3, count=60, room=None)
    assert sample == mutate.drawn(seed=3, count=60, room=None)
    assert sample != mutate.drawn(seed=4, count=60, room=None)
    assert len({mutation.file for mutation in sample}) == 60
    assert len({mutation.operator for mutation in sample}) > 6
