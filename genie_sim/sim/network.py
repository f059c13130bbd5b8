"""The hosts and links of a run: what is built for a scenario under one method, and what its faults
act on.
"""

from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from genie_sim.base import seeds
from genie_sim.base.contracts import class_name, require
from genie_sim.base.errors import UserError, unknown
from genie_sim.base.seeds import Draws
from genie_sim.sim.bends import Bend, Border, Sense
from genie_sim.sim.clock import Clock
from genie_sim.sim.device import Device
from genie_sim.sim.encoding import Coder, CoderRole, ImageCodec, Take
from genie_sim.sim.host import Host, Processor
from genie_sim.sim.interface import InterfaceUse
from genie_sim.sim.link import Link
from genie_sim.sim.link_model import LinkEnds, LinkModel, Transmitter
from genie_sim.sim.monitor import Monitor, Part, Resource
from genie_sim.sim.places import Place, Point
from genie_sim.sim.ros_graph import Dropped, Graph
from genie_sim.sim.settings import ALL, EDGES

if TYPE_CHECKING:
    from genie_sim.sim.connection import CarConnection


class Network:
    """The hosts of a run with their ROS graphs, the links between them, and the cars' connections
    to their edges.

    Random numbers are named after car, device and link, and belong to frames or to time, so every
    method sees the same ones.

    Parameters
    ----------
    clock : Clock
        The run's clock.
    monitor : Monitor
        Observes the run.
    seed : int
        The root of all random streams.
    host_names : collection of str
        All cars and edges, also those on which the method runs nothing.
    queue_length : int
        How many messages wait in each queue of nodes and links.
    codec : ImageCodec or None
        How images are encoded; ``None``: not at all.
    places : mapping
        Where each car is at a time [ns]: east and north [m].
    sites : mapping
        Where each edge is: east and north [m], or ``None``.
    tail_times_ns : mapping
        How long a network interface of each car stays awake after a transfer.
    """

    def __init__(
        self,
        clock: Clock,
        monitor: Monitor,
        *,
        seed: int,
        host_names: Collection[str],
        queue_length: int,
        codec: ImageCodec | None = None,
        places: Mapping[str, Place] = MappingProxyType({}),
        sites: Mapping[str, Point | None] = MappingProxyType({}),
        tail_times_ns: Mapping[str, int] = MappingProxyType({}),
    ) -> None:
        self.clock = clock
        self.monitor = monitor
        self.codec = codec
        self.resources: list[Resource] = []  # what is sampled
        self.shared: list[Resource] = []  # those of them that link models have added
        self.graphs: dict[str, Graph] = {}  # by the host
        self.links: dict[str, Link] = {}
        self.connections: dict[str, CarConnection] = {}  # by the car, each to its own edge
        self.interfaces: dict[str, list[InterfaceUse]] = defaultdict(list)  # by the car
        self._seed = seed
        self._host_names = host_names
        self._queue_length = queue_length
        self._places = places
        self._sites = sites
        self._tail_times_ns = tail_times_ns
        self._bends: dict[str, list[Bend]] = defaultdict(list)  # by the host
        self._senses: dict[str, list[tuple[Sense, str]]] = defaultdict(list)  # by the car
        self.outages: list[tuple[str, str]] = []  # targets that are cut off now, and by what
        self._streams: dict[tuple[str | int, ...], np.random.Generator] = {}

    def stream(self, *names: str | int) -> np.random.Generator:
        """The random generator of these names, one a run: its draws are the same under every
        method.
        """
        stream = self._streams.get(names)
        if stream is None:
            stream = self._streams[names] = seeds.stream(self._seed, *names)
        return stream

    def draws(self, *names: str | int) -> Draws:
        """The random numbers of these names, by key: that of a key is the same under every
        method.
        """
        return Draws(self._seed, *names)

    def is_busy(self, *, stalled_too: bool) -> bool:
        """Whether a message is queued, handled or on its way anywhere, with ``stalled_too`` also on
        a host that stands still.
        """
        return (
            self.clock.in_flight > 0
            or any(
                graph.is_busy and (stalled_too or not graph.host.is_stalled)
                for graph in self.graphs.values()
            )
            or any(link.is_busy for link in self.links.values())
        )

    def add_host(self, name: str, device: Device) -> Graph:
        """A new host with an empty graph."""
        host = Host(self.clock, name, device, seed=self._seed)
        graph = Graph(host, self._queue_length, self.monitor.dropped)
        self.resources += [host.accelerator, host.cpu]
        self.graphs[name] = graph
        return graph

    @property
    def cars(self) -> tuple[str, ...]:
        """All cars."""
        return tuple(self._places)

    @property
    def edges(self) -> tuple[str, ...]:
        """All edges."""
        return tuple(self._sites)

    def place(self, car: str) -> Point:
        """Where a car is now: east and north [m]."""
        return self._places[car](self.clock.now)

    def site(self, edge: str) -> Point | None:
        """Where an edge is: east and north [m]; ``None`` if the scenario does not say."""
        return self._sites.get(edge)

    def add_resource(self, resource: Resource) -> None:
        """Adds something that links share, whose use is sampled."""
        self.resources.append(resource)
        self.shared.append(resource)

    def add_link(
        self,
        ends: LinkEnds,
        model: LinkModel,
        *,
        part: Part,
        dropped: Dropped | None = None,
    ) -> Link:
        """A new link.

        Parameters
        ----------
        ends : LinkEnds
            Its name, also that of its random stream, and what it connects.
        model : LinkModel
            Its rates and delays.
        part : {"uplink", "downlink", "edges"}
            What the time on it counts as.
        dropped : callable, optional
            Called with each message that is lost, and what lost it; by default the monitor is told.
        """
        if ends.name in self.links:
            raise UserError(f"link {ends.name}: there is one already")
        transmitter = model.transmitter(self, ends)
        what = f"link model {class_name(model)!r}: transmitter()"
        require(isinstance(transmitter, Transmitter), what, transmitter, "a Transmitter")
        link = Link(
            self.clock,
            ends.name,
            transmitter,
            part=part,
            queue_length=self._queue_length,
            dropped=dropped or self.monitor.dropped,
        )
        for target, cause in self.outages:
            if (host := cut_host(link, target)) is not None:
                link.cut(cause, host)
        self.links[ends.name] = link
        self.resources.append(link)
        return link

    def add_interface(self, car: str) -> InterfaceUse:
        """A new network interface of a car."""
        use = InterfaceUse(self._tail_times_ns.get(car, 0))
        self.interfaces[car].append(use)
        return use

    def border(self, source: str, destination: str) -> Border:
        """The two ends of a link between hosts, for its messages."""
        bends = self._bends
        return Border(source, destination, bends[source], bends[destination])

    def bend(self, host: str, bend: Bend) -> None:
        """Changes from now on what crosses the border of a host, of any method. Messages that are
        lost are dropped by ``LINK:cause``.
        """
        self._bends[host].append(bend)

    def unbend(self, host: str, bend: Bend) -> None:
        """Ends what ``bend`` has begun."""
        self._bends[host].remove(bend)

    def senses(self, car: str) -> list[tuple[Sense, str]]:
        """What faults make of the images of a car's cameras, each with what drops those that it
        loses. A fault adds to the list, and takes away what it has added.
        """
        return self._senses[car]

    def add_coder(self, graph: Graph, role: CoderRole, take: Take) -> Coder | None:
        """A new encoder or decoder on a host; ``None`` if images are not encoded."""
        if self.codec is None:
            return None
        coder = Coder(graph, self.codec, role=role, take=take)
        self.resources.append(coder)
        return coder

    def _cuts(self, target: str) -> Iterator[tuple[Link, str]]:
        """Each link that a cut at ``target`` takes, and what of it: see ``cut_host``."""
        for link in self.links.values():
            if (host := cut_host(link, target)) is not None:
                yield link, host

    def cut(self, target: str, cause: str) -> None:
        """The links at ``target`` carry nothing from now on, those that are made later included;
        they drop messages as ``LINK:cause``. Raises ``UserError`` for an unknown host.
        """
        for end in target.split("->"):
            if end not in (ALL, EDGES):
                self._check_host(end)
        self.outages.append((target, cause))
        for link, host in self._cuts(target):
            link.cut(cause, host)

    def restore(self, target: str, cause: str) -> None:
        """Ends what ``cut`` has begun."""
        self.outages.remove((target, cause))
        for link, host in self._cuts(target):
            link.restore(cause, host)

    def void(self, host: str, where: str, *, keeps_memory: bool = False) -> None:
        """What is queued and in service on a host is lost, dropped by ``where``, and its nodes lose
        their state, unless it ``keeps_memory``.

        Nothing happens if the method runs nothing there. Raises ``UserError`` for an unknown host.
        """
        self._check_host(host)
        if host in self.graphs:
            self.graphs[host].void(where, keeps_memory=keeps_memory)

    def processors(self, host: str) -> tuple[Processor, ...]:
        """The accelerator and the CPU of a host; none if the method runs nothing there. Raises
        ``UserError`` for an unknown host.
        """
        self._check_host(host)
        graph = self.graphs.get(host)
        return () if graph is None else (graph.host.accelerator, graph.host.cpu)

    def _check_host(self, host: str) -> None:
        if host not in self._host_names:
            raise UserError(unknown("host", host, self._host_names))


def cut_host(link: Link, target: str) -> str | None:
    """What of a link a cut at ``target`` takes: all (an empty text), what goes to a host, or
    nothing (``None``). What an edge sends over the network between edges may be for the target.
    """
    source, _, end = link.name.partition("->")
    if target in (link.name, source, end):
        return ""
    *sources, host = target.split("->")
    return host if end == EDGES != host and sources in ([], [source]) else None
