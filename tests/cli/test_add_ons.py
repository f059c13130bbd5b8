"""Commands, importers and exporters that other packages add through entry points."""

from __future__ import annotations

from pathlib import Path

import pytest

from genie_sim.base import add_ons
from genie_sim.base.errors import UserError
from genie_sim.cli.main import main

PACKAGE = """
import click

@click.command()
def wave() -> None:
    "Wave to whoever looks."
    click.echo("waves")
"""
ENTRY_POINTS = """
[genie_sim.commands]
wave = waving:wave
absent = waving:absent
[genie_sim.importers]
wave = waving:wave
"""


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A package that adds the command ``wave`` and the importer of this name."""
    (tmp_path / "waving.py").write_text(PACKAGE)
    info = tmp_path / "waving-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: waving\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(ENTRY_POINTS)
    monkeypatch.syspath_prepend(tmp_path)


def test_a_command_of_an_installed_package_is_found_by_its_name(installed, capsys):
    assert main(["wave"]) == 0 and main(["import", "wave"]) == 0
    assert capsys.readouterr().out == "waves\nwaves\n"


def test_the_list_of_importers_has_those_of_installed_packages(installed, capsys):
    assert main(["import", "--help"]) == 0
    assert "wave" in capsys.readouterr().out


def test_an_add_on_that_cannot_be_imported_is_named_in_one_line(installed, capsys):
    assert main(["absent"]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert "absent" in line and "waving:absent" in line


@pytest.mark.parametrize("line", ["ros attach /node", "import bag street.bag"])
def test_without_the_add_on_for_ros_it_is_said_what_to_install(line, capsys, monkeypatch):
    monkeypatch.setattr("importlib.metadata.entry_points", lambda **_: ())
    assert main(line.split()) == 1
    (said,) = capsys.readouterr().err.splitlines()
    assert add_ons.INSTALL_ROS in said
    with pytest.raises(UserError, match=r"mcap: .*packages/genie-sim-ros"):
        add_ons.offered(add_ons.EXPORTERS, "mcap")


def test_help_and_known_commands_read_no_entry_points(capsys, monkeypatch):
    """They are slow to read."""
    monkeypatch.setattr("importlib.metadata.entry_points", lambda **_: pytest.fail("are read"))
    assert main(["--help"]) == 0 and main(["list", "methods"]) == 0
