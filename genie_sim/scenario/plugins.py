"""Settings that name an entry of a registry of the core, or a class of the user's own: ``package.module:Class``."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Mapping
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, PlainSerializer, WithJsonSchema

from genie_sim import units
from genie_sim.core.confidence import CONFIDENCE_RULES
from genie_sim.core.eviction import EVICTIONS
from genie_sim.core.similarity import SIMILARITIES
from genie_sim.errors import shown, unknown
from genie_sim.scenario.fields import Model, problem

Parameter = bool | int | float | str

_OWN_CLASS = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*:[A-Za-z_]\w*")
_WITH_UNIT: dict[str, tuple[Callable[[object], Any], Callable[[Any], str]]] = {
    "_ns": (units.duration_ns, units.duration_text),
    "_bytes": (units.size_bytes, units.size_text),
    "_m": (units.length_m, units.length_text),
    "_rad": (units.angle_rad, units.angle_text),
}


class Similarity(Model):
    """A similarity by name, and the keyword arguments of its class.

    In YAML a name, or ``{name: pose_grid, cell: 1 m}``: a parameter ``cell_m`` of the class is written ``cell`` with a
    unit. The parameters of an own class are passed on as they stand.
    """

    name: str
    parameters: dict[str, Parameter] = Field(default_factory=dict)


def read_similarity(value: object) -> Similarity:
    """A name or a mapping from YAML, completed by the defaults of the class. Raises ``ValueError``."""
    if isinstance(value, Similarity):
        return value
    given = dict(value) if isinstance(value, Mapping) else {"name": value}
    name = _checked_name("similarity", given.pop("name", "pose_grid"), SIMILARITIES)
    if name not in SIMILARITIES:
        return Similarity(name=name, parameters={key: _plain(key, item) for key, item in given.items()})
    known = inspect.signature(SIMILARITIES[name], eval_str=True).parameters
    python_names = {_yaml_name(python_name): python_name for python_name in known}
    for key in given:
        if key not in python_names:
            problem(key, unknown(f"parameter of {name}", key, python_names))
    parameters: dict[str, Parameter] = {}
    for key, python_name in python_names.items():
        if key in given:
            parameters[python_name] = _read_parameter(key, python_name, given[key], known[python_name].annotation)
        elif known[python_name].default is inspect.Parameter.empty:
            problem(key, "missing")
        else:
            parameters[python_name] = known[python_name].default
    SIMILARITIES[name](**parameters)  # the class knows its own bounds
    return Similarity(name=name, parameters=parameters)


def _read_parameter(key: str, python_name: str, value: object, kind: object) -> Parameter:
    try:
        for suffix, (read, _) in _WITH_UNIT.items():
            if python_name.endswith(suffix):
                number: int | float = read(value)
                return number
    except ValueError as error:
        problem(key, str(error))
    if kind is int and (isinstance(value, bool) or not isinstance(value, int)):
        problem(key, f"must be a whole number, not {shown(value)}")
    if kind is float and (isinstance(value, bool) or not isinstance(value, int | float)):
        problem(key, f"must be a number, not {shown(value)}")
    return _plain(key, value)


def _plain(key: str, value: object) -> Parameter:
    if not isinstance(value, Parameter):
        problem(key, f"must be a number, true or false, or text, not {shown(value)}")
    return value


def _write_similarity(similarity: Similarity) -> object:
    if not similarity.parameters:
        return similarity.name
    written: dict[str, Parameter] = {"name": similarity.name}
    for python_name, value in similarity.parameters.items():
        suffix = next((suffix for suffix in _WITH_UNIT if python_name.endswith(suffix)), None)
        if suffix is None or similarity.name not in SIMILARITIES:
            written[python_name] = value
        else:
            written[_yaml_name(python_name)] = _WITH_UNIT[suffix][1](value)
    return written


def _yaml_name(python_name: str) -> str:
    suffix = next((suffix for suffix in _WITH_UNIT if python_name.endswith(suffix)), "")
    return python_name.removesuffix(suffix)


def _checked_name(what: str, name: object, registry: Mapping[str, object]) -> str:
    if not isinstance(name, str) or (name not in registry and not _OWN_CLASS.fullmatch(name)):
        raise ValueError(f"{unknown(what, name, registry)}, or package.module:Class")
    return name


def _named(what: str, registry: Mapping[str, object]) -> BeforeValidator:
    return BeforeValidator(lambda value: _checked_name(what, value, registry))


def _schema(registry: Mapping[str, object], *more: dict[str, str]) -> WithJsonSchema:
    own_class = {"type": "string", "pattern": f"^{_OWN_CLASS.pattern}$"}
    return WithJsonSchema({"anyOf": [{"enum": list(registry)}, own_class, *more]})


SimilarityChoice = Annotated[
    Similarity,
    BeforeValidator(read_similarity),
    PlainSerializer(_write_similarity, when_used="json"),
    _schema(SIMILARITIES, {"type": "object"}),
]
EvictionName = Annotated[str, _named("eviction", EVICTIONS), _schema(EVICTIONS)]
RuleName = Annotated[str, _named("confidence rule", CONFIDENCE_RULES), _schema(CONFIDENCE_RULES)]
