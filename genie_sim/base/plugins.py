"""Code found by name: an entry of a registry, or a class of the user's own written
``package.module:Class``.

A registry is an explicit dict from a name to a class, or to the text ``package.module:Class`` of
one that is imported when it is asked for.

The way of a class of the user's own: ``own_code_allowed`` says whether one may be imported at all,
``resolve`` imports it, ``call`` calls it; ``own_faults_told``, around both and around a simulation,
turns what it raises into a line that names it. ``own_fault`` makes that line, ``own_place`` finds
whose code it is. What it returns is checked where it is used (``base.contracts``; frames in
``runs.own_classes``).
"""

import importlib
import re
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import Any

from genie_sim.base.errors import UserError, as_user_error, short_repr, text_of, unknown
from genie_sim.base.paths import working_folder_kept

Parameter = bool | int | float | str
_CLASS = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*:[A-Za-z_]\w*")
NOT_IMPORTED = (ImportError, AttributeError, SyntaxError, ValueError, OSError)
_own_code_allowed = True
_own_modules: dict[str, str] = {}  # what was asked of each


@contextmanager
def own_code_allowed(allowed: bool) -> Iterator[None]:
    """Unless ``allowed``, nothing in this process imports a class of the user's own while it lasts:
    what a result folder names may be anybody's. Around everything that a command does with such a
    folder.
    """
    global _own_code_allowed
    before, _own_code_allowed = _own_code_allowed, allowed
    try:
        yield
    finally:
        _own_code_allowed = before


@dataclass(frozen=True)
class Choice:
    """A plug-in by name, and the keyword arguments for it."""

    name: str
    parameters: Mapping[str, Any] = field(default_factory=dict)


def is_own(name: object) -> bool:
    """Whether a name is written as a class of the user's own: ``package.module:Class``."""
    return isinstance(name, str) and _CLASS.fullmatch(name) is not None


def own_label(what: str, name: str) -> str | None:
    """What error lines call a class of the user's own, ``None`` for one of the package."""
    return f"{what} {name!r}" if is_own(name) else None


OWN_CLASS_PATTERN = f"^{_CLASS.pattern}$"


def checked_name(what: str, name: object, registry: Mapping[str, object]) -> str:
    """``name`` if it is in the registry or written as an own class. Raises ``ValueError`` with the
    choices.
    """
    if isinstance(name, str) and (name in registry or is_own(name)):
        return name
    if not registry:
        raise ValueError(f"must be a {what} of your own, package.module:Class, not {name!r}")
    raise ValueError(f"{unknown(what, name, registry)}, or package.module:Class")


def resolve(
    what: str, name: str, registry: Mapping[str, Any], methods: tuple[str, ...] = ()
) -> Any:
    """The class or function called ``name``; an own one must have the ``methods``,
    of ``a or b`` either. Raises ``UserError``.

    The module may lie in the current folder, also for the installed command, where Python does not
    look by itself.
    """
    from genie_sim.base import own_sources

    entry = registry.get(name)
    if entry is not None and not isinstance(entry, str):
        return entry
    path = name if entry is None else entry
    if not is_own(path):
        raise UserError(unknown(what, name, registry))
    module_name, _, class_name = path.partition(":")
    if module_name.endswith(".py"):
        hint = f"{module_name.removesuffix('.py')}:{class_name}"
        raise UserError(f"{what} {name!r}: a module is named without .py: {hint}")
    if entry is None:
        _own_modules[module_name] = f"{what} {name!r}"
        if not _own_code_allowed:
            raise UserError(
                f"{what} {name!r}: is third-party code; pass --allow-own-code to run it"
            )
        if "" not in sys.path:
            sys.path.append("")
    # whatever an own module raises when it is imported, and what Python says of one that it cannot
    with as_user_error(f"{what} {name!r}", *NOT_IMPORTED), own_faults_told():
        if entry is None:
            own_sources.forget_edited(module_name)
        made = getattr(importlib.import_module(module_name), class_name)
    if entry is None:
        own_sources.note(module_name)
    lacking = [
        method
        for method in methods
        if not any(hasattr(made, name) for name in method.split(" or "))
    ]
    if lacking:
        raise UserError(f"{what} {name!r}: has no {', '.join(lacking)}; needs {', '.join(methods)}")
    return made


def own_fault(error: BaseException) -> str | None:
    """One line about an exception that comes out of a class of the user's own, ``None`` for any
    other.
    """
    place = _place_within(error)
    if place is None:
        return None
    whose, where = place.split(" (", 1)
    return f"{whose}: {type(error).__name__}: {short_repr(text_of(error))} ({where}"


def _place_within(error: BaseException) -> str | None:
    """Where in code of the user's own an exception was raised, or called what raised it."""
    import traceback

    for frame, line in reversed(list(traceback.walk_tb(error.__traceback__))):
        place = own_place(frame, line)
        if place:
            return place
    # SimPy raises a copy of what ends a process
    return None if error.__cause__ is None else _place_within(error.__cause__)


@contextmanager
def own_faults_told() -> Iterator[None]:
    """Whatever comes out of a class of the user's own becomes a ``UserError`` that names it, and
    the working folder is where it was.
    """
    try:
        with working_folder_kept():
            yield
    except UserError as error:
        place = _place_within(error)
        whose = "" if place is None else place.split(" (", 1)[0]
        if whose in str(error):
            raise
        raise UserError(f"{whose}: {error}") from error
    except BaseException as error:
        fault = own_fault(error)
        if fault is None or isinstance(error, KeyboardInterrupt):
            raise
        raise UserError(fault) from error


def own_place(frame: FrameType, line: int | None = None) -> str | None:
    """The class of the user's own to which code belongs that is running, and where it is:
    ``fault 'mine:Flap' (mine.py, line 12, in run)``; ``None`` for any other code.
    """
    whose = _own_modules.get(frame.f_globals.get("__name__", ""))
    if whose is None:
        return None
    code = frame.f_code
    name = Path(code.co_filename).name
    return f"{whose} ({name}, line {line or frame.f_lineno}, in {code.co_name})"


def call(what: str, name: str, made: Any, /, *arguments: Any, **parameters: Any) -> Any:
    """What a class or function, perhaps of the user's own, returns. Raises ``UserError`` for wrong
    arguments.
    """
    with as_user_error(f"{what} {name!r}", TypeError, ValueError), own_faults_told():
        return made(*arguments, **parameters)


def code_digest(what: str, name: str) -> str:
    """sha256 of the files of what is the user's own: its code decides the outcome, too."""
    from genie_sim.base import own_sources

    return own_sources.digest(resolve(what, name, {}), name.partition(":")[0])
