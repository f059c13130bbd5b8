"""The report of a sweep: its points in a table that sorts, and curves of any metric with their
intervals.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from genie_sim.cli.main import main
from genie_sim.study import figures
from genie_sim.study import page as sweep
from genie_sim.study.design import load_design
from tests.browser import Browser
from tests.report.pages import EVIL, MEGABYTE, embedded, picture
from tests.report.sweeps import swept

pytestmark = pytest.mark.slow

SMALL = """
description: DESCRIPTION
scenario: street_1car_homo
set: {methods: [local], "cars[0].route.window": [0 s, 1 s], record: []}
seeds: 1
axes:
  gate: {set: genie.object_map.gate, list: [1 m, 2 m]}
"""


# What the page holds


def test_sweep_writes_the_page_and_report_writes_it_again(crossed, capsys):
    made = (crossed / "report.html").read_bytes()
    assert len(made) < MEGABYTE
    assert main(["report", str(crossed), "--out", "again.html"]) == 0
    assert Path("again.html").read_bytes() == made
    assert "Report: again.html" in capsys.readouterr().out


def test_the_table_is_that_of_the_sweep(crossed):
    data = embedded(sweep.page(crossed))
    shown, titles = data["table"], [one["title"] for one in data["methods"]]
    assert titles == ["local (L)", "remote (R)", "Genie (DG)"]
    points = pd.read_parquet(crossed / "table.parquet")
    mine = points[(points["metric"] == "object_reuse") & (points["placement"] == "car")]
    assert shown["levels"] == [mine["rate"].tolist(), mine["rule"].tolist()]
    for column, name in zip(
        shown["values"]["object_reuse"][0], ("value", "low", "high"), strict=True
    ):
        assert column == pytest.approx(mine[name].tolist(), rel=1e-4)


def test_a_curve_averages_over_the_other_axis_or_keeps_its_levels_apart(crossed):
    rate, rule = embedded(sweep.page(crossed))["curves"]
    points = pd.read_parquet(crossed / "table.parquet")
    mine = points[(points["metric"] == "object_reuse") & (points["placement"] == "edge")]
    assert (rate["log"], rate["levels"], rule["levels"]) == (
        True,
        [0.01, 0.1, 1.0],
        ["noisy_or", "ema"],
    )
    lines = {line["level"]: line["values"]["object_reuse"][1][0] for line in rate["lines"]}
    assert lines[None] == pytest.approx(mine.groupby("rate")["value"].mean().tolist(), rel=1e-4)
    assert lines["ema"] == pytest.approx(mine[mine["rule"] == "ema"]["value"].tolist(), rel=1e-4)


def test_values_that_span_decades_are_on_a_logarithmic_axis(crossed):
    data = embedded(sweep.page(crossed))
    is_log = {one["name"]: one["log"] for one in data["metrics"]}
    points = pd.read_parquet(crossed / "table.parquet")
    values = points[points["metric"] == "first_answer_mean"]["value"]
    assert values.max() / values.min() > 20 and is_log["first_answer_mean"]
    assert not is_log["object_reuse"], "a share"


def test_axes_that_are_not_in_the_order_of_their_names_keep_their_settings(drawn, town):
    assert [(axis["column"], axis["of"]) for axis in embedded(sweep.page(town))["axes"]] == [
        ("size", ["fleet.cars"]),
        ("forget [ms]", ["genie.object_map.freshness.ttl"]),
        ("mix", ["fleet.devices"]),
    ]
    assert [curve["sampled"] for curve in embedded(sweep.page(town))["curves"]] == [
        False,
        True,
        False,
    ]
    gate, view = ["genie.object_map.gate"], ["genie.view_range"]
    assert [axis["of"] for axis in embedded(sweep.page(drawn))["axes"]] == [view, gate]


def test_one_seed_gives_no_intervals(drawn):
    assert embedded(sweep.page(drawn))["table"]["values"]["object_reuse"][0][1] == [None] * 5


def test_a_large_sweep_is_thinned_honestly(crossed, monkeypatch):
    monkeypatch.setattr(sweep, "MAX_NUMBERS", 3 * 4 * 19)
    shown = embedded(sweep.page(crossed))
    assert {one["name"] for one in shown["metrics"]} == set(sweep.PANELS)
    assert 1 <= len(shown["table"]["points"]) < 6
    assert any("main metrics only" in note for note in shown["notes"])
    assert any(" of 6 points" in note for note in shown["notes"])


def test_of_too_many_values_of_an_axis_some_are_drawn_from_end_to_end(drawn, monkeypatch):
    whole = {curve["column"]: curve["levels"] for curve in embedded(sweep.page(drawn))["curves"]}
    assert [len(levels) for levels in whole.values()] == [5, 5]
    monkeypatch.setattr(sweep, "MAX_LEVELS", 3)
    shown = embedded(sweep.page(drawn))
    for curve in shown["curves"]:
        assert curve["levels"] == whole[curve["column"]][::2]
    assert "Along gate [m], 3 of its 5 values are drawn, evenly chosen." in shown["notes"]


def test_an_unfinished_sweep_gets_one_line(crossed, capsys):
    Path("half").mkdir()
    Path("half/sweep.json").write_bytes((crossed / "sweep.json").read_bytes())
    assert main(["report", "half"]) == 1
    Path("half/sweep.json").write_text("{}")
    assert main(["report", "half"]) == 1
    unfinished, foreign = capsys.readouterr().err.splitlines()
    assert "runs.parquet: missing; the sweep is not finished" in unfinished
    assert "sweep.json: cannot be read" in foreign


def test_only_drawn_values_are_averaged_over_and_not_along_a_drawn_axis(drawn, crossed, town):
    assert "averaged over" not in (drawn / "figures" / "gate.svg").read_text()
    assert not any(
        "averaged over" in path.read_text() for path in (crossed / "figures").glob("*.svg")
    )
    assert "averaged over forget" in (town / "figures" / "size.svg").read_text()


def test_the_figures_of_a_sweep_in_a_town_show_its_ghosts(town):
    words = (town / "figures" / "forget-1.svg").read_text()
    assert "false objects" in words and "size = 3" in words
    assert "ghost_share" in {
        one["name"] for one in embedded(sweep.page(town))["metrics"] if one["main"]
    }


TITLES = {"local": "local (L)", "remote": "remote (R)", "genie": "Genie (DG)"}


def test_values_on_an_axis_can_be_read(town):
    """Round numbers on a logarithmic axis, long texts cut as in the page, and no marker at the edge
    of its panel.
    """
    axes = load_design(town.parent / "town.yaml").axes
    runs = pd.read_parquet(town / "runs.parquet")
    drawn = figures.along(axes["forget"], "forget [ms]", runs, titles=TITLES, footer="")
    assert [tick.get_text() for tick in drawn.axes[0].get_xticklabels()] == [
        "200",
        "500",
        "1000",
        "2000",
    ]
    assert drawn.get_label().split("\n")[0].endswith("one seed, so without intervals")
    assert {panel.get_xlabel() for panel in drawn.axes} == {"forget [ms], logarithmic"}
    assert any("fresh result" in panel.get_ylabel() for panel in drawn.axes), (
        "latencies are of those alone"
    )
    mixes = figures.along(axes["mix"], "mix", runs, titles=TITLES, footer="")
    assert [tick.get_text() for tick in mixes.axes[0].get_xticklabels()] == [
        "orin_nano",
        '{"jetson_tx2": …',
    ]
    for panel in (*drawn.axes, *mixes.axes):
        highest = np.nanmax(np.concatenate([line.get_ydata() for line in panel.get_lines()]))
        low, high = panel.get_ylim()
        assert low + 0.98 * (high - low) > highest


def test_a_sweep_has_a_table_and_figures_for_a_paper(crossed, tmp_path, capsys):
    capsys.readouterr()
    assert main(["table", str(crossed), "--format", "latex"]) == 0
    latex = capsys.readouterr().out
    points = pd.read_parquet(crossed / "table.parquet")
    mean = points[(points["metric"] == "first_answer_mean")].iloc[0]
    assert f"{mean['value']:.3g}" in latex and r"\caption{crossed: " in latex
    assert main(["table", str(crossed), "--format", "csv"]) == 0
    assert len(capsys.readouterr().out.splitlines()) == len(points) + 1
    assert main(["table", str(crossed), "--methods", "genie"]) == 0
    of_genie = capsys.readouterr().out
    assert TITLES["genie"] in of_genie and TITLES["local"] not in of_genie
    assert main(["table", str(crossed), "--methods", "geni"]) == 1
    assert "did you mean 'genie'?" in capsys.readouterr().err
    assert main(["figures", str(crossed), "--format", "pdf", "--out", str(tmp_path)]) == 0
    drawn = {path.stem for path in (crossed / "figures").glob("*.svg")}
    assert {path.stem for path in tmp_path.glob("*.pdf")} == drawn


# In a browser


def choose(browser: Browser, element: str, value: str) -> None:
    browser.evaluate(
        f"byId('{element}').value = '{value}'; byId('{element}').dispatchEvent(new Event('change'))"
    )


@pytest.mark.parametrize(
    ("width", "dark"), [(1200, False), (1200, True), (360, False)], ids=["wide", "dark", "narrow"]
)
@pytest.mark.parametrize("which", ["crossed", "drawn"])
def test_the_page_draws_itself_in_any_window(browser, request, which, width, dark):
    file = request.getfixturevalue(which) / "report.html"
    browser.size(width, 900, dark=dark)
    browser.open(file)
    assert browser.errors == []
    assert browser.requests == [file.as_uri()]
    shown = picture(browser.screenshot())
    assert shown.std() > 8
    assert (shown.mean() < 80) == dark
    assert browser.evaluate("document.documentElement.scrollWidth") == width
    assert (
        browser.evaluate("byId('curves').querySelectorAll('svg[tabindex] path.solid').length") >= 10
    )
    words = browser.evaluate("document.body.innerText")
    assert not any(word in words for word in ("NaN", "undefined", "Infinity", "[object"))


def test_the_metric_and_the_lines_are_chosen(browser, crossed):
    browser.open(crossed / "report.html")
    keys = (
        "[...byId('curves').querySelectorAll('.chart:first-child .keys button')].map(one =>"
        " one.textContent)"
    )
    assert browser.evaluate(keys) == ["on cars", "on edges"]
    choose(browser, "metric", "fresh_answer_mean")
    assert browser.evaluate(keys) == ["local (L)", "remote (R)", "Genie (DG)"]
    assert "fresh result, mean [ms] along rate" in browser.evaluate("byId('curves').textContent")
    choose(browser, "split", "rule")
    assert browser.evaluate(keys) == ["rule noisy_or", "rule ema"]
    assert browser.evaluate("byId('series').selectedOptions[0].text") == "Genie (DG)"
    assert browser.evaluate("byId('curves').children.length") == 1, (
        "along the rule itself nothing is left to tell apart"
    )


def test_an_interval_is_read_off(browser, crossed):
    browser.open(crossed / "report.html")
    browser.evaluate("byId('curves').querySelector('svg[tabindex]').focus()")
    browser.press("ArrowRight")
    told = browser.evaluate("byId('curves').querySelector('.tip').textContent")
    assert told.startswith("rate: 0.01\non cars: ")
    assert " to " in told


def test_the_table_sorts_by_a_click_on_a_head(browser, crossed):
    browser.open(crossed / "report.html")
    choose(browser, "columns", "object_reuse")
    points = pd.read_parquet(crossed / "table.parquet")
    mine = points[(points["metric"] == "object_reuse") & (points["placement"] == "car")]
    heads = browser.evaluate("[...byId('table').tHead.rows[0].cells].map(one => one.textContent)")
    assert heads == ["point", "rate", "rule", "object reuse, on cars", "object reuse, on edges"]
    values = dict(zip(mine["point"], mine["value"], strict=True))
    for direction in ("ascending", "descending"):
        browser.evaluate("byId('table').tHead.querySelectorAll('button')[3].click()")
        order = browser.evaluate(
            "[...byId('table').tBodies[0].rows].map(row => Number(row.cells[0].textContent))"
        )
        shown = [values[point] for point in order]
        assert shown == sorted(shown, reverse=direction == "descending")
        assert (
            browser.evaluate("byId('table').tHead.rows[0].cells[3].getAttribute('aria-sort')")
            == direction
        )
    browser.evaluate(
        "byId('filter').value = 'EMA 0.1'; byId('filter').dispatchEvent(new Event('input'))"
    )
    assert browser.evaluate("byId('table').tBodies[0].rows.length") == 1


def test_markup_in_a_description_is_shown_as_text(browser, tmp_path):
    import json

    folder = swept(SMALL.replace("DESCRIPTION", json.dumps(EVIL)), tmp_path, "evil")
    assert (folder / "report.html").read_text(encoding="utf-8").count("<script") == 2
    browser.open(folder / "report.html")
    assert browser.evaluate("typeof window.hacked") == "undefined"
    assert browser.evaluate("byId('description').textContent") == EVIL
    assert browser.errors == []
