"""Fleets on a map of the tests' own."""

from __future__ import annotations

from typing import Any

from genie_sim.scenario.scenario import Scenario, read_scenario

WEST_M, SOUTH_M = -1000.0, 5000.0


SPEED_MPS = 20.0


def on_map(source: str, **fleet: Any) -> Scenario:
    return read_scenario(
        {
            "name": "plain",
            "methods": ["local", "remote"],
            "perception": {"source": f"{__name__}:{source}"},
            "start_jitter": "0 s",
            "cameras": [{"name": "front", "recording": "front"}],
            "fleet": {
                "devices": "jetson_tx2",
                "edge_device": "rtx_a4500",
                "cell": "100 m",
                "hysteresis": "5 m",
                **fleet,
            },
        }
    )
