"""What every test may ask for: real data, the command line, and a folder of its own to write
into.
"""

from __future__ import annotations

import gc
import io
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import pytest
from hypothesis import settings

from genie_sim.__main__ import OBJECTS_BETWEEN_COLLECTIONS
from tests import tiers
from tests.browser import Browser, installed
from tests.checkout import REPOSITORY, CommandLine, forget

gc.set_threshold(OBJECTS_BETWEEN_COLLECTIONS)  # as the program does: a tenth less CPU
os.environ.setdefault("MPLBACKEND", "Agg")
# Without --jobs a command starts no processes: the tests keep every core busy themselves.
os.environ["LOKY_MAX_CPU_COUNT"] = "1"
os.environ["GENIE_SIM_PROGRESS"] = "off"  # lines of progress would come where a machine is slow
settings.register_profile("genie_sim", derandomize=True, deadline=None, max_examples=30)
settings.load_profile("genie_sim")


def pytest_addoption(pluginmanager: pytest.PytestPluginManager) -> None:
    pluginmanager.register(tiers, "tiers")


@pytest.fixture(autouse=True)
def _no_fsync(monkeypatch: pytest.MonkeyPatch) -> None:
    """No test cuts the power, and disks take their time; ``test_files.py`` looks at it."""
    monkeypatch.setattr(os, "fsync", lambda descriptor: None)


@pytest.fixture(autouse=True)
def _own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each test starts in an empty folder: nothing written to a relative path ends up in the
    checkout.
    """
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def without_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """A sweep draws nothing: that takes most of a small one's time."""
    monkeypatch.setattr("genie_sim.study.figures.SweepFigures.drawn", lambda _: iter(()))


@pytest.fixture(scope="session")
def kitti_root() -> Path:
    """The folder of real KITTI frames; skips the test where there is none."""
    return _real_data("GENIE_SIM_KITTI")


@pytest.fixture(scope="session")
def weights_dir() -> Path:
    """The folder of real detector weights; skips the test where there is none."""
    return _real_data("GENIE_SIM_WEIGHTS")


@pytest.fixture(scope="session")
def v2v4real_root() -> Path:
    """The folder of DMSTrack's text files of V2V4Real; skips the test where there is none."""
    return _real_data("GENIE_SIM_V2V4REAL")


def _real_data(variable: str) -> Path:
    folder = os.environ.get(variable)
    if not folder or not Path(folder).is_dir():
        pytest.skip("needs real data, in the folders that variables say (tests/README.md)")
    return Path(folder).resolve()


@pytest.fixture
def run_cli(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> CommandLine:
    """``run_cli("run", "3car_hetero")`` runs ``genie-sim`` in the test's folder, in this process.

    Returns a ``CompletedProcess``, with exit status and texts. Modules that the command has
    imported from the folder are forgotten afterwards.
    """

    def run(*arguments: str) -> subprocess.CompletedProcess[str]:
        from genie_sim.cli.main import main

        said, warned = io.StringIO(), io.StringIO()
        with monkeypatch.context() as within:
            within.chdir(tmp_path)
            within.syspath_prepend(tmp_path)
            with redirect_stdout(said), redirect_stderr(warned):
                status = main(list(arguments))
        forget(tmp_path)
        return subprocess.CompletedProcess(arguments, status, said.getvalue(), warned.getvalue())

    return run


@pytest.fixture
def run_process(tmp_path: Path) -> CommandLine:
    """As ``run_cli``, in a process of its own, with ``env`` added to its environment."""

    def run(
        *arguments: str, env: dict[str, str] | None = None, timeout_s: float = 300
    ) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "genie_sim", *arguments],
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": str(REPOSITORY), **(env or {})},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=timeout_s,
        )

    return run


@pytest.fixture(scope="session")
def program() -> str:
    """The program of a browser; skips the test where there is none."""
    found = installed()
    if found is None:
        pytest.skip("needs Chromium: none of its programs is installed")
    return found


@pytest.fixture(scope="module")
def one_browser(program: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    browser = Browser(program, tmp_path_factory.mktemp("profile"))
    yield browser
    browser.close()


@pytest.fixture
def browser(one_browser: Browser) -> Browser:
    """The browser, with nothing noted so far, in a common window."""
    one_browser.errors.clear()
    one_browser.requests.clear()
    one_browser.size(1200, 900)
    return one_browser
