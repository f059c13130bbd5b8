"""Who may import whom: ``units, messages, errors, paths <- core <- {sim, ros} <- experiment.runner <- cli``."""

from __future__ import annotations

import ast
import subprocess
import sys
import tomllib
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parent.parent
PACKAGE = REPOSITORY / "genie_sim"

# Each layer, and what of genie_sim it may import. A module belongs to the first layer that its name starts with.
GROUND = ("units", "messages", "errors", "paths")
SETTINGS = ("experiment.settings", "experiment.genies", "experiment.seeds")
LAYERS: dict[str, tuple[str, ...]] = {
    "errors": (),
    "paths": ("errors",),
    "units": ("errors",),
    "messages": ("units", "errors"),
    "core": (*GROUND, "core"),
    "perception": (*GROUND, "core", "perception", "experiment.seeds"),
    "sim": (*GROUND, "core", "sim", "perception.trace", *SETTINGS, "experiment.records"),
    "ros.bags": (*GROUND, "core", "ros", "perception"),
    "ros.export": (*GROUND, "ros", "experiment"),
    "ros": (*GROUND, "core", "ros", *SETTINGS, "experiment.records"),
    "experiment.settings": (
        *GROUND, "core", "perception.city.rules", "perception.detector", "experiment.settings", "experiment.seeds",
    ),
    "experiment.runner": (*GROUND, "core", "sim", "perception", "experiment"),
    "experiment.paper.replicate": (*GROUND, "core", "sim", "perception", "experiment"),
    "experiment.paper.drives": (*GROUND, "core", "sim", "perception", "experiment"),
    "experiment.sweep": (*GROUND, "core", "sim", "perception", "experiment"),
    "experiment": (*GROUND, "core", "perception", "experiment"),
    "api": (*GROUND, "experiment"),
    "terminal": GROUND,
    "arguments": (*GROUND, "experiment"),
    "cli_perceive": (*GROUND, "perception", "ros.bags", "terminal", "arguments"),
    "cli": (*GROUND, "core", "sim", "ros", "perception", "experiment", "terminal", "arguments", "cli_perceive"),
    "__main__": ("cli",),
}
SIMULATE = {  # everything else reads settings and tables
    "experiment.runner", "experiment.paper.replicate", "experiment.paper.drives", "api", "cli",
    "experiment.sweep.plan", "experiment.sweep.sweep", "experiment.sweep.tasks",
}  # fmt: skip

CORE_MAY_IMPORT = {*sys.stdlib_module_names, "numpy", "genie_sim"}
PROVIDED_BY = {"cv2": "opencv-python-headless", "yaml": "pyyaml", "pydantic_core": "pydantic"}
# Library -> the extra that brings it; imported where it is asked for.
FROM_EXTRAS = {"distributed": "dask", "rosbags": "ros", "mcap": "ros"}
FROM_ROS = {"rospy", "rosgraph", "roslib", "genpy", "rclpy"}  # not on PyPI; only genie_sim.ros may import them
LATE = (
    "pandas", "matplotlib", "onnxruntime", "onnx", "cv2", "pyarrow", "scipy", "pykitti", "simpy", "joblib",
    "distributed", "rosbags", "mcap",
)  # fmt: skip
LONGEST_FILE_LINES = 400
LONGER_FILES: dict[str, str] = {}  # file -> why it is better in one piece


def module_name(path: Path) -> str:
    """``core.node`` for ``genie_sim/core/node.py``, ``core`` for its ``__init__.py``."""
    return ".".join(path.relative_to(PACKAGE).with_suffix("").parts).removesuffix(".__init__")


MODULES = {module_name(path): path for path in sorted(PACKAGE.rglob("*.py"))}
ROOT = MODULES.pop("__init__")


def imports(path: Path) -> Iterator[tuple[int, str]]:
    """Line and full dotted name of all that a file imports: at its top, inside functions, for type checking only."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, name.name) for name in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: relative import"
            yield from ((node.lineno, f"{node.module}.{name.name}") for name in node.names)


def within(name: str, prefixes: Iterable[str]) -> bool:
    return any(name == prefix or name.startswith(f"{prefix}.") for prefix in prefixes)


def layer_of(module: str) -> str:
    return next(layer for layer in LAYERS if within(module, (layer,)))


def test_every_module_has_a_layer():
    homeless = [module for module in MODULES if not within(module, LAYERS)]
    assert not homeless, f"say in LAYERS what these may import: {homeless}"
    mine = [name for _, name in imports(ROOT) if within(name, ("genie_sim",))]
    assert all(within(name, ("genie_sim.api",)) for name in mine), mine
    assert not _loaded_by("import genie_sim") & {"genie_sim.api", "pydantic", *LATE}, "it comes when it is used"


@pytest.mark.parametrize("module", MODULES)
def test_a_module_imports_only_from_its_layer_and_below(module: str):
    allowed = LAYERS[layer_of(module)]
    for line, name in imports(MODULES[module]):
        inside = name.removeprefix("genie_sim.")
        if inside in (name, "__version__") or within(inside, allowed):
            continue
        raise AssertionError(f"{MODULES[module]}:{line}: {layer_of(module)} imports {inside}; it may import {allowed}")


def test_the_core_is_standard_library_and_numpy():
    for module in (name for name in MODULES if layer_of(name) in (*GROUND, "core")):
        for line, name in imports(MODULES[module]):
            assert name.partition(".")[0] in CORE_MAY_IMPORT, f"{MODULES[module]}:{line}: imports {name}"


def test_what_is_imported_is_declared():
    """A library that only happens to be installed with another one is missing on somebody's machine."""
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    declared = {requirement.partition(">=")[0] for requirement in project["dependencies"]}
    for module, path in MODULES.items():
        for line, name in imports(path):
            library = name.partition(".")[0]
            if library in sys.stdlib_module_names or library == "genie_sim":
                continue
            if library in FROM_ROS and layer_of(module) == "ros":
                continue
            if library in FROM_EXTRAS:
                extra = project["optional-dependencies"][FROM_EXTRAS[library]]
                assert any(requirement.startswith(library) for requirement in extra), f"{path}:{line}: {library}"
                continue
            assert PROVIDED_BY.get(library, library) in declared, f"{path}:{line}: {library} is not in pyproject.toml"


def test_only_the_simulation_knows_simpy():
    users = {module for module, path in MODULES.items() if any(within(name, ("simpy",)) for _, name in imports(path))}
    assert users, "nothing imports simpy any more: this test checks nothing"
    assert {layer_of(module) for module in users} == {"sim"}


def test_only_the_runner_builds_a_world():
    """Metrics, figures, summaries, claims and reports read what a run wrote, never the simulator."""
    for module, path in MODULES.items():
        if layer_of(module) != "sim" and module not in SIMULATE:
            used = [name for _, name in imports(path) if within(name, ("genie_sim.sim", "genie_sim.runner"))]
            assert not used, f"{path}: imports {used}"


def test_the_command_line_starts_without_heavy_libraries():
    """``genie-sim --help`` must not wait for pandas."""
    loaded = _loaded_by("import genie_sim.cli")
    assert "genie_sim.cli" in loaded
    assert not set(LATE) & loaded


def test_a_scenario_is_read_without_heavy_libraries():
    """The shell's completion and the real Genies read settings, too."""
    assert not set(LATE) & _loaded_by("import genie_sim.scenario.scenario")


def _loaded_by(statement: str) -> set[str]:
    """Every module that a fresh Python has loaded after a statement."""
    told = subprocess.run(
        [sys.executable, "-c", f"import sys; {statement}; print(*sys.modules)"],
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    )
    return set(told.stdout.split())


def test_only_the_command_line_prints():
    for module, path in MODULES.items():
        if module == "cli":
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            printing = isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "print"
            assert not printing, f"{path}:{node.lineno}: print; use a module logger"


def test_files_stay_short():
    lines = {path.relative_to(REPOSITORY).as_posix(): len(path.read_text().splitlines()) for path in MODULES.values()}
    long = {file: count for file, count in lines.items() if count > LONGEST_FILE_LINES}
    assert long.keys() == LONGER_FILES.keys(), f"longer than {LONGEST_FILE_LINES} lines: {long}"
