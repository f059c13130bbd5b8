"""Values of numpy, pandas, pathlib and classes, in the form that YAML has."""

import datetime
from collections.abc import Iterable, Mapping
from numbers import Integral, Real
from pathlib import PurePath
from typing import Any

from genie_sim.base.errors import UserError, short_repr


def plain(value: Any, where: str) -> Any:
    """The value in lists, mappings with text keys, texts, numbers, truth values and None.

    Numbers and arrays of numpy and pandas are what they hold, a path is its text, a time difference
    is a duration, and a class is named by its module: ``mine:Link``.

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
    if isinstance(value, datetime.timedelta):  # pandas.Timedelta is one, and counts nanoseconds
        ns = getattr(value, "value", None)
        return f"{ns} ns" if isinstance(ns, int) else f"{value // datetime.timedelta.resolution} us"
    if isinstance(value, Mapping):
        return {str(key): plain(item, f"{where}.{key}") for key, item in value.items()}
    if getattr(value, "ndim", None) == 0 and hasattr(value, "item"):  # a scalar of numpy
        return plain(value.item(), where)
    if isinstance(value, Iterable) and not isinstance(value, bytes | bytearray):
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
