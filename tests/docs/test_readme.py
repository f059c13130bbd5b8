"""What the README says of tests and links, and how blocks of commands are read."""

from __future__ import annotations

import re
import tomllib
from itertools import product
from pathlib import Path

import pytest

from tests import tiers
from tests.docs.blocks import matches, script, session

REPOSITORY = Path(__file__).resolve().parents[2]
README = REPOSITORY / "README.md"


def test_continuous_integration_runs_the_tests_as_the_readme_says():
    """Of the same packages, and the fast tests before all others."""
    said = README.read_text(encoding="utf-8")
    done = (REPOSITORY / ".ci" / "run").read_text(encoding="utf-8")
    assert "python -m pip install '.[test]' && python -m pytest" in said
    before, command, after = done.partition("\npython -m pytest ||")
    assert "\npython -m pip install --quiet '.[test]'\n" in before and command
    assert "\ntask ros " in after and "\ntask rest " in after


def test_every_test_runs_once_but_for_nightly_ones():
    """With any of the tiers' marks a test is one of the fast ones or of the rest. Those of ROS are
    the add-on's, all of whose tests run.
    """
    tasks = (REPOSITORY / "noxfile.py").read_text(encoding="utf-8")
    runs = [tiers.FAST, *re.findall(r'^REST = "(.*)"$', tasks, re.MULTILINE)]
    names = re.findall(r"\w+", tiers.FAST.removeprefix("not ").replace(" or ", " "))
    for marks in product((False, True), repeat=len(names)):
        marked = dict(zip(names, marks, strict=True))
        times = sum(eval(run, {}, marked) for run in runs)
        assert times == (not marked["nightly"] and not marked["ros"]), marked
    options = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))
    assert tiers.FAST in options["tool"]["pytest"]["ini_options"]["addopts"]


@pytest.mark.parametrize("page", ["README.md", "CONTRIBUTING.md", "CHANGELOG.md"])
def test_links_lead_somewhere(page: str):
    text = (REPOSITORY / page).read_text(encoding="utf-8")
    targets = [target.partition("#")[0] for target in re.findall(r"\]\(([^)\s]+)\)", text)]
    broken = [
        target
        for target in targets
        if target and "://" not in target and not (REPOSITORY / target).exists()
    ]
    assert not broken


EXAMPLE = """
$ genie-sim run town \\
    --seed 7
method  answered
genie   ...  of 617

...
Results: out
$ genie-sim list towns
"""
INSTALL = """
python -m pip install \\
    '.[test]' && genie-sim list links
genie-sim list devices
"""


def shown_lines() -> list[tuple[str, list[str]]]:
    return session(tuple(EXAMPLE.strip().splitlines()))


def test_what_sets_the_project_up_is_not_run_again():
    lines = tuple(INSTALL.strip().splitlines())
    assert script(lines) == "genie-sim list links\ngenie-sim list devices"


def test_a_console_block_is_commands_and_their_output():
    (run, shown), (listing, nothing) = shown_lines()
    assert run.split() == ["genie-sim", "run", "town", "--seed", "7"]
    assert shown[0] == "method  answered"
    assert (listing, nothing) == ("genie-sim list towns", [])


@pytest.mark.parametrize(
    ("printed", "same"),
    [
        ("method  answered\ngenie   98.7 %  of 617\n\nResults: out\n", True),
        ("method  answered  \ngenie   1  of 617\n\nany\nlines\nResults: out", True),
        ("method  answered\ngenie   98.7 %  of 616\n\nResults: out\n", False),
        ("method  answered\ngenie   98.7 %  of 617\n\nResults: out\nWarning: more\n", False),
        ("", False),
    ],
)
def test_output_is_compared_line_by_line(printed: str, same: bool):
    (_, shown), _ = shown_lines()
    assert matches(shown, printed) is same


def test_a_command_shown_without_output_prints_nothing():
    assert matches([], "\n")
    assert not matches([], "surprise\n")
