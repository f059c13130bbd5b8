"""Sweeps that figures and tables are made of."""

from __future__ import annotations

from pathlib import Path

from genie_sim.cli.main import main

CROSSED = """
description: DESCRIPTION
scenario: street_2car_homo
set: {"cars[0].route.window": [0 s, 1 s], "cars[1].route.window": [0.5 s, 1.5 s]}
seeds: 1
axes:
  rate: {set: genie.object_map.rate, grid: {from: 0.01, to: 1, points: 2, scale: log}}
  rule: {set: genie.object_map.rule, list: [noisy_or, ema]}
"""

DRAWN = """
scenario: street_1car_homo
set: {methods: [genie], "cars[0].route.window": [0 s, 1 s]}
seeds: 1
samples: 5
axes:
  range: {set: genie.view_range, latin_hypercube: {from: 20 m, to: 80 m}}
  gate: {set: genie.object_map.gate, latin_hypercube: {from: 0.5 m, to: 8 m, scale: log}}
"""

TOWN = """
scenario: fleet_30
set:
  methods: [genie]
  perception.duration: 1 s
  record: [lookups, held]
seeds: 1
samples: 4
axes:
  size: {set: fleet.cars, list: [2, 3]}
  forget:
    set: genie.object_map.forget_after
    latin_hypercube: {from: 100 ms, to: 5000 ms, scale: log}
  mix: {set: fleet.devices, list: [orin_nano, {jetson_tx2: 0.5, orin_nano: 0.5}]}
"""


def swept(text: str, folder: Path, name: str) -> Path:
    """Runs a sweep; returns the folder of its results."""
    file = folder / f"{name}.yaml"
    file.write_text(text, encoding="utf-8")
    assert main(["sweep", str(file), "--out", str(folder), "--jobs", "1"]) == 0
    return folder / name
