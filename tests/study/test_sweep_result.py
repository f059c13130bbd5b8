"""A sweep for a paper: which sweep it is, and titles that tell methods apart."""

from __future__ import annotations

import csv
import io
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from genie_sim.scenario.yaml_input import dump
from genie_sim.study import sweep
from genie_sim.study.design import load_design


def design(seeds: int | list[int]) -> Any:
    axes = {"rate": {"set": "genie.object_map.rate", "list": [0.1, 0.5]}}
    Path("s.yaml").write_text(dump({"scenario": "street_1car_homo", "seeds": seeds, "axes": axes}))
    return load_design(Path("s.yaml"))


def test_the_footer_names_the_sweep_its_points_and_its_seeds():
    assert sweep.footer_of(design(3)) == "sweep s of street_1car_homo, 2 points, seeds 1, 2, 3"
    assert sweep.footer_of(design([4, 9]), "mine") == (
        "mine, sweep s of street_1car_homo, 2 points, seeds 4, 9"
    )
    assert sweep.footer_of(design(5)).endswith("seeds 1, 2, 3, 4, 5")
    assert sweep.footer_of(design(6)).endswith("2 points, 6 seeds")


def test_methods_with_one_title_go_by_their_names():
    titles = {"a": "Genie (DG)", "b": "Genie (DG)", "c": "local (L)"}
    assert sweep.unique_titles(titles) == {"a": "a", "b": "b", "c": "local (L)"}


@pytest.fixture
def swept() -> sweep.Sweep:
    """A finished sweep of two axes with 26 points of two methods."""
    rows = [
        {
            "point": point,
            "rate": 0.1 * point,
            "rule": f"rule{point}",
            "metric": metric,
            "method": method,
            "placement": placement,
            "component": "",
            "value": None if (method, metric) == ("local", "fresh_answered_share") else 0.5 + point,
            "low": 0.4 + point,
            "high": 0.6 + point,
        }
        for point in range(26)
        for method in ("local", "genie")
        for metric in ("fresh_answered_share", "first_answer_mean", "energy_per_frame")
        for placement in (("all", "car") if metric == "energy_per_frame" else ("all",))
    ]
    about = {"titles": {"genie": "Genie (DG)", "local": "local (L)"}}
    points = pd.DataFrame(rows)
    return sweep.Sweep(design(2), about, points, points, None, label="my_sweep")


def test_a_cell_can_be_printed_and_says_that_it_has_no_tables(swept: sweep.Sweep):
    about = {**swept.about, "genie_sim": "1", "run_ids": []}
    cells = replace(swept, about=about, every_run=swept.means.assign(seed=1)).cells
    cell = next(iter(cells.values()))[1]
    assert "no tables" in repr(cell) and not hasattr(cell, "frames")


def test_the_table_has_a_row_for_each_point_and_method(swept: sweep.Sweep):
    lines = swept.text().splitlines()
    titles = "first answer, mean [ms] | frames with a fresh result [%]"
    assert lines[0] == f"| rate | rule | method | {titles} |"
    assert lines[1] == "|---|---|---|---:|---:|"
    assert lines[2] == "| 0 | rule0 | local (L) | 0.5 | - |"
    assert lines[5] == "| 0.1 | rule1 | Genie (DG) | 1.5 | 150 |"
    assert len(lines) == 2 + 52


def test_an_axis_that_changes_nothing_is_told(swept: sweep.Sweep):
    few = swept.means[swept.means["point"] < 2]
    points = [
        few.assign(rule=rule, point=few["point"] + 2 * number)
        for number, rule in enumerate(("lru", "lfu"))
    ]
    for format in ("markdown", "latex"):
        text = replace(swept, means=pd.concat(points)).text(format)
        assert "No number changes with rule." in text


def test_a_paper_has_intervals_and_the_first_rows_alone(swept: sweep.Sweep):
    text = swept.text("latex")
    assert "Means, in brackets their 95 % t intervals, over 2 seeds." in text.replace("\\%", "%")
    assert "The first 50 of 52 rows; all are in table.csv." in text
    assert "Sweep my\\_sweep of " in text and "main results along rate and rule" in text
    assert r"\label{tab:my-sweep}" in text
    assert "[0.4, 0.6]" in text and "[1.4, 1.6]" in text, "intervals stand below their values"
    assert "Genie (DG)" in text and text.count("rule24") == 1 and "rule25" not in text


def test_a_spreadsheet_has_every_number(swept: sweep.Sweep):
    text = swept.text("csv")
    assert text.startswith("point,rate,rule,metric,method,placement,component,seed,value,unit,low")
    rows = list(csv.DictReader(io.StringIO(text)))
    assert len(rows) == 26 * 2 * 4
    ends = [rows[-1][name] for name in ("value", "low", "high", "seed")]
    assert ends == ["25.5", "25.4", "25.6", ""]
    assert rows[0]["value"] == "", "what is not defined is an empty field"
