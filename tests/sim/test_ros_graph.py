"""Topics, bounded queues, remapping, attaching a Genie, and bridges between graphs."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from genie_sim.core.messages import Header
from genie_sim.links.wire import Wire
from genie_sim.runs.build import device as built_device
from genie_sim.sim.clock import Clock
from genie_sim.sim.host import Host
from genie_sim.sim.link import Bridge, Link
from genie_sim.sim.method import HostConfig, Interceptor
from genie_sim.sim.nodes import attach
from genie_sim.sim.ros_graph import Graph, Node, Subscriber
from genie_sim.sim.topology import EdgeServer
from tests.make import fixed_device
from tests.sim.processes import DOWN, UP, transmitter

WORK_NS = 1000
HOP_NS = 10


class Note:
    """A message of one byte."""

    size_bytes = 1

    def __init__(self, number: int) -> None:
        self.header = Header(number, "camera_02", "car1")


class Clerk(Node):
    """A node that needs ``WORK_NS`` for a note and writes down when it was done with which, and on
    which topic.
    """

    def __init__(self, *arguments, **settings) -> None:
        super().__init__(*arguments, **settings)
        self.done: list[tuple[int, int, str]] = []

    def work(self, topic, message, sender):
        yield self.clock.timeout(WORK_NS)

    def handle(self, topic: str, message, sender: str) -> None:
        self.done.append((self.clock.now, message.header.stamp_ns, topic))


class Listener(Subscriber):
    """Writes down all that reaches it."""

    def __init__(self, address: str = "listener") -> None:
        self.address = address
        self.heard: list[tuple[str, int, str]] = []

    def deliver(self, topic: str, message, sender: str) -> None:
        self.heard.append((topic, message.header.stamp_ns, sender))


def office(name: str = "car1", clock: Clock | None = None, **settings) -> Graph:
    """An empty graph of a host on which each message takes ``HOP_NS`` to the next node."""
    clock = clock if clock is not None else Clock()
    device = fixed_device(name, detector="1 ms", hop=f"{HOP_NS} ns", per_megabyte="0 ms")
    return Graph(
        Host(clock, name, built_device(device, "autoware_vision_detector"), seed=1), **settings
    )


def link(clock: Clock, name: str, up: bool = True) -> Link:
    """One direction of a gigabit Ethernet."""
    wire = Wire(1_000_000_000, 1_000_000_000, delay_ns=200_000)
    return Link(clock, name, transmitter(wire, UP if up else DOWN, clock=clock))


def clerk(
    name: str = "clerk", topics: tuple[str, ...] = ("/notes",), threads: int = 1, **settings
) -> Clerk:
    node = Clerk(name, office(**settings), topics, (), threads=threads)
    node.clock.run(node.clock.timeout(0))  # its threads wait for messages
    return node


def inject(node: Clerk, *topics: str) -> None:
    """Numbered notes at once, on these topics; then all that follows."""
    for number, topic in enumerate(topics):
        node.graph.inject(topic, Note(number), "sender")
    node.clock.run()


# Queues


def test_the_newest_notes_are_kept_and_the_others_counted():
    dropped: list[tuple[int, str]] = []
    node = clerk(dropped=lambda note, where: dropped.append((note.header.stamp_ns, where)))
    inject(node, *["/notes"] * 5)
    assert [number for _, number, _ in node.done] == [0, 4], "the first was at work already"
    assert dropped == [(1, "clerk:/notes"), (2, "clerk:/notes"), (3, "clerk:/notes")]
    assert (node.completed, node.drops, node.queued) == (2, 3, 0)


def test_of_a_longer_queue_the_oldest_goes_first():
    node = clerk(queue_length=2)
    inject(node, *["/notes"] * 5)
    assert [number for _, number, _ in node.done] == [0, 3, 4]


def test_topics_do_not_push_each_other_out_and_are_served_in_order_of_arrival():
    node = clerk(topics=("/a", "/b"))
    inject(node, "/a", "/b", "/a", "/b", "/a")
    assert node.done == [(WORK_NS, 0, "/a"), (2 * WORK_NS, 3, "/b"), (3 * WORK_NS, 4, "/a")]
    assert node.drops == 2


def test_a_graph_is_busy_as_long_as_one_of_its_nodes_is():
    graph = office()
    assert not graph.is_busy, "nobody is there"
    for name in ("clerk", "idle"):
        Clerk(name, graph, (f"/{name}",), ())
    graph.clock.run(graph.clock.timeout(0))
    graph.inject("/clerk", Note(0), "sender")
    graph.clock.run(until=WORK_NS // 2)
    assert graph.is_busy
    graph.clock.run()
    assert not graph.is_busy


def test_threads_work_at_the_same_time():
    node = clerk(threads=3)
    inject(node, *["/notes"] * 4)
    assert [at_ns for at_ns, *_ in node.done] == [WORK_NS] * 3 + [2 * WORK_NS]
    assert node.drops == 0


@given(
    st.lists(
        st.tuples(st.integers(0, 10 * WORK_NS), st.sampled_from(("/a", "/b"))),
        min_size=1,
        max_size=40,
    ),
    st.integers(1, 4),
    st.integers(1, 3),
)
def test_every_note_is_done_or_dropped_and_no_queue_grows_beyond_its_length(
    notes, queue_length: int, threads: int
):
    dropped: list[int] = []
    node = clerk(
        topics=("/a", "/b"),
        queue_length=queue_length,
        threads=threads,
        dropped=lambda note, where: dropped.append(note.header.stamp_ns),
    )
    for number, (at_ns, topic) in enumerate(notes):

        def arrive(_, number=number, topic=topic) -> None:
            node.graph.inject(topic, Note(number), "sender")

        node.clock.timeout(at_ns).callbacks.append(arrive)
    while node.clock.peek() != float("inf"):
        node.clock.step()
        assert node.queued <= 2 * queue_length
    done = [number for _, number, _ in node.done]
    assert sorted(done + dropped) == list(range(len(notes)))
    assert (node.completed, node.drops, node.queued) == (len(done), len(dropped), 0)
    if threads == 1:
        arrived_ns = [notes[number][0] for number in done]
        assert arrived_ns == sorted(arrived_ns), "what has waited longest is served first"


# Topics


def test_a_message_reaches_all_other_subscribers_after_one_hop():
    graph = office()
    publisher = Clerk("publisher", graph, ("/notes",), ("/notes",))
    others = [Clerk(name, graph, ("/notes",), ()) for name in ("first", "second")]
    publisher.publish("/notes", Note(7))
    graph.clock.run()
    assert [one.done for one in others] == [[(HOP_NS + WORK_NS, 7, "/notes")]] * 2
    assert publisher.done == []


def test_a_reply_reaches_the_one_it_is_meant_for():
    graph = office()
    publisher = Clerk("publisher", graph, (), ("/notes",))
    listeners = [Listener("first"), Listener("second")]
    for listener in listeners:
        graph.subscribe("/notes", listener)
    publisher.publish("/notes", Note(7), to="second")
    graph.clock.run()
    assert [listener.heard for listener in listeners] == [[], [("/notes", 7, "publisher")]]


# Remapping and attaching


def test_a_remapped_node_talks_on_other_topics_under_its_old_names():
    graph = office()
    node = Clerk("node", graph, ("/in",), ("/out",))
    old, new = Listener(), Listener()
    graph.subscribe("/out", old)
    graph.subscribe("/out-local", new)
    graph.remap("node", {"/in": "/in-local", "/out": "/out-local"})
    graph.inject("/in", Note(1), "sender")
    graph.inject("/in-local", Note(2), "sender")
    node.publish("/out", Note(3))
    graph.clock.run()
    assert [number for _, number, _ in node.done] == [2]
    assert (old.heard, new.heard) == ([], [("/out-local", 3, "node")])
    assert (node.subscribes, node.publishes) == (("/in",), ("/out",))
    assert graph.topics_of("node") == (("/in-local",), ("/out-local",))


def test_any_node_can_be_encapsulated_whatever_its_topics():
    told: list[tuple[tuple[str, ...], tuple[str, ...]]] = []

    class NothingToDo(Interceptor):
        name = "car1/genie"

        def subscriptions(self) -> tuple[str, ...]:
            return ("/clouds",)

        def publications(self) -> tuple[str, ...]:
            return ("/lanes", "/signs")

    def make(subscribed, published):
        told.append((subscribed, published))
        return NothingToDo()

    graph = office()
    Clerk("lanes", graph, ("/clouds", "/map"), ("/lanes", "/signs"))
    attach(graph, "lanes", make, lambda genie, record, now_ns: None, suffix="_local")
    assert told == [(("/clouds", "/map"), ("/lanes", "/signs"))]
    assert graph.topics_of("lanes") == (
        ("/clouds_local", "/map_local"),
        ("/lanes_local", "/signs_local"),
    )


# Bridges


class Offices:
    """Three graphs, each bridged to the two others on ``/notes``, all over one port a graph."""

    def __init__(self) -> None:
        self.clock = Clock()
        self.graphs, self.ports, self.listeners, self.nodes = {}, {}, {}, {}
        names = ("edge1", "edge2", "edge3")
        for name in names:
            self.graphs[name] = office(name, self.clock)
            self.nodes[name] = Clerk(f"{name}/genie", self.graphs[name], ("/notes",), ("/notes",))
            self.listeners[name] = Listener(f"{name}/listener")
            self.graphs[name].subscribe("/notes", self.listeners[name])
            self.ports[name] = link(self.clock, f"{name}->edges")
        for name in names:
            for other in names:
                if other != name:
                    bridge = Bridge(
                        self.ports[name],
                        self.graphs[other],
                        topic="/notes",
                        address=f"{other}/genie",
                    )
                    self.graphs[name].add_bridge("/notes", bridge)


def test_what_came_over_a_bridge_is_not_bridged_on():
    """No storms: a note published on one edge crosses the network once to each other edge, and no
    further.
    """
    three = Offices()
    three.nodes["edge1"].publish("/notes", Note(7))
    three.clock.run()
    assert {
        name: len(listener.heard) for name, listener in three.listeners.items()
    } == dict.fromkeys(three.graphs, 1)
    assert {name: port.completed for name, port in three.ports.items()} == {
        "edge1": 2,
        "edge2": 0,
        "edge3": 0,
    }


def test_a_note_for_one_neighbour_crosses_only_the_bridge_to_it():
    three = Offices()
    three.nodes["edge1"].publish("/notes", Note(7), to="edge3/genie")
    three.clock.run()
    assert [name for name, node in three.nodes.items() if node.done] == ["edge3"]
    assert three.ports["edge1"].completed == 1


def test_an_answer_goes_down_to_the_car_that_it_is_about():
    clock = Clock()
    edge = office("edge1", clock)
    server = EdgeServer(edge, HostConfig())
    edge.add_bridge("/objects", server)
    heard = {}
    for name in ("car1", "car2"):
        car = office(name, clock)
        heard[name] = Listener()
        car.subscribe("/objects", heard[name])
        down = link(clock, f"edge1->{name}", up=False)
        server.bridge_to[name] = Bridge(down, car, topic="/objects", address=f"{name}/genie")
    node = Clerk("node", edge, (), ("/objects",))
    for number, about in enumerate(("car1", "car2", "car3", "car1"), 1):
        note = Note(number)
        note.header = Header(number, "camera_02", about)
        node.publish("/objects", note)
        clock.run()
    numbers = {
        name: [number for _, number, _ in listener.heard] for name, listener in heard.items()
    }
    assert numbers == {"car1": [1, 4], "car2": [2]}


def test_a_bridge_that_was_taken_down_loses_what_comes_and_what_was_on_its_way():
    """0.2 ms of delay: the first note arrives, the second is on its way, the third comes in
    between, the last after.
    """
    clock = Clock()
    here, there = office("here", clock), office("there", clock)
    heard, lost = Listener(), []
    there.subscribe("/notes", heard)
    wire = Wire(1_000_000_000, 1_000_000_000, delay_ns=200_000)
    up = Link(clock, "link", transmitter(wire, clock=clock))
    bridge = Bridge(
        up,
        there,
        topic="/notes",
        address="there/node",
        lost=lambda note: lost.append((clock.now, note.header.stamp_ns)),
    )
    here.add_bridge("/notes", bridge)
    events = [(0, Note(1)), (300_000, Note(2)), (310_000, bridge.disconnect), (320_000, Note(3))]
    for at_ns, what in [*events, (330_000, bridge.reconnect), (600_000, Note(4))]:
        clock.run(until=max(at_ns, 1))
        what() if callable(what) else bridge.deliver("/notes", what, "here/node")
    clock.run()
    arrival_ns = 300_000 + transmitter(wire).occupied_ns(Note(2).size_bytes, 0) + 200_000
    assert [number for _, number, _ in heard.heard] == [1, 4]
    assert lost == [(320_000, 3), (arrival_ns, 2)]
