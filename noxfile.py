"""The project's tasks: ``nox --list`` shows them, ``nox -s NAME`` runs one in an environment of its
own.

``nox --no-venv -s NAME`` runs it in the environment that is active, as ``.ci/run`` does. Options
after ``--`` go to pytest: ``nox -s test -- -x tests/core``.
"""

import re
import sys
import tomllib
from pathlib import Path

import nox

nox.options.sessions = ["lint", "types", "test", "rest", "ros"]
nox.options.reuse_existing_virtualenvs = True

# What python -m pytest leaves out (tests/README.md), but what takes minutes; ROS is the add-on's.
REST = "(slow or process or browser or data) and not (ros or nightly)"
ADD_ON = "packages/genie-sim-ros"
# of a room's lines and branches that the tests run
LEAST_PERCENT, LEAST_PERCENT_OF_SIMULATOR = 80, 95
SIMULATOR = ("core", "sim", "methods", "faults")


def install(session: nox.Session, *requirements: str) -> None:
    """Installs into the session's own environment; the active one (``--no-venv``) has it all."""
    if not isinstance(session.virtualenv, nox.virtualenv.PassthroughEnv):
        session.install(*requirements)


def status_of(session: nox.Session, *command: str) -> int:
    """The exit status of a command; what comes after it runs all the same."""
    try:
        session.run(*command)
    except nox.command.CommandFailed as error:
        return error.return_code or 1
    return 0


@nox.session
def lint(session: nox.Session) -> None:
    """The hooks of pre-commit over all files: layout, ruff's rules, ends of files, large files."""
    install(session, ".[dev]")
    session.run("pre-commit", "run", "--all-files", "--show-diff-on-failure")


@nox.session
def types(session: nox.Session) -> None:
    """``mypy --strict`` over the package, its add-on and the examples."""
    install(session, ".[dev]")
    session.run("mypy")


@nox.session
def test(session: nox.Session) -> None:
    """The fast tests: ``python -m pytest``."""
    install(session, ".[test]")
    session.run("python", "-m", "pytest", *session.posargs)


@nox.session
def rest(session: nox.Session) -> None:
    """What the fast tests leave out, and the tests of the tools, but no test that takes minutes.
    What is missing on this machine is skipped.
    """
    install(session, ".[test]")
    pass_or_stop(session, ("-m", REST), ("-m", "not nightly", "tools"))


@nox.session
def ros(session: nox.Session) -> None:
    """The tests of the add-on for ROS, also in real ROS, but those that take minutes."""
    install(session, ".[test]", f"./{ADD_ON}[test]")
    pass_or_stop(session, ("-m", "not nightly", ADD_ON))


def pass_or_stop(session: nox.Session, *runs: tuple[str, ...]) -> None:
    """Runs all of them. Some tests wait for other programs: those that fail beside others run once
    more, alone, and both runs are printed.
    """
    passed = []
    own = ("-o", f"cache_dir=.pytest_cache/{session.name}")  # of what failed; others run beside
    for chosen in runs:
        pytest = ("python", "-m", "pytest", "--durations=15", *own, *session.posargs, *chosen)
        status = status_of(session, *pytest)
        if status:
            session.warn("What failed beside other tests runs again, alone.")
            again = ("--last-failed", "--last-failed-no-failures", "none", "-n0")
            right = (0, 5) if status == 1 else (0,)  # 5: a worker crashed, and all passed then
            status = 0 if status_of(session, *pytest, *again) in right else status
        passed.append(not status)
    if not all(passed):
        session.error("Some tests failed; see above.")


@nox.session
def coverage(session: nox.Session) -> None:
    """All tests, those of the night too, and whether they run enough of every room of the
    package.
    """
    install(session, ".[test]")
    session.run("python", "-m", "pytest", "-m", "", "--cov", "--cov-report=", *session.posargs)
    rooms = sorted(path.parent for path in Path("genie_sim").glob("*/__init__.py"))
    least = {
        room: LEAST_PERCENT_OF_SIMULATOR if room.name in SIMULATOR else LEAST_PERCENT
        for room in rooms
    }
    report = ("python", "-m", "coverage", "report", "--skip-covered", "--precision=1")
    passed = [
        status_of(session, *report, f"--include={room}/*", f"--fail-under={percent}") == 0
        for room, percent in least.items()
    ]
    if not all(passed):
        session.error("The tests run too little of some rooms; see above.")


@nox.session
def docs(session: nox.Session) -> None:
    """Builds the documentation into ``site/``; a broken link is an error."""
    install(session, ".[docs]")
    session.run("mkdocs", "build", "--strict", env={"NO_MKDOCS_2_WARNING": "1"})


@nox.session
def bench(session: nox.Session) -> None:
    """Times the simulator, fleets and peers; prints the tables of docs/speed.md."""
    install(session, ".[test]")
    session.run("python", "-m", "benchmarks.speed", *session.posargs)


@nox.session
def mutate(session: nox.Session) -> None:
    """Puts single errors into the package and lists those that no test notices."""
    install(session, ".[test]")
    session.run("python", "-m", "tools.mutate", *session.posargs)


@nox.session
def lower_bounds(session: nox.Session) -> None:
    """The fast tests with the oldest versions that pyproject.toml allows."""
    session.install("uv")
    session.run("uv", "pip", "install", "--resolution", "lowest-direct", ".[test]")
    session.run("uv", "pip", "list")
    session.run("python", "-m", "pytest", *session.posargs)


@nox.session
def lock(session: nox.Session) -> None:
    """Writes requirements.lock anew: the newest versions allowed, with the digests of their
    files.
    """
    install(session, "uv")
    path = Path("requirements.lock")
    fresh = Path(session.create_tmp()) / path.name
    session.run(
        "uv",
        "pip",
        "compile",
        "pyproject.toml",
        f"{ADD_ON}/pyproject.toml",
        "--no-emit-package",
        "genie-sim",
        "--universal",
        "--python-version",
        "3.11",
        "--all-extras",
        "--generate-hashes",
        "--no-header",
        "--no-annotate",
        "--quiet",
        "--output-file",
        str(fresh),
        silent=True,
    )
    path.write_text(
        "# Versions known to work together, for Python 3.11 and later: of genie-sim and add-on.\n"
        "# Use:   python -m pip install -r requirements.lock && python -m pip install --no-deps .\n"
        "# Made:  nox -s lock\n" + fresh.read_text(encoding="utf-8"),
        encoding="utf-8",
    )


@nox.session
def release(session: nox.Session) -> None:
    """Builds and checks the sdist and the wheel of a tag: ``nox -s release -- v1.2.3``."""
    version = release_version(session.posargs[0] if session.posargs else "")
    install(session, "--require-hashes", "-r", "requirements.lock")
    session.run("python", "-m", "build", "--no-isolation")
    session.run("python", "-m", "twine", "check", "--strict", *map(str, Path("dist").iterdir()))
    session.log(f"genie-sim {version}: see dist/")


def release_version(tag: str) -> str:
    """The version that a tag stands for; ends the task unless code, changelog and citation
    agree.
    """
    project = tomllib.loads(Path("pyproject.toml").read_text(encoding="utf-8"))
    source = Path(project["tool"]["hatch"]["version"]["path"]).read_text(encoding="utf-8")
    version = re.search(r'^(?:__version__|VERSION) = "(.*)"$', source, re.MULTILINE).group(1)
    if tag != f"v{version}":
        sys.exit(f"release: the tag is {tag or 'missing'}, the package is {version}")
    if f"\n## [{version}]" not in Path("CHANGELOG.md").read_text(encoding="utf-8"):
        sys.exit(f"release: CHANGELOG.md has no section [{version}]")
    add_on = tomllib.loads(Path(ADD_ON, "pyproject.toml").read_text(encoding="utf-8"))["project"]
    if add_on["version"] != version or f"genie-sim=={version}" not in add_on["dependencies"]:
        sys.exit(f"release: {ADD_ON} has another version")
    if f"\nversion: {version}\n" not in Path("CITATION.cff").read_text(encoding="utf-8"):
        sys.exit("release: CITATION.cff has another version")
    return version
