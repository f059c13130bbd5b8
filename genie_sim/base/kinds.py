"""Kinds of settings: how a number, a quantity with a unit, a text or a list is read from the plain
data of YAML, written back, and described by JSON Schema.

A kind is one class (``Kind``). To add one, write its class; a field has it where its instance is a
mark of the annotation, ``Annotated[Colour, ColourKind()]``. Kinds that follow from Python's own
types are chosen by ``settings.kind_of``, and ``settings`` has those that hold other settings.
"""

import dataclasses
import math
import re
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from genie_sim.base import units
from genie_sim.base.errors import short_repr, unknown
from genie_sim.base.removed import instead_of_setting

Schema = dict[str, Any]


class SettingError(ValueError):
    """``text`` is wrong with ``field``, a path such as ``cars[1].edge`` below the settings that are
    read; so many ``more`` mistakes follow.
    """

    def __init__(self, field: str, text: str, more: int = 0) -> None:
        super().__init__(f"{field}: {text}" if field else text)
        self.field, self.text, self.more = field, text, more

    def below(self, step: str | int) -> "SettingError":
        """The same error, seen from the settings that hold these under ``step``."""
        return SettingError(join(step, self.field), self.text, self.more)

    @property
    def message(self) -> str:
        """The text, or what to write instead of a setting that was removed, and how many mistakes
        there are besides.
        """
        instead = instead_of_setting(self.field)
        text = self.text if instead is None else f"was removed. {instead}"
        return text + (f" (and {self.more} more)" if self.more else "")


def quoted(key: object) -> str:
    """A key as part of a path; in quotes if it is no plain word."""
    return key if isinstance(key, str) and re.fullmatch(r"[\w-]{1,40}", key) else short_repr(key)


def join(step: str | int, path: str) -> str:
    """``path`` below a name, a path or an index: ``cars[1].edge``."""
    begin = f"[{step}]" if isinstance(step, int) else step
    return begin + path if not path or not begin or path.startswith("[") else f"{begin}.{path}"


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

    @property
    def words(self) -> str:
        """The bounds in words, such as ``from 0 to 1``."""
        if self.minimum is not None and self.maximum is not None:
            return f"from {_plain_number(self.minimum)} to {_plain_number(self.maximum)}"
        parts = [
            f"{words} {_plain_number(limit)}"
            for words, limit in (
                ("at least", self.minimum),
                ("more than", self.above),
                ("at most", self.maximum),
            )
            if limit is not None
        ]
        return " and ".join(parts)


def _plain_number(number: float) -> str:
    """``1,000,000`` and ``0.1``."""
    return f"{number:,.10g}"


@dataclasses.dataclass(frozen=True)
class Matches:
    """A text must match a regular expression and have at most ``maximum`` characters; ``rule`` says
    so in words.
    """

    pattern: str
    rule: str
    maximum: int = 1_000_000


class Unit(NamedTuple):
    """A unit by which the names of settings end, or a mark: how its texts are read and written."""

    number: type
    example: str
    read: Callable[[object], float]
    text: Callable[[Any], str]
    bounds: Bounds = Bounds(minimum=0)


DURATION = Unit(int, "30 ms", read=units.duration_ns, text=units.duration_text)
SIZE = Unit(int, "1.4 MB", read=units.size_bytes, text=units.size_text)
RATE = Unit(int, "100 Mbit/s", read=units.rate_bps, text=units.rate_text, bounds=Bounds(above=0))
LENGTH = Unit(float, "1 m", read=units.length_m, text=units.length_text)
ANGLE = Unit(float, "15 deg", read=units.angle_rad, text=units.angle_text, bounds=Bounds())
FREQUENCY = Unit(
    int, "25 MHz", read=units.frequency_hz, text=units.frequency_text, bounds=Bounds(above=0)
)
FRAME_RATE = Unit(
    float, "5 Hz", read=units.frame_rate, text=units.frame_rate_text, bounds=Bounds(above=0)
)
RATIO = Unit(float, "3 dB", read=units.ratio_db, text=units.ratio_text, bounds=Bounds())
POWER = Unit(float, "23 dBm", read=units.power_dbm, text=units.power_text, bounds=Bounds())
DRIFT = Unit(float, "20 ppm", read=units.drift_ppm, text=units.drift_text, bounds=Bounds())
WATTS = Unit(float, "3 W", read=units.watts, text=units.watts_text)
UNITS = {
    "_ns": DURATION,
    "_bytes": SIZE,
    "_bps": RATE,
    "_m": LENGTH,
    "_rad": ANGLE,
    "_hz": FREQUENCY,
    "_db": RATIO,
    "_dbm": POWER,
    "_w": WATTS,
    "_ppm": DRIFT,
}


class Kind:
    """How the values of a setting are written. This one takes anything as it is."""

    def fits(self, value: object) -> bool:
        """Whether a value is written as those of this kind are; asked where a setting may be of
        several kinds.
        """
        return isinstance(value, str)

    def read(self, value: object, base: object = None) -> Any:
        """The setting that YAML has as ``value``; what is left out is as in ``base``, a setting
        that was read before. Raises ``SettingError``.
        """
        return value

    def plain(self, value: Any) -> Any:
        """A setting as in YAML; what is of no such kind stays as it is."""
        if isinstance(value, Mapping):
            return {key: self.plain(item) for key, item in value.items()}
        return [self.plain(item) for item in value] if isinstance(value, list | tuple) else value

    def schema(self, classes: dict[str, Schema]) -> Schema:
        """Its JSON Schema; those of the settings classes in it go to ``classes``, by name."""
        return {}


class Nothing(Kind):
    """``None``."""

    def fits(self, value: object) -> bool:
        return value is None

    def read(self, value: object, base: object = None) -> None:
        return None

    def schema(self, classes: dict[str, Schema]) -> Schema:
        return {"type": "null"}


class TrueOrFalse(Kind):
    """A ``bool``."""

    def fits(self, value: object) -> bool:
        return isinstance(value, bool)

    def read(self, value: object, base: object = None) -> Any:
        return _of_type(value, bool, "true or false")

    def schema(self, classes: dict[str, Schema]) -> Schema:
        return {"type": "boolean"}


@dataclasses.dataclass(frozen=True)
class Number(Kind):
    """A number without a unit, ``whole`` or finite."""

    whole: bool
    bounds: Bounds

    def fits(self, value: object) -> bool:
        return _is_number(value)

    def read(self, value: object, base: object = None) -> float:
        number: float
        if self.whole:
            number = _of_type(value, int, "a whole number")
        else:
            number = _of_type(value, int | float, "a number")
            try:
                number = float(number)
            except OverflowError:
                number = math.inf
            if not math.isfinite(number):
                raise SettingError("", f"must be a finite number, not {short_repr(value)}")
        if not self.bounds.contain(number):
            raise SettingError("", f"must be {self.bounds.words}, not {short_repr(value)}")
        return number

    def schema(self, classes: dict[str, Schema]) -> Schema:
        limits = {
            "minimum": self.bounds.minimum,
            "exclusiveMinimum": self.bounds.above,
            "maximum": self.bounds.maximum,
        }
        given = {key: limit for key, limit in limits.items() if limit is not None}
        return {"type": "integer" if self.whole else "number", **given}


@dataclasses.dataclass(frozen=True)
class Quantity(Kind):
    """A number with a unit, such as ``30 ms``."""

    unit: Unit
    bounds: Bounds

    def fits(self, value: object) -> bool:
        return _is_number(value) or isinstance(value, str)

    def read(self, value: object, base: object = None) -> float:
        try:
            number = self.unit.read(value)
        except ValueError as error:
            raise SettingError("", str(error)) from error
        bounds = self.bounds
        if not bounds.contain(number):
            words = "be more than zero"
            if bounds.minimum == 0 and number < 0:
                words = "not be negative"
            elif bounds.minimum is not None and bounds.maximum is not None:
                low, high = self.unit.text(bounds.minimum), self.unit.text(bounds.maximum)
                words = f"be from {low} to {high}"
            raise SettingError("", f"must {words}, but is {short_repr(value)}")
        return number

    def plain(self, value: Any) -> Any:
        return self.unit.text(value) if _is_number(value) else value

    def schema(self, classes: dict[str, Schema]) -> Schema:
        return {"type": "string", "examples": [self.unit.example]}


@dataclasses.dataclass(frozen=True)
class TextKind(Kind):
    """A ``str``."""

    not_empty: bool
    matches: Matches | None

    def read(self, value: object, base: object = None) -> str:
        text: str = _of_type(value, str, "text")
        _check_not_empty(text, self.not_empty)
        rule = self.matches
        if rule is not None and len(text) > rule.maximum:
            raise SettingError("", f"must have at most {rule.maximum} characters, not {len(text)}")
        if rule is not None and not re.search(rule.pattern, text):
            raise SettingError("", f"{rule.rule}, not {short_repr(text)}")
        return text

    def schema(self, classes: dict[str, Schema]) -> Schema:
        schema: Schema = {"type": "string"}
        if self.matches is not None:
            schema |= {"pattern": self.matches.pattern, "maxLength": self.matches.maximum}
        return {**schema, "minLength": 1} if self.not_empty else schema


@dataclasses.dataclass(frozen=True)
class Word(Kind):
    """One of a few texts, a ``Literal``. ``name`` is what error lines call the setting, ``others``
    what it may be besides, in words.
    """

    name: str
    choices: tuple[str, ...]
    others: str

    def read(self, value: object, base: object = None) -> Any:
        if value in self.choices:
            return value
        others = f", {self.others}" if self.others else ""
        raise SettingError("", unknown(self.name, value, self.choices) + others)

    def schema(self, classes: dict[str, Schema]) -> Schema:
        return {"enum": list(self.choices), "type": "string"}


@dataclasses.dataclass(frozen=True)
class Items(Kind):
    """A list as a tuple: of ``kinds[0]`` and of any length, or with one item for each of the
    ``kinds``.
    """

    kinds: tuple[Kind, ...]
    any_length: bool
    not_empty: bool

    def fits(self, value: object) -> bool:
        return isinstance(value, list | tuple)

    def read(self, value: object, base: object = None) -> tuple[Any, ...]:
        items: Any = _of_type(value, list | tuple, "a list")
        kinds = self._of(items)
        if len(items) != len(kinds):
            raise SettingError("", f"must hold {len(kinds)} values, not {len(items)}")
        _check_not_empty(items, self.not_empty)
        values: list[Any] = []
        errors: list[SettingError] = []
        for index, (kind, item) in enumerate(zip(kinds, items, strict=True)):
            try:
                values.append(kind.read(item))
            except SettingError as error:
                errors.append(error.below(index))
        raise_first(errors)
        return tuple(values)

    def plain(self, value: Any) -> Any:
        if not self.fits(value):
            return value
        return [kind.plain(item) for kind, item in zip(self._of(value), value, strict=True)]

    def schema(self, classes: dict[str, Schema]) -> Schema:
        schemas = [kind.schema(classes) for kind in self.kinds]
        if self.any_length:
            schema = {"type": "array", "items": schemas[0]}
            return {**schema, "minItems": 1} if self.not_empty else schema
        length = len(schemas)
        return {"type": "array", "prefixItems": schemas, "minItems": length, "maxItems": length}

    def _of(self, items: Any) -> tuple[Kind, ...]:
        """The kind of each item."""
        return self.kinds * len(items) if self.any_length else self.kinds


@dataclasses.dataclass(frozen=True)
class Named(Kind):
    """A mapping of any keys; ``shorts`` are what may be written instead."""

    keys: Kind
    items: Kind
    not_empty: bool
    shorts: tuple[Schema, ...]

    def fits(self, value: object) -> bool:
        return isinstance(value, Mapping)

    def read(self, value: object, base: object = None) -> dict[Any, Any]:
        items: Any = _of_type(value, Mapping, "a mapping")
        _check_not_empty(items, self.not_empty)
        values = {}
        for key, item in items.items():
            try:
                values[self.keys.read(key)] = self.items.read(item)
            except SettingError as error:
                raise error.below(quoted(key)) from error
        return values

    def plain(self, value: Any) -> Any:
        if not self.fits(value):
            return value
        return {key: self.items.plain(item) for key, item in value.items()}

    def schema(self, classes: dict[str, Schema]) -> Schema:
        mapping = {"type": "object", "additionalProperties": self.items.schema(classes)}
        return any_of(self.shorts, mapping)


@dataclasses.dataclass(frozen=True)
class OneOfKinds(Kind):
    """A union: the first of the ``kinds`` as which a value is written. ``words`` are what it may be
    besides its named choices.
    """

    kinds: tuple[Kind, ...]
    words: str
    shorts: tuple[Schema, ...]

    def fits(self, value: object) -> bool:
        return any(kind.fits(value) for kind in self.kinds)

    def read(self, value: object, base: object = None) -> Any:
        for kind in self.kinds:
            if kind.fits(value):
                return kind.read(value, base)
        if self.words:
            named = [word for kind in self.kinds if isinstance(kind, Word) for word in kind.choices]
            words = ", ".join([*named, self.words])
            raise SettingError("", f"must be {words}, not {short_repr(value)}")
        return next(kind for kind in self.kinds if not isinstance(kind, Nothing)).read(value, base)

    def plain(self, value: Any) -> Any:
        for kind in self.kinds:
            if kind.fits(value):
                return kind.plain(value)
        return value

    def schema(self, classes: dict[str, Schema]) -> Schema:
        return {"anyOf": [*self.shorts, *(kind.schema(classes) for kind in self.kinds)]}


def any_of(shorts: tuple[Schema, ...], schema: Schema) -> Schema:
    """A schema, or the short forms that may be written instead."""
    return {"anyOf": [*shorts, schema]} if shorts else schema


def raise_first(errors: list[SettingError]) -> None:
    """Raises the first of several mistakes, which says how many there are besides."""
    if errors:
        more = len(errors) - 1 + sum(error.more for error in errors)
        raise SettingError(errors[0].field, errors[0].text, more)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _of_type(value: object, kind: Any, words: str) -> Any:
    if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
        raise SettingError("", f"must be {words}, not {short_repr(value)}")
    return value


def _check_not_empty(value: Any, not_empty: bool) -> None:
    if not_empty and not value:
        raise SettingError("", "must not be empty")
