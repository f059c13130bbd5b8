"""Reads untrusted YAML: plain data only, one clear line for everything else.

Stricter than PyYAML's safe loader, and without its surprises: ``no`` and ``on`` are text, ``1e-3``
is a number, ``02`` and ``2011_09_26`` stay text; duplicate keys, tags and anchors are refused.
"""

import copy
import functools
import json
import re
from pathlib import Path
from typing import Any

import yaml
from yaml.composer import Composer
from yaml.constructor import SafeConstructor
from yaml.parser import Parser
from yaml.reader import Reader
from yaml.resolver import BaseResolver
from yaml.scanner import Scanner

try:  # several times as fast
    from yaml._yaml import CParser
except ImportError:
    CParser = None  # type: ignore[assignment, misc]

from genie_sim.base.errors import UserError, short_repr
from genie_sim.base.paths import read_text

MAX_BYTES = 1_000_000
MAX_DEPTH = 40
_PARSER: Any = (Reader, Scanner, Parser) if CParser is None else (CParser,)
_UNPRINTABLE = re.compile(r"[\x00-\x08\x0b-\x1f\x7f\ud800-\udfff]")

_ESCAPED = re.compile(r"[\x7f-\x9f\u2028\u2029\ufeff\ufffe\uffff\ud800-\udfff]")

_PLAIN = {
    "tag:yaml.org,2002:null": re.compile(r"~|null|Null|NULL|"),
    "tag:yaml.org,2002:bool": re.compile(r"true|True|TRUE|false|False|FALSE"),
    "tag:yaml.org,2002:int": re.compile(r"[-+]?(0|[1-9][0-9]{0,30})"),
    "tag:yaml.org,2002:float": re.compile(
        r"[-+]?((0|[1-9][0-9]{0,30})(\.[0-9]{1,30})?|\.[0-9]{1,30})([eE](-[0-9]{1,3}|\+?[0-9]{1,2}))?"
    ),
}


def read_mapping(path: Path) -> dict[str, Any]:
    """The one mapping in a YAML file. Raises ``UserError`` with file and line."""
    value = parse(read_text(path, MAX_BYTES), str(path))
    if value is None:
        raise UserError(f"{path}: is empty; expected a mapping such as 'name: value'")
    if not isinstance(value, dict):
        what = "a list" if isinstance(value, list) else f"the single value {short_repr(value)}"
        raise UserError(f"{path}: is {what}; expected a mapping such as 'name: value'")
    return value


def parse(text: str, where: str) -> Any:
    """The plain data in ``text``. Raises ``UserError`` that begins with ``where`` and the line."""
    return copy.deepcopy(_parsed(text, where))


@functools.lru_cache(maxsize=64)
def _parsed(text: str, where: str) -> Any:
    """The same, cached: the runs of an evaluation read the same few files thousands of times."""
    if bad := Reader.NON_PRINTABLE.search(text):
        line = text[: bad.start()].count("\n") + 1
        raise UserError(f"{where}: line {line}: holds the character {bad[0]!r}")
    try:
        return _Loader(text).get_single_data()
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        lines, problem = text.split("\n"), str(error.problem)
        line = min(mark.line + 1 if mark else 1, len(lines))
        if problem.startswith(("but ", "did not ")):
            problem = f"{error.context} {problem}"
        if lines[line - 1].lstrip(" ").startswith("\t"):
            problem = "a tab stands where YAML allows only spaces"
        raise UserError(f"{where}: line {line}: {problem}") from error


def dump(value: Any) -> str:
    """YAML text that ``parse`` reads back to the same plain data."""
    return yaml.dump(
        value,
        Dumper=_Dumper,
        sort_keys=False,
        allow_unicode=True,
        width=120,
        default_flow_style=False,
    )


def inline(value: Any) -> str:
    """The same in one line, where every text is quoted: JSON, which is YAML too but for characters
    that only escapes can write.
    """
    return _ESCAPED.sub(
        lambda found: f"\\u{ord(found[0]):04x}", json.dumps(value, ensure_ascii=False)
    )


class _Loader(Composer, SafeConstructor, BaseResolver, *_PARSER):  # type: ignore[misc]
    """Maps, lists and the four kinds of plain scalar; no tags, anchors or aliases."""

    def __init__(self, text: str) -> None:
        for base in _Loader.__bases__:
            base.__init__(self, *([text] if base in (Reader, CParser) else []))
        self._depth = 0

    def compose_node(self, parent: Any, index: Any) -> Any:
        event, self._depth = self.peek_event(), self._depth + 1
        problem = ""
        if getattr(event, "tag", None) is not None:
            problem = f"tags such as {event.tag!r} are not allowed"
        elif getattr(event, "anchor", None) is not None:
            problem = f"anchors and aliases such as {event.anchor!r} are not allowed"
        elif self._depth > MAX_DEPTH:
            problem = f"nested more than {MAX_DEPTH} deep"
        elif bad := _UNPRINTABLE.search(getattr(event, "value", "")):
            problem = f"holds the character {bad[0]!r}"
        if problem:
            raise yaml.MarkedYAMLError(problem=problem, problem_mark=event.start_mark)
        node = super().compose_node(parent, index)
        self._depth -= 1
        return node

    def construct_mapping(self, node: Any, deep: bool = False) -> dict[Any, Any]:
        seen: set[str] = set()
        for key, _ in node.value:
            problem = ""
            if key.tag != "tag:yaml.org,2002:str":
                problem = "a key must be plain text; put it in quotes"
            elif key.value in seen:
                problem = f"duplicate key {key.value!r}"
            if problem:
                raise yaml.MarkedYAMLError(problem=problem, problem_mark=key.start_mark)
            seen.add(key.value)
        return super().construct_mapping(node, deep=deep)


for _tag, _pattern in _PLAIN.items():
    _Loader.add_implicit_resolver(_tag, re.compile(rf"(?:{_pattern.pattern})\Z"), None)


class _Dumper(yaml.SafeDumper):
    """Quotes what either YAML 1.1 or ``parse`` would take for a number, a boolean or null."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def _represent_text(dumper: yaml.SafeDumper, text: str) -> yaml.ScalarNode:
    quoted = any(pattern.fullmatch(text) for pattern in _PLAIN.values())
    return dumper.represent_scalar("tag:yaml.org,2002:str", text, style='"' if quoted else None)


_Dumper.add_representer(str, _represent_text)
