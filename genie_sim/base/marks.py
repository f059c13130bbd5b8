"""Marks of settings, in ``Annotated``: what a value must be beyond its type; and the units that the
ends of names say.
"""

import dataclasses
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, Any

from genie_sim.base import units
from genie_sim.base.units import Quantity

if TYPE_CHECKING:
    from genie_sim.base.settings import PlugIn


@dataclasses.dataclass(frozen=True)
class Bounds:
    """A number must be at least ``minimum``, more than ``above`` and at most ``maximum``."""

    minimum: float | None = None
    above: float | None = None
    maximum: float | None = None

    def contain(self, number: float) -> bool:
        """Whether a number is within the bounds."""
        return (
            (self.minimum is None or number >= self.minimum)
            and (self.above is None or number > self.above)
            and (self.maximum is None or number <= self.maximum)
        )

    def words(self, text: Callable[[Any], str]) -> str:
        """The bounds in words, such as ``from 0 to 1``."""
        if self.minimum is not None and self.maximum is not None:
            return f"from {text(self.minimum)} to {text(self.maximum)}"
        limits = {"at least": self.minimum, "more than": self.above, "at most": self.maximum}
        given = [f"{words} {text(limit)}" for words, limit in limits.items() if limit is not None]
        return " and ".join(given)


@dataclasses.dataclass(frozen=True)
class Matches:
    """The whole of a text must match a regular expression and have at most ``maximum`` characters;
    ``rule`` says so in words.
    """

    pattern: str
    rule: str
    maximum: int = 1_000_000


@dataclasses.dataclass(frozen=True)
class NotEmpty:
    """A text, list or mapping must not be empty."""


@dataclasses.dataclass(frozen=True)
class Key:
    """The name in YAML, where it is not that of the field without its unit."""

    name: str


@dataclasses.dataclass(frozen=True)
class Short:
    """Texts that are read as well, such as ``10 MB`` for a mapping, or the name of a plug-in; the
    class method ``expand`` reads them.
    """

    examples: tuple[str, ...] = ()
    plug_in: "PlugIn | None" = None


NOT_NEGATIVE, POSITIVE = Bounds(minimum=0), Bounds(above=0)
ENDINGS: dict[str, tuple[Quantity[Any], Bounds]] = {  # of names
    "_ns": (units.DURATION, NOT_NEGATIVE),
    "_bytes": (units.SIZE, NOT_NEGATIVE),
    "_bps": (units.RATE, POSITIVE),
    "_m": (units.LENGTH, NOT_NEGATIVE),
    "_rad": (units.ANGLE, Bounds()),
    "_hz": (units.FREQUENCY, POSITIVE),
    "_db": (units.RATIO, Bounds(minimum=-200, maximum=200)),
    "_dbm": (units.RADIATED, Bounds(minimum=-200, maximum=200)),
    "_w": (units.POWER, NOT_NEGATIVE),
    "_ppm": (units.DRIFT, Bounds()),
}
Count = Annotated[int, Bounds(minimum=1)]
Share = Annotated[float, Bounds(minimum=0, maximum=1)]
Text = Annotated[str, NotEmpty()]
Name = Annotated[
    str,
    Matches(
        r"^[A-Za-z0-9][A-Za-z0-9_.-]*$",
        "must be letters, digits, '_', '-' and '.', the first a letter or digit",
        maximum=100,
    ),
]
