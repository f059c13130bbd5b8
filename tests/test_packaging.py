"""What travels: the wheel carries the shipped scenarios, traces and device profiles, and finds them
from any folder.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from itertools import chain
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parent.parent
PROJECT = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))
AT_THE_ROOT = """
    .ci .git-blame-ignore-revs .gitattributes .github .gitignore .pre-commit-config.yaml
    CHANGELOG.md CITATION.cff CONTRIBUTING.md LICENSE README.md SECURITY.md
    benchmarks device_profiles docs examples genie_sim hatch_build.py mkdocs.yml notebooks
    noxfile.py packages pyproject.toml requirements.lock results scenarios schemas studies
    tests tools
"""
SHIPPED_TRACE = re.compile(r"scenarios/traces/kitti_\d{4}(\.\w+)?\.(parquet|LICENSE\.md)")
SHIPPED_FOLDERS: dict[str, str] = PROJECT["tool"]["hatch"]["build"]["targets"]["wheel"][
    "force-include"
]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A wheel of this checkout, as ``pip install .`` makes it."""
    folder = tmp_path_factory.mktemp("wheel")
    made = subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)],
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert made.returncode == 0, made.stderr
    (path,) = folder.glob("*.whl")
    return path


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, unpacked: a folder for ``PYTHONPATH``."""
    folder = tmp_path_factory.mktemp("installed")
    with zipfile.ZipFile(wheel) as packed:
        packed.extractall(folder)
    return folder


def test_git_holds_no_stray_file():
    """Commands that are tried in a checkout write where they stand."""
    try:
        listed = subprocess.run(("git", "ls-files"), cwd=REPOSITORY, capture_output=True, text=True)
    except FileNotFoundError:
        pytest.skip("there is no git")
    if listed.returncode != 0:
        pytest.skip("this is no checkout of git")
    names = listed.stdout.splitlines()
    assert {name.partition("/")[0] for name in names} <= {*AT_THE_ROOT.split()}
    traces = [name for name in names if "traces" in name.split("/")]
    assert [name for name in traces if not SHIPPED_TRACE.fullmatch(name)] == []


@pytest.mark.process
def test_the_wheel_carries_every_shipped_file(wheel: Path):
    packed = set(zipfile.ZipFile(wheel).namelist())
    assert len(SHIPPED_FOLDERS) == 3
    for source, target in SHIPPED_FOLDERS.items():
        files = [
            path.relative_to(REPOSITORY / source)
            for path in (REPOSITORY / source).rglob("*")
            if path.is_file()
        ]
        missing = {f"{target}/{file.as_posix()}" for file in files} - packed
        assert files and not missing, f"not in the wheel: {missing}"


def test_the_wheel_carries_the_licence_of_the_trace_beside_it(wheel: Path):
    """The trace was computed from KITTI, whose licence asks for attribution wherever it goes."""
    packed = set(zipfile.ZipFile(wheel).namelist())
    traces = [name for name in packed if "/traces/" in name and name.endswith(".parquet")]
    assert traces
    assert all(name.replace(".parquet", ".LICENSE.md") in packed for name in traces)


def test_the_wheel_names_both_licences_and_carries_their_texts(wheel: Path):
    """One licence of the code, another of the trace: who installs the package is told of both."""
    packed = zipfile.ZipFile(wheel)
    folder = f"genie_sim-{version()}.dist-info/"
    metadata = packed.read(folder + "METADATA").decode()
    assert "License-Expression: Apache-2.0 AND CC-BY-NC-SA-3.0\n" in metadata
    named = re.findall("^License-File: (.*)$", metadata, re.MULTILINE)
    parts = {
        "0005": ("", "jpeg80.", "jpeg90.", "png.", "truth."),
        "0013": ("", "jpeg90.", "truth."),
    }
    assert named == [
        "LICENSE",
        *(
            f"scenarios/traces/kitti_{drive}.{part}LICENSE.md"
            for drive, of_drive in parts.items()
            for part in of_drive
        ),
    ]
    assert {f"{folder}licenses/{name}" for name in named} <= set(packed.namelist())


@pytest.mark.process
def test_an_installed_package_knows_the_commit_that_it_was_built_from(installed: Path):
    """Also where it was built from an unpacked sdist, which has no ``.git``."""
    git = ["git", "describe", "--always", "--abbrev=12", "--dirty", "--exclude=*"]
    told = subprocess.run(git, cwd=REPOSITORY, capture_output=True, text=True, check=True)
    code = "from genie_sim.record.provenance import environment; print(environment()['commit'])"
    known = subprocess.run(
        [sys.executable, "-c", code],
        cwd=installed,
        env={**os.environ, "PYTHONPATH": str(installed)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert known.stdout == told.stdout and len(told.stdout.strip()) >= 12


@pytest.mark.process
def test_a_wheel_of_an_sdist_knows_the_commit(tmp_path: Path):
    build = [sys.executable, "-m", "hatchling", "build", "-d", str(tmp_path)]
    subprocess.run([*build, "-t", "sdist"], cwd=REPOSITORY, capture_output=True, check=True)
    (sdist,) = tmp_path.glob("*.tar.gz")
    with tarfile.open(sdist) as packed:
        packed.extractall(tmp_path / "unpacked", filter="data")
    (root,) = (tmp_path / "unpacked").iterdir()
    subprocess.run([*build, "-t", "wheel"], cwd=root, capture_output=True, check=True)
    (wheel,) = tmp_path.glob("*.whl")
    commit = (root / "commit.txt").read_text(encoding="utf-8")
    assert zipfile.ZipFile(wheel).read("genie_sim/shipped/commit.txt").decode() == commit


def test_the_wheel_says_that_it_is_typed(wheel: Path):
    """So that mypy reads the annotations of an installed copy."""
    assert "genie_sim/py.typed" in zipfile.ZipFile(wheel).namelist()


def test_the_wheel_carries_nothing_else(wheel: Path):
    """No tests, caches, frames or weights, and small enough to download in a moment."""
    information = f"genie_sim-{version()}.dist-info/"
    code = (
        ".py",
        ".typed",
        ".yaml",
        ".parquet",
        ".md",
        ".html",
        ".css",
        ".js",
        ".schema.json",
        "laws.json",
        "/paper/full_run.json",
        "/shipped/scenarios/traffic/sumo_grid.xml.gz",
        "/shipped/commit.txt",
    )
    foreign = [
        name
        for name in zipfile.ZipFile(wheel).namelist()
        if not name.startswith(information)
        and not (name.startswith("genie_sim/") and name.endswith(code))
    ]
    assert not foreign
    assert wheel.stat().st_size < 2_000_000


def version() -> str:
    from genie_sim import __version__

    return __version__


def test_the_changelog_and_the_citation_know_the_version():
    assert version() in (REPOSITORY / "CHANGELOG.md").read_text(encoding="utf-8")
    assert f"version: {version()}\n" in (REPOSITORY / "CITATION.cff").read_text(encoding="utf-8")


@pytest.mark.process
def test_an_installed_copy_lists_its_scenarios_and_devices(installed: Path, tmp_path: Path):
    assert "street_3car_hetero" in genie_sim(installed, tmp_path, "list", "scenarios")
    assert "jetson_tx2" in genie_sim(installed, tmp_path, "list", "devices")


@pytest.mark.slow
def test_an_installed_copy_runs_a_scenario_by_name(installed: Path, tmp_path: Path):
    """Scenario, trace and device profiles are all found inside the installed package."""
    genie_sim(
        installed, tmp_path, "run", "street_3car_hetero", "--set", "methods=[genie]", "--out", "out"
    )
    (record,) = tmp_path.glob("out/street_3car_hetero-*/run.json")
    assert json.loads(record.read_text(encoding="utf-8"))


def genie_sim(installed: Path, folder: Path, *arguments: str) -> str:
    """Runs the copy at ``installed`` from ``folder``; returns what it prints."""
    env = {**os.environ, "PYTHONPATH": str(installed)}
    where = [sys.executable, "-c", "import genie_sim; print(genie_sim.__file__)"]
    origin = subprocess.run(
        where, cwd=folder, env=env, capture_output=True, text=True, check=True
    ).stdout
    assert Path(origin.strip()).is_relative_to(installed), "another copy of genie_sim comes first"
    ran = subprocess.run(
        [sys.executable, "-m", "genie_sim", *arguments],
        cwd=folder,
        env=env,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert ran.returncode == 0, ran.stderr
    return ran.stdout


def test_the_lock_file_pins_every_requirement_with_digests():
    """Every requirement, extras included, has an exact version and the SHA-256 of its files; no
    index, no path of the machine that made it.
    """
    text = (REPOSITORY / "requirements.lock").read_text(encoding="utf-8").replace(" \\\n", "")
    pin = re.compile(r"([a-z0-9-]+)==[^ ;]+( ; .*?)?(    --hash=sha256:[0-9a-f]{64})+")
    pins = {line: pin.fullmatch(line) for line in text.splitlines() if not line.startswith("#")}
    assert all(pins.values()), [line for line, found in pins.items() if not found]
    extras = PROJECT["project"]["optional-dependencies"]
    needed = {
        requirement_name(one)
        for one in (*PROJECT["project"]["dependencies"], *chain(*extras.values()))
    }
    assert needed <= {found[1] for found in pins.values() if found}


def test_every_requirement_has_a_lower_bound():
    """``nox -s lower_bounds`` tests those of what is needed; an upper one would be a guess, but for
    SimPy, whose clock is built upon.
    """
    extras = PROJECT["project"]["optional-dependencies"]
    for requirement in (*PROJECT["project"]["dependencies"], *chain(*extras.values())):
        lower = requirement.removesuffix(",<5") if requirement.startswith("simpy") else requirement
        assert re.fullmatch(r"[A-Za-z0-9-]+(\[[a-z0-9]+\])?>=[0-9.]+", lower), requirement


def requirement_name(requirement: str) -> str:
    return re.split(r"[\[>]", requirement)[0].lower()
