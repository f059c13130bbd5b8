"""How long things take on a device: read from ``device_profiles/*.yaml``, every number with its source.

Tags: [P] the paper says so; [S] a public source; [M] measured; [D] derived, formula given; [A] assumed, to be varied.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Generic, Literal, TypeVar

import numpy as np
from pydantic import Field, model_validator

from genie_sim.errors import UserError, unknown
from genie_sim.scenario import files
from genie_sim.scenario.fields import Duration, Listed, Model, Name, PositiveDuration, problem, validate
from genie_sim.scenario.yaml_input import read_mapping

SPREADS = ("isolated", "default", "loaded")
MEGABYTE = 10**6
Tag = Literal["P", "S", "M", "D", "A"]

Value = TypeVar("Value")


class Sourced(Model, Generic[Value]):
    """A number and where it comes from."""

    value: Value
    tag: Tag
    source: Annotated[str, Field(min_length=1)]


class ServiceTime(Model):
    """The law ``X = median (loc + (1 - loc) exp(sigma Z))``, Z standard normal: a sure part and a log-normal tail.

    With ``quantiles_ns``, evenly spaced from the shortest to the longest time measured, X is the quantile of Z instead.
    """

    median_ns: PositiveDuration = Field(alias="median")
    loc: Annotated[float, Field(ge=0, le=1)]
    sigma: Annotated[float, Field(ge=0, le=5)]
    quantiles_ns: Annotated[tuple[PositiveDuration, ...], Listed] = Field((), alias="quantiles")

    def sample(self, rng: np.random.Generator) -> int:
        """One service time in whole nanoseconds, at least 1. Takes exactly one normal draw."""
        return self.at(float(rng.standard_normal()))

    def at(self, z: float) -> int:
        """The time for a standard normal number."""
        if self.quantiles_ns:
            share = 0.5 * (1.0 + math.erf(z / math.sqrt(2.0)))
            steps = np.arange(len(self.quantiles_ns))
            return round(float(np.interp(share * steps[-1], steps, self.quantiles_ns)))
        return max(1, round(self.median_ns * (self.loc + (1.0 - self.loc) * math.exp(self.sigma * z))))

    @property
    def mean_ns(self) -> float:
        """The law's mean: that of exp(sigma Z) is exp(sigma^2 / 2)."""
        if self.quantiles_ns:
            return float(np.mean((self.quantiles_ns[:-1], self.quantiles_ns[1:])))
        return self.median_ns * (self.loc + (1.0 - self.loc) * math.exp(self.sigma**2 / 2))


class Spread(Model):
    """How much service times vary about their median."""

    loc: Annotated[float, Field(ge=0, le=1)]
    sigma: Annotated[float, Field(ge=0, le=5)]
    tag: Tag
    source: Annotated[str, Field(min_length=1)]


class Spreads(Model):
    """The three conditions a device can be in: alone, as usual, with other work beside it."""

    isolated: Spread
    default: Spread
    loaded: Spread


class Hop(Model):
    """Handing a message to another process on the same host."""

    small: Sourced[Duration]
    per_megabyte: Sourced[Duration]

    def duration_ns(self, size_bytes: int) -> int:
        """A fixed part and one that grows with the message."""
        return self.small.value + self.per_megabyte.value * size_bytes // MEGABYTE


class GenieTime(Model):
    """Genie's own CPU time for one message."""

    median: Sourced[PositiveDuration]
    spread: Spread


class ModelTime(Model):
    """The median time of one detection, or ``oom``: the model does not fit into the device's memory.

    ``quantiles``, evenly spaced from the shortest to the longest time, replace the law of the device's spreads by what
    was measured.
    """

    median_ns: PositiveDuration | None = Field(default=None, alias="median")
    quantiles_ns: Annotated[tuple[PositiveDuration, ...], Listed] = Field((), alias="quantiles")
    oom: bool = False
    tag: Tag
    source: Annotated[str, Field(min_length=1)]

    @model_validator(mode="after")
    def _fits_or_not(self) -> ModelTime:
        if (self.median_ns is None) != self.oom:
            problem("median", "exactly one of 'median' and 'oom: true' must be given")
        if self.quantiles_ns and (len(self.quantiles_ns) < 2 or sorted(self.quantiles_ns) != list(self.quantiles_ns)):
            problem("quantiles", "must be at least two times, in ascending order")
        return self


class DeviceProfile(Model):
    """One computer: a car's or an edge's."""

    name: Name
    title: str
    cores: Sourced[Annotated[int, Field(ge=1, le=1024)]]
    hop: Hop
    genie_time: GenieTime = Field(alias="genie")
    spreads: Spreads
    models: dict[Name, ModelTime]

    @property
    def genie(self) -> ServiceTime:
        """Genie's own CPU time for one message."""
        law = self.genie_time
        return ServiceTime.model_construct(median_ns=law.median.value, loc=law.spread.loc, sigma=law.spread.sigma)

    def service_time(self, model: str, spread: str = "default") -> ServiceTime:
        """One detection of ``model``. Raises ``UserError`` where it is unknown here or does not fit into memory."""
        if model not in self.models:
            raise UserError(f"{self.name}: {unknown('model', model, self.models)}")
        if spread not in SPREADS:
            raise UserError(unknown("spread", spread, SPREADS))
        time = self.models[model]
        if time.median_ns is None:
            raise UserError(f"{self.name}: model {model!r} runs out of memory")
        law: Spread = getattr(self.spreads, spread)
        return ServiceTime.model_construct(
            median_ns=time.median_ns, loc=law.loc, sigma=law.sigma, quantiles_ns=time.quantiles_ns
        )


def load_profile(path_or_name: str | Path) -> DeviceProfile:
    """The profile of a shipped device (``jetson_tx2``) or of a file (``./my_device.yaml``)."""
    path = files.find(files.DEVICE, path_or_name)
    return validate(DeviceProfile, read_mapping(path), lambda field: str(path))
