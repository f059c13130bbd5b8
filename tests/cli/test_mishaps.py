"""What goes wrong around the program: results that somebody changed, full disks, odd paths, readers
that go away.
"""

from __future__ import annotations

import errno
import os
import runpy
import shutil
import subprocess
import sys
import typing
from itertools import cycle
from pathlib import Path

import pytest

import genie_sim as gs
from genie_sim import __main__ as program
from genie_sim.base.errors import UserError
from genie_sim.base.paths import atomic_write
from genie_sim.cli.arguments import PATH
from genie_sim.cli.main import app, main
from genie_sim.scenario.checks import MAX_DAYS, check_time
from genie_sim.scenario.reading import load_scenario
from tests.checkout import REPOSITORY, sign

SHORT = {"cars[0].route.window": ["0 s", "1 s"], "methods": ["local", "genie"]}


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The result folder of a short run."""
    folder = gs.run("street_1car_homo", SHORT, out=tmp_path_factory.mktemp("results")).folder
    assert folder is not None
    return folder


@pytest.fixture
def folder(made: Path) -> Path:
    """A copy, to be spoilt."""
    return Path(shutil.copytree(made, "result"))


def one_line(said: str, message: str) -> None:
    assert message in said
    assert said.count("\n") == 1, said
    assert "Traceback" not in said


# Results that somebody changed, or that another version wrote


NO_RUNS = ("", "[]", "3", "{}", "\udc80", "[" * 100_000, '{"format": 1}')


@pytest.mark.parametrize(("text", "command"), [*zip(NO_RUNS, cycle(["report", "rerun"]))])
def test_a_run_json_that_is_none_gets_one_line(command, text, folder, capsys):
    (folder / "run.json").write_bytes(text.encode("utf-8", "surrogatepass"))
    assert main([command, str(folder)]) == 1
    one_line(capsys.readouterr().err, "result/run.json: ")


PARTS = ("frames.parquet", "poses.parquet", "metrics.json", "scenario.resolved.yaml")


@pytest.mark.parametrize(("name", "command"), [*zip(PARTS, cycle(["report", "table"]))])
def test_a_folder_or_nothing_in_the_place_of_a_file_gets_one_line(command, name, folder, capsys):
    (folder / name).unlink()
    assert main([command, str(folder)]) == 1
    one_line(capsys.readouterr().err, f"result/{name}: ")
    (folder / name).mkdir()
    assert main([command, str(folder)]) == 1
    one_line(capsys.readouterr().err, f"result/{name}: ")


def test_a_table_without_one_of_its_columns_is_told(folder, capsys):
    import pyarrow.parquet as pq

    path = folder / "frames.parquet"
    table = pq.ParquetFile(path).read()
    *kept, last = table.column_names
    pq.write_table(table.select(kept), path)
    sign(folder)
    assert main(["report", str(folder)]) == 1
    one_line(capsys.readouterr().err, f"frames.parquet: column {last}: missing, or not ")


# Paths


def test_every_path_is_taken_in_one_way():
    """``~`` and what cannot be shown are dealt with in ``arguments``, for every option and
    argument.
    """
    found = 0
    for command in app.commands.values():
        for name, hint in typing.get_type_hints(command.callback).items():
            if Path in (hint, *typing.get_args(hint)):
                (about,) = (one for one in command.params if one.name == name)
                assert about.type is PATH, f"{command.name}: {name}"
                found += 1
    assert found >= 19


@pytest.mark.parametrize(
    "arguments",
    [
        ["report", "~/nothing"],
        ["rerun", "~/nothing"],
        ["export", "~/nothing"],
        ["run", "~/nothing.yaml"],
        ["sweep", "~/nothing.yaml"],
        ["profile", "--out=~/p.yaml", "--csv=~/nothing.csv"],
        ["perceive", "--drive=2011_09_26/0005", "--kitti=~/nothing", "--out=~/t.parquet"],
    ],
    ids=lambda arguments: " ".join(arguments[:2]),
)
def test_home_is_found_wherever_a_path_may_stand(arguments, capsys, monkeypatch):
    monkeypatch.setenv("HOME", str(Path("home").absolute()))
    monkeypatch.setenv("GENIE_SIM_WEIGHTS", os.environ.get("GENIE_SIM_WEIGHTS", "~/nothing"))
    Path("~").mkdir()
    assert main(arguments) == 1
    said = capsys.readouterr().err
    one_line(said, "nothing")
    assert str(Path("home").absolute()) in said or "~/nothing.yaml: no such file" in said
    assert not list(Path("~").iterdir())


@pytest.mark.parametrize("variable", ["GENIE_SIM_KITTI", "GENIE_SIM_WEIGHTS"])
def test_home_is_found_in_the_environment(variable, capsys, monkeypatch):
    monkeypatch.setenv("HOME", "/somebodys/home")
    for name in ("GENIE_SIM_KITTI", "GENIE_SIM_WEIGHTS"):
        monkeypatch.setenv(name, "~/data")
    other = ["--kitti=."] if variable == "GENIE_SIM_WEIGHTS" else ["--weights=."]
    assert main(["perceive", "--drive=2011_09_26/0005", "--out=t.parquet", *other]) == 1
    assert "~" not in capsys.readouterr().err


@pytest.mark.slow
def test_the_library_finds_home_too(monkeypatch):
    monkeypatch.setenv("HOME", str(Path("home").absolute()))
    run = gs.run("street_1car_homo", SHORT, out="~/lab", report=False)
    assert run.folder.is_relative_to(Path("home").absolute())
    assert gs.load(f"~/lab/{run.folder.name}").report("~/page.html").is_file()
    assert not Path("~").exists()


@pytest.mark.parametrize("character", ["\udcff", "\n", "\x1b"])
def test_a_path_that_no_screen_can_show_gets_one_line(character, capsys):
    assert main(["run", "street_1car_homo", f"--out=a{character}b"]) == 1
    one_line(
        capsys.readouterr().err, f"--out: {f'a{character}b'!r} holds the character {character!r}"
    )
    assert not list(Path().iterdir())


@pytest.mark.slow
@pytest.mark.usefixtures("without_figures")
@pytest.mark.parametrize("name", ["s3://bucket", "a=1"])
def test_a_folder_may_be_called_like_an_address(name, made, capsys):
    """Nothing is looked up in a network, and nothing is read from elsewhere."""
    sweep = (
        "scenario: street_1car_homo\nset: {'cars[0].route.window': [0 s, 1 s], methods:"
        " [genie]}\nseeds: 1\n"
    )
    Path("s.yaml").write_text(sweep + "axes: {a: {set: genie.eviction, list: [lru, lfu]}}\n")
    assert main(["sweep", "s.yaml", "--jobs=1", "--out", name]) == 0
    folder = shutil.copytree(made, Path(name) / "run")
    for command in (
        ["report", str(folder)],
        ["rerun", str(folder)],
        ["table", str(Path(name) / "s")],
    ):
        assert main(command) == 0, capsys.readouterr().err


@pytest.mark.parametrize("command", ["compare", "figures", "table", "report", "rerun"])
def test_a_folder_that_no_screen_can_show_gets_one_line(command, capsys):
    assert main([command, "a\0b"]) == 1
    one_line(capsys.readouterr().err, "holds the character '\\x00'")


def test_whatever_a_name_holds_the_error_is_one_line(capsys):
    assert main(["run", "street_1car_homo", "--set", "a\n\x1b[31mb"]) == 1
    one_line(capsys.readouterr().err, "--set a\\n\\x1b[31mb: must be path=value")


@pytest.mark.parametrize("what", ["a folder", "no file"])
def test_only_a_file_is_replaced_by_a_file(what):
    """``--out=/dev/null`` would otherwise be the last of it, for a user who may rename there."""
    path = Path("there")
    path.mkdir() if what == "a folder" else os.mkfifo(path)
    with pytest.raises(UserError, match=f"there: cannot be written: {what}"), atomic_write(path):
        raise AssertionError("nothing is written")
    assert [one.name for one in Path().iterdir()] == ["there"]
    assert not path.is_file()


# Disks, screens, readers


@pytest.mark.process
@pytest.mark.skipif(not Path("/dev/full").is_char_device(), reason="needs /dev/full")
@pytest.mark.parametrize(
    "arguments",
    [["list"], ["--help"], ["show", "--schema", "scenario"], ["run", "--help"]],
    ids=" ".join,
)
def test_a_full_device_for_the_output_gets_one_line(arguments):
    with Path("/dev/full").open("w") as full:
        done = genie_sim(*arguments, stdout=full)
    assert done.returncode == 1
    assert done.stderr == "genie-sim: No space left on device\n"


@pytest.mark.process
def test_a_reader_that_goes_away_ends_it_quietly():
    reading, writing = os.pipe()
    os.close(reading)
    done = genie_sim("list", stdout=writing)
    os.close(writing)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.process
@pytest.mark.parametrize("closed", ["stdout", "stderr"])
def test_a_closed_output_is_no_reason_to_fail(closed):
    code = f"import sys; sys.{closed} = None; from genie_sim.cli.main import main; main(['list'])"
    done = genie_sim(code=code)
    assert done.returncode == 0
    assert done.stderr == ""


@pytest.mark.process
@pytest.mark.parametrize("backend", ["foo", "tkagg"])
def test_figures_need_no_window(backend):
    short = "--set=cars[0].route.window=[0 s, 1 s]"
    done = genie_sim(
        "run", "street_1car_homo", short, "--no-report", "--figures", MPLBACKEND=backend
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert list(Path("results").glob("*/figures/latency_cdf.svg"))


def genie_sim(
    *arguments: str, stdout: object = subprocess.PIPE, code: str = "", **env: str
) -> typing.Any:
    command = ["-c", code] if code else ["-m", "genie_sim", *arguments]
    surroundings = {**os.environ, "PYTHONPATH": str(REPOSITORY), **env}
    return subprocess.run(
        [sys.executable, *command],
        stdout=stdout,
        stderr=subprocess.PIPE,
        env=surroundings,
        text=True,
        timeout=120,
    )


# Time


@pytest.mark.parametrize(
    ("scenario", "setting"),
    [
        ("street_1car_homo", "cars[0].route.laps=999999999999999999"),
        ("street_1car_homo", "cars[0].route.start=2000000 h"),
        ("street_1car_homo", "start_jitter=2000000 h"),
        ("street_1car_homo", "cars[0].route={laps: 3, pause: 1000 h}"),
        ("street_1car_homo", "cameras=[{name: a, recording: '02', phase: 2000000 h}]"),
        ("fleet_30", "perception.duration=1000 h"),
        ("fleet_30", "start_jitter=2000000 h"),
    ],
)
def test_years_of_simulated_time_get_one_line(scenario, setting, capsys):
    assert main(["run", scenario, "--set", setting]) == 1
    one_line(capsys.readouterr().err, f"days; at most {MAX_DAYS} are simulated")
    assert not Path("results").exists()


def test_a_month_is_not_too_long():
    scenario = load_scenario("street_1car_homo", ["cars[0].route={laps: 2, pause: 719 h}"])
    check_time(scenario, "route", scenario.cars[0].route, 15 * 10**9)


def test_what_cannot_be_drawn_or_written_leaves_the_tables(monkeypatch, capsys, caplog):
    """A library's exception, and a disk that is full when the page is written."""

    def full(*_, **__):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def broken(*_):
        raise ZeroDivisionError("of a library")

    monkeypatch.setattr("genie_sim.report.pages.of_run", full)
    monkeypatch.setattr("genie_sim.analysis.figures.save_all", broken)
    line = ["run", "street_1car_homo", "--figures"]
    assert main([*line, "--set", "cars[0].route.window=[0 s, 1 s]"]) == 1
    (folder,) = Path("results").iterdir()
    said = capsys.readouterr().err.splitlines()
    kept = f"genie-sim: {folder}: the results are kept, but without figures, report.html"
    assert said[-1] == kept and len(gs.load(folder).metrics)
    told = [record.getMessage() for record in caplog.records]
    assert "figures: ZeroDivisionError: of a library" in told
    assert f"report.html: OSError: {OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))}" in told
    assert (folder / "summary.md").exists() and not (folder / "report.html").exists()
    monkeypatch.setattr("genie_sim.report.comparison.figures", broken)
    assert main(["compare", str(folder), "--out", "compared"]) == 1
    kept = "genie-sim: compared: the results are kept, but without figures\n"
    assert capsys.readouterr().err == kept
    assert {path.name for path in Path("compared").iterdir()} == {
        *("table.md", "table.csv", "table.tex", "compare.html")
    }


def test_ctrl_c_while_the_program_is_imported_ends_in_one_line(monkeypatch, capsys):
    class Interrupting:
        def find_spec(self, name: str, *_: object) -> None:
            if name == "genie_sim.cli.main":
                raise KeyboardInterrupt

    monkeypatch.delitem(sys.modules, "genie_sim.cli.main")
    monkeypatch.setattr(sys, "meta_path", [Interrupting(), *sys.meta_path])
    assert program.main() == 130
    assert capsys.readouterr().err == "genie-sim: interrupted; nothing was written\n"


@pytest.mark.parametrize("is_checkout", [True, False])
def test_nothing_is_imported_from_the_current_folder_but_the_checkout(
    is_checkout: bool, monkeypatch: pytest.MonkeyPatch
):
    path = [str(REPOSITORY if is_checkout else Path.cwd()), *sys.path]
    monkeypatch.setattr(sys, "path", [*path])
    monkeypatch.setattr(sys, "argv", ["genie-sim"])
    with pytest.raises(SystemExit):
        runpy.run_path(program.__file__, run_name="__main__")
    assert sys.path == path[not is_checkout :]


# Outputs and the files that are there


def latencies(path: Path) -> Path:
    path.write_text("latency_ms\n" + "".join(f"{20 + place % 7}.5\n" for place in range(40)))
    return path


def link_rates(path: Path) -> Path:
    path.write_text("time_s,up_mbps\n0,5\n1,6\n")
    return path


OUTPUTS = {
    "table": ("table", "result", "--out"),
    "table --format csv": ("table", "result", "--format", "csv", "--out"),
    "table --format latex": ("table", "result", "--format", "latex", "--out"),
    "report": ("report", "result", "--out"),
    "figures": ("figures", "result", "--only", "latency_cdf", "--out"),
    "import link": ("import", "link", "link.csv", "--out"),
    "profile": ("profile", "--csv", "latencies.csv", "--cores", "4", "--model", "mine", "--out"),
}


@pytest.mark.parametrize("command", OUTPUTS)
def test_an_output_replaces_nothing_but_its_own_kind(command, folder, capsys):
    """Neither an input, nor a file of a result, nor a text of the user's."""
    latencies(Path("latencies.csv")), link_rates(Path("link.csv"))
    Path("mine.txt").write_text("mine\n")
    kept = [*map(Path, ("latencies.csv", "link.csv", "mine.txt"))]
    kept += [folder / name for name in ("run.json", "summary.md", "frames.parquet")]
    before = {path: path.read_bytes() for path in kept}
    for path in before:
        if command == "figures":  # it is told its format by the ending
            path = Path(shutil.copy(path, f"{path.name}.svg"))
        assert main([*OUTPUTS[command], str(path)]) == 1
        one_line(capsys.readouterr().err, f"{path}: is there already")
    assert {path: path.read_bytes() for path in before} == before


@pytest.mark.parametrize(
    "command",
    [
        pytest.param(name, marks=pytest.mark.slow if name == "report" else ())
        for name in OUTPUTS
        if name != "profile"
    ],
)
def test_an_output_replaces_its_own_kind_and_an_empty_file(command, folder):
    link_rates(Path("link.csv"))
    Path("out.svg").touch()
    for _ in range(2):
        assert main([*OUTPUTS[command], "out.svg"]) == 0
        assert Path("out.svg").stat().st_size > 50


def test_a_profile_that_people_may_have_edited_is_not_replaced(tmp_path, capsys):
    latencies(Path("latencies.csv"))
    assert main([*OUTPUTS["profile"], "mine.yaml"]) == 0
    before = Path("mine.yaml").read_bytes()
    assert main([*OUTPUTS["profile"], "mine.yaml"]) == 1
    assert "mine.yaml: is there already" in capsys.readouterr().err
    assert Path("mine.yaml").read_bytes() == before


def test_a_comparison_leaves_the_tables_of_others_alone(folder, capsys):
    Path("out").mkdir()
    Path("out/table.csv").write_text("what,who\nmine,me\n")
    assert main(["compare", str(folder), "--out", "out"]) == 1
    assert "out/table.csv: is there already" in capsys.readouterr().err
    assert Path("out/table.csv").read_text() == "what,who\nmine,me\n"


@pytest.mark.parametrize("format", ["csv", "markdown"])
def test_a_table_for_a_program_stands_alone_on_the_screen(format, folder, monkeypatch, capsys):
    monkeypatch.setattr("genie_sim.report.comparison.figures", lambda *_: {})
    assert main(["compare", str(folder), "--format", format, "--out", "compared"]) == 0
    said = capsys.readouterr()
    assert ("Report: " in said.err) == (format == "csv") != ("Report: " in said.out)


@pytest.mark.parametrize("label", ["", "another"])
def test_a_summary_that_was_edited_is_kept_when_its_run_is_made_again(label, caplog):
    run = gs.run("street_1car_homo", SHORT, out="results", report=False)
    assert run.folder is not None
    summary = run.folder / "summary.md"
    as_written = summary.read_text(encoding="utf-8")
    summary.write_text(f"Mine.\n{as_written}", encoding="utf-8")
    gs.run("street_1car_homo", SHORT, out="results", report=False, label=label)
    (kept,) = run.folder.glob("summary.edited-*.md")
    assert kept.read_text(encoding="utf-8") == f"Mine.\n{as_written}"
    assert kept.name in caplog.text and "Mine." not in summary.read_text(encoding="utf-8")
    caplog.clear()
    gs.run("street_1car_homo", SHORT, out="results", report=False)
    assert [*run.folder.glob("summary.edited-*.md")] == [kept] and not caplog.text
