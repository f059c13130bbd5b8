"""The page and the figures of a search: what they say, and that a browser draws them."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest

from genie_sim.cli import main
from genie_sim.scenario.yaml_input import dump
from genie_sim.tuning import page
from tests.browser import Browser
from tests.report.test_report import embedded
from tests.tuning.test_search_of_scenarios import SHORT, SPACE

EVIL = "</script><script>document.title = 'evil'</script>"
TWO = {
    **SHORT,
    "description": EVIL,
    "methods": {
        "remote": SPACE,
        "genie": {
            "method": "genie",
            "set": {"genie.algorithm": "recommended"},
            "space": {
                "every": {"set": "genie.looks.every", "range": {"from": "30 ms", "to": "400 ms"}},
                "own": {"set": "genie.looks.own", "list": ["all", "rest"]},
            },
        },
    },
    "objectives": {"maximize": "streaming_f1", "minimize": ["first_answer_p95", "ghost_share"]},
    "subject_to": "ghost_share <= 90 %",
    "points": 10,
    "batch": 10,
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished search of two methods."""
    out = tmp_path_factory.mktemp("search")
    (out / "two.yaml").write_text(dump(TWO))
    assert main(["search", str(out / "two.yaml"), "--out", str(out), "--jobs", "1"]) == 0
    return out / "two"


def test_the_page_shows_held_out_numbers(folder: Path):
    data = embedded(page.page(folder))
    designs = pd.read_csv(folder / "designs.csv").set_index("design")
    assert [one["name"] for one in data["designs"]] == designs.index.tolist()
    for one in data["designs"]:
        value, low, high = one["values"]["streaming_f1"]
        row = designs.loc[one["name"]]
        assert value == pytest.approx(row["streaming_f1"], rel=1e-4)
        assert low == pytest.approx(row["streaming_f1 low"], rel=1e-4) and low <= value <= high
    assert data["parameters"] == ["queue", "consumer", "every [ms]", "own"]
    assert data["about"]["seeds"] == {"tuning": [1, 2], "held_out": [3, 4]}
    assert {row["method"] for row in data["importance"]} == {"remote", "genie"}
    assert any("There is one drive" in note for note in data["notes"])


def test_as_many_paired_differences_as_a_page_holds_are_in_it(
    folder: Path, monkeypatch: pytest.MonkeyPatch
):
    known = len(pd.read_csv(folder / "differences.csv"))
    for room, is_told in ((known, False), (known - 1, True)):
        monkeypatch.setattr(page, "MAX_DIFFERENCES", room)
        data = embedded(page.page(folder))
        told = any("Paired differences are in differences.csv" in note for note in data["notes"])
        assert told is is_told and bool(data["differences"]) is not is_told


def test_the_page_is_made_again_from_the_folder_and_refuses_changed_tables(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    assert main(["report", str(folder), "--out", "again.html"]) == 0
    assert Path("again.html").read_bytes() == (folder / "report.html").read_bytes()
    copy = tmp_path / "copy"
    copy.mkdir()
    for name in ("search.json", "importance.parquet", "differences.parquet"):
        (copy / name).write_bytes((folder / name).read_bytes())
    assert main(["report", str(copy)]) == 1
    (copy / "designs.parquet").write_bytes((folder / "importance.parquet").read_bytes())
    assert main(["report", str(copy)]) == 1
    missing, changed = capsys.readouterr().err.splitlines()
    assert "designs.parquet" in missing
    assert "changed since the results were written: designs.parquet" in changed


def test_figures_of_the_front_and_of_each_method(folder: Path):
    names = {path.stem for path in (folder / "figures").glob("*.svg")}
    assert names == {
        "front",
        *(f"{kind}-{method}" for kind in ("parallel", "importance") for method in TWO["methods"]),
    }
    front = (folder / "figures" / "front.svg").read_text()
    assert "Genie (DG), as it is" in front and "first answer, p95 [ms]" in front


def test_the_page_in_a_browser(folder: Path, browser: Browser):
    browser.open(folder / "report.html")
    assert browser.errors == [] and len(browser.requests) == 1, "the page itself"
    assert browser.evaluate("document.title") == "two, a search"
    rows = len(pd.read_csv(folder / "designs.csv"))
    assert browser.evaluate("document.querySelectorAll('#table tbody tr').length") == rows
    assert browser.evaluate("document.querySelectorAll('#scatter svg g').length") >= 5
    assert browser.evaluate("document.querySelectorAll('#lines path').length") > 0
    assert browser.evaluate("document.querySelectorAll('#picks li').length") == 3
    browser.evaluate(
        "(() => { const one = document.getElementById('against'); one.value = '1';"
        " one.dispatchEvent(new Event('change')); })()"
    )
    assert "against false objects" in browser.evaluate(
        "document.querySelector('#scatter h3').textContent"
    )
    assert browser.errors == []


def test_on_a_narrow_screen_lines_scroll_and_a_method_has_one_colour(
    folder: Path, browser: Browser
):
    browser.size(420, 900)
    browser.open(folder / "report.html")
    drawn, needed = browser.evaluate(
        "(() => { const svg = document.querySelector('#lines svg');"
        " return [svg.getBoundingClientRect().width, svg.viewBox.baseVal.width]; })()"
    )
    assert drawn == pytest.approx(needed), "text keeps its size"
    assert browser.evaluate("document.documentElement.scrollWidth") <= 420
    colours = browser.evaluate(
        "Object.fromEntries([...document.querySelectorAll('#scatter .keys button')].map(key => {"
        " const look = getComputedStyle(key.querySelector('svg'));"
        " return [key.textContent.trim(), look.getPropertyValue('--c')]; }))"
    )
    assert colours["remote (R)"] == colours["remote (R), as it is"] != colours["Genie (DG)"]
