"""What processes that simulate one run tell each other, and what each makes of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pytest

from genie_sim.messages import Detections, Expired, Header, ImageLookup
from genie_sim.sim.clock import Clock
from genie_sim.sim.link_models import LinkEnds
from genie_sim.sim.share import EDGES, OrderUnknown, Parcel, Share, Verdict

HERE, THERE = Header(1, "camera", "car1"), Header(2, "camera", "car2")
OWNERS = {"car1": EDGES, "car2": 1, "car3": 2}
UP = LinkEnds("car2->edge", "car2", "edge", up=True)
DOWN = LinkEnds("edge->car2", "car2", "edge", up=False)
PORT = LinkEnds("edge->edges", None, "edge", up=True)
NOTHING = Verdict(is_idle=False, has_ties=False)


class Told:
    """An exchange that notes what is swapped, and in which the others have said all already."""

    def __init__(self, *told: Mapping[int, Any], verdict: Verdict = NOTHING) -> None:
        self.swapped: list[tuple[dict[int, Any], Verdict]] = []
        self._told = list(told)
        self._verdict = verdict

    def swap(
        self, parcels: Mapping[int, Any], verdict: Verdict
    ) -> tuple[Mapping[int, Any], Verdict]:
        copies = {
            number: Parcel(*map(list, parcel)) if isinstance(parcel, Parcel) else parcel
            for number, parcel in parcels.items()
        }
        self.swapped.append((copies, verdict))
        return self._told.pop(0) if self._told else {}, self._verdict


class Noted:
    """A monitor that notes what it hears."""

    wants_changes = wants_paths = False
    samples = "none"

    def __init__(self) -> None:
        self.heard: list[tuple[Any, ...]] = []

    def dropped(self, message: Any, where: str) -> None:
        self.heard.append(("dropped", message.header, where))

    def observe(self, placement: str, node: str, record: Any, now_ns: int) -> None:
        self.heard.append(("observed", node, record, now_ns))

    def carried(self, column: str, message: Any) -> None:
        self.heard.append((column, message.header, message.size_bytes))

    published = received = answered = sample = used = failed = attacked = close = dropped


class Bridge:
    """Notes what arrives, and when."""

    def __init__(self, clock: Clock) -> None:
        self.clock = clock
        self.arrived: list[tuple[Any, ...]] = []

    def arrive(self, *arguments: Any) -> None:
        self.arrived.append((self.clock.now, *arguments))


def begun(number: int, exchange: Told) -> tuple[Share, Any, Noted, Clock]:
    """A share, what observes it, what hears that, and the clock."""
    share = Share(number, OWNERS, 10, exchange)
    clock, noted = Clock(), Noted()
    return share, share.observe(clock, noted), noted, clock


def test_a_share_has_its_cars_and_one_has_the_edges():
    edges, other = (Share(number, OWNERS, 10, Told()) for number in (EDGES, 1))
    assert edges.has_edges and not other.has_edges
    hosts = ("edge", "car1", "car2", "car3")
    assert [edges.has(host) for host in hosts] == [True, True, False, False]
    assert [other.has(host) for host in hosts] == [False, False, True, False]
    links = (UP, DOWN, PORT)
    assert [edges.sends(ends) for ends in links] == [False, True, True]
    assert [edges.receives(ends) for ends in links] == [True, False, True]
    assert [other.sends(ends) for ends in links] == [True, False, False]
    assert [other.receives(ends) for ends in links] == [False, True, False]


def test_a_message_goes_to_the_process_of_its_receiver_with_all_that_its_bridge_needs():
    """The window's messages go once; they come at their instants, and in the order in which they
    were sent.
    """
    exchange = Told()
    share, _, _, clock = begun(EDGES, exchange)
    clock.run(until=4)
    answer = Detections(THERE, (), "cache", "edge/genie")
    share.carry(DOWN, 25, (answer, "edge/genie", 3))
    share.exchange(is_idle=False)
    share.exchange(is_idle=False)
    (parcels, _), (later, _) = exchange.swapped
    assert list(parcels) == [1, 2] and not parcels[2].crossings
    assert not any(later[1])

    other, _, _, there = begun(1, Told({EDGES: parcels[1]}))
    bridge = Bridge(there)
    other.expect(DOWN.name, bridge)  # type: ignore[arg-type]
    there.run(until=10)
    other.exchange(is_idle=False)
    there.run(until=25)
    assert not bridge.arrived
    there.run(until=26)
    assert bridge.arrived == [(25, answer, "edge/genie", 3)]
    assert there.scheduled_ns == 4


def test_losses_are_heard_by_the_process_of_the_car_in_the_order_in_which_they_happened():
    exchange = Told()
    share, monitor, noted, clock = begun(EDGES, exchange)
    expired = Expired(THERE)
    clock.after(3, monitor.dropped, (Detections(THERE, ()), "edge:queue"))
    clock.after(7, monitor.observe, ("edge", "edge/genie", expired, 7))
    clock.after(5, monitor.dropped, (Detections(HERE, ()), "mine"))
    lookup = ImageLookup(THERE, "hit", "client", 1)
    monitor.observe("edge", "edge/genie", lookup, 0)  # which concerns no frame's row
    clock.run(until=10)
    assert noted.heard == [("observed", "edge/genie", lookup, 0)]
    share.exchange(is_idle=False)
    assert noted.heard[1:] == [("dropped", HERE, "mine")]
    ((parcels, _),) = exchange.swapped

    other, monitor, noted, clock = begun(1, Told({EDGES: parcels[1]}))
    clock.after(5, monitor.dropped, (Detections(THERE, ()), "car:queue"))
    clock.run(until=10)
    other.exchange(is_idle=False)
    assert noted.heard == [
        ("dropped", THERE, "edge:queue"),
        ("dropped", THERE, "car:queue"),
        ("observed", "edge/genie", expired, 7),
    ]


def test_what_is_carried_to_a_car_elsewhere_counts_there():
    exchange = Told()
    share, monitor, noted, _ = begun(EDGES, exchange)
    for header in (THERE, HERE, THERE):
        monitor.carried("bytes_down", Detections(header, ()))
    size_bytes = Detections(HERE, ()).size_bytes
    assert noted.heard == [("bytes_down", HERE, size_bytes)]
    share.exchange(is_idle=False)
    other, _, noted, _ = begun(1, Told({EDGES: exchange.swapped[0][0][1]}))
    other.exchange(is_idle=False)
    assert noted.heard == 2 * [("bytes_down", THERE, size_bytes)]
    assert other.carried_bytes("car2") == 2 * size_bytes and other.carried_bytes("car3") == 0


def test_the_use_of_an_interface_is_known_when_both_ends_have_told():
    """Sending from 1 to 5 and receiving from 3 to 8, then nothing, with 4 ns awake after it."""
    exchange = Told()
    share, _, _, _ = begun(EDGES, exchange)
    receiving = share.interface("car2", 4)
    receiving.begin(3)
    receiving.end(8)
    receiving.begin(20)
    share.exchange(is_idle=False)
    other, _, _, _ = begun(1, Told({EDGES: exchange.swapped[0][0][1]}))
    sending = other.interface("car2", 4)
    sending.begin(1)
    sending.end(5)
    other.exchange(is_idle=False)
    assert sending.transfer_ns(22) == 7 + 2 and sending.tail_ns == 4


@pytest.mark.parametrize("number", [EDGES, 1])
def test_all_agree_on_the_latest_instant(number: int):
    """First the one with the edges hears it, then all do."""
    exchange = Told({0: 5, 1: 5}, {0: 9, 1: 5})
    assert Share(number, OWNERS, 10, exchange).latest(7) == 9
    first, second = (parcels for parcels, _ in exchange.swapped)
    assert set(first.values()) == {7} and set(second.values()) == {7}


def test_nothing_is_over_while_a_message_is_on_its_way():
    exchange = Told()
    share, _, _, _ = begun(EDGES, exchange)
    share.exchange(is_idle=True)
    share.carry(DOWN, 25, (Detections(THERE, ()), "edge/genie", 1))
    share.exchange(is_idle=True)
    assert [verdict.is_idle for _, verdict in exchange.swapped] == [True, False]


def test_a_verdict_is_that_of_all():
    is_over = Told(verdict=Verdict(is_idle=True, has_ties=False))
    assert begun(1, is_over)[0].exchange(is_idle=True)
    assert not begun(1, Told())[0].exchange(is_idle=True)
    with pytest.raises(OrderUnknown):
        begun(1, Told(verdict=Verdict(is_idle=True, has_ties=True)))[0].exchange(is_idle=True)


def test_ties_are_told():
    exchange = Told()
    share, _, _, clock = begun(1, exchange)
    clock.has_ties = True
    share.exchange(is_idle=False)
    assert exchange.swapped[0][1].has_ties
