"""How long things take on a device: read from ``device_profiles/*.yaml``, every number with its
source.

Tags: [P] the paper says so; [S] a public source; [M] measured; [D] derived, formula given; [A]
assumed, to be varied.
"""

import functools
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated

from genie_sim.base import files
from genie_sim.base.errors import UserError, unknown
from genie_sim.base.marks import Bounds, Name, Share
from genie_sim.base.paths import read_text
from genie_sim.base.setting_errors import SettingError
from genie_sim.base.settings import read
from genie_sim.scenario.power import DevicePower, Sourced, Watts
from genie_sim.scenario.yaml_input import read_mapping


@dataclass(frozen=True, kw_only=True)
class Time(Sourced):
    """A time."""

    value_ns: int
    """How long."""


@dataclass(frozen=True, kw_only=True)
class PositiveTime(Sourced):
    """A time above zero."""

    value_ns: Annotated[int, Bounds(above=0)]
    """How long."""


@dataclass(frozen=True, kw_only=True)
class Cores(Sourced):
    """The number of a computer's cores."""

    value: Annotated[int, Bounds(minimum=1, maximum=1024)]
    """How many."""


@dataclass(frozen=True, kw_only=True)
class Factor(Sourced):
    """How many times as long something takes as where it was measured."""

    value: Annotated[float, Bounds(above=0, maximum=1000)]
    """Times as long."""


@dataclass(frozen=True, kw_only=True)
class Spread(Sourced):
    """How much service times vary about their median."""

    loc: Share
    """The share of the median that every one takes."""

    sigma: Annotated[float, Bounds(minimum=0, maximum=5)]
    """By how much the logarithm of the rest varies."""


@dataclass(frozen=True, kw_only=True)
class Spreads:
    """The three conditions a device can be in."""

    isolated: Spread
    """Alone."""

    default: Spread
    """As usual."""

    loaded: Spread
    """With other work beside it."""


@dataclass(frozen=True, kw_only=True)
class Hop:
    """Handing a message to another process on the same host."""

    small: Time
    """Of any message, whatever its size."""

    per_megabyte: Time
    """More, for each megabyte of it."""


@dataclass(frozen=True, kw_only=True)
class GenieTime:
    """Genie's own CPU time for one message."""

    median: PositiveTime
    """Half of all messages take less."""

    spread: Spread
    """How much they vary."""


@dataclass(frozen=True, kw_only=True)
class BatchTime(Sourced):
    """What pictures gain from being detected at once."""

    fixed: Share
    """Pictures at once, b of them, take `fixed + (1 - fixed) b` times as long as one."""


@dataclass(frozen=True, kw_only=True)
class ModelTime(Sourced):
    """How long one detection takes, or that the model does not run: ``median`` or ``oom``."""

    median_ns: Annotated[int, Bounds(above=0)] | None = None
    """The median time of one detection."""

    oom: bool = False
    """The model does not fit into the device's memory."""

    batch: BatchTime = BatchTime(fixed=0.0, tag="A", source="assumed: batches gain nothing")
    """How much longer several pictures at once take."""

    power: Watts | None = None
    """What the accelerator takes beside the idle device, where this model makes a difference."""

    def __post_init__(self) -> None:
        if (self.median_ns is None) != self.oom:
            raise SettingError("median", "exactly one of 'median' and 'oom: true' must be given")


@dataclass(frozen=True, kw_only=True)
class KeyTime(Sourced):
    """What a picture's key costs: ``median`` or ``of_detection``."""

    median_ns: Annotated[int, Bounds(above=0)] | None = None
    """CPU time."""

    of_detection: Annotated[float, Bounds(above=0, maximum=1)] | None = None
    """Accelerator time, as a share of one detection's median."""

    def __post_init__(self) -> None:
        if (self.median_ns is None) == (self.of_detection is None):
            text = "exactly one of 'median' and 'of_detection' must be given"
            raise SettingError("median", text)


KEYS = {  # by the name of the feature; a profile may say otherwise
    "hsv": KeyTime(median_ns=1_000_000, tag="A", source="assumed: a histogram of a picture"),
    "yolox_gap": KeyTime(
        of_detection=0.455,
        tag="D",
        source="multiplications of YOLOX-nano up to this tensor, 168.9 of 371.0 million at 640x192",
    ),
}


@dataclass(frozen=True, kw_only=True)
class DeviceProfile:
    """One computer: a car's or an edge's."""

    name: Name
    """As scenarios call it."""

    title: str
    """As people call it."""

    cores: Cores
    """The processor's."""

    hop: Hop
    """What a message between two of its processes takes."""

    genie: GenieTime
    """What Genie itself takes."""

    codec: Factor = Factor(
        value=1.0, tag="A", source="as fast as the processor that sim/encoding.py was measured on"
    )
    """How many times as long as in `sim/encoding.py` it takes to encode and decode pictures."""

    spreads: Spreads
    """How much service times vary, by the scenario's `spread`."""

    keys: Mapping[Name, KeyTime] = field(default_factory=lambda: KEYS)
    """What similarity keys cost, by the name of the feature."""

    models: Mapping[Name, ModelTime]
    """What detections take, by the name of the model."""

    power: DevicePower | None = None
    """What the computer takes; without it, the energy of a run is not known."""

    def power_with(self, model: str) -> DevicePower | None:
        """What the computer takes with this model; ``None`` if nobody says."""
        if self.power is None:
            return None
        return replace(self.power, accelerator=self.models[model].power or self.power.accelerator)

    def median_ns(self, model: str) -> int:
        """Of one detection [ns]. Raises ``UserError`` where the model is unknown here or does not
        fit into memory.
        """
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
    """What stands in a file with this text, remembered: the runs of an evaluation have the same few
    devices.
    """
    return read(DeviceProfile, read_mapping(path), lambda _: str(path))
