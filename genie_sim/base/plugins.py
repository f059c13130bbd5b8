"""Code found by name: an entry of a registry, or a class of the user's own written
``package.module:Class``.

A registry is an explicit dict from a name to a class, or to the text ``package.module:Class`` of
one that is imported when it is asked for.

Around a class of the user's own stand, from the outside in:

- ``own_code_allowed``: whether one may be imported. The library may; a command only if its body, or
  ``--allow-own-code``, calls ``allow_own_code``; a worker what may who gives it work;
- ``own_faults_told``: what is raised within becomes a line with the class and the place;
- ``resolve``, which imports the class, and ``call``, which calls it, both within the former, as a
  simulation is;
- checks of what it returns, where that is used: ``base.contracts``, frames in ``runs.own_classes``.
"""

import importlib
import re
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from genie_sim.base.errors import UserError, as_user_error, short_repr, text_of, unknown
from genie_sim.base.paths import working_folder_kept

Parameter = bool | int | float | str
_CLASS = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*:[A-Za-z_]\w*")
NOT_IMPORTED = (ImportError, AttributeError, SyntaxError, ValueError, OSError)
_own_code_allowed = True
_own_modules: dict[str, dict[str, str]] = {}  # of each the classes, as error lines call them


def is_own_code_allowed() -> bool:
    """Whether a class of the user's own may be imported now."""
    return _own_code_allowed


@contextmanager
def own_code_allowed(allowed: bool) -> Iterator[None]:
    """Unless ``allowed``, nothing in this process imports a class of the user's own while it lasts:
    what a result folder names may be anybody's.
    """
    global _own_code_allowed
    before, _own_code_allowed = _own_code_allowed, allowed
    try:
        yield
    finally:
        _own_code_allowed = before


def allow_own_code() -> None:
    """Allows it until the ``own_code_allowed`` around this ends, such as that around a command."""
    global _own_code_allowed
    _own_code_allowed = True


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
    """The class or function called ``name``; an own one must have the ``methods``. Raises
    ``UserError``.

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
        _own_modules.setdefault(module_name, {})[class_name] = f"{what} {name!r}"
        if not _own_code_allowed:
            raise UserError(f"{what} {name!r}: is code of its own; pass --allow-own-code to run it")
        if "" not in sys.path:
            sys.path.append("")
    # whatever an own module raises when it is imported, and what Python says of one that it cannot
    with as_user_error(f"{what} {name!r}", *NOT_IMPORTED), own_faults_told():
        if entry is None:
            own_sources.forget_edited(module_name)
        made = getattr(importlib.import_module(module_name), class_name)
    if entry is None:
        own_sources.note(module_name)
    lacking = [method for method in methods if not hasattr(made, method)]
    if lacking:
        raise UserError(f"{what} {name!r}: has no {', '.join(lacking)}; needs {', '.join(methods)}")
    return made


class OwnPlace(NamedTuple):
    """Where code of the user's own is: its class, such as ``fault 'mine:Flap'``, or where no class
    called it each that is named of its module; and ``mine.py, line 12, in run``.
    """

    owners: tuple[str, ...]
    line: str

    @property
    def owner(self) -> str:
        """What error lines begin with."""
        return " or ".join(self.owners)


def own_fault(error: BaseException) -> str | None:
    """One line about an exception that comes out of a class of the user's own, ``None`` for any
    other.
    """
    place = own_place(error)
    if place is None:
        return None
    text = f"{type(error).__name__}: {short_repr(text_of(error))}"
    return f"{place.owner}: {text} ({place.line})"


def own_place(error: BaseException) -> OwnPlace | None:
    """Where in code of the user's own an exception was raised, or what raised it was called."""
    import traceback

    place = None
    for frame, number in reversed(list(traceback.walk_tb(error.__traceback__))):
        code, classes = frame.f_code, _own_modules.get(frame.f_globals.get("__name__", ""))
        if classes is None:
            continue
        if place is None:
            line = f"{Path(code.co_filename).name}, line {number}, in {code.co_name}"
            place = OwnPlace((*classes.values(),), line)
        owner = classes.get(code.co_qualname.partition(".")[0])
        if owner is not None:
            return place._replace(owners=(owner,))
    # SimPy raises a copy of what ends a process
    return own_place(error.__cause__) if place is None and error.__cause__ is not None else place


@contextmanager
def own_faults_told() -> Iterator[None]:
    """Whatever comes out of a class of the user's own becomes a ``UserError`` that names it, and
    the working folder is where it was.
    """
    try:
        with working_folder_kept():
            yield
    except UserError as error:
        place = own_place(error)
        if place is None or any(owner in str(error) for owner in place.owners):
            raise
        raise UserError(f"{place.owner}: {error}") from error
    except BaseException as error:
        fault = own_fault(error)
        if fault is None or isinstance(error, KeyboardInterrupt):
            raise
        raise UserError(fault) from error


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
