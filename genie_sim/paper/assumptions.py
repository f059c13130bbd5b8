"""Reads ``assumptions.yaml``: everything the paper leaves open, decided beforehand, and what is calibrated."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from genie_sim.scenario.yaml_input import read_mapping


@dataclass(frozen=True, slots=True)
class Variant:
    """Another reading or machine. ``plausible``: ``yes``, ``arguable`` or ``no``, whatever comes out."""

    name: str
    settings: tuple[str, ...]
    plausible: str
    why: str


@dataclass(frozen=True, slots=True)
class Sweep:
    """One open parameter, the values it is tried at and their plausible range; ``paper``: what the paper gives."""

    parameter: str
    unit: str
    values: tuple[float, ...]
    plausible: tuple[float, float]
    paper: str


@dataclass(frozen=True, slots=True)
class Fitted:
    """A calibrated parameter's physically plausible range."""

    name: str
    low: float
    high: float
    why: str


@dataclass(frozen=True, slots=True)
class Assumptions:
    """The content of the file."""

    scenarios: tuple[str, ...]
    seeds: tuple[int, ...]
    calibration_seeds: tuple[int, ...]
    settings: tuple[str, ...]
    fixed: tuple[dict[str, str], ...]
    fitted: tuple[Fitted, ...]
    targets: dict[str, float]
    variants: tuple[Variant, ...]
    sweeps: tuple[Sweep, ...]


@lru_cache(maxsize=1)
def load_assumptions() -> Assumptions:
    """The committed assumptions."""
    data: dict[str, Any] = read_mapping(Path(__file__).with_name("assumptions.yaml"))
    evaluation, calibrated = data["evaluation"], data["calibrated"]
    return Assumptions(
        scenarios=tuple(evaluation["scenarios"]),
        seeds=tuple(evaluation["seeds"]),
        calibration_seeds=tuple(evaluation["calibration_seeds"]),
        settings=tuple(evaluation["settings"]),
        fixed=tuple(data["fixed"]),
        fitted=tuple(
            Fitted(name, *_range(one["range"]), one["why"])
            for name, one in calibrated["parameters"].items()
        ),
        targets={name: float(target["value"]) for name, target in calibrated["targets"].items()},
        variants=tuple(
            Variant(one["name"], tuple(one["set"]), one["plausible"], one["why"]) for one in data["variants"]
        ),
        sweeps=tuple(
            Sweep(one["parameter"], one["unit"], _floats(one["values"]), _range(one["plausible"]), one["paper"])
            for one in data["sweeps"]
        ),
    )


def _floats(values: list[float]) -> tuple[float, ...]:
    return tuple(float(value) for value in values)


def _range(values: list[float]) -> tuple[float, float]:
    low, high = _floats(values)
    return low, high
