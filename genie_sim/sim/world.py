"""Builds the world of a scenario for one method (local, remote or genie), and lets time run in it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

from genie_sim.core.genies import make_genie
from genie_sim.core.node import GenieNode
from genie_sim.messages import Detections, Fact, Image, Message
from genie_sim.perception.trace import Trace
from genie_sim.recording.log import Log, Resource
from genie_sim.recording.truth import Truth
from genie_sim.scenario.links import LinkProfile
from genie_sim.scenario.profiles import DeviceProfile
from genie_sim.scenario.scenario import EDGES, Car, Scenario
from genie_sim.seeds import stream
from genie_sim.sim.camera import Camera
from genie_sim.sim.clock import Clock, Process
from genie_sim.sim.device import Host
from genie_sim.sim.link import Bridge, Downlinks, Link
from genie_sim.sim.nodes import Consumer, Detector, Genie, attach_genie
from genie_sim.sim.phantom import POSITION_BYTES, Coordinator, positions
from genie_sim.sim.ros_graph import Graph

IMAGES = "/image_raw"
OBJECTS = "/detection/image_detector/objects"
DETECTOR = "vision_darknet_detect"
REMOTE = "-remote"
SAMPLE_NS = 100_000_000
DRAIN_NS = 5_000_000_000  # after the last frame, and as often again as something is still on its way
MOST_DRAIN_NS = 600_000_000_000


class _Edge:
    """An edge server: its host, its ROS graph, its detector if its cars have cameras, and its Genie."""

    def __init__(self, world: World, name: str, host: Host, detects: bool) -> None:
        self.name = name
        self.host = host
        self.graph = Graph(world.env, name)
        self.detector = world.add_detector(name, host, self.graph) if detects else None
        self.downlinks = Downlinks(f"{name}/cars")
        self.graph.bridge(OBJECTS, self.downlinks)


class _Uplink:
    """A car's way to its edge and back: frames go up, the answers to them come down.

    A hand-over is hard, as that of a mobile network and of a ROS node that connects to another master: the connection
    to the old edge breaks, and after the scenario's ``hand_over_gap`` there is one to the new edge. What the car sends
    in between is lost, and so is whatever waits for the old link or is on it, and what the old edge answers while the
    car is away: it is dropped by ``CAR:hand_over``. Each edge has its own link to the car, which is there again when
    the car comes back.
    """

    def __init__(self, world: World, car: Car, graph: Graph, topics: tuple[str, str]) -> None:
        assert car.edge is not None
        self.address = f"{car.name}/uplink"
        self.edge = car.edge
        self._world = world
        self._car = car
        self._graph = graph
        self._up_topic, self._down_topic = topics
        self._bridges: dict[str, tuple[Bridge, Bridge]] = {}  # up and down, by the edge
        self._up = self._connect(car.edge)
        graph.bridge(self._up_topic, self)
        if car.hand_overs:
            world.env.process(self._hand_overs())

    def deliver(self, topic: str, message: Message, sender: str) -> None:
        self._up.deliver(topic, message, sender)

    def _connect(self, name: str) -> Bridge:
        """Puts up the bridges to an edge, and returns the one that leads up."""
        self.edge = name
        if name in self._bridges:
            for bridge in self._bridges[name]:
                bridge.put_up()
        else:
            self._bridges[name] = self._world.bridges(self._car, self._graph, self._world.edges[name], self._down_topic)
        return self._bridges[name][0]

    def _hand_overs(self) -> Process:
        env = self._world.env
        for hand_over in self._car.hand_overs:
            yield env.timeout(hand_over.at_ns - env.now)
            for bridge in self._bridges[self.edge]:
                bridge.take_down()
            yield env.timeout(self._world.scenario.hand_over_gap_ns)
            self._up = self._connect(hand_over.edge)


class World:
    """All hosts, graphs and links of one scenario under one method, on one clock of integer nanoseconds.

    ``local``: each car runs its own detector. ``remote``: each car's frames go to its edge's detector. ``genie``: a
    Genie stands before every detector, cars upload what they miss, and edges share over the edge network. Random
    numbers come from streams named after car, device and link, so the three methods see the same ones.
    """

    def __init__(
        self,
        scenario: Scenario,
        devices: Mapping[str, DeviceProfile],
        traces: Mapping[str, Trace],
        method: str,
        log: Log,
        truth: Truth | None = None,
    ) -> None:
        self.env = Clock()
        self.scenario = scenario
        self.method = method
        self.resources: list[Resource] = []
        self._devices = devices
        self._log = log
        self._truth = truth
        self._end_ns = 0
        self.edges: dict[str, _Edge] = {}
        self._uplinks: dict[str, _Uplink] = {}
        without_cameras = {car.edge for car in scenario.cars if not car.cameras}
        for edge in scenario.edges:
            host = self._add_host(edge.name, edge.device)
            self.edges[edge.name] = _Edge(self, edge.name, host, detects=edge.name not in without_cameras)
        if method == "genie":
            for name, edge_ in self.edges.items():
                if edge_.detector is not None:
                    self._attach(name, edge_.graph, role="remote")
            self._join_edges()
        of_edges = len(self.resources)
        for car in scenario.cars:
            if car.cameras:
                self._add_car(car, traces[car.name])
            elif method == "genie":  # nobody else answers a car without cameras
                self._add_car_without_cameras(car, traces[car.name])
        self._sampled: list[Resource] = []
        if "resources" in scenario.record:
            self._sampled = self.resources if scenario.fleet is None else self.resources[:of_edges]

    def run(self, progress: Callable[[int, int], None] | None = None) -> None:
        """Runs until nothing is on its way any more, at most ten minutes after the last frame. ``progress`` gets the
        time now and at the end [ns]."""
        sampler = self.env.process(self._sampler(progress))
        for waited_ns in range(DRAIN_NS, MOST_DRAIN_NS + 1, DRAIN_NS):
            self.env.run(until=self._end_ns + waited_ns)
            if self.env.waits_only_for(sampler):
                break
        self._log.sample(self._sampled, self.env.now)
        self._log.close()

    def add_detector(self, place: str, host: Host, graph: Graph) -> Detector:
        name = f"{place}/{DETECTOR}"
        node = Detector(name, host, graph, IMAGES, OBJECTS, self.scenario.queue_length, self._log.dropped)
        self.resources.append(node)
        return node

    def _add_host(self, name: str, device: str) -> Host:
        seed = self.scenario.seed
        profile = self._devices[device]
        model_time = profile.service_time(self.scenario.model, self.scenario.spread)
        host = Host(self.env, name, profile, model_time, stream(seed, name, "accelerator"), stream(seed, name, "cpu"))
        self.resources += [host.accelerator, host.cpu]
        return host

    def _add_car(self, car: Car, trace: Trace) -> None:
        host = self._add_host(car.name, car.device)
        graph = Graph(self.env, car.name)
        edge = self.edges[car.edge] if car.edge is not None else None
        if self.method != "remote":
            self.add_detector(car.name, host, graph)
        if self.method == "genie" and car.genie:
            self._attach(car.name, graph, role="local", alone=edge is None)
            if edge is not None:
                self._join_car(car, graph, IMAGES + REMOTE, OBJECTS + REMOTE)
        elif self.method == "remote" and edge is not None:
            self._join_car(car, graph, IMAGES, OBJECTS)
        self._add_frames(car, host, graph, trace)

    def _add_car_without_cameras(self, car: Car, trace: Trace) -> None:
        """Section V-F: the coordinator server finds that nothing detects objects here and assigns phantom Genies."""
        host = self._add_host(car.name, car.device)
        graph = Graph(self.env, car.name)
        assert car.edge is not None
        edge = self.edges[car.edge]
        coordinator = Coordinator(self.scenario.genie, self.scenario.queue_length, self._log)
        for phantom in coordinator.assign(IMAGES, OBJECTS, (graph, host, "local"), (edge.graph, edge.host, "remote")):
            self.resources.append(phantom)
        self._join_car(car, graph, IMAGES + REMOTE, OBJECTS + REMOTE)
        self._add_frames(car, host, graph, trace)

    def _add_frames(self, car: Car, host: Host, graph: Graph, trace: Trace) -> None:
        """What the car sees or where it is, who notes when it does, and who consumes the answers."""
        nobody_takes_them = self.method == "remote" and car.edge is None
        _Watch(graph, partial(self._lost, f"{car.name}:no_edge") if nobody_takes_them else self._received)
        Consumer(f"{car.name}/consumer", graph, OBJECTS, partial(self._answered, car))
        self._add_cameras(car, host, graph, trace)

    def _add_cameras(self, car: Car, host: Host, graph: Graph, trace: Trace) -> None:
        set_off_ns = self.scenario.set_off_ns(car)
        for camera in self.scenario.cameras:
            frames = trace.frames[camera.recording]
            node = Camera(
                camera.name,
                host,
                graph,
                IMAGES,
                car.name,
                frames if car.cameras else positions(frames),
                car.route.window_ns,
                set_off_ns + camera.phase_ns,
                car.route.laps,
                car.route.pause_ns,
                camera.size_bytes if car.cameras else POSITION_BYTES,
                self._log.published if self._truth is None else self._published,
            )
            self._end_ns = max(self._end_ns, node.last_stamp_ns)

    def _attach(self, place: str, graph: Graph, role: str, alone: bool = False) -> Genie:
        name = f"{place}/genie"

        def make(subscribed: tuple[str, ...], published: tuple[str, ...]) -> GenieNode:
            on_edge, tells_changes = role == "remote", self._log.wants_changes
            settings = self.scenario.genie
            return make_genie(
                settings, name, subscribed, published, on_edge=on_edge, alone=alone, tells_changes=tells_changes
            )

        def observe(genie: Genie, record: Fact) -> None:
            self._log.observe(genie.name, record, "edge" if role == "remote" else "car", self.env.now)

        detector = f"{place}/{DETECTOR}"
        genie = attach_genie(graph, detector, make, self.scenario.queue_length, observe, self._log.dropped)
        self.resources.append(genie)
        return genie

    def _join_car(self, car: Car, graph: Graph, *topics: str) -> None:
        """The car and its edge become one virtual network. ``topics``: what goes up, and what comes down to."""
        up_topic, down_topic = topics
        self._uplinks[car.name] = _Uplink(self, car, graph, (up_topic, down_topic))

    def bridges(self, car: Car, graph: Graph, edge: _Edge, down_topic: str) -> tuple[Bridge, Bridge]:
        """What carries a car's frames up to an edge, and the answers to them down."""
        assert car.link is not None, "a car with an edge has a link"
        up = self._link(f"{car.name}->{edge.name}", car.link, up=True)
        down = self._link(f"{edge.name}->{car.name}", car.link, up=False)
        sent, received = partial(self._log.carried, "bytes_up"), partial(self._log.carried, "bytes_down")
        lost = partial(self._lost, f"{car.name}:hand_over")
        upwards = Bridge(up, edge.graph, IMAGES, f"{edge.name}/{DETECTOR}", sent, lost)
        downwards = Bridge(down, graph, down_topic, f"{car.name}/genie", received, lost)
        edge.downlinks.of_car[car.name] = downwards
        return upwards, downwards

    def _received(self, message: Message) -> None:
        """A camera's frame is in the queue of the first node that handles it."""
        self._log.received(message.header, self.env.now)

    def _lost(self, where: str, message: Message) -> None:
        self._log.dropped(message, where)

    def _join_edges(self) -> None:
        """Every edge's ``-remote`` topics reach its neighbours through its port to the edge network.

        Two edges are neighbours unless one of them names its own and leaves the other out.
        """
        named = {edge.name: edge.neighbours for edge in self.scenario.edges}
        order = {name: place for place, name in enumerate(self.edges)}
        for edge in self.edges.values():
            port = self._link(f"{edge.name}->{EDGES}", self.scenario.edge_network, up=True)
            theirs = named[edge.name]
            wanted = self.edges if theirs is None else sorted(theirs, key=order.__getitem__)
            for name in wanted:
                other, back = self.edges[name], named[name]
                if other is not edge and (back is None or edge.name in back):
                    # An edge without detector has nothing of its own to answer neighbours with; it only listens.
                    topics = (IMAGES + REMOTE, OBJECTS + REMOTE) if other.detector is not None else (OBJECTS + REMOTE,)
                    for topic in topics:
                        edge.graph.bridge(topic, Bridge(port, other.graph, topic, f"{other.name}/genie"))

    def _link(self, name: str, profile: LinkProfile, up: bool) -> Link:
        rng = stream(self.scenario.seed, name)
        link = Link(self.env, name, profile, up, rng, self.scenario.queue_length, self._log.dropped)
        self.resources.append(link)
        return link

    def _published(self, image: Image, number: int, lap: int) -> None:
        assert self._truth is not None
        self._truth.published(image)
        self._log.published(image, number, lap)

    def _answered(self, car: Car, answer: Detections, now_ns: int) -> None:
        source = self._source(car, answer)
        self._log.answered(answer, source, now_ns)
        if self._truth is not None:
            self._truth.answered(answer, source)

    def _source(self, car: Car, answer: Detections) -> str:
        """Where an answer comes from, seen from the car at this moment."""
        place = answer.served_by.split("/")[0]
        if answer.source == "map":
            return "map"
        uplink = self._uplinks.get(car.name)
        whose = "own" if place == car.name else "edge" if uplink is not None and place == uplink.edge else "peer"
        if answer.source == "detector":
            return "own_detector" if whose == "own" else "edge_detector"
        return f"{whose}_cache"

    def _sampler(self, progress: Callable[[int, int], None] | None) -> Process:
        while True:
            self._log.sample(self._sampled, self.env.now)
            if progress is not None:
                progress(min(self.env.now, self._end_ns), self._end_ns)
            yield self.env.timeout(SAMPLE_NS)


class _Watch:
    """Notes when a camera's frame is there for the first node that handles it; takes no time and changes nothing."""

    def __init__(self, graph: Graph, note: Callable[[Message], None]) -> None:
        self.address = f"{graph.name}/log"
        self._note = note
        graph.subscribe(IMAGES, self)

    def deliver(self, topic: str, message: Message, sender: str) -> None:
        self._note(message)
