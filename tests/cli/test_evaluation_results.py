"""Figures and tables of the committed evaluation."""

from __future__ import annotations

import re

import pytest

from genie_sim import kinds
from genie_sim.base.errors import UserError
from genie_sim.cli.main import main
from tests.checkout import REPOSITORY, copied

PAPER = REPOSITORY / "results" / "paper"


@pytest.mark.slow
def test_an_evaluation_s_figures_have_the_width_that_is_asked_for(tmp_path):
    command = ["figures", str(PAPER), "--width", "acm-column", "--format", "pdf"]
    assert main([*command, "--only", "case_study", "--out", str(tmp_path / "f.pdf")]) == 0
    width_points = float(
        re.search(rb"/MediaBox \[ *0 0 ([\d.]+)", (tmp_path / "f.pdf").read_bytes())[1]
    )
    assert width_points == pytest.approx(72 * 3.33, abs=0.1)


def test_figures_are_not_drawn_from_changed_data(tmp_path):
    folder = copied(PAPER, tmp_path / "evaluation", "figures")
    with (folder / "curves.parquet").open("ab") as file:
        file.write(b"more")
    with pytest.raises(UserError, match=r"curves\.parquet"):
        kinds.load(folder)
    (folder / "curves.parquet").unlink()
    with pytest.raises(UserError, match=r"curves\.parquet: no such file"):
        kinds.load(folder)


def test_an_evaluation_s_table_is_of_claims_and_not_of_methods(capsys):
    assert main(["table", str(PAPER), "--methods", "genie"]) == 1
    assert "its table are of claims" in capsys.readouterr().err
