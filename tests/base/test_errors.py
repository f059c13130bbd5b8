"""Exceptions of libraries as lines for the user."""

import errno
from typing import cast

import pytest

from genie_sim.base.errors import UserError, as_user_error, unknown
from genie_sim.sim.link_model import Transmitter


def test_an_exception_becomes_one_line():
    with (
        pytest.raises(UserError, match=r"^a.txt: not a table: first$"),
        as_user_error("a.txt: not a table", ValueError),
    ):
        raise ValueError("first\nsecond")


def test_a_method_that_a_class_lacks_is_named():
    with (
        pytest.raises(UserError, match=r"^own:Slow: transmit\(\) is missing$"),
        as_user_error("own:Slow", NotImplementedError),
    ):
        Transmitter.transmit(cast(Transmitter, None), 1)


class OutOfMemory(OSError, MemoryError):
    """As pyarrow's ``ArrowMemoryError``, which is also one of its own kind."""


@pytest.mark.parametrize(
    "error",
    [
        MemoryError(),
        OutOfMemory("malloc of size 64 failed"),
        OSError(errno.ENOMEM, "Cannot allocate memory"),
        RuntimeError("std::bad_alloc"),
        RuntimeError("Insufficient memory: failed to allocate 8 bytes"),
    ],
)
def test_a_file_alone_is_not_to_blame_for_low_memory(error):
    with (
        pytest.raises(UserError, match=r"Parquet file, or there is not enough memory$"),
        as_user_error("trace.parquet: not a readable Parquet file", Exception),
    ):
        raise error


def test_choices_with_control_characters_stay_on_one_line():
    text = unknown("recording", "02", ["left", "\n", "\x1b[2J"])
    assert text == "unknown recording '02'; known: \\n, \\x1b[2J, left"


def test_a_choice_that_is_nearly_the_value_is_offered():
    assert unknown("link", "wifo", ["wifi", "lte"]) == (
        "unknown link 'wifo' (did you mean 'wifi'?); known: lte, wifi"
    )
    assert unknown("link", "xyz", ["wifi", "lte"]) == "unknown link 'xyz'; known: lte, wifi"
    assert unknown("link", "xyz", []) == "unknown link 'xyz'; there are none"
    assert unknown("vehicle", "x", map(str, range(100, 170))).endswith(", 158, 159 and 10 more")
