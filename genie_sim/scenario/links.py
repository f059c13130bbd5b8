"""Links between cars and edges: rates, delays, losses, each with its source.

Tags: [S] a public source, named; [D] derived from one, formula given; [A] assumed, to be varied.
"""

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import BeforeValidator, PlainSerializer, WithJsonSchema

from genie_sim import plugins
from genie_sim.errors import unknown
from genie_sim.plugins import Choice
from genie_sim.scenario.fields import problem
from genie_sim.scenario.plain import OWN_CLASS_SCHEMA, PlugIn, model_of
from genie_sim.sim.link_models import LINK_MODELS
from genie_sim.units import NS_PER_MS

MBIT = 10**6
USUAL = "ethernet_1g"
_MODEL = PlugIn("link model", LINK_MODELS, key="model", default="wire")


def _wire(
    up: int | None, down: int | None, delay_ns: int, jitter_ns: int = 0, overhead_bytes: int = 90
) -> Choice:
    rates = {"rate_up_bps": up, "rate_down_bps": down}
    more = {"loss": 0.0, "mtu_payload_bytes": 1448, "overhead_bytes": overhead_bytes}
    return Choice("wire", {**rates, "delay_ns": delay_ns, "jitter_ns": jitter_ns, **more})


LINKS: dict[str, Choice] = {
    # No network at all: what is left is computing time.
    "ideal": _wire(None, None, 0, overhead_bytes=0),
    # IEEE 802.3 rates [S]; 0.2 ms from one end of a LAN to the other [A].
    "ethernet_1g": _wire(1000 * MBIT, 1000 * MBIT, 200_000),
    "ethernet_100m": _wire(100 * MBIT, 100 * MBIT, 200_000),
    # 802.11ac, 2x2 client at 10 m: about 360 Mbit/s [S: duckware.com/tech/wifi-in-the-us.html, version 4.5f]. The rate
    # holds for one direction at a time, both are given it: optimistic when both are busy [A]. Delay and jitter [A];
    # frames are repeated by the link layer, so nothing is lost above it [A]. Here and below the rates are measured
    # above TCP, so there is no overhead left to add.
    "wifi": _wire(360 * MBIT, 360 * MBIT, 1 * NS_PER_MS, 4 * NS_PER_MS, overhead_bytes=0),
    # Means over the UK's networks. Rates: 5G 129.9 Mbit/s down, 14.7 up; 4G 29.5 down, 7.6 up [S: Ofcom, Mobile
    # Matters 2023]. Delay: half the response time, the middle of the operators' 16.3 to 21.4 ms on 5G and 18.3 to
    # 23.7 ms on 4G [D from S: Ofcom, Mobile Matters 2024]. Jitter [A]. Both carry far less than a car's four cameras.
    "nr5g": _wire(
        14_700_000, 129_900_000, (16_300_000 + 21_400_000) // 4, 5 * NS_PER_MS, overhead_bytes=0
    ),
    "lte": _wire(
        7_600_000, 29_500_000, (18_300_000 + 23_700_000) // 4, 10 * NS_PER_MS, overhead_bytes=0
    ),
}


def _read(value: object) -> Choice:
    """A link's name; a mapping with ``like`` (default ``ethernet_1g``) for the settings that it leaves out; or a
    mapping with a ``model`` and its settings."""
    if isinstance(value, Choice):
        return value
    if isinstance(value, str) and not plugins.is_own(value):
        if value not in LINKS:
            raise ValueError(unknown("link", value, LINKS))
        return LINKS[value]
    if not isinstance(value, Mapping) or value.get("model", "wire") != "wire":
        return _MODEL.read(value)
    like = value.get("like", USUAL)
    if not isinstance(like, str) or like not in LINKS:
        problem("like", unknown("link", like, LINKS))
    usual = _MODEL.write(LINKS[like])
    assert isinstance(usual, dict)
    return _MODEL.read(usual | {name: item for name, item in value.items() if name != "like"})


def _write(link: Choice) -> object:
    for name, known in LINKS.items():
        if link == known:
            return name
    return _MODEL.write(link)


def _schema() -> dict[str, Any]:
    of_wire = model_of(plugins.resolve("link model", "wire", LINK_MODELS)).model_json_schema()[
        "properties"
    ]
    fields = {"like": {"enum": list(LINKS)}, "model": {"enum": list(LINK_MODELS)}, **of_wire}
    named = {"type": "object", "properties": fields, "additionalProperties": False}
    own = {"type": "object", "properties": {"model": OWN_CLASS_SCHEMA}, "required": ["model"]}
    return {"anyOf": [{"enum": list(LINKS)}, named, own]}


Link = Annotated[
    Choice,
    BeforeValidator(_read),
    PlainSerializer(_write, when_used="json"),
    WithJsonSchema(_schema()),
]
