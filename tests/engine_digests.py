"""Runs a few scenarios with every table and prints the engine and a digest of each table, as JSON.

    python -m tests.engine_digests

Scenarios are chosen so that every compiled module has its part: all methods on the shipped drive, a
town with many cars, faults on links and hosts, looks that travel, every shipped kind of scenario,
all methods, and extensions in plain Python.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping

import pandas as pd

from genie_sim.engine import ENGINE
from genie_sim.runner import prepare, simulate
from genie_sim.scenario.scenario import Scenario, load_scenario
from tests.conformance import small

SHORT = [f"cars[{car}].route.window=[0 s, 2 s]" for car in range(3)]
LAPS = [f"cars[{car}].route.laps=2" for car in range(3)]
OWN = "tests.conformance.own"


def scenarios() -> dict[str, Scenario]:
    """What runs, by name: a few seconds of simulated time each."""
    parts = {"similarity": f"{OWN}:OwnSimilarity", "eviction": f"{OWN}:OwnEviction"}
    map_rules = {"freshness": f"{OWN}:OwnPolicy", "threshold": {"percentile": 40}}
    own_genie = {**parts, "capacity": "20 entries", "object_map": map_rules}
    outage = {"fault": "outage", "target": "car1", "begin": "500 ms", "end": "1 s"}
    crash = {"fault": f"{OWN}:Crash", "target": "edge1", "begin": "800 ms", "end": "1.2 s"}
    return {
        "three cars": load_scenario("3car_hetero", [*SHORT, *LAPS]),
        "recommended": load_scenario("3car_recommended", SHORT),
        "town": load_scenario(
            "fleet_1000",
            ["fleet.cars=9", "perception.town.blocks=[3, 3]", "perception.duration=2 s"],
        ),
        "literal": small.scenario(["genie"], genie={"algorithm": "literal"}),
        "faults": small.scenario(faults=[outage, crash]),
        "own": small.scenario([f"{OWN}:Again", "genie"], genie=own_genie),
        **shipped_scenarios(),
    }


def shipped_scenarios() -> dict[str, Scenario]:
    """Those that ship, each shorter than it is."""
    settings = {
        "baselines": SHORT,
        "3car_laps": [*SHORT, *LAPS],
        "red_light": ["perception.duration=3 s"],
        "lossy_link": SHORT[:2],
        "shared_cell": ["perception.duration=3 s"],
        "edge_batches": ["convoy.route.window=[0 s, 2 s]"],
        "lying_car": ["perception.duration=3 s"],
        "failing_edge": [],
        "recorded_link": SHORT,
        "energy": SHORT,
        "town_recommended": ["perception.duration=3 s"],
        "fleet_30": ["perception.duration=4 s"],
        "case_study": ["cars[0].route.window=[3.1 s, 5.1 s]", "cars[1].route.window=[0 s, 2 s]"],
        "1car_homo": ["consumer=tracker", "image_encoding=jpeg90", "seed=3", SHORT[0]],
    }
    return {name: load_scenario(name, changes) for name, changes in settings.items()}


def digest(rows: pd.DataFrame) -> str:
    """sha256 of all values of a table, numbers to their last bit."""
    return hashlib.sha256(rows.to_csv(float_format=float.hex).encode()).hexdigest()


def digests(scenario: Scenario) -> Mapping[str, str]:
    """The digest of each table of a run."""
    tables = simulate(prepare(scenario))
    return {name: digest(table.to_frame()) for name, table in tables.items()}


def main() -> None:
    runs = {name: digests(scenario) for name, scenario in scenarios().items()}
    print(json.dumps({"engine": ENGINE.title, "runs": runs}))


if __name__ == "__main__":
    main()
