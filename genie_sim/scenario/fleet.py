"""Many cars in a generated town: the ``fleet:`` section of a scenario."""

from typing import Annotated

from pydantic import AfterValidator, BeforeValidator, Field, WithJsonSchema

from genie_sim.scenario.fields import Duration, Length, Model, PositiveLength
from genie_sim.scenario.links import LINKS, Link
from genie_sim.units import NS_PER_MS

# How long a car that changes its edge can send and receive nothing. Drive tests see 30 to 80 ms within LTE and 50 to
# 150 ms within 5G [S: 5g6gacademy.com, 5G drive testing, lesson 12.3.5]: what both have in common.
HAND_OVER_GAP_NS = 50 * NS_PER_MS

SHARES_ERROR = 1e-6  # by which shares written in decimals may miss a sum of 1
# Far beyond what anyone has simulated, see docs/explanation/million-cars.md; more is a slip of the pen, which would
# fill the memory before anything is said.
MOST_CARS, MOST_EDGES = 1_000_000, 100_000


def _shares(value: object) -> object:
    """A device's name, or the share of each."""
    return {value: 1.0} if isinstance(value, str) else value


def _sum_to_one(shares: dict[str, float]) -> dict[str, float]:
    if abs(sum(shares.values()) - 1.0) > SHARES_ERROR:
        raise ValueError(f"shares must add up to 1, not to {sum(shares.values()):g}")
    return dict(
        sorted(shares.items())
    )  # the order decides which car gets which device, and is nobody's choice


Share = Annotated[float, Field(gt=0, le=1)]
_DEVICES_SCHEMA = WithJsonSchema(
    {
        "anyOf": [
            {"type": "string"},
            {
                "type": "object",
                "additionalProperties": {"type": "number", "exclusiveMinimum": 0, "maximum": 1},
            },
        ]
    }
)


class Fleet(Model):
    """Cars that are alike but for their devices, and an edge server in the middle of each cell of the town.

    The cells are squares of about ``cell_m``: as many as fit the town best. A car is with the nearest edge; it changes
    when another is nearer by ``hysteresis_m``, and can send and receive nothing for ``hand_over_gap_ns``. Edges share
    with those of the cells that have a border with theirs.
    """

    cars: Annotated[int, Field(ge=1, le=MOST_CARS)]
    devices: Annotated[
        dict[str, Share], BeforeValidator(_shares), AfterValidator(_sum_to_one), _DEVICES_SCHEMA
    ]
    link: Link = LINKS["nr5g"]
    edge_device: str
    cell_m: PositiveLength = Field(default=300.0, alias="cell")
    hysteresis_m: Length = Field(default=20.0, alias="hysteresis")
    hand_over_gap_ns: Duration = Field(default=HAND_OVER_GAP_NS, alias="hand_over_gap")
