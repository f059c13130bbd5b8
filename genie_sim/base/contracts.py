"""Checks of what classes of the user's own return: a wrong type is one line that names the class
and the method.

The package's own classes are checked by mypy, so only own ones are wrapped.
"""

import sys
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from numbers import Integral, Real
from typing import Any, NamedTuple

from genie_sim.base.errors import UserError, short_repr

MAX_WHOLE = 2**62  # what tables can hold
MAX_NUMBER = sys.float_info.max


class Contract(NamedTuple):
    """What a value must be: in words, and as a test. ``then`` makes of a right one, its owner and
    field what is handed on in its place, such as a ``Checked``.
    """

    expected: str
    holds: Callable[[Any], bool]
    then: Callable[[Any, str, str], Any] | None = None


def require(owner: str, field: str, value: Any, contract: Contract) -> Any:
    """``value``, or what the contract makes of it, if it is what the contract says. Raises
    ``UserError``.

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
    return value if contract.then is None else contract.then(value, owner, field)


class Checked:
    """Passes everything on to an object of the user's own, and checks what its methods return.

    Parameters
    ----------
    checked : object
        The object.
    owner : str
        Its class, as error lines name it.
    contracts : mapping
        By the name of a method, what it must return.
    """

    def __init__(self, checked: Any, owner: str, contracts: Mapping[str, Contract]) -> None:
        for name, contract in contracts.items():
            method = require(owner, name, getattr(checked, name, None), METHOD)
            self.__dict__[name] = _checked(method, owner, f"{name}()", contract)
        self.__dict__["_checked"] = checked

    def __getattr__(self, name: str) -> Any:
        return getattr(self.__dict__["_checked"], name)

    def __setattr__(self, name: str, value: Any) -> None:
        setattr(self.__dict__["_checked"], name, value)


def _checked(
    method: Callable[..., Any], owner: str, field: str, contract: Contract
) -> Callable[..., Any]:
    def call(*arguments: Any, **parameters: Any) -> Any:
        return require(owner, field, method(*arguments, **parameters), contract)

    return call


def checked(own: Any, owner: str | None, contracts: Mapping[str, Contract]) -> Any:
    """The object itself, or ``Checked`` where it has an ``owner``: is of a class of the user's own
    (see ``plugins.own_label``).
    """
    return own if owner is None else Checked(own, owner, contracts)


def has(contracts: Mapping[str, Contract]) -> Contract:
    """An object with methods that return what these contracts say."""
    *names, last = contracts
    return Contract(
        f"an object with {', '.join(names)} and {last}" if names else f"an object with {last}",
        lambda value: all(callable(getattr(value, name, None)) for name in contracts),
        lambda value, owner, _: Checked(value, owner, contracts),
    )


def _is_whole(value: Any) -> bool:
    return (
        isinstance(value, Integral) and not isinstance(value, bool) and 0 <= int(value) < MAX_WHOLE
    )


def is_number(value: Any) -> bool:
    """Whether a value is a finite number."""
    number: Any = value  # a Real, whose comparisons have no types
    is_real = isinstance(value, Real) and not isinstance(value, bool)
    return is_real and bool(abs(number) <= MAX_NUMBER)


def _is_texts(value: Any) -> bool:
    return isinstance(value, tuple | list) and all(isinstance(item, str) for item in value)


def optional(contract: Contract) -> Contract:
    """The same, or ``None``."""
    then = contract.then
    return Contract(
        f"{contract.expected}, or None",
        lambda value: value is None or contract.holds(value),
        then and (lambda value, *of: None if value is None else then(value, *of)),
    )


METHOD = Contract("a method", callable)
WHOLE = Contract("a whole number, 0 or more", _is_whole)
NUMBER = Contract("a number", is_number)
POSITIVE = Contract("a number above 0", lambda value: is_number(value) and value > 0)
TEXT = Contract("text", lambda value: isinstance(value, str) and value != "")
TEXTS = Contract("a tuple of texts", _is_texts)
BOOLEAN = Contract("True or False", lambda value: isinstance(value, bool))
SHARE = Contract("a number from 0 to 1", lambda value: is_number(value) and 0 <= value <= 1)
HASHABLE = Contract("hashable", lambda value: isinstance(value, Hashable))
MAPPING = Contract("a mapping", lambda value: isinstance(value, Mapping))
SEQUENCE = Contract(
    "a sequence with at least one item",
    lambda value: (
        isinstance(value, Sequence) and not isinstance(value, str | bytes) and len(value) > 0
    ),
)
ITERABLE = Contract("something to iterate over", lambda value: isinstance(value, Iterable))
