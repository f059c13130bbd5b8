"""Plain classes written in YAML: the arguments of a class are its settings.

An argument's name carries its unit (``cell_m``, ``ttl_ns``), its name in YAML does not, and its value does
(``cell: 1 m``, ``ttl: 10 s``). So a plug-in needs no model beside its class.
"""

import functools
import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import is_dataclass
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import (
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    ValidationError,
    create_model,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, core_schema

from genie_sim import plugins
from genie_sim.errors import UserError, short_repr, unknown
from genie_sim.plugins import Choice, Parameter
from genie_sim.scenario.fields import (
    Duration,
    Length,
    Listed,
    Model,
    Rate,
    Size,
    Turn,
    first_problem,
    problem,
    wrong,
)

_WITH_UNIT: dict[str, Any] = {
    "_ns": Duration,
    "_bytes": Size,
    "_m": Length,
    "_bps": Rate,
    "_rad": Turn,
}


class Plain:
    """Marks a field of a model whose value is an instance of ``cls``: ``Annotated[TownRules, Plain(TownRules)]``.

    ``complete`` may add to the mapping from YAML; ``fields`` are the types of arguments whose names and annotations do
    not say all.
    """

    def __init__(
        self, cls: type, complete: Callable[[Any], Any] | None = None, **fields: Any
    ) -> None:
        self._cls, self._complete, self._fields = cls, complete, fields

    @functools.cached_property
    def model(self) -> type[Model]:
        return model_of(self._cls, **self._fields)

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        def read(value: Any, validate: Callable[[Any], Model]) -> Any:
            if isinstance(value, self._cls):
                return value
            return _instance(
                self._cls, validate(self._complete(value) if self._complete else value)
            )

        return core_schema.no_info_wrap_validator_function(
            read,
            handler.generate_schema(self.model),
            serialization=core_schema.plain_serializer_function_ser_schema(
                self.write, when_used="json"
            ),
        )

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        return handler(self.model.__pydantic_core_schema__)

    def write(self, value: Any) -> dict[str, Any]:
        """The value as a mapping of plain data, as in YAML."""
        return _written(
            self.model, {name: getattr(value, name) for name in self.model.model_fields}
        )


class PlugIn:
    """Marks a field whose value is a ``Choice`` out of ``registry``: in YAML a name, or a mapping of the name (under
    ``key``) and the arguments of the class. Those of a class of the user's own are passed on as they stand.

    ``beside`` are the other settings that may stand in the mapping, which the caller takes out before.
    """

    def __init__(
        self,
        what: str,
        registry: Mapping[str, Any],
        key: str = "name",
        default: str | None = None,
        beside: Sequence[str] = (),
    ) -> None:
        self.what, self.registry, self._key, self._default, self._beside = (
            what,
            registry,
            key,
            default,
            beside,
        )

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(
            self.read,
            serialization=core_schema.plain_serializer_function_ser_schema(
                self.write, when_used="json"
            ),
        )

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        own = {
            "type": "object",
            "properties": {self._key: OWN_CLASS_SCHEMA},
            "required": [self._key],
        }
        shipped = []
        for name in self.registry:
            model = model_of(plugins.resolve(self.what, name, self.registry))
            made = dict(handler.resolve_ref_schema(handler(model.__pydantic_core_schema__)))
            made["properties"] = {self._key: {"const": name}, **made.get("properties", {})}
            if name != self._default:
                made["required"] = [self._key, *made.get("required", ())]
            shipped.append(made)
        return {"anyOf": [{"enum": list(self.registry)}, OWN_CLASS_SCHEMA, *shipped, own]}

    def read(self, value: object) -> Choice:
        """A name or a mapping from YAML, completed by the defaults of the class. Raises ``ValueError``."""
        if isinstance(value, Choice):
            return value
        if not isinstance(value, str | Mapping):
            problem("", f"must be a name or a mapping, not {short_repr(value)}")
        given = dict(value) if isinstance(value, Mapping) else {self._key: value}
        with wrong(self._key if isinstance(value, Mapping) else ""):
            name = plugins.checked_name(
                self.what, given.pop(self._key, self._default), self.registry
            )
        if name not in self.registry:
            for key, item in given.items():
                if not isinstance(item, Parameter):
                    problem(
                        key, f"must be a number, true or false, or text, not {short_repr(item)}"
                    )
            return Choice(name, given)
        cls = plugins.resolve(self.what, name, self.registry)
        known = model_of(cls)
        for key in given:
            if key not in known.yaml_names():
                problem(
                    str(key),
                    unknown(f"parameter of {name}", key, [*known.yaml_names(), *self._beside]),
                )
        try:
            model = known.model_validate(given)
        except ValidationError as error:
            problem(*first_problem(error, given))
        _instance(cls, model)  # the class knows its own bounds
        return Choice(name, {field: getattr(model, field) for field in known.model_fields})

    def write(self, choice: Choice) -> object:
        """The choice as in YAML."""
        if not choice.parameters:
            return choice.name
        if choice.name not in self.registry:
            return {self._key: choice.name, **choice.parameters}
        model = model_of(plugins.resolve(self.what, choice.name, self.registry))
        return {self._key: choice.name, **_written(model, choice.parameters)}


OWN_CLASS_SCHEMA = {"type": "string", "pattern": plugins.OWN_CLASS_PATTERN}


@functools.cache
def model_of(cls: Callable[..., Any], **fields: Any) -> type[Model]:
    """The model of a class's arguments, named as in YAML."""
    found: dict[str, Any] = {}
    for name, parameter in inspect.signature(cls, eval_str=True).parameters.items():
        kind = fields.get(name, _with_unit(name, parameter.annotation))
        default = ... if parameter.default is inspect.Parameter.empty else parameter.default
        if isinstance(default, Mapping) or type(default).__name__ == "_HAS_DEFAULT_FACTORY_CLASS":
            found[name] = (
                kind,
                Field(default_factory=cls.__dataclass_fields__[name].default_factory),
            )  # type: ignore[attr-defined]
        else:
            found[name] = (kind, Field(default=default, alias=name.removesuffix(_suffix(name))))
    made: type[Model] = create_model(getattr(cls, "__name__", "Settings"), __base__=Model, **found)
    return made


def _with_unit(name: str, annotation: Any) -> Any:
    """The annotation, with the unit that the name's ending tells; tuples are lists in YAML."""
    if get_origin(annotation) in (Union, UnionType):
        return Union[tuple(_with_unit(name, one) for one in get_args(annotation))]  # noqa: UP007 - made at run time
    if get_origin(annotation) is tuple:
        return Annotated[annotation, Listed]
    if isinstance(annotation, type) and is_dataclass(annotation):
        return Annotated[annotation, Plain(annotation)]
    return _WITH_UNIT.get(_suffix(name), annotation) if annotation in (int, float) else annotation


def _suffix(name: str) -> str:
    """Of an argument with a unit: ``_m`` of ``cell_m``."""
    return next((suffix for suffix in _WITH_UNIT if name.endswith(suffix)), "")


def _instance(cls: Callable[..., Any], model: Model) -> Any:
    """The instance that a valid model describes. Raises ``ValueError`` for what the class itself finds wrong."""
    try:
        return cls(**{name: getattr(model, name) for name in type(model).model_fields})
    except (UserError, ValueError) as error:
        text = str(error)
        while ": " in text:  # a class may say which one it is before it names the field
            field, _, text = text.partition(": ")
            if field.partition(".")[0] in type(model).yaml_names():
                problem(field, text)
        raise ValueError(str(error)) from error


def _written(model: type[Model], values: Mapping[str, Any]) -> dict[str, Any]:
    return model.model_construct(**values).model_dump(mode="json", by_alias=True)
