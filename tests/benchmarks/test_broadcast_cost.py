"""The benchmark of broadcasts counts what cars receive. How fast it is decides no test."""

from __future__ import annotations

import pytest

from benchmarks import broadcast


@pytest.mark.slow
def test_every_car_in_range_receives_each_message(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(broadcast, "MESSAGES", 40)
    for range_m, receptions in ((broadcast.NOBODY_M, 0), (broadcast.ALL_M, 3 * 40)):
        assert broadcast.cost(broadcast.square(4, range_m)).receptions == receptions


@pytest.mark.slow
def test_a_row_for_each_fleet_and_range(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(broadcast, "MESSAGES", 40)
    monkeypatch.setattr(broadcast, "ROUNDS", 1)
    some, everyone = broadcast.rows([4])
    assert some[:2] == ("4", "some")
    assert everyone[:4] == ("4", "all", "3.0", "120")
