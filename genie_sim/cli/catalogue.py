"""What can be named in a scenario, each with a line about it; the answers of ``genie-sim list``."""

from collections.abc import Callable, Iterable, Mapping

from genie_sim.base import files
from genie_sim.base.docstrings import docstring
from genie_sim.base.plugins import Choice, resolve
from genie_sim.base.units import duration_text, rate_text
from genie_sim.core.confidence import CONFIDENCE_RULES
from genie_sim.core.eviction import EVICTIONS
from genie_sim.core.similarity import SIMILARITIES
from genie_sim.data.sources import SOURCES
from genie_sim.links.presets import LINKS
from genie_sim.scenario.profiles import load_profile
from genie_sim.scenario.yaml_input import read_mapping
from genie_sim.sim.fault import FAULTS
from genie_sim.sim.link_model import LINK_MODELS
from genie_sim.sim.method import METHODS

Listing = Iterable[tuple[str, str]]


def _described(kind: files.FileKind) -> Listing:
    for name, path in files.available(kind).items():
        yield name, str(read_mapping(path).get("description", ""))


def _models() -> Listing:
    """Every model, with its median time on each device that knows it."""
    medians: dict[str, list[str]] = {}
    for name in files.available(files.DEVICE):
        for model, law in load_profile(name).models.items():
            median = "out of memory" if law.median_ns is None else duration_text(law.median_ns)
            medians.setdefault(model, []).append(f"{name} {median}")
    return ((model, ", ".join(times)) for model, times in medians.items())


def _about_link(link: Choice) -> str:
    of = link.parameters
    rates = (of["rate_up_bps"], of["rate_down_bps"])
    up, down = (rate_text(rate) if rate is not None else "no limit" for rate in rates)
    delay, jitter = (duration_text(of[name]) for name in ("delay_ns", "jitter_ns"))
    return f"{up} up, {down} down, delay {delay}, jitter {jitter}"


def _detectors() -> Listing:
    from genie_sim.data.detectors.detector import DETECTORS

    return _first_lines(DETECTORS)


def _metrics() -> Listing:
    from genie_sim.analysis.registry import METRICS

    for name, metric in METRICS.items():
        yield name, f"{metric.label}: {metric.meaning}"


def _columns() -> Listing:
    """Every column of the tables of a run, with its unit and meaning."""
    from genie_sim.record.records import SCHEMAS

    for table in SCHEMAS.values():
        for column in table.columns:
            unit = f" [{column.unit}]" if column.unit else ""
            yield f"{table.name}.{column.name}", f"{column.description}{unit}"


def _first_lines(registry: Mapping[str, object]) -> Listing:
    """Each name of a registry with the first paragraph of its class's docstring, on one line."""
    for name in registry:
        paragraph, _, _ = docstring(resolve("", name, registry)).partition("\n\n")
        yield name, " ".join(paragraph.split())


KINDS: dict[str, Callable[[], Listing]] = {
    "methods": lambda: _first_lines(METHODS),
    "faults": lambda: _first_lines(FAULTS),
    "sources": lambda: _first_lines(SOURCES),
    "link-models": lambda: _first_lines(LINK_MODELS),
    "scenarios": lambda: _described(files.SCENARIO),
    "sweeps": lambda: _described(files.SWEEP),
    "devices": lambda: ((name, load_profile(name).title) for name in files.available(files.DEVICE)),
    "models": _models,
    "links": lambda: ((name, _about_link(link)) for name, link in LINKS.items()),
    "traces": lambda: ((name, str(path)) for name, path in files.available(files.TRACE).items()),
    "detectors": _detectors,
    "similarities": lambda: _first_lines(SIMILARITIES),
    "evictions": lambda: _first_lines(EVICTIONS),
    "rules": lambda: _first_lines(CONFIDENCE_RULES),
    "metrics": _metrics,
    "columns": _columns,
}
