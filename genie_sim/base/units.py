"""Quantities with units: text such as ``30 ms`` or ``1 Gbit/s`` to numbers, and back.

Inside the program times are integer nanoseconds, sizes integer bytes, rates integer bit/s, lengths
metres and angles radians. Text is converted once, where it is read, in exact arithmetic. Every
error is a ``ValueError`` that says what to write instead.
"""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from fractions import Fraction
from typing import Generic, TypeVar

from genie_sim.base.errors import short_repr

NS_PER_US = 1_000
NS_PER_MS = 1_000_000
NS_PER_S = 1_000_000_000
# Nothing real is farther away than around the Earth, and squares of such numbers are still finite.
MAX_M = 4e7
MAX_TIME_S = 4e9  # a time since 1970 at most (2096): two of them apart still are 64 bits of ns

_QUANTITY = re.compile(
    r"([+-]?\d{1,30}(?:\.\d{1,30})?(?:e[+-]?\d{1,2})?)\s*(\D\S*)?", re.ASCII | re.IGNORECASE
)
_LARGEST = 2**63 - 1  # what a Parquet integer column holds
Number = TypeVar("Number", int, float)


@dataclass(frozen=True, eq=False)
class Quantity(Generic[Number]):
    """What has a unit: its name, an example, and how many of the smallest unit each unit is.

    ``number`` is the type of its values, ``written`` the units of its texts, the largest first.
    One that is ``counted`` is a whole number of its smallest unit, called so. ``in_titles`` are
    further names of units, in titles of tables alone.
    """

    name: str
    example: str
    number: type[Number]
    units: Mapping[str, int | Fraction]
    written: Sequence[str]
    counted: str = ""
    in_titles: Mapping[str, float] = field(default_factory=dict)

    def read(self, value: object) -> Number:
        """The number in a text with a unit. Raises ``ValueError``."""
        number, unit = self._split(value)
        if unit == "deg":
            number = Fraction(math.radians(float(number)))
        elif unit:
            number *= self.units[unit]
        if self.counted and number.denominator != 1:
            raise ValueError(
                f"{self.name} {short_repr(value)} is not a whole number of {self.counted}"
            )
        if self.counted and abs(number) > _LARGEST:
            raise ValueError(f"{self.name} {short_repr(value)} is too large")
        plain = self.number(number)
        if plain == 0 and number != 0:
            raise ValueError(f"{self.name} {short_repr(value)} is too small")
        return plain

    def text(self, value: Number) -> str:
        """The shortest exact text, which ``read`` reads back."""
        unit = self.written[-1]
        if not self.counted:
            degrees = round(math.degrees(value), 9)
            if unit == "rad" and math.radians(degrees) == value:
                return f"{_shortest(degrees)} deg"
            return f"{_shortest(value)} {unit}"
        if value == 0:
            return f"0 {'s' if 's' in self.written else unit}"
        unit = next(unit for unit in self.written if abs(value) >= self.units[unit])
        whole, rest = divmod(abs(value), self.units[unit])
        digits = f"{whole}"
        if rest:
            digits += "." + f"{rest:0{len(str(self.units[unit])) - 1}d}".rstrip("0")
        return f"{'-' if value < 0 else ''}{digits} {unit}"

    def _split(self, value: object) -> tuple[Fraction, str]:
        """Number and unit of a text; the unit is empty for a bare zero only."""
        match = _QUANTITY.fullmatch(str(value).strip())
        problem = f"{self.name} {short_repr(value)}"
        hint = f"; write for example '{self.example}'"
        if match is None or isinstance(value, bool) or not isinstance(value, str | int | float):
            raise ValueError(f"{problem} is not a number with a unit{hint}")
        number = Fraction(Decimal(match[1]))
        unit = (match[2] or "").replace("μ", "µ")  # Greek mu and the micro sign look the same
        if not unit and number != 0:
            raise ValueError(f"{problem} has no unit{hint}")
        if unit and unit not in self.units:
            known = ", ".join(self.units)
            raise ValueError(f"{problem} has an unknown unit {unit!r}; known: {known}")
        return number, unit


def _shortest(value: float) -> str:
    return str(int(value)) if value == int(value) and abs(value) < 1e15 else repr(value)


# --- the table of all units

DURATION = Quantity(
    "duration",
    "30 ms",
    int,
    {
        "ns": 1,
        "us": NS_PER_US,
        "µs": NS_PER_US,
        "ms": NS_PER_MS,
        "s": NS_PER_S,
        "min": 60 * NS_PER_S,
        "h": 3600 * NS_PER_S,
    },
    written=("s", "ms", "us", "ns"),
    counted="nanoseconds",
    in_titles={
        "sec": NS_PER_S,
        "seconds": NS_PER_S,
        "msec": NS_PER_MS,
        "milliseconds": NS_PER_MS,
        "μs": NS_PER_US,
        "microseconds": NS_PER_US,
        "nanoseconds": 1,
    },
)
SIZE = Quantity(
    "size",
    "1.4 MB",
    int,
    {
        "B": 1,
        "kB": 10**3,
        "MB": 10**6,
        "GB": 10**9,
        "TB": 10**12,
        "KiB": 2**10,
        "MiB": 2**20,
        "GiB": 2**30,
        "TiB": 2**40,
    },
    written=("GB", "MB", "kB", "B"),
    counted="bytes",
)
RATE = Quantity(  # bytes are refused, so that nobody is off by eight
    "rate",
    "100 Mbit/s",
    int,
    {"bit/s": 1, "kbit/s": 10**3, "Mbit/s": 10**6, "Gbit/s": 10**9},
    written=("Gbit/s", "Mbit/s", "kbit/s", "bit/s"),
    counted="bits per second",
    in_titles={
        f"{mark}{per_second}": 10**power
        for mark, power in (("", 0), ("k", 3), ("m", 6), ("g", 9))
        for per_second in ("bps", "b/s")
    },
)
HERTZ = {"Hz": 1, "kHz": 10**3, "MHz": 10**6, "GHz": 10**9}
FREQUENCY = Quantity(
    "frequency", "25 MHz", int, HERTZ, written=("GHz", "MHz", "kHz", "Hz"), counted="hertz"
)
FRAME_RATE = Quantity("rate", "5 Hz", float, HERTZ, written=("Hz",))
LENGTH = Quantity(
    "length",
    "1 m",
    float,
    {"mm": Fraction(1, 1000), "cm": Fraction(1, 100), "m": 1, "km": 1000},
    written=("m",),
    in_titles={"meters": 1, "metres": 1},
)
ANGLE = Quantity(  # degrees in titles
    "angle",
    "15 deg",
    float,
    {"deg": Fraction(math.radians(1)), "rad": 1},
    written=("deg", "rad"),
    in_titles={
        "deg": 1,
        "°": 1,
        "degrees": 1,
        "rad": math.degrees(1),
        "radians": math.degrees(1),
    },
)
RATIO = Quantity("ratio", "3 dB", float, {"dB": 1}, written=("dB",))
DRIFT = Quantity("drift", "20 ppm", float, {"ppm": 1}, written=("ppm",))
RADIATED = Quantity("power", "23 dBm", float, {"dBm": 1}, written=("dBm",))
POWER = Quantity(
    "power", "3 W", float, {"mW": Fraction(1, 1000), "W": 1, "kW": 1000}, written=("W",)
)
IN_TITLES = (DURATION, LENGTH, RATE, ANGLE)  # what tables of others hold

duration_ns, duration_text = DURATION.read, DURATION.text  # "1.5 s" to 1,500,000,000 ns, and back
size_bytes = SIZE.read  # "1.4 MB" (10^6 bytes) or "4 MiB" (2^20)
rate_bps, rate_text = RATE.read, RATE.text
frame_rate_text, length_m, length_text = FRAME_RATE.text, LENGTH.read, LENGTH.text
