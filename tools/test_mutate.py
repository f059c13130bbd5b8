"""The tool that puts errors into the package: what it makes is what it says."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from tools import mutate

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


def test_rooms_take_turns_until_there_are_enough_errors():
    sample = mutate.drawn_by_room(seed=3, count=7, rooms=["core", "sim", "faults"])
    rooms = [mutation.file.split("/")[1] for mutation in sample]
    assert rooms == ["core", "sim", "faults", "core", "sim", "faults", "core"]
    small = mutate.drawn_by_room(seed=3, count=10**6, rooms=["version.py", "faults"])
    assert len(small) == len(set(small)), "and go on where one has no more"


def test_a_copy_has_what_tests_ask_for_and_nothing_else(tmp_path: Path):
    mutate.copy_to(tmp_path)
    for name in (".ci/run", "examples/livemap.py", "tests/conftest.py", "tools/mutate.py"):
        assert (tmp_path / name).is_file(), name
    assert not list(tmp_path.rglob("__pycache__"))


def test_a_copy_has_several_errors_at_once_and_is_whole_again(tmp_path: Path):
    (tmp_path / "file.py").write_text(SOURCE)
    changed = {
        mutation.operator: mutation for mutation in mutate.candidates("file.py", SOURCE)
    }  # the last of each
    with mutate.broken(tmp_path, [changed["function"], changed["number"], changed["branches"]]):
        broken = (tmp_path / "file.py").read_text()
    assert "largest = (min(values))" in broken, "and not what overlaps with others"
    assert ast.dump(ast.parse(broken)) != ast.dump(ast.parse(SOURCE))
    assert (tmp_path / "file.py").read_text() == SOURCE


def test_what_all_tests_together_notice_is_asked_of_each_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """Of two errors one makes the test fail that fails with both."""
    (tmp_path / "file.py").write_text(SOURCE)
    seen = [mutation for mutation in mutate.candidates("file.py", SOURCE) if mutation.line == 3]
    (error,) = seen
    harmless = mutate.Mutation("file.py", 2, 2, "number", 0, 0, "")

    def failing_test(copy: Path, tests: list[str]) -> str | None:
        assert tests == ["tests/test_file.py::test_it"]
        return "FAILED" if "min" in (copy / "file.py").read_text() else None

    monkeypatch.setattr(mutate, "noticed_together", lambda *_: ["tests/test_file.py::test_it"])
    monkeypatch.setattr(mutate, "failing_test", failing_test)
    assert mutate.unnoticed([error, harmless], tmp_path) == [harmless]
