"""Quantities with units: text such as ``30 ms`` or ``1 Gbit/s`` to numbers, and back.

Inside the program times are integer nanoseconds, sizes integer bytes, rates integer bit/s, lengths
metres and angles radians. Text is converted once, where it is read, in exact arithmetic. Every
error is a ``ValueError`` that says what to write instead.
"""

import math
import re
from collections.abc import Collection, Mapping, Sequence
from decimal import Decimal
from fractions import Fraction
from typing import NamedTuple

from genie_sim.base.errors import short_repr

NS_PER_US = 1_000
NS_PER_MS = 1_000_000
NS_PER_S = 1_000_000_000
# Nothing real is farther away than around the Earth, and squares of such numbers are still finite.
MAX_M = 4e7
MAX_TIME_S = 4e9  # a time since 1970 at most (2096): two of them apart still are 64 bits of ns

DURATIONS: dict[str, int] = {
    "ns": 1,
    "us": NS_PER_US,
    "µs": NS_PER_US,
    "ms": NS_PER_MS,
    "s": NS_PER_S,
    "min": 60 * NS_PER_S,
    "h": 3600 * NS_PER_S,
}
SIZES: dict[str, int] = {
    "B": 1,
    "kB": 10**3,
    "MB": 10**6,
    "GB": 10**9,
    "TB": 10**12,
    "KiB": 2**10,
    "MiB": 2**20,
    "GiB": 2**30,
    "TiB": 2**40,
}
RATES: dict[str, int] = {"bit/s": 1, "kbit/s": 10**3, "Mbit/s": 10**6, "Gbit/s": 10**9}
FREQUENCIES: dict[str, int] = {"Hz": 1, "kHz": 10**3, "MHz": 10**6, "GHz": 10**9}
LENGTHS: dict[str, Fraction] = {
    "mm": Fraction(1, 1000),
    "cm": Fraction(1, 100),
    "m": Fraction(1),
    "km": Fraction(1000),
}
POWERS: dict[str, Fraction] = {
    "mW": Fraction(1, 1000),
    "W": Fraction(1),
    "kW": Fraction(1000),
}
ANGLES = ("deg", "rad")

_QUANTITY = re.compile(
    r"([+-]?\d{1,30}(?:\.\d{1,30})?(?:e[+-]?\d{1,2})?)\s*(\D\S*)?", re.ASCII | re.IGNORECASE
)
_LARGEST = 2**63 - 1  # what a Parquet integer column holds


class _Counted(NamedTuple):
    """A quantity that is a whole number of its smallest unit; ``written`` are the units of texts,
    the largest first.
    """

    name: str
    example: str
    units: Mapping[str, int]
    counted: str
    written: Sequence[str]

    def read(self, value: object) -> int:
        number, unit = _split(value, self.name, self.example, self.units)
        exact = number * self.units[unit] if unit else Fraction(0)
        if exact.denominator != 1:
            raise ValueError(
                f"{self.name} {short_repr(value)} is not a whole number of {self.counted}"
            )
        if abs(exact) > _LARGEST:
            raise ValueError(f"{self.name} {short_repr(value)} is too large")
        return int(exact)

    def text(self, value: int) -> str:
        """The shortest exact text, which ``read`` reads back."""
        if value == 0:
            return f"0 {'s' if 's' in self.written else self.written[-1]}"
        unit = next(unit for unit in self.written if abs(value) >= self.units[unit])
        whole, rest = divmod(abs(value), self.units[unit])
        digits = f"{whole}"
        if rest:
            digits += "." + f"{rest:0{len(str(self.units[unit])) - 1}d}".rstrip("0")
        return f"{'-' if value < 0 else ''}{digits} {unit}"


class _Measured(NamedTuple):
    """A quantity that is any number of its unit, ``written``, a float."""

    name: str
    example: str
    units: Mapping[str, int | Fraction]
    written: str

    def read(self, value: object) -> float:
        number, unit = _split(value, self.name, self.example, self.units)
        return _finite(number * (self.units[unit] if unit else 0), value, self.name)

    def text(self, value: float) -> str:
        """Text that ``read`` reads back exactly."""
        return f"{_plain(value)} {self.written}"


_DURATION = _Counted(
    "duration", "30 ms", DURATIONS, counted="nanoseconds", written=("s", "ms", "us", "ns")
)
_SIZE = _Counted("size", "1.4 MB", SIZES, counted="bytes", written=("GB", "MB", "kB", "B"))
_RATE = _Counted(
    "rate",
    "100 Mbit/s",
    RATES,
    counted="bits per second",
    written=("Gbit/s", "Mbit/s", "kbit/s", "bit/s"),
)
_FREQUENCY = _Counted(
    "frequency", "25 MHz", FREQUENCIES, counted="hertz", written=("GHz", "MHz", "kHz", "Hz")
)
duration_ns, duration_text = _DURATION.read, _DURATION.text  # "1.5 s" to 1,500,000,000 ns, and back
# "1.4 MB" (10^6 bytes) or "4 MiB" (2^20 bytes), and back
size_bytes, size_text = _SIZE.read, _SIZE.text
# "100 Mbit/s"; bytes are refused, so that nobody is off by eight
rate_bps, rate_text = _RATE.read, _RATE.text
frequency_hz, frequency_text = _FREQUENCY.read, _FREQUENCY.text  # "25 MHz", and back
_FRAME_RATE = _Measured("rate", "5 Hz", FREQUENCIES, written="Hz")
_LENGTH = _Measured("length", "1 m", LENGTHS, written="m")
_RATIO = _Measured("ratio", "3 dB", {"dB": 1}, written="dB")
_DRIFT = _Measured("drift", "20 ppm", {"ppm": 1}, written="ppm")
_POWER = _Measured("power", "23 dBm", {"dBm": 1}, written="dBm")
_WATTS = _Measured("power", "3 W", POWERS, written="W")
frame_rate, frame_rate_text = _FRAME_RATE.read, _FRAME_RATE.text  # "2.5 Hz" to 2.5 frames a second
length_m, length_text = _LENGTH.read, _LENGTH.text  # "50 cm" to 0.5 m
ratio_db, ratio_text = _RATIO.read, _RATIO.text
drift_ppm, drift_text = _DRIFT.read, _DRIFT.text  # microseconds per second
power_dbm, power_text = _POWER.read, _POWER.text  # decibels above a milliwatt
watts, watts_text = _WATTS.read, _WATTS.text  # "500 mW" to 0.5 W


def angle_rad(value: object) -> float:
    """``"15 deg"`` to 0.2618 rad."""
    number, unit = _split(value, "angle", "15 deg", ANGLES)
    plain = _finite(number, value, "angle")
    return math.radians(plain) if unit == "deg" else plain


def angle_text(value_rad: float) -> str:
    """In degrees where that reads back exactly, else in radians."""
    degrees = round(math.degrees(value_rad), 9)
    return (
        f"{_plain(degrees)} deg"
        if math.radians(degrees) == value_rad
        else f"{_plain(value_rad)} rad"
    )


def _split(value: object, what: str, example: str, units: Collection[str]) -> tuple[Fraction, str]:
    """Number and unit of a text; the unit is empty for a bare zero only."""
    match = _QUANTITY.fullmatch(str(value).strip())
    if match is None or isinstance(value, bool) or not isinstance(value, str | int | float):
        raise ValueError(
            f"{what} {short_repr(value)} is not a number with a unit; write for example '{example}'"
        )
    number = Fraction(Decimal(match[1]))
    unit = (match[2] or "").replace("μ", "µ")  # Greek mu and the micro sign look the same
    if not unit:
        if number == 0:
            return number, ""
        raise ValueError(f"{what} {short_repr(value)} has no unit; write for example '{example}'")
    if unit not in units:
        raise ValueError(
            f"{what} {short_repr(value)} has an unknown unit {unit!r}; known: {', '.join(units)}"
        )
    return number, unit


def _finite(number: Fraction, value: object, what: str) -> float:
    plain = float(number)
    if plain == 0.0 and number != 0:
        raise ValueError(f"{what} {short_repr(value)} is too small")
    return plain


def _plain(value: float) -> str:
    return str(int(value)) if value == int(value) and abs(value) < 1e15 else repr(value)
