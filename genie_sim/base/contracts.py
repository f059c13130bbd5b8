"""What a class of the user's own returns: a wrong value is one line that names the class."""

import sys
from numbers import Integral, Real
from typing import Any

from genie_sim.base.errors import UserError, short_repr

MAX_WHOLE = 2**62  # what tables can hold
MAX_NUMBER = sys.float_info.max
WHOLE = "a whole number, 0 or more"


def require(holds: bool, what: str, value: object, expected: str) -> None:
    """Raises ``UserError`` unless ``value`` is as ``expected``; ``what`` names the class, and what
    it is of it, such as ``link model 'mine:Radio': transmitter()``.
    """
    if not holds:
        raise UserError(f"{what} is {short_repr(value)}, but must be {expected}")


def whole(owner: object, field: str, value: Any) -> int:
    """What a method of ``owner``, perhaps of a class of the user's own, returned, if it is a whole
    number of 0 or more. Raises ``UserError``.
    """
    if type(value) is not int or not 0 <= value < MAX_WHOLE:
        require(is_whole(value), f"{class_name(owner)}: {field}", value, WHOLE)
    return int(value)


def class_name(thing: object) -> str:
    """How scenarios name the class of an object: ``package.module:Class``."""
    return f"{type(thing).__module__}:{type(thing).__qualname__}"


def is_whole(value: Any, limit: int = MAX_WHOLE) -> bool:
    """Whether a value is a whole number from 0 to below the limit."""
    return isinstance(value, Integral) and not isinstance(value, bool) and 0 <= int(value) < limit


def is_number(value: Any, lowest: float = -MAX_NUMBER, highest: float = MAX_NUMBER) -> bool:
    """Whether a value is a finite number within these limits."""
    number: Any = value  # a Real, whose comparisons have no types
    is_real = isinstance(value, Real) and not isinstance(value, bool)
    return is_real and bool(lowest <= number <= highest)
