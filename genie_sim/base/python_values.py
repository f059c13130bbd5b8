"""Values of numpy, pandas, pathlib and classes, in the form that YAML has."""

import functools
import inspect
from collections.abc import Callable, Collection, Iterable, Mapping
from numbers import Integral, Real
from pathlib import PurePath
from types import NoneType, UnionType
from typing import Any, ParamSpec, TypeVar, Union, get_args, get_origin

from genie_sim.base.errors import UserError, as_user_error, short_repr, unknown

Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")
WORDS = {NoneType: "None", str: "a text", bool: "true or false", int: "a whole number"}
WORDS |= {Mapping: "a mapping", Collection: "a list"}
UNORDERED = (set, frozenset)  # from one process to the next what they hold has another order


def typed(function: Callable[Parameters, Result]) -> Callable[Parameters, Result]:
    """A function that raises ``UserError`` for an argument that it does not have, or of another
    type than its annotation names; what lists and mappings hold, and numbers of numpy, are left to
    the function itself.
    """
    signature = inspect.signature(function)

    @functools.wraps(function)
    def checked(*args: Parameters.args, **kwargs: Parameters.kwargs) -> Result:
        for name in kwargs.keys() - signature.parameters.keys():
            raise UserError(unknown(f"argument of {function.__name__}", name, signature.parameters))
        with as_user_error(function.__name__, TypeError):
            bound = signature.bind(*args, **kwargs)
        for name, value in bound.arguments.items():
            parameter = signature.parameters[name]
            values = value if parameter.kind is parameter.VAR_POSITIONAL else [value]
            kinds = _kinds(parameter.annotation)
            for item in values if kinds else ():
                if not _is_any_of(item, kinds):
                    words = " or ".join(WORDS.get(kind, f"a {kind.__name__}") for kind in kinds)
                    text = f"{name.rstrip('_')}: {short_repr(item)} of type {type(item).__name__}"
                    raise UserError(f"{text}: expected {words}")
        return function(*args, **kwargs)

    return checked


def _kinds(annotation: Any) -> list[type]:
    """The types that an annotation names; none where it says nothing that can be checked."""
    if get_origin(annotation) in (Union, UnionType):
        kinds = [_kinds(part) for part in get_args(annotation)]
        return [kind for part in kinds for kind in part] if all(kinds) else []
    kind = NoneType if annotation is None else get_origin(annotation) or annotation
    if not isinstance(kind, type) or kind is inspect.Parameter.empty:
        return []
    if kind not in (str, Mapping) and issubclass(kind, Collection):
        kind = Collection  # arrays of numpy and pandas are no sequences
    return [kind]


def _is_any_of(value: object, kinds: list[type]) -> bool:
    if isinstance(value, str | bytes):
        return str in kinds and isinstance(value, str)
    if isinstance(value, bool):
        return bool in kinds
    if isinstance(value, Integral) and int in kinds:
        return True
    if isinstance(value, Mapping) and Mapping not in kinds:
        return False
    if isinstance(value, UNORDERED):
        return False
    return any(
        all(hasattr(value, name) for name in _members(kind))
        if getattr(kind, "_is_protocol", False)
        else isinstance(value, kind)
        for kind in kinds
    )


def _members(protocol: type) -> list[str]:
    return [name for name in vars(protocol) if name == "__call__" or not name.startswith("_")]


def plain(value: Any, where: str) -> Any:
    """The value in lists, mappings with text keys, texts, numbers, truth values and None.

    Numbers and arrays of numpy and pandas are what they hold, a path is its text, and a class
    is named by its module: ``mine:Link``.

    Parameters
    ----------
    value : object
        What a program has given.
    where : str
        What it is for, for the error line.

    Raises ``UserError`` for anything else.
    """
    if value is None or isinstance(value, bool | str | int | float):
        return _builtin(value)
    if isinstance(value, type):
        return f"{value.__module__}:{value.__qualname__}"
    if isinstance(value, PurePath):
        return str(value)
    if isinstance(value, Mapping):
        return {str(key): plain(item, f"{where}.{key}") for key, item in value.items()}
    if getattr(value, "ndim", None) == 0 and hasattr(value, "item"):  # a scalar of numpy
        return plain(value.item(), where)
    if isinstance(value, Iterable) and not isinstance(value, (bytes, bytearray, *UNORDERED)):
        return [plain(item, f"{where}[{index}]") for index, item in enumerate(value)]
    if isinstance(value, Integral):
        return int(value)
    if isinstance(value, Real):
        return float(value)
    raise UserError(
        f"{where}: {short_repr(value)} of type {type(value).__name__}: expected a number, a text, a"
        " truth value, a list, a mapping or a class"
    )


def _builtin(value: Any) -> Any:
    """``numpy.float64`` and ``numpy.str_`` are subclasses of what they stand for."""
    for kind in (bool, int, float, str):
        if isinstance(value, kind):
            return value if type(value) is kind else kind(value)
    return value
