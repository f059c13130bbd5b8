"""Every type that a setting may have is read, told apart in a union, written and told editors."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import pytest
from jsonschema import Draft202012Validator

from genie_sim.base.marks import Bounds, Name
from genie_sim.base.plugins import Choice
from genie_sim.base.setting_errors import SettingError
from genie_sim.base.settings import (
    Kind,
    Setting,
    from_plain,
    is_settings_class,
    plain_data,
    settings_of,
)
from genie_sim.core.rules import EVICTION
from genie_sim.scenario.power import Sourced
from genie_sim.scenario.schema import SCHEMAS, class_schema

PAPER = {"tag": "P", "source": "table 1"}


@dataclass(frozen=True, kw_only=True)
class Every:
    """A setting of each type, each in a union."""

    flag: bool | None = None
    count: Annotated[int, Bounds(minimum=1)] | None = None
    share: float | None = None
    text: Name | None = None
    word: Literal["first", "all"] | None = None
    delay_ns: int | None = None
    pair: tuple[int, str] | None = None
    names: tuple[Name, ...] | None = None
    counts: Mapping[Name, int] | None = None
    number: Sourced | None = None
    name_alone: Annotated[str, EVICTION] | None = None
    choice: Annotated[Choice, EVICTION] | None = None


# of each: as it is written, as it is read, and what it must not be
VALUES: dict[str, tuple[Any, Any, Any]] = {
    "flag": (True, True, 1),
    "count": (3, 3, 0),
    "share": (0.5, 0.5, "half"),
    "text": ("car1", "car1", "a b"),
    "word": ("all", "all", "none"),
    "delay": ("30 ms", 30_000_000, 30),
    "pair": ([1, "a"], (1, "a"), [1]),
    "names": (["a", "b"], ("a", "b"), ["a b", 1]),
    "counts": ({"a": 1}, {"a": 1}, {"a": "one"}),
    "number": (PAPER, Sourced(**PAPER), {"tag": "X", "source": "?"}),
    "name_alone": ("lru", "lru", "lruu"),
    "choice": ({"name": "mine:Class", "size": 3}, Choice("mine:Class", {"size": 3}), 3),
}


@pytest.mark.parametrize("setting", settings_of(Every), ids=lambda setting: setting.key)
def test_a_value_is_read_written_and_told_editors(setting: Setting):
    written, value, wrong = VALUES[setting.key]
    classes: dict[str, Any] = {}
    editor = Draft202012Validator({**class_schema(Every, classes), "$defs": classes})
    for as_written, as_read in ((written, value), (None, None)):
        settings = from_plain(Every, {setting.key: as_written})
        assert getattr(settings, setting.name) == as_read
        assert plain_data(settings)[setting.key] == as_written
        assert editor.is_valid({setting.key: as_written})
    with pytest.raises(SettingError):
        from_plain(Every, {setting.key: wrong})
    assert not editor.is_valid({setting.key: wrong})


def types(kind: Kind) -> Iterator[object]:
    """All that a setting may be, with what it holds."""
    for member in kind.members:
        if is_settings_class(member.type):
            yield Sourced
            for setting in settings_of(member.type):
                yield from types(setting.kind)
            continue
        yield member.type
        for item in () if member.type is Literal else member.items:
            yield from types(item)


def test_no_setting_is_of_a_type_that_is_not_tried():
    tried = set(types(Kind.of(Every)))
    asked = {of for cls in SCHEMAS.values() for of in types(Kind.of(cls))}
    assert asked - {Any} <= tried
