"""The report of an evaluation: every claim with its evidence, offline, safe, the same bytes each
time.
"""

from __future__ import annotations

import json
from html import escape
from pathlib import Path

import pytest

from genie_sim.cli.main import main
from genie_sim.paper import claims, printed
from genie_sim.paper.reproduce import FILES, Reproduction
from genie_sim.record import provenance
from tests.checkout import copied, sign
from tests.report.pages import EVIL, MEGABYTE, asked_for, middle, picture

PAPER = Path(__file__).resolve().parents[2] / "results" / "paper"
ROWS = printed.read_rows(PAPER)
SHOWN = "[...document.querySelectorAll('tbody tr[id^=C]:not([hidden])')].map(row => row.id)"


@pytest.fixture(scope="module")
def page() -> str:
    return Reproduction.read(PAPER).page()


@pytest.fixture
def folder() -> Path:
    """A copy of the same evaluation, to be changed."""
    return copied(PAPER, Path("evaluation"), "report.html")


def signed(folder: Path) -> Path:
    """The same folder with the digests of its files as they are now."""
    digests = provenance.digests(folder, FILES)
    rewritten(folder / "run.json", lambda about: about.update(digests=digests))
    return folder


def rewritten(path: Path, change) -> None:
    data = json.loads(path.read_text())
    change(data)
    path.write_text(json.dumps(data))


# What the page holds


def test_every_claim_is_there_with_what_was_found_and_judged(page):
    assert "Full evaluation: seeds 1 to 10." in page
    assert "paper, seeds 1 to 10, " in repr(Reproduction.read(PAPER))
    for row in ROWS:
        shown = page.partition(f'<tr id="{row["id"]}">')[2].partition("</tr>")[0]
        texts = [row[name] for name in ("claim", "kind", "paper", "test", "command")]
        for text in (*texts, printed.number(row), printed.verdict(row), printed.reason(row)):
            assert escape(text) in shown, (row["id"], text)
    assert all(escape(text) in page for text in (claims.total(ROWS), *claims.sentences(ROWS)))
    assert page.count("<img") == 5


@pytest.mark.slow
def test_the_page_is_small_and_independent_of_time_and_machine(page, folder):
    assert len(page.encode()) < 8 * MEGABYTE
    rewritten(folder / "run.json", lambda about: about.update(platform="moon", python="4"))
    assert Reproduction.read(folder).page() == page


# The command


@pytest.mark.slow
def test_report_writes_the_page_of_an_evaluation(folder, page, capsys):
    assert main(["report", str(folder)]) == 0
    assert (folder / "report.html").read_text(encoding="utf-8") == page
    assert "Report: evaluation/report.html" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda folder: (folder / "numbers.parquet").unlink(), "numbers.parquet: no such file"),
        (lambda folder: (folder / "run.json").write_text("{"), "run.json: cannot be read"),
        (
            lambda folder: [(folder / "verdicts.json").write_text('[{"id": "C1"}]'), sign(folder)],
            "not written by this version",
        ),
    ],
    ids=["incomplete", "broken", "other"],
)
def test_a_folder_that_is_not_whole_gets_one_line(folder, spoil, message, capsys):
    spoil(folder)
    assert main(["report", str(folder)]) == 1
    said = capsys.readouterr().err
    assert message in said
    assert said.count("\n") == 1
    assert not (folder / "report.html").exists()


def test_an_evaluation_has_no_replay_to_start(folder):
    assert main(["report", str(folder), "--start", "2 s"]) == 1


# In a browser


@pytest.fixture
def file(page: str) -> Path:
    path = Path("report.html")
    path.write_text(page, encoding="utf-8")
    return path.absolute()


@pytest.mark.parametrize(
    ("width", "dark"), [(1200, False), (1200, True), (360, False)], ids=["wide", "dark", "narrow"]
)
def test_the_page_draws_itself_in_any_window(browser, file, width, dark):
    browser.size(width, 900, dark=dark)
    browser.open(file)
    assert browser.errors == []
    assert asked_for(browser) == [file.as_uri()]
    shown = picture(browser.screenshot())
    assert shown.std() > 10
    assert (shown.mean() < 80) == dark
    assert browser.evaluate("document.documentElement.scrollWidth") == width
    decoded = (
        "Promise.all([...document.images].map(one => one.decode().then(() => one.naturalWidth)))"
    )
    assert min(browser.evaluate(decoded)) > 100
    words = browser.evaluate("document.body.innerText")
    assert not any(word in words for word in ("NaN", "undefined", "Infinity", "[object"))


def test_claims_are_filtered_by_words_of_claim_verdict_kind_and_test(browser, file):
    browser.open(file)
    assert browser.evaluate(SHOWN) == [row["id"] for row in ROWS]
    field = "document.querySelector('input[type=search]')"
    for words, is_shown in (
        ("OBJECT reuse", lambda row: "object reuse" in row["claim"].lower()),
        ("outcome:", lambda row: row["kind"] == "outcome"),
    ):
        browser.evaluate(f"{field}.value = {json.dumps(words)}")
        browser.evaluate(f"{field}.dispatchEvent(new Event('input'))")
        found = browser.evaluate(SHOWN)
        assert (
            {row["id"] for row in ROWS if is_shown(row)} <= set(found) < {row["id"] for row in ROWS}
        )
        assert browser.evaluate("document.querySelector('output').value") == (
            f"{len(found)} of {len(ROWS)}"
        )


def test_a_click_on_a_claim_opens_its_test_and_command(browser, file):
    browser.open(file)
    browser.evaluate("document.querySelector('#C14 summary').id = 'opener'")
    assert browser.evaluate("document.querySelector('#C14 details').open") is False
    browser.click(*middle(browser, "opener"))
    row = next(row for row in ROWS if row["id"] == "C14")
    assert browser.evaluate("document.querySelector('#C14 details').open") is True
    told = browser.evaluate("document.querySelector('#C14 dl').innerText")
    assert row["test"] in told and row["command"] in told


def test_markup_in_results_is_shown_as_text(browser, folder):
    rewritten(folder / "verdicts.json", lambda rows: rows[0].update(claim=EVIL, note=EVIL))
    Path("report.html").write_text(Reproduction.read(signed(folder)).page(), encoding="utf-8")
    assert Path("report.html").read_text(encoding="utf-8").count("<script") == 2
    browser.open(Path("report.html"))
    assert browser.evaluate("document.querySelector('#C1').cells[1].textContent").startswith(EVIL)
    assert browser.evaluate("typeof window.hacked") == "undefined"
    assert browser.errors == []
    assert asked_for(browser) == [Path("report.html").absolute().as_uri()]
