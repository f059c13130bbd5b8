"""The report of an evaluation: every claim with its evidence, offline, safe, the same bytes each
time.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import genie_sim as gs
from genie_sim.cli.main import main
from genie_sim.paper import page as evaluation
from genie_sim.paper import verdict_table
from genie_sim.paper.readings import load_reading
from genie_sim.record import provenance
from genie_sim.report import html_page
from tests.browser import Browser
from tests.checkout import copied
from tests.report.pages import EVIL, MEGABYTE, embedded, middle, picture

PAPER = Path(__file__).resolve().parents[2] / "results" / "paper"
ROWS = [row for row in verdict_table.read_rows(PAPER) if row["reading"] == "street"]
SHOWN = "[...byId('claims').querySelectorAll('tr.claim')].map(row => row.id)"


def with_bench(folder: Path) -> Path:
    """The committed evaluation under one reading, and a made-up outcome of another: C14 is turned
    round, C11 is retrodicted, C16 holds in part, C25 is C23's number, and by the metrics of a run
    nothing holds.
    """
    by_run = dict.fromkeys(("value", "low", "high")) | {"verdict": "not reproduced"}
    legs = [{"name": "higher", "held": 3, "effects": 3}, {"name": "more", "held": 0, "effects": 2}]
    turned = {
        "C14": {"verdict": "reproduced", "marginal": True},
        "C11": {"kind": "retrodicted"},
        "C16": {"verdict": "in part", "legs": legs},
        "C25": {"same_as": "C23"},
    }
    bench = [
        row
        | {"reading": "bench", "by_run_metrics": by_run, "note": "made up"}
        | turned.get(row["id"], {})
        for row in ROWS
    ]
    (folder / "verdicts.json").write_text(json.dumps(ROWS + bench))
    shown = [
        one.as_json() | {"settings": []} for one in (load_reading("street"), load_reading("bench"))
    ]
    (folder / "readings.json").write_text(json.dumps(shown))
    return folder


@pytest.fixture(scope="module")
def page(tmp_path_factory) -> str:
    """Of the committed evaluation with a made-up reading beside it."""
    copy = copied(PAPER, tmp_path_factory.mktemp("page") / "evaluation")
    return evaluation.page(signed(with_bench(copy)))


@pytest.fixture
def folder() -> Path:
    """A copy of the same evaluation, to be changed."""
    copy = copied(PAPER, Path("evaluation"))
    return signed(with_bench(copy))


def signed(folder: Path) -> Path:
    """The same folder with the digests of its files as they are now."""
    digests = provenance.digests(folder, evaluation.files_of(folder))
    rewritten(folder / "run.json", lambda about: about.update(digests=digests))
    return folder


def rewritten(path: Path, change) -> None:
    data = json.loads(path.read_text())
    change(data)
    path.write_text(json.dumps(data))


# What the page holds


def test_every_claim_is_there_with_what_was_expected_found_and_judged(page):
    shown = embedded(page)["claims"]
    for name in ("id", "claim", "kind", "expect", "test"):
        assert [one[name] for one in shown] == [row[name] for row in ROWS]
    for name in ("verdict", "marginal", "note"):
        assert [one["found"]["street"][name] for one in shown] == [row[name] for row in ROWS]
    found = [[row[name] for name in ("value", "low", "high")] for row in ROWS]
    assert [one["found"]["street"]["found"] for one in shown] == found
    other = {one["id"]: one["found"]["bench"] for one in shown}
    assert (other["C14"]["verdict"], other["C11"]["kind"]) == ("reproduced", "retrodicted")


def test_a_bound_has_its_sign_and_is_that_of_the_verdict(page):
    """A number is reproduced just where its whole interval holds; of several effects the mean is
    above zero, too.
    """
    shown = {
        one["id"]: one["bound"]
        for one in embedded(page)["claims"]
        if not one["tolerance"] and one["kind"] != "table"
    }
    assert {sign for sign, _ in shown.values()} == {"\u2265", "\u2264", ">"}
    for row in ROWS:
        sign, bound = shown.get(row["id"], ("", 0.0))
        holds = row["verdict"] == "reproduced"
        if sign == ">":
            assert row["low"] > bound or not holds, row["id"]
        elif sign:
            assert holds == (row["low"] >= bound if sign == "\u2265" else row["high"] <= bound), (
                row["id"]
            )


def test_a_bound_is_written_with_its_sign(browser, file):
    browser.open(file)
    told = browser.evaluate("['C14', 'C1'].map((one) => byId(one).cells[3].textContent)")
    assert told == ["1 > 2 > 3 cars", "82 %"], "the paper's value"
    for claim, expected in (
        ("C5", "\u2264 1.1"),
        ("C3", "\u2265 0.99"),
        ("C4", "each effect above 1 % of the value"),
        ("C1", "0.82 \u00b1 0.05"),
    ):
        browser.evaluate(f"byId('{claim}').querySelector('button').click()")
        told = browser.evaluate(f"byId('{claim}').nextElementSibling.textContent")
        assert f"Expected{expected}" in told, claim


def test_each_reading_is_there_with_reasons_quotes_and_what_was_known(page):
    street, bench = embedded(page)["readings"]
    assert street["metrics"].keys() == bench["metrics"].keys()
    assert street["metrics"]["boost"]["says"] != bench["metrics"]["boost"]["says"]
    assert bench["known"] and all(choice["quote"] and choice["why"] for choice in bench["choices"])


def test_a_claim_of_section_v_has_its_sentence_and_its_figure(page):
    by_id = {one["id"]: one for one in embedded(page)["claims"]}
    assert by_id["C17"]["figures"] == ["object_reuse"]
    assert "local object map" in by_id["C17"]["says"][0][1]
    assert by_id["C37"]["figures"] == []
    figures = {one["name"] for one in embedded(page)["figures"]}
    assert {name for one in by_id.values() for name in one["figures"]} <= figures


def test_first_answers_and_results_are_those_of_the_metrics(page):
    rows = json.loads((PAPER / "metrics.json").read_text())
    metrics = {
        (one["scenario"], one["metric"], one["method"], one["component"]): one
        for one in rows
        if one["reading"] == "street"
    }
    mean = embedded(page)["answers"][0]
    for answer in ("first", "result"):
        for place, scenario in enumerate(mean["scenarios"]):
            found = metrics[scenario, f"{answer}_answer_mean", "genie", ""]
            assert mean[answer]["genie"][place] == [found["value"], found["low"], found["high"]]


def test_the_page_is_small_and_independent_of_time_and_machine(page, folder):
    assert len(page.encode()) < 8 * MEGABYTE
    rewritten(
        folder / "run.json",
        lambda about: about.update(wall_time_s=1, platform="moon", workers=99, commit="x"),
    )
    assert evaluation.page(folder) == page


# The command


def test_report_writes_the_page_of_an_evaluation(folder, page, capsys):
    assert main(["report", str(folder)]) == 0
    assert (folder / "report.html").read_text(encoding="utf-8") == page
    assert "Report: evaluation/report.html" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda folder: (folder / "metrics.json").unlink(), "metrics.json: missing"),
        (lambda folder: (folder / "run.json").write_text("{"), "run.json: cannot be read"),
        (
            lambda folder: (folder / "verdicts.json").write_text('[{"id": "C1"}]'),
            "not written by this version",
        ),
    ],
    ids=["incomplete", "broken", "other"],
)
def test_a_folder_that_is_not_whole_gets_one_line(folder, spoil, message, capsys):
    spoil(folder)
    assert main(["report", str(folder), "--allow-changed"]) == 1
    said = capsys.readouterr().err
    assert message in said
    assert said.count("\n") == 1
    assert not (folder / "report.html").exists()


def test_an_evaluation_has_no_replay_to_start(folder):
    assert main(["report", str(folder), "--start", "2 s"]) == 1


@pytest.mark.slow
def test_reproduce_writes_the_page(monkeypatch):
    from genie_sim.paper.reproduce import reproduce

    monkeypatch.delenv("GENIE_SIM_KITTI", raising=False)
    made = reproduce(Path("out"), quick=True, seeds=1, workers=1, reading="street").folder
    assert (made / "report.html").read_text(encoding="utf-8") == evaluation.page(made)


# In a browser


@pytest.fixture
def file(page: str) -> Path:
    path = Path("report.html")
    path.write_text(page, encoding="utf-8")
    return path.absolute()


def asked_for(browser: Browser) -> list[str]:
    """Addresses besides the pictures that are in the page itself."""
    return [
        address
        for address in browser.requests
        if not address.startswith("data:image/svg+xml;base64,")
    ]


def choose(browser: Browser, element: str, value: str, event: str = "input") -> None:
    browser.evaluate(f"byId('{element}').value = {json.dumps(value)}")
    browser.evaluate(f"byId('{element}').dispatchEvent(new Event('{event}'))")


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
    intervals = "document.querySelectorAll('#answer-charts svg .ends').length"
    assert browser.evaluate(intervals) > 30
    decoded = (
        "Promise.all([...document.images].map(one => one.decode().then(() => one.naturalWidth)))"
    )
    assert min(browser.evaluate(decoded)) > 100
    words = browser.evaluate("document.body.innerText")
    assert not any(word in words for word in ("NaN", "undefined", "Infinity", "[object"))


def test_claims_are_filtered_by_verdict_kind_words_and_marginality(browser, file):
    browser.open(file)
    assert browser.evaluate(SHOWN) == [row["id"] for row in ROWS]
    choose(browser, "kind", "prediction")
    predictions = [row for row in ROWS if row["kind"] == "prediction"]
    assert browser.evaluate(SHOWN) == [row["id"] for row in predictions]
    browser.evaluate("byId('verdict-filter').querySelector('button').click()")
    assert (
        browser.evaluate(SHOWN)
        == [row["id"] for row in predictions if row["verdict"] != "reproduced"]
        != []
    )
    browser.evaluate("byId('verdict-filter').querySelector('button').click()")
    choose(browser, "kind", "")
    browser.evaluate("byId('marginal').click()")
    assert browser.evaluate(SHOWN) == [row["id"] for row in ROWS if row["marginal"]]
    browser.evaluate("byId('marginal').click()")
    choose(browser, "search", "OBJECT reuse")
    assert "C14" in browser.evaluate(SHOWN)
    assert "C27" not in browser.evaluate(SHOWN)


def test_the_reading_decides_which_verdicts_are_filtered(browser, file):
    browser.open(file)
    counts = browser.evaluate("byId('counts').textContent")
    predictions = [row["verdict"] for row in ROWS if row["kind"] == "prediction"]
    assert f"prediction{predictions.count('reproduced')} of {len(predictions)}" in counts
    assert "retrodicted or prediction, by the metrics of a run" in counts
    assert "all" not in counts.split(), "kinds are never added up"
    heads = browser.evaluate(
        "[...byId('claims').tHead.rows[0].cells].map(cell => cell.textContent)"
    )
    assert heads[-2:] == ["street", "bench, retrodicted"]
    assert browser.evaluate("byId('C14').cells[4].textContent").startswith("not reproduced")
    assert browser.evaluate("byId('C14').cells[5].textContent").startswith("reproducedmarginal")
    browser.evaluate("byId('verdict-filter').querySelector('button').click()")
    assert "C14" in browser.evaluate(SHOWN)
    choose(browser, "reading", "bench")
    assert browser.evaluate(SHOWN) == [row["id"] for row in ROWS], (
        "another reading begins with all of its verdicts"
    )
    browser.evaluate("byId('verdict-filter').querySelector('button').click()")
    assert "C14" not in browser.evaluate(SHOWN)
    choose(browser, "reading", "street")
    browser.evaluate("byId('marginal').click()")
    assert browser.evaluate(SHOWN) == [row["id"] for row in ROWS if row["marginal"]]


def test_the_parts_of_a_claim_and_what_is_counted_once_are_told(browser, file):
    browser.open(file)
    assert browser.evaluate("byId('C16').cells[5].textContent").endswith(
        "higher: 3 of 3; more: 0 of 2"
    )
    browser.evaluate("byId('C25').querySelector('button').click()")
    told = browser.evaluate("byId('C25').nextElementSibling.textContent")
    assert "the number of C23, counted once" in told


def test_readings_are_shown_with_what_they_mean(browser, file):
    browser.open(file)
    told = browser.evaluate("byId('reading-list').textContent")
    assert (
        "on a bench" in told and "similarity=exact" in told and "Known when it was written" in told
    )
    assert "objects then stored" in browser.evaluate("byId('meanings').textContent")


def test_a_click_on_a_claim_opens_its_evidence_and_its_figure(browser, file):
    browser.open(file)
    browser.click(*middle(browser, "C14"))
    told = browser.evaluate("byId('C14').nextElementSibling.textContent")
    row = next(row for row in ROWS if row["id"] == "C14")
    assert (
        row["test"] in told
        and row["note"] in told
        and "made up" in told
        and f"{row['n']} seeds" in told
    )
    assert "By the metrics of a run" in told
    (name,) = browser.evaluate(
        "[...byId('C14').nextElementSibling.querySelectorAll('img')].map(one => one.alt)"
    )
    assert name == "Object reuse"
    browser.evaluate("byId('C15').querySelector('button').focus()")
    browser.press("Tab")
    browser.evaluate("byId('C14').querySelector('button').click()")
    assert browser.evaluate("byId('C14').nextElementSibling.id") == "C15"


def test_the_measure_of_first_and_fresh_answers_is_chosen(browser, file):
    browser.open(file)
    means = browser.evaluate("byId('answer-table').textContent")
    titles = browser.evaluate(
        "[...byId('answer-charts').querySelectorAll('h3')].map(one => one.textContent)"
    )
    assert titles == ["Mean: first answer, logarithmic", "Mean: result, logarithmic"]
    ticks = browser.evaluate(
        "[...byId('answer-charts').querySelector('svg[role=img]').querySelectorAll('text')]"
        ".map(one => one.textContent)"
    )
    assert {"10", "20", "50", "100", "200"} <= set(ticks)
    choose(browser, "measure", "2", "change")
    assert browser.evaluate("byId('answer-table').textContent") != means


def test_an_interval_is_read_off_with_the_pointer_and_with_keys(browser, file):
    browser.open(file)
    browser.move(*middle(browser, "answer-charts"))
    browser.evaluate("byId('answer-charts').querySelector('svg[tabindex]').focus()")
    browser.press("ArrowRight")
    told = browser.evaluate("byId('answer-charts').querySelector('.tip').textContent")
    assert "Genie (DG): " in told and " to " in told


def test_markup_in_results_is_shown_as_text_and_figures_run_no_scripts(browser, folder):
    rewritten(
        folder / "verdicts.json",
        lambda rows: rows[0].update(claim=EVIL, note=EVIL, verdict="reproduced"),
    )
    figure = folder / "figures" / "image_reuse.svg"
    figure.write_text(
        figure.read_text().replace("<defs>", "<script>window.parent.hacked = 3</script><defs>", 1)
    )
    Path("report.html").write_text(evaluation.page(signed(folder)), encoding="utf-8")
    assert Path("report.html").read_text(encoding="utf-8").count("<script") == 2
    browser.open(Path("report.html"))
    browser.evaluate("byId('C1').querySelector('button').click()")
    assert browser.evaluate("byId('C1').cells[1].textContent") == EVIL
    assert browser.evaluate("typeof window.hacked") == "undefined"
    assert browser.errors == []
    assert asked_for(browser) == [Path("report.html").absolute().as_uri()]


def test_a_page_that_cannot_be_written_is_named():
    with pytest.raises(gs.UserError, match=r"no/such/r\.html: cannot be written"):
        html_page.write_text(Path("no/such/r.html"), evaluation.page(PAPER))
