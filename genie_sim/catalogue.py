"""What can be named in a scenario, each with a line about it; the answers of ``genie-sim list``."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from genie_sim import files
from genie_sim.core.confidence import CONFIDENCE_RULES
from genie_sim.core.eviction import EVICTIONS
from genie_sim.core.similarity import SIMILARITIES
from genie_sim.scenario.links import LINKS, LinkProfile
from genie_sim.scenario.profiles import load_profile
from genie_sim.scenario.yaml_input import read_mapping
from genie_sim.units import duration_text, rate_text

Listing = Iterable[tuple[str, str]]


def _described(kind: files.Kind) -> Listing:
    for name, path in files.available(kind).items():
        yield name, str(read_mapping(path).get("description", ""))


def _devices() -> Listing:
    return ((name, load_profile(name).title) for name in files.available(files.DEVICE))


def _models() -> Listing:
    """Every model, with its median time on each device that knows it."""
    medians: dict[str, list[str]] = {}
    for name in files.available(files.DEVICE):
        for model, law in load_profile(name).models.items():
            median = "out of memory" if law.median_ns is None else duration_text(law.median_ns)
            medians.setdefault(model, []).append(f"{name} {median}")
    return ((model, ", ".join(times)) for model, times in medians.items())


def _links() -> Listing:
    return ((name, _about_link(link)) for name, link in LINKS.items())


def _about_link(link: LinkProfile) -> str:
    up, down = (rate_text(rate) if rate is not None else "no limit" for rate in (link.rate_up_bps, link.rate_down_bps))
    return f"{up} up, {down} down, delay {duration_text(link.delay_ns)}, jitter {duration_text(link.jitter_ns)}"


def _traces() -> Listing:
    return ((name, str(path)) for name, path in files.available(files.TRACE).items())


def _detectors() -> Listing:
    from genie_sim.perception.detector import DETECTORS

    return _first_lines(DETECTORS)


def _first_lines(registry: Mapping[str, object]) -> Listing:
    return ((name, (entry.__doc__ or "").strip().splitlines()[0]) for name, entry in registry.items())


KINDS: dict[str, Callable[[], Listing]] = {
    "scenarios": lambda: _described(files.SCENARIO),
    "sweeps": lambda: _described(files.SWEEP),
    "devices": _devices,
    "models": _models,
    "links": _links,
    "traces": _traces,
    "detectors": _detectors,
    "similarities": lambda: _first_lines(SIMILARITIES),
    "evictions": lambda: _first_lines(EVICTIONS),
    "rules": lambda: _first_lines(CONFIDENCE_RULES),
}
