"""The importer of CooperScene, on the take that its page makes up, and what a queue adds to the
latencies that are printed for such links.
"""

from __future__ import annotations

import runpy
import shutil
from pathlib import Path
from typing import Any

import import_cooperscene
import pandas as pd
import pytest
import yaml

import genie_sim as gs
from tests.checkout import REPOSITORY
from tests.run_page import blocks

PAGE = REPOSITORY / "docs" / "examples" / "import_cooperscene.md"
TAKE = Path("cooperscene/test/1")


@pytest.fixture(scope="module")
def made_up(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with what the page's program writes."""
    folder = tmp_path_factory.mktemp("made_up")
    (program,) = (one for one in blocks(PAGE.read_text(encoding="utf-8")) if one.title)
    (folder / "made_up_take.py").write_text(program.text, encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        runpy.run_path("made_up_take.py")
    return folder


@pytest.fixture
def folder(made_up: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of it, in which the test runs."""
    shutil.copytree(made_up, tmp_path / "mine")
    monkeypatch.chdir(tmp_path / "mine")
    return tmp_path / "mine"


def imported(*others: str) -> int:
    return import_cooperscene.main([str(TAKE), *others, "--out", "take"])


def changed(path: Path, field: str, value: Any) -> None:
    told = yaml.safe_load(path.read_text())
    told[field] = value
    path.write_text(yaml.safe_dump(told))


def rows(name: str) -> pd.DataFrame:
    return pd.read_csv(f"take/tables/{name}.csv")


def test_all_agents_are_on_one_clock_and_on_one_map(folder: Path):
    (folder / TAKE / "2" / "481264.yaml").unlink()  # a scan that was lost
    assert imported() == 0
    times = {car: list(of["time_s"]) for car, of in rows("poses").groupby("car")}
    clock = [round(0.1 * frame, 6) for frame in range(30)]
    assert times.pop("car2") == [time_s for time_s in clock if time_s != 0.4]
    assert times == dict.fromkeys(("roadside", "car1", "car3"), clock)
    parked = rows("detections").query("time_s == 0 and east_m == -18 and north_m == 6")
    assert set(parked["car"]) == {"roadside", "car1", "car3"}, "all who are near see it there"
    trace = Path("take/car1.parquet")
    assert trace.exists() and trace.with_suffix(".truth.parquet").exists()


def test_every_car_has_the_truth_of_all_but_itself(folder: Path):
    assert imported() == 0
    first = rows("objects").query("time_s == 0")
    named = {car: set(of["object"]) for car, of in first.groupby("car")}
    far = named["roadside"]
    assert {1, 2, 3} < far
    assert {car: far - of for car, of in named.items()} == {
        "roadside": set(),
        "car1": {1},
        "car2": {2},
        "car3": {3},
    }


def test_a_pose_may_be_a_matrix_and_a_middle_may_be_off_the_place(folder: Path):
    first = folder / TAKE / "1" / "481260.yaml"
    turned = [[0.0, -1.0, 0.0, 7.0], [1.0, 0.0, 0.0, 8.0], [0.0, 0.0, 1.0, 1.8], [0, 0, 0, 1]]
    changed(first, "lidar_pose", turned)
    label = {"location": [10.0, 20.0, 0.0], "angle": [0.0, 90.0, 0.0], "center": [1.0, 0.5, 0.0]}
    changed(first, "vehicles", {7: label})
    frame = import_cooperscene.Frame(first)
    assert (frame.east_m, frame.north_m, frame.heading_deg) == pytest.approx((7.0, 8.0, 90.0))
    assert frame.objects == {"7": pytest.approx((9.5, 21.0))}


def test_a_link_has_the_rates_of_both_ways_and_the_sum_of_latencies(folder: Path):
    (folder / "links.csv").write_text(
        "time_s,from,to,throughput_mbps,latency_ms,loss,jitter_ms\n"
        "0,1,0,2,10,0,0\n0,0,1,4,20,0,0\n1,1,0,1,30,0,0\n"
    )
    assert imported("--links", "links.csv") == 0
    assert Path("take/car1-roadside.link.parquet").exists()
    found = rows("car1-roadside").values.tolist()
    assert found == [[0, 2, 4, 30], [1, 1, 4, 50]]


TITLES = "time_s,from,to,throughput_mbps,latency_ms,loss,jitter_ms\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (TITLES, "links.csv: "),
        ("", "links.csv: "),
        (TITLES + "0,1,0,-1.6,12,0,0\n", "line 2: throughput_mbps: must be a number of at least 0"),
        (TITLES + "0,1,7,1.6,12,0,0\n", "line 2: to: must be one of 0, 1, 2, 3"),
        (TITLES + "0,1,0,1.6,12,0,0\n", "has rows from 1 to 0, but none back"),
        (TITLES + "0,0,1,1.6,12,0,0\n", "has rows from 0 to 1, but none back"),
    ],
)
def test_a_bad_table_of_links_is_one_line(folder: Path, capsys: Any, text: str, message: str):
    (folder / "links.csv").write_text(text)
    assert imported("--links", "links.csv") == 1
    said = capsys.readouterr().err
    assert message in said and said.count("\n") == 1, said


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("lidar_pose", None, "481260.yaml: lidar_pose: must be 6 numbers, not None"),
        ("lidar_pose", [0, "x", 0, 0, 0, 0], "lidar_pose: must be 6 numbers"),
        ("lidar_pose", [[0] * 4] * 3 + [5], "lidar_pose: must be 4 numbers, not 5"),
        ("vehicles", [1, 2], "vehicles: must be a mapping of ids"),
        ("vehicles", {7: 3}, "vehicles.7: must be a mapping with location"),
        ("vehicles", {7: {}}, "vehicles.7.location: must be 3 numbers, not None"),
    ],
)
def test_a_bad_field_is_one_line(folder: Path, capsys: Any, field: str, value: Any, message: str):
    changed(folder / TAKE / "0" / "481260.yaml", field, value)
    assert imported() == 1
    said = capsys.readouterr().err
    assert message in said and said.count("\n") == 1, said


def test_a_broken_take_is_one_line(folder: Path, capsys: Any):
    frame = folder / TAKE / "2" / "481260.yaml"
    for text, message in (("a: [1, 2", "481260.yaml: is no YAML"), ("- 1", "must be a mapping")):
        frame.write_text(text)
        assert imported() == 1
        said = capsys.readouterr().err
        assert message in said and said.count("\n") == 1
    for scan in frame.parent.iterdir():
        scan.unlink()
    assert imported() == 1 and "has no frames" in capsys.readouterr().err
    shutil.rmtree(frame.parent)
    assert imported() == 1 and "agent 2 is missing" in capsys.readouterr().err


@pytest.mark.slow
def test_the_printed_latency_is_one_without_a_queue(folder: Path):
    """59.5 kB at 1.6 Mbit/s take 298 ms, so of the ten a second, two of three are lost and the rest
    waits for up to a period.
    """
    assert imported("--links", "links.csv") == 0
    shutil.copy(REPOSITORY / "examples" / "import_cooperscene.yaml", ".")

    def answered_ms(link: Any) -> pd.Series:
        car = {"name": "car1", "device": "orin_nano", "edge": "roadside", "link": link}
        frames = gs.run("import_cooperscene.yaml", {"cars": [car], "methods": ["remote"]}).frames
        return (frames["first_answer_ns"] - frames["received_ns"]) / 1e6

    took_ms = answered_ms({"like": "ideal", "rate_up": "1.6 Mbit/s"}) - answered_ms("ideal")
    assert took_ms.iloc[0] == 1e3 * 59_500 * 8 / 1.6e6
    later = took_ms.dropna().iloc[1:]
    assert later.between(297.5 + 50, 297.5 + 100).all()
    assert took_ms.isna().mean() == pytest.approx(2 / 3, abs=0.05)


@pytest.mark.slow
def test_the_shipped_scenario_drives_what_was_imported(folder: Path):
    assert imported("--links", "links.csv") == 0
    shutil.copy(REPOSITORY / "examples" / "import_cooperscene.yaml", ".")
    run = gs.run("import_cooperscene.yaml", {"methods": ["remote"]})
    frames = run.frames
    assert set(frames["car"]) == {"car1", "car2", "car3", "mast"}
    first = frames.groupby("car")["first_answer_ns"].apply(lambda times: times.notna().mean())
    assert first["mast"] == 1.0 and (first.drop("mast") < 0.5).all()
