"""Running a result folder again: contents are compared, and versions that differ are named."""

from __future__ import annotations

import hashlib
import json
import sys
from pathlib import Path

import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest

import genie_sim as gs
from genie_sim.cli.main import main
from tests.checkout import REPOSITORY

OWN = """
from dataclasses import dataclass

from genie_sim.methods.remote import Remote


@dataclass(frozen=True)
class Mine(Remote):
    entries: int = 1
    cell: int = 2
"""
SHORT = ["--no-report", "--set", "cars[0].route.window=[0 s, 1 s]"]


def only_folder() -> Path:
    (folder,) = Path("results").iterdir()
    return folder


def test_own_settings_keep_the_order_in_which_they_were_written(tmp_path, capsys):
    (tmp_path / "two_settings.py").write_text(OWN)
    sys.modules.pop("two_settings", None)
    methods = "methods=[{name: mine, method: 'two_settings:Mine', entries: 3, cell: 4}]"
    assert main(["run", "street_1car_homo", *SHORT, "--set", methods]) == 0
    assert main(["rerun", str(only_folder()), "--allow-own-code"]) == 0
    assert capsys.readouterr().out.endswith("reproduced, byte for byte\n")


def test_a_run_has_the_device_profiles_it_was_made_with(capsys):
    mine = Path("mine.yaml")
    text = (REPOSITORY / "device_profiles/jetson_tx2.yaml").read_text()
    mine.write_text(text.replace("name: jetson_tx2", "name: mine"))
    line = ["run", "street_1car_homo", *SHORT, "--methods", "local"]
    assert main([*line, "--set", "cars[0].device=./mine.yaml"]) == 0
    mine.unlink()
    assert main(["rerun", str(only_folder())]) == 0
    assert capsys.readouterr().out.endswith("reproduced, byte for byte\n")
    scenario = gs.load(only_folder()).scenario
    assert gs.load_scenario(scenario, seed=2).profiles["./mine.yaml"].name == "mine"


def test_each_run_of_several_seeds_is_run_again(capsys):
    line = ["run", "street_1car_homo", *SHORT, "--methods", "remote", "--seeds", "2", "--jobs", "1"]
    assert main(line) == 0
    assert main(["rerun", str(only_folder())]) == 0
    said = capsys.readouterr().out
    assert all(f"runs/seed-{seed}: reproduced, byte for byte\n" in said for seed in (1, 2))


@pytest.mark.parametrize("value", ["as it was", "another"])
def test_what_another_version_wrote_is_compared_by_contents(value, capsys, caplog):
    """Its bytes are others; a value that is another one is not taken for a matter of bytes."""
    assert main(["run", "street_1car_homo", *SHORT, "--methods", "remote"]) == 0
    folder = only_folder()
    about = json.loads((folder / "run.json").read_text())
    about["packages"]["pyarrow"] = "15.0.0"
    for path in folder.glob("*.parquet"):
        table = pq.read_table(path)
        if value == "another" and path.name == "frames.parquet":
            place = table.schema.get_field_index("stamp_ns")
            more = pc.add(table.column(place), 1).cast(table.schema.field(place).type)
            table = table.set_column(place, table.schema.field(place), more)
        pq.write_table(table, path, compression="snappy")
        about["digests"][path.name] = hashlib.sha256(path.read_bytes()).hexdigest()
    scenario = folder / "scenario.resolved.yaml"
    scenario.write_text(f"# of another version\n{scenario.read_text()}")
    about["digests"][scenario.name] = hashlib.sha256(scenario.read_bytes()).hexdigest()
    (folder / "run.json").write_text(json.dumps(about))
    capsys.readouterr()
    assert main(["rerun", str(folder)]) == (value == "another")
    said = capsys.readouterr().out
    assert "poses.parquet: equal\n" in said and "metrics.json: identical\n" in said
    assert "scenario.resolved.yaml: equal\n" in said
    assert ("frames.parquet: DIFFERENT\n" in said) == (value == "another")
    assert said.endswith("reproduced, by contents\n") == (value == "as it was")
    assert "pyarrow: 15.0.0 when it was made" in caplog.text
