"""Searches of a real scenario that are killed, shared out, or run on a cluster."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
import pytest

from genie_sim.cli import main
from genie_sim.scenario.yaml_input import dump
from tests.conftest import REPOSITORY
from tests.tuning.test_search import TABLES
from tests.tuning.test_search_of_scenarios import SHORT

SEARCH = {**SHORT, "points": 6, "batch": 2}


def run(out: str, *more: str) -> dict[str, bytes]:
    """The tables of the search after the command, which must be done."""
    Path("s.yaml").write_text(dump(SEARCH))
    assert main(["search", "s.yaml", "--out", out, *more]) == 0
    return {name: (Path(out) / "s" / name).read_bytes() for name in TABLES}


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("whole")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        return run("out", "--jobs", "1")


@pytest.mark.unix
@pytest.mark.parametrize("storage", ["journal", "sqlite"])
def test_kill_9_and_resume_loses_nothing(storage: str, uninterrupted: dict[str, bytes]):
    Path("s.yaml").write_text(dump(SEARCH))
    command = ["search", "s.yaml", "--out", "out", "--jobs", "1", "--storage", storage]
    process = subprocess.Popen(
        [sys.executable, "-m", "genie_sim", *command],
        env={**os.environ, "PYTHONPATH": str(REPOSITORY)},
        start_new_session=True,
        stdout=subprocess.DEVNULL,
    )
    deadline = time.monotonic() + 300
    while len(list(Path("out").glob("s/parts/*.parquet"))) < 3 and time.monotonic() < deadline:
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    before = {path: path.stat().st_mtime_ns for path in Path("out/s/parts").glob("[!.]*.parquet")}
    assert before and not Path("out/s/designs.csv").exists()
    assert run("out", "--jobs", "1", "--storage", storage) == uninterrupted
    assert before.items() <= {path: path.stat().st_mtime_ns for path in before}.items()
    ids = [
        run_id
        for path in Path("out/s/parts").glob("*.parquet")
        for run_id in pd.read_parquet(path)["run_id"].unique()
    ]
    assert len(ids) == len(set(ids)), "no run was made twice"


def test_a_cluster_gives_the_same_bytes(uninterrupted: dict[str, bytes]):
    distributed = pytest.importorskip("distributed", reason="Dask comes with '.[dask]'")
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=True, dashboard_address=None, host="127.0.0.1"
    ) as cluster:
        address = cluster.scheduler_address
        assert run("out", "--backend", "dask", "--scheduler", address) == uninterrupted


def test_shards_in_turn_make_one_report(capsys: pytest.CaptureFixture[str]):
    Path("s.yaml").write_text(dump(SEARCH))
    for number in (1, 2):
        assert main(["search", "s.yaml", "--jobs", "1", "--shard", f"{number}/2"]) == 0
        printed = capsys.readouterr().out
        assert ("3 of 6 points are in results/s; the last shard" in printed) == (number == 1)
    points = pd.read_csv("results/s/points.csv")
    assert points["point"].tolist() == list(range(6))
