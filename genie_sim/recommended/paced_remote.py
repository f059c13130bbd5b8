"""Paced remote execution: the edge's detector answers as many frames as the way up carries.

Remote execution with the pacing of the recommended Genie, and without its map: a frame goes up if
the way is free, else nobody looks at it. It needs a consumer that predicts between answers.
"""

from dataclasses import dataclass
from functools import partial
from typing import Annotated

from genie_sim.base.marks import Bounds, Count
from genie_sim.base.units import NS_PER_MS
from genie_sim.core.messages import Effect, Expired, Image, Message, Publish
from genie_sim.methods.remote import Remote
from genie_sim.recommended.pacing import Pacer
from genie_sim.sim.method import (
    REMOTE,
    REMOTE_UPLINK,
    Costs,
    HostConfig,
    HostContext,
    LocalAndRemote,
)


@dataclass(frozen=True)
class PacedRemote(Remote):
    """Each car's frames go to its edge's detector while few enough are on their way."""

    title = "paced remote"

    every_ns: int = 0
    """As that of `recommended`."""

    in_flight: Count = 1
    """As that of `recommended`."""

    stale_ns: Annotated[int, Bounds(above=0)] = 500 * NS_PER_MS
    """As that of `recommended`."""

    def on_car(self, host: HostContext) -> HostConfig | None:
        if not host.gets_images:
            return None
        if not host.has_edge:
            return HostConfig()
        return HostConfig(
            interceptor=partial(self._sender, host), uplink=REMOTE_UPLINK, costs=Costs(is_free=True)
        )

    def _sender(
        self, host: HostContext, inputs: tuple[str, ...], outputs: tuple[str, ...]
    ) -> "PacedSender":
        pacer = Pacer(every_ns=self.every_ns, in_flight=self.in_flight, stale_ns=self.stale_ns)
        return PacedSender(f"{host.name}/sender", pacer, inputs, outputs)


class PacedSender(LocalAndRemote):
    """Sends a frame up if its pacer lets it, and passes the answers on."""

    def __init__(self, name: str, pacer: Pacer, *topics: tuple[str, ...]) -> None:
        super().__init__(name, *topics)
        self._pacer = pacer

    def on_message(
        self, topic: str, message: Message, now_ns: int, sender: str | None = None
    ) -> list[Effect]:
        effects: list[Effect] = [Expired(loss.header) for loss in self._pacer.expire(now_ns)]
        if topic != self._images:
            arrival = self._pacer.answered(message.header, now_ns)
            effects += [Expired(loss.header) for loss in arrival.losses]
            return [*effects, Publish(self._objects, message)]
        assert isinstance(message, Image)
        if self._pacer.dispatch(message.header, message.pose.heading_rad, now_ns) is None:
            return [*effects, Expired(message.header)]
        return [*effects, Publish(self._images + REMOTE, message)]

    def next_deadline_ns(self) -> int | None:
        return self._pacer.next_deadline_ns()

    def on_deadline(self, now_ns: int) -> list[Effect]:
        return [Expired(loss.header) for loss in self._pacer.expire(now_ns)]
