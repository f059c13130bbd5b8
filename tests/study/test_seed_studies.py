"""A run with several seeds: means and intervals over them, resumed, labelled, compared."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from genie_sim import kinds
from genie_sim.analysis.seed_runs import SeedRuns, is_seeds_folder, seeds_text
from genie_sim.base.errors import UserError
from genie_sim.cli.main import main

pytestmark = pytest.mark.slow

SHORT = ["--set", "cars[0].route.window=[0 s, 1 s]", "--set", "methods=[remote, genie]"]
RUN = ["run", "street_1car_hetero", *SHORT]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run with the seeds 2, 5 and 9, made by one process."""
    out = tmp_path_factory.mktemp("seeds")
    assert main([*RUN, "--seeds", "2,5,9", "--jobs", "1", "--out", str(out), "--figures"]) == 0
    (path,) = out.iterdir()
    return path


def seeds_of(folder: Path) -> SeedRuns:
    runs = kinds.load(folder)
    assert isinstance(runs, SeedRuns)
    return runs


def test_every_seed_has_its_results_and_the_folder_page_and_figures(folder, capsys):
    for seed in (2, 5, 9):
        assert {"run.json", "frames.parquet", "summary.md", "report.html"} <= {
            path.name for path in (folder / "runs" / f"seed-{seed}").iterdir()
        }
    assert main(["rerun", str(folder / "runs" / "seed-5")]) == 0
    assert {"summary.md", "table.csv", "report.html"} <= {path.name for path in folder.iterdir()}
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert main(["report", str(folder), "--out", "again.html"]) == 0
    assert Path("again.html").read_text(encoding="utf-8") == page
    assert "seed 5: run " in page and 'href="runs' not in page
    assert "Genie (DG) is better than remote (R)" in page
    assert "95 % intervals" in (folder / "figures" / "latency_cdf.svg").read_text(encoding="utf-8")
    assert "Seeds 2, 5, 9: means" in (folder / "summary.md").read_text(encoding="utf-8")
    capsys.readouterr()


def test_two_processes_give_the_same_bytes_and_skip_finished_runs(
    folder, tmp_path, monkeypatch, capsys
):
    run = [*RUN, "--no-report", "--out", str(tmp_path)]
    assert main([*run, "--seeds", "5,2", "--jobs", "2"]) == 0
    (other,) = tmp_path.iterdir()
    assert other.name == folder.name, "seeds do not decide what the folder is called"
    written = (other / "runs" / "seed-2" / "run.json").stat().st_mtime_ns
    assert main([*run, "--seeds", "2,5,9", "--jobs", "2"]) == 0
    assert (other / "runs" / "seed-2" / "run.json").stat().st_mtime_ns == written
    for name in ("summary.md", "table.csv", "runs.parquet"):
        assert (other / name).read_bytes() == (folder / name).read_bytes(), name

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("nothing is missing")

    monkeypatch.setattr("genie_sim.runs.simulate.simulate", refuse)
    monkeypatch.setattr("genie_sim.study.work.simulate", refuse)
    assert main([*run, "--seeds", "2,5,9", "--jobs", "1"]) == 0


def test_a_run_whose_results_were_lost_is_run_again(folder, tmp_path, capsys):
    import shutil

    out = tmp_path / "out"
    shutil.copytree(folder, out / folder.name)
    shutil.rmtree(out / folder.name / "runs" / "seed-5")
    with pytest.raises(UserError, match=r"seed-5: missing; the study is not finished"):
        kinds.load(out / folder.name)
    line = [*RUN, "--seeds", "2,5,9", "--jobs", "1", "--no-report", "--out", str(out)]
    assert main(line) == 0
    assert seeds_of(out / folder.name).seeds == [2, 5, 9]
    capsys.readouterr()


@pytest.fixture
def without_pages(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pages of single runs take most of the time of short ones."""
    monkeypatch.setattr("genie_sim.report.pages.of_run", lambda *_: "")


@pytest.mark.usefixtures("without_pages")
def test_a_label_is_what_tables_figures_and_pages_say(folder, tmp_path, capsys):
    label = "two seconds of Karlsruhe"
    arguments = [*RUN, "--seeds", "2,5,9", "--jobs", "1", "--label", label, "--out"]
    import shutil

    shutil.copytree(folder, tmp_path / folder.name)
    assert main([*arguments, str(tmp_path)]) == 0
    assert f"{label} (street_1car_hetero): 1 car" in capsys.readouterr().out
    runs = seeds_of(tmp_path / folder.name)
    assert runs.title == label and runs.footer.startswith(
        f"{label}, street_1car_hetero, seeds 2, 5, 9"
    )
    assert label in (tmp_path / folder.name / "report.html").read_text(encoding="utf-8")
    one = tmp_path / "one"
    single = [*RUN, "--seed", "2", "--label", label, "--no-report"]
    assert main([*single, "--out", str(one)]) == 0
    (single,) = one.iterdir()
    assert kinds.load(single).title == label
    assert json.loads((single / "run.json").read_text())["label"] == label
    assert main(["rerun", str(single)]) == 0
    unlabelled = folder / "runs" / "seed-2"
    capsys.readouterr()
    assert main(["compare", str(unlabelled), str(folder), "--label", "a"]) == 1
    assert "the same run is given twice" in capsys.readouterr().err


def test_comparing_takes_folders_of_seeds_methods_and_labels_as_lists(folder, tmp_path, capsys):
    slower = ["--set", "edges[0].device=agx_xavier"]
    arguments = [*RUN, *slower, "--seeds", "2,5,9", "--jobs", "1", "--no-report", "--out"]
    assert main([*arguments, str(tmp_path)]) == 0
    (other,) = tmp_path.iterdir()
    assert not (other / "report.html").exists() and not list(other.glob("runs/*/report.html"))
    capsys.readouterr()
    command = ["compare", str(folder), str(other)]
    assert (
        main([*command, "--methods", "remote", "--label", "server", "--label", "car computer"]) == 0
    )
    out = capsys.readouterr().out
    assert "car computer: remote (R) is worse than server: remote (R) in first answer, mean" in out
    assert "over 3 seeds" in out and "edges[0].device" in out and "Genie" not in out
    assert main([*command, "--label", "same", "--label", "same"]) == 1
    assert "two settings have the same label" in capsys.readouterr().err
    assert main([*command, "--label=a", "--label=b", "--label=c"]) == 1
    assert "3 labels for 2 settings" in capsys.readouterr().err


@pytest.mark.usefixtures("without_pages")
def test_a_sweep_without_axes_is_the_same_and_takes_seeds_and_methods(folder, tmp_path, capsys):
    text = """
scenario: street_1car_hetero
set: {"cars[0].route.window": [0 s, 1 s], methods: [remote, genie]}
seeds: [2, 5, 9]
"""
    path = tmp_path / "plain.yaml"
    path.write_text(text)
    assert main(["sweep", str(path), "--out", str(tmp_path), "--jobs", "1"]) == 0
    assert is_seeds_folder(tmp_path / "plain")
    assert (tmp_path / "plain" / "summary.md").read_bytes() == (folder / "summary.md").read_bytes()
    assert main(["table", str(tmp_path / "plain"), "--format", "csv"]) == 0
    sweep = ["sweep", str(path), "--out", str(tmp_path), "--jobs", "1"]
    assert main([*sweep, "--seeds", "1", "--methods", "remote"]) == 0
    (other,) = tmp_path.glob("plain-*")
    assert seeds_of(tmp_path / "plain").seeds == [2, 5, 9], "nothing is overwritten"
    runs = seeds_of(other)
    assert runs.seeds == [1] and [method.name for method in runs.methods] == ["remote"]
    capsys.readouterr()


@pytest.mark.parametrize(
    "arguments, message",
    [
        (["--seeds", "0"], "--seeds: '0': expected how many, such as 5, or which, such as 3,7"),
        (["--seeds", "a"], "--seeds: 'a': expected how many"),
        (["--seeds", "1,,2"], "--seeds: '1,,2': expected how many"),
        (["--seeds", "1,1"], "street_1car_hetero: seeds: the seed 1 comes twice"),
        (["--seeds", "2", "--seed", "3"], "--seed and --seeds: give one of them"),
        (["--label", "a\nb"], "--label: must be one line of at most 60 characters"),
        (["--methods", "remote,"], "--methods: 'remote,': expected names with commas"),
    ],
)
def test_a_mistake_gets_one_line_and_nothing_is_run(arguments, message, tmp_path, capsys):
    assert main([*RUN, *arguments, "--out", str(tmp_path / "out")]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert message in line
    assert not (tmp_path / "out").exists()


def test_a_folder_that_somebody_sent_is_refused_in_one_line(tmp_path):
    (tmp_path / "sweep.json").write_text('{"format": 7, "sweep": {"axes": {}, "seeds": "../../x"}}')
    with pytest.raises(UserError, match="seeds: missing, or not a list of whole numbers"):
        kinds.load(tmp_path)
    (tmp_path / "sweep.json").write_text("[]")
    with pytest.raises(UserError, match="not what a sweep says of itself"):
        kinds.load(tmp_path)


def test_seeds_are_written_as_they_are_read():
    assert seeds_text([7]) == "seed 7"
    assert seeds_text([1, 2]) == "seeds 1, 2"
    assert seeds_text([1, 2, 3, 4]) == "seeds 1 to 4"
    assert seeds_text([1, 2, 4]) == "seeds 1, 2, 4"


def test_a_table_has_only_the_methods_that_are_asked_for(folder, capsys):
    command = ["table", str(folder), "--methods", "genie,remote"]
    assert main(command) == 0
    heading = capsys.readouterr().out.splitlines()[0]
    assert heading.startswith("| | Genie (DG) | remote (R) |") and "local" not in heading
    assert main([*command, "--format", "latex"]) == 0
    latex = capsys.readouterr().out
    assert "Genie (DG)" in latex and "local (L)" not in latex
    assert main(["table", str(folder), "--methods", "geni"]) == 1
    assert "unknown method 'geni' (did you mean 'genie'?)" in capsys.readouterr().err


def test_figures_of_several_seeds_have_the_differences_in_any_width(folder, tmp_path):
    command = ["figures", str(folder), "--width", "acm-column", "--out", str(tmp_path)]
    assert main([*command, "--only", "differences", "--format", "pdf"]) == 0
    page = (tmp_path / "differences.pdf").read_bytes()
    width_points = float(re.search(rb"/MediaBox \[ *0 0 ([\d.]+)", page)[1])
    assert width_points == pytest.approx(72 * 3.33, abs=0.1)


def test_figures_and_table_of_two_results_compare_them(folder, tmp_path, capsys):
    runs = [str(folder / "runs" / f"seed-{seed}") for seed in (2, 5)]
    one = runs[0]
    for folders, notes in ((runs, "No intervals of fewer than 3 seeds"), ([one], "inside the run")):
        capsys.readouterr()
        assert main(["table", *folders, "--format", "latex"]) == 0
        assert notes in capsys.readouterr().out
    assert main(["figures", one, one]) == 1
    assert "--out" in capsys.readouterr().err
    assert main(["figures", one, one, "--out", str(tmp_path / "same")]) == 1
    assert "given twice" in capsys.readouterr().err
