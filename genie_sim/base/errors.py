"""The one exception a user may see: the input or the environment is at fault, never the program."""

import errno
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from genie_sim.base.text import one_line

# C++ libraries raise an exception of their own, whose text alone tells.
LOW_MEMORY_WORDS = ("bad_alloc", "Insufficient memory", "allocate memory")

MAX_CHOICES = 60  # named in an error: more than any list of genie-sim has, fewer than a file may


class UserError(Exception):
    """One clear line naming file, field, value and choices. ``genie-sim`` prints it and exits with
    status 1; a notebook shows the line alone.
    """

    def _render_traceback_(self) -> list[str]:
        """What IPython shows."""
        return [f"{type(self).__name__}: {one_line(str(self))}"]


class UnknownAttribute(UserError, AttributeError):
    """An object has no such attribute."""


class Suggesting:
    """A class whose objects answer a misspelt attribute with the nearest."""

    if not TYPE_CHECKING:  # or every attribute would be known

        def __getattr__(self, name):
            raise no_attribute(self, name)


def no_attribute(owner: object, name: str) -> UnknownAttribute:
    """That an object has no attribute of this name, and which it has."""
    names = [known for known in dir(owner) if not known.startswith("_")]
    text = unknown(f"attribute of {type(owner).__name__}", name, names)
    return UnknownAttribute(text)


def short_repr(value: object) -> str:
    """A value for an error message: short, on one line, whatever its class says of it."""
    try:
        text = one_line(repr(value))
    except Exception as error:
        text = f"<{type(value).__name__}, whose repr() raises {type(error).__name__}>"
    return text if len(text) <= 60 else f"{text[:57]}..."


def text_of(error: BaseException) -> str:
    """What an exception says, whose class may be the user's own; of a method that its class lacks,
    which that is.
    """
    try:
        text = str(error)
        trace = (error.__cause__ or error).__traceback__  # SimPy raises a copy
        if isinstance(error, NotImplementedError) and not text and trace is not None:
            while trace.tb_next is not None:
                trace = trace.tb_next
            return f"{trace.tb_frame.f_code.co_name}() is missing"
        return text
    except Exception as failure:
        return f"its text fails with {type(failure).__name__}"


def first_line(error: BaseException) -> str:
    """What an exception of a library says, as far as it goes into one line."""
    return (text_of(error).strip() or type(error).__name__).splitlines()[0]


@contextmanager
def as_user_error(
    what: str, *kinds: type[BaseException], most: int | None = None
) -> Iterator[None]:
    """An exception of these ``kinds`` within it becomes a ``UserError``: ``what`` is wrong, and
    why, in one line, of ``most`` characters. Where memory ran out, ``what`` may be right: a good
    file needs more than there is, or a broken one asks for any amount.
    """
    try:
        yield
    except kinds as error:
        if tells_of_low_memory(error):
            raise UserError(f"{what}, or there is not enough memory") from error
        raise UserError(
            f"{what}: {str(getattr(error, 'strerror', None) or first_line(error))[:most]}"
        ) from error


def tells_of_low_memory(error: BaseException) -> bool:
    """Whether an exception of Python, numpy, pyarrow, OpenCV or ONNX Runtime is about memory."""
    if isinstance(error, MemoryError):
        return True
    if isinstance(error, OSError):
        return error.errno == errno.ENOMEM
    return any(words in str(error) for words in LOW_MEMORY_WORDS)


def unknown(what: str, value: object, choices: Iterable[str]) -> str:
    """``unknown eviction 'lruu' (did you mean 'lru'?); known: fifo, lfu, lru, ttl``; of more than
    ``MAX_CHOICES`` the first, and how many more there are.
    """
    import difflib

    names = [one_line(choice) for choice in sorted(choices)]
    near = difflib.get_close_matches(str(value), names, n=1)
    hint = f" (did you mean {near[0]!r}?)" if near else ""
    more = f" and {len(names) - MAX_CHOICES:,} more" if len(names) > MAX_CHOICES else ""
    return f"unknown {what} {short_repr(value)}{hint}; " + (
        f"known: {', '.join(names[:MAX_CHOICES])}{more}" if names else "there are none"
    )
