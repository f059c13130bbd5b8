"""Builds the world of a scenario for one method, and lets time run in it."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial

from genie_sim.base.errors import UserError, as_user_error, short_repr
from genie_sim.base.seeds import Draws
from genie_sim.base.units import NS_PER_S
from genie_sim.sim import connectivity, fault_process
from genie_sim.sim.batching import BatchingDetectorNode
from genie_sim.sim.cameras import CameraNode
from genie_sim.sim.clock import Clock, Steps
from genie_sim.sim.connection import CarConnection
from genie_sim.sim.fault import TimedFault
from genie_sim.sim.listener import CarListener
from genie_sim.sim.method import DETECTOR, IMAGES, OBJECTS, HostConfig, HostContext, Method
from genie_sim.sim.monitor import FaultSpan, HostUsage, Monitor, Placement, Resource
from genie_sim.sim.network import Network
from genie_sim.sim.nodes import DetectorNode, InterceptorNode, attach
from genie_sim.sim.ros_graph import Graph
from genie_sim.sim.settings import Car, Serving
from genie_sim.sim.setup import Setup
from genie_sim.sim.topology import EdgeServer, join_edges, neighbours

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
        self.clock = Clock(keeps_paths=monitor.wants_paths)
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
        self._method = method
        # Edges first: cars connect to them. Faults and cameras last: they act on all that is there.
        self.edges = self._build_edges()
        edge_resources = list(self.network.resources)
        cameras = [camera for car in setup.cars for camera in self._build_car(car)]
        self.last_frame_ns = max((camera.last_stamp_ns for camera in cameras), default=0)
        wire = getattr(method, "wire", None)  # a class of the user's own need not have it
        if wire is not None:
            with as_user_error(method.title, UserError):
                wire(self.network)
        self._sampled = self._choose_sampled(edge_resources)
        self._used_in_warm_up: dict[str, HostUsage] = {}  # by host
        self._fault_spans: list[FaultSpan] = []
        self._faults = [self.clock.process(self._strike(fault)) for fault in setup.faults]
        for camera in cameras:
            self.clock.process(camera.run())

    def _strike(self, fault: TimedFault) -> Steps:
        """The process of a fault."""
        return fault_process.run(fault, self.network, self.last_frame_ns, self._fault_spans)

    def _build_edges(self) -> dict[str, EdgeServer]:
        """The edge servers, by name, joined to their neighbours."""
        setup, network = self.setup, self.network
        blind_edges = setup.blind_edges
        neighbours_of = neighbours(setup.edges, setup.settings.edge_neighbours)
        servers: dict[str, EdgeServer] = {}
        for edge in setup.edges:
            name = edge.name
            gets_images = name not in blind_edges
            context = self._context(name, gets_images, neighbours=neighbours_of[name])
            config = _checked("on_edge", self._method.on_edge(context))
            graph = network.add_host(name, setup.devices[edge.device])
            servers[name] = EdgeServer(graph, config)
            if config.detector:
                self._add_detector(graph, edge.serving or setup.settings.serving)
        for server in servers.values():
            graph = server.graph
            self._add_interceptor(graph, server.config, "edge")
            # frames from cars arrive at the decoder, or at the graph itself
            server.target = network.add_coder(graph, "decoder", graph.inject) or graph
        join_edges(network, servers, neighbours_of, setup.edge_network)
        return servers

    def _build_car(self, car: Car) -> list[CameraNode]:
        """What the method runs on a car; its cameras, none if it runs nothing."""
        setup = self.setup
        context = self._context(car.name, bool(car.cameras))
        genie = context.genie if car.genie else None
        context = replace(context, has_edge=car.edge is not None, genie=genie)
        config = self._method.on_car(context)
        if config is None:
            return []
        _checked("on_car", config)
        graph = self.network.add_host(car.name, setup.devices[car.device])
        if config.detector:
            self._add_detector(graph)
        self._add_interceptor(graph, config, "car")
        connection = self._connect(car, graph, config)
        is_answered = config.detector or config.interceptor is not None or connection is not None
        # the frames of a car with neither a node nor an edge are meant to reach nobody
        if is_answered or car.edge is not None:
            self._check_connections(car, graph, config)
        CarListener(graph, self.monitor, connection=connection, is_answered=is_answered)
        return [
            CameraNode(
                camera,
                car,
                graph,
                frames=setup.frames[car.name][camera.recording],
                published=self.monitor.published,
                senses=self.network.senses(car.name),
            )
            for camera in car.streams(setup.cameras)
        ]

    def _context(self, name: str, gets_images: bool, neighbours: Sequence[str] = ()) -> HostContext:
        """What a method gets to know of a host."""
        setup = self.setup
        return HostContext(
            name=name,
            gets_images=gets_images,
            has_edge=True,
            genie=setup.settings.genie,
            draws=partial(Draws, setup.seed, name),
            names_changes=self.monitor.names_changes,
            laws=setup.laws,
            edges=tuple(edge.name for edge in setup.edges),
            neighbours=neighbours,
            is_one_world=setup.is_one_world,
        )

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
        costs = replace(config.costs, passes=self.setup.settings.genie.passes)
        if config.detector and not config.is_beside:
            detector = f"{graph.name}/{DETECTOR}"
            node = attach(graph, detector, make, observe, costs=costs)
        else:
            node = InterceptorNode(lambda: make((IMAGES,), (OBJECTS,)), graph, observe, costs=costs)
        self.network.resources.append(node)
        if not config.is_beside:
            graph.entry = node.name

    def _connect(self, car: Car, graph: Graph, config: HostConfig) -> CarConnection | None:
        """The car's connection to its edge, if the method wants one."""
        if config.uplink is None:
            return None
        if car.edge is None:
            raise UserError(f"{self._method.title}: {car.name} has an uplink, but no edge")
        network, model = self.network, self.setup.links[car.name]
        connection = CarConnection(network, graph, config.uplink, model=model, edges=self.edges)
        connection.join(car.edge)
        network.connections[car.name] = connection
        return connection

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

    def _end_warm_up(self) -> None:
        """What hosts, links and queues have done until now is left out."""
        self._used_in_warm_up = {usage.host: usage for usage in self._usage()}
        for resource in self._sampled:
            resource.occupancy.restart_most()

    def _since_warm_up(self, usage: HostUsage) -> HostUsage:
        """What a host has used, without what it had used before the end of the warm-up."""
        earlier = self._used_in_warm_up.get(usage.host)
        if earlier is None:
            return usage
        growth = {name: getattr(usage, name) - getattr(earlier, name) for name in GROWING_COUNTS}
        begin_ns = max(usage.begin_ns, self.setup.warm_up_ns)
        return usage._replace(**growth, begin_ns=begin_ns)

    def _usage(self) -> Iterator[HostUsage]:
        """What every host has used until now."""
        setup = self.setup
        starts_ns = {car.name: car.route.start_ns for car in setup.cars}
        traffic = {}  # of each car with an uplink
        for car, interfaces in self.network.interfaces.items():
            traffic_of = [use.bytes_carried() for use in interfaces]
            traffic[car] = {
                "bytes_up": sum(up for up, _ in traffic_of),
                "bytes_down": sum(down for _, down in traffic_of),
                "transfer_ns": sum(use.transfer_ns(self.clock.now) for use in interfaces),
                "tail_ns": sum(use.tail_ns for use in interfaces),
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
        if self.monitor.samples == "all":
            return self.network.resources  # the list itself: a hand-over adds links while time runs
        return edge_resources + self.network.shared if self.monitor.samples == "edges" else []

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
                self._end_warm_up()
            self.monitor.sample(self._sampled, now_ns)
            if progress is not None:
                progress(min(now_ns, self.last_frame_ns), self.last_frame_ns)
            yield self.clock.timeout(SAMPLE_NS)


def _checked(field: str, config: HostConfig) -> HostConfig:
    """What a method has returned, where it is of the right type."""
    if not isinstance(config, HostConfig):
        raise TypeError(f"{field}() is {short_repr(config)}, but must be a HostConfig")
    if isinstance(config.neighbour_topics, str):
        text = f"is {config.neighbour_topics!r}, but must be a tuple of topics"
        raise TypeError(f"{field}(): neighbour_topics {text}")
    return config
