"""``genie-sim figures --only``: one figure, or one metric, of one or several results."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import pytest

import genie_sim as gs
from genie_sim.cli.main import main

WINDOW = {"cars[*].route.window": ["0 s", "1 s"]}


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """Runs that did not see the same frames: of other cars."""
    out = tmp_path_factory.mktemp("results")
    scenarios = ("street_1car_hetero", "street_2car_homo")
    return [str(gs.run(name, WINDOW, out=out, report=False).folder) for name in scenarios]


def words(path: str) -> str:
    """All text of an SVG."""
    return " | ".join(re.findall(r">([^<>]+)</(?:text|tspan)>", Path(path).read_text()))


def size_in(path: str) -> list[float]:
    """Width and height of an SVG [in]."""
    found = re.search(r'width="([\d.]+)pt" height="([\d.]+)pt"', Path(path).read_text())
    assert found is not None
    return [float(points) / 72 for points in found.groups()]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["latency_cdf", "confidence_boost"])
def test_one_figure_of_several_results_fits_a_column(folders, name, capsys):
    line = ["--only", name, "--methods", "genie,remote", "--label", "one", "--label", "two"]
    assert main(["figures", *folders, *line, "--width", "3.5in", "--out", "f.svg"]) == 0
    assert capsys.readouterr().out == "f.svg\n"
    text = words("f.svg")
    assert "one:" in text and "two:" in text and "Genie (DG)" in text
    assert "local" not in text
    width, height = size_in("f.svg")
    assert width == pytest.approx(3.5) and height <= 3.2 + 1e-6


@pytest.mark.slow
def test_one_metric_of_results_is_called_by_the_results(folders, capsys):
    line = ["--only", "first_answer_p99", "--methods", "genie", "--format", "svg,pdf"]
    assert main(["figures", *folders, *line, "--out", "drawn"]) == 0
    assert capsys.readouterr().out.split() == [
        "drawn/first_answer_p99.svg",
        "drawn/first_answer_p99.pdf",
    ]
    text = words("drawn/first_answer_p99.svg")
    assert "street_1car_hetero" in text and "street_2car_homo" in text
    assert "first answer, p99 [ms], lower is better" in text
    run = gs.load(folders[0])
    assert run.figure("first_answer_p99").axes[0].get_xlabel() == (
        "first answer, p99 [ms], lower is better"
    )
    with pytest.raises(gs.UserError, match="unknown figure 'nope'"):
        run.figure("nope")


@pytest.mark.slow
def test_a_figure_of_a_run_can_be_asked_for_alone(folders):
    assert (
        main(["figures", folders[0], "--only", "resources", "--label", "mine", "--out", "r.svg"])
        == 0
    )
    assert "mine, street_1car_hetero" in Path("r.svg").read_text(), "in its description"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("line", "message"),
    [
        (
            ["--only", "latncy_cdf"],
            "unknown figure 'latncy_cdf' (did you mean 'latency_cdf'?)",
        ),
        (["--only", "lap_f1"], "lap_f1: these results have no value of it"),
        (["--only", "utilization"], "values are too many for a column: name fewer with --methods"),
        (["--only", "latency_cdf", "--width", "30in"], "--width: '30in': expected column, page,"),
        (["--only", "latency_cdf", "--width", "wide"], "or inches from 2 to 12, such as 3.5"),
        (["--only", "latency_cdf", "--out", "f.jpg"], "--out: unknown format 'jpg'"),
        (
            ["--out", "f.pdf", "--only", "latency_cdf", "--format", "svg"],
            "--format: f.pdf says another",
        ),
        (["--methods", "genei"], "unknown method 'genei' (did you mean 'genie'?)"),
        (["--label", "a", "--label", "b"], "labels: 2 labels for one result"),
        (["--format", "jpg"], "--format: unknown format 'jpg'"),
    ],
)
def test_a_figure_that_cannot_be_drawn_gets_one_line(folders, line, message, capsys):
    assert main(["figures", folders[0], "--out", "drawn", *line]) == 1
    said = capsys.readouterr().err
    assert message in said and said.count("\n") == 1
    assert not Path("drawn").exists()


@pytest.mark.slow
def test_several_results_need_a_folder_before_they_are_read(capsys):
    assert main(["figures", "nowhere", "nor_here"]) == 1
    assert "--out" in capsys.readouterr().err


def test_methods_labels_and_metrics_choose_in_every_command_that_shows(folders, capsys):
    line = ["--methods", "genie,remote", "--metrics", "first_answer_p99", "--format", "csv"]
    for command in ("table", "compare"):
        assert main([command, folders[0], *line]) == 0
        rows = csv.DictReader(capsys.readouterr().out.splitlines())
        values = [row for row in rows if not row.get("against")]
        assert {row["metric"] for row in values} == {"first_answer_p99"}
        assert sorted(row["method"] for row in values) == ["genie", "remote"]
    assert main(["table", folders[0], "--label", "mine"]) == 0
    assert main(["table", folders[0], "--metrics", "nope"]) == 1
    assert main(["compare", folders[0], "--metrics", "nope"]) == 1
    assert capsys.readouterr().err.count("metrics: unknown metric 'nope'") == 2
    with pytest.raises(gs.UserError, match=r"unknown metric 'nope'"):
        gs.compare(folders[0], metrics=["nope"])
