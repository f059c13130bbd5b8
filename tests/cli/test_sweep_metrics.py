"""Figures and tables of a sweep's folder, of chosen metrics and widths."""

from __future__ import annotations

from pathlib import Path

import pytest

from genie_sim.cli.main import main
from genie_sim.study.figures import SweepFigures
from tests.cli.test_figures_command import size_in, words

pytestmark = pytest.mark.slow
BASE = ["sweep", "street_1car_hetero", "--set", "cars[0].route.window=[0 s, 1 s]", "--seeds", "1"]
RATE, EDGE = "genie.object_map.rate=0.2,0.5", "genie.view_range=50 m,90 m"


@pytest.fixture(scope="module")
def line(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A sweep along one axis."""
    return swept(tmp_path_factory.mktemp("line"), RATE)


@pytest.fixture(scope="module")
def plane(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A sweep over two axes."""
    return swept(tmp_path_factory.mktemp("plane"), RATE, EDGE)


def swept(out: Path, *axes: str) -> str:
    chosen = [part for axis in axes for part in ("--axis", axis)]
    line = [*BASE, *chosen, "--methods", "remote,genie", "--jobs", "1", "--out", str(out)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(SweepFigures, "drawn", lambda _: iter(()))
        assert main(line) == 0
    (folder,) = out.iterdir()
    return str(folder)


def test_one_metric_of_a_sweep_is_drawn_along_its_axis(line):
    command = ["figures", line, "--only", "first_answer_p99", "--width", "column"]
    assert main([*command, "--out", "f.svg"]) == 0
    text = words("f.svg")
    assert "first answer," in text and "p99 [ms]" in text and "rate" in text
    assert "remote (R)" in text and "Genie (DG)" in text and "(a)" not in text
    width, height = size_in("f.svg")
    assert width == pytest.approx(252 / 72.27) and 1.5 < height <= 3.2 + 1e-6


def test_one_metric_of_two_axes_is_lines_at_any_width(plane):
    command = ["figures", plane, "--only", "first_answer_p99"]
    assert main([*command, "--out", "f.svg"]) == 0
    text = words("f.svg")
    assert "first answer, p99" in text and "rate" in text and "view_range [m]" in text
    assert main([*command, "--width", "acm-page", "--out", "g.svg"]) == 0
    assert size_in("g.svg")[0] == pytest.approx(7)
    assert main([*command, "--width", "column", "--out", "h.svg"]) == 0
    assert size_in("h.svg")[0] == pytest.approx(252 / 72.27)
    assert "view_range [m] = " in words("h.svg"), "a line for each value of the second axis"


def test_a_sweep_says_what_it_cannot_draw(line, capsys):
    for name, message in (
        ("rte", "unknown figure 'rte' (did you mean 'rate'?)"),
        ("lap_f1", "lap_f1: this sweep has no value of it to draw"),
    ):
        assert main(["figures", line, "--only", name, "--out", "none"]) == 1
        said = capsys.readouterr().err
        assert message in said and said.count("\n") == 1


def test_the_table_of_a_sweep_has_the_metrics_that_are_asked_for(line, capsys):
    command = ["table", line, "--metrics", "first_answer_p99,image_reuse"]
    assert main(command) == 0
    first, _, *rows = capsys.readouterr().out.splitlines()
    titles = ["first answer, p99 [ms]", "image reuse on cars [%]", "image reuse on edges [%]"]
    assert first == f"| {' | '.join(['rate', 'method', *titles])} |"
    assert len(rows) == 4
    assert main([*command, "--format", "csv"]) == 0
    _, *rows = capsys.readouterr().out.splitlines()
    assert all("first_answer_p99" in row or "image_reuse" in row for row in rows)
    assert main([*command, "--format", "latex"]) == 0
    assert "image reuse" in capsys.readouterr().out
    for name, message in (
        ("nope", "metrics: unknown metric 'nope'"),
        ("utilization", "utilization: this sweep has no value of it"),
        ("improvement_first_answer", "is not of a method as a whole; format csv has it"),
    ):
        assert main(["table", line, "--metrics", name]) == 1
        said = capsys.readouterr().err
        assert message in said and said.count("\n") == 1
