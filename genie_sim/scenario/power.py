"""What computers and network interfaces take in watts, every number with its source and range.

Tags are those of the device profiles. Nearly all are assumed: a run says which conclusions hold
over all ranges.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple

from genie_sim.base.marks import Bounds, Text
from genie_sim.base.setting_errors import SettingError
from genie_sim.base.units import NS_PER_MS

MAX_W = 100_000


@dataclass(frozen=True, kw_only=True)
class Sourced:
    """What is told of every number."""

    tag: Literal["P", "S", "M", "D", "A"]
    """From the paper, a public source, measured, derived, or assumed."""

    source: Text
    """Where it is from, and how it was derived."""


@dataclass(frozen=True, kw_only=True)
class Watts(Sourced):
    """A power, and the range in which it may well be."""

    value_w: Annotated[float, Bounds(minimum=0, maximum=MAX_W)]
    """What is taken."""

    low_w: Annotated[float, Bounds(minimum=0, maximum=MAX_W)]
    """The least that it may be."""

    high_w: Annotated[float, Bounds(minimum=0, maximum=MAX_W)]
    """The most that it may be."""

    def __post_init__(self) -> None:
        if not self.low_w <= self.value_w <= self.high_w:
            raise SettingError("value", "must be from 'low' to 'high'")


@dataclass(frozen=True, kw_only=True)
class DevicePower:
    """What a computer takes."""

    idle: Watts
    """Always."""

    accelerator: Watts
    """More, while its accelerator works."""

    core: Watts
    """More, for each core that works."""


class Range(NamedTuple):
    """A value and its range: in watts, or of the slopes of an interface in joules per megabit."""

    value: float
    low: float
    high: float


NOTHING = Range(0, 0, 0)


@dataclass(frozen=True, kw_only=True)
class InterfacePower:
    """What a car's network interface takes: ``port`` always [W], ``transfer`` while it sends or
    receives [W], ``up`` and ``down`` for what it sends and receives [J/Mbit], ``tail`` in between
    [W], for at most ``tail_time_ns``.
    """

    port: Range = NOTHING
    transfer: Range = NOTHING
    up: Range = NOTHING
    down: Range = NOTHING
    tail: Range = NOTHING
    tail_time_ns: int = 0
    tag: str
    source: str


HUANG = (
    "Huang et al., A close examination of performance and power characteristics of 4G LTE "
    "networks, MobiSys 2012, table 4; the range is assumed, 20 % to either side"
)
# The transfer's power is what the phone took beyond its 2.36 W without transfers.
NARAYANAN = (
    "derived from measurements of Narayanan et al., A variegated look at 5G in the wild, SIGCOMM "
    "2021 (github.com/SIGCOMM21-5G/artifact at 35aaf285): least squares over a phone's power on "
    "low-band 5G (MN-Transfer_combined.csv), less its power without transfers "
    "(baseline_power.csv); the range covers another operator's 5G in the field (cleaned-logs) and "
    "20 % above; tail time of RRC-Probe, tail power assumed"
)
InterfaceName = Literal["auto", "none", "ethernet", "wifi", "lte", "nr5g"]


def _near(value: float) -> Range:
    return Range(value, 0.8 * value, 1.2 * value)


INTERFACES: Mapping[str, InterfacePower] = {
    "none": InterfacePower(tag="D", source="not counted"),
    "ethernet": InterfacePower(
        port=Range(0.7, 0.5, 1.0), tag="A", source="assumed: a port takes 0.5 to 1 W, always"
    ),
    "wifi": InterfacePower(
        transfer=_near(0.133), up=_near(0.283), down=_near(0.137), tag="S", source=HUANG
    ),
    "lte": InterfacePower(
        transfer=_near(1.288),
        up=_near(0.438),
        down=_near(0.052),
        tail=_near(1.060),
        tail_time_ns=11_600 * NS_PER_MS,
        tag="S",
        source=HUANG,
    ),
    "nr5g": InterfacePower(
        transfer=Range(0.842, 0.526, 2.171),
        up=Range(0.0322, 0.0076, 0.0386),
        down=Range(0.0115, 0.0, 0.0184),
        tail=Range(0.5, 0.2, 1.1),
        tail_time_ns=10_200 * NS_PER_MS,
        tag="D",
        source=NARAYANAN,
    ),
}
OF_LINKS = {  # the interfaces of links by name
    "ideal": "none",
    "ethernet_1g": "ethernet",
    "ethernet_100m": "ethernet",
    "wifi": "wifi",
    "lte": "lte",
    "nr5g": "nr5g",
}
OF_MODELS = {"cell": "nr5g", "trace": "nr5g"}  # the interfaces of other link models


def parts(power: DevicePower | InterfacePower) -> Iterator[tuple[str, Range]]:
    """Each part of a power by name, with its range."""
    if isinstance(power, InterfacePower):
        for name in ("port", "transfer", "up", "down", "tail"):
            yield name, getattr(power, name)
        return
    for name in ("idle", "accelerator", "core"):
        watts = getattr(power, name)
        yield name, Range(watts.value_w, watts.low_w, watts.high_w)
