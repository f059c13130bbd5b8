"""Overrides of single settings from the command line: ``--set cars[0].device=orin_nano``."""

import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from genie_sim.base.errors import UserError, short_repr
from genie_sim.base.marks import Short
from genie_sim.base.plugins import Choice
from genie_sim.base.setting_errors import SettingError, join, must
from genie_sim.base.settings import (
    REQUIRED,
    Kind,
    PlugIn,
    Setting,
    from_plain,
    is_settings_class,
    mark_in,
    plain_default,
    settings_of,
    written,
)
from genie_sim.scenario.yaml_input import parse

_STEP = re.compile(r"([A-Za-z_]\w*)|\[(\d{1,6}|\*)\]")
_PATH = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*|\[(\d{1,6}|\*)\])*")
_ANYTHING = Kind.of(Any)
EVERY = -1  # of the entries of a list, as a step


class Override(NamedTuple):
    """What was set, and how it was written."""

    path: str
    text: str

    def sets(self, path: str) -> bool:
        """Whether what is at ``path`` was set, or something around it."""
        every = re.escape(self.path).replace(r"\[\*\]", r"\[\d+\]")
        return re.match(rf"{every}(?=[.\[]|$)", path) is not None


def apply_overrides(
    cls: type, settings: Mapping[str, Any], overrides: Sequence[str], given_by: str = "--set"
) -> tuple[dict[str, Any], list[Override]]:
    """The settings of a class, as they are written, with each ``path=value``, the value read as
    YAML; ``[*]`` in a path stands for every entry of a list. What is short for a mapping, and lists
    that are not written, are written out where a path leads into them. Raises ``UserError`` naming
    the override, after what it was ``given_by``.
    """
    applied: list[Override] = []
    changed: Any = dict(settings)
    for assignment in overrides:
        text = f"{given_by} {assignment}".lstrip()
        path, equals, value = assignment.partition("=")
        path = path.strip()
        if not equals or not path:
            raise UserError(f"{text}: must be path=value, such as cars[0].device=orin_nano")
        if not _PATH.fullmatch(path):
            raise UserError(f"{text}: cannot read the path {path!r}; write it like cars[0].device")
        steps = [name or (EVERY if at == "*" else int(at)) for name, at in _STEP.findall(path)]
        change = _Change(steps, parse(value, text), text)
        changed = change.applied_to(Kind.of(cls), changed, "")
        applied.append(Override(path, text))
    return changed, applied[::-1]  # of two with the same path the last counts


class _Change(NamedTuple):
    """One override: the steps of its path that are left, the value at their end, and the text that
    error lines call it. What is not written has its default; where it ``inherits``, as below a
    method's entry, another's value, such as the scenario's.
    """

    steps: Sequence[str | int]
    value: Any
    text: str
    inherits: bool = False

    def applied_to(self, kind: Kind, node: Any, path: str) -> Any:
        """What is written at ``path``, ``node``, with the change: with ``rate=1 Mbit/s`` left of
        ``cars[0].link.rate=1 Mbit/s``, ``wifi`` at ``cars[0].link`` becomes ``{like: wifi, rate: 1
        Mbit/s}``.
        """
        if not self.steps:
            return self.value
        step, *following = self.steps
        below = self._replace(steps=following)
        if isinstance(step, int):
            return below.applied_to_entries(kind, node, path, step)
        if isinstance(node, list) and any(isinstance(entry, dict) for entry in node):
            rest = _text(self.steps)
            other = f"did you mean {path}[*].{rest}, or {path}[0].{rest}?"
            raise self._error(path, f"is a list; {other}")
        try:
            mapping = {} if node is None else _written_out(kind, node, self.inherits)
        except SettingError:
            text = f"is {short_repr(node)}, which has no setting {step!r}"
            raise self._error(path, text) from None
        setting = _settings_in(kind, mapping).get(step)
        if setting is None:
            mapping[step] = below.applied_to(_ANYTHING, mapping.get(step), join(path, step))
            return mapping
        below = below._replace(inherits=self.inherits or setting.default is REQUIRED)
        inner = mapping.get(step)
        if inner is None and not below.inherits:
            inner = _default_to_enter(setting, following)
        mapping[step] = below.applied_to(setting.kind, inner, join(path, step))
        return mapping

    def applied_to_entries(self, kind: Kind, node: Any, path: str, step: int) -> list[Any]:
        """The list with the entry at ``step``, or every one, changed."""
        if not isinstance(node, list):
            hint = ": it is null; set the whole list" if node is None else ""
            raise self._error(path, f"is not a list in the scenario{hint}")
        entries = [*node]
        places = range(len(entries)) if step == EVERY else [step]
        if not places:
            raise self._error(path, "is no list with entries in the scenario")
        for place in places:
            if place > len(entries):
                count = "1 entry" if len(entries) == 1 else f"{len(entries)} entries"
                text = f"has {count}, counted from 0; the next is {path}[{len(entries)}]"
                raise self._error(path, text)
            if place == len(entries):
                entries.append([] if self.steps and isinstance(self.steps[0], int) else None)
            entries[place] = self.applied_to(
                _entry(kind, place), entries[place], f"{path}[{place}]"
            )
        return entries

    def _error(self, path: str, text: str) -> UserError:
        return UserError(f"{self.text}: {path}: {text}")


def _default_to_enter(setting: Setting, following: Sequence[str | int]) -> Any:
    """The default of a setting that is not written, where the rest of a path needs it.

    In ``cameras[1].phase`` the path leads into one of four cameras, of which the others stay; in
    ``genie.similarity.cell`` into the settings of a class, which must be named. None at the end of
    a path (``record=[held]``), and for any other mapping (``genie.object_map.rate``), whose
    defaults complete what is written.
    """
    if following and (isinstance(following[0], int) or isinstance(setting.default, Choice)):
        return plain_default(setting)
    return None


def _entry(kind: Kind, place: int) -> Kind:
    """What stands at a place of a list."""
    for member in kind.members:
        if member.type is tuple and member.arguments:
            items = member.items  # of ``tuple[X, ...]`` one for all places
            return items[min(place, len(items) - 1)]
    return _ANYTHING


def _text(steps: Sequence[str | int]) -> str:
    """``["cars", 1, "genie"]`` as ``cars[1].genie``."""
    path = ""
    for step in reversed(steps):
        path = join("[*]" if step == EVERY else step, path)
    return path


def _written_out(kind: Kind, value: object, inherits: bool) -> dict[str, Any]:
    """The mapping that a value is short for: ``{like: wifi}`` for ``wifi`` at ``cars[0].link``,
    ``{entries: 5}`` for ``5 entries`` at ``genie.capacity``, the rules that differ from the default
    ones for ``literal`` at ``genie``. Where it ``inherits``, as at ``methods[0].genie``, all rules
    of ``literal``: the scenario's ``genie`` would complete them else. Raises ``SettingError`` where
    it is short for none.
    """
    for member in kind.members:
        short, plug_in = member.marks.get(Short), member.marks.get(PlugIn)
        plug_in = plug_in or (short and short.plug_in)
        if plug_in is not None and isinstance(value, str):
            is_preset = plug_in.presets is not None and value in plug_in.presets.choices
            return {"like" if is_preset else plug_in.key: value}
        if hasattr(member.type, "expand") and _plug_in_beside(member.type) is None:
            if inherits and not isinstance(value, Mapping):
                value = from_plain(member.type, value)
            value = _expanded(member.type, value)
    if not isinstance(value, Mapping):
        raise must("be a mapping", value)
    return dict(value)


def _expanded(cls: Any, value: object) -> object:
    """A short form, or a mapping of which a part is short, as a mapping; what is wrong with one is
    told when it is read.
    """
    try:
        value = cls.expand(value)
    except SettingError:
        if not isinstance(value, Mapping):
            raise
    is_read = isinstance(value, cls)
    return written(cls, vars(value)) if is_read else value


def _settings_in(kind: Kind, value: Mapping[str, Any]) -> dict[str, Setting]:
    """The settings that may stand in a mapping as it is written, by their names in YAML.

    Of a link, ``{model: wire}``, those of ``Wire``; of ``{method: genie}`` those of its class, of
    every entry, such as ``title``, and of the scenario, such as ``consumer``, which may stand
    beside. These have no default here: what an entry leaves out is as in the scenario.
    """
    settings: list[Setting] = []
    for member in kind.members:
        plug_in = member.marks.get(PlugIn)
        if is_settings_class(member.type):
            settings += settings_of(member.type)
            plug_in = _plug_in_beside(member.type)
            for cls in () if plug_in is None else plug_in.beside:
                settings += (own._replace(default=REQUIRED) for own in settings_of(cls))
        name = plug_in and value.get(plug_in.key, value.get("name", plug_in.default))
        if plug_in is not None and isinstance(name, str) and name in plug_in.registry:
            settings += settings_of(plug_in.resolve(name))
    return {setting.key: setting for setting in settings}


def _plug_in_beside(cls: Any) -> PlugIn | None:
    """The plug-in of a settings class whose own settings stand beside those of the class."""
    marks = (mark_in(setting.annotation, PlugIn) for setting in settings_of(cls))
    return next((mark for mark in marks if mark is not None and mark.beside), None)
