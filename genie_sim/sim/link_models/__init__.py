"""Link models: how long a message occupies a link, when it arrives, and whether it is lost. One
file each.

A model whose links do not affect each other is a ``LinkModel``: it says how long each message
takes. A model whose links share something, or that must know where a car is, is a ``Medium``. To
add one, write a frozen dataclass with the method of its kind and name it here (or in a scenario as
``package.module:Class``). Its arguments are its settings in YAML.
"""

from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from genie_sim.base.seeds import Draws
from genie_sim.sim.monitor import Resource

if TYPE_CHECKING:
    import simpy

    from genie_sim.sim.clock import Clock
    from genie_sim.sim.link_models.message_random import MessageRandom

LINK_MODELS: dict[str, str] = {
    "wire": "genie_sim.sim.link_models.wire:Wire",
    "trace": "genie_sim.sim.link_models.trace:RecordedLink",
    "cell": "genie_sim.sim.link_models.cell:RadioCell",
}


class Channel(Protocol):
    """One direction of one link."""

    def occupied_ns(self, size_bytes: int, now_ns: int) -> int:
        """How long [ns] a message of ``size_bytes``, which begins its way ``now_ns``, keeps the
        sender busy; not negative.
        """

    def delay_ns(self, size_bytes: int, now_ns: int) -> int | None:
        """How long [ns] a message of ``size_bytes`` takes from ``now_ns``, when its last bit has
        left, until it arrives; not negative. ``None`` if it is lost.
        """


class LinkModel(Protocol):
    """What a scenario says about a link."""

    def channel(self, up: bool, rng: "MessageRandom") -> Channel:
        """One direction of a link, which is made anew for every run and method.

        Parameters
        ----------
        up : bool
            Whether it leads from a car to its edge, or from an edge into the edge network.
        rng : MessageRandom
            Random numbers of its own: those of the message that is sent, as from a NumPy generator.
        """


class LinkEnds(NamedTuple):
    """One direction of a link: its ``name``, ``FROM->TO``, and whose it is. ``car`` is ``None`` in
    the network between edges.
    """

    name: str
    car: str | None
    edge: str
    up: bool


class Air(Protocol):
    """What a medium knows of the world."""

    @property
    def clock(self) -> "Clock":
        """The run's clock."""

    @property
    def edges(self) -> tuple[str, ...]:
        """Every edge by name."""

    def stream(self, *names: str | int) -> np.random.Generator:
        """The random generator of these names: the same under every method."""

    def draws(self, *names: str | int) -> Draws:
        """The random numbers of these names, by key."""

    def place(self, car: str) -> tuple[float, float]:
        """Where a car is now: east and north [m]."""

    def site(self, edge: str) -> tuple[float, float] | None:
        """Where an edge is: east and north [m]; ``None`` if the scenario does not say."""

    def add_resource(self, resource: Resource) -> None:
        """Adds something whose use is sampled."""


class Sender(Protocol):
    """What carries the messages of one direction of a link, one after the other.

    If it has an attribute ``random``, a ``MessageRandom``, this is told which message is sent.
    """

    def sent(self, size_bytes: int) -> "simpy.Event":
        """Sends a message; happens when its last bit has left."""

    def delay_ns(self, size_bytes: int, now_ns: int) -> int | None:
        """How long the message takes from now, when its last bit has left, until it arrives;
        ``None`` if it is lost.
        """

    def set_up(self, is_up: bool) -> None:
        """The link goes down or comes back, by a fault or a hand-over."""


class Radio(Protocol):
    """A medium in one run of one method: all of its state."""

    def sender(self, ends: LinkEnds) -> Sender:
        """What carries one direction of a link."""


class Medium(Protocol):
    """What a scenario says about links that share something.

    ``needs_sites = True``: every edge must say where it is; ``needs_cars = True``: it cannot be the
    network between edges. With a method ``check``, which raises ``UserError``, it looks at its
    files before anything runs; ``digests`` gives what of them decides the outcome, by name.
    """

    def radio(self, air: Air) -> Radio:
        """A radio for one run of one method."""
