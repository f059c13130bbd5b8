"""The goals of the recommended Genie: what was missed is told, and pages say what the files say."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest

from benchmarks import look_goals
from benchmarks.speed_page import filled
from benchmarks.where_it_pays import GENIE, OUT, WITHOUT_GENIE
from benchmarks.where_it_pays_page import PAGE, read

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(autouse=True)
def in_the_repository(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)


def runs(genie: dict[str, float], others: float = 0.8) -> pd.DataFrame:
    """Two seeds of conditions: F1 of the Genie, and of every other method."""
    rows = []
    for condition, f1 in genie.items():
        for method in (*WITHOUT_GENIE, "genie_prototype", GENIE):
            for seed in (1, 2):
                row = {"condition": condition, "seed": seed, "method": method, "lap 1": 0.8}
                is_genie = method == GENIE
                row |= {"streaming_f1": f1 if is_genie else others, "lap 3": f1}
                row |= {"uplink_bytes": 3.0 if is_genie else 10.0, "first_answer_mean": 9.0}
                rows.append(row)
    return pd.DataFrame(rows)


def verdicts(seen: pd.DataFrame, held_out: pd.DataFrame) -> list[str]:
    lines = look_goals.goals(seen, held_out).splitlines()[2:]
    return [line.rpartition(" | ")[2].strip("* |") for line in lines]


def test_goals_are_met_or_missed():
    """In order: held-out mean and worst, both beside the prototype, ahead, laps, first, bytes."""
    good = runs(dict.fromkeys(look_goals.PROTOTYPE, 0.95), others=0.93)
    assert verdicts(good, good) == ["met"] * 8
    assert verdicts(good, runs({"a": 0.85, "b": 0.785})) == ["met", "missed", *["met"] * 6]
    assert verdicts(good, runs({"a": 0.8, "b": 0.795})) == ["missed", *["met"] * 7]
    bad = runs(dict.fromkeys(look_goals.PROTOTYPE, 0.77)).assign(first_answer_mean=11.0)
    bad.loc[bad["method"] == GENIE, "uplink_bytes"] = 5.0
    assert verdicts(bad, runs({"a": 0.85})) == ["met", "met", *["missed"] * 6]


def test_curves_are_means_by_p_min():
    base = {"streaming_f1": 0.5, "ghost_share": 0.25}
    rows = [
        {**base, "condition": name, "method": method, "p_min": p_min, "lap 1": 0.8, "lap 3": lap}
        for name in ("0008, here", "town, 5G", *(f"three laps, {p}" for p in look_goals.PAUSES))
        for method in (GENIE, "remote_tracker")
        for p_min, lap in ((0.7, 0.75), (0.8, 0.79))
    ]
    curves = pd.DataFrame(rows)
    assert look_goals.missed(curves).splitlines()[2] == (
        "| 0008, here: Genie | 0.500, 0.25 | 0.500, 0.25 |"
    )
    assert look_goals.laps(curves).splitlines()[-1] == "| 60 s | -0.050 | -0.010 |"


def test_the_genie_is_compared_with_the_better_tracker_of_the_town():
    f1 = {GENIE: (0.8, [0.84, 0.80]), "remote_tracker": (0.5, [0.8, 0.8])}
    f1 |= {"local_tracker": (0.5, [0.81, 0.81])}
    rows = [
        {"condition": "town, LTE", "seed": seed, "method": name, "p_min": p_min, "streaming_f1": f}
        for name, (p_min, values) in f1.items()
        for seed, f in enumerate(values)
    ]
    line = look_goals.tuned_to_town(pd.DataFrame(rows)).splitlines()[2]
    assert line == "| town, LTE | 0.820 | 0.810 | 0.800 | +0.010 (+0.030, -0.010) |"


def test_pages_say_what_the_files_say():
    seen, held_out, _, second = read()
    curves = pd.read_csv(OUT / "curves.csv")
    tables = look_goals.looks_blocks(seen, held_out, second, curves)
    for page, blocks in {
        look_goals.LOOKS_PAGE: tables,
        PAGE: look_goals.town_blocks(curves),
    }.items():
        text = page.read_text(encoding="utf-8")
        for name, block in blocks.items():
            assert filled(text, name, block, str(page)) == text, name
