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


def frame_rate(value: object) -> float:
    """``"2.5 Hz"`` to 2.5 frames a second."""
    number, unit = _split(value, "rate", "5 Hz", FREQUENCIES)
    return _finite(number * (FREQUENCIES[unit] if unit else 0), value, "rate")


def frame_rate_text(value_per_s: float) -> str:
    """2.5 to ``"2.5 Hz"``. ``frame_rate`` reads it back."""
    return f"{_plain(value_per_s)} Hz"


def length_m(value: object) -> float:
    """``"50 cm"`` to 0.5 m."""
    number, unit = _split(value, "length", "1 m", LENGTHS)
    return _finite(number * (LENGTHS[unit] if unit else 0), value, "length")


def angle_rad(value: object) -> float:
    """``"15 deg"`` to 0.2618 rad."""
    number, unit = _split(value, "angle", "15 deg", ANGLES)
    plain = _finite(number, value, "angle")
    return math.radians(plain) if unit == "deg" else plain


def ratio_db(value: object) -> float:
    """``"3 dB"`` to 3.0."""
    number, _ = _split(value, "ratio", "3 dB", ("dB",))
    return _finite(number, value, "ratio")


def ratio_text(value_db: float) -> str:
    """3.0 to ``"3 dB"``. ``ratio_db`` reads it back."""
    return f"{_plain(value_db)} dB"


def drift_ppm(value: object) -> float:
    """``"20 ppm"`` to 20.0: microseconds per second."""
    number, _ = _split(value, "drift", "20 ppm", ("ppm",))
    return _finite(number, value, "drift")


def drift_text(value_ppm: float) -> str:
    """20.0 to ``"20 ppm"``. ``drift_ppm`` reads it back."""
    return f"{_plain(value_ppm)} ppm"


def power_dbm(value: object) -> float:
    """``"23 dBm"`` to 23.0: decibels above a milliwatt."""
    number, _ = _split(value, "power", "23 dBm", ("dBm",))
    return _finite(number, value, "power")


def power_text(value_dbm: float) -> str:
    """23.0 to ``"23 dBm"``. ``power_dbm`` reads it back."""
    return f"{_plain(value_dbm)} dBm"


def watts(value: object) -> float:
    """``"500 mW"`` to 0.5 W."""
    number, unit = _split(value, "power", "3 W", POWERS)
    return _finite(number * (POWERS[unit] if unit else 0), value, "power")


def watts_text(value_w: float) -> str:
    """0.5 W to ``"0.5 W"``. ``watts`` reads it back."""
    return f"{_plain(value_w)} W"


def length_text(value_m: float) -> str:
    """0.5 m to ``"0.5 m"``. ``length_m`` reads it back."""
    return f"{_plain(value_m)} m"


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
