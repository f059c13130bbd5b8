"""Parts of the replay: what hosts have to do over time, pictures of cameras, packed columns."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from genie_sim.record.columns import Columns
from genie_sim.record.records import RESOURCES
from genie_sim.record.tables import Table
from genie_sim.report import replay_pictures
from genie_sim.report.packing import deltas, integers, scaled
from genie_sim.report.replay_hosts import HOSTS_PER_PLACEMENT, hosts_over_time, shown_hosts
from genie_sim.report.replay_pictures import Pictures, pictures_of

MS = 1_000_000


def test_columns_are_packed_as_short_whole_numbers():
    assert deltas(np.array([5, 7, 7, 4])) == [5, 2, 0, -3]
    assert scaled(np.array([0.1, 0.25, 1.0006]), 1000).tolist() == [100, 250, 1001]
    assert integers(np.array([1.0, np.nan, 3.0])).tolist() == [1, -1, 3]


def samples(*rows: tuple[int, str, str, int | None, int, int, int]) -> Columns:
    """Of time [ms], resource, kind, capacity, busy [ms], queue and dropped."""
    table = Table(RESOURCES)
    for t_ms, name, kind, capacity, busy_ms, queue, dropped in rows:
        table.append(
            ("m", t_ms * MS, name, kind, capacity, busy_ms * MS, queue, 0, dropped, None, 0, 0)
        )
    return Columns.of(table.to_frame())


def test_a_host_s_accelerator_queues_and_links_at_each_sample():
    """Two cores that worked 150 of 2 x 100 ms, then 100 of 2 x 100; queues and links together."""
    rows = samples(
        (100, "car1.accelerator", "accelerator", 2, 0, 9, 9),
        (200, "car1.accelerator", "accelerator", 2, 150, 9, 9),
        (300, "car1.accelerator", "accelerator", 2, 250, 9, 9),
        (100, "car1.cpu", "cpu", 1, 0, 7, 7),
        (100, "car1/detector:/image_raw", "queue", None, 0, 1, 0),
        (300, "car1/detector:/image_raw", "queue", None, 0, 2, 4),
        (200, "car1->edge1", "link", 1, 0, 5, 1),
        (300, "car1->edge1", "link", 1, 0, 6, 3),
        (100, "car10.accelerator", "accelerator", 1, 0, 0, 0),
        (100, "edge1.accelerator", "accelerator", 1, 0, 0, 0),
        (200, "edge1.accelerator", "accelerator", 1, 40, 0, 0),
    )
    shown = dict(hosts_over_time(rows, ["car1", "edge1", "car2"]))
    assert shown == {
        "car1": {
            "t_us": [100_000, 100_000, 100_000],
            "busy": [0, 750, 500],
            "waiting": [1, 5, 8],
            "lost": [0, 1, 6],
        },
        "edge1": {
            "t_us": [100_000, 100_000],
            "busy": [0, 400],
            "waiting": [0, 0],
            "lost": [0, 0],
        },
    }, "a host without resources is not shown"


def test_the_first_hosts_of_each_placement_are_shown():
    cars = [{"name": f"car{number}"} for number in range(9)]
    run: Any = SimpleNamespace(facts={"scenario": {"cars": cars, "edges": [{"name": "edge1"}]}})
    names = shown_hosts(run)
    assert names == [*(f"car{number}" for number in range(HOSTS_PER_PLACEMENT)), "edge1"]


def shown(copied: bool, most: int, monkeypatch: Any) -> tuple[dict[str, Any], list[str]]:
    """Five frames of which one has no picture and two have the same one."""
    monkeypatch.setattr(replay_pictures, "MAX_PICTURES", most)
    poses = Columns(
        {
            "car": np.array(["car1"] * 5, dtype=object),
            "stream": np.array(["02", "02", "03", "02", "02"], dtype=object),
            "frame": np.array([0, 1, 0, 2, 3]),
        }
    )
    names = {("02", 0): "a", ("02", 1): "b", ("03", 0): "a", ("02", 3): "c"}
    paths = {("car1", *key): Path(name) for key, name in names.items()}
    pictures = Pictures(paths, lambda path: f"<{path.name}>", "KITTI", copied)
    notes: list[str] = []
    return pictures_of(poses, pictures, notes), notes


def test_each_picture_has_one_address(monkeypatch):
    known, notes = shown(copied=True, most=3, monkeypatch=monkeypatch)
    assert known == {
        "addresses": ["<a>", "<b>", "<c>"],
        "of_frame": [0, 1, 0, -1, 2],
        "attribution": "KITTI",
    }
    assert notes == []


def test_a_page_limits_its_copies_and_says_so(monkeypatch):
    few, notes = shown(copied=True, most=2, monkeypatch=monkeypatch)
    assert few["addresses"] == ["<a>", "<b>"] and few["of_frame"] == [0, 1, 0, -1, -1]
    assert notes == ["The page holds 2 of 3 pictures, the first ones."]
    all_of_them, notes = shown(copied=False, most=2, monkeypatch=monkeypatch)
    assert len(all_of_them["addresses"]) == 3 and notes == []
