"""The JSON Schema of a settings class."""

import inspect
from collections.abc import Callable, Mapping
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from genie_sim.base.plugins import OWN_CLASS_PATTERN, Choice
from genie_sim.base.settings import (
    REQUIRED,
    Beside,
    Bounds,
    Matches,
    NotEmpty,
    PlugIn,
    Setting,
    Short,
    Unit,
    descriptions,
    is_settings_class,
    mark_in,
    plain_default,
    settings_of,
)

OWN_CLASS = {"type": "string", "pattern": OWN_CLASS_PATTERN}
TYPES = {int: "integer", float: "number", bool: "boolean", str: "string", NoneType: "null"}
Schema = dict[str, Any]


def class_schema(cls: Callable[..., Any], classes: dict[str, Schema]) -> Schema:
    """The mapping of a settings class; the classes of its own settings go to ``classes``."""
    texts = descriptions(cls)
    properties: Schema = {}
    closed = True
    for setting in settings_of(cls):
        beside = mark_in(setting.kind, Beside)
        if beside is not None:
            properties |= class_schema(beside.cls, classes)["properties"]
            continue
        mark = mark_in(setting.kind, PlugIn)
        if mark is not None and mark.beside:  # its own settings stand beside those of the class
            closed = False
            names = {"anyOf": _name_schemas(mark)}
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
    schema = _kind_schema(setting.kind, (), setting.unit, classes)
    if setting.default is REQUIRED or setting.default is None:
        return schema if setting.default is REQUIRED else {**schema, "default": None}
    return {**schema, "default": plain_default(setting)}


def _kind_schema(
    kind: Any, marks: tuple[Any, ...], unit: Unit | None, classes: dict[str, Schema]
) -> Schema:
    """The schema of an annotated type.

    Parameters
    ----------
    kind : type
        The type, perhaps ``Annotated``.
    marks : tuple
        The marks of an ``Annotated`` around it.
    unit : Unit or None
        The unit of the numbers in it.
    classes : dict
        Gets the schemas of the settings classes in it, by name.
    """
    origin = get_origin(kind)
    if origin is Annotated:
        kind, *more = get_args(kind)
        return _kind_schema(kind, (*marks, *more), unit, classes)
    for mark in marks:
        if isinstance(mark, PlugIn):
            return _plug_in_schema(mark, kind, classes)
    if origin in (Union, UnionType):
        members = [_kind_schema(member, marks, unit, classes) for member in get_args(kind)]
        return {"anyOf": [*_short_schemas(marks), *members]}
    if is_settings_class(kind):
        if kind.__name__ not in classes:
            classes[kind.__name__] = {}  # a class may hold itself
            classes[kind.__name__] = class_schema(kind, classes)
            if any(isinstance(mark, Short) and mark.plug_in is not None for mark in marks):
                del classes[kind.__name__]["required"]  # the name of a plug-in alone is enough
        reference = {"$ref": f"#/$defs/{kind.__name__}"}
        shorts = _short_schemas(marks)
        return {"anyOf": [*shorts, reference]} if shorts else reference
    if origin is Literal:
        return {"enum": list(get_args(kind)), "type": "string"}
    if origin is tuple:
        return _list_schema(kind, marks, unit, classes)
    if isinstance(origin, type) and issubclass(origin, Mapping):
        items = _kind_schema(get_args(kind)[1], (), unit, classes)
        mapping = {"type": "object", "additionalProperties": items}
        return {"anyOf": [*_short_schemas(marks), mapping]} if _short_schemas(marks) else mapping
    if unit is not None and kind in (int, float):
        return {"type": "string", "examples": [unit.example]}
    return {"type": TYPES[kind], **_limits(marks)} if kind in TYPES else {}


def _list_schema(
    kind: Any, marks: tuple[Any, ...], unit: Unit | None, classes: dict[str, Schema]
) -> Schema:
    """A list of any length, or with one item of each type (see ``_kind_schema``)."""
    kinds = get_args(kind)
    if kinds[-1] is Ellipsis:
        schema = {"type": "array", "items": _kind_schema(kinds[0], (), unit, classes)}
        return {**schema, "minItems": 1} if NotEmpty() in marks else schema
    items = [_kind_schema(inner, (), unit, classes) for inner in kinds]
    return {"type": "array", "prefixItems": items, "minItems": len(items), "maxItems": len(items)}


def _short_schemas(marks: tuple[Any, ...]) -> list[Schema]:
    """What may be written in place of a mapping."""
    schemas: list[Schema] = []
    for mark in marks:
        if isinstance(mark, Short) and mark.plug_in is not None:
            schemas += _name_schemas(mark.plug_in)
        elif isinstance(mark, Short):
            schemas.append({"type": "string", "examples": list(mark.examples)})
    return schemas


def _name_schemas(mark: PlugIn) -> list[Schema]:
    return [{"enum": list(mark.registry)}, OWN_CLASS]


def _limits(marks: tuple[Any, ...]) -> Schema:
    """What bounds and patterns are called in JSON Schema."""
    limits: Schema = {}
    for mark in marks:
        if isinstance(mark, Bounds):
            limits |= {
                "minimum": mark.minimum,
                "exclusiveMinimum": mark.above,
                "maximum": mark.maximum,
            }
        elif isinstance(mark, Matches):
            limits |= {"pattern": mark.pattern, "maxLength": mark.maximum}
        elif isinstance(mark, NotEmpty):
            limits["minLength"] = 1
    return {key: limit for key, limit in limits.items() if limit is not None}


def _plug_in_schema(mark: PlugIn, kind: Any, classes: dict[str, Schema]) -> Schema:
    """A name, or a mapping of the name and the settings of its class."""
    names = _name_schemas(mark)
    if kind is not Choice:
        return {"anyOf": names}
    own_name = {"description": "A class of your own, `package.module:Class`.", **OWN_CLASS}
    own = {"type": "object", "properties": {mark.key: own_name}, "required": [mark.key]}
    shipped = [_shipped_schema(mark, name, classes) for name in mark.registry]
    if mark.presets is not None:
        names = [{"enum": list(mark.presets.choices)}]
        text = f"A named {mark.presets.what} that gives the settings left out."
        like = {"like": {"description": text, "enum": list(mark.presets.choices)}}
        for schema in shipped:
            schema["properties"] = like | schema["properties"]
            schema.pop("required", None)
    return {"anyOf": [*names, *shipped, own]}


def _shipped_schema(mark: PlugIn, name: str, classes: dict[str, Schema]) -> Schema:
    schema = class_schema(mark.resolve(name), classes)
    schema["properties"] = {mark.key: {"const": name}, **schema["properties"]}
    if name != mark.default:
        schema["required"] = [mark.key, *schema.get("required", ())]
    return schema
