"""What a link model is: a class that makes the transmitters of links, one for each direction.

To add one, write a class with ``transmitter``, put it into a file of ``genie_sim/links`` and name
it here (or in a scenario as ``package.module:Class``). Its arguments are its settings in YAML.
"""

from typing import TYPE_CHECKING, NamedTuple, Protocol

from genie_sim.base.contracts import whole
from genie_sim.base.plugins import Choice
from genie_sim.base.settings import PlugIn, Presets
from genie_sim.sim.message_random import MessageRandom

if TYPE_CHECKING:
    import simpy

    from genie_sim.sim.network import Network

LINK_MODELS: dict[str, str] = {
    "wire": "genie_sim.links.wire:Wire",
    "trace": "genie_sim.links.recorded:RecordedLink",
    "cell": "genie_sim.links.cell:RadioCell",
}
# Marks a setting that is a link: a name; a mapping, with ``like`` for what it leaves out; or a
# mapping with a ``model`` and its settings.
LINK = PlugIn(
    "link model",
    LINK_MODELS,
    ("transmitter",),
    key="model",
    default="wire",
    presets=Presets("link", "genie_sim.links.presets:LINKS", "ethernet_1g"),
)


def usual_link() -> Choice:
    """The link where a scenario names none."""
    assert LINK.presets is not None
    return LINK.presets.get(LINK.presets.usual)


class LinkEnds(NamedTuple):
    """One direction of a link: its ``name``, ``FROM->TO``, and whose it is. ``car`` is ``None`` in
    the network between edges; ``up`` leads from a car to its edge, or from an edge into the network
    between edges.
    """

    name: str
    car: str | None
    edge: str
    up: bool


class LinkModel(Protocol):
    """What a scenario says about links. It is made anew for every run and method. Cars' links with
    equal settings have one: what they share is kept in it. The network between edges has its own.

    ``needs_sites = True``: every edge must say where it is; ``needs_cars = True``: it cannot be the
    network between edges. With a method ``check``, which raises ``UserError``, it looks at its
    files before anything runs; ``digests`` gives what of them decides the outcome, by name.
    """

    def transmitter(self, network: "Network", ends: LinkEnds) -> "Transmitter":
        """What carries one direction of a link. The ``network`` has the clock, random numbers, the
        places of cars and edges, and ``add_resource`` for what is to be sampled.
        """


class Transmitter:
    """Carries the messages of one direction of a link, one after the other: ``transmit`` and
    ``delay_ns``. One that shares nothing with other links is a ``TimedTransmitter``.

    ``random`` has the random numbers of the message that is sent.

    Parameters
    ----------
    network : Network
        Where the link is.
    ends : LinkEnds
        Which direction of which link.
    """

    def __init__(self, network: "Network", ends: LinkEnds) -> None:
        self.clock = network.clock
        self.random = MessageRandom(network, ends.name)

    def transmit(self, size_bytes: int) -> "simpy.Event":
        """Sends a message of ``size_bytes``; happens when its last bit has left."""
        raise NotImplementedError

    def delay_ns(self, size_bytes: int, now_ns: int) -> int | None:
        """How long [ns] a message of ``size_bytes`` takes from ``now_ns``, when its last bit has
        left, until it arrives; not negative. ``None`` if it is lost.
        """
        raise NotImplementedError

    def set_available(self, is_available: bool) -> None:
        """A fault or a hand-over takes the link away, or gives it back. By itself nothing changes:
        what is on its way then still takes its time.
        """


class TimedTransmitter(Transmitter):
    """Of one link alone: a message keeps it busy for a time that is known at its beginning."""

    def occupied_ns(self, size_bytes: int, now_ns: int) -> int:
        """How long [ns] a message of ``size_bytes``, which begins its way ``now_ns``, keeps the
        transmitter busy; not negative.
        """
        raise NotImplementedError

    def transmit(self, size_bytes: int) -> "simpy.Event":
        occupied_ns = self.occupied_ns(size_bytes, self.clock.now)
        return self.clock.timeout(whole(self, "occupied_ns()", occupied_ns))
