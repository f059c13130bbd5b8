"""Link profiles: what a message takes on the wire, and links of a scenario's own."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from genie_sim.errors import UserError
from genie_sim.scenario.fields import Model, validate
from genie_sim.scenario.links import LINKS, Link, LinkProfile

IMAGE_BYTES = 1_397_297


class Network(Model):
    link: Link


def link(value: object) -> LinkProfile:
    return validate(Network, {"link": value}, lambda field: "x.yaml").link


def test_an_image_takes_11_87_ms_on_gigabit_ethernet() -> None:
    gigabit = LINKS["ethernet_1g"]
    assert gigabit.rate_up_bps is not None
    assert gigabit.wire_bits(IMAGE_BYTES) / gigabit.rate_up_bps == pytest.approx(11.87e-3, abs=5e-6)


@given(st.integers(1, 10**9))
def test_every_segment_has_its_overhead(size: int) -> None:
    bits = LINKS["ethernet_1g"].wire_bits(size)
    segments = (bits // 8 - size) // 90
    assert bits == (size + 90 * segments) * 8
    assert (segments - 1) * 1448 < size <= segments * 1448


def test_an_empty_message_takes_nothing() -> None:
    assert LINKS["ethernet_1g"].wire_bits(0) == 0


def test_the_ideal_link_is_no_link() -> None:
    ideal = LINKS["ideal"]
    assert (ideal.rate_up_bps, ideal.rate_down_bps, ideal.delay_ns, ideal.jitter_ns, ideal.loss) == (
        None,
        None,
        0,
        0,
        0,
    )


def test_only_a_wire_carries_the_four_cameras_of_a_car() -> None:
    """Two colour and two grey cameras at 10 Hz: 298 Mbit/s."""
    cameras_bps = (2 * IMAGE_BYTES + 2 * 465_800) * 8 * 10
    enough = {name for name, known in LINKS.items() if known.rate_up_bps is None or known.rate_up_bps > cameras_bps}
    assert enough == {"ideal", "ethernet_1g", "wifi"}


@pytest.mark.parametrize("name", LINKS)
def test_a_link_by_name_is_written_as_its_name(name: str) -> None:
    assert link(name) == LINKS[name]
    assert Network(link=LINKS[name]).model_dump(mode="json", by_alias=True) == {"link": name}


def test_an_own_link_is_like_another_but_for_what_it_says() -> None:
    worse = link({"like": "wifi", "loss": 0.01, "outages": [["5 s", "8 s"]]})
    assert worse.rate_up_bps == LINKS["wifi"].rate_up_bps
    assert worse.loss == 0.01
    assert worse.outages_ns == ((5_000_000_000, 8_000_000_000),)
    assert link({"delay": "5 ms"}).rate_up_bps == LINKS["ethernet_1g"].rate_up_bps
    assert link({"rate_up": None}).rate_up_bps is None
    written = Network(link=worse).model_dump(mode="json", by_alias=True)["link"]
    assert link(written) == worse


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("wfi", "x.yaml: link: unknown link 'wfi' (did you mean 'wifi'?); known: " + ", ".join(sorted(LINKS))),
        (
            {"like": "5g"},
            "x.yaml: link.like: unknown link '5g' (did you mean 'nr5g'?); known: " + ", ".join(sorted(LINKS)),
        ),
        ({"like": [1]}, "x.yaml: link.like: unknown link [1]; known: " + ", ".join(sorted(LINKS))),
        ({"losss": 0.1}, "x.yaml: link.losss: unknown field; did you mean 'loss'?"),
        ({"loss": 1.5}, "x.yaml: link.loss: must be at most 1.0, not 1.5"),
        ({"loss": "1 %"}, "x.yaml: link.loss: must be a number, not '1 %'"),
        ({"rate_up": "0 bit/s"}, "x.yaml: link.rate_up: must be more than zero, but is '0 bit/s'"),
        ({"rate_down": "-1 Gbit/s"}, "x.yaml: link.rate_down: must be more than zero, but is '-1 Gbit/s'"),
        (
            {"rate_up": "1 GB/s"},
            "x.yaml: link.rate_up: rate '1 GB/s' has an unknown unit 'GB/s'; known: bit/s, kbit/s, Mbit/s, Gbit/s",
        ),
        ({"delay": "-1 ms"}, "x.yaml: link.delay: must not be negative, but is '-1 ms'"),
        ({"mtu_payload": "0 B"}, "x.yaml: link.mtu_payload: must be more than zero, but is '0 B'"),
        (
            {"outages": [["8 s", "5 s"]]},
            "x.yaml: link.outages[0]: must be [begin, end], begin before end, not before the last outage ends",
        ),
        (
            {"outages": [["1 s", "5 s"], ["4 s", "6 s"]]},
            "x.yaml: link.outages[1]: must be [begin, end], begin before end, not before the last outage ends",
        ),
        ({"outages": [["8 s"]]}, "x.yaml: link.outages[0][1]: missing"),
        ({"outages": "5 s"}, "x.yaml: link.outages: must be a list, not '5 s'"),
        (5, "x.yaml: link: must be a mapping, not 5"),
    ],
)
def test_mistakes_in_a_link(value: object, message: str) -> None:
    with pytest.raises(UserError) as error:
        link(value)
    assert str(error.value) == message
