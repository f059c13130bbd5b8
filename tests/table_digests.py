"""Digests of every column of every table, for twenty settings that together use all of the
simulator.

    python -m tests.table_digests            compare with table_digests.json; exit status 1 if
                                             anything differs
    python -m tests.table_digests --write    write it anew, after a change of results on purpose
    python -m tests.table_digests --only town,faults

The settings are short, and cover all methods on the shipped drive, a town with many cars, recorded
traffic, faults on links and hosts, looks that travel, every shipped kind of scenario, and
extensions in plain Python.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path

import pandas as pd

from genie_sim.runs.prepare import prepare
from genie_sim.runs.simulate import simulate
from genie_sim.scenario.reading import load_scenario
from genie_sim.scenario.scenario import Scenario
from tests.conformance import small

COMMITTED = Path(__file__).with_name("table_digests.json")
# Columns that have another name now than in the committed digests: (table, new name) -> old name.
RENAMED: Mapping[tuple[str, str], str] = {}

SHORT = [f"cars[{car}].route.window=[0 s, 2 s]" for car in range(3)]
LAPS = [f"cars[{car}].route.laps=2" for car in range(3)]
OWN = "tests.conformance.own"
SHIPPED = {
    "baselines": SHORT,
    "3car_laps": [*SHORT, *LAPS],
    "red_light": ["perception.duration=3 s"],
    "lossy_link": SHORT[:2],
    "shared_cell": ["perception.duration=3 s"],
    "edge_batches": [f"cars[{n}].route.window=[{n} s, {n + 2} s]" for n in range(10)],
    "failing_edge": [],
    "recorded_link": SHORT,
    "energy": SHORT,
    "town_recommended": ["perception.duration=3 s"],
    "fleet_30": ["perception.duration=4 s"],
    "case_study": ["cars[0].route.window=[3.1 s, 5.1 s]", "cars[1].route.window=[0 s, 2 s]"],
    "1car_homo": ["consumer=tracker", "image_encoding=jpeg90", "seed=3", SHORT[0]],
}
# The scenarios whose digests have another name.
FILES = {"case_study": "street_case_study", "1car_homo": "street_1car_homo"}
NAMES = ("three cars", "recommended", "town", "traffic", "literal", "faults", "own", *SHIPPED)

Digests = dict[str, dict[str, str]]  # by table, by column


def scenario(name: str) -> Scenario:
    """One of ``NAMES``: a few seconds of simulated time."""
    if name in SHIPPED:
        return load_scenario(FILES.get(name, name), SHIPPED[name])
    if name == "three cars":
        return load_scenario("street_3car_hetero", [*SHORT, *LAPS])
    if name == "recommended":
        return load_scenario("3car_recommended", SHORT)
    if name == "town":
        small_town = ["fleet.cars=9", "perception.town.blocks=[3, 3]", "perception.duration=2 s"]
        return load_scenario("fleet_1000", small_town)
    if name == "traffic":  # a fifth of the vehicles are cars, and drive
        part = ["perception.begin=62 s", "perception.duration=3 s", "perception.equipped=0.2"]
        return load_scenario("red_light", part)
    if name == "literal":
        return small.scenario(["genie"], genie={"algorithm": "literal"})
    if name == "faults":
        outage = {"fault": "outage", "target": "car1", "begin": "500 ms", "end": "1 s"}
        crash = {"fault": f"{OWN}:Crash", "target": "edge1", "begin": "800 ms", "end": "1.2 s"}
        return small.scenario(("local", "remote", "genie"), faults=[outage, crash])
    parts = {"similarity": f"{OWN}:OwnSimilarity", "eviction": f"{OWN}:OwnEviction"}
    map_rules = {"threshold": {"percentile": 40}}
    own_genie = {**parts, "capacity": "20 entries", "object_map": map_rules}
    return small.scenario([f"{OWN}:Again", "genie"], genie=own_genie)


def column_digest(values: pd.Series) -> str:
    """A digest of all values of a column, numbers to their last bit; not of its name."""
    text = values.to_csv(float_format=float.hex, header=False, index=False)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def digests(name: str) -> Digests:
    """The digest of each column of each table of a setting, by their names in the committed
    ones.
    """
    found: Digests = {}
    for table, rows in simulate(prepare(scenario(name))).items():
        frame = rows.to_frame()
        columns = {
            RENAMED.get((table, str(column)), str(column)): column_digest(frame[column])
            for column in frame.columns
        }
        found[table] = {"rows": str(len(frame)), **columns}
    return found


def differences(expected: Digests, found: Digests) -> list[str]:
    """The columns, as ``table.column``, that one has and the other has not or has otherwise."""
    flat = [
        {f"{table}.{column}": value for table, of in tables.items() for column, value in of.items()}
        for tables in (expected, found)
    ]
    names = sorted({*flat[0], *flat[1]})
    return [name for name in names if flat[0].get(name) != flat[1].get(name)]


def main(arguments: Iterable[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--write", action="store_true", help="write the committed digests anew")
    parser.add_argument("--only", default=",".join(NAMES), help="settings, separated by commas")
    options = parser.parse_args(None if arguments is None else list(arguments))
    committed = json.loads(COMMITTED.read_text()) if COMMITTED.is_file() else {}
    failed = False
    for name in options.only.split(","):
        found = digests(name)
        changed = differences(committed.get(name, {}), found)
        failed |= bool(changed)
        print(f"{name}: {'equal' if not changed else 'differs: ' + ', '.join(changed)}", flush=True)
        committed[name] = found
    if options.write:
        COMMITTED.write_text(json.dumps(committed, indent=1, sort_keys=True) + "\n")
        return 0
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
