"""Which engine runs: modules compiled from this very source, or plain Python.

A build may leave extension modules in the folder ``_compiled`` of the package, with a manifest of
what they were made of. They are used all together or not at all: a module that was compiled with
others works with those alone. Both engines give the same results.
"""

import os
import sys
from collections.abc import Sequence
from importlib.machinery import EXTENSION_SUFFIXES, ExtensionFileLoader, ModuleSpec
from pathlib import Path
from types import ModuleType
from typing import Any

FOLDER = "_compiled"
MANIFEST = "manifest.json"
PURE = "GENIE_SIM_PURE"


class CompiledFinder:
    """Finds extension modules in the place of the Python modules that they were compiled from."""

    def __init__(self, paths: dict[str, Path]) -> None:
        self._paths = paths

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """See ``importlib``; ``None`` for all other modules."""
        file = self._paths.get(name)
        return None if file is None else spec_of(name, file)


class Engine:
    """What runs in this process. ``why_plain`` is empty for the compiled engine, else the reason
    why it is not used.
    """

    def __init__(self, package: Path) -> None:
        self.why_plain = ""
        self._finder: CompiledFinder | None = None
        folder = package / FOLDER
        try:
            paths = usable_modules(package, folder)
            probe(paths)
        except NotUsable as reason:
            self.why_plain = str(reason)
        else:
            self._finder = CompiledFinder(paths)

    @property
    def is_compiled(self) -> bool:
        return self._finder is not None

    @property
    def title(self) -> str:
        """One line: which engine, and why not the compiled one."""
        return "compiled" if self.is_compiled else f"plain Python ({self.why_plain})"

    def install(self) -> None:
        """Imports of the package find compiled modules from now on, if they are usable."""
        if self._finder is not None:
            sys.meta_path.insert(0, self._finder)


def spec_of(name: str, file: Path) -> ModuleSpec:
    """How a compiled module is loaded from its file."""
    spec = ModuleSpec(name, ExtensionFileLoader(name, str(file)), origin=str(file))
    spec.has_location = True
    return spec


class NotUsable(Exception):
    """Why the compiled engine cannot be used, in a few words."""


def usable_modules(package: Path, folder: Path) -> dict[str, Path]:
    """The files of the compiled modules by name. Raises ``NotUsable`` unless all of them are whole
    and made of the package's present source for this Python.
    """
    manifest = folder / MANIFEST
    if not manifest.is_file():
        raise NotUsable("not compiled")
    if os.environ.get(PURE, "") not in {"", "0"}:
        raise NotUsable(f"{PURE} is set")
    import hashlib
    import json

    try:
        build: dict[str, Any] = json.loads(manifest.read_bytes())
        if "failed" in build:
            raise NotUsable(f"compiling failed when it was installed: {build['failed']}")
        suffix = build["suffix"]
        if suffix != EXTENSION_SUFFIXES[0]:
            raise NotUsable(f"compiled for another Python: {suffix} is not {EXTENSION_SUFFIXES[0]}")
        paths = {}
        for name, made in build["modules"].items():
            module = package.joinpath(*name.split(".")[1:])
            for suffix_of_source, digest in made["sources"].items():
                source = module.with_suffix(suffix_of_source)
                # an installed package has no more than the .py
                if suffix_of_source != ".py" and not source.exists():
                    continue
                if hashlib.sha256(source.read_bytes()).hexdigest() != digest:
                    raise NotUsable(f"stale: {name} has changed since it was compiled")
            paths[name] = folder / f"{name}{suffix}"
            if paths[name].stat().st_size != made["bytes"]:
                raise NotUsable(f"damaged: {paths[name].name}")
    except (OSError, ValueError, TypeError, KeyError, AttributeError) as error:
        raise NotUsable(f"damaged: {folder.name}: {type(error).__name__}: {error}") from error
    if not paths:
        raise NotUsable("nothing was compiled")
    return paths


def probe(paths: dict[str, Path]) -> None:
    """Lets the system load one compiled module, without running it. Raises ``NotUsable``."""
    spec = spec_of(*next(iter(paths.items())))
    try:
        ExtensionFileLoader(spec.name, str(spec.origin)).create_module(spec)
    except ImportError as error:
        raise NotUsable(f"cannot be loaded: {' '.join(str(error).split())}") from error


ENGINE = Engine(Path(__file__).parent)
