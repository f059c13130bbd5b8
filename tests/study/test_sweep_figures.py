"""Figures of sweeps of made-up numbers look as they did, and show what they say."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from genie_sim.scenario.yaml_input import dump
from genie_sim.study.design import Design, load_design
from genie_sim.study.figures import SweepFigures
from tests import outline
from tests.drawn_text import faults

TITLES = {"remote": "remote (R)", "genie": "Genie (DG)"}
UNITS = {
    "first_answer_mean": "ms",
    "fresh_answer_mean": "ms",
    "fresh_answered_share": "1",
    "image_reuse": "1",
    "streaming_f1": "1",
}


def design(axes: dict[str, object]) -> Design:
    Path("s.yaml").write_text(
        dump(
            {
                "scenario": "street_1car_homo",
                "set": {"methods": ["genie"]},
                "seeds": 3,
                "axes": axes,
            }
        )
    )
    return load_design(Path("s.yaml"))


def runs(columns: dict[str, list[object]], seeds: int = 3) -> pd.DataFrame:
    """Every combination of the axes' values, with numbers that grow along them."""
    rng, rows = np.random.default_rng(4), []
    grid = pd.MultiIndex.from_product(columns.values(), names=list(columns)).to_frame(index=False)
    for point, levels in enumerate(grid.to_dict("records")):
        for seed in range(1, seeds + 1):
            for place, method in enumerate(TITLES):
                for number, (metric, unit) in enumerate(UNITS.items()):
                    placements = ("car", "edge") if metric == "image_reuse" else ("all",)
                    for placement in placements:
                        size = (1 + point + place) * (20 if unit == "ms" else 0.04)
                        value = size * (1 + 0.1 * number) + 0.01 * size * rng.random()
                        row = {
                            "method": method,
                            "metric": metric,
                            "placement": placement,
                            "component": "",
                            "value": value if unit == "ms" else min(value, 0.97),
                            "unit": unit,
                        }
                        rows.append({"point": point, "seed": seed, **levels, **row})
    return pd.DataFrame(rows).assign(low=np.nan, high=np.nan, n=100)


RATE = {"set": "genie.object_map.rate", "list": [0.1, 0.2, 0.5]}
GATE = {"set": "genie.object_map.gate", "grid": {"from": "1 m", "to": "64 m", "points": 3}}
LOGARITHMIC = {"from": 0.01, "to": 1, "points": 4, "scale": "log"}
RULE = {"set": "genie.object_map.rule", "list": ["ema", "noisy_or"]}


def test_one_axis_of_each_kind():
    wide = {
        "set": "genie.object_map.gate",
        "grid": {"from": "1 m", "to": "4000 m", "points": 4, "scale": "log"},
    }
    axes = {"numbers": RATE, "texts": RULE, "decades": wide}
    levels: dict[str, list[object]] = {
        "numbers": [0.1, 0.2, 0.5],
        "texts": ["ema", "noisy_or"],
        "decades [m]": [1.0, 16.0, 250.0, 4000.0],
    }
    drawn = {}
    for (name, axis), (column, values) in zip(axes.items(), levels.items(), strict=True):
        table = runs({column: values})
        drawn[name] = SweepFigures(design({name: axis}), table, TITLES, "made up").along(name)
    outline.check("sweep along one axis", drawn)


@pytest.mark.slow
def test_two_axes():
    crossed = design({"rate": RATE, "gate": GATE})
    table = runs({"rate": [0.1, 0.2, 0.5], "gate [m]": [1.0, 32.5, 64.0]})
    outline.check(
        "sweep of two axes", dict(SweepFigures(crossed, table, TITLES, "made up").drawn())
    )


def test_a_drawn_axis_is_averaged_and_one_seed_has_no_intervals():
    random = {"set": "genie.view_range", "latin_hypercube": {"from": "10 m", "to": "90 m"}}
    Path("s.yaml").write_text(
        dump({"scenario": "street_1car_homo", "samples": 6, "axes": {"rule": RULE, "view": random}})
    )
    table = runs({"rule": ["ema", "noisy_or"], "view [m]": [12.0, 45.0, 88.0]}, seeds=1)
    drawn = dict(SweepFigures(load_design(Path("s.yaml")), table, TITLES, "made up").drawn())
    assert {name.partition("-")[0] for name in drawn} == {"rule", "view"}
    for name, figure in drawn.items():
        assert ("averaged over" in str(figure.get_suptitle())) == (name == "rule"), name
    outline.check("sweep with samples", drawn)


@pytest.mark.slow
@pytest.mark.parametrize("width_in", [7.16, 3.33])
@pytest.mark.parametrize("many", [False, True], ids=["few values", "many values"])
def test_nothing_is_clipped_or_overlaps_at_any_width(width_in: float, many: bool):
    rates, decades = [0.1, 0.2, 0.5], {"list": [0.1, 0.2, 0.5]}
    if many:  # 0.01, 0.04642, 0.2154, 1
        rates, decades = np.geomspace(0.01, 1, 4), {"grid": LOGARITHMIC}
    names = ["noisy_or", "exponential", "a very long name of a value", "max"][: 4 if many else 2]
    crossed = design({"rate": {"set": RATE["set"], **decades}, "rule": RULE})
    table = runs({"rate": list(rates), "rule": list(names)})
    figures = SweepFigures(crossed, table, TITLES, "made up", width_in)
    drawn = {**dict(figures.drawn()), "one": figures.of("streaming_f1")}
    for name, figure in drawn.items():
        assert faults(figure) == [], name
        assert figure.get_figwidth() == width_in


def test_many_methods_leave_room_for_their_panels_in_a_column(monkeypatch):
    for name in ("sim_lru", "rnd_lru", "potluck", "foggycache", "cachier", "central", "oracle"):
        monkeypatch.setitem(TITLES, name, f"method {name}")
    names = ["a_long_name", "exponential", "max"]
    one_axis = design({"rule": RULE | {"list": names}})
    table = runs({"rule": list(names)})
    drawn = dict(SweepFigures(one_axis, table, TITLES, "made up", 3.5).drawn())
    assert [faults(figure) for figure in drawn.values()] == [[]]


def test_a_metric_without_a_value_in_one_run_is_drawn_all_the_same():
    table = runs({"rate": [0.1, 0.2, 0.5]})
    table.loc[table["point"] == 1, "value"] = np.nan
    figures = SweepFigures(design({"rate": RATE}), table, TITLES, "made up")
    assert figures.of("image_reuse").axes


def test_each_value_of_the_second_axis_is_a_line():
    crossed = design({"rate": RATE, "rule": RULE})
    table = runs({"rate": [0.1, 0.2, 0.5], "rule": ["ema", "noisy_or"]})
    figure = SweepFigures(crossed, table, TITLES, "made up", width_in=3.5).of("image_reuse")
    assert [panel.get_title().partition(") ")[2] for panel in figure.axes] == [
        f"{title}, {where}" for title in TITLES.values() for where in ("on cars", "on edges")
    ]
    cars = table.query("metric == 'image_reuse' and placement == 'car' and method == 'remote'")
    for line, rule in zip(figure.axes[0].containers, ("ema", "noisy_or"), strict=True):
        assert line.get_label() == f"rule = {rule}"
        expected = cars[cars["rule"] == rule].groupby("rate")["value"].mean()
        assert line[0].get_ydata() == pytest.approx(expected.tolist())
