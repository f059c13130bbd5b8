"""Settings: plain frozen dataclasses, read from the plain data of YAML and JSON, and written back.

A field is a setting. Its annotation is its type, with ``Bounds`` and the other marks of this module
in ``Annotated`` where there is more to say. The end of its name is its unit (``delay_ns``); in YAML
the name has none, but the value does (``delay: 0.2 ms``). The text below it is its description. The
arguments of a plug-in's class are settings in the same way.

A class may have a class method ``expand``, which turns a short form into a mapping or an instance
before it is read, and a method ``shorten``, which does the opposite. What its ``__post_init__``
raises as ``ValueError("field: text")`` is reported with the path of that field.
"""

import ast
import dataclasses
import difflib
import functools
import inspect
import itertools
import math
import re
import textwrap
from collections.abc import Callable, Collection, Iterator, Mapping
from types import MappingProxyType, NoneType, UnionType
from typing import (
    Annotated,
    Any,
    Literal,
    NamedTuple,
    TypeGuard,
    TypeVar,
    Union,
    get_args,
    get_origin,
)

from genie_sim.base import plugins, units
from genie_sim.base.errors import UserError, as_user_error, short_repr, unknown
from genie_sim.base.plugins import Choice, Parameter
from genie_sim.base.removed import instead_of_setting

Settings = TypeVar("Settings")
REQUIRED = inspect.Parameter.empty  # the default of a setting that must be given


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


@dataclasses.dataclass(frozen=True)
class Matches:
    """A text must match a regular expression and have at most ``maximum`` characters; ``rule`` says
    so in words.
    """

    pattern: str
    rule: str
    maximum: int = 1_000_000


@dataclasses.dataclass(frozen=True)
class IfGiven:
    """Marks a setting that is written only where it is given: what it does not touch stays as it
    was before there was such a setting.
    """


@dataclasses.dataclass(frozen=True)
class NotEmpty:
    """A text, list or mapping must not be empty."""


@dataclasses.dataclass(frozen=True)
class Key:
    """The name in YAML, where it is not that of the field without its unit."""

    name: str


@dataclasses.dataclass(frozen=True)
class OneOf:
    """What a value of several types may be besides its named choices, in words."""

    words: str


@dataclasses.dataclass(frozen=True)
class Short:
    """Texts that are read as well, such as ``10 MB`` for a mapping, or the name of a plug-in; the
    class method ``expand`` reads them.
    """

    examples: tuple[str, ...] = ()
    plug_in: "PlugIn | None" = None


@dataclasses.dataclass(frozen=True)
class Beside:
    """The field holds settings of another class as they are written, in the same mapping."""

    cls: type


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


class Setting(NamedTuple):
    """One field of a settings class, or one argument of a plug-in's class.

    ``name`` is its name in Python, ``key`` in YAML; ``default`` may be ``REQUIRED``.
    """

    name: str
    key: str
    kind: Any
    unit: Unit | None
    default: Any


@functools.cache
def settings_of(cls: Callable[..., Any]) -> tuple[Setting, ...]:
    """Every setting of a class: fields of a dataclass, arguments of any other.

    A field that is no setting has ``setting=False`` in its metadata.
    """
    fields = (
        {field.name: field for field in dataclasses.fields(cls)} if is_settings_class(cls) else {}
    )
    settings = []
    for name, parameter in _signature(cls).parameters.items():
        if parameter.kind in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD):
            continue
        default = parameter.default
        if name in fields:
            if not fields[name].metadata.get("setting", True):
                continue
            factory = fields[name].default_factory
            if factory is not dataclasses.MISSING:
                default = factory()
        suffix = next((suffix for suffix in UNITS if name.endswith(suffix)), "")
        unit = UNITS.get(suffix)
        kind = _annotation(parameter, default, unit)
        key = mark_in(kind, Key)
        settings.append(
            Setting(
                name=name,
                key=name.removesuffix(suffix) if key is None else key.name,
                kind=kind,
                unit=unit or mark_in(kind, Unit),
                default=default,
            )
        )
    return tuple(settings)


def keys_of(cls: Callable[..., Any]) -> list[str]:
    """The names in YAML of the settings of a class."""
    return [setting.key for setting in settings_of(cls)]


def _signature(cls: Callable[..., Any]) -> inspect.Signature:
    """The arguments of a class; annotations stay texts where their names cannot be found."""
    try:
        return inspect.signature(cls, eval_str=True)
    except NameError:
        return inspect.signature(cls)


def names_of(cls: Callable[..., Any]) -> list[str]:
    """The names in Python of the settings of a class."""
    return [setting.name for setting in settings_of(cls)]


def _annotation(parameter: inspect.Parameter, default: Any, unit: Unit | None) -> Any:
    """The type of an argument; where nothing says it, that of its unit."""
    annotation = parameter.annotation
    if annotation is not inspect.Parameter.empty and not isinstance(annotation, str):
        return annotation
    if unit is not None:
        return unit.number if default is not None else unit.number | None
    return Any


Mark = TypeVar("Mark")


def mark_in(kind: Any, mark: type[Mark]) -> Mark | None:
    """The mark of this type in an annotation, also in members of a union or items of a list."""
    for part in get_args(kind) if get_origin(kind) is not Literal else ():
        if isinstance(part, mark):
            return part
        inner = mark_in(part, mark)
        if inner is not None:
            return inner
    return None


@functools.cache
def descriptions(cls: type) -> dict[str, str]:
    """What each setting of a class means, by its name in Python: the text below a field of a
    dataclass, or the entry of an argument in the section ``Parameters`` of any other class.
    """
    if not is_settings_class(cls):
        return _parameters(inspect.getdoc(cls) or "")
    texts: dict[str, str] = {}
    for owner in reversed(cls.__mro__):
        if dataclasses.is_dataclass(owner):
            texts |= _below_fields(owner)
    return texts


def _below_fields(cls: type) -> dict[str, str]:
    """The text below each field in the source of a dataclass."""
    tree = _tree_of(cls)
    texts = {}
    for field, below in itertools.pairwise(tree.body):
        match field, below:
            case (
                ast.AnnAssign(target=ast.Name(id=name)),
                ast.Expr(value=ast.Constant(value=str(text))),
            ):
                texts[name] = " ".join(text.split())
    return texts


def _tree_of(cls: type) -> ast.ClassDef:
    """The source of a class, parsed."""
    (tree,) = ast.parse(textwrap.dedent(inspect.getsource(cls))).body
    assert isinstance(tree, ast.ClassDef)
    return tree


def _parameters(docstring: str) -> dict[str, str]:
    """The section ``Parameters`` of a docstring, by name."""
    _, _, section = docstring.partition("Parameters\n----------\n")
    section, _, _ = section.partition("\n\n")
    entries = re.findall(r"^(\w+) : .*\n((?:    .*\n?)+)", section, re.MULTILINE)
    return {name: " ".join(text.split()) for name, text in entries}


# --- reading


def read(cls: type[Settings], data: object, where: Callable[[str], str]) -> Settings:
    """The settings in ``data``, plain data as from YAML.

    Parameters
    ----------
    cls : type
        The settings class.
    data : object
        A mapping, or a short form that the class expands.
    where : callable
        Gives the file, or the option, that a field's path comes from, to begin the error with.

    Raises
    ------
    UserError
        In one line, for the first mistake.
    """
    try:
        return from_plain(cls, data)
    except SettingError as error:
        parts = (where(error.field), error.field, error.message)
        raise UserError(": ".join(part for part in parts if part)) from error


def from_plain(cls: type[Settings], data: object) -> Settings:
    """The settings in ``data``, plain data as from YAML. Raises ``SettingError``."""
    return _settings(cls, data, None)


def merged(base: Settings, data: Mapping[str, Any]) -> Settings:
    """``base`` with what ``data`` sets otherwise, at any depth: a plug-in that is named anew brings
    its own settings. Raises ``SettingError``.
    """
    return _settings(type(base), data, base)


class _Context(NamedTuple):
    """What is known of the value that is read: its setting's name, unit and marks."""

    name: str
    unit: Unit | None = None
    bounds: Bounds = Bounds()
    matches: Matches | None = None
    not_empty: bool = False
    one_of: str = ""
    plug_in: "PlugIn | None" = None

    def of(self, kind: Any) -> tuple[Any, "_Context"]:
        """The type in an ``Annotated``, and the context with its marks."""
        if get_origin(kind) is not Annotated:
            return kind, self
        context = self
        kind, *marks = get_args(kind)
        for mark in marks:
            match mark:
                case Bounds():
                    context = context._replace(bounds=mark)
                case Matches():
                    context = context._replace(matches=mark)
                case NotEmpty():
                    context = context._replace(not_empty=True)
                case OneOf():
                    context = context._replace(one_of=mark.words)
                case PlugIn():
                    context = context._replace(plug_in=mark)
        return kind, context


def _settings(cls: type[Settings], data: object, base: Settings | None) -> Settings:
    """The settings in ``data``, those that it leaves out from ``base``, or their defaults."""
    if isinstance(data, cls):
        return data
    base = base if isinstance(data, Mapping) else None
    expand = getattr(cls, "expand", None)
    if expand is not None:
        data = expand(data)
        if isinstance(data, cls):
            return data
    if not isinstance(data, Mapping):
        raise SettingError("", f"must be a mapping, not {short_repr(data)}")
    keys = keys_of(cls)
    for key in data:
        if key not in keys:
            near = difflib.get_close_matches(str(key), keys, n=1)
            hint = f"did you mean {near[0]!r}?" if near else f"known: {', '.join(keys)}"
            raise SettingError(quoted(key), f"unknown field; {hint}")
    before = {} if base is None else {name: getattr(base, name) for name in names_of(cls)}
    return built(cls, _values(cls, data, before))


def _values(
    cls: Callable[..., Any], data: Mapping[Any, Any], before: Mapping[str, Any]
) -> dict[str, Any]:
    """The values of settings in ``data``, by name in Python, and those ``before`` of others."""
    values = dict(before)
    errors: list[SettingError] = []
    for setting in settings_of(cls):
        if setting.key not in data:
            if setting.default is REQUIRED and setting.name not in before:
                errors.append(SettingError(setting.key, "missing"))
            continue
        context = _context(setting)
        try:
            base = before.get(setting.name)
            values[setting.name] = _value(setting.kind, data[setting.key], context, base)
        except SettingError as error:
            errors.append(error.below(setting.key))
    if errors:
        more = len(errors) - 1 + sum(error.more for error in errors)
        raise SettingError(errors[0].field, errors[0].text, more)
    return values


def _context(setting: Setting) -> _Context:
    bounds = Bounds() if setting.unit is None else setting.unit.bounds
    return _Context(setting.key.replace("_", " "), setting.unit, bounds)


def built(cls: Callable[..., Settings], values: Mapping[str, Any]) -> Settings:
    """An instance of a class. Raises ``SettingError`` for what the class itself finds wrong."""
    try:
        return cls(**values)
    except SettingError:
        raise
    except (UserError, ValueError) as error:
        text = str(error)
        while ": " in text:  # a class may say which one it is before it names the field
            field, _, text = text.partition(": ")
            if re.split(r"[.\[]", field)[0] in keys_of(cls):
                raise SettingError(field, text) from error
        raise SettingError("", str(error)) from error


def _value(kind: Any, value: object, context: _Context, base: object) -> Any:
    """``value`` as a ``kind``. Raises ``SettingError``."""
    kind, context = context.of(kind)
    origin = get_origin(kind)
    if origin in (Union, UnionType):
        return _value(_member(kind, value, context), value, context, base)
    if kind is NoneType:
        return None
    if context.plug_in is not None:
        if kind is str:
            return context.plug_in.name(value)
        return context.plug_in.read(value, base)
    if is_settings_class(kind):
        return _settings(kind, value, base if isinstance(base, kind) else None)
    if origin is Literal:
        return _literal(kind, value, context)
    if origin is tuple:
        return _items(kind, value, context)
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return _mapping(kind, value, context)
    if kind is str:
        return _text(value, context)
    if kind is bool:
        return _of_type(value, bool, "true or false")
    if kind in (int, float):
        return _number(kind, value, context)
    return value


def _member(union: Any, value: object, context: _Context) -> Any:
    """The member of a union that ``value`` is meant as, by how it is written."""
    members = get_args(union)
    for member in members:
        if _fits(member, value, context):
            return member
    if context.one_of:
        choices = [
            choice
            for member in members
            if get_origin(member) is Literal
            for choice in get_args(member)
        ]
        words = ", ".join([*choices, context.one_of])
        raise SettingError("", f"must be {words}, not {short_repr(value)}")
    return next(member for member in members if member is not NoneType)


def _fits(kind: Any, value: object, context: _Context) -> bool:
    """Whether a value is written as those of this type are."""
    kind, context = context.of(kind)
    origin = get_origin(kind)
    if kind is NoneType or value is None:
        return kind is NoneType and value is None
    if context.plug_in is not None:
        return True
    if is_settings_class(kind):
        return isinstance(value, Mapping | kind) or hasattr(kind, "expand")
    if origin is tuple:
        return isinstance(value, list | tuple)
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return isinstance(value, Mapping)
    if kind is bool:
        return isinstance(value, bool)
    if kind in (int, float):
        number = isinstance(value, int | float) and not isinstance(value, bool)
        return number or (context.unit is not None and isinstance(value, str))
    return isinstance(value, str)


def _literal(kind: Any, value: object, context: _Context) -> Any:
    choices = get_args(kind)
    if value in choices:
        return value
    others = f", {context.one_of}" if context.one_of else ""
    raise SettingError("", unknown(context.name, value, choices) + others)


def _items(kind: Any, value: object, context: _Context) -> tuple[Any, ...]:
    """A list as a tuple: of any length, or with one item for each of the types."""
    items: Any = _of_type(value, list | tuple, "a list")
    kinds = get_args(kind)
    if kinds[-1] is Ellipsis:
        kinds = kinds[:1] * len(items)
    if len(items) != len(kinds):
        raise SettingError("", f"must hold {len(kinds)} values, not {len(items)}")
    _check_not_empty(items, context)
    context = context._replace(name=context.name.removesuffix("s"), not_empty=False)
    values: list[Any] = []
    errors: list[SettingError] = []
    for index, (inner, item) in enumerate(zip(kinds, items, strict=True)):
        try:
            values.append(_value(inner, item, context, None))
        except SettingError as error:
            errors.append(error.below(index))
    if errors:
        more = len(errors) - 1 + sum(error.more for error in errors)
        raise SettingError(errors[0].field, errors[0].text, more)
    return tuple(values)


def _mapping(kind: Any, value: object, context: _Context) -> dict[Any, Any]:
    key_kind, item_kind = get_args(kind)
    items: Any = _of_type(value, Mapping, "a mapping")
    _check_not_empty(items, context)
    values = {}
    for key, item in items.items():
        try:
            inner = context._replace(name=str(key), not_empty=False)
            values[_value(key_kind, key, inner, None)] = _value(item_kind, item, inner, None)
        except SettingError as error:
            raise error.below(quoted(key)) from error
    return values


def _text(value: object, context: _Context) -> str:
    text: str = _of_type(value, str, "text")
    _check_not_empty(text, context)
    rule = context.matches
    if rule is not None and len(text) > rule.maximum:
        raise SettingError("", f"must have at most {rule.maximum} characters, not {len(text)}")
    if rule is not None and not re.search(rule.pattern, text):
        raise SettingError("", f"{rule.rule}, not {short_repr(text)}")
    return text


def _number(kind: type, value: object, context: _Context) -> float:
    if context.unit is not None:
        return _quantity(value, context.unit, context.bounds)
    if kind is int:
        number: float = _of_type(value, int, "a whole number")
    else:
        number = _of_type(value, int | float, "a number")
        try:
            number = float(number)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            raise SettingError("", f"must be a finite number, not {short_repr(value)}")
    if not context.bounds.contain(number):
        raise SettingError("", f"must be {context.bounds.words}, not {short_repr(value)}")
    return number


def _quantity(value: object, unit: Unit, bounds: Bounds) -> float:
    """A number with a unit, such as ``30 ms``."""
    try:
        number = unit.read(value)
    except ValueError as error:
        raise SettingError("", str(error)) from error
    if not bounds.contain(number):
        words = "be more than zero"
        if bounds.minimum == 0 and number < 0:
            words = "not be negative"
        elif bounds.minimum is not None and bounds.maximum is not None:
            words = f"be from {unit.text(bounds.minimum)} to {unit.text(bounds.maximum)}"
        raise SettingError("", f"must {words}, but is {short_repr(value)}")
    return number


def _of_type(value: object, kind: Any, words: str) -> Any:
    if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
        raise SettingError("", f"must be {words}, not {short_repr(value)}")
    return value


def _check_not_empty(value: Any, context: _Context) -> None:
    if context.not_empty and not value:
        raise SettingError("", "must not be empty")


def is_settings_class(kind: Any) -> TypeGuard[type[Any]]:
    """Whether a type is a settings class, which a plug-in by name is not."""
    return isinstance(kind, type) and dataclasses.is_dataclass(kind) and kind is not Choice


def _plain_number(number: float) -> str:
    """``1,000,000`` and ``0.1``."""
    return f"{number:,.10g}"


def quoted(key: object) -> str:
    """A key as part of a path; in quotes if it is no plain word."""
    return key if isinstance(key, str) and re.fullmatch(r"[\w-]{1,40}", key) else short_repr(key)


def join(step: str | int, path: str) -> str:
    """``path`` below a name, a path or an index: ``cars[1].edge``."""
    begin = f"[{step}]" if isinstance(step, int) else step
    return begin + path if not path or not begin or path.startswith("[") else f"{begin}.{path}"


# --- plug-ins


class Presets(NamedTuple):
    """Whole choices of a plug-in by name, such as links; the ``usual`` one completes others."""

    what: str
    choices: Mapping[str, Choice]
    usual: str

    def get(self, name: object) -> Choice:
        """The choice of this name. Raises ``SettingError``."""
        if not isinstance(name, str) or name not in self.choices:
            raise SettingError("", unknown(self.what, name, self.choices))
        return self.choices[name]


@dataclasses.dataclass(frozen=True, eq=False)
class PlugIn:
    """Marks a ``Choice`` out of ``registry``: in YAML a name, or a mapping of the name (under
    ``key``) and the settings of the class. Marks a text that is a name alone, too.

    Parameters
    ----------
    what : str
        The kind of plug-in, for messages.
    registry : mapping
        Every shipped class, or ``package.module:Class``, by name.
    methods : tuple of str
        What a class of the user's own must have.
    key : str
        The name of the class in a mapping.
    default : str, optional
        The class of a mapping that names none.
    presets : Presets, optional
        What may be written instead. A mapping may name one under ``like`` for what it leaves out.
    beside : tuple of str
        Settings of another class that stand in the same mapping; who reads it takes them out
        before.
    """

    what: str
    registry: Mapping[str, Any]
    methods: tuple[str, ...] = ()
    key: str = "name"
    default: str | None = None
    presets: Presets | None = None
    beside: tuple[str, ...] = ()

    def name(self, value: object) -> str:
        """A name alone, such as that of an eviction policy. Raises ``SettingError``."""
        if isinstance(value, Mapping):
            text = f"must be a name alone, without settings, not {short_repr(value)}"
            raise SettingError("", text)
        try:
            return plugins.checked_name(self.what, value, self.registry)
        except ValueError as error:
            raise SettingError("", str(error)) from error

    def read(self, value: object, base: object = None) -> Choice:
        """A name or a mapping, completed by ``base`` unless it names a class, else by the defaults
        of the class. Raises ``SettingError``.

        Settings of a class of the user's own stay as they are written: its code runs only where the
        class is needed (``make``).
        """
        if isinstance(value, Choice):
            return value
        if isinstance(value, str) and self.presets is not None and not plugins.is_custom(value):
            return self.presets.get(value)
        if not isinstance(value, str | Mapping):
            raise SettingError("", f"must be a name or a mapping, not {short_repr(value)}")
        given = dict(value) if isinstance(value, Mapping) else {self.key: value}
        if self.key in given or "like" in given or not isinstance(base, Choice):
            base = None
        named = given.pop(self.key, self.default) if base is None else base.name
        try:
            name = self.name(named)
        except SettingError as error:
            raise error.below(self.key if isinstance(value, Mapping) else "") from error
        if base is None and self.presets is not None and name == self.default:
            try:
                base = self.presets.get(given.pop("like", self.presets.usual))
            except SettingError as error:
                raise error.below("like") from error
        before = {} if base is None else dict(base.parameters)
        if name not in self.registry:
            return Choice(name, before | _unread(given))
        cls = self.resolve(name)
        values = _arguments(cls, name, given, before=before, beside=self.beside)
        built(cls, values)  # the class validates its own ranges
        return Choice(name, values)

    def resolve(self, name: str) -> Any:
        """The class called ``name``. Raises ``UserError``."""
        return plugins.resolve(self.what, name, self.registry, self.methods)

    def make(self, choice: Choice) -> Any:
        """An instance of the chosen class. Raises ``UserError``."""
        cls = self.resolve(choice.name)
        parameters = choice.parameters
        if choice.name not in self.registry:
            with as_user_error(f"{self.what} {choice.name!r}", SettingError):
                parameters = own_arguments(cls, choice)
        return plugins.call(self.what, choice.name, cls, **parameters)

    def write(self, choice: Choice) -> object:
        """The choice as in YAML."""
        for name, preset in self.presets.choices.items() if self.presets else ():
            if choice == preset:
                return name
        if not choice.parameters:
            return choice.name
        if choice.name not in self.registry:
            return {self.key: choice.name, **choice.parameters}
        cls = self.resolve(choice.name)
        return {self.key: choice.name, **_written(cls, choice.parameters)}


def complete(name: str, cls: Callable[..., Any], **parameters: Any) -> Choice:
    """The choice of a shipped class, with the defaults of what is not given."""
    defaults = {setting.name: setting.default for setting in settings_of(cls)}
    return Choice(name, defaults | parameters)


def _unread(given: Mapping[str, Any]) -> dict[str, Any]:
    """Settings of a class of the user's own, as they are written."""
    for key, item in given.items():
        if not isinstance(item, Parameter):
            text = f"must be a number, true or false, or text, not {short_repr(item)}"
            raise SettingError(quoted(key), text)
    return dict(given)


def _arguments(
    cls: Callable[..., Any],
    name: str,
    given: Mapping[str, Any],
    *,
    before: Mapping[str, Any] = MappingProxyType({}),
    beside: Collection[str] = (),
) -> dict[str, Any]:
    """The arguments of a plug-in's class, by name in Python. Raises ``SettingError``.

    Parameters
    ----------
    cls : callable
        The class.
    name : str
        What it is called in YAML.
    given : mapping
        Its settings as in YAML.
    before : mapping
        Arguments that ``given`` may leave out; the defaults of the class complete them.
    beside : collection of str
        Settings of another class in the same mapping, named among the choices.
    """
    keys = keys_of(cls)
    for key in given:
        if key not in keys:
            text = unknown(f"parameter of {name}", key, [*keys, *beside])
            raise SettingError(quoted(key), text)
    values = _values(cls, given, before)
    return {setting.name: values.get(setting.name, setting.default) for setting in settings_of(cls)}


def own_arguments(cls: Callable[..., Any], choice: Choice) -> dict[str, Any]:
    """The arguments of a class of the user's own, out of its settings as they are written. Raises
    ``SettingError``.
    """
    try:
        parameters = inspect.signature(cls).parameters.values()
    except (TypeError, ValueError):  # a class without a signature takes what it is given
        return dict(choice.parameters)
    if any(parameter.kind is parameter.VAR_KEYWORD for parameter in parameters):
        keys = keys_of(cls)
        others = {key: item for key, item in choice.parameters.items() if key not in keys}
        given = {key: item for key, item in choice.parameters.items() if key in keys}
        return others | _arguments(cls, choice.name, given)
    return _arguments(cls, choice.name, choice.parameters)


class Chosen(NamedTuple):
    """A plug-in that settings name; its own settings stand at ``path``, unless it is a
    ``name_alone``.
    """

    path: str
    mark: PlugIn
    choice: Choice
    name_alone: bool = False


def chosen(value: object, path: str = "") -> Iterator[Chosen]:
    """Every plug-in that settings name, at any depth; ``path`` is where they stand themselves."""
    cls: Any = type(value)
    for setting in settings_of(cls):
        item = getattr(value, setting.name)
        yield from _chosen(setting.kind, item, join(path, setting.key), path)


def _chosen(kind: Any, item: object, path: str, parent: str) -> Iterator[Chosen]:
    plug_in = mark_in(kind, PlugIn)
    if plug_in is not None and isinstance(item, Choice | str):
        if isinstance(item, str):
            yield Chosen(path, plug_in, Choice(item), name_alone=True)
        else:
            yield Chosen(parent if plug_in.beside else path, plug_in, item)
    elif isinstance(item, tuple):
        for index, inner in enumerate(item):
            yield from _chosen(kind, inner, f"{path}[{index}]", path)
    elif is_settings_class(type(item)):
        yield from chosen(item, path)


# --- writing


def plain_data(value: object) -> Any:
    """Settings as plain data for YAML and JSON, every one written out; ``read`` reads them back."""
    return _plain(type(value), value, None)


def _plain(kind: Any, value: Any, unit: Unit | None) -> Any:
    """A value of an annotated type as plain data."""
    if isinstance(value, Choice):
        plug_in = mark_in(kind, PlugIn)
        assert plug_in is not None, f"{kind} says nothing of its plug-ins"
        return plug_in.write(value)
    if isinstance(value, int | float) and not isinstance(value, bool):
        return value if unit is None else unit.text(value)
    if is_settings_class(type(value)):
        if hasattr(value, "shorten"):
            return value.shorten()
        return _written(type(value), {name: getattr(value, name) for name in names_of(type(value))})
    if isinstance(value, Mapping):
        return {key: _plain(kind, item, unit) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(kind, item, unit) for item in value]
    return value


def plain_default(setting: Setting) -> Any:
    """The default of a setting as plain data."""
    return _plain(setting.kind, setting.default, setting.unit)


def _written(cls: Callable[..., Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """Values by their names in Python, as in YAML."""
    return {
        setting.key: _plain(setting.kind, values[setting.name], setting.unit)
        for setting in settings_of(cls)
        if setting.name in values
        and (mark_in(setting.kind, IfGiven) is None or values[setting.name] != setting.default)
    }
