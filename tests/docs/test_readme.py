"""The README does what it says: its commands are run, and what it shows of their output is what
they print.

A ``bash`` block is run as one script. In a ``console`` block each ``$ command`` (continued after a
backslash) is run, and the lines below it are compared with its output: a line ``...`` stands for
any number of lines, ``...`` within a line for any text, such as a time. A comment ``<!-- not run:
reason -->`` above a block leaves it out. Blocks share one folder and are run from top to bottom.
"""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import pytest

from tests import tiers
from tests.checkout import copied
from tests.docs.blocks import matches, script, session

REPOSITORY = Path(__file__).resolve().parents[2]
README = REPOSITORY / "README.md"
FOLDERS = ("scenarios", "device_profiles")  # what a command of the README may read of the checkout
LONGEST_BLOCK_S = 300


@dataclass(frozen=True)
class Block:
    """One fenced block: its language, the number of its first line, its lines, and why it is not
    run (or None).
    """

    language: str
    line: int
    lines: tuple[str, ...]
    not_run: str | None

    def __str__(self) -> str:
        return f"line {self.line}"


def blocks(text: str) -> list[Block]:
    """The ``bash`` and ``console`` blocks of a Markdown text."""
    found = []
    lines = iter(enumerate(text.splitlines(), start=1))
    not_run = None
    for number, line in lines:
        if comment := re.fullmatch(r"<!-- not run: (.+) -->", line.strip()):
            not_run = comment[1]
        elif fence := re.fullmatch(r"```(\w*)", line.strip()):
            inside = []
            for _, content in lines:
                if content.strip() == "```":
                    break
                inside.append(content)
            if fence[1] in ("bash", "console"):
                found.append(Block(fence[1], number + 1, tuple(inside), not_run))
            not_run = None
        elif line.strip():
            not_run = None
    return found


BLOCKS = blocks(README.read_text(encoding="utf-8")) if README.exists() else []


@pytest.fixture(scope="module")
def reader(tmp_path_factory: pytest.TempPathFactory):
    """Runs a command as a reader would: ``genie-sim`` and ``python`` on the path, in a folder of
    its own.
    """
    root = tmp_path_factory.mktemp("readme")
    work, path = root / "work", root / "bin"
    for folder in FOLDERS:
        copied(REPOSITORY / folder, work / folder)
    path.mkdir()
    for name, arguments in (("python", ""), ("genie-sim", " -m genie_sim")):
        (path / name).write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)}{arguments} "$@"\n')
        (path / name).chmod(0o755)
    env = {
        **os.environ,
        "PATH": f"{path}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": str(REPOSITORY),
        "COLUMNS": "100",
        "NO_COLOR": "1",
        "TERM": "dumb",
    }

    def run(commands: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            ["bash", "-euo", "pipefail", "-c", commands],
            cwd=work,
            env=env,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=LONGEST_BLOCK_S,
        )

    return run


@pytest.mark.process
@pytest.mark.slow
@pytest.mark.xdist_group("readme")
@pytest.mark.parametrize("block", [one for one in BLOCKS if not one.not_run], ids=str)
def test_a_block_does_what_it_shows(block: Block, reader, request: pytest.FixtureRequest):
    if "genie-sim perceive" in "\n".join(block.lines):
        request.getfixturevalue("kitti_root")
        request.getfixturevalue("weights_dir")
    if block.language == "bash":
        ran = reader(script(block.lines))
        assert ran.returncode == 0, f"README.md:{block.line}:\n{ran.stdout}"
        return
    for command, shown in session(block.lines):
        ran = reader(command)
        an_error_is_shown = any(line.startswith("genie-sim: ") for line in shown)
        assert ran.returncode == (1 if an_error_is_shown else 0), (
            f"README.md:{block.line}: {command}:\n{ran.stdout}"
        )
        assert matches(shown, ran.stdout), (
            f"README.md:{block.line}: {command} prints:\n{ran.stdout}"
        )


def test_the_readme_shows_commands_and_what_they_print():
    assert README.exists(), "README.md is missing"
    runnable = [block for block in BLOCKS if not block.not_run]
    assert any(
        "genie-sim run" in "\n".join(block.lines)
        for block in runnable
        if block.language == "console"
    )


def test_continuous_integration_runs_the_tests_as_the_readme_says():
    """Of the same packages, and the fast tests before all others."""
    said = README.read_text(encoding="utf-8")
    done = (REPOSITORY / ".ci" / "run").read_text(encoding="utf-8")
    assert "python -m pip install '.[test]' && python -m pytest" in said
    before, command, after = done.partition("\npython -m pytest ||")
    assert "\ninstall '.[test]'\n" in before and command
    assert "\ntask " not in before and "\ntask processes " in after and "rest ||" in after


def test_every_test_runs_once_but_for_nightly_ones():
    """With any of the tiers' marks a test is one of the fast ones, of the rest, or of processes."""
    tasks = (REPOSITORY / "noxfile.py").read_text(encoding="utf-8")
    runs = [tiers.FAST, *re.findall(r'^(?:REST|PROCESSES) = "(.*)"$', tasks, re.MULTILINE)]
    names = re.findall(r"\w+", tiers.FAST.removeprefix("not ").replace(" or ", " "))
    for marks in product((False, True), repeat=len(names)):
        marked = dict(zip(names, marks, strict=True))
        times = sum(eval(run, {}, marked) for run in runs)
        assert times == (not marked["nightly"]), marked
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
```console
$ genie-sim run town \\
    --seed 7
method  answered
genie   ...  of 617

...
Results: out
$ genie-sim list towns
```
<!-- not run: downloads 40 MB -->

```bash
genie-sim import fetch model yolox_nano
```
```python
print("not a command")
```
```bash
python -m pip install \\
    '.[test]' && genie-sim list links
genie-sim list devices
```
"""


def test_blocks_are_found_with_the_reason_not_to_run_them():
    console, download, install = blocks(EXAMPLE)
    assert (console.language, console.line, console.not_run) == ("console", 3, None)
    assert download.not_run == "downloads 40 MB"
    assert install.not_run is None
    assert script(install.lines) == "genie-sim list links\ngenie-sim list devices"


def test_a_console_block_is_commands_and_their_output():
    (run, shown), (listing, nothing) = session(blocks(EXAMPLE)[0].lines)
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
    (_, shown), _ = session(blocks(EXAMPLE)[0].lines)
    assert matches(shown, printed) is same


def test_a_command_shown_without_output_prints_nothing():
    assert matches([], "\n")
    assert not matches([], "surprise\n")


@pytest.mark.slow
def test_the_first_experiment_in_python_runs_as_it_stands(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (code,) = re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)
    assert 12 <= len([line for line in code.splitlines() if line]) <= 18
    exec(compile(code, "README.md", "exec"), {})
    told = capsys.readouterr().out
    links = [line.split()[0] for line in told.splitlines() if " remote " in line]
    assert links == ["ideal", "ethernet_1g", "wifi", "nr5g"]
    assert (tmp_path / "cdf.pdf").exists() and (tmp_path / "report.html").exists()
