"""How long things take: the law of a service time, and of a message's hop from one process to
another.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from math import exp
from typing import Literal

MEGABYTE = 10**6


@dataclass(frozen=True, slots=True)
class ServiceTime:
    """The shifted log-normal law ``X = median (loc + (1 - loc) exp(sigma Z))``, Z standard
    normal.
    """

    median_ns: int
    loc: float
    sigma: float

    def at(self, z: float) -> int:
        """The time [ns] for a standard normal number, at least 1."""
        return max(1, round(self.median_ns * (self.loc + (1.0 - self.loc) * exp(self.sigma * z))))

    @property
    def mean_ns(self) -> float:
        """The law's mean: that of exp(sigma Z) is exp(sigma^2 / 2)."""
        return self.median_ns * (self.loc + (1.0 - self.loc) * math.exp(self.sigma**2 / 2))


@dataclass(frozen=True, slots=True)
class HopTime:
    """Handing a message to another process on the same host: a fixed part, and one that grows with
    the message.
    """

    fixed_ns: int
    per_megabyte_ns: int

    def of(self, size_bytes: int) -> int:
        """The time [ns] for a message of this size."""
        return self.fixed_ns + self.per_megabyte_ns * size_bytes // MEGABYTE


@dataclass(frozen=True, slots=True)
class Device:
    """One kind of computer: its cores, and how long a hop, a Genie's message and a detection take
    on it.

    ``keys``: how long [ns] a picture's key of some name takes, on the CPU or on the accelerator.
    ``codec_factor``: how many times as long as in ``encoding.TIMES_NS`` encoding and decoding take.
    ``batch_fixed``: the share of a detection's time that does not grow with the size of a batch.
    """

    name: str
    cores: int
    hop: HopTime
    message_time: ServiceTime
    detector_time: ServiceTime
    keys: Mapping[str, tuple[Literal["cpu", "accelerator"], int]] = field(default_factory=dict)
    codec_factor: float = 1.0
    batch_fixed: float = 0.0

    def batch_factor(self, pictures: int) -> float:
        """How many times as long as one picture a batch of so many takes."""
        return self.batch_fixed + (1.0 - self.batch_fixed) * pictures if pictures > 1 else 1.0
