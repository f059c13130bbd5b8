"""Who may import whom. ``MAY_IMPORT`` is the whole rule: arrows run one way, and no module is an
exception.
"""

from __future__ import annotations

import ast
import functools
import importlib
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterable
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

import pytest

REPOSITORY = Path(__file__).resolve().parent.parent
PACKAGE = REPOSITORY / "genie_sim"

# Each room, and which others it may import besides ``base``; ``version`` is anybody's.
_SIMULATED = ("core", "tracks", "sim", "links", "methods", "recommended", "faults")
_READ = (*_SIMULATED, "data", "worlds", "scenario")
_RESULTS = ("record", "judge", "analysis", "report")
MAY_IMPORT: dict[str, tuple[str, ...]] = {
    "version": (),
    "base": (),
    "core": (),
    "tracks": ("core",),
    "sim": ("core", "tracks"),
    "links": ("core", "sim"),
    "methods": ("core", "sim"),
    "recommended": ("core", "tracks", "sim", "methods"),
    "faults": ("core", "sim"),
    "data": ("core", "tracks"),
    "worlds": ("core", "data"),
    "scenario": (*_SIMULATED, "data"),
    "record": ("core", "sim"),
    "judge": ("core", "tracks", "record"),
    "analysis": ("core", "record"),
    "report": ("core", "data", "record", "analysis"),
    "runs": (*_READ, *_RESULTS),
    "study": (*_READ, *_RESULTS, "runs"),
    "paper": ("scenario", "record", "analysis", "report", "runs", "study"),
    "kinds": ("scenario", "record", "analysis", "report", "runs", "study", "paper"),
    "api": (*_READ, *_RESULTS, "runs", "study", "paper", "kinds"),
    "cli": (*_READ, *_RESULTS, "runs", "study", "api", "paper", "kinds"),
    "__main__": ("cli",),
    "extend": ("core", "tracks", "sim", "methods", "recommended", "data", "record", "analysis"),
}
IN_THE_ROOT = {"__init__", "__main__", "api", "extend", "kinds", "version"}

CORE_MAY_IMPORT = {*sys.stdlib_module_names, "numpy", "genie_sim"}
PROVIDED_BY = {"cv2": "opencv-python-headless", "requests": "pooch", "yaml": "pyyaml"}
# Library -> the extra that brings it; imported where it is asked for.
FROM_EXTRAS = {"pooch": "fetch", "requests": "fetch"}
LATE = (
    "pandas",
    "matplotlib",
    "onnxruntime",
    "onnx",
    "cv2",
    "pyarrow",
    "scipy",
    "simpy",
    "joblib",
    "pykitti",
)


def module_name(path: Path) -> str:
    """``core.node`` for ``genie_sim/core/node.py``, ``core`` for its ``__init__.py``."""
    return ".".join(path.relative_to(PACKAGE).with_suffix("").parts).removesuffix(".__init__")


MODULES = {module_name(path): path for path in sorted(PACKAGE.rglob("*.py"))}
ROOT = MODULES.pop("__init__")


class Import(NamedTuple):
    """What a file imports: at its top, inside a function, or ``for_types`` only, which never
    happens at run time.
    """

    line: int
    name: str
    for_types: bool


@functools.cache
def imports(path: Path) -> tuple[Import, ...]:
    """All imports of a file; read once for all tests."""
    found: list[Import] = []
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for_types: set[ast.AST] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            for_types.update(inner for statement in node.body for inner in ast.walk(statement))
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names = [name.name for name in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: relative import"
            names = [f"{node.module}.{name.name}" for name in node.names]
        else:
            continue
        found += (Import(node.lineno, name, node in for_types) for name in names)
    return tuple(found)


def imported_module(name: str) -> str | None:
    """``core.node`` for ``genie_sim.core.node.GenieNode``. ``None`` for what is not ours, and for
    ``genie_sim`` itself: Python has imported that before any module of it, and it imports ``api``
    only when somebody asks for it.
    """
    package, _, inside = name.partition(".")
    while package == "genie_sim" and inside:
        if inside in MODULES:
            return inside
        inside = inside.rpartition(".")[0]
    return None


def within(name: str, prefixes: Iterable[str]) -> bool:
    return any(name == prefix or name.startswith(f"{prefix}.") for prefix in prefixes)


def package_of(module: str) -> str:
    return module.partition(".")[0]


PACKAGES = sorted({package_of(module) for module in MODULES})


@pytest.mark.process
def test_every_package_has_its_place():
    assert sorted(MAY_IMPORT) == PACKAGES, "say in MAY_IMPORT what a new one may import"
    assert {path.stem for path in PACKAGE.glob("*.py")} == IN_THE_ROOT
    list(TopologicalSorter(MAY_IMPORT).static_order())  # raises where arrows run in a circle
    mine = [one.name for one in imports(ROOT) if within(one.name, ("genie_sim",))]
    assert all(within(name, ("genie_sim.api", "genie_sim.version")) for name in mine), mine
    assert not _loaded_by("import genie_sim") & {
        "genie_sim.api",
        *LATE,
    }, "it comes when it is used"


@pytest.mark.parametrize("package", PACKAGES)
def test_arrows_run_one_way(package: str):
    """Imports for types count, too: who names a class of another package knows of it."""
    allowed = ("version", "base", *MAY_IMPORT[package], package)
    wrong = []
    for module, path in MODULES.items():
        if package_of(module) != package:
            continue
        for one in imports(path):
            to = imported_module(one.name)
            if to is not None and package_of(to) not in allowed:
                wrong.append(f"{path.relative_to(REPOSITORY)}:{one.line}: imports {to}")
    assert not wrong, "\n".join((f"{package} may import {allowed}", *wrong))


def test_no_modules_import_one_another_in_a_circle():
    """Imports inside functions count, those for types do not: at run time there are none."""
    graph: dict[str, set[str]] = {}
    for module, path in MODULES.items():
        found = {imported_module(one.name) for one in imports(path) if not one.for_types}
        graph[module] = {to for to in found if to is not None and to != module}
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        raise AssertionError(" <- ".join(error.args[1])) from None


def test_the_core_is_standard_library_and_numpy():
    for module in (name for name in MODULES if package_of(name) == "core"):
        for line, name, _ in imports(MODULES[module]):
            assert name.partition(".")[0] in CORE_MAY_IMPORT, (
                f"{MODULES[module]}:{line}: imports {name}"
            )


def test_what_is_imported_is_declared():
    """A library that only happens to be installed with another one is missing on somebody's
    machine.
    """
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    declared = {requirement.partition(">=")[0] for requirement in project["dependencies"]}
    for path in MODULES.values():
        for line, name, _ in imports(path):
            library = name.partition(".")[0]
            if library in sys.stdlib_module_names or library == "genie_sim":
                continue
            if library in FROM_EXTRAS:
                extra = project["optional-dependencies"][FROM_EXTRAS[library]]
                assert any(one.startswith(PROVIDED_BY.get(library, library)) for one in extra), (
                    f"{path}:{line}: {library}"
                )
                continue
            assert PROVIDED_BY.get(library, library) in declared, (
                f"{path}:{line}: {library} is not in pyproject.toml"
            )


def test_only_the_simulation_knows_simpy():
    users = {
        module
        for module, path in MODULES.items()
        for one in imports(path)
        if within(one.name, ("simpy",))
    }
    assert users, "nothing imports simpy any more: this test checks nothing"
    assert {package_of(module) for module in users} == {"sim", "links"}


@pytest.mark.process
def test_a_scenario_is_read_without_heavy_libraries():
    """The real Genies read settings, too."""
    assert not set(LATE) & _loaded_by("import genie_sim.scenario.reading")


@pytest.mark.process
def test_code_of_ones_own_starts_without_pandas():
    """A fault or a metric, of which a run starts several processes."""
    assert set(LATE) & _loaded_by("import genie_sim.extend") <= {"simpy", "cv2"}


@pytest.mark.process
def test_an_evaluation_starts_without_matplotlib():
    """Its workers import it, side by side, when there is something to draw."""
    assert "matplotlib" not in _loaded_by("import genie_sim.paper.reproduce")


@pytest.mark.process
def test_a_run_on_recorded_streets_needs_no_town():
    assert "genie_sim.worlds.town" not in _loaded_by("import genie_sim.runs.folder")


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


def test_scripts_of_pages_import_what_they_use_from_those_beside_them():
    """A page is one file, of which each script is an object: a browser looks for a name in it only
    when it comes to it.
    """
    for path in PACKAGE.rglob("*.js"):
        code = path.read_text(encoding="utf-8")
        for names, other in re.findall(r'^import \{([^}]*)\} from "\./([^"]*)";$', code, re.M):
            exporting = (path.parent / other).read_text(encoding="utf-8")
            exported = re.findall(r"^export (?:async )?\w+ (\w+)", exporting, re.M)
            assert {*re.findall(r"\w+", names)} <= {*exported}, path
        assert len(re.findall("^import ", code, re.M)) == len(re.findall(r'from "\./', code)), path


@pytest.mark.slow
def test_a_name_in_a_docstring_leads_somewhere():
    """What stands as ``room.module.Name`` in a docstring can be imported."""
    found = 0
    for path in MODULES.values():
        tree = ast.parse(path.read_text(encoding="utf-8"))
        for node in ast.walk(tree):
            if not isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
                continue
            for name in re.findall(r"``(\w+(?:\.\w+)+)", ast.get_docstring(node) or ""):
                room, *inside = name.split(".")
                if room in MODULES and inside[-1] not in ("parquet", "html", "latency_cdf"):
                    within = importlib.import_module(f"genie_sim.{room}")
                    assert _exists(inside, within), f"{path}: {name}"
                    found += 1
    assert found > 15


def _exists(names: list[str], within: object) -> bool:
    """Whether a module or class has what these names lead to."""
    if not names:
        return True
    first, *rest = names
    inside = getattr(within, first, None)
    if inside is None and isinstance(within, ModuleType):
        try:
            inside = importlib.import_module(f"{within.__name__}.{first}")
        except ModuleNotFoundError:
            return False
    return inside is not None and _exists(rest, inside)
