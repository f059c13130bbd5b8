"""What scenarios, links and device profiles have in common: fields with units, and errors on one line.

A model's Python names carry their unit (``delay_ns``), the YAML names do not (``delay: 0.2 ms``).
"""

import difflib
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Annotated, Any, NoReturn, TypeVar

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PlainSerializer,
    ValidationError,
    WithJsonSchema,
    model_validator,
)
from pydantic_core import ErrorDetails, PydanticCustomError

from genie_sim import units
from genie_sim.errors import UserError, short_repr, unknown

Number = TypeVar("Number", int, float)
AnyModel = TypeVar("AnyModel", bound="Model")


def problem(field: str, text: str) -> NoReturn:
    """Inside a validator: ``text`` is wrong with ``field``, a path such as ``cars[1].edge`` below the model."""
    raise PydanticCustomError("problem", "{text}", {"text": text, "field": field})


@contextmanager
def wrong(field: str) -> Iterator[None]:
    """Inside a validator: what is raised within is wrong with ``field``."""
    try:
        yield
    except (UserError, ValueError) as error:
        problem(field, str(error))


class Model(BaseModel):
    """Frozen, strictly typed, and closed: an unknown field is an error that names the nearest known one."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _known_fields(cls, data: Any) -> Any:
        if not isinstance(data, Mapping):
            if isinstance(data, cls):
                return data
            problem("", f"must be a mapping, not {short_repr(data)}")
        names = cls.yaml_names()
        for key in data:
            if key not in names:
                near = difflib.get_close_matches(str(key), names, n=1)
                hint = f"did you mean {near[0]!r}?" if near else f"known: {', '.join(names)}"
                problem(_step(key), f"unknown field; {hint}")
        return data

    @classmethod
    def yaml_names(cls) -> list[str]:
        """The fields as they are written in YAML."""
        return [field.alias or name for name, field in cls.model_fields.items()]


def validate(model: type[AnyModel], data: object, where: Callable[[str], str]) -> AnyModel:
    """``data`` as a ``model``. Raises ``UserError`` for the first problem; ``where`` gives the file of a field path."""
    try:
        return model.model_validate(data)
    except ValidationError as error:
        path, text = first_problem(error, data)
        raise UserError(": ".join(part for part in (where(path), path, text) if part)) from error


def first_problem(error: ValidationError, data: object) -> tuple[str, str]:
    """Path and text of the first thing that is wrong with ``data``, and how many more there are."""
    found = error.errors(include_url=False)
    more = f" (and {len(found) - 1} more)" if len(found) > 1 else ""
    return _path(found[0], data), _text(found[0]) + more


def _path(error: ErrorDetails, data: object) -> str:
    """``cars[1].genie``: the error's place in the YAML, without the names that pydantic gives to choices of types."""
    path, here, last = "", data, len(error["loc"]) - 1
    for index, step in enumerate(error["loc"]):
        if (
            isinstance(step, int)
            and isinstance(here, Sequence)
            and not isinstance(here, str)
            and step < len(here)
        ):
            path, here = f"{path}[{step}]", here[step]
        elif isinstance(here, Mapping) and step in here:
            path, here = f"{path}.{_step(step)}", here[step]
        elif index == last and error["type"] == "missing":
            path = f"{path}[{step}]" if isinstance(step, int) else f"{path}.{step}"
    if error["type"] == "problem" and error["ctx"]["field"]:
        path = f"{path}.{error['ctx']['field']}"
    return path.lstrip(".")


def _step(name: object) -> str:
    """A key as part of a path; in quotes if it is no plain word."""
    return (
        name if isinstance(name, str) and re.fullmatch(r"[\w-]{1,40}", name) else short_repr(name)
    )


def _text(error: ErrorDetails) -> str:
    kind, value, context = error["type"], error["input"], error.get("ctx", {})
    name = next(
        (str(step).replace("_", " ") for step in reversed(error["loc"]) if isinstance(step, str)),
        "value",
    )
    if error["loc"] and isinstance(error["loc"][-1], int):
        name = name.removesuffix("s")  # one of the list
    wanted = {
        "string_type": "must be text",
        "bool_type": "must be true or false",
        "int_type": "must be a whole number",
        "float_type": "must be a number",
        "finite_number": "must be a finite number",
        "tuple_type": "must be a list",
        "list_type": "must be a list",
        "dict_type": "must be a mapping",
        "model_attributes_type": "must be a mapping",
        "greater_than": f"must be more than {context.get('gt')}",
        "greater_than_equal": f"must be at least {context.get('ge')}",
        "less_than_equal": f"must be at most {context.get('le')}",
        "string_pattern_mismatch": "must be letters, digits, '_', '-' and '.', the first a letter or digit",
    }
    if kind in wanted:
        return f"{wanted[kind]}, not {short_repr(value)}"
    if kind == "literal_error":
        return unknown(name, value, re.findall(r"'([^']*)'", context["expected"]))
    if kind == "union_tag_invalid":
        choices = re.findall(r"'([^']*)'", context["expected_tags"])
        return unknown(context["discriminator"].strip("'"), context["tag"], choices)
    least = context.get("min_length")
    others = {
        "problem": context.get("text"),
        "value_error": str(context.get("error")),
        "missing": "missing",
        "string_too_short": "must not be empty",
        "too_short": "must not be empty" if least == 1 else f"must hold {least} values",
        "too_long": f"must hold at most {context.get('max_length')} values",
    }
    return others.get(kind) or error["msg"]


def _number(read: Callable[[object], Number], positive: bool = False) -> BeforeValidator:
    """Reads a number with its unit, which must not be negative, or must be ``positive``."""

    def checked(value: object) -> Number:
        number = read(value)
        if number < 0 or (positive and not number):
            wanted = "be more than zero" if positive else "not be negative"
            raise ValueError(f"must {wanted}, but is {short_repr(value)}")
        return number

    return BeforeValidator(checked)


def _example(text: str) -> WithJsonSchema:
    return WithJsonSchema({"type": "string", "examples": [text]})


# YAML has lists only; a frozen model holds tuples.
Listed = BeforeValidator(lambda value: tuple(value) if isinstance(value, list) else value)
_duration = PlainSerializer(units.duration_text, return_type=str, when_used="json")
_size = PlainSerializer(units.size_text, return_type=str, when_used="json")
_rate = PlainSerializer(units.rate_text, return_type=str, when_used="json")
_angle = PlainSerializer(units.angle_text, return_type=str, when_used="json")
_length = PlainSerializer(units.length_text, return_type=str, when_used="json")

Duration = Annotated[int, _number(units.duration_ns), _duration, _example("30 ms")]
PositiveDuration = Annotated[
    int, _number(units.duration_ns, positive=True), _duration, _example("30 ms")
]
Size = Annotated[int, _number(units.size_bytes), _size, _example("1.4 MB")]
PositiveSize = Annotated[int, _number(units.size_bytes, positive=True), _size, _example("1.4 MB")]
Rate = Annotated[int, _number(units.rate_bps, positive=True), _rate, _example("100 Mbit/s")]
Turn = Annotated[float, BeforeValidator(units.angle_rad), _angle, _example("15 deg")]
Length = Annotated[float, _number(units.length_m), _length, _example("1 m")]
PositiveLength = Annotated[float, _number(units.length_m, positive=True), _length, _example("1 m")]
Count = Annotated[int, Field(ge=1)]
Probability = Annotated[float, Field(ge=0, le=1)]
Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$", max_length=100)]
