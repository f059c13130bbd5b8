"""Numbers and names as text: significant digits, percentages, the order of names, one line."""

import math
import re

MAX_LABEL = 60  # characters of what names something in tables and figures


def number_text(value: float, digits: int = 3, sign: str = "") -> str:
    """A number to so many significant digits: ``0.0713``, ``46.2``, ``1,234``.

    Digits before the point are all written. ``sign="+"`` writes the sign of positive numbers, too.
    """
    if abs(value) >= 10**digits - 0.5:
        return f"{value:{sign},.0f}"
    return f"{value:{sign}.{digits}g}"


def percent_text(share: float, digits: int = 3) -> str:
    """A share as a percentage: 0.0713 is ``7.13 %``."""
    return f"{number_text(100 * share, digits)} %"


def significant(value: float, digits: int) -> float:
    """The number rounded to so many significant digits.

    Processors add up in different orders, so the last digits of a sum may differ between them.
    """
    return float(f"{value:.{digits}g}")


def finite(value: float | None) -> float | None:
    """The number rounded to six significant digits, ``None`` for what JSON cannot hold."""
    return None if value is None or not math.isfinite(value) else significant(value, 6)


def natural_key(name: str) -> list[tuple[str, int]]:
    """A key to sort names by, in which ``car2`` comes before ``car10``."""
    return [(word, int(digits or 0)) for word, digits in re.findall(r"(\D*)(\d*)", name)]


def one_line(text: str) -> str:
    """The text with control characters escaped, so that it stays on one line and cannot steer a
    terminal.
    """
    return "".join(
        character if character.isprintable() else character.encode("unicode_escape").decode()
        for character in text
    )
