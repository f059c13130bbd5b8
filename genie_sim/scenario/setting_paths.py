"""The paths of all settings of a scenario, as ``--set`` takes them, for completion and hints."""

import difflib
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from typing import Any

from genie_sim.base.settings import Schema, class_schema

Settings = Callable[..., Any]  # a settings class
Node = Mapping[str, Any]
MAX_HINTS = 3
CLOSE = 0.8  # of difflib's ratio: above it a misspelt word, below it perhaps one of another place


@cache
def setting_paths(cls: Settings) -> tuple[str, ...]:
    """Every path of a settings class, such as ``Scenario``, once; of lists the first entry's:
    ``cars[0].device``.
    """
    classes: dict[str, Schema] = {}
    schema = class_schema(cls, classes)
    return tuple(dict.fromkeys(_below("", schema, classes, ())))


def hint(cls: Settings, path: str, message: str) -> str:
    """``message`` about the unknown field at ``path``, with the settings of that name at other
    places where no name at its own place is close.
    """
    word = path.rpartition(".")[2]
    _, found, near = message.partition("did you mean '")
    if found and difflib.SequenceMatcher(None, word, near.rstrip("'?")).ratio() >= CLOSE:
        return message
    same = [other for other in setting_paths(cls) if other.rpartition(".")[2] == word]
    if not same:
        return message
    texts = [repr(other) for other in sorted(same, key=len)[:MAX_HINTS]]
    return f"unknown field; did you mean {' or '.join(texts)}?"


def _below(path: str, node: Node, classes: Node, above: tuple[str, ...]) -> Iterator[str]:
    """Every setting below a path; ``above`` are the classes that lead here, which are not entered
    again.
    """
    for kind in _kinds(node, classes):
        name = str(kind.get("title", "")) + ",".join(kind.get("properties", ()))
        if name and name in above:
            continue
        for key, inner in kind.get("properties", {}).items():
            if "const" in inner:
                continue
            yield f"{path}.{key}".lstrip(".")
            yield from _below(f"{path}.{key}".lstrip("."), inner, classes, (*above, name))
        if "items" in kind and not path.startswith("methods"):
            yield from _below(f"{path}[0]", kind["items"], classes, above)


def _kinds(node: Node, classes: Node) -> list[Node]:
    """What a value may be: the members of a union, references followed."""
    if "$ref" in node:
        return _kinds(classes[node["$ref"].rpartition("/")[2]], classes)
    if "anyOf" in node and "properties" not in node:
        return [kind for member in node["anyOf"] for kind in _kinds(member, classes)]
    return [node]
