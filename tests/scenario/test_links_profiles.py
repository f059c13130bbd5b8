"""Link profiles: what a message takes on the wire, and links of a scenario's own."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

import pytest

from genie_sim.base import settings
from genie_sim.base.plugins import Choice
from genie_sim.base.settings import plain_data
from genie_sim.links.presets import LINKS
from genie_sim.links.wire import Wire
from genie_sim.sim.link_model import LINK

IMAGE_BYTES = 1_397_297


@dataclass(frozen=True)
class Network:
    link: Annotated[Choice, LINK]


def read(value: object) -> Choice:
    return settings.read(Network, {"link": value}, lambda _: "x.yaml").link


def link(value: object) -> Wire:
    """The wire that is written so."""
    made = LINK.make(read(value))
    assert isinstance(made, Wire)
    return made


def test_only_a_wire_carries_the_four_cameras_of_a_car() -> None:
    """Two colour and two grey cameras at 10 Hz: 298 Mbit/s."""
    cameras_bps = (2 * IMAGE_BYTES + 2 * 465_800) * 8 * 10
    rates = {name: link(name).rate_up_bps for name in LINKS}
    enough = {
        name for name, rate_bps in rates.items() if rate_bps is None or rate_bps > cameras_bps
    }
    assert enough == {"ideal", "ethernet_1g", "wifi"}


@pytest.mark.parametrize("name", LINKS)
def test_a_link_by_name_is_written_as_its_name(name: str) -> None:
    assert read(name) == LINKS[name]
    assert plain_data(Network(link=LINKS[name])) == {"link": name}


def test_an_own_link_is_like_another_but_for_what_it_says() -> None:
    worse = read({"like": "wifi", "loss": 0.01})
    assert LINK.make(worse) == replace(link("wifi"), loss=0.01)
    assert link({"delay": "5 ms"}).rate_up_bps == link("ethernet_1g").rate_up_bps
    assert link({"rate_up": None}).rate_up_bps is None
    written = plain_data(Network(link=worse))["link"]
    assert read(written) == worse


def test_a_link_may_have_a_model_of_the_users_own() -> None:
    own = read({"model": "my.code:Tunnel", "length_m": 300})
    assert own == Choice("my.code:Tunnel", {"length_m": 300})
    written = plain_data(Network(link=own))["link"]
    assert read(written) == own
    assert read({"model": "wire", "like": "wifi"}) == read({"like": "wifi"}) == LINKS["wifi"]
