"""JSON Schemas of scenarios and device profiles, so that an editor completes settings and marks
mistakes.
"""

import ast
import dataclasses
import functools
import inspect
import itertools
import re
import textwrap
from collections.abc import Callable
from types import UnionType
from typing import Any, Literal, Union

from genie_sim.base.docstrings import docstring
from genie_sim.base.marks import Bounds, Matches, NotEmpty, Short
from genie_sim.base.plugins import OWN_CLASS_PATTERN
from genie_sim.base.settings import (
    REQUIRED,
    Kind,
    PlugIn,
    is_mapping,
    is_settings_class,
    mark_in,
    plain_default,
    settings_of,
)
from genie_sim.scenario.profiles import DeviceProfile
from genie_sim.scenario.scenario import Scenario

Schema = dict[str, Any]
SCHEMAS: dict[str, type[Any]] = {"scenario": Scenario, "device": DeviceProfile}
DIALECT = "https://json-schema.org/draft/2020-12/schema"
OWN_CLASS = {"type": "string", "pattern": OWN_CLASS_PATTERN}


def json_schema(what: str) -> Schema:
    """The JSON Schema of a ``scenario`` or a ``device`` file.

    It knows names, types and choices. Only ``genie-sim run`` checks whether settings fit together:
    a car's edge exists, a device knows the model.
    """
    classes: dict[str, Schema] = {}
    schema = class_schema(SCHEMAS[what], classes)
    if what == "scenario":
        del schema["required"]  # the file's name stands for that of the scenario
        schema["anyOf"] = [{"required": [who]} for who in ("cars", "fleet")]
    return {"$schema": DIALECT, "$defs": dict(sorted(classes.items())), **schema}


def class_schema(cls: Callable[..., Any], classes: dict[str, Schema]) -> Schema:
    """The mapping of a settings class; the classes of its own settings go to ``classes``."""
    texts = descriptions(cls)
    properties: Schema = {}
    closed = True
    for setting in settings_of(cls):
        mark = mark_in(setting.annotation, PlugIn)
        text = {"description": texts[setting.name]} if setting.name in texts else {}
        if mark is not None and mark.beside:  # its own settings stand beside those of the class
            closed = False
            schema = {"anyOf": _names_schema(mark)}
            for beside in mark.beside:
                properties |= class_schema(beside, classes)["properties"]
        else:
            schema = _schema(setting.kind, classes)
            if setting.default is not REQUIRED:
                schema = {**schema, "default": plain_default(setting)}
        properties[setting.key] = {**text, **schema}
    mapping: Schema = {
        "type": "object",
        "description": docstring(cls),
        "properties": properties,
        "additionalProperties": not closed,
    }
    required = [setting.key for setting in settings_of(cls) if setting.default is REQUIRED]
    return {**mapping, "required": required} if required else mapping


@functools.cache
def descriptions(cls: type) -> dict[str, str]:
    """What each setting of a class means, by its name in Python: the text below a field of a
    dataclass, or the entry of an argument in the section ``Parameters`` of any other class.
    """
    if not is_settings_class(cls):
        _, _, section = (docstring(cls) or inspect.getdoc(cls) or "").partition(
            "Parameters\n----------\n"
        )
        section, _, _ = section.partition("\n\n")
        found = re.findall(r"^(\w+) : .*\n((?:    .*\n?)+)", section, re.MULTILINE)
        return {name: " ".join(text.split()) for name, text in found}
    texts: dict[str, str] = {}
    for owner in filter(dataclasses.is_dataclass, reversed(cls.__mro__)):
        (tree,) = ast.parse(textwrap.dedent(inspect.getsource(owner))).body
        for field, below in itertools.pairwise(tree.body):  # type: ignore[attr-defined]
            match field, below:
                case (
                    ast.AnnAssign(target=ast.Name(id=name)),
                    ast.Expr(value=ast.Constant(value=str(text))),
                ):
                    texts[name] = " ".join(text.split())
    return texts


def _schema(kind: Kind, classes: dict[str, Schema]) -> Schema:
    """Of one setting."""
    marks, short = kind.marks, kind.marks.get(Short)
    shorts: list[Schema] = []
    if short is not None:
        texts = {"type": "string", "examples": list(short.examples)}
        shorts = [texts] if short.plug_in is None else _names_schema(short.plug_in)
    if kind.plug_in is not None:
        named = {"anyOf": _names_schema(kind.plug_in)}
        return named if kind.type is str else _plug_in_schema(kind.plug_in, classes)
    schema: Schema = {}
    match kind.type:
        case origin if origin in (Union, UnionType):
            return {"anyOf": [*shorts, *(_schema(member, classes) for member in kind.members)]}
        case origin if origin is Literal:
            return {"enum": list(kind.arguments), "type": "string"}
        case origin if origin is tuple and kind.arguments:
            inner = [_schema(item, classes) for item in kind.items]
            if kind.arguments[-1] is ...:
                schema = {"type": "array", "items": inner[0]}
                return {**schema, "minItems": 1} if NotEmpty in marks else schema
            count = {"minItems": len(inner), "maxItems": len(inner)}
            return {"type": "array", "prefixItems": inner, **count}
        case cls if is_settings_class(cls):
            name = cls.__name__
            if name not in classes:
                classes[name] = {}  # a class may hold itself
                classes[name] = class_schema(cls, classes)
                if short is not None and short.plug_in is not None:
                    del classes[name]["required"]  # the name of a plug-in alone is enough
            schema = {"$ref": f"#/$defs/{name}"}
        case cls if is_mapping(cls) and kind.arguments:
            schema = {"type": "object", "additionalProperties": _schema(kind.items[1], classes)}
        case _ if kind.unit is not None:
            quantity = {"type": "string", "examples": [kind.unit.example]}
            takes_zero = marks.get(Bounds, Bounds()).contain(0)
            return {"anyOf": [quantity, {"const": 0}]} if takes_zero else quantity
        case cls if kind.yaml_form is not None and not kind.arguments:
            schema = {"type": kind.yaml_form.schema}
            if cls in (int, float):
                schema |= _limits(marks.get(Bounds, Bounds()))
            elif cls is str:
                if rule := marks.get(Matches):
                    schema |= {"pattern": rule.pattern, "maxLength": rule.maximum}
                schema |= {"minLength": 1} if NotEmpty in marks else {}
            return schema
    return {"anyOf": [*shorts, schema]} if shorts else schema


def _limits(bounds: Bounds) -> Schema:
    """As in JSON Schema."""
    names = ("minimum", "exclusiveMinimum", "maximum")
    limits = zip(names, dataclasses.astuple(bounds), strict=True)
    return {name: limit for name, limit in limits if limit is not None}


def _plug_in_schema(plug_in: PlugIn, classes: dict[str, Schema]) -> Schema:
    """A name, or a mapping of the name and the settings of its class."""
    own_name = {"description": "A class of your own, `package.module:Class`.", **OWN_CLASS}
    own = {"type": "object", "properties": {plug_in.key: own_name}, "required": [plug_in.key]}
    shipped = []
    for name in plug_in.registry:
        schema = class_schema(plug_in.resolve(name), classes)
        schema["properties"] = {plug_in.key: {"const": name}, **schema["properties"]}
        if name != plug_in.default:
            schema["required"] = [plug_in.key, *schema.get("required", ())]
        shipped.append(schema)
    names = _names_schema(plug_in)
    if plug_in.presets is not None:
        names = [{"enum": list(plug_in.presets.choices)}]
        text = f"A named {plug_in.presets.what} that gives the settings left out."
        like = {"like": {"description": text, "enum": list(plug_in.presets.choices)}}
        for schema in shipped:
            schema["properties"] = like | schema["properties"]
            schema.pop("required", None)
    return {"anyOf": [*names, *shipped, own]}


def _names_schema(plug_in: PlugIn) -> list[Schema]:
    """What a name alone may be."""
    return [{"enum": list(plug_in.registry)}, OWN_CLASS]
