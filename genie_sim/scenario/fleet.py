"""Many cars in a generated town or on another map: the ``fleet:`` section of a scenario."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

from genie_sim.base.marks import Bounds, Short
from genie_sim.base.plugins import Choice
from genie_sim.base.setting_errors import SettingError
from genie_sim.base.units import NS_PER_MS
from genie_sim.links.presets import LINKS
from genie_sim.sim.link_model import LINK

SHARES_ERROR = 1e-6  # by which shares written in decimals may miss a sum of 1
# Far beyond what anyone has simulated: more is a typing error that would exhaust the memory before
# any message appears.
MAX_CARS, MAX_EDGES = 1_000_000, 100_000


@dataclass(frozen=True, kw_only=True)
class Fleet:
    """Cars that are alike but for their devices, and an edge server in the middle of each cell of
    the map.

    The cells are squares of about ``cell_m``: as many as fit the map best. A car is with the
    nearest edge; it changes when another is nearer by ``hysteresis_m``, and can send and receive
    nothing for ``hand_over_gap_ns``. Edges share with those of the cells that have a border with
    theirs.
    """

    cars: Annotated[int, Bounds(minimum=1, maximum=MAX_CARS)] | None = None
    """Number of cars; leave it out only where the source of frames brings its own."""

    devices: Annotated[
        Mapping[str, Annotated[float, Bounds(above=0, maximum=1)]], Short(("jetson_tx2",))
    ]
    """The device of all cars, or a mapping from devices to the shares of cars that have them:
    `{jetson_tx2: 0.7, orin_nano: 0.3}`."""

    link: Annotated[Choice, LINK] = LINKS["nr5g"]
    """The link of every car, with the settings of `edge_network`."""

    edge_device: str
    """The device of every edge."""

    cell_m: Annotated[float, Bounds(above=0)] = 300.0
    """Approximate side of the square that an edge serves; the town gets as many squares as fit."""

    hysteresis_m: float = 20.0
    """A car is handed over when another edge is nearer than its own by more than this."""

    # Drive tests see 30 to 80 ms within LTE and 50 to 150 ms within 5G [S: 5g6gacademy.com, 5G
    # drive testing, lesson 12.3.5]: what both have in common.
    hand_over_gap_ns: int = 50 * NS_PER_MS
    """How long a car can send and receive nothing during a hand-over. Assumed."""

    def __post_init__(self) -> None:
        total = sum(self.devices.values())
        if abs(total - 1.0) > SHARES_ERROR:
            raise SettingError("devices", f"shares must add up to 1, not to {total:g}")
        # the order decides which car gets which device, and is nobody's choice
        object.__setattr__(self, "devices", dict(sorted(self.devices.items())))

    @classmethod
    def expand(cls, value: object) -> object:
        """One device for all cars is a share of 1."""
        if isinstance(value, Mapping) and isinstance(value.get("devices"), str):
            return {**value, "devices": {value["devices"]: 1.0}}
        return value
