"""The methods of a run side by side: the same tables, told of while they are made."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import genie_sim as gs
from genie_sim.cli.main import main
from genie_sim.runs.prepare import prepare
from genie_sim.runs.simulate import simulate
from genie_sim.scenario.reading import read_scenario
from genie_sim.scenario.scenario import RECORDS
from tests.checkout import REPOSITORY

EVERY_TABLE = {
    "name": "every_table",
    "methods": ["local", "remote", "genie"],
    "record": list(RECORDS),
    "perception": {
        "source": "town",
        "duration": "1 s",
        "town": {"blocks": [1, 1], "block": "100 m"},
    },
    "cameras": [{"name": "camera_02", "recording": "02", "size": "100 kB"}],
    "fleet": {"cars": 3, "devices": "orin_nano", "edge_device": "rtx_a4500", "cell": "100 m"},
}


def written(tables, folder: Path) -> dict[str, bytes]:
    folder.mkdir()
    for name, table in tables.items():
        table.write(folder / name)
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_methods_in_processes_write_the_same_tables_as_one_by_one(tmp_path, monkeypatch):
    """Poses and the detector without delay are those of the first method that drives a car."""
    prepared = prepare(read_scenario(EVERY_TABLE))
    tables = simulate(prepared)
    assert len(tables["poses"]) and len(tables["held"]) and len(tables["steps"])
    one_by_one = written(tables, tmp_path / "one by one")
    monkeypatch.setattr(
        "genie_sim.runs.method_processes.in_processes", lambda run, jobs, _: map(run, jobs)
    )
    spill = tmp_path / "spill"
    spill.mkdir()
    for folder in (None, spill):
        apart = written(
            simulate(prepared, workers=3, spill=folder), tmp_path / f"to {bool(folder)}"
        )
        assert apart == one_by_one
    assert not list(spill.iterdir())


@pytest.mark.nightly
def test_processes_write_the_results_of_one_process():
    one, two = (gs.run(EVERY_TABLE, out=f"with {jobs}", jobs=jobs) for jobs in (1, 2))
    assert one.run_id == two.run_id
    of_one, of_two = ({path.name for path in run.folder.iterdir()} for run in (one, two))
    assert of_one == of_two
    for name in of_one - {"run.json"}:
        assert (one.folder / name).read_bytes() == (two.folder / name).read_bytes(), name


def test_progress_is_that_of_all_methods_together(monkeypatch):
    monkeypatch.setattr(
        "genie_sim.runs.method_processes.in_processes", lambda run, jobs, _: map(run, jobs)
    )
    told = []
    simulate(prepare(read_scenario(EVERY_TABLE)), lambda *now: told.append(now), workers=3)
    assert [done_s / told[0][0] for done_s, _, _ in told] == pytest.approx([1, 2, 3])
    assert {of_s / told[0][0] for _, of_s, _ in told} == {3.0}


@pytest.mark.parametrize("jobs", [0, -1, 1.5, "two", True])
def test_jobs_are_a_whole_number_from_one_on(jobs):
    with pytest.raises(gs.UserError, match=r"^jobs: .*: expected a whole number"):
        gs.run("street_1car_homo", jobs=jobs)


@pytest.mark.parametrize("jobs", ["0", "-1", "two", "1.5"])
def test_jobs_that_are_none_are_refused_by_name(jobs, capsys):
    assert main(["run", "street_1car_homo", "--jobs", jobs]) == 2
    assert "Invalid value for '--jobs'" in capsys.readouterr().err


def test_one_method_needs_no_process_of_its_own(tmp_path, monkeypatch):
    def refuse(*_):
        raise AssertionError("one method runs here")

    monkeypatch.setattr("genie_sim.runs.method_processes.in_processes", refuse)
    settings = {"cars[0].route.window": ["0 s", "0.3 s"]}
    gs.run("street_1car_homo", settings, methods=["local"], jobs=8)


def memory_told_by(program: str) -> list[int]:
    """The numbers that a Python program prints; it knows ``max_memory_bytes``."""
    program = f"from genie_sim.base.parallel import max_memory_bytes\n{program}"
    told = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=REPOSITORY
    )
    return [int(number) for number in told.stdout.split()]


@pytest.mark.process
@pytest.mark.skipif(sys.platform == "win32", reason="Windows does not tell")
def test_the_memory_of_a_process_is_the_most_that_it_had():
    before, after = memory_told_by(
        "before = max_memory_bytes()\n"
        "room = b'x' * 300_000_000\n"
        "del room\n"
        "print(before, max_memory_bytes())\n"
    )
    assert 10**7 < before <= after and 300_000_000 < after < before + 600_000_000


@pytest.mark.process
@pytest.mark.skipif(sys.platform == "win32", reason="Windows does not tell")
def test_a_process_does_not_show_the_memory_of_the_one_that_started_it():
    ours, its = memory_told_by(
        "import os, subprocess, sys\n"
        "tell = 'from genie_sim.base.parallel import max_memory_bytes; print(max_memory_bytes())'\n"
        "room = b'x' * 300_000_000\n"
        "print(max_memory_bytes(), flush=True)\n"
        "subprocess.run([sys.executable, '-c', tell], check=True)\n"
    )
    assert ours > 300_000_000 > 2 * its
