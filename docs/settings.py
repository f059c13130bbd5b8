"""The reference of settings: what the program's own schema says of each, with the meanings of ``settings.yaml``."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import yaml

from genie_sim.scenario.schema import json_schema

MEANINGS = Path(__file__).with_name("settings.yaml")
UNITS = {  # by the example that the schema gives of a quantity
    "30 ms": "duration",
    "1.4 MB": "size",
    "100 Mbit/s": "rate",
    "15 deg": "angle",
    "1 m": "length",
    "1000 entries": "entries or size",
}
KINDS = {
    "integer": "whole number",
    "number": "number",
    "boolean": "true or false",
    "string": "text",
    "array": "list",
}
OWN_CLASS = "`package.module:Class`"
REPEATED = (
    "cars[].cameras[].",
    "cars[].link.",
    "fleet.link.",
    "convoy.link.",
    "convoy.route.",
)  # described elsewhere

Node = Mapping[str, Any]


def settings() -> Iterator[str]:
    """A section for every group of settings, and in it one for every setting, with an anchor of its name."""
    found = dict(_walked())
    for group, members in meanings().items():
        yield f"## {group}\n"
        for path, meaning in members.items():
            yield f"### `{path}` {{#{_anchor(path)}}}\n\n{_about(found[path])}\n\n{meaning.strip()}\n"


def meanings() -> dict[str, dict[str, str]]:
    """What ``settings.yaml`` says, by group and path."""
    found: dict[str, dict[str, str]] = yaml.safe_load(MEANINGS.read_text(encoding="utf-8"))
    return found


def paths() -> list[str]:
    """All settings of the schema, ``genie.similarity.cell[pose_grid]`` where one belongs to a choice."""
    return [path for path, _ in _walked()]


def _walked() -> Iterator[tuple[str, Node]]:
    schema = json_schema("scenario")
    yield from _below("", schema, schema["$defs"], set())


def _below(path: str, node: Node, known: Node, seen: set[str]) -> Iterator[tuple[str, Node]]:
    node = _resolved(node, known)
    for kind in _kinds(node, known):
        properties = {
            name: _resolved(one, known) for name, one in kind.get("properties", {}).items()
        }
        variant = next((f"[{one['const']}]" for one in properties.values() if "const" in one), "")
        for name, one in properties.items():
            below = f"{path}.{name}{variant}".lstrip(".")
            if "const" in one or below in seen or below.startswith(REPEATED):
                continue
            seen.add(below)
            missing = name in kind.get("required", ())
            yield below, {**one, "required": missing, "kinds": _kinds(one, known)}
            yield from _below(below, one, known, seen)
        if "items" in kind:
            yield (
                f"{path}[]",
                {"required": False, "kinds": _kinds(_resolved(kind["items"], known), known)},
            )
            yield from _below(f"{path}[]", kind["items"], known, seen)


def _resolved(node: Node, known: Node) -> Node:
    if node.get("$ref") is None:
        return node
    return {**_resolved(known[node["$ref"].rpartition("/")[2]], known), **node, "$ref": None}


def _kinds(node: Node, known: Node) -> list[Node]:
    """What a value may be."""
    several = None if "properties" in node else node.get("anyOf") or node.get("oneOf")
    return [_resolved(one, known) for one in several] if several else [node]


def _about(node: Node) -> str:
    """Type, choices, bounds and default, such as "duration such as `30 ms` or `null`; default `2 s`"."""
    choices = [str(choice) for kind in node["kinds"] for choice in kind.get("enum", ())]
    names = [_kind(kind) for kind in node["kinds"] if "enum" not in kind]
    parts = [" or ".join(dict.fromkeys(filter(None, names)))] if any(names) else []
    if choices:
        parts.insert(0, " · ".join(f"`{choice}`" for choice in choices))
    bounds = [f"at least {kind['minimum']:g}" for kind in node["kinds"] if "minimum" in kind]
    bounds += [f"at most {kind['maximum']:g}" for kind in node["kinds"] if "maximum" in kind]
    said = ", ".join([" or ".join(parts), *bounds])
    default = node.get("default")
    if node["required"] and OWN_CLASS not in said:
        said += "; must be given"
    elif "default" in node and (
        not isinstance(default, dict | list) or len(json.dumps(default)) < 100
    ):
        default = round(default, 3) if isinstance(default, float) else default
        shown = json.dumps(default) if not isinstance(default, str) else default or '""'
        said += f"; default `{shown}`"
    return said


def _kind(kind: Node) -> str:
    example = next(iter(kind.get("examples", ())), None)
    if example in UNITS:
        return f"{UNITS[example]} such as `{example}`"
    if "pattern" in kind and ":" in kind["pattern"]:
        return OWN_CLASS
    of = str(kind.get("type", "mapping" if "properties" in kind else ""))
    return {"null": "`null`", "object": "mapping"}.get(of, KINDS.get(of, of))


def _anchor(path: str) -> str:
    return path.replace("[]", "-entry").replace("[", "-").replace("]", "")
