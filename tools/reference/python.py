"""Signatures and docstrings of public names, as Markdown."""

from __future__ import annotations

import importlib
import inspect
import re
from collections.abc import Iterator
from types import ModuleType

SECTION = re.compile(r"^(\w[\w ]*)\n-{3,}$", re.MULTILINE)


def module(name: str) -> Iterator[str]:
    """The functions and classes that a module defines."""
    found = importlib.import_module(name)
    yield f"## {name.removeprefix('genie_sim.')}\n\n{text_of(found)}\n"
    for member, value in vars(found).items():
        here = getattr(value, "__module__", None) == name and not member.startswith("_")
        if here and (inspect.isfunction(value) or inspect.isclass(value)) and value.__doc__:
            yield from entry(member, value)


def entry(name: str, value: object) -> Iterator[str]:
    """One function, or a class with its methods."""
    yield f"### `{name}{_signature(value)}`\n\n{text_of(value)}\n"
    if not inspect.isclass(value):
        return
    for member, inner in vars(value).items():
        if isinstance(inner, classmethod | staticmethod):
            inner = inner.__func__
        if member.startswith("_") or not inspect.getdoc(inner):
            continue
        if isinstance(inner, property):
            yield f"- `{member}`: {_first(inner)}"
        elif inspect.isfunction(inner) and inner.__doc__:
            yield f"- `{member}{_signature(inner)}`: {_first(inner)}"
    yield ""


def text_of(value: object | ModuleType) -> str:
    """A docstring as Markdown: its sections in bold, its parameters as a list."""
    first, *sections = SECTION.split(_clean(value))
    parts = [first.strip()]
    for heading, body in zip(sections[::2], sections[1::2], strict=True):
        entries = re.sub(r"^(\S.*)\n((?: +.*\n?|\n)+)", _item, body.strip() + "\n", flags=re.M)
        parts.append(f"**{heading}**\n\n{entries.strip()}")
    return "\n\n".join(part for part in parts if part)


def _item(found: re.Match[str]) -> str:
    return f"- `{found[1].strip()}`: {' '.join(found[2].split())}\n"


def _first(value: object) -> str:
    """The first paragraph of a docstring, on one line."""
    return " ".join(_clean(value).partition("\n\n")[0].split())


def _clean(value: object) -> str:
    text = (inspect.getdoc(value) or "").replace("``", "`")
    return re.sub(r"\.\. \[(\d+)\]", r"[\1]", text)


def _signature(value: object) -> str:
    """``(name, other=1)``, without types; empty where there is none, as of a protocol."""
    if getattr(value, "_is_protocol", False):
        return ""
    try:
        signature = inspect.signature(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        return ""
    shown = [
        one.replace(annotation=one.empty, default=one.default if _is_short(one.default) else ...)
        for one in signature.parameters.values()
        if one.name not in ("self", "cls")
    ]
    return str(signature.replace(parameters=shown, return_annotation=signature.empty))


def _is_short(default: object) -> bool:
    """Whether a default can be shown: no address in memory, and not long."""
    return default is inspect.Parameter.empty or (
        len(repr(default)) < 30 and "<" not in repr(default)
    )
