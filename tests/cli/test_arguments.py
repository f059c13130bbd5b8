"""Arguments with a syntax of their own: what is read, and what is refused in one line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
import pytest

from genie_sim.base import plugins
from genie_sim.base.errors import UserError
from genie_sim.cli import arguments
from genie_sim.cli.main import main

READ = {
    arguments.width_height: {
        None: None,
        "832x256": (832, 256),
        "832": "expected WIDTHxHEIGHT in pixels, for example 832x256",
        "832x": "expected WIDTHxHEIGHT",
        "x256": "expected WIDTHxHEIGHT",
        "٨x٨": "expected WIDTHxHEIGHT",
    },
    arguments.geodetic: {
        None: None,
        "49.01,8.42,112.8": (49.01, 8.42, 112.8),
        "-90,-180,-10": (-90.0, -180.0, -10.0),
        "90,180,0": (90.0, 180.0, 0.0),
        "90.1,0,0": "latitude 90.1",
        "0,-180.1,0": "longitude -180.1",
        "nan,0,0": "latitude nan",
        "0,0,inf": "altitude inf",
        **dict.fromkeys(("0,0", "٤,0,0", "4_9,0,0"), "expected latitude, longitude and altitude"),
    },
    arguments.listed: {
        None: [],
        "a": ["a"],
        "a, b,c ": ["a", "b", "c"],
        "a,,b": "'a,,b': expected names with commas between them",
        "": "expected names",
    },
}


@pytest.mark.parametrize(
    ("read", "text", "expected"),
    [(read, text, value) for read, values in READ.items() for text, value in values.items()],
)
def test_an_option_is_read_or_its_line_says_what_it_should_be(read: Any, text: str, expected: Any):
    if isinstance(expected, str):
        with pytest.raises(UserError, match=r"^--option: ") as error:
            read("--option", text)
        assert expected in str(error.value)
    else:
        assert read("--option", text) == expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [(None, None), ("5", 5), ("3,", [3]), ("3, 7", [3, 7]), ("0,1", [0, 1])],
)
def test_one_number_is_how_many_seeds_and_several_are_these(text: str | None, expected: Any):
    assert arguments.seeds(text) == expected


@pytest.mark.parametrize("text", ["0", "", ",", "3,,7", "-1", "1.5", "1234567890"])
def test_seeds_that_cannot_be(text: str):
    with pytest.raises(UserError, match=r"^--seeds: .*: expected how many, such as 5, or which"):
        arguments.seeds(text)


def test_a_shard_is_one_of_so_many():
    assert arguments.shard("1/1") == (1, 1)
    assert arguments.shard("8/8") == (8, 8)
    for text in ("0/8", "9/8", "2", "2/", "/8", "a/b"):
        with pytest.raises(UserError, match=r"^--shard: "):
            arguments.shard(text)


def command(*options: Any) -> click.Command:
    """A command with these options, which returns what it is given."""

    def body(**given: Any) -> dict[str, Any]:
        return {**given, "own_code": plugins.is_own_code_allowed()}

    for option in options:
        body = option(body)
    return click.command()(body)


def given(asked: click.Command, *texts: str) -> dict[str, Any]:
    values: dict[str, Any] = asked.main(list(texts), standalone_mode=False)
    return values


def test_a_path_begins_at_home_and_holds_what_a_screen_can_show(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("HOME", "/home/somebody")
    asked = command(click.option("--out", type=arguments.PATH))
    assert given(asked, "--out=~/results")["out"] == Path("/home/somebody/results")
    for character in ("\n", "\x1f", "\x7f", "\ud800"):
        with pytest.raises(UserError, match=r"^--out: .* holds the character "):
            given(asked, f"--out=a{character}b")


def test_options_of_several_commands():
    """Their defaults; a count is at least 1; code of one's own is a choice of the command alone."""
    asked = command(
        arguments.seeds_option,
        arguments.label_option,
        arguments.jobs_option,
        arguments.own_code_option,
    )
    with plugins.own_code_allowed(allowed=False):
        usual = given(asked)
        chosen = given(asked, "--allow-own-code", "--jobs=1")
    assert usual == {
        "seeds": None,
        "label": "",
        "jobs": None,
        "own_code": False,
    }
    assert chosen["own_code"]
    assert chosen["jobs"] == 1
    with pytest.raises(click.BadParameter):
        given(asked, "--jobs=0")


@pytest.mark.parametrize(
    ("line", "option"),
    [
        ("perceive --check a --cameras 02", "--cameras"),
        ("profile --csv a.csv --runs 30 --out p.yaml", "--runs"),
        ("profile --detector yolox_nano --unit ms --out p.yaml", "--unit"),
        ("import link a.csv --direction up --out l.parquet", "--direction"),
        ("import tables a.csv b.csv --range 10m --out t", "--range"),
        ("show scenario --schema --kind device", "--kind"),
    ],
)
def test_an_option_without_effect_is_refused(line, option, capsys):
    assert main(line.split()) == 1
    error = capsys.readouterr().err
    assert f": {option}: has no effect with" in error and error.count("\n") == 1
