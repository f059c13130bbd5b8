"""The wire, and a radio of the tests' own."""

from __future__ import annotations

from typing import Any

import pytest

from genie_sim.base.errors import UserError
from genie_sim.runs.folder import run_in_memory
from genie_sim.sim.link_model import LINK, LINK_MODELS
from tests.conformance import small
from tests.conformance.link_models import LinkModelConformance, LoneLinkConformance

RADIO = "tests.conformance.own:Radio"
FULL = {
    "model": "wire",
    "rate_up": "50 Mbit/s",
    "rate_down": None,
    "delay": "3 ms",
    "jitter": "9 ms",
    "loss": 0.1,
}

BURSTS = {"like": "ethernet_100m", "loss": {"mean": 0.01, "burst": 50}}


def test_every_shipped_model_is_tested_here():
    assert set(LINK_MODELS) == {"wire", "trace", "cell"}


@pytest.mark.parametrize("link", [FULL, BURSTS])
class TestWire(LoneLinkConformance):
    pass


@pytest.mark.parametrize(
    "link", [{"model": "tests.conformance.own:OneAtATime", "rate": "1 Gbit/s"}]
)
class TestOneAtATime(LinkModelConformance):
    pass


@pytest.mark.parametrize(
    "link",
    [
        {"model": RADIO, "slot_ms": 0.5, "fails": 3},
        {"model": "tests.conformance.own:CountingRadio", "slot_ms": 0.5, "fails": 3},
    ],
)
class TestRadio(LoneLinkConformance):
    pass


def test_a_radio_of_ones_own_carries_the_frames():
    """A slot each millisecond: what arrives left at the end of a slot."""
    radio = {"model": RADIO, "slot_ms": 1.0, "slot": "200 kB"}
    setting = small.scenario(["remote"], cars=[small.car(1, link=radio), small.car(2)])
    made: Any = LINK.make(setting.cars[0].link)
    assert (made.slot_ms, made.slot_bytes) == (1.0, 200_000)
    rows = small.frames(setting).query("car == 'car1'")
    assert rows["first_answer_ns"].notna().any()
    assert f"link model {RADIO}" in setting.own_code_digests()
    failing = small.scenario(
        ["remote"], cars=[small.car(1, link={**radio, "fails": 1}), small.car(2)]
    )
    rows = small.frames(failing).query("car == 'car1'")
    assert (rows["drop"] == "car1->edge1").all(), "every one of them is lost"


@pytest.mark.parametrize(
    ("link", "message"),
    [
        ({"model": "wifi"}, r"cars\[0\].link.model: .*; 'wifi' is a link: like: wifi"),
        ({"model": "wre"}, r"cars\[0\].link.*unknown link model 'wre' \(did you mean 'wire'\?\)"),
        (
            {"model": "wire", "rate_up": "1 Mbit/s", "dely": "1 ms"},
            r"cars\[0\].link.dely: unknown parameter of wire",
        ),
        ({"like": "lte", "loss": 1.5}, r"cars\[0\].link.*loss: must be from 0 to 1, not 1.5"),
        (
            {"model": RADIO, "slot_ms": -1.0},
            f"link model '{RADIO}': .*slot_ms: must be more than zero",
        ),
        ({"model": RADIO}, r"cars\[0\].link.slot_ms: missing"),
        (
            {"model": "tests.conformance.own:NoTransmitter"},
            r"own:NoTransmitter.: transmitter\(\) is None, but must be a Transmitter",
        ),
        ({"model": "tests.conformance.own:Again"}, "has no transmitter"),
        ({"model": "tests.conformance.own:Nobody"}, "has no attribute 'Nobody'"),
    ],
)
def test_a_link_that_does_not_work_is_one_line(link, message: str):
    with pytest.raises(UserError, match=message) as error:
        run_in_memory(small.scenario(["remote"], cars=[small.car(1, link=link), small.car(2)]))
    assert "\n" not in str(error.value)
