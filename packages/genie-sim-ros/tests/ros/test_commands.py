"""Options of ``genie-sim ros attach`` and ``detach``: what they become before any ROS is there."""

from __future__ import annotations

import math
from typing import Any

import pytest

from genie_sim.cli.main import main
from genie_sim_ros import attach


@pytest.fixture
def attached(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What the last ``attach`` was asked for."""
    asked: dict[str, Any] = {}
    monkeypatch.setattr(attach, "attach", lambda node, **options: asked.update(options, node=node))
    return asked


def test_options_reach_the_genie(attached: dict[str, Any]):
    line = "ros attach /node --role car --fov 90deg"
    line += " --set genie.eviction=lru --set genie.object_map.gate=2m"
    line += " --request /left --request /right --connect edge1@h:1 --pose-topic /pose"
    assert main(line.split()) == 0
    assert attached["node"] == "/node" and attached["role"] == "car"
    assert attached["settings"] == {"eviction": "lru", "object_map": {"gate": "2m"}}
    assert attached["horizontal_fov_rad"] == pytest.approx(math.pi / 2)
    assert attached["requests"] == ("/left", "/right") and attached["leave"] == ()
    assert attached["connect"] == ("edge1@h:1",) and attached["pose_topic"] == "/pose"


def test_a_setting_is_written_as_in_scenarios(attached: dict[str, Any], capsys):
    assert main(["ros", "attach", "/node", "--set", "eviction=lru"]) == 1
    said = capsys.readouterr().err
    assert said == "genie-sim: --set eviction=lru: write --set genie.eviction=lru\n"
    assert not attached


def test_without_options_nothing_is_set(attached: dict[str, Any]):
    assert main(["ros", "attach", "/node", "--role", "edge"]) == 0
    assert attached["settings"] == {} and attached["horizontal_fov_rad"] == 0.0


def test_a_field_of_view_without_a_unit_is_refused(capsys: pytest.CaptureFixture[str]):
    assert main(["ros", "attach", "/node", "--role", "car", "--fov", "wide"]) == 1
    assert capsys.readouterr().err.startswith("genie-sim: --fov: ")
