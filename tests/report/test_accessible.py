"""Every page passes axe-core in a browser, light and dark: no finding that is serious or
critical.
"""

from __future__ import annotations

import json
from importlib import resources
from pathlib import Path

import pytest

import genie_sim as gs
from genie_sim.paper.reproduce import Reproduction
from tests.browser import Browser
from tests.checkout import copied, sign

PAPER = Path(__file__).resolve().parents[2] / "results" / "paper"
AXE = resources.files("axe_core_python").joinpath("axe.min.js")
CHECK = """(async (only) => {
  for (const one of document.querySelectorAll('details')) one.open = true;
  const rules = only ? { runOnly: only } : {};
  const { violations } = await axe.run(document, { resultTypes: ['violations'], ...rules });
  return violations.filter(({ impact }) => impact === 'serious' || impact === 'critical')
    .map(({ id, nodes }) => [id, nodes.map((node) => node.html.slice(0, 200)).slice(0, 5)]);
})"""


@pytest.fixture(scope="module")
def run() -> gs.Run:
    windows = {f"cars[{place}].route.window": ["0 s", "1 s"] for place in range(2)}
    return gs.run("street_2car_homo", windows)


def page_of(what: str, run: gs.Run, folder: Path) -> Path:
    """Writes one of the kinds of pages."""
    if what == "run":
        return run.report(folder / "report.html")
    if what == "fleet":
        return gs.run("fleet_30", {"fleet.cars": 3, "perception.duration": "2 s"}).report(
            folder / "report.html"
        )
    if what == "seeds":
        short = {"cars[0].route.window": ["0 s", "1 s"]}
        seeds = gs.run_seeds("street_1car_homo", short, seeds=2, jobs=1, out=folder)
        return Path(str(seeds.folder)) / "report.html"
    if what == "comparison":
        return gs.compare(run).report(folder)
    few = copied(PAPER, folder / "evaluation")
    rows = json.loads((few / "verdicts.json").read_text())
    (few / "verdicts.json").write_text(
        json.dumps([row for row in rows if row["id"] in ("C1", "C2", "C21")])
    )
    sign(few)
    text = Reproduction.read(few).page()
    (folder / "report.html").write_text(text, encoding="utf-8")
    return folder / "report.html"


@pytest.mark.parametrize("what", ["run", "seeds", "fleet", "comparison", "evaluation"])
def test_a_page_has_no_serious_finding(browser: Browser, run: gs.Run, tmp_path: Path, what: str):
    page = page_of(what, run, tmp_path)
    # in the dark, only colours are others
    for dark, rules in ((False, None), (True, ["color-contrast"])):
        browser.size(1200, 900, dark=dark)
        browser.open(page)
        assert browser.errors == []
        browser.evaluate(AXE.read_text(encoding="utf-8") + "; 0")
        found = browser.evaluate(f"{CHECK}({json.dumps(rules)})")
        assert not found, json.dumps(found, indent=1)
