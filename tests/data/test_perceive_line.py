"""``perceive`` on the command line."""

from __future__ import annotations

import pytest

from genie_sim.cli.main import main
from genie_sim.data.trace import read_trace
from tests.kitti_folder import DATE, make_network, make_street
from tools.make import evaluation


@pytest.fixture
def street(tmp_path):
    """One car 15 m ahead, as in the tests of ``perceive``, and its tracklet."""
    folder = make_street(tmp_path / "kitti")
    values = {"ty": 0, "tz": -0.8, "rz": 0, "occlusion": 0, "truncation": 0}
    pose = "".join(f"<{name}>{value}</{name}>" for name, value in values.items())
    poses = f"<item><tx>17</tx>{pose}</item>" * 3
    item = "<objectType>Car</objectType><h>1</h><w>1.8</w><l>4</l><first_frame>0</first_frame>"
    item += f"<poses>{poses}</poses>"
    (folder / "tracklet_labels.xml").write_text(
        f"<b><tracklets><item>{item}</item></tracklets></b>"
    )
    make_network(tmp_path / "yolox_nano.onnx")
    return (
        "perceive",
        "--kitti",
        "kitti",
        "--drive",
        f"{DATE}/0005",
        "--weights",
        "yolox_nano.onnx",
    )


def test_a_detector_is_judged_by_the_labels_of_a_drive(street, capsys, monkeypatch, tmp_path):
    monkeypatch.setenv("GENIE_SIM_KITTI", str(tmp_path / "kitti"))
    monkeypatch.setenv("GENIE_SIM_WEIGHTS", str(tmp_path))
    assert evaluation.main(["--drive", f"{DATE}/0005", "--cameras", "02,03"]) == 0
    told = capsys.readouterr().out
    assert "| vehicles (IoU 0.5) | 6 | 1.000 | 1.00 | 1.00 |" in told
    assert "| vehicles | 6 of 6 |" in told
    assert evaluation.main(["--drive", f"{DATE}/0005", "--labels", "tracking/0000"]) == 1
    assert "unknown labelled drive 'tracking/0000'" in capsys.readouterr().err


def test_origin_and_missing_scans(street, run_cli, tmp_path):
    (scan,) = (tmp_path / "kitti").rglob("*_sync/velodyne_points/data/0000000001.bin")
    scan.unlink()
    refused = run_cli(*street, "--out", "x.parquet")
    assert refused.returncode == 1
    assert "0000000001.bin: missing" in refused.stderr
    done = run_cli(
        *street, "--out", "x.parquet", "--allow-missing-scans", "--origin", "49.0,8.4,100"
    )
    assert done.returncode == 0, done.stderr
    trace = read_trace(tmp_path / "x.parquet")
    assert trace.origin == (49.0, 8.4, 100.0)
    # 0.0112 degrees of latitude
    assert trace.frames["02"][0].pose.north_m == pytest.approx(1245, rel=0.01)


@pytest.mark.parametrize(
    ("arguments", "place"), [((), "--out"), (("--out", "x.parquet", "--providers", "TPU"), "'TPU'")]
)
def test_mistakes_are_one_line(street, run_cli, arguments, place):
    done = run_cli(*street, *arguments)
    assert done.returncode == 1
    assert place in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("option", "place"),
    [
        ("--origin=91,1,2", "latitude 91.0"),
        ("--origin=49,-180.5,2", "longitude -180.5"),
        ("--origin=49,8,inf", "altitude inf"),
        ("--origin=49,8", "for example 49.01,8.42,112.8"),
        ("--size=x", "--size: 'x': expected WIDTHxHEIGHT"),
        ("--size=640x-32", "--size: '640x-32': "),
    ],
)
def test_a_value_that_cannot_be_gets_one_line(option, place, capsys):
    assert main(["perceive", "--drive", f"{DATE}/0005", "--out", "x.parquet", option]) == 1
    error = capsys.readouterr().err
    assert place in error
    assert error.count("\n") == 1
