"""What a host broadcasts reaches those in range, and nobody else."""

from __future__ import annotations

from typing import Any

import pytest
from sidelink import Sidelink, connect

from genie_sim.base.errors import UserError
from genie_sim.core.messages import Detections, Image, Message, Publish
from genie_sim.sim.method import IMAGES, OBJECTS, HostConfig, HostContext, Interceptor, Method
from genie_sim.sim.network import Network
from genie_sim.sim.world import World
from tests.make import build, scenario, street

TOLD = "/told"
HEARD: dict[str, list[tuple[int, str]]] = {}  # by the host: when it heard of whose frames
TWO = [{"name": f"car{i}", "device": "jetson_tx2", "edge": "edge1"} for i in (1, 2)]
METHODS = [{"method": f"{__name__}:Telling"}]


class Telling(Method):
    """A car with a frame tells all others of it; nobody detects anything."""

    title = "telling"
    sidelink = Sidelink()

    def on_car(self, host: HostContext) -> HostConfig:
        return HostConfig(interceptor=lambda *_: Teller(host.name))

    def on_edge(self, host: HostContext) -> HostConfig:
        return HostConfig(detector=True, interceptor=lambda *_: Teller(host.name))

    def wire(self, network: Network) -> None:
        connect(network, [*network.edges, *network.cars], (TOLD,), self.sidelink)


class Near(Telling):
    sidelink = Sidelink(range_m=1.0)


class Lossy(Telling):
    sidelink = Sidelink(loss=1.0)


class Teller(Interceptor):
    def __init__(self, host: str) -> None:
        self.name = f"{host}/teller"
        self._heard = HEARD.setdefault(host, [])

    def subscriptions(self) -> tuple[str, ...]:
        return IMAGES, TOLD

    def publications(self) -> tuple[str, ...]:
        return OBJECTS, TOLD, f"{IMAGES}-local"

    def on_message(
        self, topic: str, message: Message, now_ns: int, sender: str | None = None
    ) -> list[Any]:
        if topic == TOLD:
            self._heard.append((message.header.stamp_ns, message.header.origin))
            return []
        assert isinstance(message, Image)
        return [Publish(TOLD, Detections(message.header, ()))]


class Empty(Telling):
    """It tells nothing, in no bytes."""

    def on_car(self, host: HostContext) -> HostConfig:
        return HostConfig(interceptor=lambda *_: EmptyTeller(host.name))


class EmptyTeller(Teller):
    def on_message(
        self, topic: str, message: Message, now_ns: int, sender: str | None = None
    ) -> list[Any]:
        nothing = Image(message.header, 0, "", 0, None, 0.0)  # type: ignore[arg-type]
        return [Publish(TOLD, nothing)] if topic == IMAGES else []


def ran(cars: list[dict[str, Any]] = TWO, method: str = "Telling", **settings: Any) -> World:
    """The world of a run of two cars and an edge, one camera each."""
    HEARD.clear()
    usual = {
        "methods": [{"method": f"{__name__}:{method}"}],
        "cameras": [{"name": "camera", "recording": "02"}],
    }
    setting = scenario(cars, **usual | settings)
    world, _ = build(setting, setting.methods[0].name, street(seconds=1.0))
    world.run()
    return world


def origins(host: str) -> set[str]:
    return {origin for _, origin in HEARD[host]}


def test_every_car_in_range_hears_every_other_and_not_itself():
    world = ran()
    assert origins("car1") == {"car2"} and origins("car2") == {"car1"}
    assert len(HEARD["car1"]) == len(HEARD["car2"]) == 10
    assert HEARD["edge1"] == [], "an edge without a place hears nothing"
    channel = next(one for one in world.network.resources if one.name == "car1/channel")
    link = world.network.links["car1->*"]
    assert (channel.completed, channel.drops, link.completed, link.drops) == (10, 0, 10, 0)
    airtime_ns = 40_000 + 12 * 8_000  # (26 + 38) bytes and 22 bits are 12 symbols of 48 bits
    assert channel.busy_ns == 20 * airtime_ns, "of its own messages and the other's"


def test_a_car_out_of_range_hears_nothing():
    late = [TWO[0], {**TWO[1], "route": {"start": "0.5 s"}}]
    ran(late, "Near", start_jitter="0 s")
    assert max(stamp_ns for stamp_ns, _ in HEARD["car2"]) <= 200_000_000, "1 m ahead by then"
    assert min(stamp_ns for stamp_ns, _ in HEARD["car1"]) == 1_200_000_000, "it has come up to it"


def test_an_edge_with_a_place_hears_those_that_pass():
    edges = [{"name": "edge1", "device": "agx_xavier", "at": ["0 m", "10 m"]}]
    ran(edges=edges)
    assert origins("edge1") == {"car1", "car2"}


@pytest.mark.parametrize("target", ["car1", "car1->*"])
def test_an_outage_silences_a_car_and_makes_it_deaf(target: str):
    faults = [{"fault": "outage", "target": target, "begin": "0.5 s"}]
    world = ran(faults=faults, start_jitter="0 s")
    times = {host: [t_ns for t_ns, _ in HEARD[host]] for host in ("car1", "car2")}
    assert max(times["car1"]) < 500_000_000 and max(times["car2"]) < 500_000_000
    assert world.network.links["car1->*"].drops == 10, "five sent, five not heard"


def test_a_fault_at_a_border_loses_what_is_broadcast():
    faults = [{"fault": "partition", "target": ["car1"], "begin": "0 s"}]
    ran(faults=faults)
    assert HEARD["car1"] == HEARD["car2"] == []


@pytest.mark.parametrize(
    ("settings", "text"),
    [
        ({"method": "Empty"}, "car1->*: a message of 0 bytes; it must have some"),
    ],
)
def test_what_cannot_be_is_told_in_one_line(settings: dict[str, Any], text: str):
    with pytest.raises(UserError) as told:
        ran(**settings)
    assert text in str(told.value) and "\n" not in str(told.value)


def test_what_is_lost_on_the_air_is_no_loss_of_a_frame():
    """Nobody answers here, so nothing else is dropped."""
    world = ran(method="Lossy")
    assert HEARD["car1"] == []
    channel = next(one for one in world.network.resources if one.name == "car1/channel")
    assert (channel.completed, channel.drops) == (0, 10)
