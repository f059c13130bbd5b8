"""Reads ``assumptions.yaml``: everything the paper leaves open, decided beforehand, and what is calibrated."""

from functools import lru_cache
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from genie_sim.scenario.yaml_input import read_mapping


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True)


class Variant(_Part):
    """Another reading or machine. ``plausible``: ``yes``, ``arguable`` or ``no``, whatever comes out."""

    name: str
    settings: tuple[str, ...] = Field(alias="set")
    plausible: str
    why: str


class Sweep(_Part):
    """One open parameter, the values it is tried at and their plausible range; ``paper``: what the paper gives."""

    parameter: str
    unit: str
    values: tuple[float, ...]
    plausible: tuple[float, float]
    paper: str


class Fitted(_Part):
    """A calibrated parameter's physically plausible range."""

    name: str
    range: tuple[float, float]
    why: str


class Assumptions(_Part):
    scenarios: tuple[str, ...]
    seeds: tuple[int, ...]
    calibration_seeds: tuple[int, ...]
    fixed: tuple[dict[str, Any], ...]
    fitted: tuple[Fitted, ...]
    targets: dict[str, float]
    variants: tuple[Variant, ...]
    sweeps: tuple[Sweep, ...]


@lru_cache(maxsize=1)
def load_assumptions() -> Assumptions:
    data = read_mapping(Path(__file__).with_name("assumptions.yaml"))
    calibrated = data["calibrated"]
    fitted = [{"name": name, **one} for name, one in calibrated["parameters"].items()]
    targets = {name: target["value"] for name, target in calibrated["targets"].items()}
    return Assumptions.model_validate(
        {**data, **data["evaluation"], "fitted": fitted, "targets": targets}
    )
