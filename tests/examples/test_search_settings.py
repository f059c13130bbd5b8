"""A search: what it finds, that it goes on, and that it reports other seeds than it tuned on."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("optuna", reason="Optuna comes with '.[test]'")
import search_settings

import genie_sim as gs


@pytest.mark.slow
@pytest.mark.usefixtures("without_figures")
def test_a_search_goes_on_and_reports_seeds_that_it_has_not_seen(tmp_path: Path, monkeypatch):
    monkeypatch.setattr(search_settings, "TUNING", (1,))
    monkeypatch.setattr(search_settings, "HELD_OUT", (2,))
    front, held_out = search_settings.search(tmp_path, batches=1, batch=2)
    assert front and set(front) <= {"genie-0", "genie-1"}
    assert set(held_out.index.get_level_values("design")) == set(front)

    sweeps: list[tuple[int, ...]] = []
    sweep = gs.sweep

    def counted(scenario: str, axes: object, settings: object, **options: object) -> object:
        sweeps.append(tuple(options["seeds"]))
        return sweep(scenario, axes, settings, **options)

    def refuse(*_: object) -> None:
        raise AssertionError("every run is there")

    monkeypatch.setattr(gs, "sweep", counted)
    monkeypatch.setattr("genie_sim.study.work.measured", refuse)
    again, same = search_settings.search(tmp_path, batches=1, batch=2)
    assert again == front and same["value"].tolist() == held_out["value"].tolist()
    assert sweeps == [(1,), (2,)]
