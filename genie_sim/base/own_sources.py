"""The files of a class of the user's own: its module, and the user's own modules that this one
imports. They decide what a run gives, so they belong to what identifies its result.
"""

import ast
import functools
import hashlib
import importlib
import inspect
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from genie_sim.base.paths import sha256_of

_PACKAGE = Path(__file__).resolve().parents[1]
_imported: dict[str, dict[Path, str]] = {}  # of each module: the digests of its files when imported
_tokens: dict[int, tuple[object, str]] = {}  # of classes without a file; holds them, or ids recur


def digest(made: Any) -> str:
    """sha256 of the files of a class. A class without a file, made in a notebook, has one of its
    own, which no other process and no other definition has: its results are never taken for
    another's.
    """
    try:
        inspect.getfile(inspect.unwrap(made))
    except (TypeError, OSError):
        _, token = _tokens.setdefault(id(made), (made, os.urandom(16).hex()))
        return f"in no file: {token}"
    module = inspect.unwrap(made).__module__
    found = sorted(_digests(module).values())
    return found[0] if len(found) == 1 else hashlib.sha256(" ".join(found).encode()).hexdigest()


def forget_edited(module: str) -> None:
    """Lets a module, and what it imports of the user's, be imported anew where a file of theirs was
    edited since. Classes that are in use stay as they are.
    """
    before = _imported.get(module)
    if before is None or module == "__main__" or _digests(module) == before:
        return
    del _imported[module]
    for name in [name for name, _ in _own_modules(module)]:
        sys.modules.pop(name, None)
    importlib.invalidate_caches()


def note(module: str) -> None:
    """A module has been imported, as its files are now."""
    if module not in _imported:
        _imported[module] = _digests(module)


def _digests(module: str) -> dict[Path, str]:
    return {path: sha256_of(path) for _, path in _own_modules(module) if path.is_file()}


def _own_modules(module: str) -> Iterator[tuple[str, Path]]:
    """A module of the user's own and those that it imports, each with its file."""
    waiting, seen = list(_with_packages(module)), set[str]()
    while waiting:
        name = waiting.pop()
        if name in seen or name.rpartition(".")[0] not in seen | {""}:
            continue  # known, or in a package that is not the user's: to look there would import it
        path = _file_of(name)
        if path is None or not _is_own(path):
            continue
        seen.add(name)
        yield name, path
        waiting += _imports(name, path)


def _file_of(module: str) -> Path | None:
    loaded = getattr(sys.modules.get(module), "__file__", None)
    if loaded is not None:
        return Path(loaded).resolve()
    from importlib.util import find_spec

    try:
        spec = find_spec(module)
    except (ImportError, ValueError, AttributeError):
        return None
    return None if spec is None or spec.origin is None else Path(spec.origin).resolve()


def _is_own(path: Path) -> bool:
    """Whether a file belongs to no installed package."""
    return path.suffix == ".py" and not any(
        path.is_relative_to(folder) for folder in (*_installed(), _PACKAGE)
    )


@functools.cache
def _installed() -> tuple[Path, ...]:
    """Where Python and its packages are."""
    import sysconfig

    kinds = ("stdlib", "platstdlib", "purelib", "platlib")
    return tuple(Path(sysconfig.get_path(kind)).resolve() for kind in kinds)


def _imports(module: str, path: Path) -> Iterator[str]:
    """The modules that a file may import, wherever it says so; each with its packages."""
    try:
        tree = ast.parse(path.read_bytes())
    except (OSError, SyntaxError, ValueError):
        return
    is_package = path.name == "__init__.py"
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield from _with_packages(alias.name)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                parts = module.split(".")
                kept = parts[: len(parts) - node.level + is_package]
                base = ".".join([*kept, *filter(None, [base])])
            for alias in node.names:
                yield from _with_packages(f"{base}.{alias.name}" if base else alias.name)


def _with_packages(module: str) -> Iterator[str]:
    """``a.b.c``, ``a.b`` and ``a``: a package's own file is imported first."""
    while module:
        yield module
        module = module.rpartition(".")[0]
