"""Links whose messages take the times of a channel."""

from typing import TYPE_CHECKING

import simpy

from genie_sim.sim.link_models import Air, Channel, LinkEnds, LinkModel, Medium, Radio, Sender

if TYPE_CHECKING:
    from genie_sim.sim.clock import Clock


class ChannelSender:
    """Sends by the times of a channel."""

    def __init__(self, clock: "Clock", channel: Channel) -> None:
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
        channel = self._model.channel(ends.up, self._air.stream(ends.name))
        return ChannelSender(self._air.clock, channel)


def make_radio(model: LinkModel | Medium, air: Air) -> Radio:
    """The radio of a link model of either kind."""
    make = getattr(model, "radio", None)
    return ChannelRadio(model, air) if make is None else make(air)  # type: ignore[arg-type]
