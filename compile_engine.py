"""Compiles the simulator with Cython: every module of the package with a ``.pxd`` beside it.

    python compile_engine.py [FOLDER]

A ``.pxd`` says which classes become extension types, and what types their attributes and methods
have; the ``.py`` file stays the only source. Where a ``.pyx`` stands beside them, that is compiled
in its place: the same in C. The extension modules go to FOLDER, by default
``genie_sim/_compiled`` of this checkout, with a manifest that says of which bytes they were made.
``genie_sim.engine`` loads them. A build of a wheel does the same where ``GENIE_SIM_COMPILE=1`` is
set (``hatch_build.py``).
"""

import hashlib
import json
import os
import re
import shutil
import sys
import sysconfig
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent
PACKAGE = "genie_sim"
FOLDER = "_compiled"  # of the package
MANIFEST = "manifest.json"
# The same results as Python's: no product is fused with a sum, and annotations such as ``float``
# for what may be a whole number mean nothing.
DIRECTIVES = {"language_level": 3, "annotation_typing": False, "auto_pickle": False}
# What extension types have by nature or cannot have, and Cython refuses to read.
SLOTS = re.compile(r"^(@dataclass\(.*)slots=True(?:, )?", re.MULTILINE)
GENERIC = re.compile(r"^(class \w+)\(Generic\[\w+\]\):$", re.MULTILINE)
SUBSCRIPTABLE = r"""\1:
    @classmethod
    def __class_getitem__(cls, item):
        return cls
"""
LONGEST_REASON = 200  # characters
OPTIONS = ["/O2", "/fp:precise"] if os.name == "nt" else ["-O2", "-g0", "-ffp-contract=off"]


def modules(root: Path) -> dict[str, Path]:
    """The modules to compile by name: those with a ``.pxd`` beside them, relative to the root."""
    sources = sorted(path.with_suffix(".py") for path in (root / PACKAGE).rglob("*.pxd"))
    relative = [path.relative_to(root) for path in sources if path.name != "__init__.py"]
    return {".".join(path.with_suffix("").parts): path for path in relative}


def in_c(path: Path) -> Path:
    """What is compiled for a module: its ``.pyx``, where it has one, else the ``.py`` itself."""
    twin = path.with_suffix(".pyx")
    return twin if twin.exists() else path


def copy_sources(root: Path, folder: Path) -> None:
    """Copies what Cython reads, without slots of data classes and without ``Generic``."""
    for path in (root / PACKAGE).rglob("*.p*"):
        if path.suffix != ".pxd" and path != in_c(path):
            continue
        if path.name == "__init__.py" or path.with_suffix(".pxd").exists():
            target = folder / path.relative_to(root)
            target.parent.mkdir(parents=True, exist_ok=True)
            text = path.read_text(encoding="utf-8")
            text = GENERIC.sub(SUBSCRIPTABLE, SLOTS.sub(r"\1", text))
            target.write_text(text, encoding="utf-8")


def compile_into(folder: Path, scratch: Path) -> None:
    """Compiles all modules of this checkout and puts them with their manifest into an empty folder.
    Raises what Cython, setuptools and the compiler raise.
    """
    from Cython.Build import cythonize
    from setuptools import Distribution, Extension

    sources = modules(ROOT)
    copy_sources(ROOT, scratch)
    os.chdir(scratch)  # Cython finds a module's package by its path
    processes = os.cpu_count() or 1
    extensions = cythonize(
        [
            Extension(
                name,
                [in_c(ROOT / path).relative_to(ROOT).as_posix()],
                extra_compile_args=OPTIONS,
            )
            for name, path in sources.items()
        ],
        nthreads=processes,
        compiler_directives=DIRECTIVES,
        quiet=True,
    )
    project = Distribution({"name": PACKAGE, "ext_modules": extensions})
    command = project.get_command_obj("build_ext")
    command.build_lib, command.build_temp = "built", "objects"
    command.parallel = processes
    command.ensure_finalized()
    command.run()
    suffix = sysconfig.get_config_var("EXT_SUFFIX")
    made = {}
    for name, path in sources.items():
        target = folder / f"{name}{suffix}"
        shutil.copyfile(command.get_ext_fullpath(name), target)
        made[name] = {"sources": digests(ROOT / path), "bytes": target.stat().st_size}
    write_manifest(folder, {"suffix": suffix, "modules": made})


def digests(path: Path) -> dict[str, str]:
    """Of a module's source files, by their suffix."""
    files = (path.with_suffix(suffix) for suffix in (".py", ".pxd", ".pyx"))
    return {
        file.suffix: hashlib.sha256(file.read_bytes()).hexdigest()
        for file in files
        if file.exists()
    }


def write_manifest(folder: Path, manifest: dict[str, object]) -> None:
    """What ``genie_sim.engine`` reads before it loads anything."""
    text = json.dumps(manifest, indent=1, sort_keys=True)
    (folder / MANIFEST).write_text(f"{text}\n", encoding="utf-8")


def main() -> str:
    """Compiles; returns in one line what was wrong if that fails."""
    folder = Path(sys.argv[1]) if sys.argv[1:] else ROOT / PACKAGE / FOLDER
    with tempfile.TemporaryDirectory() as scratch:
        made = Path(scratch) / FOLDER
        made.mkdir()
        try:
            compile_into(made, Path(scratch))
        except Exception as error:  # of any of three programs
            return f"{type(error).__name__}: {' '.join(str(error).split())[:LONGEST_REASON]}"
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(made, folder)
    return ""


if __name__ == "__main__":
    sys.exit(main() or 0)
