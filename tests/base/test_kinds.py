"""A kind of setting of its own: one class, and a mark."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import pytest

from genie_sim.base.kinds import Kind, Schema
from genie_sim.base.settings import SettingError, class_schema, from_plain, plain_data


class Colour(Kind):
    """A number, in YAML ``#0000ff``."""

    def fits(self, value: object) -> bool:
        return isinstance(value, str) and value.startswith("#")

    def read(self, value: object, base: object = None) -> int:
        if not isinstance(value, str) or not value.startswith("#"):
            raise SettingError("", f"must be such as '#0000ff', not {value!r}")
        return int(value[1:], 16)

    def plain(self, value: Any) -> Any:
        return value if value is None else f"#{value:06x}"

    def schema(self, classes: dict[str, Schema]) -> Schema:
        return {"type": "string", "pattern": "^#"}


@dataclass(frozen=True)
class Paint:
    car: Annotated[int, Colour()]
    others: tuple[Annotated[int, Colour()], ...] = ()


def test_a_kind_of_ones_own_is_read_written_and_described():
    paint = from_plain(Paint, {"car": "#0000ff", "others": ["#000001", "#000002"]})
    assert paint == Paint(255, (1, 2))
    assert plain_data(paint) == {"car": "#0000ff", "others": ["#000001", "#000002"]}
    properties = class_schema(Paint, {})["properties"]
    assert properties["others"] == {
        "type": "array",
        "items": {"type": "string", "pattern": "^#"},
        "default": [],
    }


def test_a_kind_of_ones_own_says_what_is_wrong():
    with pytest.raises(SettingError, match=r"^others\[1\]: must be such as '#0000ff', not 'x'$"):
        from_plain(Paint, {"car": "#0000ff", "others": ["#1", "x"]})
