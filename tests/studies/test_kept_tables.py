"""What the studies keep and choose, on tables made up here."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from studies import keep, where_it_pays


def csv(path: Path, header: str, *rows: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")


def test_the_usual_setting_stays_unless_another_is_clearly_better(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    """A drive's conditions are averaged first. The remote tracker is .01 better at 0.5 and 0 ms,
    the others .001 better there, which is within .002.
    """
    monkeypatch.setattr(where_it_pays, "KEPT", tmp_path)

    def simulated(step: str, conditions: Any, methods: Any, seeds: Any) -> pd.DataFrame:
        rows = []
        for condition in ("0003, slow", "0003, fast", "town, 5G"):
            for entry in methods:
                gain = 0.01 if entry["name"].startswith("remote") else 0.001
                f1 = 0.5 + gain * entry["name"].endswith("-0.5-0")
                # a setting that wins in two conditions of one drive alone wins nothing
                f1 += 0.015 * (entry["name"].endswith("-0.6-0") and condition.startswith("0003"))
                f1 -= 0.03 * (entry["name"].endswith("-0.6-0") and condition.startswith("town"))
                rows.append((condition, 1, entry["name"], f1))
        table = pd.DataFrame(rows, columns=["condition", "seed", "method", "streaming_f1"])
        return table.set_index(["condition", "seed", "method"])

    monkeypatch.setattr(where_it_pays, "simulated", simulated)
    found = {entry["name"]: entry for entry in where_it_pays.chosen("step", {}, (1,), "_x")}
    remote, local = (found[f"{name}_tracker_x"]["consumer"] for name in ("remote", "local"))
    assert (remote["p_min"], remote["tau"]) == (0.5, "0 ms")
    assert (local["p_min"], local["tau"]) == (0.8, "0 ms")
    assert len(pd.read_csv(tmp_path / "step.csv")) == 40


def test_a_sweep_keeps_the_metrics_of_its_page(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    monkeypatch.chdir(tmp_path)
    header = "point,serving,metric,method,placement,component,unit,value,low,high,runs"
    csv(
        Path("results/studies/batching/table.csv"),
        header,
        "0,in fours,streaming_f1,remote,all,,1,0.5,0.4,0.6,5",
        "0,in fours,look_age_mean,remote,all,,ms,1,1,1,5",
    )
    keep.keep("batching")
    kept = pd.read_csv("results/batching/points.csv")
    assert kept["metric"].tolist() == ["streaming_f1"] and "point" not in kept
