"""Overrides of single settings from the command line: ``--set cars[0].device=orin_nano``."""

import re
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from genie_sim.base.errors import UserError, short_repr
from genie_sim.scenario.yaml_input import parse

_STEP = re.compile(r"([A-Za-z_]\w*)|\[(\d{1,6})\]")
_PATH = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*|\[(\d{1,6}|\*)\])*")
# settings that may be a mere name
_SHORT_FOR = {"link": "like", "edge_network": "like", "similarity": "name"}


class Override(NamedTuple):
    """What was set, and how it was written."""

    path: str
    text: str


def apply_overrides(settings: dict[str, Any], overrides: Sequence[str]) -> list[Override]:
    """Sets each ``path=value`` in ``settings``, the value read as YAML; ``[*]`` in a path stands
    for every entry of a list. Raises ``UserError`` naming the override.
    """
    applied = []
    for assignment in overrides:
        text = f"--set {assignment}"
        path, equals, value = assignment.partition("=")
        path = path.strip()
        if not equals or not path:
            raise UserError(f"{text}: must be path=value, such as cars[0].device=orin_nano")
        if not _PATH.fullmatch(path):
            raise UserError(f"{text}: cannot read the path {path!r}; write it like cars[0].device")
        for of_entry in list(_of_every_entry(settings, path, text)):
            _assign(settings, _steps(of_entry), parse(value, text), text)
            applied.append(Override(of_entry, text))
    return applied[::-1]  # of two with the same path the last counts


def _of_every_entry(settings: Any, path: str, text: str) -> Iterator[str]:
    """``cars[*].link`` to ``cars[0].link``, ``cars[1].link`` ..."""
    before, every, after = path.partition("[*]")
    if not every:
        yield path
        return
    node = settings
    for step in _steps(before):
        try:
            node = node[step]
        except (KeyError, IndexError, TypeError):
            node = None
    if not isinstance(node, list) or not node:
        raise UserError(f"{text}: {before}: is no list with entries in the scenario")
    for place in range(len(node)):
        yield from _of_every_entry(settings, f"{before}[{place}]{after}", text)


def _steps(path: str) -> list[str | int]:
    """``cars[1].genie`` to ``["cars", 1, "genie"]``."""
    return [name or int(place) for name, place in _STEP.findall(path)]


def _assign(settings: dict[str, Any], steps: list[str | int], value: Any, text: str) -> None:
    """Sets what is at the end of ``steps``, and makes the mappings that lead there."""
    node: Any = settings
    path = ""
    for place, (step, following) in enumerate(zip(steps, [*steps[1:], None], strict=True)):
        if isinstance(step, int):
            if not isinstance(node, list):
                hint = ": it is null; set the whole list" if node is None else ""
                raise UserError(f"{text}: {path}: is not a list in the scenario{hint}")
            if step > len(node):
                count = "1 entry" if len(node) == 1 else f"{len(node)} entries"
                raise UserError(
                    f"{text}: {path}: has {count}, counted from 0; the next is {path}[{len(node)}]"
                )
            if step == len(node):
                node.append({} if isinstance(following, str) else [])
            path += f"[{step}]"
        else:
            if isinstance(node, list) and any(isinstance(entry, dict) for entry in node):
                below = "".join(
                    f"[{one}]" if isinstance(one, int) else f".{one}" for one in steps[place:]
                )
                other = f"did you mean {path}[*]{below}, or {path}[0]{below}?"
                raise UserError(f"{text}: {path}: is a list; {other}")
            if not isinstance(node, dict):
                raise UserError(
                    f"{text}: {path}: is {short_repr(node)}, which has no setting {step!r}"
                )
            path += f".{step}" if path else step
        if following is None:
            node[step] = value
        elif isinstance(step, int):
            node = node[step]
        else:
            inner = node.get(step)
            if isinstance(following, str) and (
                inner is None or (isinstance(inner, str) and step in _SHORT_FOR)
            ):
                inner = {} if inner is None else {_SHORT_FOR[step]: inner}
            node[step] = node = inner
