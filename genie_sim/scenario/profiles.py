"""How long things take on a device: read from ``device_profiles/*.yaml``, every number with its source.

Tags: [P] the paper says so; [S] a public source; [M] measured; [D] derived, formula given; [A] assumed, to be varied.
"""

import functools
from pathlib import Path
from typing import Annotated, Generic, Literal, TypeVar

from pydantic import Field, model_validator

from genie_sim import files
from genie_sim.errors import UserError, unknown
from genie_sim.scenario.fields import (
    Duration,
    Listed,
    Model,
    Name,
    PositiveDuration,
    problem,
    validate,
)
from genie_sim.scenario.yaml_input import read_mapping, read_text

Tag = Literal["P", "S", "M", "D", "A"]

Value = TypeVar("Value")


class Sourced(Model, Generic[Value]):
    """A number and where it comes from."""

    value: Value
    tag: Tag
    source: Annotated[str, Field(min_length=1)]


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
    def _fits_or_not(self) -> "ModelTime":
        if (self.median_ns is None) != self.oom:
            problem("median", "exactly one of 'median' and 'oom: true' must be given")
        if self.quantiles_ns and (
            len(self.quantiles_ns) < 2 or sorted(self.quantiles_ns) != list(self.quantiles_ns)
        ):
            problem("quantiles", "must be at least two times, in ascending order")
        return self


class KeyTime(Model):
    """What a picture's key costs: CPU time (``median``), or accelerator time as a share of one detection's median."""

    median_ns: PositiveDuration | None = Field(default=None, alias="median")
    of_detection: Annotated[float, Field(gt=0, le=1)] | None = None
    tag: Tag
    source: Annotated[str, Field(min_length=1)]

    @model_validator(mode="after")
    def _one_of_both(self) -> "KeyTime":
        if (self.median_ns is None) == (self.of_detection is None):
            problem("median", "exactly one of 'median' and 'of_detection' must be given")
        return self


KEYS = {  # by the name of the feature; a profile may say otherwise
    "hsv": KeyTime.model_validate(
        {"median": "1 ms", "tag": "A", "source": "assumed: a histogram of a picture"}
    ),
    "yolox_gap": KeyTime(
        of_detection=0.455,
        tag="D",
        source="multiplications of YOLOX-nano up to this tensor, 168.9 of 371.0 million at 640x192",
    ),
}

_CODEC = Sourced(
    value=1.0, tag="A", source="as fast as the processor that sim/encoding.py was measured on"
)


class DeviceProfile(Model):
    """One computer: a car's or an edge's.

    ``keys``: what similarity keys cost, by the name of the feature. ``codec``: how many times as long as in
    ``sim/encoding.py`` it takes to encode and decode pictures.
    """

    name: Name
    title: str
    cores: Sourced[Annotated[int, Field(ge=1, le=1024)]]
    hop: Hop
    genie_time: GenieTime = Field(alias="genie")
    codec: Sourced[Annotated[float, Field(gt=0, le=1000)]] = _CODEC
    spreads: Spreads
    keys: dict[Name, KeyTime] = KEYS
    models: dict[Name, ModelTime]

    def median_ns(self, model: str) -> int:
        """Of one detection [ns]. Raises ``UserError`` where the model is unknown here or does not fit into memory."""
        if model not in self.models:
            raise UserError(f"{self.name}: {unknown('model', model, self.models)}")
        median_ns = self.models[model].median_ns
        if median_ns is None:
            raise UserError(f"{self.name}: model {model!r} runs out of memory")
        return median_ns


def load_profile(path_or_name: str | Path) -> DeviceProfile:
    """The profile of a shipped device (``jetson_tx2``) or of a file (``./my_device.yaml``)."""
    path = files.find(files.DEVICE, path_or_name)
    return _profile(path, read_text(path))


@functools.lru_cache(maxsize=64)
def _profile(path: Path, _: str) -> DeviceProfile:
    """What stands in a file with this text, remembered: the runs of an evaluation have the same few devices."""
    return validate(DeviceProfile, read_mapping(path), lambda field: str(path))
