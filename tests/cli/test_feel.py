"""How the command line feels: where to begin, how it reads in any window, how soon it is there."""

from __future__ import annotations

import os
import re
import select
import struct
import subprocess
import sys
import time

import pytest

from genie_sim.cli import terminal
from genie_sim.cli.main import main
from tests.checkout import REPOSITORY

SHORT = ["run", "street_1car_hetero", "--set", "cars[0].route.window=[0 s, 2 s]", "--no-report"]
COMMAND = [sys.executable, "-m", "genie_sim"]
HEAVY = {
    "numpy",
    "pandas",
    "pyarrow",
    "matplotlib",
    "yaml",
    "simpy",
    "cv2",
    "onnxruntime",
    "scipy",
}


def on_a_terminal(*arguments: str, columns: int = 80, **env: str) -> str:
    """What ``genie-sim`` shows on a terminal of that width."""
    import fcntl
    import pty
    import termios

    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
    surroundings = {
        name: value
        for name, value in os.environ.items()
        if name not in ("COLUMNS", "NO_COLOR", "GENIE_SIM_PROGRESS")
    }
    shown = b""
    with subprocess.Popen(
        [*COMMAND, *arguments],
        stdin=theirs,
        stdout=theirs,
        stderr=theirs,
        env={**surroundings, "PYTHONPATH": str(REPOSITORY), "TERM": "xterm-256color", **env},
    ) as process:
        os.close(theirs)
        until = time.monotonic() + 120
        while time.monotonic() < until:
            if select.select([ours], [], [], 0.2)[0]:
                try:
                    part = os.read(ours, 1 << 16)
                except OSError:  # the terminal is gone with its last process
                    break
                if not part:
                    break
                shown += part
            elif process.poll() is not None:
                break
    os.close(ours)
    return shown.decode().replace("\r\n", "\n")


def plain(shown: str) -> str:
    return re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", shown)


def test_genie_sim_alone_shows_the_help(capsys):
    assert main([]) == 0
    assert capsys.readouterr().out.startswith("Usage: genie-sim")


def test_help_shows_three_examples_and_every_command(capsys):
    assert main(["--help"]) == 0
    usage, _, *lines = capsys.readouterr().out.splitlines()
    assert usage.startswith("Usage: genie-sim")
    assert [line.split()[0] for line in lines[:3]] == ["genie-sim"] * 3
    assert lines[3] == ""
    cut = [line for line in lines if line.endswith("...")]
    assert not cut, f"say it in fewer words: {cut}"


@pytest.mark.process
@pytest.mark.unix
@pytest.mark.parametrize("columns", [30, 80])
def test_every_screen_fits_its_window(columns):
    """Nothing but a command or a path, which cannot be broken, is wider. Help needs 50 columns, by
    its library.
    """
    for arguments in (["list"], ["--help"], ["run", "--help"]):
        room = max(columns, 50) if "--help" in arguments else columns
        for line in plain(on_a_terminal(*arguments, columns=columns)).splitlines():
            assert len(line) <= room or " --set " in line or len(line.split()) <= 3, (
                f"{arguments}: {line!r}"
            )


def test_a_list_has_one_line_a_name_for_other_programs(run_process):
    """Whatever the window: ``genie-sim list scenarios | grep``."""
    from genie_sim.base import files

    lines = run_process("list", "scenarios", env={"COLUMNS": "30"}).stdout.splitlines()
    assert [line.split()[0] for line in lines] == list(files.available(files.SCENARIO))


@pytest.mark.process
@pytest.mark.unix
def test_a_run_shows_its_simulated_seconds_on_a_terminal():
    shown = on_a_terminal(*SHORT, columns=100)
    bars = [line for line in re.split(r"[\r\n]", plain(shown)) if "frames/s" in line]
    assert bars
    words = r"[\d.]+ of [\d.]+ s of all methods, (local|remote|genie), [\d,]+ frames/s"
    assert re.search(words, bars[-1])
    assert max(map(len, bars)) <= 100
    assert "Results: results/street_1car_hetero-" in plain(shown)


def test_without_a_terminal_there_is_no_bar_and_no_colour(run_process):
    done = run_process(*SHORT)
    assert done.returncode == 0
    assert done.stderr == ""
    assert "\x1b" not in done.stdout
    assert "frames/s" not in done.stdout


def test_without_a_terminal_a_line_with_each_tenth_says_how_far_it_is(monkeypatch, capsys):
    monkeypatch.setenv("GENIE_SIM_PROGRESS", "off")
    with terminal.ProgressBar("s") as progress:
        progress(45.0, 90.0, "genie, 400 frames/s")
    assert capsys.readouterr().err == ""
    monkeypatch.delenv("GENIE_SIM_PROGRESS")
    monkeypatch.setattr(terminal, "LINE_EVERY_S", 0)
    with terminal.ProgressBar("s") as progress:
        for step in range(1001):
            progress(0.09 * step, 90.0, "genie, 400 frames/s")
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 9
    assert lines[0] == "genie-sim: 9.0 of 90.0 s, genie, 400 frames/s"


def test_show_gives_what_is_shipped(capsys):
    from genie_sim.base import files

    for name, kind in (("street_3car_hetero", files.SCENARIO), ("jetson_tx2", files.DEVICE)):
        text = files.find(kind, name).read_text(encoding="utf-8")
        assert main(["show", name]) == 0
        assert capsys.readouterr().out == text
    assert main(["list", "columns"]) == 0
    assert re.search(r"^frames\.bytes_down .* \[B\]$", capsys.readouterr().out, re.MULTILINE)
    assert main(["show", "baselines"]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert (
        line == "genie-sim: 'baselines' is a scenario and a sweep: say which with --kind scenario"
    )
    assert main(["show", "baselines", "--kind", "sweep"]) == 0
    assert "axes:" in capsys.readouterr().out
    assert main(["show", "3car_heter"]) == 1
    assert "did you mean '3car_hetero'?" in capsys.readouterr().err


@pytest.mark.process
@pytest.mark.unix
def test_colour_can_be_switched_off():
    shown = on_a_terminal(*SHORT, columns=100, NO_COLOR="1")
    assert "frames/s" in shown
    assert not re.search(r"\x1b\[[0-9;]*(3[0-7]|9[0-7]|38;[0-9;]*)m", shown)


@pytest.mark.parametrize(
    ("line", "near", "status"),
    [
        ("rnu", "'run'", 2),
        ("run street_3car_hetero --sed 3", "--seed", 2),
        ("run 3car_heter", "'3car_hetero'", 1),
        ("run street_3car_hetero --set duration=60s", "'perception.duration'", 1),
        ("run street_3car_hetero --set eviction=lru", "'genie.eviction'", 1),
        ("list evictoins", "'evictions'", 1),
    ],
)
def test_the_nearest_name_is_suggested(line, near, status, capsys):
    assert main(line.split()) == status
    (said,) = capsys.readouterr().err.splitlines()
    assert near in said


@pytest.mark.process
@pytest.mark.parametrize(
    "arguments", [["--help"], ["run", "--help"], ["--version"], []], ids=" ".join
)
def test_help_is_there_before_anything_heavy(arguments):
    """Under 0.2 s: little is loaded besides the library that reads the arguments."""
    code = (
        f"import sys; from genie_sim.cli.main import main; main({arguments}); print(*sys.modules)"
    )
    told = subprocess.run(
        [sys.executable, "-c", code],
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
        check=True,
    )
    loaded = set(told.stdout.splitlines()[-1].split())
    assert not loaded & HEAVY
    ours = {name for name in loaded if name.startswith("genie_sim.")}
    command_line = [path.stem for path in (REPOSITORY / "genie_sim" / "cli").glob("*.py")]
    command_line.remove("catalogue")
    assert ours <= {
        "genie_sim.version",
        "genie_sim.base",
        *(f"genie_sim.base.{part}" for part in ("add_ons", "docstrings", "errors", "paths")),
        *(f"genie_sim.base.{part}" for part in ("plugins", "text")),
        *(f"genie_sim.core{part}" for part in ("", ".encodings")),
        *(f"genie_sim.cli{part}" for part in ("", *(f".{part}" for part in command_line))),
    }
    bare = subprocess.run(
        [sys.executable, "-c", "import sys, click; print(*sys.modules)"], capture_output=True
    )
    added = loaded - set(bare.stdout.decode().split()) - ours
    assert len(added) < 30, added
