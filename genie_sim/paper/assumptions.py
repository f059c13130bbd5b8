"""Reads ``assumptions.yaml``: everything the paper leaves open, decided beforehand, and what is
calibrated.
"""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any

from genie_sim.scenario.yaml_input import read_mapping
from genie_sim.settings import Key, read


@dataclass(frozen=True)
class Variant:
    """Another reading or machine. ``plausible``: ``yes``, ``arguable`` or ``no``, whatever comes
    out.
    """

    name: str
    settings: Annotated[tuple[str, ...], Key("set")]
    plausible: str
    why: str


@dataclass(frozen=True)
class Sweep:
    """One open parameter, the values it is tried at and their plausible range; ``paper``: what the
    paper gives.
    """

    parameter: str
    unit: str
    values: tuple[float, ...]
    plausible: tuple[float, float]
    paper: str


@dataclass(frozen=True)
class Fitted:
    """A calibrated parameter's physically plausible range."""

    name: str
    range: tuple[float, float]
    why: str


@dataclass(frozen=True)
class Assumptions:
    """All that the file says, with the defaults of the evaluation beside it."""

    scenarios: tuple[str, ...]
    seeds: tuple[int, ...]
    calibration_seeds: tuple[int, ...]
    route: str
    fixed: tuple[dict[str, Any], ...]
    fitted: tuple[Fitted, ...]
    targets: dict[str, float]
    variants: tuple[Variant, ...]
    sweeps: tuple[Sweep, ...]


@lru_cache(maxsize=1)
def load_assumptions() -> Assumptions:
    """What stands in ``assumptions.yaml``."""
    path = Path(__file__).with_name("assumptions.yaml")
    data = read_mapping(path)
    calibrated = data.pop("calibrated")
    fitted = [{"name": name, **parameter} for name, parameter in calibrated["parameters"].items()]
    targets = {name: target["value"] for name, target in calibrated["targets"].items()}
    evaluation = data.pop("evaluation")
    parts = {**data, **evaluation, "fitted": fitted, "targets": targets}
    return read(Assumptions, parts, lambda _: str(path))
