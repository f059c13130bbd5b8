"""The defaults and bounds of every plug-in's settings, the presets, the powers of interfaces and
what metrics are called: another one changes the results or the tables of everybody who relied on
it, so that it is changed here, too.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

from genie_sim.analysis.registry import METRICS
from genie_sim.base.plugins import resolve
from genie_sim.base.settings import keys_of
from genie_sim.core.eviction import EVICTIONS
from genie_sim.core.rules import LITERAL
from genie_sim.core.similarity import SIMILARITIES
from genie_sim.data.sources import SOURCES
from genie_sim.links.presets import LINKS
from genie_sim.scenario.power import INTERFACES, OF_LINKS, OF_MODELS, parts
from genie_sim.scenario.schema import class_schema
from genie_sim.sim.fault import FAULTS
from genie_sim.sim.link_model import LINK_MODELS
from genie_sim.sim.method import METHODS
from genie_sim.tracks.laws import ASSUMED

REGISTRIES: dict[str, Mapping[str, Any]] = {
    "eviction": EVICTIONS,
    "fault": FAULTS,
    "link": LINK_MODELS,
    "method": METHODS,
    "similarity": SIMILARITIES,
    "source": SOURCES,
}
TOLD = ("default", "minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum", "enum")
EXPECTED = Path(__file__).parent / "defaults.txt"


def settings(kind: str) -> Iterator[str]:
    """``fault.slow.factor: default 2.0, exclusiveMinimum 0``."""
    for name, entry in sorted(REGISTRIES[kind].items()):
        schema = class_schema(resolve(kind, name, {name: entry}), {})
        required = schema.get("required", ())
        for setting, about in sorted(schema.get("properties", {}).items()):
            told = [f"{word} {json.dumps(about[word])}" for word in TOLD if word in about]
            told += ["required"] * (setting in required)
            yield f"{kind}.{name}.{setting}: {', '.join(told) or 'nothing'}"


def presets() -> Iterator[str]:
    for name, link in LINKS.items():
        yield f"preset link {name}: {link.name} {json.dumps(link.parameters, default=str)}"
    yield f"preset genie literal: {json.dumps(LITERAL, default=str)}"


def known_numbers() -> Iterator[str]:
    for name, power in INTERFACES.items():
        ranges = {part: tuple(watts) for part, watts in parts(power) if any(watts)}
        yield f"interface {name}: {ranges}, tail {power.tail_time_ns} ns, {power.tag}"
    yield f"interfaces of links: {OF_LINKS} {OF_MODELS}"
    for law, values in ASSUMED._asdict().items():
        yield f"assumed detector law {law}: {json.dumps(values)}"
    for name, metric in METRICS.items():
        yield f"metric {name}: {json.dumps([metric.title, metric.unit, metric.better])}"


def listed() -> list[str]:
    return [*(line for kind in REGISTRIES for line in settings(kind)), *presets(), *known_numbers()]


def test_defaults_and_bounds_are_those_that_are_written_down():
    """If one is meant to change: delete the file and run this again."""
    if not EXPECTED.exists():
        EXPECTED.write_text("\n".join(listed()) + "\n", encoding="utf-8")
        raise AssertionError(f"{EXPECTED.name} is new: look at it")
    assert listed() == EXPECTED.read_text(encoding="utf-8").splitlines()


@pytest.mark.parametrize("kind", REGISTRIES)
def test_every_plug_in_has_its_settings_there(kind: str):
    written = {
        tuple(line.partition(":")[0].split(".")) for line in EXPECTED.read_text().splitlines()
    }
    for name, entry in REGISTRIES[kind].items():
        for key in keys_of(resolve(kind, name, {name: entry})):
            assert (kind, name, key) in written
