"""What a method puts on a host: the seam between the world and the schemes that are compared in it.

A method says, for every car and every edge, whether a detector runs there, which interceptor stands
before it, and which topics reach whom. The world builds that, in the same way for every method.

To add one, write a class like ``Method``, put it into a file of ``genie_sim/methods`` and name it
in ``METHODS`` (or in a scenario as ``package.module:Class``).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, Protocol

from genie_sim.base.seeds import Draws
from genie_sim.core.messages import Effect, Message, Observation
from genie_sim.core.rules import GenieRules
from genie_sim.tracks.laws import DetectorLaws

if TYPE_CHECKING:
    from genie_sim.sim.network import Network

IMAGES = "/image_raw"
OBJECTS = "/detection/image_detector/objects"
LOCAL = "-local"  # suffix of the topics between an interceptor and the detector behind it
REMOTE = "-remote"  # suffix of the topics between a car and its edge, and between edges
DETECTOR = "vision_darknet_detect"

# Each method by its name in a scenario, which may also name ``package.module:Class``.
METHODS: dict[str, str] = {
    "local": "genie_sim.methods.local:Local",
    "remote": "genie_sim.methods.remote:Remote",
    "paced_remote": "genie_sim.recommended.paced_remote:PacedRemote",
    "genie": "genie_sim.methods.genie:Genie",
    "recommended": "genie_sim.recommended.method:Recommended",
    "central": "genie_sim.methods.central:Central",
    "sim_lru": "genie_sim.methods.sim_lru:SimLRU",
    "rnd_lru": "genie_sim.methods.sim_lru:RndLRU",
    "potluck": "genie_sim.methods.potluck:Potluck",
    "foggycache": "genie_sim.methods.foggycache:FoggyCache",
    "cachier": "genie_sim.methods.cachier:Cachier",
    "deadline": "genie_sim.methods.deadline:Deadline",
    "oracle": "genie_sim.methods.oracle:Oracle",
}
DEFAULT_METHODS = ("local", "remote", "genie")  # what a scenario compares if it does not say
METHOD_PARTS = ("title", "baseline", "on_car", "on_edge")


class Interceptor(Protocol):
    """A pure node, such as a Genie: messages in, effects out. It has no clock and no middleware of
    its own.

    A class that inherits from this one has no deadlines and no state to lose, unless it says so.
    """

    name: str

    def subscriptions(self) -> tuple[str, ...]:
        """The topics whose messages it gets, each by its name."""
        ...

    def publications(self) -> tuple[str, ...]:
        """The topics on which it publishes."""
        ...

    def on_message(
        self, topic: str, message: Message, now_ns: int, sender: str | None = None
    ) -> list[Effect]:
        """What it does about a message: publishes some, and tells what it has looked up.

        Parameters
        ----------
        topic : str
            One of its ``subscriptions``.
        message : Message
            An ``Image`` or ``Detections``; it must not be changed.
        now_ns : int
            Simulated time [ns].
        sender : str, optional
            The node that published it, of this host or another one, such as ``car1/camera_02`` or
            ``edge2/genie``: what ``Publish(to=...)`` takes. ``None`` where real ROS does not tell.
        """
        ...

    def next_deadline_ns(self) -> int | None:
        """When ``on_deadline`` wants to be called if no message arrives before [ns], ``None`` for
        never.
        """
        return None

    def on_deadline(self, now_ns: int) -> list[Effect]:
        """Called at or after the instant that ``next_deadline_ns`` returned; ``now_ns`` is the
        simulated time [ns].
        """
        return []

    def cache_entries(self) -> int:
        """The number of entries that a look-up searches, if ``Costs.per_entry_ns`` charges for
        each.
        """
        return 0

    def on_memory_lost(self) -> Sequence[Observation]:
        """A fault takes its state: each request that it owes an answer is ``Expired``, its objects
        ``Forgotten``.
        """
        return ()


class LocalAndRemote(Interceptor):
    """The base of a car's interceptor that sends images to the car's own detector or up to the
    edge, and gets answers from both.

    Parameters
    ----------
    name : str
        Of the node, such as ``car1/router``.
    inputs, outputs : tuple of str
        T_S and T_P of the car's detector: one topic each.
    """

    def __init__(self, name: str, inputs: tuple[str, ...], outputs: tuple[str, ...]) -> None:
        self.name = name
        (self._images,) = inputs
        (self._objects,) = outputs

    def subscriptions(self) -> tuple[str, ...]:
        return self._images, self._objects + LOCAL, self._objects + REMOTE

    def publications(self) -> tuple[str, ...]:
        return self._objects, self._images + LOCAL, self._images + REMOTE


# Makes an interceptor from T_S and T_P, the topics of the node behind it.
MakeInterceptor = Callable[[tuple[str, ...], tuple[str, ...]], Interceptor]


@dataclass(frozen=True)
class HostContext:
    """What a method gets to know of a host: a car or an edge.

    Parameters
    ----------
    name : str
        The car's or edge's name in the scenario.
    gets_images : bool
        Whether images arrive here, from the host's own cameras or from cars; if not, only positions
        do.
    has_edge : bool
        Whether the car is connected to an edge; true of every edge.
    genie : GenieRules or None
        The rules of Genies on this host; ``None`` where the scenario wants none.
    draws : callable
        Returns the host's random numbers of these names, by key (``base.seeds.Draws``).
    names_changes : bool
        Whether observations are to name the objects of a map that changed.
    laws : DetectorLaws
        The detectors' laws, as maps that weigh evidence take them to be.
    edges : tuple of str
        All edges, in the scenario's order.
    neighbours : sequence of str
        The edges that this edge is connected to; empty for a car.
    is_one_world : bool
        Whether what one car sees is there for the others: all are in one world at one time.
    """

    name: str
    gets_images: bool
    has_edge: bool
    genie: GenieRules | None
    draws: Callable[..., Draws]
    names_changes: bool
    laws: DetectorLaws
    edges: tuple[str, ...]
    neighbours: Sequence[str] = ()
    is_one_world: bool = True

    @property
    def rules(self) -> GenieRules:
        """The rules of its Genie, where there is to be one."""
        assert self.genie is not None, f"{self.name} has no Genie"
        return self.genie


class UplinkTopics(NamedTuple):
    """What goes up from a car to the images of its edge, and the topic on which the edge's answers
    come down.
    """

    up: str
    down: str


DIRECT_UPLINK = UplinkTopics(IMAGES, OBJECTS)
REMOTE_UPLINK = UplinkTopics(IMAGES + REMOTE, OBJECTS + REMOTE)


@dataclass(frozen=True)
class Costs:
    """What the messages of an interceptor cost: CPU time of its host. By itself each one that comes
    takes the Genie time of the device profile.

    Parameters
    ----------
    is_free : bool
        Whether nothing costs anything, as under a bound.
    key : str or None
        The feature that is computed of every image, which takes its time first. Whoever gets the
        image from the interceptor gets the feature, too.
    per_entry_ns : int
        CPU time [ns] that the search for such a key takes for each entry of the cache.
    relay_time_ns : int or None
        CPU time [ns] of every message that comes, but for images with a ``key``, where the Genie
        time is that of the answers of its own making alone.
    passes : {1, 2}
        With 2, answers of its own making take the Genie time, too, before they leave. Set by the
        scenario (``genie.passes``), whatever a method says.
    """

    is_free: bool = False
    key: str | None = None
    per_entry_ns: int = 0
    relay_time_ns: int | None = None
    passes: int = 1

    @property
    def charge_answers(self) -> bool:
        """Whether an answer of the interceptor's own making takes time before it leaves."""
        return not self.is_free and (self.passes == 2 or self.relay_time_ns is not None)


@dataclass(frozen=True)
class HostConfig:
    """What a method puts on a host.

    Parameters
    ----------
    detector : bool
        Whether a detector runs here.
    interceptor : callable or None
        Makes the interceptor that takes over the topics of the detector, or their names where none
        runs.
    uplink : UplinkTopics or None
        Connects a car to its edge.
    neighbour_topics : tuple of str
        What neighbouring edges publish on these topics reaches this edge.
    costs : Costs
        What the interceptor's messages cost.
    is_beside : bool
        Whether the interceptor leaves the detector its topics, and only listens and speaks there.
    """

    detector: bool = False
    interceptor: MakeInterceptor | None = None
    uplink: UplinkTopics | None = None
    neighbour_topics: tuple[str, ...] = ()
    costs: Costs = Costs()
    is_beside: bool = False


class Method:
    """A scheme that answers the cars' frames. Others are compared with the best ``baseline``.

    A class that inherits from this one is no baseline and puts a detector on every edge that gets
    images, unless it says so.
    """

    title: str
    baseline = False

    def on_car(self, host: HostContext) -> HostConfig | None:
        """What runs on a car, of which ``host`` tells; ``None`` if nothing would answer it: it is
        then left out.
        """
        raise NotImplementedError

    def on_edge(self, host: HostContext) -> HostConfig:
        """What runs on an edge server, of which ``host`` tells."""
        return HostConfig(detector=host.gets_images)

    def wire(self, network: "Network") -> None:
        """Adds what else connects the hosts, once all of them are built: links by
        ``network.add_link``; what goes over them by ``add_bridge`` of a graph, or by
        ``also_send_over`` of a connection.
        """
