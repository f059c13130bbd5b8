"""Old names of commands, options and settings are answered with what to write instead."""

import importlib.util
from pathlib import Path

import pytest

from genie_sim.base import plugins, removed
from genie_sim.base.errors import UserError
from genie_sim.cli.main import app, main
from genie_sim.scenario.reading import read_scenario
from genie_sim.scenario.scenario import Scenario
from genie_sim.scenario.setting_paths import setting_paths
from genie_sim.study.design import read_design

CARS = {
    "name": "mine",
    "cars": [{"name": "car1", "device": "jetson_tx2", "edge": "edge1", "route": {}}],
    "edges": [{"name": "edge1", "device": "agx_xavier"}],
}
INSTEAD = "Write 'genie-sim new'."


def test_a_removed_command_is_answered_with_what_to_write_instead(monkeypatch, capsys):
    monkeypatch.setitem(removed.NAMES, "command old", INSTEAD)
    assert main(["old", "folder"]) == 2
    assert "unknown command 'old', which was removed. " + INSTEAD[:-1] in capsys.readouterr().err


@pytest.mark.parametrize(
    ("entry", "line"),
    [("run --old", ["run", "street_3car_hetero", "--old", "5"]), ("--old", ["--old", "run"])],
)
def test_a_removed_option_is_answered_with_what_to_write_instead(entry, line, monkeypatch, capsys):
    monkeypatch.setitem(removed.OPTIONS, entry, INSTEAD)
    assert main(line) == 2
    assert "No such option '--old', which was removed. " + INSTEAD[:-1] in capsys.readouterr().err


def test_an_option_that_another_command_had_is_only_unknown(monkeypatch, capsys):
    monkeypatch.setitem(removed.OPTIONS, "run --old", INSTEAD)
    assert main(["rerun", "--old"]) == 2
    assert "removed" not in capsys.readouterr().err


@pytest.mark.parametrize(
    ("entry", "data", "path"),
    [
        ("old", {"old": 1}, "old"),
        ("genie.old", {"genie": {"old": 1}}, "genie.old"),
        (
            "genie.old",
            {"methods": [{"method": "genie", "genie": {"old": 1}}]},
            "methods[0].genie.old",
        ),
        ("cars.old", {"cars": [{**CARS["cars"][0], "old": 1}]}, "cars[0].old"),
    ],
)
def test_a_removed_setting_is_answered_with_what_to_write_instead(entry, data, path, monkeypatch):
    monkeypatch.setitem(removed.SETTINGS, entry, INSTEAD)
    with pytest.raises(UserError) as error:
        read_scenario(CARS | data, where="mine.yaml")
    assert str(error.value) == f"mine.yaml: {path}: was removed. {INSTEAD}"


def test_a_removed_name_in_a_list_is_answered_with_what_to_write_instead(monkeypatch):
    monkeypatch.setitem(removed.NAMES, "record old", INSTEAD)
    with pytest.raises(UserError) as error:
        read_scenario(CARS | {"record": ["looks", "old"]}, where="mine.yaml")
    assert str(error.value) == (
        f"mine.yaml: record[1]: unknown record 'old', which was removed. {INSTEAD}"
    )


def test_a_removed_key_of_a_sweep_is_answered_with_what_to_write_instead(monkeypatch):
    monkeypatch.setitem(removed.SETTINGS, "axes.*.old", INSTEAD)
    data = {"name": "mine", "scenario": "street_3car_hetero", "axes": {"seeds": {"old": "seed"}}}
    with pytest.raises(UserError, match=r"mine\.yaml: axes\.seeds\.old: was removed\. Write"):
        read_design(data, "mine.yaml")


def test_every_entry_is_a_sentence():
    for table in (removed.NAMES, removed.OPTIONS, removed.SETTINGS):
        for name, sentence in table.items():
            assert sentence[0].isupper(), name
            assert sentence.endswith("."), name
            assert "\n" not in sentence, name


def test_no_entry_is_still_there():
    commands = {f"command {name}" for name in app.commands}
    options = {
        f"{name} {option}".strip()
        for name, command in [("", app), *app.commands.items()]
        for parameter in command.params
        for option in parameter.opts
    }
    assert not commands & set(removed.NAMES)
    assert not options & set(removed.OPTIONS)
    assert not {path.replace("[0]", "") for path in setting_paths(Scenario)} & set(removed.SETTINGS)


def test_own_code_that_imports_a_module_by_its_old_name_is_told_the_new_one(monkeypatch):
    monkeypatch.syspath_prepend("")
    Path("mine.py").write_text("from genie_sim.messages import Image\n")
    now = r"^method 'mine:Mine': genie_sim.messages is genie_sim.core.messages now\.$"
    with pytest.raises(UserError, match=now):
        plugins.resolve("method", "mine:Mine", {})
    for name, new in removed.MODULES.items():
        assert importlib.util.find_spec(f"genie_sim.{name}") is None, name
        assert importlib.util.find_spec(new) is not None, new
