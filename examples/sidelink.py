"""Broadcasts between hosts on one channel: carrier sense, random backoff, collisions.

After IEEE 802.11p in 10 MHz, with the numbers of ETSI EN 302 663: nobody acknowledges a broadcast,
and nobody repeats it. A method connects its hosts in ``wire``:

def wire(self, network):
    connect(network, network.cars, ("/my_topic",), Sidelink(range_m=200.0))
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated

import simpy

from genie_sim.extend import (
    NS_PER_MS,
    NS_PER_S,
    Bounds,
    Graph,
    LinkEnds,
    Message,
    MessageRandom,
    Network,
    Occupancy,
    Steps,
    Subscriber,
    Transmitter,
)

MBIT = 10**6
PLACES_NS = 100 * NS_PER_MS  # how often ranges follow the places of the cars
SLOT_NS = 13_000
IDLE_NS = 110_000  # so long the channel must be idle before the backoff: best effort, AIFS
WINDOW = 15  # the most slots of the backoff: best effort, CWmin
PREAMBLE_NS = 40_000  # with the signal field
SYMBOL_NS = 8_000  # of OFDM in 10 MHz
SERVICE_AND_TAIL_BITS = 22


@dataclass
class Sidelink:
    """One channel for the broadcasts of all cars, and of edges that have a place.

    Whoever has a message waits until the channel is idle where it is, then for a random number of
    slots. Those in range receive it, unless they send at the same time or hear another message that
    overlaps with it; no message is strong enough to be received beside another.
    """

    rate_bps: Annotated[int, Bounds(above=0)] = 6 * MBIT
    """The rate of every message: the default of ETSI's control channel."""

    range_m: Annotated[float, Bounds(above=0)] = 300.0
    """How far a message is received, and the channel sensed. Assumed."""

    overhead_bytes: Annotated[int, Bounds(minimum=0)] = 38
    """Added to every message: the header of IEEE 802.11 (26), its check sequence (4), and the
    headers of the logical link (8)."""

    loss: Annotated[float, Bounds(minimum=0, maximum=1)] = 0.0
    """The share of receptions that are lost otherwise, each by itself."""

    def __post_init__(self) -> None:
        self._stations: list[Station] = []
        self._near: dict[Station, list[Station]] = {}
        self._places: list[tuple[float, float]] = []  # of the stations, in their order
        self._places_of = -1  # the tenth of a second

    def transmitter(self, network: Network, ends: LinkEnds) -> "Station":
        """The station of a host: a car, or an edge that has a place."""
        station = Station(network, ends, self)
        self._stations.append(station)
        network.add_resource(station)
        return station

    def airtime_ns(self, size_bytes: int) -> int:
        """How long a message of so many bytes keeps the channel busy [ns]."""
        bits = (size_bytes + self.overhead_bytes) * 8 + SERVICE_AND_TAIL_BITS
        symbols = -(-bits * NS_PER_S // (self.rate_bps * SYMBOL_NS))
        return PREAMBLE_NS + symbols * SYMBOL_NS

    def near(self, station: "Station") -> list["Station"]:
        """The other stations in range now. Ranges follow the places of the cars every tenth of a
        second.
        """
        tenth = station.clock.now // PLACES_NS
        if tenth != self._places_of:
            self._places_of = tenth
            self._places = [other.place() for other in self._stations]
            self._near.clear()
        near = self._near.get(station)
        if near is None:
            here = self._places[self._stations.index(station)]
            near = self._near[station] = [
                other
                for other, place in zip(self._stations, self._places, strict=True)
                if other is not station and math.dist(here, place) <= self.range_m
            ]
        return near


@dataclass(slots=True, eq=False)
class Broadcasting:
    """A message on the air: the stations in range, and those of them where something overlaps with
    it.
    """

    stations: Sequence["Station"]
    lost_at: set["Station"] = field(default_factory=set)


class Station(Transmitter):
    """A host on the channel. It sends one message at a time.

    As a resource it is the channel as the host senses it: its utilization is the channel busy
    ratio, with the host's own messages; ``completed`` counts the messages that it received,
    ``drops`` those in range that it did not.
    """

    kind = "cell"
    capacity = 1
    sent_bytes = None

    def __init__(self, network: Network, ends: LinkEnds, sidelink: Sidelink) -> None:
        super().__init__(network, ends)
        self.host = host = ends.car or ends.edge
        self.name = f"{host}/channel"
        self.completed = 0
        self.drops = 0
        self.occupancy = Occupancy(self.clock)  # of messages that are heard
        self.random = MessageRandom(network, f"{host}.broadcast")
        self.heard_by: tuple[str, ...] = ()
        self._network = network
        self._sidelink = sidelink
        self._losses = network.draws(f"{host}.broadcast", "loss")
        self._heard: dict[Broadcasting, None] = {}
        self._is_sending = False
        self._is_available = True
        self._busy_since_ns: int | None = None
        self._busy_ns = 0
        self._change: simpy.Event | None = None  # the channel gets busy or idle

    @property
    def queued(self) -> int:
        """How many messages are heard now."""
        return len(self._heard)

    @property
    def busy_ns(self) -> int:
        """How long the channel was busy until now."""
        since_ns = self._busy_since_ns
        return self._busy_ns + (0 if since_ns is None else self.clock.now - since_ns)

    def place(self) -> tuple[float, float]:
        """Where the host is now: east and north [m]."""
        if self.host not in self._network.edges:
            return self._network.place(self.host)
        site = self._network.site(self.host)
        assert site is not None, "an edge that broadcasts has a place"
        return site

    def transmit(self, size_bytes: int) -> simpy.Event:
        """Sends a message, see ``Transmitter``; then ``heard_by`` says who has received it."""
        self.heard_by = ()
        if not self._is_available:  # lost by what took it away
            return self.clock.timeout(0)
        return self.clock.process(self._send(size_bytes))

    def delay_ns(self, size_bytes: int, now_ns: int) -> int | None:
        return 0

    def set_available(self, is_available: bool) -> None:
        self._is_available = is_available

    def _send(self, size_bytes: int) -> Steps:
        """Waits for the channel, then occupies it. A backoff that another message interrupts goes
        on after it with the slots that are left.
        """
        clock, sidelink = self.clock, self._sidelink
        slots = int(self.random.integers(WINDOW + 1))
        loss_key = str(self.random.random()) if sidelink.loss else ""
        while True:
            while self._busy_since_ns is not None:
                yield self._next_change()
            idle_since_ns, wait_ns = clock.now, IDLE_NS + slots * SLOT_NS
            yield clock.timeout(wait_ns) | self._next_change()
            waited_ns = clock.now - idle_since_ns
            if waited_ns >= wait_ns:  # also if another begins in the same slot
                break
            slots -= max(waited_ns - IDLE_NS, 0) // SLOT_NS
        if not self._is_available:  # taken away while it waited
            return
        broadcasting = Broadcasting(sidelink.near(self))
        self._begin(broadcasting)
        yield clock.timeout(sidelink.airtime_ns(size_bytes))
        self._end(broadcasting, loss_key)

    def _next_change(self) -> simpy.Event:
        """Happens when the channel gets busy or idle here."""
        if self._change is None:
            self._change = self.clock.event()
        return self._change

    def _begin(self, broadcasting: Broadcasting) -> None:
        """The first bit leaves. Who sends, or hears another message too, receives none of them."""
        self._is_sending = True
        for heard in self._heard:
            heard.lost_at.add(self)
        self._sense()
        for station in broadcasting.stations:
            if station._is_sending or station._heard:
                broadcasting.lost_at.add(station)
                for other in station._heard:
                    other.lost_at.add(station)
            station._heard[broadcasting] = None
            station.occupancy.enter()
            station._sense()

    def _end(self, broadcasting: Broadcasting, loss_key: str) -> None:
        """The last bit leaves: notes who has received the message."""
        self._is_sending = False
        self._sense()
        heard_by = []
        for station in broadcasting.stations:
            del station._heard[broadcasting]
            station.occupancy.leave()
            station._sense()
            is_whole = self._is_available and station not in broadcasting.lost_at
            if is_whole and not self._is_lost(station, loss_key):
                station.completed += 1
                heard_by.append(station.host)
            else:
                station.drops += 1
        self.heard_by = tuple(heard_by)

    def _is_lost(self, station: "Station", key: str) -> bool:
        """Whether a reception is one of those that ``loss`` takes; ``key`` is the message's."""
        loss = self._sidelink.loss
        return loss > 0 and self._losses.uniform(f"{station.host}\n{key}") < loss

    def _sense(self) -> None:
        """Notes whether the channel has become busy or idle here."""
        is_busy = self._is_sending or bool(self._heard)
        if is_busy == (self._busy_since_ns is not None):
            return
        if is_busy:
            self._busy_since_ns = self.clock.now
        else:
            self._busy_ns = self.busy_ns
            self._busy_since_ns = None
        change, self._change = self._change, None
        if change is not None:
            change.succeed()


class Broadcast(Subscriber):
    """Sends what a host publishes on the ``topics`` to all hosts in range, on the same topics.

    Parameters
    ----------
    network : Network
        The hosts of the run.
    graph : Graph
        The host's graph.
    topics : tuple of str
        What it broadcasts.
    sidelink : Sidelink
        The channel.
    others : dict
        All broadcasts of the run, by host; this one is added.
    """

    def __init__(
        self,
        network: Network,
        graph: Graph,
        topics: tuple[str, ...],
        *,
        sidelink: Sidelink,
        others: "dict[str, Broadcast]",
    ) -> None:
        is_car = graph.name in network.cars
        ends = LinkEnds(f"{graph.name}->*", graph.name if is_car else None, graph.name, up=True)
        # what is lost on the way is no answer to a frame, and so no frame's loss
        self._link = network.add_link(
            ends, sidelink, part="edges", dropped=lambda message, where: None
        )
        station = self._link.transmitter
        assert isinstance(station, Station)
        self._station = station
        self.address, self.host = f"{graph.name}/broadcast", graph.name
        self._network, self._graph, self._others = network, graph, others
        others[graph.name] = self
        for topic in topics:
            graph.add_bridge(topic, self)

    def deliver(self, topic: str, message: Message, sender: str) -> None:
        """The host has published something: it waits for the medium."""
        heard_by: list[str] = []  # the hosts; ``carried`` fills it in before anything arrives
        self._link.send(
            (topic, message.header.frame_id),
            message,
            self._arrive,
            (topic, message, sender, heard_by),
            carried=lambda _: heard_by.extend(self._station.heard_by),
        )

    def _arrive(self, topic: str, message: Message, sender: str, heard_by: list[str]) -> None:
        """The message reaches the hosts that have heard it, but for those that a fault has cut
        off.
        """
        for host in heard_by:
            other = self._others[host]
            received = None if other._link.cut_by else self._across(message, host)
            if received is None:
                other._link.drops += 1
            else:
                other._graph.inject(topic, received, sender)

    def _across(self, message: Message, host: str) -> Message | None:
        """The message as it arrives at a host; ``None`` if a fault loses it."""
        border = self._network.border(self.host, host)
        left = border.leave(message)
        if isinstance(left, str):  # what it is lost by
            return None
        arrived = border.enter(left)
        return None if isinstance(arrived, str) else arrived


def connect(
    network: Network, hosts: Iterable[str], topics: tuple[str, ...], sidelink: Sidelink
) -> None:
    """Lets hosts hear each other: what one publishes on the topics reaches the others in range.
    Those on which the method runs nothing, and edges without a place, are left out.
    """
    of_run = replace(sidelink)  # its state is that of one run
    others: dict[str, Broadcast] = {}
    for host in hosts:
        is_placed = host in network.cars or network.site(host) is not None
        if host in network.graphs and is_placed:
            Broadcast(network, network.graphs[host], topics, sidelink=of_run, others=others)
