"""What the guides to extensions promise: one file of at most 60 lines makes a method that is
everywhere, and the path of a frame leads through functions that exist.
"""

from __future__ import annotations

import ast
import json
import re
from pathlib import Path

import pandas as pd
import pytest

from tests.conformance import small
from tests.run_page import blocks

REPOSITORY = Path(__file__).resolve().parents[2]
DOCS = REPOSITORY / "docs"
LONGEST_METHOD_LINES = 60


def files_of(page: str) -> dict[str, str]:
    return {
        one.title: one.text
        for one in blocks((DOCS / page).read_text(encoding="utf-8"))
        if one.title is not None
    }


@pytest.fixture
def skip(tmp_path: Path) -> Path:
    """The folder with the files of the guide."""
    files = files_of("extend/method.md")
    assert len(files["skip.py"].splitlines()) <= LONGEST_METHOD_LINES
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    return tmp_path


@pytest.mark.slow
def test_the_method_of_the_guide_is_in_everything_that_a_run_makes(skip: Path, run_cli):
    window = "cars[0].route.window=[0 s, 3 s]"
    chosen = ("--methods", "local,genie,skip:Skip", "--set", window)
    ran = run_cli("run", "street_1car_hetero", *chosen, "--figures")
    assert ran.returncode == 0, ran.stderr
    first, table = ran.stdout.splitlines()[0], ran.stdout
    assert first == "street_1car_hetero runs code of its own: method skip:Skip"
    headings = table.split("first answer")[0]  # on one line or two, as they fit
    for word in ("local", "Genie", "(DG)", "skip", "frames", "zero-delay"):
        assert word in headings.split(), table
    (folder,) = (skip / "results").iterdir()
    summary = (folder / "summary.md").read_text()
    assert "first answer, mean" in summary
    for name in ("frames", "lookups", "resources"):
        rows = pd.read_parquet(folder / f"{name}.parquet")
        assert "Skip" in set(rows["method"]), name
    metrics = pd.DataFrame(json.loads((folder / "metrics.json").read_text()))
    found = metrics[metrics["method"] == "Skip"].set_index("metric")["value"]
    assert found["answered_share"] > 0.5 and found["image_reuse"] > 0.5
    assert set(metrics[metrics["metric"] == "improvement_first_answer"]["component"]) == {"local"}
    assert re.search(r"Skip|skip frames", (folder / "summary.md").read_text())
    assert re.search(r"Skip|skip frames", (folder / "report.html").read_text())
    for name in ("latency_cdf", "image_reuse"):
        assert re.search(r"Skip|skip frames", (folder / "figures" / f"{name}.svg").read_text()), (
            name
        )


def test_a_variant_of_genie_stores_less_on_the_car(skip: Path, monkeypatch):
    monkeypatch.syspath_prepend(skip)
    lookups = small.tables(small.scenario(["genie", "own:OwnGenie"]))["lookups"]
    on_cars = lookups[lookups["genie"].str.startswith("car")]
    entries = on_cars.groupby("method")["entries"].max()
    assert 0 < entries["OwnGenie"] < entries["genie"]


def test_the_way_of_a_frame_leads_through_functions_that_exist():
    page = (DOCS / "explanation" / "path-of-a-frame.md").read_text(encoding="utf-8")
    hops = re.findall(r"^\| (\d) \|.*\|(.*)\|$", page, re.MULTILINE)
    assert [int(number) for number, _ in hops] == list(range(1, len(hops) + 1)) and 1 < len(
        hops
    ) <= 9
    named = [
        one
        for _, where in hops
        for one in re.findall(r"`(genie_sim/[\w/.]+)`: ((?:`[\w.]+`(?:, )?)+)", where)
    ]
    named += re.findall(r"`(genie_sim/[\w/.]+)`\s\((`\w+`)\)", page)
    assert len(named) >= len(hops) + 3
    for file, functions in named:
        known = _defined(REPOSITORY / file)
        for function in re.findall(r"`([\w.]+)`", functions):
            assert function in known, f"{file}: no {function}"


def _defined(path: Path) -> set[str]:
    """``function`` and ``Class.method`` of a file."""
    found = set()
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.ClassDef | ast.FunctionDef):
            found.add(node.name)
        if isinstance(node, ast.ClassDef):
            found |= {
                f"{node.name}.{inner.name}"
                for inner in node.body
                if isinstance(inner, ast.FunctionDef)
            }
    return found


def test_every_page_on_extensions_is_in_the_navigation():
    navigation = (REPOSITORY / "mkdocs.yml").read_text(encoding="utf-8")
    pages = sorted(page.name for page in (DOCS / "extend").glob("*.md"))
    assert len(pages) > 5 and all(f"extend/{page}" in navigation for page in pages)
