"""The reference of settings: what the program's own schema says of each."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from genie_sim.base.settings import keys_of
from genie_sim.scenario.methods import MethodSettings
from genie_sim.scenario.schema import json_schema

GROUPS = {  # a setting belongs to the longest path that it is below
    "The run": (
        *("name", "description", "seed", "methods", "model", "spread", "queue_length"),
        *("consumer", "start_jitter", "warm_up", "judged", "record", "metrics", "origin"),
    ),
    "What cameras see": ("perception",),
    "Cameras": ("cameras", "image_encoding"),
    "Edges": ("edges", "edge_neighbours", "edge_network", "serving"),
    "Cars": ("cars", "interface"),
    "Fleet": ("fleet",),
    "Faults": ("faults",),
    "Genie's message cache (Algorithm 1)": ("genie",),
    "Genie's object map (Algorithm 2)": ("genie.object_map",),
}
SEE = {  # where more is written
    "methods": "[Add a method](../extend/method.md)",
    "model": "`genie-sim list devices`",
    "spread": "[the timing model](../explanation/timing-model.md)",
    "consumer": "[The recommended Genie](../explanation/looks.md)",
    "judged": "[Correctness](../explanation/correctness.md)",
    "record": "[Tables](tables.md)",
    "metrics": "[Add a metric](../extend/metric.md)",
    "perception": "[Perception](../perception.md)",
    "perception.source": "[Add a frame source](../extend/frame-source.md)",
    "perception.town[town]": "[The town](../explanation/town.md)",
    "edges[].device": "`genie-sim list devices`",
    "edge_network": "`genie-sim list links`",
    "edge_network.model": "[Add a link](../extend/link.md)",
    "interface": "[Measure energy](../how-to/energy.md)",
    "serving": "[Serve in batches](../how-to/serving.md)",
    "fleet": "[Simulate a fleet](../how-to/fleets.md)",
    "faults": "[Add a fault](../extend/fault.md)",
    "genie": "[How the paper is read](../explanation/paper-readings.md)",
    "genie.similarity.name": "[Add a similarity](../extend/similarity.md)",
    "genie.eviction": "[Add an eviction policy](../extend/eviction.md)",
    "genie.object_map.rule": "[rules](../explanation/paper-readings.md#how-confidence-grows)",
    "genie.object_map.forget_after": "[The recommended Genie](../explanation/looks.md)",
}
UNITS = {  # by the example that the schema gives of a quantity
    "30 ms": "duration",
    "1.4 MB": "size",
    "100 Mbit/s": "rate",
    "5 Hz": "rate",
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
    "object": "mapping",
    "null": "`null`",
}
OWN_CLASS = "`package.module:Class`"
# described elsewhere
REPEATED = (
    "cars[].cameras[].",
    "cars[].link.",
    "fleet.link.",
    *(f"methods[].{key}" for key in keys_of(MethodSettings)),
)

Node = Mapping[str, Any]


def settings(groups: Iterable[str] = tuple(GROUPS)) -> Iterator[str]:
    """A section for each group of settings, and in it one for every setting, with an anchor of its
    name.
    """
    sections: dict[str, list[tuple[int, str]]] = {group: [] for group in GROUPS}
    for path, node in _walked():
        text = f"{node['description']} ({SEE[path]})" if path in SEE else node["description"]
        section = f"### `{path}` {{#{_anchor(path)}}}\n\n{_about(node)}\n\n{text}\n"
        group, place = _group(path)
        sections[group].append((place, section))
    for group in groups:
        yield f"## {group}\n"
        for _, section in sorted(sections[group], key=lambda member: member[0]):
            yield section


def paths() -> list[str]:
    """All settings of the schema, ``genie.similarity.cell[pose_grid]`` where one belongs to a
    choice.
    """
    return [path for path, _ in _walked()]


def unexplained() -> list[str]:
    """The settings of which the schema has no description."""
    return [path for path, node in _walked() if not node.get("description")]


def _group(path: str) -> tuple[str, int]:
    """The group of a setting, and its place in it."""
    begins = {
        begin: (group, place)
        for group, prefixes in GROUPS.items()
        for place, begin in enumerate(prefixes)
        if path.startswith(begin) and path[len(begin) : len(begin) + 1] in ("", ".", "[")
    }
    return begins[max(begins, key=len)]


def _walked() -> Iterator[tuple[str, Node]]:
    schema = json_schema("scenario")
    yield from _below("", schema, schema["$defs"], set())


def _below(path: str, node: Node, classes: Node, seen: set[str]) -> Iterator[tuple[str, Node]]:
    """Every setting below a path, once: its path and its node of the schema."""
    for kind in _kinds(node, classes):
        properties = kind.get("properties", {})
        names = [property_["const"] for property_ in properties.values() if "const" in property_]
        variant = f"[{names[0]}]" if names else ""
        for name, property_ in properties.items():
            below = f"{path}.{name}{variant}".lstrip(".")
            if "const" in property_ or below in seen or below.startswith(REPEATED):
                continue
            seen.add(below)
            kinds = _kinds(property_, classes)
            yield below, {**property_, "required": name in kind.get("required", ()), "kinds": kinds}
            yield from _below(below, property_, classes, seen)
        if "items" in kind:
            yield from _below(f"{path}[]", kind["items"], classes, seen)


def _kinds(node: Node, classes: Node) -> list[Node]:
    """What a value may be: the members of a union, references followed."""
    if "$ref" in node:
        return _kinds(classes[node["$ref"].rpartition("/")[2]], classes)
    if "anyOf" in node and "properties" not in node:
        return [kind for member in node["anyOf"] for kind in _kinds(member, classes)]
    return [node]


def _about(node: Node) -> str:
    """Type, choices, bounds and default, such as "duration such as `30 ms` or `null`; default `2
    s`".
    """
    kinds = node["kinds"]
    choices = [str(choice) for kind in kinds for choice in kind.get("enum", ())]
    names = [_kind(kind) for kind in kinds if "enum" not in kind]
    parts = [" or ".join(dict.fromkeys(name for name in names if name))] if any(names) else []
    if choices:
        parts.insert(0, " · ".join(f"`{choice}`" for choice in choices))
    bounds = [f"at least {kind['minimum']:g}" for kind in kinds if "minimum" in kind]
    bounds += [
        f"more than {kind['exclusiveMinimum']:g}" for kind in kinds if "exclusiveMinimum" in kind
    ]
    bounds += [f"at most {kind['maximum']:g}" for kind in kinds if "maximum" in kind]
    text = ", ".join([" or ".join(parts), *bounds])
    default = node.get("default")
    if node["required"] and OWN_CLASS not in text:
        return f"{text}; must be given"
    if "default" in node and (
        not isinstance(default, dict | list) or len(json.dumps(default)) < 100
    ):
        default = round(default, 3) if isinstance(default, float) else default
        shown = json.dumps(default) if not isinstance(default, str) else default or '""'
        return f"{text}; default `{shown}`"
    return text


def _kind(kind: Node) -> str:
    example = next(iter(kind.get("examples", ())), None)
    if example in UNITS:
        return f"{UNITS[example]} such as `{example}`"
    if "pattern" in kind and ":" in kind["pattern"]:
        return OWN_CLASS
    if kind.get("type") == "array" and "enum" in kind.get("items", {}):
        return "list of " + ", ".join(f"`{choice}`" for choice in kind["items"]["enum"])
    return KINDS.get(str(kind.get("type", "")), "")


def _anchor(path: str) -> str:
    return path.replace("[]", "-entry").replace("[", "-").replace("]", "")
