"""The files of a class of the user's own: its module, and what is imported from beside it. They
decide what a run gives, so they belong to what identifies its result.
"""

import ast
import hashlib
import importlib
import inspect
import os
import sys
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any

from genie_sim.base.paths import sha256_of

OTHERS = {*sys.stdlib_module_names, "genie_sim"}
INSTALLED = {"site-packages", "dist-packages"}  # folders of packages that are nobody's own
_imported: dict[str, dict[Path, str]] = {}  # of each module: the digests of its files when imported
_tokens: dict[int, tuple[object, str]] = {}  # of classes without a file; holds them, or ids recur


def digest(made: Any, module: str) -> str:
    """sha256 of the files of a class, or of the ``module`` that has an object such as a metric.

    What has no file, as it was made in a notebook, has a digest of its own, which no other process
    and no other definition has: its results are never taken for another's.
    """
    thing = inspect.unwrap(made)
    try:
        if inspect.isclass(thing) or inspect.isfunction(thing):
            inspect.getfile(thing)
            module = thing.__module__
        digests = _digests(module)
    except (TypeError, OSError):
        digests = {}
    if not digests:
        _, token = _tokens.setdefault(id(made), (made, os.urandom(16).hex()))
        return f"in no file: {token}"
    found = sorted(digests.values())
    return found[0] if len(found) == 1 else hashlib.sha256(" ".join(found).encode()).hexdigest()


def forget_edited(module: str) -> None:
    """Lets a module, and what it imports from beside it, be imported anew where a file of theirs
    was edited since. Classes that are in use stay as they are.
    """
    before = _imported.get(module)
    if before is None or module == "__main__" or _digests(module) == before:
        return
    files = _imported.pop(module)
    for name, loaded in list(sys.modules.items()):
        if Path(getattr(loaded, "__file__", None) or "").resolve() in files:
            del sys.modules[name]
    importlib.invalidate_caches()


def note(module: str) -> None:
    """A module has been imported, as its files are now."""
    _imported.setdefault(module, _digests(module))


def _digests(module: str) -> dict[Path, str]:
    """The digest of a module's file, and of what that one imports from its own folder, or from that
    of its package.
    """
    file = getattr(sys.modules.get(module), "__file__", None)
    if file is None:
        return {}
    path = Path(file).resolve()
    package, *inner = module.split(".")
    root = path.parents[len(inner) + (path.name == "__init__.py")]
    waiting = [path, *_paths(root, [package, *inner])]
    digests: dict[Path, str] = {}
    while waiting:
        path = waiting.pop()
        if path in digests or not path.is_file():
            continue
        digests[path] = sha256_of(path)
        for level, names in _imports(path, digests[path]):
            folder = path.parents[level - 1] if level else root
            own = names[0] == package if root.name in INSTALLED else names[0] not in OTHERS
            if folder != root or own:
                waiting += _paths(folder, names)
    return digests


@lru_cache(maxsize=1000)
def _imports(path: Path, digest: str) -> list[tuple[int, list[str]]]:
    """What a file of a digest imports, wherever it says so: how many folders up a name begins, 0
    for the root of its package, and the parts of the name.
    """
    try:
        tree = ast.parse(path.read_bytes())
    except (SyntaxError, ValueError):
        return []
    imports = []
    for node in ast.walk(tree):
        match node:
            case ast.Import():
                imports += [(0, alias.name.split(".")) for alias in node.names]
            case ast.ImportFrom():
                module = (node.module or "").split(".")
                imports += [(node.level, [*module, alias.name]) for alias in node.names]
    return imports


def _paths(folder: Path, names: list[str]) -> Iterator[Path]:
    """Where a module and the packages around it lie."""
    for name in filter(None, names):
        folder /= name
        yield folder.with_suffix(".py")
        yield folder / "__init__.py"
