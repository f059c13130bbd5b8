"""Links between cars and edges by name: rates, delays, losses, each with its source.

Tags: [S] a public source, named; [D] derived from one, formula given; [A] assumed, to be varied.
"""

from genie_sim.base.plugins import Choice
from genie_sim.base.settings import complete
from genie_sim.base.units import NS_PER_MS
from genie_sim.links.wire import Wire

KBIT = 10**3
MBIT = 10**6


def _wire(up_bps: int | None, down_bps: int | None, delay_ns: int, **settings: int) -> Choice:
    return complete(
        "wire", Wire, rate_up_bps=up_bps, rate_down_bps=down_bps, delay_ns=delay_ns, **settings
    )


LINKS: dict[str, Choice] = {
    # No network at all: what is left is computing time.
    "ideal": _wire(None, None, 0, overhead_bytes=0),
    # IEEE 802.3 rates [S]; 0.2 ms from one end of a LAN to the other [A].
    "ethernet_1g": _wire(1000 * MBIT, 1000 * MBIT, 200_000),
    "ethernet_100m": _wire(100 * MBIT, 100 * MBIT, 200_000),
    # 802.11ac, 2x2 client at 10 m: about 360 Mbit/s [S: duckware.com/tech/wifi-in-the-us.html,
    # version 4.5f]. The rate holds for one direction at a time, both are given it: optimistic when
    # both are busy [A]. Delay and jitter [A]; frames are repeated by the link layer, so nothing is
    # lost above it [A]. Here and below the rates are measured above TCP, so there is no overhead
    # left to add.
    "wifi": _wire(360 * MBIT, 360 * MBIT, 1 * NS_PER_MS, jitter_ns=4 * NS_PER_MS, overhead_bytes=0),
    # Means over the UK's networks. Rates: 5G 129.9 Mbit/s down, 14.7 up; 4G 29.5 down, 7.6 up [S:
    # Ofcom, Mobile Matters 2023]. Delay: half the response time, the middle of the operators' 16.3
    # to 21.4 ms on 5G and 18.3 to 23.7 ms on 4G [D from S: Ofcom, Mobile Matters 2024]. Jitter [A].
    # Both carry far less than a car's four cameras.
    "nr5g": _wire(
        14_700 * KBIT,
        129_900 * KBIT,
        (16_300_000 + 21_400_000) // 4,
        jitter_ns=5 * NS_PER_MS,
        overhead_bytes=0,
    ),
    "lte": _wire(
        7_600 * KBIT,
        29_500 * KBIT,
        (18_300_000 + 23_700_000) // 4,
        jitter_ns=10 * NS_PER_MS,
        overhead_bytes=0,
    ),
}
