"""Links between cars and edges: rates, delays, losses, each with its source.

Tags: [S] a public source, named; [D] derived from one, formula given; [A] assumed, to be varied.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, PlainSerializer, WithJsonSchema, model_validator

from genie_sim.errors import unknown
from genie_sim.scenario.fields import Duration, Listed, Model, PositiveRate, PositiveSize, Probability, Size, problem
from genie_sim.units import NS_PER_MS

MBIT = 10**6
ETHERNET_PAYLOAD_BYTES = 1448  # a segment's payload at MTU 1500, TCP with time stamps
ETHERNET_OVERHEAD_BYTES = 90  # its headers, preamble, gap and check sequence on the wire

Outage = Annotated[tuple[Duration, Duration], Listed]


class LinkProfile(Model):
    """A full-duplex link. ``up`` leads from a car to its edge, or from an edge into the edge network.

    A rate of ``None`` is infinite. Every message is delayed by ``delay_ns`` plus a uniform draw from 0 to
    ``jitter_ns``, and lost with probability ``loss``; during an outage nothing gets through.
    """

    rate_up_bps: PositiveRate | None = Field(alias="rate_up")
    rate_down_bps: PositiveRate | None = Field(alias="rate_down")
    delay_ns: Duration = Field(alias="delay")
    jitter_ns: Duration = Field(default=0, alias="jitter")
    loss: Probability = 0.0
    mtu_payload_bytes: PositiveSize = Field(default=ETHERNET_PAYLOAD_BYTES, alias="mtu_payload")
    overhead_bytes: Size = Field(default=ETHERNET_OVERHEAD_BYTES, alias="overhead")
    outages_ns: Annotated[tuple[Outage, ...], Listed] = Field((), alias="outages")

    @model_validator(mode="after")
    def _outages_in_order(self) -> LinkProfile:
        last_ns = 0
        for index, (begin_ns, end_ns) in enumerate(self.outages_ns):
            if begin_ns >= end_ns or begin_ns < last_ns:
                problem(f"outages[{index}]", "must be [begin, end], begin before end, not before the last outage ends")
            last_ns = end_ns
        return self

    def wire_bits(self, size_bytes: int) -> int:
        """What a message of ``size_bytes`` takes on the wire: every segment has its overhead."""
        segments = -(-size_bytes // self.mtu_payload_bytes)
        return (size_bytes + segments * self.overhead_bytes) * 8


def _link(up: int | None, down: int | None, delay_ns: int, jitter_ns: int = 0, **more: Any) -> LinkProfile:
    return LinkProfile.model_construct(
        rate_up_bps=up, rate_down_bps=down, delay_ns=delay_ns, jitter_ns=jitter_ns, loss=0.0, **more
    )


LINKS: dict[str, LinkProfile] = {
    # No network at all: what is left is computing time.
    "ideal": _link(None, None, 0, overhead_bytes=0),
    # IEEE 802.3 rates [S]; 0.2 ms from one end of a LAN to the other [A].
    "ethernet_1g": _link(1000 * MBIT, 1000 * MBIT, 200_000),
    "ethernet_100m": _link(100 * MBIT, 100 * MBIT, 200_000),
    # 802.11ac, 2x2 client at 10 m: about 360 Mbit/s [S: duckware.com/tech/wifi-in-the-us.html, version 4.5f]. The rate
    # holds for one direction at a time, both are given it: optimistic when both are busy [A]. Delay and jitter [A];
    # frames are repeated by the link layer, so nothing is lost above it [A]. Here and below the rates are measured
    # above TCP, so there is no overhead left to add.
    "wifi": _link(360 * MBIT, 360 * MBIT, 1 * NS_PER_MS, 4 * NS_PER_MS, overhead_bytes=0),
    # Means over the UK's networks. Rates: 5G 129.9 Mbit/s down, 14.7 up; 4G 29.5 down, 7.6 up [S: Ofcom, Mobile
    # Matters 2023]. Delay: half the response time, the middle of the operators' 16.3 to 21.4 ms on 5G and 18.3 to
    # 23.7 ms on 4G [D from S: Ofcom, Mobile Matters 2024]. Jitter [A]. Both carry far less than a car's four cameras.
    "nr5g": _link(14_700_000, 129_900_000, (16_300_000 + 21_400_000) // 4, 5 * NS_PER_MS, overhead_bytes=0),
    "lte": _link(7_600_000, 29_500_000, (18_300_000 + 23_700_000) // 4, 10 * NS_PER_MS, overhead_bytes=0),
}


def _named(value: object) -> object:
    """A link's name, or a mapping: its fields, and ``like`` (default ``ethernet_1g``) for those it leaves out."""
    if isinstance(value, str):
        if value not in LINKS:
            raise ValueError(unknown("link", value, LINKS))
        return LINKS[value]
    if not isinstance(value, Mapping):
        return value
    like = value.get("like", "ethernet_1g")
    if not isinstance(like, str) or like not in LINKS:
        problem("like", unknown("link", like, LINKS))
    own = {name: item for name, item in value.items() if name != "like"}
    return LINKS[like].model_dump(mode="json", by_alias=True) | own


def _name_or_fields(link: LinkProfile) -> object:
    for name, known in LINKS.items():
        if link == known:
            return name
    return link.model_dump(mode="json", by_alias=True)


def _schema() -> dict[str, Any]:
    fields = LinkProfile.model_json_schema()["properties"]
    own = {"type": "object", "properties": {"like": {"enum": list(LINKS)}, **fields}, "additionalProperties": False}
    return {"anyOf": [{"enum": list(LINKS)}, own]}


Link = Annotated[
    LinkProfile,
    BeforeValidator(_named),
    PlainSerializer(_name_or_fields, when_used="json"),
    WithJsonSchema(_schema()),
]
