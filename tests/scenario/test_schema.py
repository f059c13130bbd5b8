"""Editors are told what a scenario and a device profile may hold, and what they are told is
true.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator

from genie_sim.scenario.schema import SCHEMAS, json_schema
from genie_sim.scenario.yaml_input import read_mapping

REPOSITORY = Path(__file__).resolve().parents[2]
FILES = {"scenario": "scenarios", "device": "device_profiles"}
SHIPPED = [
    (kind, path)
    for kind, folder in FILES.items()
    for path in sorted((REPOSITORY / folder).glob("*.yaml"))
]


def complaints(kind: str, data: object) -> list[str]:
    """Where an editor would draw a red line."""
    checker = Draft202012Validator(json_schema(kind))
    return [f"{error.json_path}: {error.message}" for error in checker.iter_errors(data)]


@pytest.mark.parametrize(("kind", "path"), SHIPPED, ids=lambda value: getattr(value, "stem", value))
def test_an_editor_accepts_every_shipped_file_and_finds_its_schema(kind: str, path: Path):
    assert not complaints(kind, read_mapping(path))
    hint = path.read_text(encoding="utf-8").splitlines()[0]
    assert hint == f"# yaml-language-server: $schema=../schemas/{kind}.schema.json"
    assert (path.parent / hint.partition("=")[2]).is_file()


def test_an_editor_accepts_a_bare_zero_where_the_reader_does():
    car = {"name": "car1", "device": "jetson_tx2"}
    assert not complaints("scenario", {"cars": [{**car, "route": {"start": 0}}], "warm_up": 0})
    assert complaints("scenario", {"cars": [{**car, "route": {"start": 3}}]})
    assert complaints("scenario", {"cars": [car], "genie": {"object_map": {"gate": True}}})


def test_an_editor_marks_misspelt_and_misplaced_settings():
    car = {"name": "car1", "device": "jetson_tx2"}
    assert complaints("scenario", {"cars": [{**car, "devise": "x"}]})
    assert complaints("scenario", {"cars": [car], "genie": {"eviction": "lruu"}})
    assert complaints("scenario", {"cars": [car], "genie": {"object_map": {"threshold": 60}}})
    assert complaints("scenario", {"genie": {}}), "without cars"
    assert not complaints(
        "scenario",
        {"cars": [car], "genie": {"eviction": "my_policies:Random", "capacity": "10 MB"}},
    )


def test_an_editor_knows_the_settings_of_each_plug_in():
    car = {"name": "car1", "device": "jetson_tx2"}
    town = {"source": "town", "duration": "6 s", "town": {"blocks": [3, 2]}}
    assert not complaints("scenario", {"cars": [car], "perception": town})
    assert complaints("scenario", {"cars": [car], "perception": {**town, "durration": "6 s"}})
    assert complaints("scenario", {"cars": [car], "perception": {**town, "town": {"blok": 3}}})
    assert complaints(
        "scenario", {"cars": [car], "genie": {"similarity": {"name": "dhash", "cell": "1 m"}}}
    )
    assert not complaints(
        "scenario", {"cars": [car], "perception": {"source": "my.code:Frames", "rate_hz": 30}}
    )


@pytest.mark.parametrize("kind", SCHEMAS)
def test_the_shipped_schemas_are_those_of_the_code(kind: str):
    """If not: ``genie-sim show --schema scenario > schemas/scenario.schema.json``, and the same for
    ``device``.
    """
    shipped = (REPOSITORY / "schemas" / f"{kind}.schema.json").read_text(encoding="utf-8")
    assert json.loads(shipped) == json_schema(kind)


def test_the_command_prints_a_schema(run_cli):
    printed = run_cli("show", "--schema", "device")
    assert printed.returncode == 0
    assert json.loads(printed.stdout) == json_schema("device")
    wrong = run_cli("show", "--schema", "devise")
    assert wrong.returncode == 1
    assert "did you mean 'device'?" in wrong.stderr
