"""The ``genie:`` section of a scenario: ``core.rules.GenieRules``, as it is written in YAML."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Discriminator, Field, Tag, WithJsonSchema

from genie_sim import plugins, units
from genie_sim.core.confidence import CONFIDENCE_RULES
from genie_sim.core.eviction import EVICTIONS
from genie_sim.core.freshness import FRESHNESS
from genie_sim.core.rules import LITERAL, Capacity, GenieRules, ObjectMapRules, Percentile
from genie_sim.core.similarity import SIMILARITIES
from genie_sim.errors import short_repr, unknown
from genie_sim.plugins import Choice
from genie_sim.scenario.fields import (
    Count,
    Model,
    PositiveDuration,
    PositiveLength,
    PositiveSize,
    Probability,
    validate,
)
from genie_sim.scenario.plain import OWN_CLASS_SCHEMA, Plain, PlugIn

THRESHOLDS = ("range_60", "empirical")


def _kind(value: object) -> str:
    return (
        "stored"
        if isinstance(value, Mapping | Percentile)
        else "threshold"
        if isinstance(value, str)
        else "number"
    )


def _threshold(value: str) -> str:
    if value not in THRESHOLDS:
        raise ValueError(
            f"{unknown('threshold', value, THRESHOLDS)}, a number from 0 to 1, {{percentile: N}}"
        )
    return value


def _capacity(value: object) -> object:
    """``1000 entries`` and ``10 MB`` for short."""
    if value is None or isinstance(value, Mapping | Capacity):
        return value
    number, _, unit = str(value).partition(" ")
    if unit == "entries" and number.isascii() and number.isdigit() and len(number) < 18:
        return {"entries": int(number)}
    try:
        units.size_bytes(value)
    except ValueError as error:
        raise ValueError(
            f"must be such as '1000 entries' or '10 MB', not {short_repr(value)}"
        ) from error
    return {"bytes": value}


def _name(what: str, registry: Mapping[str, object]) -> Any:
    """A plug-in without arguments: its name, or ``package.module:Class``."""
    schema = WithJsonSchema({"anyOf": [{"enum": list(registry)}, OWN_CLASS_SCHEMA]})
    return Annotated[
        str, BeforeValidator(lambda value: plugins.checked_name(what, value, registry)), schema
    ]


def with_preset(data: Any) -> Any:
    """The section with what its ``algorithm`` stands for, under what it says itself."""
    if not isinstance(data, Mapping) or data.get("algorithm") != "literal":
        return data
    preset = {**LITERAL, **data}
    if isinstance(data.get("object_map", {}), Mapping):
        preset["object_map"] = {**LITERAL["object_map"], **data.get("object_map", {})}
    return preset


_CAPACITY_SCHEMA = {
    "anyOf": [
        {"type": "string", "examples": ["1000 entries", "10 MB"]},
        {
            "type": "object",
            "properties": {
                "entries": {"type": "integer", "minimum": 1},
                "bytes": {"type": "string"},
            },
            "additionalProperties": False,
        },
        {"type": "null"},
    ]
}
_PERCENTILE = Plain(Percentile, percentile=Annotated[float, Field(gt=0, le=100)])
_THRESHOLD = Annotated[
    Annotated[Probability, Tag("number")]
    | Annotated[Literal["range_60", "empirical"], BeforeValidator(_threshold), Tag("threshold")]
    | Annotated[Percentile, _PERCENTILE, Tag("stored")],
    Discriminator(_kind),
]
_OBJECT_MAP = Plain(
    ObjectMapRules,
    gate_m=PositiveLength,
    rule=_name("confidence rule", CONFIDENCE_RULES),
    rate=Probability,
    threshold=_THRESHOLD,
    freshness=Annotated[Choice, PlugIn("freshness policy", FRESHNESS)],
)
_CAPACITY = Annotated[
    Annotated[Capacity, Plain(Capacity, entries=Count | None, bytes=PositiveSize | None)] | None,
    BeforeValidator(_capacity),
    WithJsonSchema(_CAPACITY_SCHEMA),
]
GenieSection = Annotated[
    GenieRules,
    Plain(
        GenieRules,
        complete=with_preset,
        similarity=Annotated[Choice, PlugIn("similarity", SIMILARITIES, default="pose_grid")],
        eviction=_name("eviction", EVICTIONS),
        capacity=_CAPACITY,
        car_capacity=_CAPACITY,
        ttl_ns=PositiveDuration | None,
        request_expiry_ns=PositiveDuration | None,
        view_range_m=PositiveLength,
        passes=Annotated[int, Field(ge=1, le=2)],
        object_map=Annotated[ObjectMapRules, _OBJECT_MAP],
    ),
]


class _Section(Model):
    genie: GenieSection


def read_genie(data: Mapping[str, Any]) -> GenieRules:
    """The rules in a ``genie:`` section alone. Raises ``UserError``."""
    return validate(_Section, {"genie": data}, lambda _: "").genie
