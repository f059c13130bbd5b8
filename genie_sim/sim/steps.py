"""Where the time of a frame goes: a clock with which each call knows the steps that led to it.

Every delay of a run is a call at a later time (``Clock.after``): a step on the way of the frame that ordered it.
Whoever keeps messages waiting keeps their ways beside them and goes on with ``waited``. A step begins where the one
before it ends, so the steps of an answer add up to its response time.
"""

from collections.abc import Callable
from typing import Any

from genie_sim.messages import Header
from genie_sim.monitor import Step
from genie_sim.sim.clock import Clock
from genie_sim.sim.device import Processor
from genie_sim.sim.link import Bridge, Link
from genie_sim.sim.ros_graph import Graph


class StepClock(Clock):
    """A clock that follows every frame; nothing happens at another time, or in another order, because of it."""

    def begin(self, header: Header) -> None:
        self.way = Step("", "", self.now, None, header)

    def waited(self, way: Step | None, part: str, place: str) -> None:
        self.way = (
            way
            if way is None or way.end_ns == self.now
            else Step(part, place, self.now, way, way.header)
        )

    def after(self, delay_ns: int, call: Callable[..., None], *arguments: Any) -> None:
        if self.way is None:
            super().after(delay_ns, call, *arguments)
        else:
            super().after(delay_ns, self._go_on, self.way, call, arguments)

    def _go_on(self, way: Step, call: Callable[..., None], arguments: tuple[Any, ...]) -> None:
        self.waited(way, *_step(call, arguments))
        call(*arguments)
        self.way = None


def _step(call: Callable[..., None], arguments: tuple[Any, ...]) -> tuple[str, str]:
    """What took its time until this call, and where."""
    owner = getattr(call, "__self__", None)
    if isinstance(owner, Processor):  # a node's job
        _, done, _ = arguments
        return done.__self__.part, done.__self__.name
    if isinstance(owner, Graph):
        return "hop", owner.name
    link = owner.link if isinstance(owner, Bridge) else owner
    if isinstance(link, Link):
        return link.part, link.name
    return "pending", getattr(owner, "name", "")
