"""Many cars in a made-up town: the ``perception: {source: town}`` and ``fleet:`` sections of a scenario."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import MISSING, fields
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, BeforeValidator, Field, PlainSerializer, WithJsonSchema, model_validator

from genie_sim import units
from genie_sim.errors import UserError, shown, unknown
from genie_sim.scenario.fields import Length, Model, PositiveDuration, PositiveLength, problem
from genie_sim.scenario.links import LINKS, Link
from genie_sim.town.rules import TownRules

SHARES_ERROR = 1e-6  # by which shares written in decimals may miss a sum of 1
# Far beyond what anyone has simulated, see docs/explanation/million-cars.md; more is a slip of the pen, which would
# fill the memory before anything is said.
MOST_CARS, MOST_EDGES, MOST_FRAMES, MOST_BLOCK_M = 1_000_000, 100_000, 100_000_000, 10_000.0


def _yaml_name(python_name: str) -> str:
    return python_name.removesuffix("_m")


DEFAULTS = {one.name: one.default for one in fields(TownRules)}
YAML_NAMES = {_yaml_name(one.name): one.name for one in fields(TownRules)}


def _read_town(value: object) -> TownRules:
    """A mapping from YAML: a length ``block_m`` of the rules is written ``block``, with its unit."""
    if isinstance(value, TownRules):
        return value
    if not isinstance(value, Mapping):
        problem("", f"must be a mapping, not {shown(value)}")
    rules: dict[str, Any] = {}
    for key, given in value.items():
        if key not in YAML_NAMES:
            problem(str(key), unknown("field of a town", key, YAML_NAMES))
        name = YAML_NAMES[key]
        try:
            rules[name] = units.length_m(given) if name.endswith("_m") else given
        except ValueError as error:
            problem(key, str(error))
        if isinstance(DEFAULTS[name], tuple) and not isinstance(rules[name], list | tuple):
            problem(key, f"must be a list, not {shown(given)}")
        if not isinstance(rules[name], int | float | list | tuple):
            problem(key, f"must be a number, not {shown(given)}")
        if name == "block_m" and rules[name] > MOST_BLOCK_M:
            problem(key, f"must be at most {units.length_text(MOST_BLOCK_M)}, but is {shown(given)}")
        if isinstance(rules[name], list):
            rules[name] = tuple(rules[name])
    try:
        return TownRules(**rules)
    except UserError as error:
        raise ValueError(str(error).removeprefix("town: ")) from error


def _write_town(rules: TownRules) -> dict[str, Any]:
    written = {}
    for key, name in YAML_NAMES.items():
        value = getattr(rules, name)
        written[key] = units.length_text(value) if name.endswith("_m") else value
    return {key: list(value) if isinstance(value, tuple) else value for key, value in written.items()}


def _town_schema() -> dict[str, Any]:
    found: dict[str, Any] = {}
    for one in fields(TownRules):
        if one.name.endswith("_m"):
            found[_yaml_name(one.name)] = {"type": "string", "examples": ["1 m"]}
        elif isinstance(one.default, tuple):
            count = len(one.default)
            found[one.name] = {"type": "array", "items": {"type": "integer"}, "minItems": count, "maxItems": count}
        else:
            found[one.name] = {"type": "integer" if isinstance(one.default, int) else "number"}
        assert one.default is not MISSING, "every rule of a town has a default"
    return {"type": "object", "properties": found, "additionalProperties": False}


class InTown(Model):
    """Every car drives its own way through a made-up town, and what is really there is known.

    Each drives for ``duration_ns`` and takes a frame every ``interval_ns``; recordings are "02" and "03". A served
    object is true if one of its class really is within ``tolerance_m`` of it: the detector's own error of places, and
    the object map's usual gate. Objects up to ``range_m`` away are wanted in an answer. Both are a ruler, the same
    whatever a Genie is told. The town is made from ``town`` and the scenario's seed.
    """

    source: Literal["town"] = "town"
    duration_ns: PositiveDuration = Field(default=60 * units.NS_PER_S, alias="duration")
    interval_ns: PositiveDuration = Field(default=100 * units.NS_PER_MS, alias="interval")
    tolerance_m: Length = Field(default=3.0, alias="tolerance")
    range_m: PositiveLength = Field(default=50.0, alias="range")
    town: Annotated[
        TownRules,
        BeforeValidator(_read_town),
        PlainSerializer(_write_town, when_used="json"),
        WithJsonSchema(_town_schema()),
    ] = Field(default_factory=TownRules)

    @model_validator(mode="after")
    def _not_too_many_frames(self) -> Self:
        if self.duration_ns / self.interval_ns > MOST_FRAMES:
            problem("interval", f"makes more than {MOST_FRAMES:,} frames of {units.duration_text(self.duration_ns)}")
        return self

    def edges(self, cell_m: float) -> float:
        """About how many cells of that size the town has."""
        return math.prod(max(1.0, blocks * self.town.block_m / cell_m) for blocks in self.town.blocks)


def _shares(value: object) -> object:
    """A device's name, or the share of each."""
    return {value: 1.0} if isinstance(value, str) else value


def _sum_to_one(shares: dict[str, float]) -> dict[str, float]:
    if abs(sum(shares.values()) - 1.0) > SHARES_ERROR:
        raise ValueError(f"shares must add up to 1, not to {sum(shares.values()):g}")
    return dict(sorted(shares.items()))  # the order decides which car gets which device, and is nobody's choice


Share = Annotated[float, Field(gt=0, le=1)]
_DEVICES_SCHEMA = WithJsonSchema(
    {
        "anyOf": [
            {"type": "string"},
            {"type": "object", "additionalProperties": {"type": "number", "exclusiveMinimum": 0, "maximum": 1}},
        ]
    }
)


class Fleet(Model):
    """Cars that are alike but for their devices, and an edge server in the middle of each cell of the town.

    The cells are squares of about ``cell_m``: as many as fit the town best. A car is with the nearest edge; it changes
    when another is nearer by ``hysteresis_m``. Edges share with those of the cells that have a border with theirs.
    """

    cars: Annotated[int, Field(ge=1, le=MOST_CARS)]
    devices: Annotated[dict[str, Share], BeforeValidator(_shares), AfterValidator(_sum_to_one), _DEVICES_SCHEMA]
    link: Link = LINKS["nr5g"]
    edge_device: str
    cell_m: PositiveLength = Field(default=300.0, alias="cell")
    hysteresis_m: Length = Field(default=20.0, alias="hysteresis")
