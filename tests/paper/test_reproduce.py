"""The evaluation: declared before, whole or absent, shown as it came out."""

from __future__ import annotations

import errno
import hashlib
import json
import os
from pathlib import Path

import numpy as np
import pytest

import genie_sim as gs
from genie_sim.base import files
from genie_sim.cli.main import main
from genie_sim.paper import claims, curves, numbers, printed
from genie_sim.paper.checks import judge
from genie_sim.paper.evidence import Evidence
from genie_sim.paper.reproduce import FIGURES, FILES, declared_seeds, reproduce
from genie_sim.paper.sources import ASSUMPTIONS
from genie_sim.record import provenance
from genie_sim.scenario.yaml_input import read_mapping
from studies import paper_pages
from tests.checkout import copied

REPOSITORY = Path(__file__).resolve().parents[2]
PAPER = REPOSITORY / "results" / "paper"
ASSUMED = read_mapping(ASSUMPTIONS)


def test_everything_fixed_has_a_reason():
    for one in ASSUMED["fixed"]:
        assert one["value"] and len(one["why"]) > 40, one["what"]
    assert len(declared_seeds()) == 10


@pytest.mark.slow
@pytest.mark.nightly
def test_a_quick_evaluation_has_the_rows_legs_and_units_of_the_full_one(tmp_path, capsys):
    assert main(["reproduce", "--seeds", "1", "--jobs", "1", "--out", str(tmp_path / "out")]) == 0
    check_quick(tmp_path / "out", capsys.readouterr().out)


def check_quick(folder: Path, told: str) -> None:
    rows, full = printed.read_rows(folder), printed.read_rows(PAPER)
    same = ("id", "section", "kind", "claim", "paper", "ours", "unit", "command")
    assert [[row[name] for name in same] for row in rows] == [
        [row[name] for name in same] for row in full
    ]
    for row in rows:
        assert row["id"] in told and row["value"] is not None
        if row["verdict"] != row["full_run"]:
            assert f"{row['verdict']} (full run: {row['full_run']})" in " ".join(told.split())
    assert all(sentence.split()[0] in told for sentence in claims.sentences(rows))
    for name in FIGURES:
        assert (folder / "figures" / f"{name}.svg").stat().st_size > 10_000
    assert "| streaming F1 [%] |" in (folder / "verdicts.md").read_text()


def test_the_committed_results_are_those_of_the_committed_inputs():
    about = json.loads((PAPER / "run.json").read_text())
    here = REPOSITORY / "genie_sim" / "paper"
    for name, digest in about["inputs"].items():
        assert hashlib.sha256((here / name).read_bytes()).hexdigest() == digest, (
            f"{name} changed: evaluate anew"
        )
    assert about["quick"] is False
    assert tuple(about["seeds"]) == declared_seeds()[: len(about["seeds"])]


def test_the_committed_verdicts_follow_from_the_committed_numbers():
    """The claims as they are now, judged from the rows of every run: nothing is simulated."""
    rows = printed.read_rows(PAPER)
    assert json.loads(json.dumps(judge(Evidence(numbers.read(PAPER))))) == rows, (
        "the claims changed: evaluate anew"
    )
    assert provenance.read_json(paper_pages.FULL_RUN) == {row["id"]: row["verdict"] for row in rows}


def test_the_committed_results_are_small():
    paths = [path for path in PAPER.rglob("*.*") if path.suffix not in (".html", ".svg")]
    assert sum(path.stat().st_size for path in paths) < 1_000_000


def test_the_readme_shows_the_committed_verdicts():
    assert paper_pages.readme() == paper_pages.README.read_text(encoding="utf-8"), (
        "python -m studies.paper_pages"
    )


def test_the_set_ups_are_the_declared_ones():
    for name, declared in ASSUMED["evaluation"]["scenarios"].items():
        content = read_mapping(files.find(files.SCENARIO, name))
        del content["description"]
        text = json.dumps(content, sort_keys=True, default=str)
        assert hashlib.sha256(text.encode()).hexdigest()[:16] == declared, (
            f"{name} changed: if that is meant, declare it in assumptions.yaml"
        )


def test_results_of_the_former_meanings_are_one_line(tmp_path, capsys):
    folder = copied(PAPER, tmp_path / "old")
    about = json.loads((folder / "run.json").read_text())
    del about["format"]
    (folder / "run.json").write_text(json.dumps(about))
    for command in ("table", "figures", "report"):
        assert main([command, str(folder)]) == 1
        said = capsys.readouterr().err
        assert "run.json: says no format" in said and said.count("\n") == 1


@pytest.mark.parametrize("seeds", ["0", "-1", "two", "1.5"])
def test_a_wrong_number_of_seeds_is_one_line(seeds, capsys, tmp_path):
    assert main(["reproduce", "--seeds", seeds, "--out", str(tmp_path / "out")]) in (1, 2)
    assert "--seeds" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_the_library_takes_whole_numbers_alone():
    for seeds in (0, -1, 1.5, "2", True):
        with pytest.raises(gs.UserError, match=r"seeds: .*expected a whole number"):
            gs.reproduce(seeds=seeds)


def test_nothing_is_overwritten_that_is_no_result(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine.txt").write_text("mine")
    with pytest.raises(gs.UserError, match="choose another --out"):
        reproduce(tmp_path / "out", seeds=1)
    (tmp_path / "out" / "mine.txt").unlink()
    for about in ({"seeds": [1, 2]}, {"facts": {}}):  # an evaluation with more seeds, and a run
        (tmp_path / "out" / "run.json").write_text(json.dumps(about))
        with pytest.raises(gs.UserError, match="is kept; choose another --out"):
            reproduce(tmp_path / "out", seeds=1)
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


@pytest.mark.slow
def test_an_evaluation_that_cannot_be_shown_keeps_its_numbers(tmp_path, capsys, monkeypatch):
    """Then it is shown, as the full one is, and what somebody has put beside it stays. The runs of
    the first seed give the committed numbers, as ``test_regression`` sees to.
    """

    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    known = numbers.read(PAPER)
    of_first = known[known["seed"] == 1], curves.read(PAPER / curves.FILE)
    monkeypatch.setattr("genie_sim.paper.runs.simulate", lambda *_: of_first)
    line, out = ["reproduce", "--seeds", "1", "--out", str(tmp_path / "out")], tmp_path / "out"
    with monkeypatch.context() as patched:
        patched.setattr("genie_sim.paper.reproduce.Reproduction.figures", lambda *_: {})
        patched.setattr("genie_sim.report.template.part", full)
        assert main(line) == 1
    assert capsys.readouterr().err.splitlines()[-1] == (
        f"genie-sim: {out}: the results are kept, but without report.html"
    )
    assert printed.read_rows(out) and not (out / "report.html").exists()
    (out / "mine.txt").write_text("mine")
    assert main(line) == 0
    check_quick(out, capsys.readouterr().out)
    assert (out / "report.html").exists() and (out / "mine.txt").exists()


@pytest.mark.parametrize(
    ("command", "name"),
    [
        *(("report", name) for name in FILES),
        *((command, "run.json") for command in ("report", "table", "figures")),
        ("table", "verdicts.json"),
        ("figures", curves.FILE),
    ],
)
def test_no_file_of_an_evaluation_is_read_outside_of_it(command, name, tmp_path, capsys):
    folder = copied(PAPER, tmp_path / "out")
    (folder / name).rename(tmp_path / "outside")
    (folder / name).symlink_to(tmp_path / "outside")
    assert main([command, str(folder)]) == 1
    assert f"out/{name}: a link out of" in capsys.readouterr().err


def test_the_table_is_printed_in_markdown_and_for_a_notebook():
    rows = printed.read_rows(PAPER)
    assert gs.load(PAPER).text().count("\n| C") == 39
    page = printed.html(rows)
    assert page.count("<tr>") == 40 and "the paper says" in page
    with pytest.raises(gs.UserError, match="markdown and csv"):
        gs.load(PAPER).text("latex")
    narrow = printed.text(rows, 60)
    assert printed.in_short(rows).splitlines()[-1] in narrow
    assert max(map(len, narrow.splitlines())) <= 60
    assert not np.isnan([row["value"] for row in rows]).any()
