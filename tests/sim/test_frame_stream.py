"""Frames of a map are computed while cars drive: a run of any length holds a few at a time."""

from __future__ import annotations

import weakref
from functools import partial

import pytest

from genie_sim.judge.consumers import ConsumerJudge
from genie_sim.runs.prepare import prepare
from genie_sim.runs.simulate import simulate
from genie_sim.scenario.reading import read_scenario
from genie_sim.scenario.scenario import Scenario
from genie_sim.worlds.scene.frames import BATCH_FRAMES, FrameBatch


def in_town(record: list[str]) -> Scenario:
    return read_scenario(
        {
            "name": "street",
            "methods": ["remote"],
            "perception": {"source": "town", "duration": "20 s", "town": {"blocks": [1, 2]}},
            "cameras": [{"name": "front", "recording": "02", "size": "1 kB"}],
            "cars": [{"name": "car1", "device": "jetson_tx2", "edge": "edge1"}],
            "edges": [{"name": "edge1", "device": "rtx_a4500"}],
            "record": record,
        }
    )


def test_few_frames_of_a_drive_are_in_memory_at_any_time(monkeypatch):
    """Those of some batches, and those that wait to be judged together."""
    small_window = partial(ConsumerJudge, window=BATCH_FRAMES // 2)
    monkeypatch.setattr("genie_sim.runs.simulate.ConsumerJudge", small_window)
    batches: weakref.WeakSet[FrameBatch] = weakref.WeakSet()
    alive: list[int] = []
    init = FrameBatch.__init__

    def counted(self, drive, camera, indices):
        init(self, drive, camera, indices)
        batches.add(self)
        alive.append(len(batches))

    monkeypatch.setattr(FrameBatch, "__init__", counted)
    tables = simulate(prepare(in_town(["lookups", "held"])))
    assert len(tables["frames"]) == 200
    assert len(alive) > 200 // BATCH_FRAMES and max(alive) <= 3


@pytest.mark.parametrize("record", [["held"], []], ids=["judged", "not judged"])
def test_what_is_in_view_is_computed_once_for_each_batch(record, monkeypatch):
    prepared = prepare(in_town(record))
    visibility = prepared.drives["car1"].scene.visibility
    views: list[int] = []
    visible = type(visibility).visible

    def counted(self, poses):
        views.append(len(poses.t_s))
        return visible(self, poses)

    monkeypatch.setattr(type(visibility), "visible", counted)
    simulate(prepared)
    whole_batches = [count for count in views if count == BATCH_FRAMES]
    assert len(whole_batches) == 201 // BATCH_FRAMES, "3 whole batches, and the rest of 9 frames"
