"""A text of a user is text in every output, never markup, a command or a control character."""

from __future__ import annotations

import csv
import html
import json
import re
import shutil
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from markdown_it import MarkdownIt

import genie_sim as gs
from genie_sim.analysis.renderers import ESCAPES
from genie_sim.cli.main import main
from genie_sim.record import provenance
from tests.checkout import REPOSITORY, copied, sign

LABEL = r"[a](b) $\frac$ *c _d_ `e` <img src=f>&lt;|~~g~~ \% #1 {h}"
CONTROL = "\u202e\n\x1b[31m"
SETTINGS = {
    "cars[0].route.window": ["0 s", "1 s"],
    "methods": ["local", {"name": "m", "method": "genie", "title": f"=-{LABEL}"}],
}
TABLES = ("markdown", "csv", "latex")


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of a run, of seeds and of a sweep, with a text that is meant ill."""
    out = tmp_path_factory.mktemp("lab")
    of_all: dict[str, Any] = {"label": LABEL, "out": out}
    run = gs.run("street_1car_homo", SETTINGS, report=False, **of_all)
    run.folder.rename(out / "run")
    add_controls(shutil.copytree(out / "run", out / "of somebody") / "run.json")
    few: dict[str, Any] = {"seeds": 2, "jobs": 1, "report": False}
    seeds = gs.run_seeds("street_1car_homo", SETTINGS, **few, **of_all)
    seeds.folder.rename(out / "seeds")
    axes = {"a": {"set": "cars[0].link", "list": ["wifi", "lte"]}}
    sweep = gs.sweep("street_1car_homo", axes, SETTINGS, seeds=[1], jobs=1, **of_all)
    assert len(sweep.metrics)
    next(out.glob("street_1car_homo-*")).rename(out / "sweep")
    add_controls(shutil.copytree(out / "sweep", out / "sweep of somebody") / "sweep.json")
    return out


def add_controls(path: Path) -> None:
    """What no setting may hold, in the title of a method, may stand in somebody's results."""
    escaped = json.dumps(CONTROL)[1:-1]
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace('"=-', f'"={escaped}-'), encoding="utf-8")
    assert escaped in path.read_text(encoding="utf-8")
    sign(path.parent)


def test_a_title_that_is_no_line_is_refused():
    for title in ("a\nb", "a\n", "\u202e", "a" * 61, " "):
        with pytest.raises(gs.UserError, match=r"methods\[0\]\.title: must "):
            gs.load_scenario(
                "1car_homo", {"methods": [{"name": "m", "method": "genie", "title": title}]}
            )


def texts(markdown: str) -> Iterator[str]:
    """Of each heading, paragraph and cell that is nothing but text, what a reader sees."""
    for block in MarkdownIt("commonmark").enable(["table", "strikethrough"]).parse(markdown):
        parts = block.children or []
        if parts and {part.type for part in parts} <= {"text", "text_special", "softbreak"}:
            yield "".join("\n" if part.type == "softbreak" else part.content for part in parts)


def check_markdown(text: str) -> None:
    assert any(LABEL in shown for shown in texts(text)), text


def check_latex(text: str) -> None:
    """Every character is there, and none is a command."""
    plain = {escape: chr(code) for code, escape in ESCAPES.items()}
    longest_first = sorted(plain, key=len, reverse=True)
    pattern = re.compile("|".join(map(re.escape, longest_first)))
    assert LABEL in pattern.sub(lambda found: plain[found[0]], text)


def check_page(text: str) -> None:
    assert text.count("<img") == text.count('<img src="data:image/svg+xml;base64,')
    assert html.escape(LABEL) in text


def check_svg(path: Path) -> None:
    titles = [one.text for one in ET.parse(path).iter() if one.tag.endswith("}title")]
    assert titles and all(title and title.isprintable() for title in titles)


def check_screen(capsys: pytest.CaptureFixture[str]) -> str:
    said = capsys.readouterr()
    assert (said.out + said.err).replace("\n", "").isprintable()
    return said.out


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["run", "of somebody", "seeds", "sweep", "sweep of somebody"])
def test_a_text_of_a_user_is_text_in_what_results_show(kind, lab, capsys):
    folder = Path(shutil.copytree(lab / kind, "result"))
    assert main(["report", str(folder)]) == 0
    check_page((folder / "report.html").read_text(encoding="utf-8"))
    if "sweep" not in kind:
        check_markdown((folder / "summary.md").read_text(encoding="utf-8"))
    assert main(["figures", str(folder)]) == 0
    for path in (folder / "figures").glob("*.svg"):
        check_svg(path)
    check_screen(capsys)
    for format in TABLES:
        assert main(["table", str(folder), "--format", format]) == 0
        check_table(format, check_screen(capsys))


def check_table(format: str, text: str) -> None:
    if format == "markdown":
        check_markdown(text)
    elif format == "latex":
        check_latex(text)
    else:
        assert not any(
            cell.startswith("=") for row in csv.reader(text.splitlines()) for cell in row
        )


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["of somebody", "seeds"])
def test_a_text_of_a_user_is_text_in_a_comparison(kind, lab, capsys):
    for format in TABLES:
        line = ["compare", str(lab / kind), "--format", format, "--label", LABEL]
        assert main(line) == 0
        check_table(format, check_screen(capsys))
    assert main([*line, "--out", "compared"]) == 0
    check_markdown(Path("compared/table.md").read_text(encoding="utf-8"))
    check_latex(Path("compared/table.tex").read_text(encoding="utf-8"))
    check_page(Path("compared/compare.html").read_text(encoding="utf-8"))
    for path in Path("compared/figures").glob("*.svg"):
        check_svg(path)


@pytest.mark.slow
def test_a_text_of_a_user_is_text_on_the_screen(lab, capsys):
    settings = [f"--set={name}={json.dumps(value)}" for name, value in SETTINGS.items()]
    assert main(["run", "street_1car_homo", *settings, "--label", LABEL]) == 0
    assert LABEL in check_screen(capsys)


@pytest.mark.slow
def test_a_text_of_somebody_s_evaluation_is_text(capsys):
    folder = copied(REPOSITORY / "results" / "paper", Path("paper"))
    rows = provenance.read_json(folder / "verdicts.json")
    provenance.write_json(
        folder / "verdicts.json", [row | {"why": CONTROL + LABEL} for row in rows]
    )
    sign(folder)
    for command in (["table"], ["table", "--format", "csv"], ["report"]):
        assert main([*command, str(folder)]) == 0
        check_screen(capsys)
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert page.count("<img") == page.count('<img src="data:image/svg+xml;base64,')
