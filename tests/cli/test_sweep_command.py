"""``genie-sim sweep`` of a scenario along axes that the command line names."""

from __future__ import annotations

from pathlib import Path

import pytest

from genie_sim.cli.main import main
from genie_sim.study.design import named_axes

SHORT = ["--set", "cars[0].route.window=[0 s, 0.3 s]", "--jobs", "1"]
SWEEP = ["sweep", "street_1car_homo", "--axis", "genie.eviction=lru,lfu", *SHORT]


def only_folder() -> Path:
    (folder,) = Path("results").iterdir()
    return folder


@pytest.mark.slow
@pytest.mark.usefixtures("without_figures")
def test_a_sweep_without_a_file_goes_on_where_it_was(capsys):
    command = [*SWEEP, "--seeds", "2", "--methods", "genie"]
    assert main(command) == 0
    assert capsys.readouterr().out.startswith("2 points, 4 runs\n")
    table = (only_folder() / "table.parquet").read_bytes()
    parts = {path.name: path.stat().st_mtime_ns for path in only_folder().glob("parts/*")}
    assert len(parts) == 4 and main(command) == 0
    assert (only_folder() / "table.parquet").read_bytes() == table
    again = {path.name: path.stat().st_mtime_ns for path in only_folder().glob("parts/*")}
    assert again == parts, "nothing ran again"


@pytest.mark.slow
@pytest.mark.usefixtures("without_figures")
def test_more_seeds_go_into_the_same_folder_and_other_settings_into_another(capsys):
    assert main([*SWEEP, "--seeds", "1", "--methods", "local"]) == 0
    folder = only_folder()
    assert main([*SWEEP, "--seeds", "2", "--methods", "local"]) == 0
    assert only_folder() == folder
    other = ["--set", "spread=loaded"]
    assert main([*SWEEP, *other, "--seeds", "1", "--methods", "local"]) == 0
    assert len(list(Path("results").iterdir())) == 2


def test_a_sweep_file_takes_settings_too(capsys):
    Path("s.yaml").write_text(
        "scenario: street_1car_homo\naxes: {e: {set: genie.eviction, list: [lru]}}\nseeds: 1\n"
    )
    assert main(["sweep", "s.yaml", *SHORT, "--set", "genie.eviction=lfu"]) == 1
    assert "genie.eviction would undo genie.eviction, set by 'set'" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "place"),
    [
        (["--axis", "fleet.cars"], "--axis fleet.cars: "),
        (["--axis", "genie.eviction="], "--axis genie.eviction=: "),
        (["--axis", "seed=1,2"], "--axis seed=1,2: "),
        (["--axis", "genie.pases=1"], "genie.pases: unknown"),
        (["--axis", "link=lte"], "did you mean 'fleet.link'"),
        (["--axis", "cars[0].link=[lte"], "--axis cars[0].link=[lte: line 1: "),
        (["--axis", "cars[0].link=lte,let"], "unknown link 'let'"),
        (["--axis", "spread=a", "--axis", "spread=b"], "--axis spread=b: "),
        ([], "say what varies"),
        (["--axis", "spread=isolated", "--out", ""], "--out: "),
    ],
)
def test_an_axis_that_cannot_be_gets_one_line(arguments, place, capsys):
    assert main(["sweep", "street_1car_homo", *arguments]) == 1
    said = capsys.readouterr().err
    assert place in said and said.count("\n") == 1
    assert not Path("results").exists()


def test_a_scenario_file_is_no_sweep(capsys):
    Path("s.yaml").write_text("cars: []\n")
    assert main(["sweep", "s.yaml"]) == 1
    assert "s.yaml is a scenario: say what varies" in capsys.readouterr().err


def test_axes_along_lists_have_names_of_their_own():
    along = {"cars[0].link": ["lte"], "cars[1].link": ["lte"], "genie.eviction": ["lru"]}
    assert list(named_axes(along)) == ["cars_0_link", "cars_1_link", "eviction"]
    named = {"eviction": {"set": "spread", "list": ["loaded"]}, "genie.eviction": ["lru"]}
    assert list(named_axes(named)) == ["eviction", "genie_eviction"]
    assert list(named_axes({"cars[0].method": ["genie"]})) == ["cars_0_method"]
