"""Figures and tables of the committed evaluation."""

from __future__ import annotations

import re

import pytest

from genie_sim.base.errors import UserError
from genie_sim.cli import outputs
from genie_sim.cli.main import main
from genie_sim.paper import figure_data, paper_figures
from tests.checkout import REPOSITORY, copied

PAPER = REPOSITORY / "results" / "paper"


@pytest.mark.slow
def test_every_committed_figure_is_drawn_again_from_the_folder_s_data(tmp_path):
    figures = paper_figures.of_evaluation(PAPER)
    assert set(figures) == {path.stem for path in (PAPER / "figures").glob("*.svg")}
    assert set(figures) == set(figure_data.FIGURES)
    for name, figure in figures.items():
        title, _, run = str(figure.get_label()).partition("\n")
        committed = (PAPER / "figures" / f"{name}.svg").read_text(encoding="utf-8")
        assert title in committed and run.partition(":")[0] in committed


def test_an_evaluation_s_figures_have_the_width_that_is_asked_for(tmp_path, monkeypatch):
    monkeypatch.setattr(paper_figures, "_makers", _only("worth"))
    command = ["figures", str(PAPER), "--width", "acm-column", "--format", "pdf"]
    assert main([*command, "--out", str(tmp_path)]) == 0
    (path,) = tmp_path.iterdir()
    width_points = float(re.search(rb"/MediaBox \[ *0 0 ([\d.]+)", path.read_bytes())[1])
    assert width_points == pytest.approx(72 * 3.33, abs=0.1)


def _only(name: str):
    """The figures' makers, of which this one alone is left."""
    makers = paper_figures._makers
    return lambda *arguments: {name: makers(*arguments)[name]}


def test_figures_are_not_drawn_from_changed_data(tmp_path):
    folder = copied(PAPER, tmp_path / "evaluation", "figures")
    quality = folder / "quality.json"
    quality.write_text(quality.read_text(encoding="utf-8").replace("0.1", "0.2"))
    with pytest.raises(UserError, match=r"quality\.json"):
        outputs.Results([folder]).figures()
    (folder / "figures.parquet").unlink()
    with pytest.raises(UserError, match=r"figures\.parquet: no such file"):
        outputs.Results([folder]).figures()


def test_an_evaluation_s_table_is_of_claims_and_not_of_methods(capsys):
    assert main(["table", str(PAPER), "--methods", "genie"]) == 1
    assert "its table are of claims" in capsys.readouterr().err
