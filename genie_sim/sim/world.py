"""Builds the world of a scenario for one method, and lets time run in it."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from genie_sim import seeds
from genie_sim.errors import UserError, unknown
from genie_sim.monitor import Monitor, Placement, Resource
from genie_sim.sim import fault
from genie_sim.sim.cameras import Camera
from genie_sim.sim.clock import Clock
from genie_sim.sim.device import Host
from genie_sim.sim.encoding import Coder, Take
from genie_sim.sim.link import Link
from genie_sim.sim.link_models import LinkModel
from genie_sim.sim.listener import CarListener
from genie_sim.sim.nodes import Detector, InterceptorNode, attach
from genie_sim.sim.ros_graph import Graph
from genie_sim.sim.service import Device
from genie_sim.sim.setup import CarSetup, Setup
from genie_sim.sim.station import DETECTOR, IMAGES, OBJECTS, Method, Place, Station
from genie_sim.sim.steps import StepClock
from genie_sim.sim.topology import Edge, join_edges, neighbours
from genie_sim.sim.uplinks import CarUplink

SAMPLE_NS = 100_000_000
DRAIN_NS = 5_000_000_000  # after the last frame, and as often again as something is still in flight
MOST_DRAIN_NS = 600_000_000_000


class World:
    """All hosts, graphs and links of one scenario under one method, on one clock of integer nanoseconds.

    What stands on each host the ``method`` says; the ``monitor`` is told what happens. Random numbers come from streams
    named after car, device and link, so every method sees the same ones.
    """

    def __init__(self, setup: Setup, method: Method, monitor: Monitor) -> None:
        self.env = StepClock() if monitor.wants_steps else Clock()
        self.setup = setup
        self.monitor = monitor
        self.resources: list[Resource] = []
        self.edges: dict[str, Edge] = {}
        self.uplinks: dict[str, CarUplink] = {}
        self.hosts: dict[str, tuple[Host, Graph]] = {}
        self.links: dict[str, Link] = {}
        self.end_ns = 0  # when the last frame is taken
        self.outages: list[
            tuple[str, str]
        ] = []  # the targets of links that are down now, and by which fault
        self._method = method
        self._edge_names = tuple(edge.name for edge in setup.edges)
        self._cameras: list[Camera] = []
        self._fronts: dict[str, str] = {}  # of each host, the node that takes what comes over links
        self._build_edges()
        of_edges = len(self.resources)
        for car in setup.cars:
            self._build_car(car)
        processors = [one for one in self.resources if one.kind in ("accelerator", "cpu")]
        sampled = {
            "all": self.resources,
            "edges": self.resources[:of_edges],
            "processors": processors,
            "none": [],
        }
        self._sampled: list[Resource] = sampled[monitor.samples]
        for timed in setup.faults:
            fault.start(self, timed)
        for camera in self._cameras:
            camera.wait()

    def run(self, progress: Callable[[int, int], None] | None = None) -> None:
        """Runs until nothing is in flight any more, at most ten minutes after the last frame. ``progress`` gets the
        time now and at the end [ns]."""

        self._sample(progress)
        for waited_ns in range(DRAIN_NS, MOST_DRAIN_NS + 1, DRAIN_NS):
            self.env.run(until=self.end_ns + waited_ns)
            if self.env.waits_only_for(self._sample):
                break
        self.monitor.sample(self._sampled, self.env.now)
        self.monitor.close()

    def _sample(self, progress: Callable[[int, int], None] | None) -> None:
        self.monitor.sample(self._sampled, self.env.now)
        if progress is not None:
            progress(min(self.env.now, self.end_ns), self.end_ns)
        self.env.after(SAMPLE_NS, self._sample, progress)

    def dismantle(self) -> None:
        """After the run: takes everything apart, so that it is freed at once and not by Python's collector."""
        for _, graph in self.hosts.values():
            graph.clear()
        for uplink in self.uplinks.values():
            uplink.clear()
        for parts in (
            self.hosts,
            self.edges,
            self.uplinks,
            self.links,
            self.resources,
            self._sampled,
            self._cameras,
        ):
            parts.clear()
        self.env.clear()

    def stream(self, *names: str) -> np.random.Generator:
        """The random generator of these names: the same under every method."""
        return seeds.stream(self.setup.seed, *names)

    def link(self, name: str, model: LinkModel, up: bool) -> Link:
        """A new link called ``FROM->TO``."""
        channel = model.channel(up, self.stream(name))
        link = Link(self.env, name, channel, self.setup.queue_length, self.monitor.dropped)
        link.down_by += [by for target, by in self.outages if is_at(link, target)]
        self.links[name] = link
        self.resources.append(link)
        return link

    def links_at(self, target: str) -> Iterator[Link]:
        """The links called ``target``, or those with an end there: a car, an edge, or ``edges`` for their network."""
        return (link for link in self.links.values() if is_at(link, target))

    def coder(self, place: str, name: str, step: int, take: Take) -> Coder | None:
        """A new encoder (step 0) or decoder (1) on a host; ``None`` where pictures are sent as they are."""
        if self.setup.codec is None:
            return None
        made = Coder(f"{place}/{name}", self.hosts[place][1], self.setup.codec, step, take)
        self.resources.append(made)
        return made

    def void(self, host: str, where: str) -> None:
        """What is queued and in service on a host is lost, dropped by ``where``, and its nodes forget what they know.

        Nothing happens where the method has put nothing. Raises ``UserError`` for a host that is not there.
        """
        known = [*(car.name for car in self.setup.cars), *(edge.name for edge in self.setup.edges)]
        if host not in known:
            raise UserError(unknown("host", host, known))
        if host in self.hosts:
            computer, graph = self.hosts[host]
            for node in graph.nodes:
                node.void(where)
            computer.accelerator.void()
            computer.cpu.void()

    def front(self, host: str) -> str:
        """The address of the node on a host that takes what comes over links."""
        return self._fronts.get(host, f"{host}/consumer")

    def _build_edges(self) -> None:
        blind, joined = self.setup.blind_edges, dict(neighbours(self.setup.edges))
        for edge in self.setup.edges:
            name = edge.name
            place = replace(
                self._place(name, name not in blind, True, True), neighbours=joined[name]
            )
            station = self._method.on_edge(place)
            self.edges[name] = Edge(self._add_host(name, edge.device), station)
            if station.detector:
                self._add_detector(name)
        for name, built in self.edges.items():
            self._add_interceptor(name, built.station, "edge")
            built.target = self.coder(name, "decoder", 1, built.graph.inject) or built.graph
        join_edges(self, self.edges)

    def _build_car(self, car: CarSetup) -> None:
        station = self._method.on_car(
            self._place(car.name, car.sees, car.edge is not None, car.genie)
        )
        if station is None:
            return
        graph = self._add_host(car.name, car.device)
        if station.detector:
            self._add_detector(car.name)
        self._add_interceptor(car.name, station, "car")
        uplink = None
        if station.uplink is not None:
            uplink = self.uplinks[car.name] = CarUplink(self, car, graph, station.uplink)
        CarListener(
            self, car.name, graph, uplink, no_server=uplink is None and car.name not in self._fronts
        )
        for camera in car.cameras:
            node = Camera(camera, car, graph, IMAGES, self.monitor.published)
            self._cameras.append(node)
            self.end_ns = max(self.end_ns, node.last_stamp_ns)

    def _place(self, name: str, sees: bool, joined: bool, genie: bool) -> Place:
        setup, stream = self.setup, partial(self.stream, name)
        rules = setup.genie if genie else None
        return Place(
            name,
            sees,
            joined,
            rules,
            stream,
            self.monitor.wants_changes,
            setup.laws,
            self._edge_names,
        )

    def _add_host(self, name: str, device: Device) -> Graph:
        host = Host(
            self.env, name, device, self.stream(name, "accelerator"), self.stream(name, "cpu")
        )
        self.resources += [host.accelerator, host.cpu]
        graph = Graph(host, self.setup.queue_length, self.monitor.dropped)
        self.hosts[name] = host, graph
        return graph

    def _add_detector(self, place: str) -> None:
        _, graph = self.hosts[place]
        name = self._fronts[place] = f"{place}/{DETECTOR}"
        self.resources.append(Detector(name, graph, (IMAGES,), (OBJECTS,)))

    def _add_interceptor(self, place: str, station: Station, placement: Placement) -> None:
        make = station.interceptor
        if make is None:
            return
        _, graph = self.hosts[place]
        told = partial(self.monitor.observe, placement), station, self.setup.genie.passes
        if station.detector:
            node = attach(graph, f"{place}/{DETECTOR}", make, *told)
        else:
            node = InterceptorNode(lambda: make((IMAGES,), (OBJECTS,)), graph, *told)
        self.resources.append(node)
        self._fronts[place] = node.name


def is_at(link: Link, target: str) -> bool:
    """Whether a link is called ``target`` or has an end there."""
    return target == link.name or target in link.name.split("->")
