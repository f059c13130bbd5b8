"""The broadcast medium against theory: carrier sense, backoff, hidden terminals, busy ratio."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
import pytest
from sidelink import IDLE_NS, SLOT_NS, WINDOW, Sidelink, Station

from genie_sim.base.seeds import Draws, stream
from genie_sim.sim.clock import Clock, Steps
from genie_sim.sim.link_model import LinkEnds

SEED, S, US = 7, 1_000_000_000, 1_000
SIZE = 300  # bytes: 488 us on the air
SIDELINK = Sidelink(range_m=300.0)
HIDDEN = {"left": 0.0, "middle": 200.0, "right": 400.0}  # both hear the middle, not each other
HIDDEN_SENDERS = ("left", "right")


class Sent(NamedTuple):
    """A message: who sent it, when it was on the air [ns], and who received it."""

    host: str
    begin_ns: int
    end_ns: int
    heard_by: tuple[str, ...]


@dataclass
class Street:
    """The air of these tests: hosts that stand along a street, and what they have sent."""

    places: Mapping[str, float]  # east [m], by the host
    sidelink: Sidelink = field(default_factory=lambda: SIDELINK)
    seed: int = SEED
    clock: Clock = field(default_factory=Clock)
    edges: tuple[str, ...] = ()
    sent: list[Sent] = field(default_factory=list)

    def __post_init__(self):
        sidelink = replace(self.sidelink)
        self.stations: dict[str, Station] = {
            host: sidelink.transmitter(self, LinkEnds(host, host, host, up=True))
            for host in self.places
        }

    def draws(self, *names):
        return Draws(self.seed, *names)

    def place(self, host):
        return self.places[host], 0.0

    def add_resource(self, resource):
        pass

    def offer(self, host: str, at_ns: Iterable[int], size_bytes: int = SIZE) -> None:
        """The host gets messages to send at these instants; they wait in order."""
        self.clock.process(self._send(host, at_ns, size_bytes))

    def run(self) -> list[Sent]:
        self.clock.run()
        return sorted(self.sent)

    def _send(self, host: str, at_ns: Iterable[int], size_bytes: int) -> Steps:
        station = self.stations[host]
        airtime_ns = self.sidelink.airtime_ns(size_bytes)
        for one_ns in at_ns:
            if one_ns > self.clock.now:
                yield self.clock.timeout(one_ns - self.clock.now)
            station.random.begin(None, "")
            yield station.transmit(size_bytes)
            now_ns = self.clock.now
            self.sent.append(Sent(host, now_ns - airtime_ns, now_ns, station.heard_by))


def cluster(count: int) -> dict[str, float]:
    """So many hosts, all of which hear each other."""
    return {f"car{number}": float(number) for number in range(count)}


def poisson_ns(rng: np.random.Generator, rate_hz: float, count: int) -> list[int]:
    return [int(at) for at in np.cumsum(rng.exponential(S / rate_hz, count))]


@dataclass
class Slots:
    """Random numbers of a station that draw these backoffs."""

    slots: Sequence[int]

    def __post_init__(self):
        self._next = iter(self.slots)

    def begin(self, message, host):
        pass

    def integers(self, high):
        assert high == WINDOW + 1
        return next(self._next)


def by_hand(
    places: Mapping[str, float], backoffs: Mapping[str, Sequence[int]], at_ns: Mapping[str, int]
) -> list[Sent]:
    """What is sent if the hosts draw these backoffs, each for messages that come at once."""
    street = Street(places)
    for host, slots in backoffs.items():
        street.stations[host].random = Slots(slots)
        street.offer(host, [at_ns.get(host, 0)] * len(slots))
    return street.run()


AIRTIME_NS = SIDELINK.airtime_ns(SIZE)


def test_the_airtime_is_preamble_and_symbols():
    """338 bytes and 22 bits are 57 symbols of 48 bits, each 8 us, after 40 us."""
    assert AIRTIME_NS == 496 * US


def test_a_backoff_goes_on_where_it_was_interrupted():
    """Three slots and five: the second waits for the first, for AIFS, and for the two left."""
    first, second = by_hand(cluster(2), {"car0": [3], "car1": [5]}, {})
    assert (first.begin_ns, first.heard_by) == (IDLE_NS + 3 * SLOT_NS, ("car1",))
    assert second.begin_ns == first.end_ns + IDLE_NS + 2 * SLOT_NS


def test_a_part_of_a_slot_does_not_count():
    """The second hears the first 2.5 slots after its AIFS: it has two of its five behind it."""
    first, second = by_hand(cluster(2), {"car0": [0], "car1": [5]}, {"car0": 5 * SLOT_NS // 2})
    assert second.begin_ns == first.end_ns + IDLE_NS + 3 * SLOT_NS


def test_who_hears_a_message_within_aifs_has_all_slots_before_it():
    first, second = by_hand(cluster(2), {"car0": [0], "car1": [5]}, {"car1": IDLE_NS // 2})
    assert second.begin_ns == first.end_ns + IDLE_NS + 5 * SLOT_NS


def test_equal_backoffs_collide_and_nobody_hears_anything():
    """A sender does not hear the other, a third host hears neither; what follows is heard."""
    sent = by_hand(cluster(3), {"car0": [4, 2], "car1": [4, 9]}, {})
    assert [one.heard_by for one in sorted(sent, key=lambda one: one.begin_ns)] == [
        (),
        (),
        ("car1", "car2"),
        ("car0", "car2"),
    ]


def test_hidden_messages_collide_that_overlap_by_a_nanosecond():
    """Left and right do not hear each other; the middle loses both if they overlap at all, and
    sends itself only when neither does.
    """
    left, middle, right = by_hand(
        HIDDEN, {"left": [0], "middle": [0], "right": [0]}, {"right": AIRTIME_NS - 1, "middle": 1}
    )
    assert left.end_ns - right.begin_ns == 1
    assert left.heard_by == right.heard_by == ()
    assert middle.begin_ns == right.end_ns + IDLE_NS
    assert middle.heard_by == ("left", "right")


@pytest.mark.parametrize(("down_ns", "on_air"), [(IDLE_NS // 2, False), (IDLE_NS + 3 * US, True)])
def test_who_goes_down_is_heard_by_nobody(down_ns: int, on_air: bool):
    """If it waits, it does not begin; what it has begun keeps the channel busy, for nothing."""
    street = Street(cluster(3))
    for host, slots in (("car0", 0), ("car1", 5)):
        street.stations[host].random = Slots([slots])
        street.offer(host, [0])
    street.clock.after(down_ns, street.stations["car0"].set_available, (False,))
    heard_by = {one.host: one.heard_by for one in street.run()}
    assert heard_by == {"car0": (), "car1": ("car0", "car2")}
    listener = street.stations["car2"]
    assert (listener.completed, listener.drops) == (1, int(on_air))
    assert listener.busy_ns == (1 + on_air) * AIRTIME_NS


@pytest.mark.parametrize("order", list(itertools.permutations(HIDDEN)))
def test_messages_that_touch_do_not_collide(order: Sequence[str]):
    """The one begins at the instant at which the other ends, whoever is first in the scenario."""
    places = {host: HIDDEN[host] for host in order}
    backoffs = {host: [0] for host in order if host != "middle"}
    left, right = by_hand(places, backoffs, {"right": AIRTIME_NS})
    assert right.begin_ns == left.end_ns
    assert left.heard_by == right.heard_by == ("middle",)


def crowd(count: int, rate_hz: float, each: int) -> Street:
    """Hosts that all hear each other, each with Poisson messages."""
    street = Street(cluster(count))
    for number in range(count):
        rng = stream(SEED, "arrivals", number)
        street.offer(f"car{number}", poisson_ns(rng, rate_hz, each))
    street.run()
    return street


def test_counts_of_receptions_are_those_of_the_messages():
    street = crowd(6, 300, 50)
    for host, station in street.stations.items():
        others = [one for one in street.sent if one.host != host]
        assert station.completed == sum(host in one.heard_by for one in others)
        assert station.completed + station.drops == len(others)
        assert station.queued == 0


@pytest.mark.slow
@pytest.mark.nightly
def test_each_reception_is_lost_by_itself():
    """A lone sender and four hosts: 20 % of the receptions are lost, and of two hosts both lose 4 %
    of the messages.
    """
    street = Street(cluster(5), replace(SIDELINK, loss=0.2))
    street.offer("car0", [number * S // 100 for number in range(3000)])
    lost = np.array([[f"car{i}" not in one.heard_by for i in range(1, 5)] for one in street.run()])
    assert lost.mean() == pytest.approx(0.2, abs=3 * math.sqrt(0.16 / lost.size))
    both = np.mean([lost[:, i] & lost[:, j] for i, j in itertools.combinations(range(4), 2)])
    assert both == pytest.approx(0.04, abs=0.006)


def test_the_order_of_hosts_changes_nothing():
    """Hosts in a row of which each hears its neighbours only, all with messages at the same
    instants: what each sends, when, and who receives it depends on no order.
    """

    def found(hosts: Sequence[str]) -> list[tuple[str, int, int, set[str]]]:
        street = Street({host: 200.0 * int(host[3:]) for host in hosts}, seed=3)
        for host in hosts:
            street.offer(host, [number * S // 200 for number in range(100)])
        return [(*one[:3], set(one.heard_by)) for one in street.run()]

    hosts = [f"car{number}" for number in range(8)]
    expected = found(hosts)
    assert any(not heard_by for *_, heard_by in expected)
    for seed in range(3):
        assert found(list(stream(seed, "order").permutation(hosts))) == expected
