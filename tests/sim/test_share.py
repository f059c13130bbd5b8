"""What processes that simulate one run tell each other, and what each makes of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pytest

from genie_sim.messages import Detections, Expired, Header, ImageLookup
from genie_sim.sim.clock import Clock
from genie_sim.sim.link_models import LinkEnds
from genie_sim.sim.share import EDGES, WINDOWS, OrderUnknown, Parcel, Share

HERE, THERE = Header(1, "camera", "car1"), Header(2, "camera", "car2")
OWNERS = {"car1": EDGES, "car2": 1, "car3": 2}
UP = LinkEnds("car2->edge", "car2", "edge", up=True)
DOWN = LinkEnds("edge->car2", "car2", "edge", up=False)
PORT = LinkEnds("edge->edges", None, "edge", up=True)


class Told:
    """An exchange that notes what is given, and in which the others have told all already."""

    def __init__(self, *told: Mapping[int, Any]) -> None:
        self.given: list[dict[int, Any]] = []
        self.taken = 0
        self._told = told

    def give(self, parcels: Mapping[int, Any]) -> None:
        copies = {
            number: Parcel(*map(list, parcel)) if isinstance(parcel, Parcel) else parcel
            for number, parcel in parcels.items()
        }
        self.given.append(copies)

    def take(self) -> Mapping[int, Any]:
        self.taken += 1
        return self._told[self.taken - 1] if self.taken <= len(self._told) else {}


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
    share = Share(number, OWNERS, WINDOWS * 10, exchange)
    clock, noted = Clock(), Noted()
    return share, share.observe(clock, noted), noted, clock


def over(share: Share) -> None:
    """A window ends, and the others have told theirs."""
    share.end_window()
    share.catch_up()


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
    over(share)
    over(share)
    parcels, later = exchange.given
    assert list(parcels) == [1, 2] and not parcels[2].crossings
    assert not any(later[1])

    other, _, _, there = begun(1, Told({EDGES: parcels[1]}))
    bridge = Bridge(there)
    other.expect(DOWN.name, bridge)  # type: ignore[arg-type]
    there.run(until=10)
    over(other)
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
    over(share)
    assert noted.heard[1:] == [("dropped", HERE, "mine")]
    (parcels,) = exchange.given

    other, monitor, noted, clock = begun(1, Told({EDGES: parcels[1]}))
    clock.after(5, monitor.dropped, (Detections(THERE, ()), "car:queue"))
    clock.run(until=10)
    over(other)
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
    over(share)
    other, _, noted, _ = begun(1, Told({EDGES: exchange.given[0][1]}))
    over(other)
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
    over(share)
    other, _, _, _ = begun(1, Told({EDGES: exchange.given[0][1]}))
    sending = other.interface("car2", 4)
    sending.begin(1)
    sending.end(5)
    over(other)
    assert sending.transfer_ns(22) == 7 + 2 and sending.tail_ns == 4


@pytest.mark.parametrize("number", [EDGES, 1])
def test_all_agree_on_the_latest_instant(number: int):
    """First the one with the edges hears it, then all do."""
    exchange = Told({2: 5}, {2: 9})
    assert Share(number, OWNERS, 40, exchange).latest(7) == 9
    first, second = exchange.given
    assert set(first.values()) == {7} and set(second.values()) == {7}


@pytest.mark.parametrize(
    ("here", "told", "all_do"),
    [(True, [True, True], True), (True, [True, False], False), (False, [True, True], False)],
)
def test_nothing_is_over_before_all_say_so(here: bool, told: list[bool], all_do: bool):
    exchange = Told(*({EDGES: says} for says in told))
    assert Share(1, OWNERS, 40, exchange).all_say(here) is all_do
    assert set(exchange.given[1].values()) == {here and told[0]}


def test_a_process_waits_only_for_what_it_must_know():
    """What others did less than a delay ago cannot have arrived."""
    exchange = Told()
    share, _, _, _ = begun(EDGES, exchange)
    assert share.window_ns == 10
    taken = []
    for _ in range(WINDOWS + 2):
        share.end_window()
        taken.append(exchange.taken)
    assert taken == [0] * (WINDOWS - 1) + [1, 2, 3]
    share.catch_up()
    assert exchange.taken == len(exchange.given) == WINDOWS + 2


def test_what_happened_in_a_window_is_told_with_what_others_tell_of_the_same():
    told = Parcel([], [(4, 0, tuple(THERE), "edge:queue", None)], [], [])
    share, monitor, noted, clock = begun(1, Told({}, {EDGES: told}))
    clock.after(3, monitor.dropped, (Detections(THERE, ()), "car:first"))
    clock.after(13, monitor.dropped, (Detections(THERE, ()), "car:second"))
    for end_ns in (10, 20):
        clock.run(until=end_ns)
        share.end_window()
    assert noted.heard == []
    share.catch_up()
    assert [where for _, _, where in noted.heard] == ["car:first", "edge:queue", "car:second"]


def test_a_tie_ends_the_run():
    share, _, _, clock = begun(1, Told())
    clock.has_ties = True
    with pytest.raises(OrderUnknown):
        share.end_window()
