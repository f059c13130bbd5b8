"""Options of ``genie-sim import tables`` and ``genie-sim import link``."""

from __future__ import annotations

import math
from dataclasses import astuple
from pathlib import Path
from typing import Any

import pytest

from genie_sim.cli.main import main
from genie_sim.data import intake, table_import
from genie_sim.data.world_table import SOMEWHERE
from genie_sim.links import recording

TABLES = ["import", "tables", "poses.csv", "detections.csv", "--out", "traces"]


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """What the import was asked for."""
    given: list[Any] = []

    def cars_of_tables(*files: Any, **options: Any) -> list[Any]:
        given.append((files, options))
        return []

    monkeypatch.setattr(table_import, "cars_of_tables", cars_of_tables)
    monkeypatch.setattr(intake, "write_cars", lambda out, _: [f"{out}: written"])
    return given


def test_tables_with_what_holds_unless_it_is_said(asked: list[Any], capsys):
    assert main(TABLES) == 0
    (files, options) = asked[0]
    assert files == (Path("poses.csv"), Path("detections.csv"), None)
    assert options["origin"] == SOMEWHERE
    assert astuple(options["sensor"]) == (math.tau, 960_000, 40.0), "it sees all around itself"
    assert capsys.readouterr().out == "traces: written\n"


def test_every_option_of_tables_is_heard(asked: list[Any]):
    line = "--truth o.csv --fov 90deg --frame-size 5kB --range 7m --origin 49,8,112"
    assert main([*TABLES, *line.split()]) == 0
    (files, options) = asked[0]
    assert files[2] == Path("o.csv") and options["origin"] == (49.0, 8.0, 112.0)
    assert astuple(options["sensor"]) == (pytest.approx(math.pi / 2), 5_000, 7.0)


@pytest.mark.parametrize(
    ("option", "value", "message"),
    [
        ("--fov", "361 deg", "--fov: must be at most 360 deg, but is 361 deg"),
        ("--fov", "0", "--fov: must be more than zero, but is 0"),
        ("--frame-size", "0 B", "--frame-size: must be more than zero, but is 0 B"),
        ("--range", "-1 m", "--range: must be more than zero, but is -1 m"),
        ("--range", "2 km", "--range: must be at most 1000 m, but is 2 km"),
        ("--range", "far", "--range: "),
        ("--origin", "49,8", "--origin: '49,8': expected latitude"),
    ],
)
def test_what_no_sensor_has_is_one_line(asked: list[Any], capsys, option, value, message):
    assert main([*TABLES, "--truth", "truth.csv", option, value]) == 1
    line = capsys.readouterr().err
    assert line.startswith(f"genie-sim: {message}") and len(line.splitlines()) == 1 and not asked


def test_a_recorded_link_says_how_long_it_is_and_what_it_has(capsys):
    Path("drive.csv").write_text("time_s,up_mbps,rtt_ms\n10,1.5,20\n12.5,2,30\n")
    line = ["import", "link", "drive.csv", "--out", "d.parquet", "--source", "me"]
    assert main([*line, "--licence", "CC0"]) == 0
    first, *told = capsys.readouterr().out.splitlines()
    assert first == "d.parquet: 2 rows, 2.5 s: up_bps, rtt_ns" and len(told) == 2
    about = recording.read("d.parquet").about
    assert (about["format"], about["file"]) == ("csv", "drive.csv")
    assert (about["source"], about["licence"]) == ("me", "CC0")


@pytest.mark.parametrize(
    ("options", "column"), [([], "up_bps"), (["--direction", "down"], "down_bps")]
)
def test_rates_of_one_direction_are_those_of_the_option(options: list[str], column: str):
    Path("trace.txt").write_text("5\n100\n101\n350\n")
    line = ["import", "link", "trace.txt", "--format", "mahimahi", "--out", "t.parquet"]
    assert main([*line, *options]) == 0
    assert {*recording.read("t.parquet").columns} == {"t_ns", column}


def test_a_link_that_never_carries_anything_is_one_line(capsys):
    Path("drive.csv").write_text("time_s,up_mbps\n0,0\n1,0\n")
    assert main(["import", "link", "drive.csv", "--out", "d.parquet"]) == 1
    told = capsys.readouterr().err
    assert (
        "no rate is above 0: nothing would get through" in told and not Path("d.parquet").exists()
    )
