"""The ``methods:`` of a scenario: names, or mappings with settings of their own."""

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, PlainSerializer, WithJsonSchema

from genie_sim import plugins
from genie_sim.errors import short_repr
from genie_sim.methods import METHODS, MUST_HAVE
from genie_sim.plugins import Choice
from genie_sim.scenario.fields import Model, Name, problem, wrong
from genie_sim.scenario.plain import OWN_CLASS_SCHEMA, PlugIn

# What ``scenario.Overridable`` holds.
OVERRIDABLE = (
    "genie",
    "model",
    "spread",
    "queue_length",
    "consumer",
    "image_encoding",
    "edge_network",
)
_PLUG_IN = PlugIn("method", METHODS, key="method", beside=("name", "title", *OVERRIDABLE))


class MethodEntry(Model):
    """One method of a scenario.

    ``title`` is what figures and pages call it (``None``: what the method calls itself). ``settings`` are those of the
    scenario that this entry has otherwise, as in YAML.
    """

    name: Name
    method: Choice
    title: str | None = None
    settings: dict[str, Any] = Field(default_factory=dict)


def read_method(value: object) -> MethodEntry:
    """A name, or ``{name, method, title}`` with arguments of the method and settings of the scenario."""
    if isinstance(value, MethodEntry):
        return value
    given: dict[str, Any] = dict(value) if isinstance(value, Mapping) else {"method": value}
    method = given.pop("method", given.get("name"))
    name = given.pop(
        "name", method.rpartition(":")[2] if isinstance(method, str) else method
    )  # MyMethod of m:MyMethod
    title = given.pop("title", None)
    if title is not None and (not isinstance(title, str) or not title.strip()):
        problem("title", f"must be text, not {short_repr(title)}")
    with wrong("method" if isinstance(value, Mapping) and "method" in value else ""):
        plugins.checked_name("method", method, METHODS)
    of_scenario = {key: item for key, item in given.items() if key in OVERRIDABLE}
    arguments = {key: item for key, item in given.items() if key not in OVERRIDABLE}
    choice = _PLUG_IN.read({"method": method, **arguments})
    if not isinstance(name, str):
        problem("name", f"must be text, not {short_repr(name)}")
    return MethodEntry(name=name, method=choice, title=title, settings=of_scenario)


def _write(entry: MethodEntry) -> object:
    choice = _PLUG_IN.write(entry.method)
    written: dict[str, Any] = {
        "name": entry.name,
        **(choice if isinstance(choice, dict) else {"method": choice}),
    }
    written |= ({} if entry.title is None else {"title": entry.title}) | entry.settings
    return entry.name if written == {"name": entry.name, "method": entry.name} else written


MethodField = Annotated[
    MethodEntry,
    BeforeValidator(read_method),
    PlainSerializer(_write, when_used="json"),
    WithJsonSchema({"anyOf": [{"enum": list(METHODS)}, OWN_CLASS_SCHEMA, {"type": "object"}]}),
]


def method_class(entry: MethodEntry) -> Any:
    """The class of an entry's method. Raises ``UserError``."""
    return plugins.resolve("method", entry.method.name, METHODS, MUST_HAVE)


def overridden(settings: Mapping[str, Any], by: Mapping[str, Any]) -> dict[str, Any]:
    """Settings as in YAML, with others over them: mappings are merged, a plug-in that is named anew brings its own."""
    found = dict(settings)
    for key, item in by.items():
        held = found.get(key)
        merge = isinstance(held, Mapping) and isinstance(item, Mapping) and "name" not in item
        found[key] = overridden(held or {}, item) if merge else item
    return found
