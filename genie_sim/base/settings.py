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

from genie_sim.base import plugins
from genie_sim.base.errors import UserError, as_user_error, short_repr, unknown
from genie_sim.base.kinds import (
    FRAME_RATE,
    SIZE,
    UNITS,
    Bounds,
    Items,
    Kind,
    Matches,
    Named,
    Nothing,
    Number,
    OneOfKinds,
    Quantity,
    Schema,
    SettingError,
    TextKind,
    TrueOrFalse,
    Unit,
    Word,
    any_of,
    join,
    quoted,
    raise_first,
)
from genie_sim.base.plugins import OWN_CLASS_PATTERN, Choice, Parameter

__all__ = ["FRAME_RATE", "SIZE", "Bounds", "Matches", "Schema", "SettingError", "Unit", "join"]

Settings = TypeVar("Settings")
REQUIRED = inspect.Parameter.empty  # the default of a setting that must be given
OWN_CLASS = {"type": "string", "pattern": OWN_CLASS_PATTERN}


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

    ``name`` is its name in Python, ``key`` in YAML; ``default`` may be ``REQUIRED``. One that is
    written only ``if_given`` is not where it is as by default.
    """

    name: str
    key: str
    annotation: Any
    kind: Kind
    default: Any
    if_given: bool


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
        annotation = _annotation(parameter, default, unit)
        key = mark_in(annotation, Key)
        key_name = name.removesuffix(suffix) if key is None else key.name
        unit = unit or mark_in(annotation, Unit)
        bounds = Bounds() if unit is None else unit.bounds
        marks = _Marks(key_name.replace("_", " "), unit, bounds)
        settings.append(
            Setting(
                name=name,
                key=key_name,
                annotation=annotation,
                kind=kind_of(annotation, marks),
                default=default,
                if_given=mark_in(annotation, IfGiven) is not None,
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


def is_settings_class(kind: Any) -> TypeGuard[type[Any]]:
    """Whether a type is a settings class, which a plug-in by name is not."""
    return isinstance(kind, type) and dataclasses.is_dataclass(kind) and kind is not Choice


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


# --- kinds


class _Marks(NamedTuple):
    """What is known of a setting beside its type: the name of it, its unit and marks."""

    name: str
    unit: Unit | None = None
    bounds: Bounds = Bounds()
    matches: Matches | None = None
    not_empty: bool = False
    one_of: str = ""
    short: Short | None = None

    def of_items(self) -> "_Marks":
        """Those of what a list or a mapping holds."""
        return self._replace(name=self.name.removesuffix("s"), not_empty=False, short=None)


def kind_of(annotation: Any, marks: _Marks) -> Kind:
    """The kind of what an annotation says."""
    if get_origin(annotation) is Annotated:
        annotation, *own = get_args(annotation)
        for mark in own:
            match mark:
                case PlugIn():
                    return PlugInName(mark) if annotation is str else mark
                case Kind():
                    return mark
                case Bounds():
                    marks = marks._replace(bounds=mark)
                case Matches():
                    marks = marks._replace(matches=mark)
                case NotEmpty():
                    marks = marks._replace(not_empty=True)
                case OneOf():
                    marks = marks._replace(one_of=mark.words)
                case Short():
                    marks = marks._replace(short=mark)
        return kind_of(annotation, marks)
    parts = get_args(annotation)
    match get_origin(annotation) or annotation:
        case origin if origin in (Union, UnionType):
            kinds = tuple(kind_of(part, marks) for part in parts)
            return OneOfKinds(kinds, marks.one_of, _schemas_of(marks.short))
        case origin if origin is Literal:
            return Word(marks.name, parts, marks.one_of)
        case origin if origin is tuple and parts:
            any_length = parts[-1] is Ellipsis
            held = parts[:1] if any_length else parts
            kinds = tuple(kind_of(part, marks.of_items()) for part in held)
            return Items(kinds, any_length, marks.not_empty)
        case type() as origin if parts and issubclass(origin, Mapping):
            keys, items = (kind_of(part, marks.of_items()) for part in parts)
            return Named(keys, items, marks.not_empty, _schemas_of(marks.short))
        case cls if is_settings_class(cls):
            return Nested(cls, marks.short)
        case cls if cls is int or cls is float:
            if marks.unit is not None:
                return Quantity(marks.unit, marks.bounds)
            return Number(cls is int, marks.bounds)
        case cls if cls is str:
            return TextKind(marks.not_empty, marks.matches)
        case cls if cls is bool:
            return TrueOrFalse()
        case cls if cls is NoneType:
            return Nothing()
    return Kind()


def _schemas_of(short: Short | None) -> tuple[Schema, ...]:
    """What may be written in place of a mapping."""
    if short is None:
        return ()
    if short.plug_in is not None:
        return tuple(short.plug_in.names_schema())
    return ({"type": "string", "examples": list(short.examples)},)


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
    settings: Settings = Nested(cls).read(data)
    return settings


def merged(base: Settings, data: Mapping[str, Any]) -> Settings:
    """``base`` with what ``data`` sets otherwise, at any depth: a plug-in that is named anew brings
    its own settings. Raises ``SettingError``.
    """
    settings: Settings = Nested(type(base)).read(data, base)
    return settings


@dataclasses.dataclass(frozen=True)
class Nested(Kind):
    """Settings of a class of their own; ``short`` is what may be written instead."""

    cls: type[Any]
    short: Short | None = None

    def fits(self, value: object) -> bool:
        if hasattr(self.cls, "expand"):
            return value is not None
        return isinstance(value, Mapping | self.cls)

    def read(self, value: object, base: object = None) -> Any:
        cls = self.cls
        if isinstance(value, cls):
            return value
        base = base if isinstance(value, Mapping) and isinstance(base, cls) else None
        expand = getattr(cls, "expand", None)
        if expand is not None:
            value = expand(value)
            if isinstance(value, cls):
                return value
        if not isinstance(value, Mapping):
            raise SettingError("", f"must be a mapping, not {short_repr(value)}")
        keys = keys_of(cls)
        for key in value:
            if key not in keys:
                near = difflib.get_close_matches(str(key), keys, n=1)
                hint = f"did you mean {near[0]!r}?" if near else f"known: {', '.join(keys)}"
                raise SettingError(quoted(key), f"unknown field; {hint}")
        before = {} if base is None else {name: getattr(base, name) for name in names_of(cls)}
        return built(cls, _values(cls, value, before))

    def plain(self, value: Any) -> Any:
        cls = type(value)
        if not is_settings_class(cls):
            return super().plain(value)
        if hasattr(value, "shorten"):
            return value.shorten()
        return _written(cls, {name: getattr(value, name) for name in names_of(cls)})

    def schema(self, classes: dict[str, Schema]) -> Schema:
        name = self.cls.__name__
        if name not in classes:
            classes[name] = {}  # a class may hold itself
            classes[name] = class_schema(self.cls, classes)
            if self.short is not None and self.short.plug_in is not None:
                del classes[name]["required"]  # the name of a plug-in alone is enough
        return any_of(_schemas_of(self.short), {"$ref": f"#/$defs/{name}"})


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
        try:
            base = before.get(setting.name)
            values[setting.name] = setting.kind.read(data[setting.key], base)
        except SettingError as error:
            errors.append(error.below(setting.key))
    raise_first(errors)
    return values


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
class PlugIn(Kind):
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

    def fits(self, value: object) -> bool:
        return value is not None

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
        if isinstance(value, str) and self.presets is not None and not plugins.is_own(value):
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

    def plain(self, value: Any) -> Any:
        if not isinstance(value, Choice):
            return value
        for name, preset in self.presets.choices.items() if self.presets else ():
            if value == preset:
                return name
        if not value.parameters:
            return value.name
        if value.name not in self.registry:
            return {self.key: value.name, **value.parameters}
        return {self.key: value.name, **_written(self.resolve(value.name), value.parameters)}

    def schema(self, classes: dict[str, Schema]) -> Schema:
        """A name, or a mapping of the name and the settings of its class."""
        own_name = {"description": "A class of your own, `package.module:Class`.", **OWN_CLASS}
        own = {"type": "object", "properties": {self.key: own_name}, "required": [self.key]}
        shipped = [self._shipped_schema(name, classes) for name in self.registry]
        names = self.names_schema()
        if self.presets is not None:
            names = [{"enum": list(self.presets.choices)}]
            text = f"A named {self.presets.what} that gives the settings left out."
            like = {"like": {"description": text, "enum": list(self.presets.choices)}}
            for schema in shipped:
                schema["properties"] = like | schema["properties"]
                schema.pop("required", None)
        return {"anyOf": [*names, *shipped, own]}

    def names_schema(self) -> list[Schema]:
        """What a name alone may be."""
        return [{"enum": list(self.registry)}, OWN_CLASS]

    def _shipped_schema(self, name: str, classes: dict[str, Schema]) -> Schema:
        schema = class_schema(self.resolve(name), classes)
        schema["properties"] = {self.key: {"const": name}, **schema["properties"]}
        if name != self.default:
            schema["required"] = [self.key, *schema.get("required", ())]
        return schema


@dataclasses.dataclass(frozen=True)
class PlugInName(Kind):
    """The name of a plug-in alone, without settings, as a text."""

    plug_in: PlugIn

    def fits(self, value: object) -> bool:
        return value is not None

    def read(self, value: object, base: object = None) -> str:
        return self.plug_in.name(value)

    def schema(self, classes: dict[str, Schema]) -> Schema:
        return {"anyOf": self.plug_in.names_schema()}


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
        yield from _chosen(setting.annotation, item, join(path, setting.key), path)


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
    return Nested(type(value)).plain(value)


def plain_default(setting: Setting) -> Any:
    """The default of a setting as plain data."""
    return setting.kind.plain(setting.default)


def _written(cls: Callable[..., Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """Values by their names in Python, as in YAML."""
    return {
        setting.key: setting.kind.plain(values[setting.name])
        for setting in settings_of(cls)
        if setting.name in values
        and not (setting.if_given and values[setting.name] == setting.default)
    }


# --- JSON Schema


def class_schema(cls: Callable[..., Any], classes: dict[str, Schema]) -> Schema:
    """The mapping of a settings class; the classes of its own settings go to ``classes``."""
    texts = descriptions(cls)
    properties: Schema = {}
    closed = True
    for setting in settings_of(cls):
        beside = mark_in(setting.annotation, Beside)
        if beside is not None:
            properties |= class_schema(beside.cls, classes)["properties"]
            continue
        mark = mark_in(setting.annotation, PlugIn)
        if mark is not None and mark.beside:  # its own settings stand beside those of the class
            closed = False
            names = {"anyOf": mark.names_schema()}
            properties[setting.key] = {"description": texts[setting.name], **names}
            continue
        text = {"description": texts[setting.name]} if setting.name in texts else {}
        properties[setting.key] = {**text, **_setting_schema(setting, classes)}
    schema: Schema = {
        "type": "object",
        "description": inspect.cleandoc(cls.__doc__ or ""),
        "properties": properties,
        "additionalProperties": not closed,
    }
    required = [setting.key for setting in settings_of(cls) if setting.default is REQUIRED]
    return {**schema, "required": required} if required else schema


def _setting_schema(setting: Setting, classes: dict[str, Schema]) -> Schema:
    schema = setting.kind.schema(classes)
    if setting.default is REQUIRED or setting.default is None:
        return schema if setting.default is REQUIRED else {**schema, "default": None}
    return {**schema, "default": plain_default(setting)}
