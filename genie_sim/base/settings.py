"""Settings: frozen dataclasses, read from plain data, which is what YAML and JSON hold (texts,
numbers, truth values, null, lists, mappings), and written back.

A field is a setting. Its annotation is its type, with the marks of ``base.marks`` in ``Annotated``
where there is more to say. The end of its name is its unit (``delay_ns``); in YAML
the name has none, but the value does (``delay: 0.2 ms``). The text below it is its description. The
arguments of a plug-in's class are settings in the same way. Below, an ``annotation`` is what Python
has, a bare type or ``Annotated``; a ``Kind`` is an annotation taken apart.

A class may have a class method ``expand``, which turns a short form into a mapping or an instance
before it is read, and a method ``shorten``, which does the opposite. What its ``__post_init__``
raises as ``SettingError`` is reported with the path of that field.

A new type that a setting may have is a row of ``YAML_FORMS``, or a case of ``_fits``, which tells
it apart in a union; and, unless what YAML has is the value, a case of ``_value``, which reads it,
of ``_written``, which writes it, and of ``scenario.schema._schema``, which tells editors of it.
``tests/scenario/test_kinds_of_settings.py`` takes every type through all of them.
"""

import dataclasses
import difflib
import functools
import importlib
import inspect
import math
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType, NoneType, UnionType
from typing import Annotated, Any, Literal, NamedTuple, TypeVar, Union, get_args, get_origin

from genie_sim.base import plugins
from genie_sim.base.errors import UserError, as_user_error, short_repr, unknown
from genie_sim.base.marks import ENDINGS, Bounds, Key, Matches, NotEmpty, Short
from genie_sim.base.plugins import Choice, Parameter
from genie_sim.base.setting_errors import SettingError, join, must, quoted
from genie_sim.base.units import Quantity

Instance = TypeVar("Instance")
CLOSE = 0.75  # of difflib's ratio: above it a misspelt name, below it perhaps one of another place
MAX_DIGITS = 18  # of whole numbers: all fit 64 bits, and all are read back as they are written
REQUIRED = inspect.Parameter.empty  # the default of a setting that must be given


# --- the settings of a class


class YamlForm(NamedTuple):
    """What stands in YAML for a type: the classes that a YAML reader makes of it, its name in error
    lines and in JSON Schema.
    """

    classes: tuple[type, ...]
    words: str
    schema: str

    def holds(self, value: object) -> bool:
        """Whether a value is one; true and false are no numbers."""
        return isinstance(value, self.classes) and isinstance(value, bool) is (bool in self.classes)


YAML_FORMS: Mapping[Any, YamlForm] = {
    NoneType: YamlForm((NoneType,), "null", "null"),
    bool: YamlForm((bool,), "true or false", "boolean"),
    int: YamlForm((int,), "a whole number", "integer"),
    float: YamlForm((int, float), "a number", "number"),
    str: YamlForm((str,), "text", "string"),
    Literal: YamlForm((str,), "text", "string"),
    tuple: YamlForm((list, tuple), "a list", "array"),
    Mapping: YamlForm((Mapping,), "a mapping", "object"),
}


class Kind(NamedTuple):
    """An annotation, taken apart: the bare type, its arguments, and the marks by their class;
    ``name`` is what error lines call the setting.
    """

    type: Any
    arguments: tuple[Any, ...]
    marks: Mapping[type, Any]
    name: str

    @classmethod
    def of(
        cls, annotation: Any, name: str = "", marks: Mapping[type, Any] = MappingProxyType({})
    ) -> "Kind":
        """Marks inside an annotation come before those around it."""
        while get_origin(annotation) is Annotated:
            annotation, *own = get_args(annotation)
            marks = {**marks, **{type(mark): mark for mark in own}}
        return cls(get_origin(annotation) or annotation, get_args(annotation), marks, name)

    @property
    def yaml_form(self) -> YamlForm | None:
        """What it is in YAML; ``None``: anything."""
        return YAML_FORMS.get(Mapping if is_mapping(self.type) else self.type)

    @property
    def plug_in(self) -> "PlugIn | None":
        """Of which it is a choice, or a name."""
        return self.marks.get(PlugIn) if self.type in (str, Choice) else None

    @property
    def unit(self) -> Quantity[Any] | None:
        """Of a number that is written with one."""
        return self.marks.get(Quantity) if self.type in (int, float) else None

    @property
    def members(self) -> "list[Kind]":
        """Those of a union; any other kind is its only one."""
        if self.type not in (Union, UnionType):
            return [self]
        return [Kind.of(part, self.name, self.marks) for part in self.arguments]

    @property
    def items(self) -> "list[Kind]":
        """What a list or a mapping holds."""
        marks = {key: mark for key, mark in self.marks.items() if key not in (NotEmpty, Short)}
        name = self.name.removesuffix("s")
        return [Kind.of(part, name, marks) for part in self.arguments if part is not ...]


class Setting(NamedTuple):
    """One field of a settings class, or one argument of a plug-in's class.

    ``name`` is its name in Python, ``key`` in YAML; ``kind`` is the ``annotation`` taken apart,
    with the unit that the name has; ``default`` may be ``REQUIRED``.
    """

    name: str
    key: str
    annotation: Any
    kind: Kind
    default: Any


@functools.cache
def settings_of(cls: Callable[..., Any]) -> tuple[Setting, ...]:
    """Every setting of a class: fields of a dataclass, arguments of any other.

    A field that is no setting has ``setting=False`` in its metadata.
    """
    fields = getattr(cls, "__dataclass_fields__", {})
    settings = []
    for name, parameter in _signature(cls).parameters.items():
        field = fields.get(name)
        if parameter.kind in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD) or (
            field is not None and not field.metadata.get("setting", True)
        ):
            continue
        default = parameter.default
        if field is not None and field.default_factory is not dataclasses.MISSING:
            default = field.default_factory()
        ending = next((ending for ending in ENDINGS if name.endswith(ending)), "")
        unit, bounds = ENDINGS.get(ending, (None, Bounds()))
        annotation = parameter.annotation
        if annotation is parameter.empty or isinstance(annotation, str):  # its unit says the type
            annotation = Any
            if unit is not None:
                annotation = unit.number | None if default is None else unit.number
        key = mark_in(annotation, Key)
        key_name = name.removesuffix(ending) if key is None else key.name
        around = {} if unit is None else {Quantity: unit, Bounds: bounds}
        kind = Kind.of(annotation, key_name.replace("_", " "), around)
        settings.append(Setting(name, key_name, annotation, kind, default))
    return tuple(settings)


def keys_of(cls: Callable[..., Any]) -> list[str]:
    """The names in YAML of the settings of a class."""
    return [setting.key for setting in settings_of(cls)]


def names_of(cls: Callable[..., Any]) -> list[str]:
    """The names in Python of the settings of a class."""
    return [setting.name for setting in settings_of(cls)]


def _signature(cls: Callable[..., Any]) -> inspect.Signature:
    """The arguments of a class; annotations stay texts where their names cannot be found."""
    try:
        return inspect.signature(cls, eval_str=True)
    except NameError:
        return inspect.signature(cls)


Mark = TypeVar("Mark")


def mark_in(annotation: Any, mark: type[Mark]) -> Mark | None:
    """The mark of this type in an annotation, also in members of a union or items of a list."""
    for part in get_args(annotation) if get_origin(annotation) is not Literal else ():
        inner = part if isinstance(part, mark) else mark_in(part, mark)
        if inner is not None:
            return inner
    return None


def is_mapping(annotation: Any) -> bool:
    """Whether an annotation without marks is a mapping's."""
    return isinstance(annotation, type) and issubclass(annotation, Mapping)


def is_settings_class(annotation: Any) -> bool:
    """Whether an annotation without marks is a settings class, which ``Choice`` of a plug-in is
    not.
    """
    is_dataclass = isinstance(annotation, type) and dataclasses.is_dataclass(annotation)
    return is_dataclass and annotation is not Choice


# --- reading


def read(cls: type[Instance], data: object, where: Callable[[str], str]) -> Instance:
    """The settings in ``data``, plain data as from YAML; ``where`` gives the file, or the option,
    that a field's path comes from. Raises ``UserError`` in one line, for the first mistake.
    """
    try:
        return from_plain(cls, data)
    except SettingError as error:
        parts = (where(error.field), error.field, error.message)
        raise UserError(": ".join(part for part in parts if part)) from error


def from_plain(cls: type[Instance], data: object) -> Instance:
    """The settings in ``data``, plain data as from YAML. Raises ``SettingError``."""
    settings: Instance = _class_value(cls, data, None)
    return settings


def merged(base: Instance, data: Mapping[str, Any]) -> Instance:
    """``base`` with what ``data`` sets otherwise, at any depth: a plug-in that is named anew brings
    its own settings. Raises ``SettingError``.
    """
    settings: Instance = _class_value(type(base), data, base)
    return settings


def _value(kind: Kind, value: Any, base: object = None) -> Any:
    """The setting that YAML has as ``value``; what is left out is as in ``base``, a setting that
    was read before. Raises ``SettingError``.

    Marks come first, since they change what a type is in YAML: the name of a plug-in is no text
    like others, and a time, a whole number here, is a text there.
    """
    if kind.plug_in is not None:
        return kind.plug_in.name(value) if kind.type is str else kind.plug_in.read(value, base)
    if kind.unit is not None:
        return _quantity(kind.unit, kind.marks.get(Bounds, Bounds()), value)
    if kind.type in (Union, UnionType):
        return _value(_member(kind, value), value, base)
    if is_settings_class(kind.type):
        return _class_value(kind.type, value, base)
    if kind.type is Literal:
        if value not in kind.arguments:
            raise SettingError("", unknown(kind.name, value, kind.arguments))
        return value
    form = kind.yaml_form
    if form is None:
        return value
    if not form.holds(value):
        raise must(f"be {form.words}", value)
    if NotEmpty in kind.marks and not value:
        raise SettingError("", "must not be empty")
    if kind.type in (int, float):
        return _number(kind, value)
    if Matches in kind.marks and kind.type is str:
        _check_text(kind.marks[Matches], value)
    if not kind.arguments:
        return value
    return _list(kind, value) if kind.type is tuple else _mapping(kind, value)


def _list(kind: Kind, value: Sequence[Any]) -> tuple[Any, ...]:
    kinds = _kinds_of_items(kind, value)
    if len(kinds) != len(value):
        raise SettingError("", f"must hold {len(kinds)} values, not {len(value)}")
    return tuple(_each(enumerate(value), lambda place, item: _value(kinds[place], item)))


def _mapping(kind: Kind, value: Mapping[Any, Any]) -> dict[Any, Any]:
    keys, items = kind.items
    pairs = ((quoted(key), (key, item)) for key, item in value.items())
    return dict(_each(pairs, lambda _, pair: (_value(keys, pair[0]), _value(items, pair[1]))))


def _each(items: Iterable[tuple[Any, Any]], value: Callable[[Any, Any], Any]) -> list[Any]:
    """The value of each (step, item). Raises the first of several mistakes, which says how many
    there are besides.
    """
    values: list[Any] = []
    errors: list[SettingError] = []
    for step, item in items:
        try:
            values.append(value(step, item))
        except SettingError as error:
            errors.append(error.below(step))
    if errors:
        more = len(errors) - 1 + sum(error.more for error in errors)
        raise SettingError(errors[0].field, errors[0].text, more, errors[0].stray)
    return values


def _fits(kind: Kind, value: object) -> bool:
    """Whether a value is written, or was read, as those of this member of a union are."""
    if kind.plug_in is not None:
        return value is not None
    if kind.type in (Union, UnionType):
        return any(_fits(member, value) for member in kind.members)
    if is_settings_class(kind.type):
        short = hasattr(kind.type, "expand") and value is not None
        return short or isinstance(value, Mapping | kind.type)
    form = kind.yaml_form or YAML_FORMS[str]  # a text for a class of anybody's, such as ``Path``
    return form.holds(value) or (kind.unit is not None and isinstance(value, str))


def _member(kind: Kind, value: object) -> Kind:
    """The first member of a union as which a value is written. Raises ``SettingError``."""
    for member in kind.members:
        if _fits(member, value):
            return member
    first, *others = [member for member in kind.members if member.type is not NoneType]
    if not others:
        return first
    forms = [member.yaml_form for member in (first, *others)]
    words = " or ".join(form.words if form else "a mapping" for form in forms)
    raise must(f"be {words}", value)


def _quantity(unit: Quantity[Any], bounds: Bounds, value: Any) -> float:
    try:
        number: float = unit.read(value)
    except ValueError as error:
        raise SettingError("", str(error)) from error
    if not bounds.contain(number):
        words = f"be {bounds.words(unit.text)}"
        if number <= 0 and 0 in (bounds.minimum, bounds.above):
            words = "not be negative" if bounds.minimum == 0 else "be more than zero"
        raise SettingError("", f"must {words}, but is {short_repr(value)}")
    return number


def _number(kind: Kind, value: float) -> float:
    bounds = kind.marks.get(Bounds, Bounds())
    number = value
    if kind.type is float:
        number = float(value) if abs(value) < 1e308 else math.inf
        if not math.isfinite(number):
            raise must("be a finite number", value)
    elif abs(number) >= 10**MAX_DIGITS:
        raise must(f"have at most {MAX_DIGITS} digits", value)
    if not bounds.contain(number):
        raise must(f"be {bounds.words('{:,.10g}'.format)}", value)
    return number


def _check_text(rule: Matches, text: str) -> None:
    if len(text) > rule.maximum:
        raise SettingError("", f"must have at most {rule.maximum} characters, not {len(text)}")
    if not re.fullmatch(rule.pattern, text):
        raise SettingError("", f"{rule.rule}, not {short_repr(text)}")


def _kinds_of_items(kind: Kind, value: Collection[Any]) -> list[Kind]:
    return kind.items * len(value) if kind.arguments[-1] is ... else kind.items


def _class_value(cls: type[Any], value: Any, base: Any) -> Any:
    """An instance of a settings class; what a mapping leaves out is as in ``base``, while a short
    form has all its settings.
    """
    if isinstance(value, cls):
        return value
    base = base if isinstance(value, Mapping) and isinstance(base, cls) else None
    if hasattr(cls, "expand"):
        value = cls.expand(value)
        if isinstance(value, cls):
            return value
    if not isinstance(value, Mapping):
        raise must("be a mapping", value)
    keys = keys_of(cls)
    for key in value:
        if key not in keys:
            near = difflib.get_close_matches(str(key), keys, n=1, cutoff=CLOSE)
            hint = f"did you mean {near[0]!r}?" if near else f"known: {', '.join(keys)}"
            raise SettingError(quoted(key), f"unknown field; {hint}", stray=not near)
    before = {} if base is None else {name: getattr(base, name) for name in names_of(cls)}
    return built(cls, _values(cls, value, before))


def _values(
    cls: Callable[..., Any], data: Mapping[Any, Any], before: Mapping[str, Any]
) -> dict[str, Any]:
    """The values of settings in ``data``, by name in Python, and those ``before`` of others."""

    def value(key: str, setting: Setting) -> Any:
        if key in data:
            return _value(setting.kind, data[key], before.get(setting.name))
        raise SettingError("", "missing")

    asked = [
        setting
        for setting in settings_of(cls)
        if setting.key in data or (setting.default is REQUIRED and setting.name not in before)
    ]
    values = _each(((setting.key, setting) for setting in asked), value)
    return {**before, **dict(zip((setting.name for setting in asked), values, strict=True))}


def built(cls: Callable[..., Instance], values: Mapping[str, Any]) -> Instance:
    """An instance of a class. Raises ``SettingError`` for what the class itself finds wrong."""
    try:
        return cls(**values)
    except SettingError:
        raise
    except (UserError, ValueError) as error:
        raise SettingError("", str(error)) from error


# --- plug-ins


class Presets(NamedTuple):
    """Whole choices of a plug-in by name, such as links; the ``usual`` one completes others. They
    stand at ``place``, ``package.module:NAME``, and are imported when they are asked for.
    """

    what: str
    place: str
    usual: str

    @property
    def choices(self) -> Mapping[str, Choice]:
        """All of them, by name."""
        module, _, name = self.place.partition(":")
        choices: Mapping[str, Choice] = getattr(importlib.import_module(module), name)
        return choices

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
    beside : tuple of class
        Classes whose settings stand in the same mapping; who reads it takes them out before.
    """

    what: str
    registry: Mapping[str, Any]
    methods: tuple[str, ...] = ()
    key: str = "name"
    default: str | None = None
    presets: Presets | None = None
    beside: tuple[Any, ...] = ()

    @property
    def keys_beside(self) -> list[str]:
        """The names in YAML of the settings in the same mapping that are not of its class."""
        return [key for cls in self.beside for key in keys_of(cls)]

    def name(self, value: object) -> str:
        """A name alone, such as that of an eviction policy. Raises ``SettingError``."""
        if isinstance(value, Mapping):
            raise must("be a name alone, without settings", value)
        try:
            return plugins.checked_name(self.what, value, self.registry)
        except ValueError as error:
            hint = ""
            if (
                self.presets is not None
                and isinstance(value, str)
                and value in self.presets.choices
            ):
                hint = f"; {value!r} is a {self.presets.what}: like: {value}"
            raise SettingError("", f"{error}{hint}") from error

    def read(self, value: object, base: object = None) -> Choice:
        """A name or a mapping, completed by ``base`` unless it names a class, else by the defaults
        of the class. Raises ``SettingError``.

        Settings of a class of the user's own stay as they are written: its code runs only where the
        class is needed (``make``).
        """
        if isinstance(value, Choice):
            return value
        if isinstance(value, str) and self.presets is not None and not plugins.is_own(value):
            return self.presets.get(value)
        if isinstance(value, str):
            return self._with(Choice(self.name(value)), {})
        if not isinstance(value, Mapping):
            raise must("be a name or a mapping", value)
        given = dict(value)
        if not isinstance(base, Choice) or given.keys() & {self.key, "like"}:
            base = self._named(given)
        return self._with(base, given)

    def _named(self, given: dict[str, Any]) -> Choice:
        """What completes a mapping that names a class, a preset or neither, whose names are taken
        out of it: of ``{like: wifi, loss: 0.1}`` all settings of that preset, of ``{name: lru}``
        nothing but the name.
        """
        try:
            name = self.name(given.pop(self.key, self.default))
        except SettingError as error:
            raise error.below(self.key) from error
        if self.presets is None or name != self.default:
            return Choice(name)
        try:
            return self.presets.get(given.pop("like", self.presets.usual))
        except SettingError as error:
            raise error.below("like") from error

    def _with(self, base: Choice, given: Mapping[str, Any]) -> Choice:
        """``base`` with the settings ``given``, and the defaults of its class."""
        name, before = base.name, base.parameters
        if name not in self.registry:
            for key, item in given.items():
                if not isinstance(item, Parameter | list | Mapping):
                    raise must("be a number, true or false, text, a list or a mapping", item).below(
                        quoted(key)
                    )
            return Choice(name, {**before, **given})
        cls = self.resolve(name)
        values = _arguments(cls, name, given, before=before, beside=self.keys_beside)
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

    def written(self, value: Choice) -> Any:
        """A choice as in YAML."""
        for name, preset in self.presets.choices.items() if self.presets else ():
            if value == preset:
                return name
        if not value.parameters:
            return value.name
        if value.name not in self.registry:
            return {self.key: value.name, **value.parameters}
        return {self.key: value.name, **written(self.resolve(value.name), value.parameters)}


def complete(name: str, cls: Callable[..., Any], **parameters: Any) -> Choice:
    """The choice of a shipped class, with the defaults of what is not given."""
    defaults = {setting.name: setting.default for setting in settings_of(cls)}
    return Choice(name, defaults | parameters)


def _arguments(
    cls: Callable[..., Any],
    name: str,
    given: Mapping[str, Any],
    *,
    before: Mapping[str, Any] = MappingProxyType({}),
    beside: Collection[str] = (),
) -> dict[str, Any]:
    """The arguments of a plug-in's class, by name in Python, out of the settings ``given`` to what
    is called ``name``; those ``before`` and the defaults of the class complete them. ``beside`` are
    settings of another class, named among the choices. Raises ``SettingError``.
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
    given, others = dict(choice.parameters), {}
    if any(parameter.kind is parameter.VAR_KEYWORD for parameter in parameters):
        others = {key: given.pop(key) for key in [*given] if key not in keys_of(cls)}
    return others | _arguments(cls, choice.name, given)


class NamedPlugIn(NamedTuple):
    """A plug-in that settings name; its own settings stand at ``path``, unless it is a
    ``name_alone``.
    """

    path: str
    mark: PlugIn
    choice: Choice
    name_alone: bool = False


def named_plug_ins(value: object, path: str = "") -> Iterator[NamedPlugIn]:
    """Every plug-in that settings name, at any depth; ``path`` is where they stand themselves."""
    cls: Any = type(value)
    for setting in settings_of(cls):
        item = getattr(value, setting.name)
        yield from _plug_ins_of(setting.annotation, item, join(path, setting.key), path)


def _plug_ins_of(annotation: Any, item: object, path: str, parent: str) -> Iterator[NamedPlugIn]:
    plug_in = mark_in(annotation, PlugIn)
    if plug_in is not None and isinstance(item, Choice | str):
        if isinstance(item, str):
            yield NamedPlugIn(path, plug_in, Choice(item), name_alone=True)
        else:
            yield NamedPlugIn(parent if plug_in.beside else path, plug_in, item)
    elif isinstance(item, tuple):
        for index, inner in enumerate(item):
            yield from _plug_ins_of(annotation, inner, f"{path}[{index}]", path)
    elif is_settings_class(type(item)):
        yield from named_plug_ins(item, path)


# --- writing


def plain_data(value: object) -> Any:
    """Settings as plain data for YAML and JSON, every one written out; ``read`` reads them back."""
    return _written(Kind.of(type(value)), value)


def plain_default(setting: Setting) -> Any:
    """The default of a setting as plain data."""
    return _written(setting.kind, setting.default)


def _written(kind: Kind, value: Any) -> Any:
    """A setting as in YAML; what is of no such kind stays as it is."""
    if kind.type in (Union, UnionType):
        member = next((member for member in kind.members if _fits(member, value)), None)
        return value if member is None else _written(member, value)
    if isinstance(value, Choice):
        return kind.marks[PlugIn].written(value)
    if is_settings_class(type(value)):
        if hasattr(value, "shorten"):
            return value.shorten()
        cls = type(value)
        return written(cls, {name: getattr(value, name) for name in names_of(cls)})
    if kind.unit is not None and YAML_FORMS[float].holds(value):
        return kind.unit.text(value)
    if isinstance(value, Mapping):
        items = kind.items[1] if len(kind.arguments) == 2 else kind
        return {key: _written(items, item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        kinds = _kinds_of_items(kind, value) if kind.arguments else [kind] * len(value)
        return [_written(of, item) for of, item in zip(kinds, value, strict=True)]
    return value


def written(cls: Callable[..., Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """Values by their names in Python, as in YAML."""
    return {
        setting.key: _written(setting.kind, values[setting.name])
        for setting in settings_of(cls)
        if setting.name in values
    }
