"""Text with units becomes exact numbers, and back."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from genie_sim.base import units


@pytest.mark.parametrize(
    ("text", "ns"),
    [
        ("30 ms", 30_000_000),
        ("1.5 s", 1_500_000_000),
        ("2 min", 120_000_000_000),
        ("1 h", 3_600_000_000_000),
        ("250 us", 250_000),
        ("250 µs", 250_000),
        ("250 μs", 250_000),  # Greek mu
        ("8ns", 8),
        ("1e-3 s", 1_000_000),
        ("-3 s", -3_000_000_000),
        (0, 0),
        ("0", 0),
    ],
)
def test_durations(text: object, ns: int) -> None:
    assert units.duration_ns(text) == ns


@pytest.mark.parametrize(
    ("text", "size"),
    [
        ("1.4 MB", 1_400_000),
        ("4 MiB", 4 * 2**20),
        ("465.8 kB", 465_800),
        ("1397297 B", 1_397_297),
        ("1 KiB", 1024),
    ],
)
def test_sizes(text: str, size: int) -> None:
    assert units.size_bytes(text) == size


@pytest.mark.parametrize(
    ("text", "bps"), [("1 Gbit/s", 10**9), ("100 Mbit/s", 10**8), ("0.5 kbit/s", 500)]
)
def test_rates_count_bits(text: str, bps: int) -> None:
    assert units.rate_bps(text) == bps


def test_lengths_and_angles() -> None:
    assert units.length_m("1 m") == 1.0
    assert units.length_m("50 cm") == 0.5
    assert units.ANGLE.read("15 deg") == math.radians(15)
    assert units.ANGLE.read("0.5 rad") == 0.5


def test_arithmetic_is_exact_where_floats_are_not() -> None:
    assert units.duration_ns("0.1 s") + units.duration_ns("0.2 s") == units.duration_ns("0.3 s")
    assert units.duration_ns("4.35 us") == 4350


@pytest.mark.parametrize(
    ("read", "values", "kind"),
    [
        (units.duration_ns, (30, "30"), "has no unit; write for example '30 ms'"),
        (units.length_m, (1.0,), "has no unit; write for example '1 m'"),
        (units.duration_ns, (True, None, "soon", "nan s", "1e999999 s"), "is not a number with"),
        (units.duration_ns, ("3 days",), "ns, us, µs, ms, s, min, h"),
        (units.rate_bps, ("1 GB/s", "1 gbit/s"), "bit/s, kbit/s, Mbit/s, Gbit/s"),
        (units.ANGLE.read, ("15 m",), "deg, rad"),
        (units.duration_ns, ("0.5 ns",), "whole number of nanoseconds"),
        (units.size_bytes, ("0.5 B",), "whole number of bytes"),
        (units.duration_ns, ("1e99 s",), "too large"),
        (units.duration_ns, ("7" * 1000,), f"'{'7' * 56}... "),
    ],
)
def test_what_cannot_be_read_says_what_to_write(
    read: Callable[[object], object], values: tuple[object, ...], kind: str
) -> None:
    for value in values:
        with pytest.raises(ValueError) as error:
            read(value)
        assert kind in str(error.value)


@given(st.integers(-(2**63) + 1, 2**63 - 1))
@example(2**63 - 1)
def test_durations_are_written_exactly(ns: int) -> None:
    assert units.duration_ns(units.duration_text(ns)) == ns


@given(st.integers(0, 2**63 - 1))
def test_sizes_and_rates_are_written_exactly(number: int) -> None:
    assert units.size_bytes(units.SIZE.text(number)) == number
    assert units.rate_bps(units.rate_text(number)) == number


@given(st.just(0.0) | st.floats(1e-12, 1e12))
def test_lengths_are_written_exactly(metres: float) -> None:
    assert units.length_m(units.length_text(metres)) == metres
    assert units.POWER.read(units.POWER.text(metres)) == metres


def test_watts() -> None:
    assert [units.DRIFT.read(text) for text in ("20 ppm", "-0.5 ppm", "0")] == [20.0, -0.5, 0.0]
    assert units.DRIFT.read(units.DRIFT.text(-12.5)) == -12.5
    assert [units.POWER.read(text) for text in ("3 W", "450 mW", "1.5 kW", "0")] == [
        3.0,
        0.45,
        1500,
        0,
    ]
    with pytest.raises(ValueError, match="unknown unit 'w'"):
        units.POWER.read("3 w")


@given(st.floats(1e-12, 10))
def test_angles_are_written_exactly(radians: float) -> None:
    assert units.ANGLE.read(units.ANGLE.text(radians)) == radians


@pytest.mark.slow
@given(st.one_of(st.text(), st.integers(), st.floats(), st.none(), st.booleans()))
def test_nothing_but_value_errors(value: object) -> None:
    for read in (
        units.duration_ns,
        units.size_bytes,
        units.rate_bps,
        units.length_m,
        units.ANGLE.read,
    ):
        try:
            read(value)
        except ValueError as error:
            assert "\n" not in str(error)


def test_exact_texts_are_readable() -> None:
    assert units.duration_text(1_500_000_000) == "1.5 s"
    assert units.duration_text(123_456_789) == "123.456789 ms"
    assert units.duration_text(0) == "0 s"
    assert units.SIZE.text(465_800) == "465.8 kB" and units.SIZE.text(0) == "0 B"
    assert units.rate_text(10**9) == "1 Gbit/s" and units.rate_text(0) == "0 bit/s"
    assert units.ANGLE.text(math.radians(15)) == "15 deg"


def test_whole_numbers_are_written_as_such_below_a_million_billions() -> None:
    assert units.POWER.text(999_999_999_999_999.0) == "999999999999999 W"
    assert units.POWER.text(1e15) == "1000000000000000.0 W"
    assert units.POWER.text(2.5) == "2.5 W" and units.POWER.text(3.0) == "3 W"
