"""What a newcomer tries at first: it works, or one line says what to write instead."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import genie_sim as gs
from genie_sim.analysis import registry
from genie_sim.base.errors import UserError
from genie_sim.cli.main import main

SHORT = "cars[0].route.window=[0 s, 1 s]"
RUN = ["run", "street_1car_hetero", "--set", SHORT, "--methods", "remote,genie"]


@pytest.fixture(scope="module")
def seeds(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Two seeds of one setting."""
    out = tmp_path_factory.mktemp("seeds")
    settings = {"cars[0].route.window": ["0 s", "1 s"]}
    methods = ["remote", "genie"]
    runs = gs.run_seeds(
        "street_1car_hetero", settings, methods=methods, seeds=2, jobs=1, out=out, report=False
    )
    return str(runs.folder)


def refused(capsys: pytest.CaptureFixture[str], *line: str) -> str:
    """The one line that a command ends with."""
    capsys.readouterr()
    assert main([*line]) == 1
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    return said.removeprefix("genie-sim: ").strip()


@pytest.mark.slow
@pytest.mark.parametrize("seeds", [(), ("--seeds", "2")])
def test_a_page_and_figures_outlive_the_same_run_without_them(seeds):
    run = [*RUN, *seeds]
    assert main([*run, "--figures"]) == 0
    (folder,) = Path("results").iterdir()
    made = {
        path: path.read_bytes() for path in folder.rglob("*") if path.suffix in {".svg", ".html"}
    }
    assert len(made) > 3
    assert main([*run, "--no-report"]) == 0
    assert {path: path.read_bytes() for path in made} == made
    assert main([*run, "--no-report", "--label", "other"]) == 0
    shown = [path for path in made if "runs" not in path.parts]  # runs of seeds have no label
    assert not any(path.exists() for path in shown), "they show the earlier label"


@pytest.mark.slow
def test_a_page_of_other_bytes_does_not_outlive_a_run():
    assert main(RUN) == 0
    (folder,) = Path("results").iterdir()
    about = json.loads((folder / "run.json").read_text())
    about["digests"]["frames.parquet"] = "0" * 64
    (folder / "run.json").write_text(json.dumps(about))
    assert main([*RUN, "--no-report"]) == 0
    assert not (folder / "report.html").exists()


@pytest.mark.slow
def test_tables_of_seeds_have_the_metrics_that_are_asked_for(seeds, capsys):
    metrics = "first_answer_p99,dropped_share"
    for command in ("table", "compare"):
        assert main([command, seeds, "--format", "latex", "--metrics", metrics]) == 0
        text = capsys.readouterr().out
        assert "first answer, p99" in text and "frames dropped" in text
        assert "mean" not in text.split("\\midrule")[1].split("\\bottomrule")[0]
    assert main(["table", seeds, "--metrics", "fault_recall"]) == 1
    assert "metrics: no method has a value of fault_recall" in capsys.readouterr().err


@pytest.mark.slow
def test_verdicts_are_of_the_metrics_that_are_asked_for(capsys):
    line = [*RUN, "--seeds", "2", "--jobs", "1", "--no-report"]
    assert main([*line, "--metrics", "first_answer_p99"]) == 0
    assert "Genie (DG) is" not in capsys.readouterr().out
    assert main([*line, "--metrics", "ghost_share"]) == 0
    said = capsys.readouterr().out
    assert "Genie (DG) is" in said and "in false objects (" in " ".join(said.split())
    assert "first answer, mean" not in said
    assert main(line) == 0
    assert "first answer, mean (" in " ".join(capsys.readouterr().out.split())


@pytest.mark.slow
def test_a_metric_without_a_value_is_named(seeds, capsys):
    for metric in ("lap_f1", "image_reuse"):
        said = refused(capsys, "compare", seeds, "--metrics", metric)
        assert said == f"compare: of methods as a whole, no method has a value of {metric}"
    said = refused(capsys, "compare", seeds, "--metrics", "lap_f1", "--methods", "genie")
    assert "give two results, or one with several methods" in said


@pytest.mark.parametrize(
    ("name", "near"),
    [
        ("false_objects", "'ghost_share'"),
        ("false objects", "'ghost_share'"),
        ("Ghost_share", "'ghost_share'"),
        ("image_resue", "'image_reuse'"),
    ],
)
def test_a_metric_is_found_by_its_title(name, near):
    with pytest.raises(UserError) as caught:
        registry.checked([name])
    said = str(caught.value)
    assert f"metrics: unknown metric {name!r} (did you mean {near}" in said
    assert said.endswith("; see 'genie-sim list metrics'") and len(said) < 200


@pytest.mark.slow
def test_one_of_several_seeds_is_named_for_export(seeds, capsys):
    said = refused(capsys, "export", seeds)
    assert (
        said == f"{seeds}: holds several seeds, not one run; take one, such as {seeds}/runs/seed-1"
    )


@pytest.mark.slow
def test_a_format_that_agrees_with_the_file_is_accepted(seeds, capsys):
    line = ["figures", seeds, "--only", "latency_cdf", "--out", "cdf.pdf"]
    assert main([*line, "--format", "pdf"]) == 0
    assert Path("cdf.pdf").is_file()
    assert "--format: cdf.pdf says another" in refused(capsys, *line, "--format", "pdf,svg")
