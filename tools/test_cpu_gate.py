"""The gate of CPU: what it lets pass and what it stops."""

from __future__ import annotations

from tools.cpu_gate import too_slow


def test_the_median_of_three_runs_decides_what_is_too_slow():
    runs = [{"a": 2.5, "b": 9.0, "c": 0.1}, {"a": 2.1, "b": 0.2}, {"a": 0.1, "b": 0.2, "c": 0.1}]
    assert too_slow(runs) == [(2.1, "a")]
