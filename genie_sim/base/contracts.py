"""Checks of what classes of the user's own give before a run: a wrong type is one line that names
the class and the field.
"""

import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from numbers import Integral, Real
from typing import Any, NamedTuple

from genie_sim.base.errors import UserError, short_repr

MAX_WHOLE = 2**62  # what tables can hold
MAX_NUMBER = sys.float_info.max


class Contract(NamedTuple):
    """What a value must be: in words, and as a test."""

    expected: str
    holds: Callable[[Any], bool]


def require(owner: str, field: str, value: Any, contract: Contract) -> Any:
    """``value``, if it is what the contract says. Raises ``UserError``.

    Parameters
    ----------
    owner : str
        The class, such as ``link model 'my_module:MyRadio'``.
    field : str
        What the value is of it, such as ``delay_ns()``.
    value : object
        What the class returned.
    contract : Contract
        What it should be.
    """
    if not contract.holds(value):
        raise UserError(f"{owner}: {field} is {short_repr(value)}, but must be {contract.expected}")
    return value


def whole(owner: object, field: str, value: Any) -> int:
    """What a method of ``owner``, perhaps of a class of the user's own, returned, if it is a whole
    number of 0 or more. Raises ``UserError``.
    """
    if type(value) is not int or not 0 <= value < MAX_WHOLE:
        require(class_of(owner), field, value, WHOLE)
    return int(value)


def class_of(thing: object) -> str:
    """How scenarios name the class of an object: ``package.module:Class``."""
    return f"{type(thing).__module__}:{type(thing).__qualname__}"


def _is_whole(value: Any) -> bool:
    return (
        isinstance(value, Integral) and not isinstance(value, bool) and 0 <= int(value) < MAX_WHOLE
    )


def is_number(value: Any) -> bool:
    """Whether a value is a finite number."""
    number: Any = value  # a Real, whose comparisons have no types
    is_real = isinstance(value, Real) and not isinstance(value, bool)
    return is_real and bool(abs(number) <= MAX_NUMBER)


def optional(contract: Contract) -> Contract:
    """The same, or ``None``."""
    return Contract(
        f"{contract.expected}, or None", lambda value: value is None or contract.holds(value)
    )


METHOD = Contract("a method", callable)
WHOLE = Contract("a whole number, 0 or more", _is_whole)
POSITIVE = Contract("a number above 0", lambda value: is_number(value) and value > 0)
TEXT = Contract("text", lambda value: isinstance(value, str) and value != "")
BOOLEAN = Contract("True or False", lambda value: isinstance(value, bool))
SHARE = Contract("a number from 0 to 1", lambda value: is_number(value) and 0 <= value <= 1)
MAPPING = Contract("a mapping", lambda value: isinstance(value, Mapping))
SEQUENCE = Contract(
    "a sequence with at least one item",
    lambda value: (
        isinstance(value, Sequence) and not isinstance(value, str | bytes) and len(value) > 0
    ),
)
ITERABLE = Contract("something to iterate over", lambda value: isinstance(value, Iterable))
