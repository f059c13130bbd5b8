"""Links whose messages take the times of a channel."""

from typing import TYPE_CHECKING

import simpy

from genie_sim.sim.link_models import Air, Channel, LinkEnds, LinkModel, Medium, Radio, Sender
from genie_sim.sim.link_models.message_random import MessageRandom

if TYPE_CHECKING:
    from genie_sim.sim.clock import Clock


class ChannelSender:
    """Sends by the times of a channel.

    Parameters
    ----------
    clock : Clock
        The run's clock.
    channel : Channel
        Says how long each message takes.
    random : MessageRandom or None
        The channel's random numbers; ``None`` if it has none.
    """

    def __init__(
        self, clock: "Clock", channel: Channel, random: MessageRandom | None = None
    ) -> None:
        self.random = random
        self._clock = clock
        self.occupied_ns = channel.occupied_ns
        self.delay_ns = channel.delay_ns

    def sent(self, size_bytes: int) -> simpy.Event:
        return self._clock.timeout(int(self.occupied_ns(size_bytes, self._clock.now)))

    def set_up(self, is_up: bool) -> None:
        """A message that is on its way when the link goes down still takes its time."""


class ChannelRadio:
    """The links of a ``LinkModel``, which do not affect each other."""

    def __init__(self, model: LinkModel, air: Air) -> None:
        self._model = model
        self._air = air

    def sender(self, ends: LinkEnds) -> Sender:
        random = MessageRandom(self._air, ends.name)
        channel = self._model.channel(ends.up, random)
        return ChannelSender(self._air.clock, channel, random)


def make_radio(model: LinkModel | Medium, air: Air) -> Radio:
    """The radio of a link model of either kind."""
    make = getattr(model, "radio", None)
    return ChannelRadio(model, air) if make is None else make(air)  # type: ignore[arg-type]
