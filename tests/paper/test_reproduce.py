"""The evaluation: declared before, the same on any number of processes, whole or absent, shown as
it came out.
"""

from __future__ import annotations

import hashlib
import json
import shutil
from pathlib import Path

import pytest

from genie_sim.paper import page, rows, table1, verdict_table
from genie_sim.paper.checks import CASE, load_claims
from genie_sim.paper.readings import load_readings
from genie_sim.paper.reproduce import (
    QUICK_READINGS,
    calibrated_settings,
    declared_seeds,
    judge_readings,
    reproduce,
)
from genie_sim.paper.sources import ASSUMPTIONS, edited_set_ups, set_ups
from genie_sim.record import provenance
from genie_sim.scenario.yaml_input import read_mapping
from tests.checkout import copied

REPOSITORY = Path(__file__).resolve().parents[2]
PAPER = REPOSITORY / "results" / "paper"
GENERATED = (REPOSITORY / "README.md", REPOSITORY / "docs" / "paper.md")
ASSUMED = read_mapping(ASSUMPTIONS)
MARKERS = {  # of a document's generated parts
    "readings": ("<!-- readings:begin -->", "<!-- readings:end -->"),
    "verdicts": ("<!-- verdicts:begin -->", "<!-- verdicts:end -->"),
    "counts": ("<!-- counts:begin -->", "<!-- counts:end -->"),
    "section V": ("<!-- section-v:begin -->", "<!-- section-v:end -->"),
    "worth": ("<!-- worth:begin -->", "<!-- worth:end -->"),
    "table I": ("<!-- table-1:begin -->", "<!-- table-1:end -->"),
}


def section_v(verdicts: list[dict]) -> str:
    """Section V sentence by sentence: the figure and the verdicts."""
    found = verdict_table.by_claim(verdicts)
    readings = {row["reading"]: row["column"] for row in verdicts}
    lines = [f"| Section V | the paper says | figure | {' | '.join(readings.values())} | here |"]
    lines.append(f"|---|---|---|{'---|' * len(readings)}---|")
    for one in verdict_table.sentences():
        figure = f"`{one['figure']}`" if one["figure"] else ""
        cells = [
            "; ".join(f"{claim}: {found[claim][name]['verdict']}" for claim in one["claims"])
            for name in readings
        ]
        lines.append(
            f"| {one['part']} | {one['says']} | {figure} | {' | '.join(cells)} |"
            f" {one['note'] or ''} |"
        )
    return "\n".join(lines)


def generated_parts(folder: Path) -> dict[str, str]:
    """What documents show of a result folder, by the name of the part. Raises ``UserError``."""
    verdicts = verdict_table.read_rows(folder)
    parts = {"verdicts": verdict_table.in_markdown(verdicts).rstrip()}
    parts["counts"] = "\n".join(verdict_table.counts(verdicts))
    parts |= {"section V": section_v(verdicts), "table I": table1.markdown()}
    parts["readings"] = verdict_table.readings_text(provenance.read_json(folder / "readings.json"))
    quality = folder / "quality.json"
    if quality.is_file():
        parts["worth"] = verdict_table.map_quality_table(provenance.read_json(quality))
    return parts


def between(name: str, text: str) -> str | None:
    """A document's generated part of that name, ``None`` where it has none."""
    begin, end = MARKERS[name]
    if begin not in text or end not in text:
        return None
    return text.split(begin, 1)[1].split(end, 1)[0].strip()


def refreshed(text: str, parts: dict[str, str]) -> str:
    """The document with its generated parts made anew; a part it does not have is left out."""
    for name, part in parts.items():
        begin, end = MARKERS[name]
        if between(name, text) is not None:
            before, rest = text.split(begin, 1)
            text = f"{before}{begin}\n{part}\n{end}{rest.split(end, 1)[1]}"
    return text


def test_two_parameters_are_fitted_to_two_numbers_on_seeds_of_their_own():
    fitted = ASSUMED["calibrated"]
    assert list(fitted["parameters"]) == ["overlap", "gate_m"]
    targets = {name: target["value"] for name, target in fitted["targets"].items()}
    assert targets == {"object_reuse_mean": 0.31, "object_to_image_reuse": 4.0}
    assert not set(ASSUMED["evaluation"]["calibration_seeds"]) & set(declared_seeds())
    assert len(declared_seeds()) >= 10
    for setting in calibrated_settings():
        name, value = setting.split("=")
        low, high = fitted["parameters"][name]["range"]
        assert low <= float(value) <= high


def test_everything_fixed_has_a_reason():
    for one in ASSUMED["fixed"]:
        assert one["value"] and len(one["why"]) > 40, one["what"]


@pytest.mark.slow
def test_a_quick_evaluation_judges_every_claim_and_draws_every_figure(tmp_path):
    told = []
    result = reproduce(
        tmp_path / "out", quick=True, seeds=1, workers=1, progress=lambda *what: told.append(what)
    )
    verdicts = verdict_table.read_rows(result.folder)
    assert [(one["reading"], one["id"]) for one in verdicts] == [
        (name, one.id) for name in QUICK_READINGS for one in load_claims()
    ]
    assert told == sorted(told), "runs that share what is equal are done together"
    assert told[-1][0] == told[-1][1], "the progress ends at its end"
    for name in (
        "latency_cdf",
        "image_reuse",
        "object_reuse",
        "confidence_boost",
        "case_study",
        "worth",
    ):
        assert (result.folder / "figures" / f"{name}.svg").stat().st_size > 10_000
    assert "| streaming precision |" in (result.folder / "verdicts.md").read_text()
    assert json.loads((result.folder / "run.json").read_text())["quick"] is True


def test_an_interrupted_evaluation_leaves_nothing(tmp_path, monkeypatch):
    def interrupt(done, of, what):
        raise KeyboardInterrupt

    variants = {"base": ((CASE,), (), ("genie",))}
    monkeypatch.setattr("genie_sim.paper.reproduce.VARIANTS", variants)
    with pytest.raises(KeyboardInterrupt):
        reproduce(tmp_path / "out", seeds=1, workers=1, reading="street", progress=interrupt)
    assert not list(tmp_path.iterdir())


def test_the_committed_results_are_those_of_the_committed_assumptions():
    about = json.loads((PAPER / "run.json").read_text())
    here = REPOSITORY / "genie_sim" / "paper"
    for name, digest in about["inputs"].items():
        assert hashlib.sha256((here / name).read_bytes()).hexdigest() == digest, (
            f"{name} changed: evaluate anew"
        )
    assert about["quick"] is False
    assert tuple(about["seeds"]) == declared_seeds()
    assert {name: tuple(used) for name, used in about["settings"].items()} == {
        one.name: one.settings(calibrated_settings()) for one in load_readings()
    }


def test_the_committed_results_are_small():
    ignored = (".html", ".png", ".pdf")
    committed = [path for path in PAPER.rglob("*.*") if path.suffix not in ignored]
    assert sum(path.stat().st_size for path in committed) < 4_000_000


def test_the_set_ups_are_the_declared_ones():
    declared = ASSUMED["evaluation"]["scenarios"]
    assert declared == {name: digest for name, _, digest in set_ups()}, (
        "a set-up of the paper changed: if that is meant, declare it in assumptions.yaml"
    )
    assert edited_set_ups() == []


def test_an_edited_set_up_is_said_in_one_line_and_on_the_page(tmp_path, monkeypatch, caplog):
    """Whoever edits a copy of a set-up gets the numbers of the edited one, and is told so."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scenarios").mkdir()
    shipped = (REPOSITORY / "scenarios" / "1car_homo.yaml").read_text()
    own = tmp_path / "scenarios" / "1car_homo.yaml"
    own.write_text(shipped.replace("# Boards side by side", "# Some boards"))
    assert edited_set_ups() == [], "a comment changes nothing"
    own.write_text(shipped.replace("laps: 2", "laps: 3"))
    (line,) = edited_set_ups()
    assert line == (
        "scenarios/1car_homo.yaml: edited, no longer the paper's set-up; "
        "the numbers are those of the edited one"
    )
    monkeypatch.setattr("genie_sim.paper.page.verdict_table.few_seeds", lambda rows: "")
    copy = copied(PAPER, tmp_path / "evaluation")
    about = json.loads((copy / "run.json").read_text()) | {"edited": [line]}
    (copy / "run.json").write_text(json.dumps(about))
    assert line in page.page_data(copy)["notes"]


@pytest.mark.slow
def test_the_committed_verdicts_follow_from_the_committed_numbers():
    """The claims as they are now, judged from the rows of every run: nothing is simulated."""
    places = rows.read(PAPER)
    readings = load_readings()
    facts = [
        {place[1:]: list(of.values()) for place, of in places.items() if place[0] == one.name}
        for one in readings
    ]
    settings = [one.settings(calibrated_settings()) for one in readings]
    judged = judge_readings(readings, settings, facts, workers=1)
    found = [
        verdict_table.row(verdict, one.reading, plain)
        for one in judged
        for verdict, plain in zip(
            one.verdicts, one.plain or [None] * len(one.verdicts), strict=True
        )
    ]
    assert json.loads(json.dumps(found)) == verdict_table.read_rows(PAPER), (
        "the claims changed: evaluate anew"
    )


@pytest.mark.parametrize("document", GENERATED, ids=lambda path: path.name)
def test_the_documents_show_the_committed_verdicts(document):
    text = document.read_text(encoding="utf-8")
    for name, part in generated_parts(PAPER).items():
        shown = between(name, text)
        assert shown is None or shown == part, (
            f"{document.name} shows other {name}: python -m tests.paper.test_reproduce"
        )
    if document.name == "README.md":
        assert between("counts", text) is not None
    if document.name == "paper.md":
        assert between("verdicts", text) is not None
        assert between("section V", text) is not None


def refresh(repository):
    """Writes the committed evaluation into the documents of a repository."""
    for path in GENERATED:
        path = repository / path.relative_to(REPOSITORY)
        shown = refreshed(path.read_text(encoding="utf-8"), generated_parts(PAPER))
        path.write_text(shown, encoding="utf-8")


def test_refreshing_what_is_committed_changes_nothing(tmp_path):
    """What ``python -m tests.paper.test_reproduce`` does after an evaluation."""
    for path in GENERATED:
        (tmp_path / path.relative_to(REPOSITORY)).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(path, tmp_path / path.relative_to(REPOSITORY))
    refresh(tmp_path)
    for path in GENERATED:
        assert (tmp_path / path.relative_to(REPOSITORY)).read_bytes() == path.read_bytes(), path


if __name__ == "__main__":
    refresh(REPOSITORY)
