"""The compiled engine: when it is used, what is said where it is not, and that it gives the bytes
of plain Python.
"""

from __future__ import annotations

import ast
import hashlib
import json
import os
import re
import subprocess
import sys
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path
from typing import Any

import pytest

import compile_engine
import hatch_build
from genie_sim.engine import ENGINE, Engine
from tests.conftest import REPOSITORY

SUFFIX = EXTENSION_SUFFIXES[0]
SOURCE = b"answer = 42\n"
TWIN = b"cdef int answer = 42\n"
NO_LIBRARY = b"no library"


def digest(source: bytes) -> str:
    return hashlib.sha256(source).hexdigest()


@pytest.fixture(autouse=True)
def not_forced(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("GENIE_SIM_PURE", raising=False)


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A package with one module and a build of it, which is no library."""
    compiled = tmp_path / "_compiled"
    compiled.mkdir()
    (tmp_path / "sim").mkdir()
    (tmp_path / "sim" / "timeline.py").write_bytes(SOURCE)
    (compiled / f"genie_sim.sim.timeline{SUFFIX}").write_bytes(NO_LIBRARY)
    write_manifest(tmp_path)
    return tmp_path


def write_manifest(package: Path, **changes: Any) -> None:
    sources = {".py": digest(SOURCE), ".pyx": digest(TWIN)}
    made = {"sources": sources, "bytes": len(NO_LIBRARY)}
    manifest = {"suffix": SUFFIX, "modules": {"genie_sim.sim.timeline": made}, **changes}
    (package / "_compiled" / "manifest.json").write_text(json.dumps(manifest))


def test_without_a_build_plain_python_runs(tmp_path: Path):
    engine = Engine(tmp_path)
    assert not engine.is_compiled and engine.title == "plain Python (not compiled)"


def test_a_library_that_cannot_be_loaded_leaves_plain_python(package: Path):
    engine = Engine(package)
    assert engine.why_plain.startswith("cannot be loaded: ") and "\n" not in engine.title


def test_a_stale_build_leaves_plain_python(package: Path):
    """A checkout has what was compiled in the place of a module, too; an installation has not."""
    module, why = package / "sim" / "timeline.py", Engine(package).why_plain
    assert why.startswith("cannot be loaded: ")
    stale = "stale: genie_sim.sim.timeline has changed since it was compiled"
    module.with_suffix(".pyx").write_bytes(TWIN)
    assert Engine(package).why_plain == why
    module.with_suffix(".pyx").write_bytes(SOURCE)
    assert Engine(package).why_plain == stale
    module.with_suffix(".pyx").unlink()
    module.write_bytes(b"answer = 43\n")
    assert Engine(package).why_plain == stale


def test_a_build_for_another_python_leaves_plain_python(package: Path):
    write_manifest(package, suffix=".cpython-39.so")
    why = f"compiled for another Python: .cpython-39.so is not {SUFFIX}"
    assert Engine(package).why_plain == why


def test_a_damaged_build_leaves_plain_python(package: Path):
    compiled = package / "_compiled"
    library, manifest = compiled / f"genie_sim.sim.timeline{SUFFIX}", compiled / "manifest.json"
    library.write_bytes(b"half")
    assert Engine(package).why_plain == f"damaged: {library.name}"
    library.unlink()
    assert Engine(package).why_plain.startswith("damaged: _compiled: FileNotFoundError")
    for text in ("", "[]", '{"suffix": 1}', f'{{"suffix": "{SUFFIX}", "modules": []}}'):
        manifest.write_text(text)
        assert Engine(package).why_plain.startswith(("damaged", "compiled for another")), text


def test_the_reason_of_a_build_that_failed_is_kept(package: Path):
    write_manifest(package, failed="CompileError: no gcc")
    why = "compiling failed when it was installed: CompileError: no gcc"
    assert Engine(package).why_plain == why


@pytest.mark.parametrize(("value", "forced"), [("1", True), ("0", False), ("", False)])
def test_plain_python_can_be_forced(
    package: Path, value: str, forced: bool, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv("GENIE_SIM_PURE", value)
    assert (Engine(package).why_plain == "GENIE_SIM_PURE is set") is forced


def test_the_version_names_the_engine():
    told = subprocess.run(
        [sys.executable, "-m", "genie_sim", "--version"],
        cwd=REPOSITORY,
        env={**os.environ, "GENIE_SIM_PURE": "1"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert re.fullmatch(r"genie-sim \S+\nengine: plain Python \(.+\)\n", told.stdout)


# The build


class Hook(hatch_build.BuildHook):
    """The hook in a build of a wheel, with a compiler that gives up for a ``reason``."""

    def __init__(self, reason: str, monkeypatch: pytest.MonkeyPatch) -> None:
        super().__init__(str(REPOSITORY), {}, None, None, "", "wheel")  # type: ignore[arg-type]
        self.compiled: list[Path] = []
        self.manifest = ""
        self.data: dict[str, Any] = {"force_include": {}}

        def compiler(root: Path, folder: Path) -> str:
            self.compiled.append(folder)
            return reason

        monkeypatch.setattr(hatch_build, "compile_engine", compiler)

    def build(self) -> None:
        self.initialize("standard", self.data)
        for folder, target in self.data["force_include"].items():
            manifest = Path(folder, "manifest.json")
            if target == "genie_sim/_compiled" and manifest.is_file():
                self.manifest = manifest.read_text()
        self.finalize("standard", self.data, "")


def test_a_plain_build_neither_compiles_nor_needs_cython(monkeypatch: pytest.MonkeyPatch):
    for value in ("", "0"):
        monkeypatch.setenv("GENIE_SIM_COMPILE", value)
        hook = Hook("", monkeypatch)
        hook.build()
        assert not hook.compiled and not hook.dependencies()
        assert "pure_python" not in hook.data


def test_a_compiled_wheel_is_one_for_this_python(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("GENIE_SIM_COMPILE", "1")
    hook = Hook("", monkeypatch)
    hook.build()
    assert [name.partition(">")[0] for name in hook.dependencies()] == ["cython", "setuptools"]
    assert "genie_sim/_compiled" in hook.data["force_include"].values()
    assert hook.data["pure_python"] is False and hook.data["infer_tag"] is True


def test_a_failing_compiler_makes_a_plain_wheel_that_says_why(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("GENIE_SIM_COMPILE", "1")
    hook = Hook("CompileError: no gcc", monkeypatch)
    hook.build()
    assert json.loads(hook.manifest) == {"failed": "CompileError: no gcc"}
    assert hook.data["pure_python"] is True and hook.data["infer_tag"] is False


def test_a_compiler_that_fails_is_told_in_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def broken(folder: Path, scratch: Path) -> None:
        raise RuntimeError("gcc:\n  not found")

    monkeypatch.setattr(compile_engine, "compile_into", broken)
    monkeypatch.setattr(sys, "argv", ["compile_engine.py", str(tmp_path / "made")])
    assert compile_engine.main() == "RuntimeError: gcc: not found"
    assert not (tmp_path / "made").exists()


# What the .pxd files say of the modules beside them

CLASS = re.compile(r"^cdef class (\w+)(?:\((\w+)\))?:\n((?:    .*\n|\n)*)", re.MULTILINE)
ATTRIBUTE = re.compile(r"^    cdef (?:public |readonly )?(?:long )?\w+ (\w+)$", re.MULTILINE)
METHOD = re.compile(r"^    cp?def (?:\w+ )?(\w+)\(", re.MULTILINE)
MODULES = compile_engine.modules(REPOSITORY)
TWINS = {name: path for name, path in MODULES.items() if path.with_suffix(".pyx").exists()}
MAX_TWIN_LINES = 700  # in C, of all modules that stand there in Python and in C


def declared() -> dict[str, tuple[str, set[str], set[str]]]:
    """Base, attributes and methods of each class in a ``.pxd``."""
    classes = {}
    for name, path in MODULES.items():
        if name in TWINS:
            continue  # compiled from another source, held to the same behaviour by its tests
        text = (REPOSITORY / path.with_suffix(".pxd")).read_text(encoding="utf-8")
        for name, base, body in CLASS.findall(text):
            classes[name] = base, set(ATTRIBUTE.findall(body)), set(METHOD.findall(body))
    return classes


def assigned(of_class: ast.ClassDef) -> set[str]:
    """The attributes that the methods of a class set on ``self``."""
    return {
        node.attr
        for node in ast.walk(of_class)
        if isinstance(node, ast.Attribute)
        and isinstance(node.ctx, ast.Store)
        and isinstance(node.value, ast.Name)
        and node.value.id == "self"
    }


@pytest.mark.parametrize("module", sorted(set(MODULES) - set(TWINS)))
def test_every_attribute_and_method_is_declared_as_it_is_used(module: str):
    """An instance of a compiled class has the attributes of its ``.pxd`` and no others. Typed code
    calls a method of a ``.pxd`` directly, so what overrides it is in a ``.pxd``, too.
    """
    classes = declared()
    tree = ast.parse((REPOSITORY / MODULES[module]).read_text(encoding="utf-8"))
    for node in tree.body:
        if not isinstance(node, ast.ClassDef) or node.name not in classes:
            continue
        name = f"{module}.{node.name}"
        base, attributes, methods = classes[node.name]
        defined = {part.name: part for part in node.body if isinstance(part, ast.FunctionDef)}
        assert methods <= set(defined), f"{name}: only in the .pxd"
        for method in methods:
            assert "super()" not in ast.unparse(defined[method]), f"{name}.{method}: super()"
        while base in classes:
            base, inherited, overridden = classes[base]
            attributes = attributes | inherited
            assert overridden & set(defined) <= methods, f"{name}: overrides what is in a .pxd"
        assert assigned(node) <= attributes, f"{name}: not in the .pxd"


def test_little_is_written_twice():
    """Twins are structures of data, with no rule of Genie's inside."""
    assert set(TWINS) == {
        "genie_sim.recording.near_pairs",
        "genie_sim.header",
        "genie_sim.place_index",
        "genie_sim.recording.packed_rows",
        "genie_sim.sim.timeline",
    }
    sources = {
        suffix: [
            (REPOSITORY / path).with_suffix(suffix).read_text(encoding="utf-8")
            for path in TWINS.values()
        ]
        for suffix in (".py", ".pxd", ".pyx")
    }
    in_c = "".join(sources[".pxd"] + sources[".pyx"])
    assert len(in_c.splitlines()) <= MAX_TWIN_LINES
    source = in_c + "".join(sources[".py"])
    imported = set(re.findall(r"^from genie_sim\S+", source, re.M))
    for_annotations = {"from genie_sim.messages", "from genie_sim.monitor"}
    assert imported == {*for_annotations, "from genie_sim.grid"}


# Both engines


@pytest.mark.skipif(not ENGINE.is_compiled, reason=f"the engine is {ENGINE.title}")
def test_both_engines_give_the_same_bytes():
    """Every table of scenarios in which each compiled module has its part, whatever the order of
    sets is.
    """
    outcomes = []
    for pure, hash_seed in (("", "0"), ("1", "12345")):
        told = subprocess.run(
            [sys.executable, "-m", "tests.engine_digests"],
            cwd=REPOSITORY,
            env={**os.environ, "GENIE_SIM_PURE": pure, "PYTHONHASHSEED": hash_seed},
            capture_output=True,
            text=True,
        )
        assert told.returncode == 0, told.stderr
        outcomes.append(json.loads(told.stdout))
    compiled, plain = outcomes
    assert compiled["engine"] == "compiled"
    assert plain["engine"] == "plain Python (GENIE_SIM_PURE is set)"
    assert compiled["runs"] == plain["runs"]
