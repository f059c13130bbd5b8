"""Builds the world of a scenario for one method, and lets time run in it."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
import simpy

from genie_sim.base.errors import UserError, as_user_error, short_repr
from genie_sim.base.seeds import Draws
from genie_sim.base.units import NS_PER_S
from genie_sim.core.rules import GenieRules
from genie_sim.sim import connectivity, fault_process
from genie_sim.sim.batching import BatchingDetectorNode
from genie_sim.sim.cameras import CameraNode
from genie_sim.sim.clock import Clock, Steps
from genie_sim.sim.listener import CarListener
from genie_sim.sim.method import DETECTOR, IMAGES, OBJECTS, HostConfig, HostContext, Method
from genie_sim.sim.monitor import FaultSpan, HostUsage, Monitor, Placement, Resource
from genie_sim.sim.network import Network
from genie_sim.sim.nodes import DetectorNode, InterceptorNode, attach
from genie_sim.sim.ros_graph import Graph
from genie_sim.sim.settings import Car, Edge, Serving
from genie_sim.sim.setup import Setup
from genie_sim.sim.topology import EdgeServer, join_edges, neighbours
from genie_sim.sim.uplinks import CarUplink

SAMPLE_NS = NS_PER_S // 10
DRAIN_NS = 5 * NS_PER_S  # a run goes on so long after its last frame, then again while it is busy
MAX_DRAIN_NS = 600 * NS_PER_S
ONE_BY_ONE = Serving()
# The fields of HostUsage that only grow, from which the warm-up is taken away.
GROWING_COUNTS = (
    "accelerator_ns",
    "cpu_ns",
    "pictures",
    "batches",
    "bytes_up",
    "bytes_down",
    "transfer_ns",
    "tail_ns",
)
OnTime = Callable[[int, int], None]  # the time now and at the end [ns]


class World:
    """All hosts, graphs and links of one scenario under one method, on one clock of integer
    nanoseconds.

    The ``method`` says what runs on each host; the ``monitor`` observes the run.
    """

    def __init__(self, setup: Setup, method: Method, monitor: Monitor) -> None:
        self.setup = setup
        self.clock = Clock(is_traced=monitor.wants_paths)
        self.monitor = monitor
        self.network = Network(
            self.clock,
            self.monitor,
            seed=setup.seed,
            host_names=[car.name for car in setup.cars] + [edge.name for edge in setup.edges],
            queue_length=setup.settings.queue_length,
            codec=setup.codec,
            places=setup.places,
            sites={edge.name: edge.at_m for edge in setup.edges},
            tail_times_ns={
                car: interface.tail_time_ns for car, interface in setup.interfaces.items()
            },
        )
        self._contexts = HostContexts(
            setup,
            self.network.stream,
            tuple(edge.name for edge in setup.edges),
            monitor.names_changes,
        )
        self.edges: dict[str, EdgeServer] = {}
        self.last_frame_ns = 0  # when the last frame is taken
        self._method = method
        self._cameras: list[CameraNode] = []
        self._faults: list[simpy.Process] = []
        self._fault_spans: list[FaultSpan] = []
        self._used_in_warm_up: dict[str, HostUsage] = {}  # by host
        self._build_edges()
        edge_resources = list(self.network.resources)  # those of cars are not built yet
        for car in setup.cars:
            self._build_car(car)
        wire = getattr(method, "wire", None)  # a class of the user's own need not have it
        if wire is not None:
            with as_user_error(method.title, UserError):
                wire(self.network)
        self._sampled = self._choose_sampled(edge_resources)
        for timed in setup.faults:
            steps = fault_process.run(timed, self.network, self.last_frame_ns, self._fault_spans)
            self._faults.append(self.clock.process(steps))
        for camera in self._cameras:
            self.clock.process(camera.run())

    def _build_edges(self) -> None:
        setup, network = self.setup, self.network
        blind_edges = setup.blind_edges
        neighbours_of = neighbours(setup.edges, setup.settings.edge_neighbours)
        for edge in setup.edges:
            name = edge.name
            context = self._contexts.edge(edge, name not in blind_edges, neighbours_of[name])
            config = _checked("on_edge", self._method.on_edge(context))
            graph = network.add_host(name, setup.devices[edge.device])
            self.edges[name] = EdgeServer(graph, config)
            if config.detector:
                self._add_detector(graph, edge.serving or setup.settings.serving)
        for server in self.edges.values():
            graph = server.graph
            self._add_interceptor(graph, server.config, "edge")
            # frames from cars arrive at the decoder, or at the graph itself
            server.target = network.add_coder(graph, "decoder", graph.inject) or graph
        join_edges(network, self.edges, neighbours_of, setup.edge_network)

    def _build_car(self, car: Car) -> None:
        setup = self.setup
        config = self._method.on_car(self._contexts.car(car))
        if config is None:  # nothing runs on it
            return
        _checked("on_car", config)
        graph = self.network.add_host(car.name, setup.devices[car.device])
        if config.detector:
            self._add_detector(graph)
        self._add_interceptor(graph, config, "car")
        uplink = self._add_uplink(car, graph, config)
        has_server = config.detector or config.interceptor is not None or uplink is not None
        # the frames of a car with neither a server nor an edge are meant to reach nobody
        if has_server or car.edge is not None:
            self._check_connections(car, graph, config)
        CarListener(graph, self.monitor, uplink=uplink, has_server=has_server)
        for camera in car.streams(setup.cameras):
            frames = setup.frames[car.name][camera.recording]
            node = CameraNode(
                camera,
                car,
                graph,
                frames=frames,
                published=self.monitor.published,
                senses=self.network.senses(car.name),
            )
            self._cameras.append(node)
            self.last_frame_ns = max(self.last_frame_ns, node.last_stamp_ns)

    def _check_connections(self, car: Car, graph: Graph, config: HostConfig) -> None:
        """Raises ``UserError`` if the car's frames, or the answers to them, would reach nobody."""
        with as_user_error(self._method.title, UserError):
            connectivity.check_car(graph, config)
            if config.uplink is not None and car.edge is not None:
                edge = self.edges[car.edge]
                connectivity.check_edge(edge.graph, edge.config, car.name)

    def _add_detector(self, graph: Graph, serving: Serving = ONE_BY_ONE) -> None:
        name, topics = f"{graph.name}/{DETECTOR}", ((IMAGES,), (OBJECTS,))
        if serving == ONE_BY_ONE:
            detector = DetectorNode(name, graph, *topics)
        else:
            detector = BatchingDetectorNode(name, graph, *topics, serving=serving)
        self.network.resources.append(detector)
        graph.entry = detector.name

    def _add_interceptor(self, graph: Graph, config: HostConfig, placement: Placement) -> None:
        make = config.interceptor
        if make is None:
            return
        observe = partial(self.monitor.observe, placement)
        passes = self.setup.settings.genie.passes
        if config.detector and not config.is_beside:
            detector = f"{graph.name}/{DETECTOR}"
            node = attach(graph, detector, make, observe, config=config, passes=passes)
        else:
            node = InterceptorNode(
                lambda: make((IMAGES,), (OBJECTS,)), graph, observe, config=config, passes=passes
            )
        self.network.resources.append(node)
        if not config.is_beside:
            graph.entry = node.name

    def _add_uplink(self, car: Car, graph: Graph, config: HostConfig) -> CarUplink | None:
        """The car's connection to its edge, if the method wants one."""
        if config.uplink is None:
            return None
        if car.edge is None:
            raise UserError(f"{self._method.title}: {car.name} has an uplink, but no edge")
        network, model = self.network, self.setup.links[car.name]
        uplink = CarUplink(network, graph, config.uplink, model=model, edges=self.edges)
        uplink.join(car.edge)
        network.uplinks[car.name] = uplink
        return uplink

    def run(self, progress: OnTime | None = None) -> None:
        """Runs until no frame is open: none is queued, handled or on its way any more, at most ten
        minutes after the last one was taken.
        """
        self.clock.process(self._watch_resources(progress))
        for drained_ns in range(DRAIN_NS, MAX_DRAIN_NS + 1, DRAIN_NS):
            self.clock.run(until=self.last_frame_ns + drained_ns)
            may_end_stall = any(process.is_alive for process in self._faults)
            if not self.network.is_busy(stalled_too=may_end_stall):
                break
        self.monitor.sample(self._sampled, self.clock.now)
        self.monitor.used(map(self._since_warm_up, self._usage()))
        self.monitor.failed(self._fault_spans)
        self.monitor.close()

    def _begin_to_count(self) -> None:
        """From now on what hosts, links and queues do counts."""
        self._used_in_warm_up = {usage.host: usage for usage in self._usage()}
        for resource in self._sampled:
            resource.occupancy.forget_most()

    def _since_warm_up(self, usage: HostUsage) -> HostUsage:
        """What a host has used, without what it had used before the end of the warm-up."""
        earlier = self._used_in_warm_up.get(usage.host)
        if earlier is None:
            return usage
        used = {name: getattr(usage, name) - getattr(earlier, name) for name in GROWING_COUNTS}
        begin_ns = max(usage.begin_ns, self.setup.warm_up_ns)
        return usage._replace(**used, begin_ns=begin_ns)

    def _usage(self) -> Iterator[HostUsage]:
        """What every host has used until now."""
        setup = self.setup
        starts_ns = {car.name: car.route.start_ns for car in setup.cars}
        traffic = {}  # of each car with an uplink
        for car, used in self.network.interfaces.items():
            carried = [use.bytes_carried() for use in used]
            traffic[car] = {
                "bytes_up": sum(up for up, _ in carried),
                "bytes_down": sum(down for _, down in carried),
                "transfer_ns": sum(use.transfer_ns(self.clock.now) for use in used),
                "tail_ns": sum(use.tail_ns for use in used),
            }
        for name, graph in self.network.graphs.items():
            host, interface = graph.host, setup.interfaces.get(name)
            yield HostUsage(
                host=name,
                placement="car" if name in starts_ns else "edge",
                device=host.device.name,
                interface=None if interface is None else interface.name,
                accelerator_ns=host.accelerator.busy_ns,
                cpu_ns=host.cpu.busy_ns,
                pictures=host.accelerator.completed,
                batches=host.accelerator.jobs,
                **traffic.get(name, {}),
                begin_ns=starts_ns.get(name, 0),
            )

    def _choose_sampled(self, edge_resources: list[Resource]) -> list[Resource]:
        """The resources that the monitor wants to sample."""
        resources = self.network.resources
        samples = self.monitor.samples
        if samples == "all":
            return resources  # the list itself: a hand-over adds links while time runs
        if samples == "edges":
            return edge_resources + self.network.shared
        if samples == "processors":
            return [resource for resource in resources if resource.kind in ("accelerator", "cpu")]
        return []

    def _watch_resources(self, progress: OnTime | None) -> Steps:
        """The process that samples resources, and begins to count anew when the warm-up ends,
        which is one of its instants.
        """
        warm_up_ns = self.setup.warm_up_ns
        if warm_up_ns % SAMPLE_NS:
            yield self.clock.timeout(warm_up_ns % SAMPLE_NS)
        while True:
            now_ns = self.clock.now
            if now_ns == warm_up_ns > 0:
                self._begin_to_count()
            self.monitor.sample(self._sampled, now_ns)
            if progress is not None:
                progress(min(now_ns, self.last_frame_ns), self.last_frame_ns)
            yield self.clock.timeout(SAMPLE_NS)


def _checked(field: str, config: HostConfig) -> HostConfig:
    """What a method has returned, where it is of the right type."""
    if not isinstance(config, HostConfig):
        raise TypeError(f"{field}() is {short_repr(config)}, but must be a HostConfig")
    return config


class HostContexts(NamedTuple):
    """What a method gets to know of the hosts of one world."""

    setup: Setup
    stream: Callable[..., np.random.Generator]
    edges: tuple[str, ...]
    names_changes: bool = False

    def car(self, car: Car) -> HostContext:
        """About a car; it has rules of a Genie if one may run there."""
        genie = self.setup.settings.genie if car.genie else None
        has_edge = car.edge is not None
        return self._host(car.name, bool(car.cameras), has_edge=has_edge, genie=genie)

    def edge(self, edge: Edge, gets_images: bool, neighbours: Sequence[str]) -> HostContext:
        """About an edge."""
        genie = self.setup.settings.genie
        context = self._host(edge.name, gets_images, has_edge=True, genie=genie)
        return replace(context, neighbours=neighbours)

    def _host(
        self, name: str, gets_images: bool, *, has_edge: bool, genie: GenieRules | None
    ) -> HostContext:
        return HostContext(
            name=name,
            gets_images=gets_images,
            has_edge=has_edge,
            genie=genie,
            stream=partial(self.stream, name),
            draws=partial(Draws, self.setup.seed, name),
            names_changes=self.names_changes,
            laws=self.setup.laws,
            edges=self.edges,
            is_one_world=self.setup.is_one_world,
        )
